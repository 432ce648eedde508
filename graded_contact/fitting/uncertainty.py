"""How well the unknowns of a fitted series are known (NumPy).

The covariance is that of a Gauss-Newton fit whose channels have noise of different size,
C = H⁻¹ (Σ_i w_i s²_i g_i g_iᵀ) H⁻¹ with H = Σ_i w_i g_i g_iᵀ and g = ∂ ln m/∂θ, the noise s of a
channel being estimated from its residuals. It holds for independent errors about a series of the
fitted length; it knows nothing of a systematic misfit.
"""

import dataclasses

import numpy as np

from .series import Series


def covariance(
    series: Series,
    residual: np.ndarray,
    jacobian: np.ndarray,
    free: np.ndarray,
    penalty: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Returns the covariance of the unknowns; those not `free` have none.

    **Arguments:**

    - `residual`, `jacobian`: log residuals, shape `(rows,)`, and their derivatives by the
      unknowns, shape `(unknowns, rows)`.
    - `free`: which unknowns are at no bound.
    - `penalty`: weights of their squares in the cost, from what is expected beforehand.
    """
    variance = row_variance(series, residual, free)
    inside = np.abs(residual) <= series.huber
    jacobian = jacobian[free]
    penalty = np.diag(np.broadcast_to(penalty, len(free))[free])
    hessian = (jacobian * (series.weights * inside)) @ jacobian.T + penalty
    noise = np.where(series.measured, series.weights, 0) * variance
    noise = (jacobian * noise) @ jacobian.T + penalty * np.mean(variance[series.measured])
    diagonal = np.diagonal(hessian)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1))
    # Directions that rounding alone determines are left out.
    inverse = np.linalg.pinv(hessian / scale / scale[:, None], rcond=1e-13, hermitian=True)
    inverse = inverse / scale / scale[:, None]
    spread = np.zeros((len(free), len(free)))
    spread[np.ix_(free, free)] = inverse @ noise @ inverse
    return spread


def row_variance(series: Series, residual: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Returns the variance of a log residual of weight 1 in each row's channel."""
    channel = np.arange(len(residual)) // len(series.x)
    counted = series.measured
    squares = series.weights * np.clip(residual, -series.huber, series.huber) ** 2
    total = np.sum(counted)
    spare = max(total - np.sum(free), 1)
    variance = np.zeros(len(residual))
    for c in range(channel[-1] + 1):
        rows = counted & (channel == c)
        if np.any(rows):
            variance[channel == c] = np.mean(squares[rows]) * total / spare
    return variance


def resampled(series: Series, theta: np.ndarray, free: np.ndarray, count: int, seed: int):
    """Returns `count` refits to data with residuals drawn anew, shape `(count, unknowns)`.

    Residuals are drawn with replacement among those of the same channel, enlarged to make up for
    the unknowns fitted.
    """
    generator = np.random.default_rng(seed)
    model = series.model(theta)
    residual = series.residual(model)
    counted = series.measured
    root_weights = np.sqrt(np.where(counted, series.weights, 1))
    channel = np.arange(len(residual)) // len(series.x)
    enlarged = residual * root_weights
    enlarged *= np.sqrt(np.sum(counted) / max(np.sum(counted) - np.sum(free), 1))
    refits = []
    for _ in range(count):
        drawn = np.zeros(len(residual))
        for c in range(channel[-1] + 1):
            rows = np.flatnonzero(counted & (channel == c))
            drawn[rows] = generator.choice(enlarged[rows], len(rows))
        log_values = np.where(counted, np.log(model) + drawn / root_weights, series.log_values)
        again = dataclasses.replace(series, log_values=log_values)
        refits.append(again.minimise(theta, rtol=1e-6)[0])
    return np.array(refits)
