"""The covariance of the unknowns of a fitted series (NumPy).

That of Gauss and Newton, C = H⁻¹ (Σ_c V_c Σ_i w_i² g_i g_iᵀ) H⁻¹ with H = Σ_i w_i g_i g_iᵀ and
g = ∂ ln m/∂θ. The errors of each channel c have their own variance. Where neighbours on an isotherm
are alike, with the correlation ρ, a point tells as much as (1 - ρ)/(1 + ρ) of an independent one,
and V_c is larger by this factor, f.

The residuals are smaller and less alike than the errors, because the fit follows the errors in
part, and the more the more they are alike. With p unknowns, n values and n_c of a channel their
correlation is r = ρ - p/n - (p/n + 2/n_c) ρ, as beside a polynomial of as many coefficients, and
their squares sum to V_c (n_c/f - p n_c/n). `bench_uncertainty.py coverage` checks both.
"""

import numpy as np

from .series import SeriesProblem

LEAST_NOISE = 1e-4  # log residual of a modulus that no instrument, and no search, goes below
LEAST_SPARE = 0.6  # share of the values that the fit leaves free
MOST_ALIKE = 0.85  # errors with a larger ρ are rather a misfit


def covariance(series: SeriesProblem, theta: np.ndarray) -> np.ndarray:
    """Returns the covariance of the unknowns; those at a bound have none.

    Neighbours are of one isotherm. What is expected of shifts counts as known.
    """
    residual, jacobian = series.derivatives(theta)
    free = series.within_bounds(theta)
    jacobian, penalty = jacobian[free], series.penalty(theta)[free]
    root = np.sqrt(np.where(series.measured, series.weights, 0))
    design = (jacobian * root).T
    noise = np.sum(_variances(series, root * residual, len(penalty)), axis=0)
    spread_of_errors = (design.T * noise) @ design
    variance = np.sum((root * residual) ** 2) / max(np.sum(series.measured) - len(penalty), 1)
    spread_of_errors += np.diag(penalty * variance)
    hessian = (jacobian * series.weights) @ jacobian.T + np.diag(penalty)
    diagonal = np.diagonal(hessian)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1))
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(hessian / scale / scale[:, None], rcond=1e-13, hermitian=True)
    inverse = inverse / scale / scale[:, None]
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = inverse @ spread_of_errors @ inverse
    return spread


def _variances(series, errors, unknowns):
    """The variance of each row, 0 in other channels, shape `(channels, rows)`."""
    channels = np.eye(len(errors) // len(series.x))
    group = np.zeros(len(series.x)) if series.group is None else series.group
    order = np.lexsort((series.x, group))
    together = np.diff(group[order]) == 0
    found = []
    for own, values in zip(channels, series.by_channel(errors), strict=True):
        values, count = values[order], np.count_nonzero(values)
        share = unknowns / np.sum(series.measured)
        square, factor = np.sum(values**2), 1.0
        if square:
            neighbours = np.sum((values[1:] * values[:-1])[together]) / square
            alike = (neighbours + share) / max(1 - share - 2 / count, 0.5)
            alike = np.clip(alike, 0, MOST_ALIKE)
            factor = (1 + alike) / (1 - alike)
        spare = max(count * (1 - share * factor), LEAST_SPARE * count, 1)
        found.append((square / spare * factor + LEAST_NOISE**2) * np.repeat(own, len(series.x)))
    return np.array(found)
