"""Minimum of a sum of squares of a few dozen unknowns between bounds.

    damped steps of Gauss and Newton -> Newton's steps, for the last digits

A fit takes thousands of steps. SciPy's `least_squares` decomposes the Jacobian into singular values
at each one: a fit of 34 terms takes six times as long.
"""

from collections.abc import Callable

import numpy as np
import scipy

LONGEST_STEP = 3.0  # the most a step changes an unknown: all are logarithms
DAMPED = 0.1  # a step so damped that its length does not show the distance left
HEAVIEST = 1e10  # damping at which no step can gain
LEAST_GAIN = 1e-14  # relative decrease of the sum, below which rounding hides whether it falls
DIFFERENCE = 1e-5  # of an unknown, for differences of the gradient
LONGEST_LAST = 0.1  # step of Newton; each further one is at most a tenth as long
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

    Ends when a step that is hardly damped lowers the sum by less than the relative `rtol`. With
    `rtol=0` the point has the digits that rounding leaves: the sum alone, known to rounding,
    leaves half of them open.

    **Arguments:**

    - `residual`, `jacobian`: return residuals, shape `(rows,)`, and their derivatives, shape
      `(rows, unknowns)`.
    """
    if not len(start):
        return start, float(np.sum(residual(start) ** 2)) / 2
    with np.errstate(all="ignore"):  # a trial far off may overflow; it is then not taken
        point = _descended(
            residual, jacobian, np.clip(start, lower, upper), lower, upper, rtol, max_steps
        )
        if rtol == 0:
            point = _last_digits(residual, jacobian, point, lower, upper)
        return point, float(np.sum(residual(point) ** 2)) / 2


def _descended(residual, jacobian, point, lower, upper, rtol, max_steps):
    """The point after damped steps: H. B. Nielsen, report IMM-REP-1999-05, DTU (1999)."""
    damping, raised, wrong = 1e-3, 2.0, residual(point)
    slopes = jacobian(point)
    for _ in range(max_steps):
        gradient = slopes.T @ wrong
        free = np.where(gradient > 0, point > lower, point < upper)
        trial = point.copy()
        trial[free] += _damped_step(slopes[:, free], gradient[free], damping)
        trial = np.clip(trial, lower, upper)
        moved, after = trial - point, residual(trial)
        decrease = wrong @ wrong - after @ after
        if not decrease > 0:
            damping, raised = damping * raised, 2 * raised
            if damping > HEAVIEST or not np.any(moved):
                break
            continue
        expected = -moved @ (2 * gradient + slopes.T @ (slopes @ moved))
        ratio = decrease / expected if expected > 0 else 0.0
        damping, raised = damping * max(1 / 8, 1 - (2 * ratio - 1) ** 3), 2.0
        settled = decrease <= max(rtol, LEAST_GAIN) * (wrong @ wrong) and damping < DAMPED
        point, wrong = trial, after
        if settled:
            break
        slopes = jacobian(point)
    return point


def _damped_step(slopes, gradient, damping):
    """Gauss and Newton's step, damped by the diagonal of their matrix."""
    stiffness = slopes.T @ slopes
    diagonal = np.diagonal(stiffness)
    diagonal = np.maximum(diagonal, 1e-12 * np.max(diagonal, initial=0) + 1e-300)
    stiffness = stiffness + np.diag((damping + 1e-14) * diagonal)
    _, step, _ = scipy.linalg.lapack.dposv(stiffness, -gradient)
    return np.clip(step, -LONGEST_STEP, LONGEST_STEP)


def _last_digits(residual, jacobian, point, lower, upper):
    """Takes Newton's steps of the unknowns between their bounds, unless one leaves these."""
    free = (point > lower) & (point < upper)
    if not np.any(free):
        return point

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
    moved, longest = point.copy(), LONGEST_LAST
    while True:
        step = inverse @ (residual(moved) @ jacobian(moved)[:, free])
        if not np.max(np.abs(step)) < longest:
            break
        moved[free] -= step
        longest = np.max(np.abs(step)) / 10
    return moved if np.all((moved >= lower) & (moved <= upper)) else point
