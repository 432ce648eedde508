"""The errors of the grid and of the times: the contact with fewer points, or fewer times.

The waves of surface and block that half as many points resolve are kept. A surface may have waves
that half the grid lacks. Then the surface without them is solved on the grid, too, and compared
with half of it: as many points for the shortest wave as the grid itself has. What errors follow
from these contacts is in `grid.py` and `parts.py`.

A window has no waves of its own: the heights of half the grid are means of neighbours.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...contacts.operators.operator import nonzero
from ...contacts.solution import RESULTS
from ...contacts.solver.nested_solve import DouglasRachford
from ...core.checks import is_concrete
from ...core.compilation import compiled
from ...core.derivative import largest
from ...fields.grid import Grid, derivative, interpolate, resampled
from ..case import WINDOW, Numerics
from ..formulas import lift
from ..number import Found
from ..problem import CycleProblem, Problem, SteadyProblem

NEIGHBOURS_RTOL = 2e-4  # of the pressure; the differences of two grids are larger
_LEAST_TIMES = 8  # times that are not halved again
_FEWEST = 4  # points along an axis that are not halved again
_NOTHING_LACKS = 1e-5  # of the squared slope: below it half the grid lacks nothing


class Neighbours(eqx.Module):
    """Contacts on a coarser grid and with fewer times, for errors.

    **Fields:**

    - `same`: on the grid, without the waves that half of it lacks; None if it lacks none: then this
      is the contact itself.
    - `half`: the same contact on half as many points.
    - `fewer`: of a cycle or a transient solve, on the grid with half as many times; None if these
      are too few.
    - `lacking`: share of the squared slope in waves that half the grid lacks [1]; NaN if the grid
      has too few points to be halved.
    """

    same: Any | None  # of the kind of the contact
    half: Any
    fewer: Any
    lacking: Float[Array, ""]

    def both(self, found: Any) -> tuple[Any, Any]:
        """Returns `same` and `half` of a contact."""
        return found if self.same is None else self.same, self.half


# Heights on half the grid of a surface, and the waves that it lacks.


@compiled
def _heights_on(
    heights: Array, grid: Grid, half: tuple[int, ...], window: bool
) -> tuple[Array, Array, Array]:
    """Returns heights on half the grid, on the grid without the waves it lacks, and their share.

    The share is of the squared slope [1].
    """
    if window:
        return _means(heights, half), heights, jnp.zeros((), heights.dtype)
    less = resampled(heights, half)
    cut = resampled(less, heights.shape)
    axes = range(heights.ndim)
    lost, all_of = (
        jnp.sum(jnp.stack([jnp.mean(derivative(field, grid, axis) ** 2) for axis in axes]))
        for field in (heights - cut, heights)
    )
    return less, cut, lost / nonzero(all_of)


def _means(heights: Array, shape: tuple[int, ...]) -> Array:
    """The heights of a window on fewer points: of an even number the means of two neighbours."""
    for axis, (n, m) in enumerate(zip(heights.shape, shape, strict=True)):
        if n == m:
            continue
        place = (np.arange(m) + 0.5) * (n / m) - 0.5
        left = np.floor(place).astype(int)
        weight = (place - left).reshape([-1 if i == axis else 1 for i in range(heights.ndim)])
        low, high = (jnp.take(heights, i, axis) for i in (left, np.minimum(left + 1, n - 1)))
        heights = low + jnp.asarray(weight, heights.dtype) * (high - low)
    return heights


# The contacts.


def neighbours_of(found: Found) -> Neighbours:
    """Returns the contacts on half the grid, and of a cycle with half the times."""
    pressure = found.contact.mean_pressure
    if is_concrete(pressure) and not (np.isfinite(pressure) and float(pressure) != 0):
        # Without a contact there is nothing to compare.
        return Neighbours(None, found, found, jnp.zeros_like(pressure))
    times = len(found.displacement) if isinstance(found.problem, CycleProblem) else 0
    fewer = None
    if times >= 2 * _LEAST_TIMES:
        fewer = _solved(found, found.grid.shape, found.problem.roughness, times // 2)
    return neighbours_by(found, lambda shape, rough: _solved(found, shape, rough, times), fewer)


def neighbours_by(found: Found, solve: Callable[..., Found], fewer: Found | None) -> Neighbours:
    """Returns the neighbours of a contact; `solve` takes the shape of a grid and heights on it."""
    shape, window = found.grid.shape, WINDOW in found.facts
    half = tuple(n if n < 2 * _FEWEST else n // 2 for n in shape)
    parts = [_heights_on(rough, found.grid, half, window) for rough in found.problem.roughness]
    on_half, cut, lacking = zip(*parts, strict=True)
    missing = functools.reduce(jnp.maximum, lacking)
    same = None
    if not (is_concrete(missing) and float(missing) <= _NOTHING_LACKS):
        same = solve(shape, cut)
    if half == shape:  # nothing is known of the error of the grid
        missing = missing * jnp.nan
    return Neighbours(same, solve(half, on_half), fewer, missing)


def _solved(
    found: Found, shape: tuple[int, ...], heights: tuple[Array, ...], num_times: int
) -> Found:
    """The contact on another grid of the cell; of a cycle with other times."""
    problem, load, start, shift = _given(found, shape, heights[0], num_times)
    problem = problem.with_roughness(*heights)
    # In a program of the user, Newton steps would take long to compile and are seldom needed.
    solver = DouglasRachford(newton=is_concrete(load))
    how = Numerics(rtol=NEIGHBOURS_RTOL, solver=solver, throw=False)
    # The displacement by a traction that is no part of the kernel stays as it is.
    lagged = shift if shift.ndim else None
    contact = problem.contact({found.problem.prescribed: load}, how, lagged, start)
    pressure, moved = _known(contact.result, contact.pressure, contact.displacement, shift)
    contact = dataclasses.replace(contact, pressure=pressure, displacement=moved)
    return dataclasses.replace(found, contact=contact, problem=problem)


@compiled
def _known(result: RESULTS, pressure: Array, displacement: Array, shift: Array) -> tuple:
    """The pressure, NaN if the solve failed, and the displacement with lagged traction."""
    # A number that is not known must not show a small change. What may be unstable on half the grid
    # is close to what the whole grid resolves.
    good = (result == RESULTS.successful) | (result == RESULTS.gap_unresolved)
    good = good | (result == RESULTS.unresolved)
    return jnp.where(good, pressure, jnp.nan), displacement + shift


@compiled
def _given(
    found: Found, shape: tuple[int, ...], heights: Array, num_times: int
) -> tuple[Problem, Array, Array, Array]:
    """The problem on another grid, its load, a start, and the shift by lagged traction."""
    (low, high), contact, over = found.law.bounds, found.contact, ()
    if isinstance(found.problem, SteadyProblem):
        # Relative to the first touch; means of neighbours are lower than their highest.
        lower = largest(found.heights) - largest(heights)
        load = {
            "pressure": lambda: contact.mean_pressure,
            "mean_gap": lambda: jnp.mean(contact.gap),
            "approach": lambda: found.compute("approach")[0] - lower,
        }[found.problem.prescribed]()
    else:
        over = (num_times,)
        given = found.pressure if found.problem.prescribed == "pressure" else found.gap
        load = interpolate(found.operator.at_each_time(jnp.mean, given), over)
    start = jnp.clip(resampled(found.pressure, (*over, *shape)), low, high)
    shift = lift(found)
    shift = resampled(shift, (*over, *shape)) if shift.ndim else shift
    # A program would return a copy of the heights.
    problem = found.problem.on(shape, num_times)
    return problem, load, start, shift
