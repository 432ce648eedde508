"""Observations as a least-squares problem, the optimum as a material, and its derivatives.

The unknowns are θ = (ln strengths, ln times, ln extras): see `series`. The extra of moduli is
E_eq; those of a compliance are 1/E_inf and, for a liquid, the fluidity 1/η. Known values are not
part of θ; a known end value that is a sum of unknowns (E_inf of moduli, 1/E_eq of compliances) is a
term of great weight.

At the optimum θ of an objective f its gradient vanishes, so that dθ = -f_θθ⁻¹ f_θd dd for a change
dd of anything observed or known. Unknowns at a bound stay there. With more terms than the data
determine f_θθ is nearly singular: single terms then have no useful derivative, but E(ω) has.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..core.checks import Numbers, is_concrete
from ..materials.coverage import MeasuredRange
from ..materials.material import Prony
from .observations import Observations, Unknowns
from .series import COMPLETE, NEGLIGIBLE, NO_OUTLIER, Series, branches

END_WEIGHT = 1e6  # of an end value that is known, over that of all measured values
# How far times may lie outside those of the data, before and after. Farther out strengths grow
# without effect, and a slow branch replaces E_eq, so that a solid melts just below its data.
REACH = {"frequency": (3.0, 3.0), "relaxation": (2.5, 5.0), "creep": (10.0, 5.0)}
STIFFEST = 30.0  # times the first secant modulus of creep: more shows in no measured strain
REACH_TO_KNOWN = 1e3  # on the side of a known end value, which branches have to lead up to
LAST = 1e12  # a retardation time this much beyond the data is viscous flow to rounding
RIDGE = 1e-13  # relative to the diagonal of the Hessian: far below what data determine


# The problem and its material -------------------------------------------------------------------


def series_of(data: Observations, xp: Any = np) -> Series:
    """Returns the least-squares problem of the observations, in arrays of the module `xp`."""
    x, values, weights = (xp.asarray(part) for part in (data.x, data.values, data.weights))
    if data.known_end is not None:
        x = xp.append(x, COMPLETE[data.kind])
        end = xp.stack([xp.asarray(data.known_end)] * len(values))[:, None]
        values = xp.concatenate([values, end], axis=1)
        first = np.arange(len(end))[:, None] == 0
        end_weights = xp.where(first, END_WEIGHT * xp.sum(weights), 0.0)
        weights = xp.concatenate([weights, end_weights], axis=1)
    known, static = _fixed_columns(data, x, xp)
    return Series(
        kind=data.kind,
        x=x,
        log_values=xp.log(values).ravel(),
        weights=weights.ravel(),
        known=known,
        static=static,
        least=_least_static(data),
        reach=(
            REACH[data.kind][0] if data.glassy is None else REACH_TO_KNOWN,
            REACH[data.kind][1] if data.equilibrium is None else REACH_TO_KNOWN,
        ),
        num_ends=int(data.known_end is not None),
        huber=NO_OUTLIER if data.huber is None else xp.asarray(data.huber),
    )


def _fixed_columns(data, x, xp):
    """The known part of a series at `x`, and the columns of strengths whose time is not fitted."""
    rows = len(data.values) * len(x)
    constant = xp.asarray(np.arange(rows) < len(x), float)  # the first channel alone has it
    known = constant * (0.0 if data.known_start is None else xp.asarray(data.known_start))
    static = [xp.zeros((0, rows))]
    if data.times is not None:
        static.append(branches(data.kind, x, xp.asarray(data.times))[0])
    if data.known_start is None:
        static.append(constant[None])
    if data.flows:
        static.append(x[None] / xp.max(xp.asarray(data.x)))
    return known, xp.concatenate(static)


def _least_static(data):
    """Logarithms of the least strengths of the static columns."""
    least = np.full(data.num_extras + (0 if data.times is None else data.times.size), -np.inf)
    if data.known_start is None:
        least[len(least) - data.num_extras] = np.log(1e-300)
        if data.kind == "creep" and is_concrete(data.values):
            smallest = np.min(np.asarray(data.values)[np.asarray(data.weights) > 0])
            least[len(least) - data.num_extras] = np.log(smallest / STIFFEST)
    return least


def objective(theta: Unknowns, data: Observations) -> Float[Array, ""]:
    """Returns Σ w ρ(ln model - ln measured), in JAX."""
    series = series_of(data, jnp)
    return series.cost(series.residual(series.model(theta)))


@eqx.filter_jit
def model(
    theta: Unknowns, data: Observations, x: Float[Array, " any"]
) -> Float[Array, "channels any"]:
    """Returns the result of a measurement of this kind at frequencies or times `x`."""
    strengths, times, extras = _unpack(theta, data)
    known, static = _fixed_columns(dataclasses.replace(data, times=None), x, jnp)
    rows = known + strengths @ branches(data.kind, x, times)[0] + extras @ static
    return rows.reshape(-1, len(x))


@eqx.filter_jit
def material_of(theta: Unknowns, data: Observations, poisson: Numbers) -> Prony:
    """Returns the material with these unknowns, in relaxation form."""
    strengths, times, extras = _unpack(theta, data)
    common = {"poisson": poisson, "measured": measured_range(data)}
    start = extras[0] if data.known_start is None else data.known_start
    if data.kind != "creep":
        if data.known_start is None:  # exactly zero where the data need none
            smallest = jnp.min(jnp.where(data.weights > 0, data.values, jnp.inf))
            start = jnp.where(start > 1.001 * NEGLIGIBLE * smallest, start, 0)
        return Prony(equilibrium=start, strengths=strengths, times=times, **common)
    glassy = 1 / start
    if data.flows:
        last = LAST * jax.lax.stop_gradient(jnp.maximum(jnp.max(data.x), jnp.max(times, initial=0)))
        strengths = jnp.append(strengths, extras[-1] * last / jnp.max(data.x))
        times = jnp.append(times, last)
    if not len(times):
        return Prony(equilibrium=glassy, strengths=strengths, times=times, **common)
    # Retardation times that coincide after the fit are separated by 1e-6.
    meet = jnp.abs(times[:, None] - times) < 1e-7 * times
    times = times * (1 + 1e-6 * jnp.sum(jnp.tril(meet, -1), axis=1))
    material = Prony.from_creep(glassy, strengths, times, **common)
    if data.flows:
        material = eqx.tree_at(lambda m: m.equilibrium, material, jnp.zeros_like(glassy))
    return material


def measured_range(data: Observations) -> MeasuredRange:
    """Returns the frequencies that the data cover; a time t counts as the frequency 1/t."""
    used = (data.x > 0) & jnp.any(data.weights > 0, axis=0)
    x = jax.lax.stop_gradient(data.x)
    lowest = jnp.min(jnp.where(used, x, jnp.inf))
    highest = jnp.max(jnp.where(used, x, 0))
    if data.kind != "frequency":
        lowest, highest = 1 / highest, 1 / lowest
    return MeasuredRange(jnp.stack([lowest, highest]))


def _unpack(theta, data):
    """Strengths, times and extras, each possibly empty."""
    terms = data.num_terms(theta)
    extras = jnp.exp(theta[len(theta) - data.num_extras :])
    times = jnp.exp(theta[terms : 2 * terms]) if data.times is None else data.times
    return jnp.exp(theta[:terms]), times, extras


# The optimum in differentiable programs ---------------------------------------------------------


def search(find: Callable[..., tuple], sizes: tuple[int, ...], *arguments: Any) -> tuple:
    """Returns the arrays that `find(*arguments)` finds in NumPy, also under `jit` and `grad`.

    `arguments` are pytrees of arrays. `find` returns the unknowns, of shape `(sizes[0],)`, which of
    them are at no bound, and float arrays of the other `sizes`. No derivatives are attached.
    """
    arguments = jax.lax.stop_gradient(arguments)
    if all(is_concrete(leaf) for leaf in jax.tree.leaves(arguments)):
        return tuple(map(jnp.asarray, find(*arguments)))
    unknowns, *others = (jax.ShapeDtypeStruct((size,), np.float64) for size in sizes)
    free = jax.ShapeDtypeStruct((sizes[0],), np.bool_)
    return jax.pure_callback(find, (unknowns, free, *others), *arguments, vmap_method="sequential")


@eqx.filter_custom_jvp
def attach_derivative(
    objective: Callable[[Array, Any], Array],
    theta: Float[Array, " unknowns"],
    free: Bool[Array, " unknowns"],
    data: Any,
) -> Float[Array, " unknowns"]:
    """Returns `theta` unchanged, with its derivatives by every number in `data`.

    `theta` must minimise `objective(theta, data)` in its `free` entries; this is not checked.
    """
    return theta


@attach_derivative.def_jvp
def _attach_derivative_jvp(primals, tangents):
    objective, theta, free, data = primals
    return theta, _change(objective, theta, free, data, tangents[3])


@eqx.filter_jit
def _change(objective, theta, free, data, d_data):
    gradient = jax.grad(objective)
    _, forcing = eqx.filter_jvp(lambda data: gradient(theta, data), (data,), (d_data,))

    def column(direction):
        return jax.jvp(lambda theta: gradient(theta, data), (theta,), (direction,))[1]

    # One column at a time: all at once would take unknowns times the memory of a gradient.
    hessian = jax.lax.map(column, jnp.eye(len(theta), dtype=theta.dtype))
    scale = jnp.sqrt(jnp.maximum(jnp.abs(jnp.diagonal(hessian)), 1e-300))
    scale = jnp.where(free, scale, 1)
    both = free[:, None] & free
    matrix = jnp.where(both, hessian / scale / scale[:, None], 0)
    matrix = matrix + jnp.diag(jnp.where(free, RIDGE, 1))
    change = jnp.linalg.solve(matrix, jnp.where(free, forcing / scale, 0))
    return -change / scale
