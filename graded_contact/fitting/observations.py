"""Measured moduli or compliances prepared for a fit, and what a fit of them is a function of.

The unknowns are θ = (ln strengths, ln times, ln extras): see `series`. The extra of moduli is
E_eq; those of a compliance are 1/E_inf and, for a liquid, the fluidity 1/η. What is known is left
out of θ; an end value that is a sum of unknowns (E_inf of moduli, 1/E_eq of compliances) is held
by a term of great weight.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import Numbers, as_float, check_positive, check_values, is_concrete
from ..rheology.material import Prony
from ..rheology.measured import MeasuredRange
from ..rheology.shift import AbstractShift
from .series import COMPLETE, NEGLIGIBLE, Kind, Series, branches

HELD = 1e6  # weight of an end value that is known, over that of all measured values
# How far times may lie outside those of the data, before and after. Farther out strengths grow
# without effect, and a slow branch replaces E_eq, so that a solid melts just below its data.
REACH = {"frequency": (3.0, 3.0), "relaxation": (2.5, 5.0), "creep": (10.0, 5.0)}
STIFFEST = 30.0  # times the first secant modulus of creep: more shows in no measured strain
REPRESENTABLE = 1e100  # beyond this, or below its reciprocal, squares and ratios overflow
REACH_TO_KNOWN = 1e3  # on the side of a known end value, which branches have to lead up to
LAST = 1e12  # a retardation time this much beyond the data is viscous flow to rounding

Unknowns = Float[Array, " unknowns"]


class Observations(eqx.Module):
    """What was measured, with what is known beforehand.

    **Fields:**

    - `x`: angular frequencies [rad/s] or times [s], shape `(points,)`.
    - `values`: storage and loss modulus [Pa], or one channel of moduli [Pa] or compliances
      [1/Pa]; shape `(channels, points)`; 1 where nothing was measured.
    - `weights`: of the squared log residuals [1], shape `(channels, points)`.
    - `equilibrium`, `glassy`: E_eq and E_inf [Pa] where they are known.
    - `times`: given relaxation or retardation times [s], or None to find them.
    - `huber`: log residual from which on a point counts linearly, or None.
    - `kind`, `flows`: the measurement; whether a compliance is that of a liquid. Static.
    """

    x: Float[Array, " points"]
    values: Float[Array, "channels points"]
    weights: Float[Array, "channels points"]
    equilibrium: Float[Array, ""] | None
    glassy: Float[Array, ""] | None
    times: Float[Array, " times"] | None
    huber: Float[Array, ""] | None
    kind: Kind = eqx.field(static=True)
    flows: bool = eqx.field(static=True)

    @property
    def num_extras(self) -> int:
        """How many unknowns belong to no branch."""
        known = self.glassy if self.kind == "creep" else self.equilibrium
        return int(known is None) + int(self.flows)

    def num_unknowns(self, terms: int) -> int:
        """Returns the length of θ of a series of `terms` branches."""
        return terms * (2 if self.times is None else 1) + self.num_extras


def observe(
    kind: Kind,
    x: Numbers,
    channels: dict[str, tuple[Any, Numbers]],
    *,
    equilibrium: Numbers | None,
    glassy: Numbers | None,
    times: Numbers | None,
    huber: Numbers | None,
) -> Observations:
    """Returns the observations, checked.

    `channels` holds `(values, weight)` by the name of the argument that the values came in; those
    that are NaN count as not measured.
    """
    x_name, unit = ("omega", "[rad/s]") if kind == "frequency" else ("time", "[s]")
    x = as_float(x, x_name)
    if x.dtype != jnp.float64:
        raise ValueError(
            f"`{x_name}` is {x.dtype}: series over many decades are fitted in double precision. "
            "Call `jax.config.update('jax_enable_x64', True)` before creating arrays."
        )
    if x.ndim != 1 or not len(x):
        raise ValueError(f"`{x_name}` has shape {x.shape}; one axis of at least 1 is needed.")
    if kind == "frequency":
        check_positive(x_name, x, unit)
    else:
        check_values(x_name, x, f"it must be zero or a positive number {unit}", at_least=0)
    # Of a number as it was given: inside `jit` a converted one is not known.
    flows = (
        kind == "creep"
        and equilibrium is not None
        and is_concrete(equilibrium)
        and not np.any(np.asarray(equilibrium))
    )
    known = {"equilibrium": equilibrium, "glassy": glassy, "times": times, "huber": huber}
    known = {name: None if v is None else as_float(v, name) for name, v in known.items()}
    if known["equilibrium"] is not None:
        check_values(
            "equilibrium", known["equilibrium"], "zero or a positive number [Pa]", at_least=0
        )
    for name, allowed in (("glassy", "[Pa]"), ("times", "[s]"), ("huber", "[1]")):
        if (value := known[name]) is not None:
            check_positive(name, value, allowed)
    pairs = [_channel(name, *channel, x) for name, channel in channels.items()]
    data = Observations(
        x=x,
        values=jnp.stack([values for values, _ in pairs]),
        weights=jnp.stack([weights for _, weights in pairs]),
        kind=kind,
        flows=flows,
        **known,
    )
    if concrete(data):
        _check_content(data, x_name, list(channels))
    return data


def concrete(data: Observations) -> bool:
    """Returns whether all numbers of the observations are known now."""
    return all(is_concrete(leaf) for leaf in jax.tree.leaves(data))


def _channel(name, values, weight, x):
    values, weight = as_float(values, name), as_float(weight, f"weight of {name}")
    if values.shape != x.shape:
        raise ValueError(f"`{name}` has shape {values.shape}; the shape must be {x.shape}.")
    if weight.shape not in ((), x.shape):
        raise ValueError(
            f"The weight of `{name}` has shape {weight.shape}; the shape must be () or {x.shape}."
        )
    check_values(f"weight of {name}", weight, "it must be zero or positive", at_least=0)
    present = ~jnp.isnan(values)
    weights = jnp.where(present, jnp.broadcast_to(weight, x.shape), 0)
    check_values(
        name,
        jnp.where(weights > 0, values, 1),
        "its logarithm is fitted, so it must be positive; NaN, or a weight of 0, leaves it out",
        above=0,
    )
    return jnp.where(weights > 0, values, 1), weights


def _check_content(data, x_name, names):
    counts = np.sum(np.asarray(data.weights) > 0, axis=1)
    if np.sum(counts) < 2:
        raise ValueError(
            f"`{names[0].split('.')[0]}` holds {np.sum(counts)} measured value(s) of a weight "
            "above 0; at least 2 are needed."
        )
    if data.kind == "frequency" and counts[0] == 0 and data.equilibrium is None:
        raise ValueError(
            "`equilibrium=None` cannot be fitted to a loss modulus alone, which says nothing "
            "about it. Give it, or 0 for a liquid."
        )
    if data.kind != "frequency" and not np.any(np.asarray(data.x) > 0):
        raise ValueError(f"`{x_name}` holds no time after 0.")
    x = np.asarray(data.x)
    for name, measured in ((x_name, x[x > 0]), (names[0], np.asarray(data.values))):
        check_values(
            name,
            measured,
            f"a measured value lies between {1 / REPRESENTABLE:g} and {REPRESENTABLE:g}",
            at_least=1 / REPRESENTABLE,
            at_most=REPRESENTABLE,
        )
    glassy, equilibrium = data.glassy, data.equilibrium
    if glassy is not None and equilibrium is not None and float(glassy) <= float(equilibrium):
        raise ValueError(
            f"`glassy={float(glassy):g}` must exceed `equilibrium={float(equilibrium):g}`."
        )
    if data.times is not None and len(np.unique(np.asarray(data.times))) < data.times.size:
        raise ValueError("`times` holds a value twice.")


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
