"""The errors of the grid and of the times: the same contact with fewer points, or fewer times.

The waves of surface and block that half as many points resolve are kept. Friction and areas change
with the square of the spacing, roughly, so that their change from half the grid contains the error
several times (`bench_contact.py grid`). A surface may have waves that half the grid lacks. Then the
change is that of the surface without them, on the grid and on half of it: as many points for the
shortest wave as the grid itself has.

A window has no waves of its own: the heights of half the grid are means of neighbours.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..contacts.abstract_solver import Inputs
from ..contacts.adjoint import LinearSplitting
from ..contacts.nested_solve import DouglasRachford
from ..contacts.solution import RESULTS
from ..contacts.solve import contact_of, loading_of, solve_contact
from ..contacts.space_time import in_motion
from ..contacts.window import operator_of
from ..core.checks import is_concrete
from ..core.derivative import largest
from ..fields.grid import Grid, interpolate, resample_spectrum, to_field, to_spectrum

Found = Any  # a `Sliding` or a `CyclicSliding`: their module imports this one

RTOL = 2e-4  # of the pressure; the differences of two grids are larger
_LEAST, _LEAST_TIMES = 4, 8  # points along an axis, and times, which are not halved again
_LACKING = 3.0  # times the change, where half the grid lacks waves
_SAME = 1e-6  # share of the variance of heights that half the grid may lack


class Neighbours(eqx.Module):
    """Contacts that show what a grid and the times change.

    **Fields:**

    - `same`: on the grid, without the waves that half of it lacks.
    - `half`: the same on half as many points.
    - `fewer`: of a cycle, on the grid with half as many times; None if these are too few.
    - `factor`: by which changes are multiplied: 3 if half the grid lacks waves, else 1 [1].
    """

    same: Found
    half: Found
    fewer: Found | None
    factor: Float[Array, ""]


def neighbours_of(found: Found) -> Neighbours:
    """Returns the contacts on half the grid, and of a cycle with half the times."""
    shape = found.grid.shape
    halved = _halved(shape)
    pressure = found.contact.mean_pressure
    if is_concrete(pressure) and not (np.isfinite(pressure) and pressure != 0):
        # Without a contact there is nothing to compare.
        return Neighbours(found, found, found, jnp.ones_like(pressure))
    times = len(found.displacement) if found.is_cycle else 0
    on_half, cut, missing = _heights(found.heights, halved, "window" in found.facts)
    same, fewer = found, None
    if not (is_concrete(missing) and missing <= _SAME):
        same = _solved(found, shape, cut, times)
    if times >= 2 * _LEAST_TIMES:
        fewer = _solved(found, shape, found.heights, times // 2)
    factor = jnp.where(missing > _SAME, _LACKING, 1.0).astype(found.heights.dtype)
    if halved == shape:  # nothing is known of the error of the grid
        factor = factor * jnp.nan
    return Neighbours(same, _solved(found, halved, on_half, times), fewer, factor)


def grid_estimate(heights: Float[Array, "*shape"], window: bool) -> str:
    """Returns in words where the errors by the grid of a contact come from."""
    halved = _halved(heights.shape)
    if halved == heights.shape:
        return "not known: the grid has too few points"
    if float(_heights(heights, halved, window)[2]) <= _SAME:
        return "from half the grid"
    return f"from half the grid, without the waves it lacks, times {_LACKING:g}"


def _halved(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(n if n < 2 * _LEAST else n // 2 for n in shape)


@eqx.filter_jit
def _heights(heights: Array, halved: tuple[int, ...], window: bool) -> tuple[Array, Array, Array]:
    """The heights on half the grid, those without the waves it lacks, and their share."""
    if window:
        return _means(heights, halved), heights, jnp.zeros(())
    less = resampled(heights, halved)
    cut = resampled(less, heights.shape)
    missing = jnp.var(heights - cut) / jnp.var(heights)
    return less, cut, missing


def resampled(field: Float[Array, "*shape"], shape: tuple[int, ...]) -> Float[Array, "*new"]:
    """Returns a periodic field on another grid, with the waves that both resolve."""
    waves = resample_spectrum(to_spectrum(field), field.shape, shape)
    return to_field(waves, shape) * (np.prod(shape) / field.size)


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


def _solved(found: Found, shape: tuple[int, ...], heights: Array, num_times: int = 0) -> Found:
    """The contact on another grid of the same cell; of a cycle with other times."""
    load, start, operator, parts = _given(found, shape, heights, num_times)
    parts = parts | dict(operator=operator, heights=heights, grid=Grid(shape, found.grid.size))
    how: Any = {"solver": DouglasRachford(), "adjoint": LinearSplitting(), "rtol": RTOL}
    prescribed: Any = {found.prescribed: load}
    if found.is_cycle:
        spread = jnp.broadcast_to(heights, (num_times, *shape))
        loading = loading_of(found.law, spread, num_times, **prescribed)
        inputs = Inputs(operator, spread, found.law, loading)
        contact = contact_of(inputs, start=start, solution=None, throw=False, **how)
    else:
        contact = solve_contact(
            operator.kernel, heights, law=found.law, start=start, throw=False,
            **prescribed, **how,
        )  # fmt: skip
        parts |= {"measured": None, "kernel_error": None}
    # A number that is not known must not show a small change.
    good = (contact.result == RESULTS.successful) | (contact.result == RESULTS.gap_unresolved)
    pressure = jnp.where(good, contact.pressure, jnp.nan)
    contact = dataclasses.replace(contact, pressure=pressure)
    return dataclasses.replace(found, contact=contact, **parts)


@eqx.filter_jit
def _given(found: Found, shape: tuple[int, ...], heights: Array, num_times: int) -> tuple:
    """The load and the start of a contact on another grid, its operator, and its motion."""
    low, high = found.law.bounds
    old, contact = found.grid.shape, found.contact
    if not found.is_cycle:
        # Relative to the first touch; means of neighbours are lower than their highest.
        lower = largest(found.heights) - largest(heights)
        load = {
            "pressure": lambda: contact.mean_pressure, "mean_gap": lambda: contact.mean_gap,
            "approach": lambda: found.compute("approach")[0] - lower,
        }[found.prescribed]()  # fmt: skip
        start = jnp.clip(resampled(found.pressure, shape), low, high)
        cell = found.operator.cell(Grid(shape, found.grid.size))
        kernel = resample_spectrum(found.operator.kernel, found.cell.shape, cell.shape)
        return load, start, operator_of(kernel, shape), {}
    start = jnp.clip(resampled(found.pressure, (num_times, *shape)), low, high)
    name = "load" if found.prescribed == "pressure" else "mean_gap"
    load = interpolate(found.compute(name)[0], (num_times,))
    rate, back = found.motion_of_surface
    moved = resampled(back, (num_times, back.shape[1]))
    drift = jnp.mean(rate, axis=0) * found.period
    moved = moved + drift * (np.arange(num_times) / num_times)[:, None]
    kernel = resample_spectrum(found.operator.compliance, (len(rate), *old), (num_times, *shape))
    still = [(0, 0), (0, len(shape) - moved.shape[1])]
    operator = in_motion(kernel, jnp.pad(moved, still), Grid(shape, found.grid.size))
    motion = {"displacement": moved.reshape(num_times, *found.displacement.shape[1:])}
    return load, start, operator, motion
