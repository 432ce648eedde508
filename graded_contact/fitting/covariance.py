"""The covariance of the unknowns of a fitted series (NumPy).

It is that of a Gauss-Newton fit, C = H⁻¹ (Σ_ij g_i w_i V_ij w_j g_jᵀ) H⁻¹ with H = Σ_i w_i g_i g_iᵀ
and g = ∂ ln m/∂θ. V is the covariance of the errors. Each channel has its own size of errors σ, and
its own correlation of neighbours ρ: errors at a distance of k points have the correlation ρ^k.

The residuals are smaller and less alike than the errors, because the fit follows the errors in
part. σ and ρ therefore come from the restricted likelihood, that of the combinations of the
data that no change of the unknowns alters (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545,
doi:10.1093/biomet/58.3.545):

    -ln L = ½ ln|V| + ½ ln|Gᵀ V⁻¹ G| + ½ (rᵀ V⁻¹ r - bᵀ (Gᵀ V⁻¹ G)⁻¹ b),    b = Gᵀ V⁻¹ r.

Few independent errors leave σ and ρ uncertain. V is therefore the mean over a cloud of (atanh ρ,
ln σ²) about the most likely ones. A systematic misfit of the series is not part of C.
"""

import dataclasses
import functools
import itertools

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import minimize

from .series import Series

# Limits of atanh ρ, and of ln σ² about the mean square. Errors with ρ > 0.95 are rather a misfit.
LIMITS = ((-1.0, 1.8), (-12.0, 12.0))
# Variance of the cloud over that of (atanh ρ, ln σ²). With 1, ± 1.96 standard errors enclose 90 to
# 92 % of the true values at ρ = 0.8; with 2, 92 % and more (`bench_uncertainty.py coverage`).
CLOUD = 2.0
FLATTEST = 2.0  # curvature of -ln L: what the data do not determine has the variance 1/2
STEP = 0.05  # of (atanh ρ, ln σ²) in differences of the likelihood


def covariance(
    series: Series,
    residual: np.ndarray,
    jacobian: np.ndarray,
    free: np.ndarray,
    penalty: np.ndarray | float = 0.0,
    group: np.ndarray | None = None,
) -> np.ndarray:
    """Returns the covariance of the unknowns; those not `free` have none.

    **Arguments:**

    - `residual`, `jacobian`: log residuals, shape `(rows,)`, and their derivatives by the
      unknowns, shape `(unknowns, rows)`.
    - `free`: which unknowns are at no bound.
    - `penalty`: weights of their squares in the cost, from what is expected beforehand.
    - `group`: of each point; neighbours are of the same one. Shape `(points,)`.
    """
    inside = np.abs(residual) <= series.huber
    jacobian = jacobian[free]
    penalty = np.broadcast_to(penalty, len(free))[free]
    hessian = (jacobian * (series.weights * inside)) @ jacobian.T + np.diag(penalty)
    errors = _errors_of(series, residual, jacobian, penalty, group)
    pull = (jacobian * np.sqrt(series.weights))[:, errors.rows].T
    noise = np.diag(penalty * errors.mean_square)
    for parameters in errors.cloud:
        carried = errors.carried(parameters, pull)
        noise += carried.T @ carried / len(errors.cloud)
    diagonal = np.diagonal(hessian)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1))
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(hessian / scale / scale[:, None], rcond=1e-13, hermitian=True)
    inverse = inverse / scale / scale[:, None]
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = inverse @ noise @ inverse
    return spread


def resampled(series: Series, theta: np.ndarray, free: np.ndarray, count: int, seed: int):
    """Returns `count` refits to data with errors drawn anew, shape `(count, unknowns)`.

    Drawn with replacement among those of the same channel is what a residual has beyond what is
    left of its neighbour's (a sieve bootstrap: P. Bühlmann, Bernoulli 3 (1997) 123,
    doi:10.2307/3318584). Each draw has σ and ρ of another point of the cloud.
    """
    generator = np.random.default_rng(seed)
    model = series.model(theta)
    residual, jacobian, _ = series.derivatives(theta)
    errors = _errors_of(series, residual, jacobian[free], np.zeros(np.sum(free)), None)
    root_weights, rows = np.sqrt(series.weights[errors.rows]), errors.rows
    own = errors.whitened(errors.likely, residual[rows] * root_weights)
    channels = [np.flatnonzero(errors.channel == c) for c in np.unique(errors.channel)]
    for places in channels:
        own[places] /= np.sqrt(np.mean(own[places] ** 2)) if np.any(own[places]) else 1.0
    refits = []
    for _ in range(count):
        drawn = np.empty_like(own)
        for places in channels:
            drawn[places] = generator.choice(own[places], len(places))
        drawn = errors.coloured(generator.choice(errors.cloud), drawn) / root_weights
        log_values = series.log_values.copy()
        log_values[rows] = np.log(model[rows]) + drawn
        again = dataclasses.replace(series, log_values=log_values)
        refits.append(again.minimise(theta, rtol=1e-6)[0])
    return np.array(refits)


