"""A series of exponential branches as a least-squares problem in logarithms.

Rows are measured values, all storage moduli before the loss moduli. The model is linear in positive
strengths,

    m = known + Σ_k exp(s_k) φ(x, τ_k) + Σ_j exp(c_j) B_j,

with a basis φ for each kind of measurement and `static` columns B for strengths without a time:
E_eq of moduli, 1/E_inf of compliances. The unknowns are logarithms, θ = (s, ln τ, c), so that
strengths are positive by construction; the shifts of isotherms follow (`shifts`). A known E_eq is
not part of θ.

The model takes NumPy arrays in the search and JAX arrays where the optimum is differentiated by the
data. A search expands the model hundreds of times at every length. With derivatives by JAX each
length takes 1 to 4 s to compile, and an expansion takes 5 times as long.
The search therefore has closed-form derivatives in NumPy.

The squared logarithm (ln m - y)² is convex in m, hence in the strengths, wherever m < e times the
measured value: a spectrum there that no added branch improves is the best of all.
"""

import dataclasses
from typing import Any

import numpy as np

from .minimum import Fitted, least_squares
from .observations import ModuliKind, Observations
from .shifts import Isotherms, log_shifts, shift_slopes

FARTHEST = 1e60  # ωτ, or its reciprocal, beyond which a branch no longer changes
NEGLIGIBLE_STRENGTH = 1e-9  # of the smallest measured value: a strength that changes nothing
# How far times may lie outside the times of the data, before and after. Farther out strengths grow
# without effect, and a slow branch replaces E_eq, so that a solid melts just below its data.
TIMES_BEYOND = {"frequency": (3.0, 3.0), "relaxation": (2.5, 5.0), "creep": (10.0, 5.0)}
REACH_TO_KNOWN = 1e3  # after the data with a known E_eq, which branches have to lead down to
STIFFEST = 30.0  # times the first secant modulus of creep: more shows in no measured strain


