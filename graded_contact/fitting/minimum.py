"""Minimum of a sum of squares of a few dozen unknowns between bounds.

    damped steps of Gauss and Newton -> Newton's steps, for the last digits

SciPy's `least_squares` decomposes the Jacobian into singular values at each step, and a fit takes a
thousand steps: three times as long in all.
"""

from collections.abc import Callable

import numpy as np
import scipy

LONGEST_STEP = 3.0  # the most a step changes an unknown: all are logarithms
DAMPED = 0.1  # a step so damped that its length does not show the distance left
LEAST_GAIN = 1e-14  # relative decrease of the sum, below which rounding hides whether it falls
DIFFERENCE = 1e-5  # of an unknown, for differences of the gradient
SINGULAR = 1e-13  # eigenvalue of a Hessian scaled to a unit diagonal, below which rounding decides
Expand = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
Fitted = tuple[np.ndarray, float]  # the unknowns of a minimum, and half the sum of squares


def least_squares(
    expand: Expand,
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    rtol: float,
    max_steps: int = 100,
) -> Fitted:
    """Returns the point and half the sum of squares of a local minimum between bounds.

    Ends when a step that is hardly damped lowers the sum by less than the relative `rtol`, or when
    none lowers it. With `rtol=0` the point has the digits that rounding leaves: the sum alone,
    known to rounding, leaves half of them open.

    **Arguments:**

    - `expand`: returns residuals, shape `(rows,)`, and their derivatives, `(unknowns, rows)`.
    """
    with np.errstate(all="ignore"):  # a trial far off may overflow; it is then not taken
        point = _descended(expand, np.clip(start, lower, upper), lower, upper, rtol, max_steps)
        if rtol == 0:
            point = _last_digits(expand, point, lower, upper)
        residual, _ = expand(point)
    return point, float(residual @ residual) / 2


def _descended(expand, point, lower, upper, rtol, max_steps):
    """The point after damped steps: H. B. Nielsen, report IMM-REP-1999-05, DTU (1999)."""
    damping, raised = 1e-3, 2.0
    residual, jacobian = expand(point)
    cost, stiffness, gradient = residual @ residual, jacobian @ jacobian.T, jacobian @ residual
    for _ in range(max_steps):
        free = np.flatnonzero(np.where(gradient > 0, point > lower, point < upper))
        trial = point.copy()
        trial[free] += _damped_step(stiffness[np.ix_(free, free)], gradient[free], damping)
        trial = np.clip(trial, lower, upper)
        moved = trial - point
        residual, jacobian = expand(trial)
        decrease = cost - residual @ residual
        if not decrease > 0:
            damping, raised = damping * raised, 2 * raised
            if damping > 1e10 or not np.any(moved):
                break
            continue
        expected = -moved @ (2 * gradient + stiffness @ moved)
        ratio = decrease / expected if expected > 0 else 0.0
        damping, raised = damping * max(1 / 8, 1 - (2 * ratio - 1) ** 3), 2.0
        point, before, cost = trial, cost, cost - decrease
        if decrease <= max(rtol, LEAST_GAIN) * before and damping < DAMPED:
            break
        stiffness, gradient = jacobian @ jacobian.T, jacobian @ residual
    return point


def _damped_step(stiffness, gradient, damping):
    """Gauss and Newton's step, damped by the diagonal of their matrix."""
    diagonal = np.diagonal(stiffness)
    diagonal = np.maximum(diagonal, 1e-12 * np.max(diagonal, initial=0) + 1e-300)
    stiffness = stiffness + np.diag((damping + 1e-14) * diagonal)
    _, step, _ = scipy.linalg.lapack.dposv(stiffness, -gradient)
    return np.clip(step, -LONGEST_STEP, LONGEST_STEP)


def _last_digits(expand, point, lower, upper):
    """Takes Newton's steps of the unknowns between their bounds, while each is a tenth as long."""
    free = (point > lower) & (point < upper)
    if not np.any(free):
        return point

    def gradient(values):
        residual, jacobian = expand(np.where(free, values, point))
        return jacobian[free] @ residual

    moves = DIFFERENCE * np.eye(len(point))[free]
    hessian = [gradient(point + each) - gradient(point - each) for each in moves]
    hessian = (np.array(hessian) + np.transpose(hessian)) / (4 * DIFFERENCE)
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
