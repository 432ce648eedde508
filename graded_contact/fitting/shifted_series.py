"""One series for measurements at many temperatures, each with a horizontal and a vertical shift.

An isotherm g measures b_g m(x a_g) at frequencies x (or times x/a_g). Its shift is a law plus a
departure, ln a_g = L_g(p) + e_g. The unknowns are (θ, p, e, ln b): those of the series, the law's,
and departures and vertical shifts of all isotherms but the reference. Departures and ln b may be
expected to be small; those squares are then part of the cost.

The unknowns p of WLF are the logarithms of its slope c1/c2 [1/K] at the reference and of the
distance [K] of the coldest isotherm from the Vogel temperature; that of Arrhenius is ln Q/R [K].
"""

import dataclasses
import functools
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..core.display import shown
from ..materials.shift import GAS_CONSTANT, WLF, AbstractShift, Arrhenius
from .newton import Expansion, newton_minimum
from .observations import Observations, Unknowns
from .series import Series, array_module, gram, gram_diagonal, series_of

LN10 = float(np.log(10))
LawKind = Literal["wlf", "arrhenius"]
# Limits of exp(p), far beyond those of any material, and values of a usual polymer.
LAW_LIMITS = {"wlf": [(1e-4, 10), (1, 1e4)], "arrhenius": [(1e2, 1e6)]}
LAW_TYPICAL = {"wlf": [0.1, 60.0], "arrhenius": [1e4]}


@shown()
class Isotherms(eqx.Module):
    """Measurements at several temperatures, and what is expected of the shifts.

    **Fields:**

    - `observations`: all points, as measured.
    - `group`: number of the isotherm of each point, shape `(points,)`.
    - `temperatures`: [K], shape `(isotherms,)`, increasing.
    - `penalty`: weights of the squares of departures and of ln b in the objective [1].
    - `reference`: the isotherm that is not shifted. Static.
    - `law`: the shift law. Static.
    - `departs`, `lifts`: whether there are departures, and vertical shifts. Static.
    """

    observations: Observations
    group: Int[Array, " points"]
    temperatures: Float[Array, " isotherms"]
    penalty: Float[Array, " 2"]
    reference: int = eqx.field(static=True)
    law: LawKind = eqx.field(static=True)
    departs: bool = eqx.field(static=True)
    lifts: bool = eqx.field(static=True)

    @property
    def shift_counts(self) -> list[int]:
        """The numbers of unknowns of the law, of departures, and of vertical shifts."""
        others = len(self.temperatures) - 1
        return [len(LAW_LIMITS[self.law]), others * self.departs, others * self.lifts]


def law_of(
    p: Float[Array, " law"], temperatures: Float[Array, " isotherms"], reference: int, law: LawKind
) -> AbstractShift:
    """Returns the shift law with the unknowns `p` about the temperature of an isotherm."""
    base = temperatures[reference]
    if law == "arrhenius":
        return Arrhenius(activation_energy=GAS_CONSTANT * jnp.exp(p[0]), reference=base)
    slope, distance = jnp.exp(p)
    c2 = base - temperatures[0] + distance
    return WLF(c1=slope * c2, c2=c2, reference=base)


@functools.partial(jax.jit, static_argnums=(2, 3))
def _law_shifts(p, temperatures, reference, law):
    return jax.vmap(law_of(p, temperatures, reference, law).log_factor)(temperatures)


@functools.partial(jax.jit, static_argnums=(2, 3))
def _law_derivatives(p, temperatures, reference, law):
    """The first and second derivatives of ln a of each isotherm by `p`, unknowns first."""
    slope = jax.jacfwd(_law_shifts)
    first = slope(p, temperatures, reference, law)
    second = jax.jacfwd(slope)(p, temperatures, reference, law)
    return jnp.moveaxis(first, 0, -1), jnp.moveaxis(second, 0, -1)


class Parts(NamedTuple):
    """The unknowns by what they belong to."""

    theta: Any
    law: Any
    departures: Any
    log_vertical: Any