@dataclasses.dataclass(frozen=True, eq=False)
class SeriesProblem:
    """Measured logarithms and their model.

    **Fields:**

    - `xp`: `numpy` or `jax.numpy`, of which all arrays are.
    - `kind`: "frequency", "relaxation" or "creep".
    - `x`: angular frequencies [rad/s] or times [s], shape `(points,)`.
    - `log_values`, `weights`, `known`: shape `(rows,)`; a row is an entry of a channel.
    - `static`: columns B, shape `(columns, rows)`.
    - `least`: logarithms of the least strengths of the static columns.
    - `reach`: factors by which times may lie outside the times of the data, before and after.
    - `scale`: log residual from which on values count linearly, or None for least squares.
    - `isotherms`: whose shifts are unknowns, or None; `group`: the isotherm of each point.
    """

    xp: Any
    kind: ModuliKind
    x: Any
    log_values: Any
    weights: Any
    known: Any
    static: Any
    least: np.ndarray
    reach: tuple[float, float]
    scale: Any = None
    isotherms: Isotherms | None = None
    group: Any = None

    @property
    def measured(self) -> np.ndarray:
        """Which rows hold a measured value."""
        return self.weights > 0

    def by_channel(self, rows: Any) -> Any:
        """Returns rows, the last axis, as channels and points."""
        return rows.reshape(*rows.shape[:-1], -1, len(self.x))

    # The unknowns -------------------------------------------------------------------------------

    @property
    def num_shifts(self) -> int:
        """The number of unknowns of shifts, the last of θ."""
        return sum(self.isotherms.counts) if self.isotherms else 0

    def terms(self, theta: Any) -> int:
        """Returns the number of branches."""
        return (len(theta) - len(self.static) - self.num_shifts) // 2

    def split(self, theta: Any) -> tuple[Any, Any, Any]:
        """Returns `(s, ln τ, c)` of the unknowns."""
        terms, last = self.terms(theta), len(theta) - self.num_shifts
        return theta[:terms], theta[terms : 2 * terms], theta[2 * terms : last]

    def bounds(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the limits of the unknowns: strengths that matter, times that data cover.

        Those of times move with the shifts.
        """
        times = slice(self.terms(theta), 2 * self.terms(theta))
        last = len(theta) - self.num_shifts
        lower, upper = np.full(len(theta), self.faintest()), np.full(len(theta), np.inf)
        lower[times], upper[times] = self.at(theta).time_limits()
        lower[times.stop : last] = np.maximum(lower[times.stop : last], self.least)
        if self.isotherms:
            lower[last:], upper[last:] = self.isotherms.bounds()
        return lower, upper

    def within_bounds(self, theta: np.ndarray) -> np.ndarray:
        """Returns which unknowns are at no bound."""
        lower, upper = self.bounds(theta)
        return (theta > lower) & (theta < upper)

    def faintest(self) -> float:
        """Returns the logarithm of the strength below which a branch does nothing."""
        return float(np.log(NEGLIGIBLE_STRENGTH) + np.min(self.log_values[self.measured]))

    def time_limits(self) -> tuple[float, float]:
        """Returns the logarithms of the shortest and the longest time that data determine."""
        shortest, longest = np.min(self.x[self.x > 0]), np.max(self.x)
        if self.kind == "frequency":
            shortest, longest = 1 / longest, 1 / shortest
        before, after = self.reach
        return float(np.log(shortest / before)), float(np.log(longest * after))

    def time_grid(self, per_decade: float) -> np.ndarray:
        """Returns logarithms of evenly spaced times between the limits."""
        shortest, longest = self.time_limits()
        count = int(np.ceil((longest - shortest) / np.log(10) * per_decade)) + 1
        return np.linspace(shortest, longest, count)

    # Other problems -----------------------------------------------------------------------------

    def at(self, theta: Any) -> "SeriesProblem":
        """Returns the problem of a single isotherm that remains once the shifts are known."""
        return self.shifted(*log_shifts(self.isotherms, theta)) if self.isotherms else self

    def part(self, points: np.ndarray) -> "SeriesProblem":
        """Returns the problem of some of the points, given as a mask."""
        rows = np.tile(points, len(self.weights) // len(self.x))
        lines = {name: getattr(self, name)[rows] for name in ("log_values", "weights", "known")}
        return dataclasses.replace(self, x=self.x[points], static=self.static[:, rows], **lines)

    def shifted(self, along: Any, across: Any) -> "SeriesProblem":
        """Returns the problem with ln a and ln b of the isotherms given."""
        along = self._at_rows(along)[: len(self.x)]
        return dataclasses.replace(
            self,
            x=self.x * self.xp.exp(along if self.kind == "frequency" else -along),
            log_values=self.log_values - self._at_rows(across),
            isotherms=None,
        )

    def _at_rows(self, values):
        """Values of the isotherms, the last axis, at every row."""
        return self.xp.tile(values[..., self.group], len(self.weights) // len(self.x))

    # The model and the cost ---------------------------------------------------------------------

    def branches(self, log_times: Any) -> Any:
        """Returns φ at every row, shape `(terms, rows)`."""
        return branches(self.xp, self.kind, self.x, self.xp.exp(log_times))[0]

    def columns(self, log_times: Any) -> Any:
        """Returns all columns of which the model is a sum with positive strengths."""
        return self.xp.concatenate([self.branches(log_times), self.static])

    def model(self, theta: Any) -> Any:
        """Returns m at every row; the shifts in `theta` do not count."""
        s, log_times, c = self.split(theta)
        return self._sum(self.xp.exp(s) @ self.branches(log_times), self.xp.exp(c))

    def _sum(self, branches, static):
        """m, above zero also where every decay has underflowed."""
        least = 1e-12 * self.xp.exp(self.log_values)
        return self.xp.maximum(self.known + branches + static @ self.static, least)

    def residual(self, model: Any) -> Any:
        """Returns ln m - y; zero where nothing was measured."""
        return self.xp.where(self.weights > 0, self.xp.log(model) - self.log_values, 0)

    def misfit(self, theta: Any) -> Any:
        """Returns the residual at θ, the shifts in it included."""
        here = self.at(theta)
        return here.residual(here.model(theta[: len(theta) - self.num_shifts]))

    def softened(self, residual: Any) -> Any:
        """Returns g(r) whose square is SciPy's `soft_l1` of the residual r, or r itself."""
        if self.scale is None:
            return residual
        return residual * self.xp.sqrt(2 / (1 + self._reach(residual)))

    def pulling(self, residual: Any) -> Any:
        """Returns the weights with which the residuals pull at the unknowns."""
        return self.weights if self.scale is None else self.weights / self._reach(residual)

    def _reach(self, residual):
        return self.xp.sqrt(1 + (residual / self.scale) ** 2)

    def cost(self, residual: Any) -> Any:
        """Returns half the weighted sum of squares along the last axis."""
        return self.softened(residual) ** 2 @ self.weights / 2

    def total_cost(self, theta: Any) -> Any:
        """Returns the cost of the series with its shifts."""
        return self.cost(self.misfit(theta)) + self.penalty(theta) @ theta**2 / 2

    def penalty(self, theta: Any) -> Any:
        """Returns the weight of the square of each unknown in the cost."""
        none = self.xp.zeros(len(theta) - self.num_shifts)
        return self.xp.append(none, self.isotherms.weights(self.xp)) if self.isotherms else none

    def rms(self, theta: np.ndarray) -> float:
        """Returns the root mean square of the log residuals of measured values."""
        rows = self.measured
        return float(np.sqrt(np.average(self.misfit(theta)[rows] ** 2, weights=self.weights[rows])))

    def median_deviation(self, theta: np.ndarray) -> float:
        """Returns the standard deviation of the log residuals by their median, at least 1e-6."""
        return max(1.4826 * float(np.median(np.abs(self.misfit(theta)[self.measured]))), 1e-6)

    def noise(self, theta: np.ndarray) -> float:
        """Returns the usual log residual: by the median where bad values count less."""
        return self.rms(theta) if self.scale is None else self.median_deviation(theta)

    # The search ---------------------------------------------------------------------------------

    def minimise(self, theta: np.ndarray, **choices: Any) -> Fitted:
        """Returns the minimum reached from `theta`; `choices` as in `least_squares`."""
        root, tied = np.sqrt(self.weights), np.sqrt(self.penalty(theta))

        def residual(theta):
            return np.append(root * self.softened(self.misfit(theta)), tied * theta)

        def jacobian(theta):
            return np.concatenate([root * self.derivatives(theta)[1], np.diag(tied)], axis=1).T

        theta, cost = least_squares(residual, jacobian, theta, *self.bounds(theta), **choices)
        s, log_times, _ = self.split(theta)
        order = np.argsort(-log_times)
        return np.concatenate([s[order], log_times[order], theta[2 * len(s) :]]), cost

    def derivatives(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the softened residual and its derivatives, by rows."""
        series, (s, log_times, c) = self.at(theta), self.split(theta)
        value, slope = branches(np, self.kind, series.x, np.exp(log_times))
        strengths, static = np.exp(s), np.exp(c)
        model = series._sum(strengths @ value, static)
        relative = strengths[:, None] / model
        by_time = slope * relative
        parts = [value * relative, by_time, self.static * (static[:, None] / model)]
        if self.isotherms:
            # A shift moves every branch as a change of its time does.
            along, across = map(self._at_rows, shift_slopes(self.isotherms, theta))
            parts += [along * np.sum(by_time, axis=0), across]
        jacobian = np.concatenate(parts)
        residual = series.residual(model)
        if self.scale is not None:
            reach = self._reach(residual)
            jacobian *= np.sqrt((1 + reach) / 2) / reach
        return self.softened(residual), jacobian


def branches(xp: Any, kind: ModuliKind, x: Any, times: Any) -> tuple[Any, Any]:
    """Returns φ and its derivative by ln τ, each of shape `(terms, rows)`."""
    if kind == "frequency":
        # Beyond these limits a branch is complete or absent, and powers of z overflow.
        z = xp.clip(times[:, None] * x, 1 / FARTHEST, FARTHEST)
        inverse = 1 / z
        loss, storage = 1 / (z + inverse), 1 / (1 + inverse**2)
        slopes = xp.concatenate([2 * loss**2, loss * (1 - 2 * storage)], axis=1)
        return xp.concatenate([storage, loss], axis=1), slopes
    z = x / times[:, None]
    decay = xp.exp(-z)
    if kind == "creep":
        return -xp.expm1(-z), -z * decay
    return decay, z * decay


def problem_of(data: Observations, xp: Any = np) -> SeriesProblem:
    """Returns the least-squares problem of the observations, in arrays of the module `xp`."""
    x, values, weights = (xp.asarray(part) for part in (data.x, data.values, data.weights))
    least = np.full(data.num_extras, -np.inf)
    if xp is np and data.kind == "creep":
        least[0] = np.log(np.min(values[weights > 0]) / STIFFEST)
    known, static = fixed_columns(data, x, xp)
    before, after = TIMES_BEYOND[data.kind]
    after = after if data.equilibrium is None else REACH_TO_KNOWN
    return SeriesProblem(
        xp=xp,
        kind=data.kind,
        x=x,
        log_values=xp.log(values).ravel(),
        weights=weights.ravel(),
        known=known,
        static=static,
        least=least,
        reach=(before, after),
        scale=None if data.scale is None else xp.asarray(data.scale),
        isotherms=data.isotherms,
        group=data.isotherms and xp.asarray(data.isotherms.group),
    )


def fixed_columns(data: Observations, x: Any, xp: Any) -> tuple[Any, Any]:
    """Returns the known part of a series at `x`, and the columns of strengths without a time."""
    rows = len(data.values) * len(x)
    constant = xp.asarray(np.arange(rows) < len(x), float)  # the first channel alone has it
    if data.equilibrium is None:
        return xp.zeros(rows), constant[None]
    return constant * xp.asarray(data.equilibrium), xp.zeros((0, rows))
