"""What a material with given unknowns would have shown, and how far off the observations are.

The unknowns are θ = (ln strengths, ln times, ln extras): see `series`. The extra of moduli is
E_eq; those of a compliance are 1/E_inf and, for a liquid, the fluidity 1/η. What is known is left
out of θ; an end value that is a sum of unknowns (E_inf of moduli, 1/E_eq of compliances) is held
by a term of great weight.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import Numbers
from ..rheology.material import Prony
from ..rheology.measured import MeasuredRange
from ..rheology.shift import AbstractShift
from .observations import Observations, Unknowns
from .series import COMPLETE, NEGLIGIBLE, Series, branches

HELD = 1e6  # weight of an end value that is known, over that of all measured values
# How far times may lie outside those of the data, before and after. Farther out strengths grow
# without effect, and a slow branch replaces E_eq, so that a solid melts just below its data.
REACH = {"frequency": (3.0, 3.0), "relaxation": (2.5, 5.0), "creep": (10.0, 5.0)}
STIFFEST = 30.0  # times the first secant modulus of creep: more shows in no measured strain
REACH_TO_KNOWN = 1e3  # on the side of a known end value, which branches have to lead up to
LAST = 1e12  # a retardation time this much beyond the data is viscous flow to rounding


@eqx.filter_jit
def material_of(
    theta: Unknowns, data: Observations, poisson: Numbers, shift: AbstractShift | None = None
) -> Prony:
    """Returns the material that the unknowns stand for, in relaxation form."""
    strengths, times, extras = _unpack(theta, data)
    common = {"poisson": poisson, "shift": shift, "measured": measured_range(data)}
    if data.kind != "creep":
        equilibrium = _equilibrium(theta, data)
        return Prony(equilibrium=equilibrium, strengths=strengths, times=times, **common)
    glassy = 1 / extras[0] if data.glassy is None else data.glassy
    if data.flows:
        last = LAST * jax.lax.stop_gradient(jnp.maximum(jnp.max(data.x), jnp.max(times, initial=0)))
        strengths = jnp.append(strengths, extras[-1] * last / jnp.max(data.x))
        times = jnp.append(times, last)
    if not len(times):
        return Prony(equilibrium=glassy, strengths=strengths, times=times, **common)
    material = Prony.from_creep(glassy, strengths, _apart(times), **common)
    if data.flows:
        material = eqx.tree_at(lambda m: m.equilibrium, material, jnp.zeros_like(glassy))
    return material


def measured_range(data: Observations) -> MeasuredRange:
    """Returns the frequencies that the data cover; a time t stands for the frequency 1/t."""
    used = (data.x > 0) & jnp.any(data.weights > 0, axis=0)
    x = jax.lax.stop_gradient(data.x)
    lowest = jnp.min(jnp.where(used, x, jnp.inf))
    highest = jnp.max(jnp.where(used, x, 0))
    if data.kind != "frequency":
        lowest, highest = 1 / highest, 1 / lowest
    return MeasuredRange(jnp.stack([lowest, highest]))


def objective(theta: Unknowns, data: Observations) -> Float[Array, ""]:
    """Returns Σ w ρ(ln model - ln measured), the same as `Series.cost`, for derivatives."""
    residual = jnp.log(model(theta, data, data.x)) - jnp.log(data.values)
    squares = residual**2 / 2
    if data.huber is not None:
        size = jnp.abs(residual)
        squares = jnp.where(size <= data.huber, squares, data.huber * (size - data.huber / 2))
    cost = jnp.sum(jnp.where(data.weights > 0, data.weights * squares, 0))
    end = _known_end(data)
    if end is not None:
        strengths, _, extras = _unpack(theta, data)
        total = jnp.sum(strengths) + _start_value(theta, data, extras)
        cost = cost + HELD * jnp.sum(data.weights) * jnp.log(total / end) ** 2 / 2
    return cost


@eqx.filter_jit
def model(
    theta: Unknowns, data: Observations, x: Float[Array, " any"]
) -> Float[Array, "channels any"]:
    """Returns what a measurement of this kind at frequencies or times `x` would show."""
    strengths, times, extras = _unpack(theta, data)
    start = _start_value(theta, data, extras)
    if data.kind == "frequency":
        modulus = material_of(theta, data, 0.5).modulus(x)
        return jnp.stack([modulus.real, modulus.imag])
    ages = -x[:, None] / times
    if data.kind == "relaxation":
        return (start + jnp.exp(ages) @ strengths)[None]
    flow = extras[-1] * x / jnp.max(data.x) if data.flows else 0
    return (start - jnp.expm1(ages) @ strengths + flow)[None]


def series_of(data: Observations) -> Series:
    """Returns the least-squares problem of the observations, in NumPy."""
    x, values = np.asarray(data.x), np.asarray(data.values)
    weights = np.asarray(data.weights)
    end = _known_end(data)
    if end is not None:
        x = np.append(x, COMPLETE[data.kind])
        held = np.zeros((len(values), 1))
        held[0] = HELD * np.sum(weights)
        values = np.concatenate([values, np.full_like(held, float(end))], axis=1)
        weights = np.concatenate([weights, held], axis=1)
    rows = values.size
    first = np.arange(rows) < len(x)  # what is constant is seen by the first channel alone
    known = data.equilibrium if data.kind != "creep" else data.glassy
    least = [np.zeros(0)] if data.times is None else [np.full(data.times.shape, -np.inf)]
    start = 0.0 if known is None else float(known if data.kind != "creep" else 1 / known)
    static = [np.zeros((0, rows))]
    if data.times is not None:
        static.append(branches(data.kind, x, np.asarray(data.times))[0])
    if known is None:
        static.append(first[None].astype(float))
        stiffest = np.min(values[weights > 0]) / STIFFEST if data.kind == "creep" else 0.0
        least.append(np.log(np.maximum([stiffest], 1e-300)))
    if data.flows:
        static.append(x[None] / np.max(x))
        least.append(np.array([-np.inf]))
    reach = (
        REACH[data.kind][0] if data.glassy is None else REACH_TO_KNOWN,
        REACH[data.kind][1] if data.equilibrium is None else REACH_TO_KNOWN,
    )
    return Series(
        kind=data.kind,
        x=x,
        log_values=np.log(values).ravel(),
        weights=weights.ravel(),
        known=start * first,
        static=np.concatenate(static),
        least=np.concatenate(least),
        reach=reach,
        held=int(end is not None),
        huber=np.inf if data.huber is None else float(data.huber),
    )


def _unpack(theta, data):
    """Strengths, times and extras, each possibly empty."""
    count = len(theta) - data.num_extras
    extras = jnp.exp(theta[count:])
    if data.times is not None:
        return jnp.exp(theta[:count]), data.times, extras
    terms = count // 2
    return jnp.exp(theta[:terms]), jnp.exp(theta[terms:count]), extras


def _known_end(data):
    """The known value of a complete series: E_inf of moduli, 1/E_eq of compliances."""
    if data.kind != "creep":
        return data.glassy
    return None if data.equilibrium is None or data.flows else 1 / data.equilibrium


def _start_value(theta, data, extras):
    """The value of a series without its branches: E_eq of moduli, 1/E_inf of compliances."""
    if data.kind != "creep":
        return _equilibrium(theta, data)
    return extras[0] if data.glassy is None else 1 / data.glassy


def _equilibrium(theta, data):
    """E_eq, exactly zero where the data want none."""
    if data.equilibrium is not None:
        return data.equilibrium
    smallest = jnp.min(jnp.where(data.weights > 0, data.values, jnp.inf))
    fitted = jnp.exp(theta[-1])
    return jnp.where(fitted > 1.001 * NEGLIGIBLE * smallest, fitted, 0)


def _apart(times):
    """Retardation times of which none is another's: where a fit let two meet, 1e-6 apart."""
    meet = jnp.abs(times[:, None] - times) < 1e-7 * times
    return times * (1 + 1e-6 * jnp.sum(jnp.tril(meet, -1), axis=1))
