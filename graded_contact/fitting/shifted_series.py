"""One series for measurements at many temperatures, each shifted along and across (NumPy).

An isotherm g measures b_g m(x a_g) at frequencies x (or times x/a_g). Its shift is a law plus a
departure, ln a_g = L_g(p) + e_g. The unknowns are (θ, p, e, ln b): those of the series, the law's,
and departures and vertical shifts of all isotherms but the reference. Departures and ln b may be
expected to be small; those squares are then part of the cost.
"""

import dataclasses
import functools
from typing import NamedTuple

import numpy as np

from .newton import Expansion, newton_minimum
from .series import Series, gram, gram_diagonal

LN10 = float(np.log(10))


class Law(NamedTuple):
    """A shift law: its unknowns' bounds, and what follows from the temperatures [K].

    `kind` is "wlf", with unknowns the logarithms of the slope c1/c2 [1/K] at the reference and of
    the distance [K] of the coldest isotherm from the Vogel temperature, or "arrhenius", with that
    of Q/R [K].
    """

    kind: str
    temperatures: np.ndarray
    reference: float

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Limits of the unknowns, far beyond those of any material."""
        limits = [(1e-4, 10), (1, 1e4)] if self.kind == "wlf" else [(1e2, 1e6)]
        lower, upper = np.log(limits).T
        return lower, upper

    @property
    def typical(self) -> np.ndarray:
        """The unknowns of a usual polymer."""
        return np.log([0.1, 60.0] if self.kind == "wlf" else [1e4])

    def shifts(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns ln a of each isotherm and its derivatives by `p`, unknowns first."""
        step = self.temperatures - self.reference
        if self.kind == "arrhenius":
            value = np.exp(p[0]) * (1 / self.temperatures - 1 / self.reference)
            return value, value[None], value[None, None]
        slope, margin = np.exp(p)
        c2 = self.reference - np.min(self.temperatures) + margin
        value = -LN10 * slope * step * c2 / (c2 + step)
        by_margin = -LN10 * slope * (step / (c2 + step)) ** 2 * margin
        twice = by_margin * (1 - 2 * margin / (c2 + step))
        return (
            value,
            np.array([value, by_margin]),
            np.array([[value, by_margin], [by_margin, twice]]),
        )


class Parts(NamedTuple):
    """The unknowns by what they belong to."""

    theta: np.ndarray
    law: np.ndarray
    departures: np.ndarray
    log_vertical: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class SharedSeries:
    """Measurements at several temperatures, and the model that is to meet them.

    **Fields:**

    - `series`: all points as they were measured.
    - `group`: number of the isotherm of each point, -1 for what was not measured.
    - `reference`: the isotherm that stays in place.
    - `law`: the shift law.
    - `stiffness`: weights of the squares of departures and ln b in the cost; infinite where they
      are none.
    """

    series: Series
    group: np.ndarray
    reference: int
    law: Law
    stiffness: tuple[float, float]

    @property
    def channels(self) -> int:
        return len(self.series.weights) // len(self.series.x)

    @functools.cached_property
    def _member(self) -> np.ndarray:
        """Which rows belong to which isotherm, shape `(isotherms, rows)`."""
        rows = np.tile(self.group, self.channels)
        return (rows == np.arange(len(self.law.temperatures))[:, None]).astype(float)

    @functools.cached_property
    def _moving(self) -> tuple[np.ndarray, np.ndarray]:
        """The isotherms that have a departure, and those that have a vertical shift."""
        others = np.delete(np.arange(len(self.law.temperatures)), self.reference)
        departing, lifted = (others if np.isfinite(s) else others[:0] for s in self.stiffness)
        return departing, lifted

    def split(self, unknowns: np.ndarray) -> Parts:
        """Returns the unknowns by what they belong to."""
        counts = [len(self.law.bounds[0]), *map(len, self._moving)]
        ends = len(unknowns) - np.cumsum(counts[::-1])[::-1]
        return Parts(*np.split(unknowns, ends))

    def shifts(self, unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns ln a and ln b of every isotherm."""
        parts = self.split(unknowns)
        departing, lifted = self._moving
        log_shift = self.law.shifts(parts.law)[0]
        log_shift[departing] += parts.departures
        log_vertical = np.zeros(len(log_shift))
        log_vertical[lifted] = parts.log_vertical
        return log_shift, log_vertical

    def shifted(self, log_shift: np.ndarray, log_vertical: np.ndarray) -> Series:
        """Returns the problem of a single isotherm that remains once the shifts are known."""
        series = self.series
        along, across = np.append(log_shift, 0)[self.group], np.append(log_vertical, 0)[self.group]
        along = along if series.kind == "frequency" else -along
        return dataclasses.replace(
            series,
            x=series.x * np.exp(along),
            log_values=series.log_values - np.tile(across, self.channels),
        )

    def join(self, theta: np.ndarray, law: np.ndarray, log_shift: np.ndarray) -> np.ndarray:
        """Returns unknowns with these shifts, as far as departures allow, and none across."""
        departing, lifted = self._moving
        departures = (log_shift - self.law.shifts(law)[0])[departing]
        return np.concatenate([theta, law, departures, np.zeros(len(lifted))])

    def penalty(self, unknowns: np.ndarray) -> np.ndarray:
        """Returns the weight of the square of each unknown in the cost."""
        departing, lifted = self._moving
        before = len(unknowns) - len(departing) - len(lifted)
        return np.repeat([0.0, *self.stiffness], [before, len(departing), len(lifted)])

    def derivatives(self, unknowns: np.ndarray):
        """Returns the shifted series, its residual, ∂ ln m/∂unknowns, and second derivatives."""
        parts = self.split(unknowns)
        series = self.shifted(*self.shifts(unknowns))
        residual, jacobian, bend = series.derivatives(parts.theta)
        terms = len(bend)
        by_shift = np.sum(jacobian[terms : 2 * terms], axis=0) * self._member
        _, by_law, _ = self.law.shifts(parts.law)
        departing, lifted = self._moving
        present = self._member[lifted] * (series.weights > 0)
        jacobian = np.concatenate([jacobian, by_law @ by_shift, by_shift[departing], present])
        return series, residual, jacobian, (bend, by_shift)

    def expand(self, unknowns: np.ndarray) -> Expansion:
        """Returns the cost about `unknowns`; exact at a minimum, as `Series.expand`."""
        parts = self.split(unknowns)
        series, residual, jacobian, (bend, by_shift) = self.derivatives(unknowns)
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
        _, by_law, by_law_twice = self.law.shifts(parts.law)
        shifting = slice(len(parts.theta), inner)
        moves = np.concatenate([by_law, np.eye(len(self.law.temperatures))[self._moving[0]]])
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
        law_lower, law_upper = self.law.bounds
        free = np.full(len(parts.departures) + len(parts.log_vertical), np.inf)
        return np.concatenate([lower, law_lower, -free]), np.concatenate([upper, law_upper, free])

    def minimise(
        self, unknowns: np.ndarray, *, rtol: float, max_steps: int = 150
    ) -> tuple[np.ndarray, float]:
        """Returns the unknowns and the cost of the minimum reached from `unknowns`."""
        return newton_minimum(
            self.expand, unknowns, *self.bounds(unknowns), rtol=rtol, max_steps=max_steps
        )
