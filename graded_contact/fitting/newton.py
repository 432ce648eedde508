"""Minimum of a smooth function of a few dozen unknowns between bounds, by damped Newton steps.

Second derivatives are needed: by Gauss-Newton steps one of six isotherms of creep ends two decades
off (`test_moduli_in_time_are_shifted_and_handed_on_with_their_vertical_shifts`).

Libraries take up to 16 times as long (SciPy's trf; dogbox: 70, optimistix: 514) and end a step of
1e-9 to 1 short of the minimum, not 1e-12, or beyond the bounds: `bench_fit.py solvers`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

DAMPED = 1e-2  # a step so damped that its length does not show the distance left
LONGEST_STEP = 3.0  # the most a step changes an unknown: all are logarithms
LEAST_GAIN = 1e-14  # relative decrease of the value, below which rounding hides whether it falls
SINGULAR_HESSIAN = 1e-13  # of a Hessian scaled to a unit diagonal
IDLE_CURVATURE = 1e-20  # of the greatest curvature: an unknown that has no effect on the value
Fitted = tuple[np.ndarray, float]  # the unknowns of a minimum, and its value


class Expansion(NamedTuple):
    """A function about a point.

    **Fields:**

    - `value`, `gradient`: of shape `()` and `(unknowns,)`.
    - `hessian`: symmetric, not necessarily positive, shape `(unknowns, unknowns)`.
    - `scale`: positive diagonal of a similar matrix; damping is measured by it.
    """

    value: float
    gradient: np.ndarray
    hessian: np.ndarray
    scale: np.ndarray


def newton_minimum(
    expand: Callable[[np.ndarray], Expansion],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    rtol: float,
    max_steps: int = 100,
) -> Fitted:
    """Returns the point and the value of a local minimum with `lower` <= point <= `upper`.

    Ends when a step that is hardly damped lowers the value by less than the relative `rtol`, or
    when none lowers it. A value known to rounding leaves half of the digits of the point open: with
    `rtol=0` Newton's steps go on by the gradient alone until they too are rounding.
    Damping follows H. B. Nielsen, report IMM-REP-1999-05, DTU (1999).
    """
    point = np.clip(start, lower, upper)
    here, damping, raised = expand(point), 1e-3, 2.0
    for _ in range(max_steps):
        free = _free_unknowns(point, here, lower, upper)
        step = _damped_step(here, free, damping)
        trial, there = _trial_point(expand, point, free, step, lower, upper)
        moved, decrease = trial - point, here.value - there.value
        if not decrease > 0:
            damping, raised = damping * raised, 2 * raised
            if damping > 1e10 or not np.any(moved):
                break
            continue
        expected = -moved @ (here.gradient + here.hessian @ moved / 2)
        ratio = float(decrease / expected) if expected > 0 else 0.0
        damping, raised = damping * max(1 / 8, 1 - (2 * ratio - 1) ** 3), 2.0
        here, point, before = there, trial, here.value
        if decrease <= max(rtol, LEAST_GAIN) * before and damping < DAMPED:
            break
    if rtol == 0:
        point, here = _converged(expand, point, here, lower, upper)
    return point, here.value


def _converged(expand, point, here, lower, upper):
    """Takes undamped steps as long as each gains much less than the one before."""
    least = np.inf
    while True:
        free = _free_unknowns(point, here, lower, upper)
        step = _newton_step(here, free)
        gain = -step @ here.gradient[free]
        if not 2 * gain < least:
            return point, here
        trial, there = _trial_point(expand, point, free, step, lower, upper)
        if gain == 0 or not there.value <= (1 + 1e-9) * here.value:
            return point, here
        point, here, least = trial, there, gain


def _trial_point(expand, point, free, step, lower, upper):
    """The point after a step of the `free` unknowns, and the function about it."""
    trial = point.copy()
    trial[free] += step
    trial = np.clip(trial, lower, upper)
    with np.errstate(over="ignore", invalid="ignore"):  # far off; it is then not taken
        return trial, expand(trial)


def _free_unknowns(point, here, lower, upper):
    """The unknowns that the gradient does not push out of their bounds."""
    pushed_out = np.where(here.gradient > 0, point <= lower, point >= upper)
    return np.flatnonzero(~pushed_out)


def _newton_step(here, free):
    """Newton's step of the `free` unknowns along directions that more than rounding determines."""
    hessian = here.hessian[np.ix_(free, free)]
    size = np.abs(np.diagonal(hessian))
    scale = np.where(size > IDLE_CURVATURE * np.max(size, initial=0), np.sqrt(size), np.inf)
    stiffness, directions = np.linalg.eigh(hessian / scale / scale[:, None])
    determined = stiffness > SINGULAR_HESSIAN
    along = directions[:, determined]
    return along @ (along.T @ (-here.gradient[free] / scale) / stiffness[determined]) / scale


def _damped_step(here: Expansion, free: np.ndarray, damping: float) -> np.ndarray:
    """Newton's step of the `free` unknowns, damped until its matrix is positive."""
    if not len(free):
        return np.zeros(0)
    hessian, scale = here.hessian[np.ix_(free, free)], here.scale[free]
    scale = np.maximum(scale, 1e-12 * np.max(scale) + 1e-300)
    diagonal = np.arange(len(free))
    while True:
        damped = np.array(hessian, order="F")
        damped[diagonal, diagonal] += (damping + 1e-14) * scale
        _, step, indefinite = scipy.linalg.lapack.dposv(damped, -here.gradient[free])
        if not indefinite:
            return np.clip(step, -LONGEST_STEP, LONGEST_STEP)
        damping = max(8 * damping, 1e-8)


def gram(matrix: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Returns A W Aᵀ, summed over slices so small that BLAS starts no threads.

    On matrices of this size threads gain nothing, and on a busy machine they cost a hundredfold.
    """
    rooted = matrix * np.sqrt(weights)
    width = max(250_000 // max(len(matrix), 1) ** 2, 1)
    slices = (rooted[:, i : i + width] for i in range(0, matrix.shape[1], width))
    return sum((part @ part.T for part in slices), np.zeros(2 * matrix.shape[:1]))
