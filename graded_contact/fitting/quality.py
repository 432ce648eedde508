"""How well a series is known: covariance of its unknowns, errors, report (NumPy).

A Gauss-Newton fit has the covariance C = H⁻¹ Gᵀ V G H⁻¹ with H = Gᵀ G and G = ∂ ln m/∂θ. V is the
covariance of the errors: each channel has its own size, and errors at a distance of k points have
the correlation ρ^k.

The residuals are smaller and less alike than the errors, because the fit follows the errors in
part. ρ therefore has the restricted likelihood, of the combinations of the data that no change of
the unknowns alters (H. D. Patterson, R. Thompson, Biometrika 58 (1971) 545,
doi:10.1093/biomet/58.3.545). Few independent errors leave ρ uncertain: V is the mean over ρ with
this likelihood. A systematic misfit of the series is not part of C.
"""

from typing import Any

import numpy as np
import scipy

from .series import SeriesProblem

ALIKE = np.linspace(-0.75, 0.95, 35)  # trial ρ: errors more alike than these are rather a misfit
LEAST_NOISE = 1e-4  # log residual of a modulus that no instrument, and no search, goes below
FAR = 5  # robust standard deviations
MOST_NAMED = 10


def covariance(series: SeriesProblem, theta: np.ndarray) -> np.ndarray:
    """Returns the covariance of the unknowns; it is zero for unknowns at a bound.

    Neighbours are of one isotherm. The expected sizes of shifts count as known.
    """
    residual, jacobian = series.derivatives(theta)
    free = series.within_bounds(theta)
    rows, channel, first = _in_order(series)
    root, penalty = np.sqrt(series.weights[rows]), series.penalty(theta)[free]
    errors, design = root * residual[rows], root[:, None] * jacobian[free][:, rows].T
    scale = 1 / np.sqrt(np.maximum(np.sum(design**2, axis=0) + penalty, 1e-300))
    design, penalty = design * scale, penalty * scale**2
    counts = np.maximum(np.bincount(channel), 1)
    size = np.sqrt(np.bincount(channel, errors**2) / counts)[channel] + LEAST_NOISE
    usual = np.mean(size**2)
    tied = np.diag(np.sqrt(penalty / usual))
    by_distance = _alike(np.column_stack([design, errors]) / size[:, None], tied, first)
    noise = np.diag(penalty * usual)
    for run in np.split(design * size[:, None], np.flatnonzero(first)[1:]):
        noise += run.T @ scipy.linalg.toeplitz(by_distance[: len(run)]) @ run
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(design.T @ design + np.diag(penalty), rcond=1e-13, hermitian=True)
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = scale * scale[:, None] * (inverse @ noise @ inverse)
    return spread


def _in_order(series):
    """Measured rows by channel, isotherm and x; their channel, and which have none before them."""
    rows = np.flatnonzero(series.measured)
    channel, point = np.divmod(rows, len(series.x))
    group = np.zeros(len(rows), int) if series.group is None else series.group[point]
    order = np.lexsort((series.x[point], group, channel))
    channel, group = channel[order], group[order]
    first = (np.diff(channel, prepend=-1) != 0) | (np.diff(group, prepend=-1) != 0)
    return rows[order], channel, first


def _alike(columns: np.ndarray, tied: np.ndarray, first: np.ndarray) -> np.ndarray:
    """The covariance of errors by their distance in points, the mean over ρ.

    `columns` are the design and the errors, `tied` the rows of the expected sizes of unknowns. The
    triangle of a QR decomposition of whitened columns has the determinant and the misfit.
    """
    spare, logs, variances = max(len(columns) - len(tied), 1), [], []
    before = np.where(first[:, None], 0, np.roll(columns, 1, axis=0))
    tied = np.column_stack([tied, np.zeros(len(tied))])
    for rho in ALIKE:
        white = (columns - rho * before) / np.sqrt(np.where(first, 1, 1 - rho**2))[:, None]
        triangle = np.linalg.qr(np.concatenate([white, tied]), mode="r")
        *known, misfit = np.log(np.abs(np.diagonal(triangle)) + 1e-30)
        logs.append(-np.sum(~first) * np.log(1 - rho**2) / 2 - np.sum(known) - spare * misfit)
        variances.append(np.exp(2 * misfit) / spare)
    likely = np.exp(logs - np.max(logs))
    return likely / np.sum(likely) * variances @ ALIKE[:, None] ** np.arange(len(columns))


def fit_errors(series: SeriesProblem, theta: np.ndarray) -> dict[str, float]:
    """Returns root-mean-squares of ln(model/measured) [1], of all values and of each modulus."""
    squares, weights = map(series.by_channel, (series.misfit(theta) ** 2, series.weights))
    parts = {"total": (squares, weights)}
    if series.kind == "frequency":
        parts |= zip(("storage", "loss"), zip(squares, weights, strict=True), strict=True)
    return {
        name: float(np.sqrt(np.average(square, weights=weight)))
        for name, (square, weight) in parts.items()
        if np.any(weight)
    }


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
    errors = ", ".join(f"{name} {percent(error)}" for name, error in fit.errors().items())
    lines = [
        f"{fit.terms} terms, E_eq = {float(material.equilibrium):.4g} Pa, "
        f"E_inf = {float(material.glassy):.4g} Pa, Poisson's ratio {float(fit.poisson):.3g}",
        f"Measured from {float(lowest):.4g} to {float(highest):.4g} rad/s; beyond, the series is "
        "an extrapolation.",
        f"rms of ln(fit/measured): {errors}",
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
