"""A series of exponential branches as a least-squares problem in logarithms.

Rows are measured values, all storage moduli before the loss moduli. The model is linear in positive
strengths,

    m = known + Σ_k exp(s_k) φ(x, τ_k) + Σ_j exp(c_j) B_j,

with a basis φ for each kind of measurement and `static` columns B for strengths whose time is not
fitted: E_eq of moduli; 1/E_inf and, for a liquid, the fluidity 1/η of compliances; or a whole grid
of given times. The unknowns are logarithms, θ = (s, ln τ, c), so that strengths are positive by
construction. Known values are not part of θ; a known end value that is a sum of unknowns (E_inf of
moduli, 1/E_eq of compliances) is a row of great weight.

The model takes NumPy arrays in the search and JAX arrays where the optimum is differentiated by the
data (`model`). A search expands the model hundreds of times at every length. With derivatives by
JAX each length takes 1 to 4 s to compile, and an expansion takes 5 times as long
(`bench_fit.py solvers`). The search therefore has closed-form derivatives in NumPy.

The squared logarithm (ln m - y)² is convex in m, hence in the strengths, wherever m < e times the
measured value: a spectrum there that no added branch improves is the best of all.
"""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..core.checks import is_concrete
from .newton import Expansion, newton_minimum
from .observations import Kind, Observations

# Where a branch of relative strength one counts fully: infinite frequency, or the end of creep.
COMPLETE = {"frequency": 1e150, "relaxation": 0.0, "creep": 1e150}
NO_OUTLIER = 1e100  # log residual; infinity would leave NaN in derivatives
FARTHEST = 1e60  # ωτ, or its reciprocal, beyond which a branch no longer changes
MOST_POINTS = 400  # that a search goes through
NEGLIGIBLE = 1e-9  # of the smallest measured value: a strength that changes nothing
END_WEIGHT = 1e6  # of an end value that is known, over that of all measured values
# How far times may lie outside those of the data, before and after. Farther out strengths grow
# without effect, and a slow branch replaces E_eq, so that a solid melts just below its data.
REACH = {"frequency": (3.0, 3.0), "relaxation": (2.5, 5.0), "creep": (10.0, 5.0)}
REACH_TO_KNOWN = 1e3  # on the side of a known end value, which branches have to lead up to
STIFFEST = 30.0  # times the first secant modulus of creep: more shows in no measured strain


