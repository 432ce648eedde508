"""How well a series is known: covariance of its unknowns, errors, report (NumPy).

A Gauss-Newton fit has the covariance C = H⁻¹ (Σ_ij g_i w_i V_ij w_j g_jᵀ) H⁻¹ with
H = Σ_i w_i g_i g_iᵀ and g = ∂ ln m/∂θ. V is the covariance of the errors. Each channel has its own
size of errors σ, and its own correlation of neighbours ρ: errors at a distance of k points have the
correlation ρ^k.

The residuals are smaller and less alike than the errors, because the fit follows the errors in
part. σ and ρ therefore come from the restricted likelihood, that of the combinations of the
data that no change of the unknowns alters (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545,
doi:10.1093/biomet/58.3.545):

    -ln L = ½ ln|V| + ½ ln|Gᵀ V⁻¹ G| + ½ (rᵀ V⁻¹ r - bᵀ (Gᵀ V⁻¹ G)⁻¹ b),    b = Gᵀ V⁻¹ r.

Few independent errors leave σ and ρ uncertain. V is therefore the mean over a cloud of (atanh ρ,
ln σ²) about the most likely ones. A systematic misfit of the series is not part of C.
"""

import dataclasses
import itertools
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..core.display import shown
from .series import SeriesProblem

# Limits of atanh ρ, and of ln σ² about the mean square. Errors with ρ > 0.95 are rather a misfit.
BOUNDS = ((-1.0, 1.8), (-12.0, 12.0))
# Variance of the cloud over that of (atanh ρ, ln σ²). With 1, ± 1.96 standard errors enclose 90 to
# 92 % of the true values at ρ = 0.8; with 2, 92 % and more (`bench_uncertainty.py`).
CLOUD = 2.0
FLATTEST = 2.0  # curvature of -ln L: what the data do not determine has the variance 1/2
LEAST_NOISE = 1e-4  # log residual of a modulus that no instrument, and no search, goes below
LIKELIHOOD_STEP = 0.05  # of (atanh ρ, ln σ²) in differences of the likelihood
RIDGE = 1e-13  # on the diagonal of a matrix, relative: far below what data determine
FAR = 5  # robust standard deviations
MOST_NAMED = 10


def covariance(series: SeriesProblem, theta: np.ndarray) -> np.ndarray:
    """Returns the covariance of the unknowns; those at a bound have none.

    Neighbours are of one isotherm. What is expected of shifts counts as known.
    """
    residual, jacobian = series.derivatives(theta)
    free = series.within_bounds(theta)
    jacobian, penalty = jacobian[free], series.penalty(theta)[free]
    hessian = (jacobian * series.weights) @ jacobian.T + np.diag(penalty)
    diagonal = np.diagonal(hessian)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1))
    rows = np.flatnonzero(series.measured)
    channel, point = np.divmod(rows, len(series.x))
    group = np.zeros(len(rows), int) if series.group is None else series.group[point]
    order = np.lexsort((series.x[point], group, channel))
    rows, group = rows[order], group[order]
    channel = np.unique(channel[order], return_inverse=True)[1]
    root = np.sqrt(series.weights[rows])
    noise = _Errors(
        channel=channel,
        first=np.append(True, (np.diff(channel) > 0) | (np.diff(group) > 0)),
        values=root * residual[rows],
        design=(jacobian[:, rows] * root).T * scale,
        penalty=penalty * scale**2,
    ).noise()
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(hessian * scale * scale[:, None], rcond=1e-13, hermitian=True)
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = scale * scale[:, None] * (inverse @ noise @ inverse)
    return spread


