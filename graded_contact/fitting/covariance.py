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

Where a series follows most of few points (20 of a tread, 4 or 5 terms), independent errors may look
like larger ones with ρ near 0.9, which the series hides: in one of 40 draws the standard error was
12 times too large. A prior on ln σ² (a normal one of deviation 2) takes this to 4, but of errors
with ρ = 0.8 one standard error then encloses the truth in 48 % in place of 68 %: there is none.
"""

import dataclasses
import functools
import itertools

import numpy as np
import scipy

from .alignment import unseen
from .series import SeriesProblem

# Limits of atanh ρ, and of ln σ² about the mean square. Errors with ρ > 0.95 are rather a misfit.
BOUNDS = ((-1.0, 1.8), (-12.0, 12.0))
# Variance of the cloud over that of (atanh ρ, ln σ²). With 1, ± 1.96 standard errors enclose 90 to
# 92 % of the true values at ρ = 0.8; with 2, 92 % and more (`bench_uncertainty.py coverage`).
CLOUD = 2.0
FLATTEST = 2.0  # curvature of -ln L: what the data do not determine has the variance 1/2
# Log residual of a modulus that no instrument, and no search of spectra, goes below.
LEAST_NOISE = 1e-4
LIKELIHOOD_STEP = 0.05  # of (atanh ρ, ln σ²) in differences of the likelihood


def covariance(series: SeriesProblem, theta: np.ndarray) -> np.ndarray:
    """Returns the covariance of the unknowns; those at a bound have none.

    Neighbours are of one isotherm. What is expected of shifts counts as known. Other shifts
    that are about as likely lie within the standard deviations.
    """
    residual, jacobian, *_ = series.derivatives(theta)
    free = series.within_bounds(theta)
    jacobian, penalty = jacobian[free], series.penalty(theta)[free]
    hessian = (jacobian * series.weights) @ jacobian.T + np.diag(penalty)
    rows = np.flatnonzero(series.measured)
    channel, point = np.divmod(rows, len(series.x))
    group = np.zeros(len(rows), int) if series.group is None else series.group[point]
    order = np.lexsort((series.x[point], group, channel))
    rows, group = rows[order], group[order]
    channel = np.unique(channel[order], return_inverse=True)[1]
    first = np.append(True, (np.diff(channel) > 0) | (np.diff(group) > 0))
    root_weights = np.sqrt(series.weights[rows])
    errors, design = root_weights * residual[rows], (jacobian[:, rows] * root_weights).T
    noise = _NoiseModel(channel, first, errors, design, penalty).noise()
    diagonal = np.diagonal(hessian)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1))
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(hessian / scale / scale[:, None], rcond=1e-13, hermitian=True)
    inverse = inverse / scale / scale[:, None]
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = inverse @ noise @ inverse
    if series.isotherms:
        shifts = slice(len(theta) - series.num_shifts, None)
        for changes in (np.asarray(series.isotherms.rivals), unseen(series, theta)):
            spread[shifts, shifts] += changes.T @ changes
    return spread


@dataclasses.dataclass(frozen=True, eq=False)
class _NoiseModel:
    """Errors of weight 1, and the parameters (atanh ρ of each channel, ln σ² of each) of their V.

    V⁻¹ = Wᵀ W. Each row of W subtracts from an error what is left of its neighbour's, and divides
    by the standard deviation of the rest. `ln σ²` is relative to `mean_square`.

    **Fields:** (rows by channel, isotherm and x, so that neighbours follow each other)

    - `channel`: of each row, counted from 0.
    - `first`: which of them have no neighbour before them.
    - `errors`, `design`: residuals, and derivatives of the model, shape `(rows, unknowns)`.
    - `penalty`: weights of the squares of the unknowns in the cost.
    """

    channel: np.ndarray
    first: np.ndarray
    errors: np.ndarray
    design: np.ndarray
    penalty: np.ndarray

    @functools.cached_property
    def mean_square(self) -> float:
        spare = max(len(self.errors) - len(self.penalty), 1)
        return float(np.sum(self.errors**2)) / spare

    def filter(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the diagonal of W and what is left of it, each shape `(rows,)`."""
        alike, log_size = np.split(parameters, 2)
        alike = np.tanh(alike)[self.channel]
        own = np.where(self.first, 1, np.sqrt(1 - alike**2))
        size = np.sqrt(self.mean_square * np.exp(log_size[self.channel]))
        diagonal = 1 / np.where(size > 0, own * size, 1)
        return diagonal, np.where(self.first, 0, -alike * diagonal)

    def noise(self) -> np.ndarray:
        """Returns Gᵀ V G, V being the mean over the cloud, and the errors of what is expected.

        No search ends so near to exact data that its distance is not a part of V.
        """
        noise, cloud = np.diag(self.penalty * self.mean_square), self.cloud()
        noise += LEAST_NOISE**2 * self.design.T @ self.design
        for parameters in cloud:
            diagonal, left = self.filter(parameters)
            bands = np.array([np.append(0, left[1:]), diagonal])
            carried = scipy.linalg.solve_banded((0, 1), bands, self.design)  # W⁻ᵀ G
            noise += carried.T @ carried / len(cloud)
        return noise

    def cloud(self) -> list[np.ndarray]:
        """Equally likely parameters about those of the largest restricted likelihood.

        They are the corners of a box along the axes of their covariance.
        """
        count = self.channel[-1] + 1
        likely, (lower, upper) = np.repeat([0.3, 0.0], count), np.repeat(BOUNDS, count, axis=0).T
        if not self.mean_square:
            return [likely]
        bounds = list(zip(lower, upper, strict=True))
        likely = scipy.optimize.minimize(self._surprise, likely, method="L-BFGS-B", bounds=bounds).x
        steps = LIKELIHOOD_STEP * np.eye(len(likely))
        curvature = np.empty(steps.shape)
        for (i, a), (j, b) in itertools.product(enumerate(steps), repeat=2):
            corners = (self._surprise(likely + s * a + t * b) * s * t
                       for s in (-1, 1) for t in (-1, 1))  # fmt: skip
            curvature[i, j] = sum(corners) / (2 * LIKELIHOOD_STEP) ** 2
        values, axes = np.linalg.eigh(curvature)
        reach = np.sqrt(CLOUD / np.maximum(values, FLATTEST)) * axes
        signs = itertools.product((-1, 1), repeat=len(likely))
        return [np.clip(likely + reach @ sign, lower, upper) for sign in signs]

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
        diagonal, left = self.filter(parameters)
        before = np.concatenate([columns[:1], columns[:-1]])
        white = (diagonal * columns.T + left * before.T).T  # W times the columns
        products = white.T @ white
        root = np.linalg.cholesky(products[:-1, :-1] + prior)
        pull = np.linalg.solve(root, products[:-1, -1])
        half_logs = np.sum(np.log(np.diagonal(root))) - np.sum(np.log(diagonal))
        return half_logs + (products[-1, -1] - pull @ pull) / 2