def _errors_of(series, residual, jacobian, penalty, group) -> "_Errors":
    points = len(series.x)
    group = np.zeros(points, int) if group is None else group
    order = np.lexsort((series.x, group))
    rows = (np.arange(0, len(residual), points)[:, None] + order).ravel()
    rows = rows[series.measured[rows]]
    channel = np.unique(rows // points, return_inverse=True)[1]
    starts = (np.diff(channel) > 0) | (np.diff(group[rows % points]) > 0)
    root_weights = np.sqrt(series.weights[rows])
    errors = root_weights * np.clip(residual[rows], -series.huber, series.huber)
    return _Errors(
        rows=rows,
        channel=channel,
        first=np.append(True, starts),
        errors=errors,
        design=(jacobian[:, rows] * root_weights).T,
        penalty=penalty,
    )


@dataclasses.dataclass(frozen=True, eq=False)
class _Errors:
    """Errors of weight 1, and the parameters (atanh ρ of each channel, ln σ² of each) of their V.

    V⁻¹ = Wᵀ W. Each row of W subtracts from an error what is left of its neighbour's, and divides
    by the standard deviation of the rest. `ln σ²` is relative to `mean_square`.

    **Fields:**

    - `rows`: the measured rows by channel, isotherm and x, so that neighbours follow each other.
    - `channel`: of each of them, counted from 0.
    - `first`: which of them have no neighbour before them.
    - `errors`, `design`: residuals, and derivatives of the model, shape `(rows, unknowns)`.
    - `penalty`: as in `covariance`.
    """

    rows: np.ndarray
    channel: np.ndarray
    first: np.ndarray
    errors: np.ndarray
    design: np.ndarray
    penalty: np.ndarray

    @functools.cached_property
    def mean_square(self) -> float:
        spare = max(len(self.rows) - len(self.penalty), 1)
        return float(np.sum(self.errors**2)) / spare

    def filter(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the diagonal of W and what is left of it, each shape `(rows,)`."""
        alike, log_size = np.split(parameters, 2)
        alike = np.tanh(alike)[self.channel]
        own = np.where(self.first, 1, np.sqrt(1 - alike**2))
        size = np.sqrt(self.mean_square * np.exp(log_size[self.channel]))
        diagonal = 1 / np.where(size > 0, own * size, 1)
        return diagonal, np.where(self.first, 0, -alike * diagonal)

    def whitened(self, parameters: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Returns W times `columns`: of errors, independent ones of unit variance."""
        diagonal, left = self.filter(parameters)
        before = np.concatenate([columns[:1], columns[:-1]])
        return (diagonal * columns.T + left * before.T).T

    def coloured(self, parameters: np.ndarray, independent: np.ndarray) -> np.ndarray:
        """Returns W⁻¹ times independent errors."""
        diagonal, left = self.filter(parameters)
        return solve_banded((1, 0), np.array([diagonal, np.append(left[1:], 0)]), independent)

    def carried(self, parameters: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Returns W⁻ᵀ times `columns`, whose square is columnsᵀ V columns."""
        diagonal, left = self.filter(parameters)
        return solve_banded((0, 1), np.array([np.append(0, left[1:]), diagonal]), columns)

    @functools.cached_property
    def likely(self) -> np.ndarray:
        """The parameters of the largest restricted likelihood."""
        count = self.channel[-1] + 1
        start = np.repeat([0.3, 0.0], count)
        if not self.mean_square:
            return start
        bounds = [limit for limit in LIMITS for _ in range(count)]
        return minimize(self._surprise, start, method="L-BFGS-B", bounds=bounds).x

    @functools.cached_property
    def cloud(self) -> list[np.ndarray]:
        """Equally likely parameters: the corners of a box along the axes of their covariance."""
        steps = STEP * np.eye(len(self.likely))
        if not self.mean_square:
            return [self.likely]
        curvature = np.empty(steps.shape)
        for (i, a), (j, b) in itertools.product(enumerate(steps), repeat=2):
            corners = (self._surprise(self.likely + s * a + t * b) * s * t
                       for s in (-1, 1) for t in (-1, 1))  # fmt: skip
            curvature[i, j] = sum(corners) / (2 * STEP) ** 2
        values, axes = np.linalg.eigh(curvature)
        reach = np.sqrt(CLOUD / np.maximum(values, FLATTEST)) * axes
        lower, upper = np.repeat(LIMITS, len(self.likely) // 2, axis=0).T
        signs = itertools.product((-1, 1), repeat=len(self.likely))
        return [np.clip(self.likely + reach @ sign, lower, upper) for sign in signs]

    @functools.cached_property
    def _orthonormal(self):
        """G in combinations of unknowns whose derivatives are orthonormal, and the penalty."""
        stacked = np.vstack([self.design, np.diag(np.sqrt(self.penalty))])
        scale = np.linalg.norm(stacked, axis=0)
        scale = np.where(scale > 0, scale, 1)
        _, sizes, axes = np.linalg.svd(stacked / scale, full_matrices=False)
        determined = sizes > 1e-7 * np.max(sizes, initial=0)
        combined = (axes[determined].T / sizes[determined]) / scale[:, None]
        return self.design @ combined, combined.T @ (self.penalty[:, None] * combined)

    def _surprise(self, parameters):
        """-ln L, less a constant."""
        design, prior = self._orthonormal
        columns = np.column_stack([design * np.sqrt(self.mean_square), self.errors])
        white = self.whitened(parameters, columns)
        products = white.T @ white
        root = np.linalg.cholesky(products[:-1, :-1] + prior)
        pull = np.linalg.solve(root, products[:-1, -1])
        half_logs = np.sum(np.log(np.diagonal(root))) - np.sum(np.log(self.filter(parameters)[0]))
        return half_logs + (products[-1, -1] - pull @ pull) / 2
