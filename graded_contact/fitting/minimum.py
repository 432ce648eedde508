"""Minimum of a sum of squares of a few dozen unknowns between bounds.

SciPy's trust region -> Newton's steps, for the last digits
"""

from collections.abc import Callable

import numpy as np
import scipy

AT_BOUND = 1e-6  # distance to a bound, which the trust region only approaches
DIFFERENCE = 1e-5  # of an unknown, for differences of the gradient
LONGEST_STEP = 0.1  # of Newton; each further one is at most a tenth as long
SINGULAR = 1e-13  # eigenvalue of a Hessian scaled to a unit diagonal, below which rounding decides
Function = Callable[[np.ndarray], np.ndarray]
Fitted = tuple[np.ndarray, float]  # the unknowns of a minimum, and half the sum of squares


def least_squares(
    residual: Function,
    jacobian: Function,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    rtol: float,
    max_steps: int = 100,
) -> Fitted:
    """Returns the point and half the sum of squares of a local minimum between bounds.

    Ends when a step lowers the sum by less than the relative `rtol`. With `rtol=0` the point has
    the digits that rounding leaves: the sum alone, known to rounding, leaves half of them open.

    **Arguments:**

    - `residual`, `jacobian`: return residuals, shape `(rows,)`, and their derivatives, shape
      `(rows, unknowns)`.
    """
    if not len(start):
        return start, float(np.sum(residual(start) ** 2)) / 2
    with np.errstate(all="ignore"):  # a trial far off may overflow; it is then not taken
        found = scipy.optimize.least_squares(
            residual,
            np.clip(start, lower, upper),
            jacobian,
            bounds=(lower, upper),
            ftol=max(rtol, 1e-14),
            xtol=None,
            gtol=None,
            max_nfev=max_steps,
        )
    point = np.where(found.x < lower + AT_BOUND, lower, found.x)
    point = np.where(point > upper - AT_BOUND, upper, point)
    if rtol == 0:
        point = _last_digits(residual, jacobian, point, lower, upper)
    return point, float(found.cost)


def _last_digits(residual, jacobian, point, lower, upper):
    """Takes Newton's steps of the unknowns between their bounds, unless one leaves these."""
    free = (point > lower) & (point < upper)

    def gradient(change):
        moved = point.copy()
        moved[free] += change
        return residual(moved) @ jacobian(moved)[:, free]

    moves = DIFFERENCE * np.eye(np.sum(free))
    hessian = np.array([gradient(move) - gradient(-move) for move in moves]) / (2 * DIFFERENCE)
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diagonal(hessian)), 1e-300))
    scaled = scale * scale[:, None] * (hessian + hessian.T) / 2
    stiffness, directions = np.linalg.eigh(scaled)
    along = directions[:, stiffness > SINGULAR] * scale[:, None]
    inverse = along / stiffness[stiffness > SINGULAR] @ along.T
    moved, longest = point.copy(), LONGEST_STEP
    while np.any(free):
        step = inverse @ (residual(moved) @ jacobian(moved)[:, free])
        if not np.max(np.abs(step)) < longest:
            break
        moved[free] -= step
        longest = np.max(np.abs(step)) / 10
    return moved if np.all((moved >= lower) & (moved <= upper)) else point