@dataclasses.dataclass(frozen=True, eq=False)
class _Errors:
    """Errors of weight 1, and the parameters (atanh ρ of each channel, ln σ² of each) of their V.

    **Fields:** (rows by channel, isotherm and x, so that neighbours follow each other)

    - `channel`: of each row, counted from 0.
    - `first`: which of them have no neighbour before them.
    - `values`, `design`: residuals, and derivatives of the model, shape `(rows, unknowns)`.
    - `penalty`: weights of the squares of the unknowns in the cost.
    """

    channel: np.ndarray
    first: np.ndarray
    values: np.ndarray
    design: np.ndarray
    penalty: np.ndarray

    @property
    def mean_square(self) -> float:
        return float(self.values @ self.values) / max(len(self.values) - len(self.penalty), 1)

    def filter(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns W of V⁻¹ = Wᵀ W: its diagonal, and what is left of it.

        A row of W subtracts from an error what its neighbour tells, and divides by the standard
        deviation of the rest. `ln σ²` is relative to `mean_square`.
        """
        alike, log_size = np.split(parameters, 2)
        alike = np.where(self.first, 0, np.tanh(alike)[self.channel])
        variance = self.mean_square * np.exp(log_size)[self.channel]
        diagonal = 1 / np.sqrt((1 - alike**2) * variance)
        return diagonal, -alike * diagonal

    def noise(self) -> np.ndarray:
        """Returns Gᵀ V G, V being the mean over the cloud, and the errors of what is expected.

        No search ends so near to exact data that its distance is not a part of V.
        """
        noise = np.diag(self.penalty * self.mean_square)
        noise += LEAST_NOISE**2 * self.design.T @ self.design
        if not self.mean_square:
            return noise
        cloud = self.cloud()
        for parameters in cloud:
            diagonal, left = self.filter(parameters)
            bands = np.array([np.append(0, left[1:]), diagonal])
            carried = scipy.linalg.solve_banded((0, 1), bands, self.design)  # W⁻ᵀ G
            noise += carried.T @ carried / len(cloud)
        return noise

    def cloud(self) -> list[np.ndarray]:
        """Returns equally likely parameters about those of the largest restricted likelihood.

        They are the corners of a box along the axes of their covariance.
        """
        bounds = np.repeat(BOUNDS, self.channel[-1] + 1, axis=0)
        likely = np.repeat([0.3, 0.0], self.channel[-1] + 1)
        likely = scipy.optimize.minimize(self.surprise, likely, method="L-BFGS-B", bounds=bounds).x
        steps = LIKELIHOOD_STEP * np.eye(len(likely))
        curvature = np.empty(steps.shape)
        for (i, a), (j, b) in itertools.product(enumerate(steps), repeat=2):
            corners = (
                s * t * self.surprise(likely + s * a + t * b) for s in (-1, 1) for t in (-1, 1)
            )
            curvature[i, j] = sum(corners) / (2 * LIKELIHOOD_STEP) ** 2
        values, axes = np.linalg.eigh(curvature)
        reach = np.sqrt(CLOUD / np.maximum(values, FLATTEST)) * axes
        signs = itertools.product((-1, 1), repeat=len(likely))
        return [np.clip(likely + reach @ sign, *bounds.T) for sign in signs]

    def surprise(self, parameters: np.ndarray) -> float:
        """Returns -ln L, less a constant."""
        columns = np.column_stack([self.design, self.values])
        diagonal, left = self.filter(parameters)
        before = np.concatenate([columns[:1], columns[:-1]])
        white = (diagonal * columns.T + left * before.T).T  # W times the columns
        products = white.T @ white
        stiffness = products[:-1, :-1] + np.diag(self.penalty / self.mean_square)
        stiffness += RIDGE * np.diag(np.diagonal(stiffness))
        root = np.linalg.cholesky(stiffness)
        pull = np.linalg.solve(root, products[:-1, -1])
        half_logs = np.sum(np.log(np.diagonal(root))) - np.sum(np.log(diagonal))
        return half_logs + (products[-1, -1] - pull @ pull) / 2


@shown()
class FitErrors(NamedTuple):
    """Root-mean-square of ln(model/measured) [1], of all values, of storage and of loss.

    A channel without measured values has none; moduli in time are all `storage`.
    """

    total: float
    storage: float | None
    loss: float | None


def fit_errors(series: SeriesProblem, theta: np.ndarray) -> FitErrors:
    """Returns the errors of the fit `theta`."""
    weights, storage = series.weights, np.arange(len(series.weights)) < len(series.x)
    misfit = series.misfit(theta) ** 2
    total, *parts = (
        float(np.sqrt(np.average(misfit, weights=some))) if np.any(some) else None
        for some in (weights, weights * storage, weights * ~storage)
    )
    assert total is not None
    return FitErrors(total, *parts)


def far_values(series: SeriesProblem, theta: np.ndarray) -> tuple[str, ...]:
    """Returns a sentence that names the values beyond five robust deviations of their channel."""
    names = ("storage", "loss") if series.kind == "frequency" else ("value",)
    unit, found = "rad/s" if series.kind == "frequency" else "s", []
    rows = zip(names, *map(series.by_channel, (series.misfit(theta), series.measured)), strict=True)
    for name, misfit, measured in rows:
        usual = 1.4826 * np.median(np.abs(misfit[measured])) if np.any(measured) else np.inf
        for i in np.flatnonzero(measured & (np.abs(misfit) > FAR * max(usual, LEAST_NOISE))):
            kelvin = ""
            if series.isotherms is not None:
                kelvin = f" and {float(series.isotherms.temperatures[series.group[i]]):.2f} K"
            off = np.expm1(-misfit[i])
            found.append(f"{name} at {series.x[i]:.4g} {unit}{kelvin} ({off:+.0%})")
    if not found:
        return ()
    named = ", ".join(found[:MOST_NAMED]) + (", ..." if len(found) > MOST_NAMED else "")
    remedy = "" if series.scale is not None else ', or fit with `loss="soft_l1"`'
    return (
        f"{len(found)} values lie beyond {FAR} standard deviations (by the median) of the fit: "
        f"{named}. Correct them, leave them out (NaN){remedy}.",
    )


def report_of(fit: Any, warnings: tuple[str, ...]) -> str:
    """Returns the report of a `PronyFit`: end values, errors, warnings and the lengths tried."""
    import pandas as pd

    material, (lowest, highest) = fit.material, fit.material.coverage()
    errors = {name: percent(error) for name, error in fit.errors()._asdict().items() if error}
    lines = [
        f"{fit.terms} terms, E_eq = {float(material.equilibrium):.4g} Pa, "
        f"E_inf = {float(material.glassy):.4g} Pa, Poisson's ratio {float(fit.poisson):.3g}",
        f"Measured from {float(lowest):.4g} to {float(highest):.4g} rad/s; beyond, the series is "
        "an extrapolation.",
        "rms of ln(fit/measured): " + ", ".join(f"{k} {v}" for k, v in errors.items()),
        *(f"Warning: {sentence}" for sentence in warnings),
    ]
    if fit.path:
        path = pd.DataFrame(fit.path).rename(columns={"bic": "BIC"})
        path[""] = np.where(path["terms"] == fit.terms, "*", "")
        formats = [str, percent, "{:.1f}".format, str]
        lines += ["", path.to_string(index=False, formatters=formats)]
    return "\n".join(lines)


def percent(value: float) -> str:
    """Returns a share as text."""
    return f"{100 * value:.3g} %"
