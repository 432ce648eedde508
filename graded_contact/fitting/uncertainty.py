"""How well the unknowns of a fitted series are known (NumPy).

The covariance is that of a Gauss-Newton fit, C = H⁻¹ (Σ_ij g_i w_i V_ij w_j g_jᵀ) H⁻¹ with
H = Σ_i w_i g_i g_iᵀ and g = ∂ ln m/∂θ. The errors V have a size of their own in each channel, and
neighbours in it err alike: k points on, what is left of an error is ρ^k. Size and ρ are estimated
from the residuals. The errors that a shorter series would follow are seen, those that this one
follows are not: it knows nothing of a systematic misfit.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from .series import Series

BY_CHANCE = 2.0  # over √n: likeness of neighbours that n independent errors may show


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
    penalty = np.diag(np.broadcast_to(penalty, len(free))[free])
    hessian = (jacobian * (series.weights * inside)) @ jacobian.T + penalty
    variance, noise = 0.0, np.zeros_like(hessian)
    for squares, alike, runs in _errors(series, residual, free, group):
        for rows in runs:
            pull = jacobian[:, rows] * np.sqrt(squares * series.weights[rows])
            pull = _carried(pull, alike)
            noise += pull @ pull.T
            variance += squares * len(rows) / np.sum(series.measured)
    diagonal = np.diagonal(hessian)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1))
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(hessian / scale / scale[:, None], rcond=1e-13, hermitian=True)
    inverse = inverse / scale / scale[:, None]
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = inverse @ (noise + penalty * variance) @ inverse
    return spread


def resampled(series: Series, theta: np.ndarray, free: np.ndarray, count: int, seed: int):
    """Returns `count` refits to data with residuals drawn anew, shape `(count, unknowns)`.

    Drawn with replacement among those of the same channel is what a residual has beyond what is
    left of its neighbour's (a sieve bootstrap: P. Bühlmann, Bernoulli 3 (1997) 123,
    doi:10.2307/3318584), enlarged to make up for the unknowns fitted.
    """
    generator = np.random.default_rng(seed)
    model = series.model(theta)
    residual = series.residual(model)
    errors = list(_errors(series, residual, free, None))
    refits = []
    for _ in range(count):
        log_values = series.log_values.copy()
        for squares, alike, runs in errors:
            for rows in runs:
                root_weights = np.sqrt(series.weights[rows])
                own = _own(residual[rows] * root_weights, alike)
                own *= np.sqrt(squares / np.mean(own**2)) if np.any(own) else 0.0
                drawn = _left(generator.choice(own, len(rows)), alike) / root_weights
                log_values[rows] = np.log(model[rows]) + drawn
        again = dataclasses.replace(series, log_values=log_values)
        refits.append(again.minimise(theta, rtol=1e-6)[0])
    return np.array(refits)


def _errors(series, residual, free, group) -> Iterator[tuple[float, float, list[np.ndarray]]]:
    """Of each channel: variance of an error of weight 1, ρ, and the rows of neighbours in order."""
    points = len(series.x)
    group = np.zeros(points, int) if group is None else group
    spare = max(np.sum(series.measured) - np.sum(free), 1)
    errors = np.sqrt(series.weights) * np.clip(residual, -series.huber, series.huber)
    order = np.lexsort((series.x, group))
    for first in range(0, len(residual), points):
        order_here = first + order[series.measured[first + order]]
        if not len(order_here):
            continue
        cuts = np.flatnonzero(np.diff(group[order_here - first])) + 1
        runs = np.split(order_here, cuts)
        total = np.sum(errors[order_here] ** 2)
        both = sum(np.sum(errors[rows][1:] * errors[rows][:-1]) for rows in runs)
        alike = both / total if total > 0 else 0.0
        alike = alike if alike > BY_CHANCE / np.sqrt(len(order_here)) else 0.0
        yield total / len(order_here) * np.sum(series.measured) / spare, alike, runs


def _left(own, alike):
    """Errors of which each is what is left of the one before, and something of its `own`."""
    errors = own.copy()
    for i in range(1, len(own)):
        errors[i] = alike * errors[i - 1] + np.sqrt(1 - alike**2) * own[i]
    return errors


def _own(errors, alike):
    """What `_left` makes errors of."""
    return np.append(errors[:1], (errors[1:] - alike * errors[:-1]) / np.sqrt(1 - alike**2))


def _carried(rows, alike):
    """Rows times L, where L Lᵀ is the correlation ρ^|i-j| of columns: `_left` transposed."""
    carried = rows.copy()
    for i in range(rows.shape[1] - 2, -1, -1):
        carried[:, i] += alike * carried[:, i + 1]
    carried[:, 1:] *= np.sqrt(1 - alike**2)
    return carried