@dataclasses.dataclass(frozen=True, eq=False)
class Series:
    """Measured logarithms and their model; arrays are all NumPy's or all JAX's.

    **Fields:**

    - `kind`: "frequency", "relaxation" or "creep".
    - `x`: angular frequencies [rad/s] or times [s], shape `(points,)`.
    - `log_values`, `weights`, `known`: shape `(rows,)`; a row is an entry of a channel.
    - `static`: columns B, shape `(columns, rows)`.
    - `least`: logarithms of the least strengths of the static columns.
    - `reach`: factors by which times may lie outside those of the data, before and after.
    - `num_ends`: how many of the last points are known end values instead of measurements.
    - `huber`: log residual from which on a row counts linearly instead of squared.
    """

    kind: Kind
    x: Any
    log_values: Any
    weights: Any
    known: Any
    static: Any
    least: np.ndarray
    reach: tuple[float, float]
    num_ends: int
    huber: Any

    @property
    def measured(self) -> np.ndarray:
        """Which rows hold a measured value."""
        last = len(self.x) - self.num_ends
        return (self.weights > 0) & (np.arange(len(self.weights)) % len(self.x) < last)

    def terms(self, theta: Any) -> int:
        """Returns the number of branches with a separate time."""
        return (len(theta) - len(self.static)) // 2

    def split(self, theta: Any) -> tuple[Any, Any, Any]:
        """Returns `(s, ln τ, c)` of the unknowns."""
        terms = self.terms(theta)
        return theta[:terms], theta[terms : 2 * terms], theta[2 * terms :]

    def bounds(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the limits of the unknowns: strengths that matter, times that data cover."""
        times = slice(self.terms(theta), 2 * self.terms(theta))
        lower, upper = np.full(len(theta), self.faintest()), np.full(len(theta), np.inf)
        lower[times], upper[times] = self.time_limits()
        lower[times.stop :] = np.maximum(lower[times.stop :], self.least)
        return lower, upper

    def within_bounds(self, theta: np.ndarray) -> np.ndarray:
        """Returns which unknowns are at no bound."""
        lower, upper = self.bounds(theta)
        return (theta > lower) & (theta < upper)

    def faintest(self) -> float:
        """Returns the logarithm of the strength below which a branch does nothing."""
        return float(np.log(NEGLIGIBLE) + np.min(self.log_values[self.measured]))

    def time_limits(self) -> tuple[float, float]:
        """Returns the logarithms of the shortest and the longest time that data determine."""
        x = self.x[: len(self.x) - self.num_ends]
        shortest, longest = np.min(x[x > 0]), np.max(x)
        if self.kind == "frequency":
            shortest, longest = 1 / longest, 1 / shortest
        before, after = self.reach
        return float(np.log(shortest / before)), float(np.log(longest * after))

    def time_grid(self, per_decade: float) -> np.ndarray:
        """Returns logarithms of evenly spaced times between the limits."""
        shortest, longest = self.time_limits()
        count = int(np.ceil((longest - shortest) / np.log(10) * per_decade)) + 1
        return np.linspace(shortest, longest, count)

    def restricted(self, points: np.ndarray) -> "Series":
        """Returns the problem of some of the points, given as a mask."""
        rows = np.tile(points, len(self.weights) // len(self.x))
        parts = {name: getattr(self, name)[rows] for name in ("log_values", "weights", "known")}
        return dataclasses.replace(
            self, x=self.x[points], static=self.static[:, rows], num_ends=0, **parts
        )

    def thinned(self) -> "Series":
        """Returns much the same problem with at most `MOST_POINTS` points, by averaging neighbours.

        A search through it costs no more than one through few data.
        """
        count = len(self.x) - self.num_ends
        if count <= MOST_POINTS:
            return self
        log_x = np.log(np.maximum(self.x, 1e-2 * np.min(self.x[self.x > 0])))
        order = np.append(np.argsort(log_x[:count]), np.arange(count, len(self.x)))
        log_x = log_x[order]
        place = (log_x - log_x[0]) / (log_x[count - 1] - log_x[0]) * MOST_POINTS
        place[count:] = 2 * MOST_POINTS + np.arange(self.num_ends)
        starts = np.flatnonzero(np.diff(np.floor(place), prepend=-1))

        def sums(rows):
            by_channel = rows.reshape(*rows.shape[:-1], -1, len(self.x))[..., order]
            summed = np.add.reduceat(by_channel, starts, axis=-1)
            return summed.reshape(*rows.shape[:-1], -1)

        sizes, weights = sums(np.ones_like(self.weights)), sums(self.weights)
        return dataclasses.replace(
            self,
            x=np.exp(np.add.reduceat(log_x, starts) / sizes[: len(starts)]),
            log_values=sums(self.weights * self.log_values) / np.where(weights > 0, weights, 1),
            weights=weights,
            known=sums(self.known) / sizes,
            static=sums(self.static) / sizes,
        )

    def branches(self, log_times: Any) -> Any:
        """Returns φ at every row, shape `(terms, rows)`."""
        return branches(self.kind, self.x, array_module(self.x).exp(log_times))[0]

    def model(self, theta: Any) -> Any:
        """Returns m at every row."""
        s, log_times, c = self.split(theta)
        xp = array_module(self.x)
        return self._sum(xp.exp(s) @ self.branches(log_times), xp.exp(c))

    def _sum(self, branches, static):
        """m, above zero also where every decay has underflowed."""
        xp = array_module(self.x)
        return xp.maximum(self.known + branches + static @ self.static, 1e-12 * self._values)

    @functools.cached_property
    def _values(self):
        return array_module(self.x).exp(self.log_values)

    def residual(self, model: Any) -> Any:
        """Returns ln m - y; zero where nothing was measured."""
        xp = array_module(self.x)
        return xp.where(self.weights > 0, xp.log(model) - self.log_values, 0)

    def cost(self, residual: Any) -> Any:
        """Returns Σ w ρ(residual) with ρ(r) = r²/2, or Huber's, along the last axis."""
        size = abs(residual)
        linear = self.huber * (size - self.huber / 2)
        squares = array_module(self.x).where(size <= self.huber, residual**2 / 2, linear)
        return squares @ self.weights

    def rms(self, theta: np.ndarray, rows: np.ndarray | bool = True) -> float:
        """Returns the root mean square of the log residuals in `rows`, one of which is measured."""
        counted = self.measured & rows
        residual = self.residual(self.model(theta))[counted]
        return float(np.sqrt(np.average(residual**2, weights=self.weights[counted])))

    def expand(self, theta: np.ndarray) -> Expansion:
        """Returns the cost about `theta`.

        Second derivatives are exact at a minimum, where those of a strength alone vanish with the
        gradient. Rows far off take their Gauss-Newton part, which is safe at any distance.
        """
        residual, jacobian, bend = self.derivatives(theta)
        pull, stiffness, near = self.forces(residual)
        hessian = gram(jacobian, stiffness)
        scale = gram_diagonal(jacobian, stiffness)
        terms = len(bend)
        diagonal = np.arange(terms, 2 * terms)
        hessian[diagonal, diagonal] += bend @ (near * pull)
        return Expansion(float(self.cost(residual)), jacobian @ pull, hessian, scale)

    def forces(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns `(pull, stiffness, near)` of the rows.

        `pull` is the first derivative of the cost by ln m; `stiffness` multiplies products of
        first derivatives of ln m in the Hessian, which where `near` also holds second ones of m.
        """
        size = np.abs(residual)
        clipped = np.clip(residual, -self.huber, self.huber)
        near = (residual > -2) & (residual < 0.5)
        exact = (size <= self.huber) - clipped
        safe = np.minimum(1, self.huber / np.maximum(size, 1e-100))
        return self.weights * clipped, self.weights * np.where(near, exact, safe), near

    def minimise(
        self, theta: np.ndarray, *, rtol: float, max_steps: int = 100
    ) -> tuple[np.ndarray, float]:
        """Returns the unknowns and the cost of the minimum reached from `theta`."""
        theta, cost = newton_minimum(
            self.expand, theta, *self.bounds(theta), rtol=rtol, max_steps=max_steps
        )
        s, log_times, c = self.split(theta)
        order = np.argsort(-log_times)
        return np.concatenate([s[order], log_times[order], c]), cost

    def derivatives(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns the residual, ∂ ln m/∂θ, and (∂²m/∂(ln τ)²)/m of each branch, by rows."""
        s, log_times, c = self.split(theta)
        terms = len(s)
        value, slope, curvature = branches(self.kind, self.x, np.exp(log_times))
        strengths, static = np.exp(s), np.exp(c)
        model = self._sum(strengths @ value, static)
        relative = strengths[:, None] / model
        jacobian = np.empty((len(theta), len(model)))
        np.multiply(value, relative, out=jacobian[:terms])
        np.multiply(slope, relative, out=jacobian[terms : 2 * terms])
        np.multiply(self.static, static[:, None] / model, out=jacobian[2 * terms :])
        jacobian[:, self.weights == 0] = 0
        return self.residual(model), jacobian, curvature * relative


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
    known, static = fixed_columns(data, x, xp)
    least = np.full(len(static), -np.inf)
    if data.known_start is None:
        first = len(static) - data.num_extras
        least[first] = np.log(1e-300)
        if data.kind == "creep" and is_concrete(data.values):
            smallest = np.min(np.asarray(data.values)[np.asarray(data.weights) > 0])
            least[first] = np.log(smallest / STIFFEST)
    before, after = REACH[data.kind]
    return Series(
        kind=data.kind,
        x=x,
        log_values=xp.log(values).ravel(),
        weights=weights.ravel(),
        known=known,
        static=static,
        least=least,
        reach=(
            before if data.glassy is None else REACH_TO_KNOWN,
            after if data.equilibrium is None else REACH_TO_KNOWN,
        ),
        num_ends=int(data.known_end is not None),
        huber=NO_OUTLIER if data.huber is None else xp.asarray(data.huber),
    )


def fixed_columns(data: Observations, x: Any, xp: Any) -> tuple[Any, Any]:
    """Returns the known part of a series at `x`, and the columns of strengths without a time."""
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


def array_module(values: Any) -> Any:
    """Returns `jax.numpy` for JAX's arrays and `numpy` for all others."""
    return jnp if isinstance(values, jax.Array) else np


def branches(kind: Kind, x: Any, times: Any) -> tuple[Any, Any, Any]:
    """Returns φ and its first two derivatives by ln τ, each of shape `(terms, rows)`."""
    xp = array_module(x)
    if kind == "frequency":
        # Beyond these limits a branch is complete or absent, and powers of z overflow.
        z = xp.clip(times[:, None] * x, 1 / FARTHEST, FARTHEST)
        inverse = 1 / z
        loss, storage = 1 / (z + inverse), 1 / (1 + inverse**2)
        loss2, tilt = loss**2, 1 - 2 * storage
        return (
            xp.concatenate([storage, loss], axis=1),
            xp.concatenate([2 * loss2, loss * tilt], axis=1),
            xp.concatenate([4 * loss2 * tilt, loss * (1 - 8 * loss2)], axis=1),
        )
    z = x / times[:, None]
    decay = xp.exp(-z)
    slope = z * decay
    curvature = (z - 1) * slope
    if kind == "creep":
        return -xp.expm1(-z), -slope, -curvature
    return decay, slope, curvature


def gram(matrix: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Returns A W Aᵀ, summed over slices so small that BLAS starts no threads.

    On matrices of this size threads gain nothing, and on a busy machine they cost a hundredfold.
    """
    rooted = matrix * np.sqrt(np.abs(weights))
    product = _square(rooted)
    if np.any(weights < 0):
        product -= 2 * _square(rooted[:, weights < 0])
    return product


def gram_diagonal(matrix: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Returns the diagonal of A |W| Aᵀ."""
    return matrix**2 @ np.abs(weights)


def _square(matrix):
    width = max(250_000 // max(len(matrix), 1) ** 2, 1)
    slices = (matrix[:, i : i + width] for i in range(0, matrix.shape[1], width))
    return sum((part @ part.T for part in slices), np.zeros(2 * matrix.shape[:1]))
