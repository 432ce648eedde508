"""Minimum of a sum of squares between bounds: SciPy's trust region, and Newton's last digits.

    least_squares (J in closed form) -> unknowns near a bound to the bound -> Newton's steps

BLAS has one thread: on matrices of this size more gain nothing, and on a busy machine they cost a
hundredfold.
"""

from collections.abc import Callable

import numpy as np
import scipy

from ..core.compilation import one_thread_of_lapack

NEAR_BOUND = 0.05  # the trust region ends inside of its bounds: all unknowns are logarithms
STEP = 1e-5  # of an unknown, for differences of the gradient
SINGULAR = 1e-13  # eigenvalue of a Hessian scaled to a unit diagonal, below which rounding decides
Fitted = tuple[np.ndarray, float]  # the unknowns of a minimum, and half the sum of squares


def least_squares(
    residuals: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    rtol: float,
    max_steps: int = 300,
) -> Fitted:
    """Returns the point and half the sum of squares of a local minimum between bounds.

    Ends when a step lowers the sum by less than the relative `rtol`. With `rtol=0` the point has
    the digits that rounding leaves: the sum alone, known to rounding, leaves half of them open.
    """
    if not len(start):
        return start, float(np.sum(residuals(start) ** 2)) / 2
    room = 1e-9 * np.maximum(1, np.abs(start))
    start = np.clip(start, lower + room, upper - room)
    # A trial far off may overflow; it is then not taken.
    with one_thread_of_lapack, np.errstate(all="ignore"):
        found = scipy.optimize.least_squares(
            residuals,
            start,
            jacobian,
            (lower, upper),
            ftol=max(rtol, 1e-14),
            xtol=1e-15,
            gtol=None,
            max_nfev=max_steps,
        )
        point, cost = found.x, float(found.cost)
        if rtol == 0:
            point = _to_bounds(residuals, jacobian, point, lower, upper)
            point = _last_digits(residuals, jacobian, point, lower, upper)
            cost = _cost(residuals, point)
    return point, cost


def _cost(residuals, point):
    return float(np.sum(residuals(point) ** 2)) / 2


def _gradient(residuals, jacobian, point):
    return jacobian(point).T @ residuals(point)


def _to_bounds(residuals, jacobian, point, lower, upper):
    """The point with unknowns at the bounds near to which the gradient pushes them."""
    downwards = _gradient(residuals, jacobian, point) > 0
    bound = np.where(downwards, lower, upper)
    moved = np.where(np.abs(bound - point) < NEAR_BOUND, bound, point)
    return moved if _cost(residuals, moved) <= _cost(residuals, point) else point


def _last_digits(residuals, jacobian, point, lower, upper):
    """Takes Newton's steps of the unknowns between their bounds, while each is a tenth as long."""
    free = (point > lower) & (point < upper)
    if not np.any(free):
        return point

    def gradient(values):
        return _gradient(residuals, jacobian, np.where(free, values, point))[free]

    moves = STEP * np.eye(len(point))[free]
    hessian = [(gradient(point + each) - gradient(point - each)) / (2 * STEP) for each in moves]
    hessian = (np.array(hessian) + np.transpose(hessian)) / 2
    diagonal = np.abs(np.diagonal(hessian))
    scale = np.sqrt(np.where(diagonal > 0, diagonal, np.inf))
    stiffness, directions = np.linalg.eigh(hessian / scale / scale[:, None])
    along = directions[:, stiffness > SINGULAR]
    inverse = along / stiffness[stiffness > SINGULAR] @ along.T / scale / scale[:, None]
    longest = 0.1
    while True:
        step = np.zeros(len(point))
        step[free] = -inverse @ gradient(point)
        trial = point + step
        outside = np.any((trial < lower) | (trial > upper))
        if not np.max(np.abs(step)) < longest or outside:
            return point
        longest, point = np.max(np.abs(step)) / 10, trial
