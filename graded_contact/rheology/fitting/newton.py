"""Minimum of a smooth function of a few dozen unknowns between bounds, by damped Newton steps."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

DAMPED = 1e-2  # a step so damped that its length says nothing about the distance left
LONGEST = 3.0  # the most a step changes an unknown: all are logarithms
(_solve_positive,) = get_lapack_funcs(("posv",), dtype=np.float64)


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


def minimise(
    expand: Callable[[np.ndarray], Expansion],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    *,
    rtol: float,
    max_steps: int = 100,
) -> tuple[np.ndarray, float]:
    """Returns the point and the value of a local minimum with `lower` <= point <= `upper`.

    Ends when a step that is hardly damped lowers the value by less than the relative `rtol`, or
    when none lowers it.
    Damping follows H. B. Nielsen, report IMM-REP-1999-05, DTU (1999).
    """
    point = np.clip(start, lower, upper)
    here, damping, raised = expand(point), 1e-3, 2.0
    for _ in range(max_steps):
        pushed_out = np.where(here.gradient > 0, point <= lower, point >= upper)
        free = np.flatnonzero(~pushed_out)
        trial = point.copy()
        trial[free] += _damped_step(here, free, damping)
        trial = np.clip(trial, lower, upper)
        moved = trial - point
        with np.errstate(over="ignore", invalid="ignore"):  # far off; it is then not taken
            there = expand(trial)
        decrease = here.value - there.value
        if not decrease > 0:
            damping, raised = damping * raised, 2 * raised
            if damping > 1e10 or not np.any(moved):
                break
            continue
        expected = -moved @ (here.gradient + here.hessian @ moved / 2)
        ratio = float(decrease / expected) if expected > 0 else 0.0
        damping, raised = damping * max(1 / 8, 1 - (2 * ratio - 1) ** 3), 2.0
        here, point, before = there, trial, here.value
        if decrease <= rtol * before and damping < DAMPED:
            break
    return point, here.value


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
        _, step, indefinite = _solve_positive(damped, -here.gradient[free])
        if not indefinite:
            return np.clip(step, -LONGEST, LONGEST)
        damping = max(8 * damping, 1e-8)