@dataclasses.dataclass(frozen=True, eq=False)
class ShiftedSeries:
    """Measurements at several temperatures and their model; arrays as those of its `series`.

    **Fields:**

    - `series`: all points as measured.
    - `group`: number of the isotherm of each point, -1 for a known end value.
    - `data`: the isotherms.
    """

    series: Series
    group: Any
    data: Isotherms

    @property
    def _channels(self) -> int:
        return len(self.series.weights) // len(self.series.x)

    @functools.cached_property
    def _member(self) -> np.ndarray:
        """Which rows belong to which isotherm, shape `(isotherms, rows)`."""
        rows = np.tile(self.group, self._channels)
        return (rows == np.arange(len(self.data.temperatures))[:, None]).astype(float)

    @functools.cached_property
    def _others(self) -> np.ndarray:
        """Which isotherm each unknown shift belongs to: all but the reference."""
        return np.delete(np.eye(len(self.data.temperatures)), self.data.reference, axis=0)

    def split(self, unknowns: Any) -> Parts:
        """Returns the unknowns by what they belong to."""
        ends = len(unknowns) - np.cumsum(self.data.shift_counts[::-1])[::-1]
        return Parts(*array_module(unknowns).split(unknowns, ends))

    def law_shifts(self, p: Any) -> Any:
        """Returns ln a of each isotherm by the law."""
        shifts = _law_shifts(p, self.data.temperatures, self.data.reference, self.data.law)
        return array_module(self.series.x).asarray(shifts)

    def shifts(self, unknowns: Any) -> tuple[Any, Any]:
        """Returns ln a and ln b of every isotherm."""
        parts = self.split(unknowns)
        departures = parts.departures @ self._others[: len(parts.departures)]
        across = parts.log_vertical @ self._others[: len(parts.log_vertical)]
        return self.law_shifts(parts.law) + departures, across

    def shifted(self, log_shift: Any, log_vertical: Any) -> Series:
        """Returns the problem of a single isotherm that remains once the shifts are known."""
        series, xp = self.series, array_module(self.series.x)
        along, across = xp.append(log_shift, 0)[self.group], xp.append(log_vertical, 0)[self.group]
        along = along if series.kind == "frequency" else -along
        return dataclasses.replace(
            series,
            x=series.x * xp.exp(along),
            log_values=series.log_values - xp.tile(across, self._channels),
        )

    def join(self, theta: np.ndarray, p: np.ndarray, log_shift: np.ndarray) -> np.ndarray:
        """Returns unknowns with these shifts, as far as departures allow, and none across."""
        _, departures, lifts = self.data.shift_counts
        steps = self._others[:departures] @ (log_shift - self.law_shifts(p))
        return np.concatenate([theta, p, steps, np.zeros(lifts)])

    def penalty(self, unknowns: Any) -> Any:
        """Returns the weight of the square of each unknown in the cost."""
        xp, (_, *counts) = array_module(self.series.x), self.data.shift_counts
        weights = xp.append(0.0, xp.asarray(self.data.penalty))
        return xp.repeat(weights, np.array([len(unknowns) - sum(counts), *counts]))

    def cost(self, unknowns: Any) -> Any:
        """Returns the cost of the shifted series and of departures and vertical shifts."""
        series = self.shifted(*self.shifts(unknowns))
        residual = series.residual(series.model(self.split(unknowns).theta))
        return series.cost(residual) + self.penalty(unknowns) @ unknowns**2 / 2

    def derivatives(self, unknowns: np.ndarray):
        """Returns the shifted series, its residual, ∂ ln m/∂unknowns, and second derivatives."""
        parts = self.split(unknowns)
        series = self.shifted(*self.shifts(unknowns))
        residual, jacobian, bend = series.derivatives(parts.theta)
        terms = len(bend)
        by_shift = np.sum(jacobian[terms : 2 * terms], axis=0) * self._member
        law = self.data.temperatures, self.data.reference, self.data.law
        by_law, by_law_twice = map(np.asarray, _law_derivatives(parts.law, *law))
        moves = np.concatenate([by_law, self._others[: len(parts.departures)]])
        lifts = self._others[: len(parts.log_vertical)] @ self._member * (series.weights > 0)
        jacobian = np.concatenate([jacobian, moves @ by_shift, lifts])
        return series, residual, jacobian, (bend, by_shift, moves, by_law_twice)

    def expand(self, unknowns: np.ndarray) -> Expansion:
        """Returns the cost about `unknowns`; exact at a minimum, as `Series.expand`."""
        parts = self.split(unknowns)
        series, residual, jacobian, second = self.derivatives(unknowns)
        bend, by_shift, moves, by_law_twice = second
        pull, stiffness, near = series.forces(residual)
        terms, inner = len(bend), len(unknowns) - len(parts.log_vertical)
        hessian = gram(jacobian, stiffness)
        # Vertical shifts are linear in ln m: their products lack the second derivative of ln m.
        linear = jacobian @ (jacobian[inner:] * (stiffness + near * pull)).T
        hessian[:, inner:], hessian[inner:, :] = linear, linear.T
        near_pull = near * pull
        diagonal = np.arange(terms, 2 * terms)
        hessian[diagonal, diagonal] += bend @ near_pull
        # A shift moves every branch as a change of its time does.
        shifting = slice(len(parts.theta), inner)
        by_strength = (jacobian[terms : 2 * terms] * near_pull) @ self._member.T @ moves.T
        by_time = (bend * near_pull) @ self._member.T @ moves.T
        both = slice(0, 2 * terms)
        hessian[both, shifting] += np.concatenate([by_strength, by_time])
        hessian[shifting, both] += np.concatenate([by_strength, by_time]).T
        within = np.sum((bend * near_pull) @ self._member.T, axis=0)
        hessian[shifting, shifting] += (moves * within) @ moves.T
        law = slice(len(parts.theta), len(parts.theta) + len(parts.law))
        hessian[law, law] += by_law_twice @ (by_shift @ pull)
        penalty = self.penalty(unknowns)
        hessian[np.diag_indices_from(hessian)] += penalty
        return Expansion(
            float(series.cost(residual) + penalty @ unknowns**2 / 2),
            jacobian @ pull + penalty * unknowns,
            hessian,
            gram_diagonal(jacobian, stiffness) + penalty,
        )

    def bounds(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the limits of the unknowns; those of times move with the shifts."""
        parts = self.split(unknowns)
        lower, upper = self.shifted(*self.shifts(unknowns)).bounds(parts.theta)
        law_lower, law_upper = np.log(LAW_LIMITS[self.data.law]).T
        free = np.full(len(parts.departures) + len(parts.log_vertical), np.inf)
        return np.concatenate([lower, law_lower, -free]), np.concatenate([upper, law_upper, free])

    def within_bounds(self, unknowns: np.ndarray) -> np.ndarray:
        """Returns which unknowns are at no bound."""
        lower, upper = self.bounds(unknowns)
        return (unknowns > lower) & (unknowns < upper)

    def minimise(self, unknowns: np.ndarray, *, rtol: float) -> np.ndarray:
        """Returns the unknowns of the minimum reached from `unknowns`."""
        bounds = self.bounds(unknowns)
        return newton_minimum(self.expand, unknowns, *bounds, rtol=rtol, max_steps=150)[0]


def shifted_series_of(data: Isotherms, xp: Any = np) -> ShiftedSeries:
    """Returns the least-squares problem of the isotherms, in arrays of the module `xp`."""
    series = series_of(data.observations, xp)
    group = xp.append(xp.asarray(data.group), xp.full(series.num_ends, -1))
    return ShiftedSeries(series, group, data)


def shifted_objective(unknowns: Unknowns, data: Isotherms) -> Float[Array, ""]:
    """Returns the cost of `ShiftedSeries`, in JAX."""
    return shifted_series_of(data, jnp).cost(unknowns)


@eqx.filter_jit
def shifts_of(
    unknowns: Unknowns, data: Isotherms
) -> tuple[Float[Array, " isotherms"], Float[Array, " isotherms"]]:
    """Returns ln a and ln b of every isotherm, in JAX."""
    return shifted_series_of(data, jnp).shifts(unknowns)


@eqx.filter_jit
def at_reference(unknowns: Unknowns, data: Isotherms) -> Observations:
    """Returns all measurements as if made at the reference temperature."""
    observed = data.observations
    along, across = (jnp.exp(shifts)[data.group] for shifts in shifts_of(unknowns, data))
    x = observed.x * along if observed.kind == "frequency" else observed.x / along
    values = jnp.where(observed.weights > 0, observed.values / across, 1)
    return dataclasses.replace(observed, x=x, values=values)
