"""Transient motions: from rest, at a velocity, to rest, one after the other.

A motion is s(t) at the ends of steps, from s = 0 at t = 0. While the surface moves, a step leads it
by about half a spacing of the grid; while it rests, each step is a fixed part of the time so far.
"""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ScalarLike

from ...core.checks import (
    Numbers,
    check_ascending,
    check_values,
    check_whole,
    is_concrete,
    positive,
    scalar,
)
from ...core.compilation import compiled
from ...fields.grid import Grid
from .motion import CHOSEN_STEP, Motion, check_path, components

_STEPS = 128  # of a motion, where the grid is not known
_A_DECADE = 10  # steps of a rest, whose error is then below 1e-3


def dwell(
    duration: ScalarLike, num_times: int | None = None, first: ScalarLike | None = None
) -> Motion:
    """Returns a rest, in steps that grow with the time.

    **Arguments:**

    - `duration`: of the rest [s].
    - `num_times`: number of steps; None for ten for each decade from `first` on.
    - `first`: end of the first step [s]; None for 1e-4 of the duration.

    **Returns:** the motion.

    **Raises:** `ValueError` for a refused argument.
    """
    duration = positive("duration", "[s]")(duration)
    first = positive("first", "[s]")(1e-4 * duration if first is None else first)
    ratio = duration / first
    if is_concrete(ratio) and not ratio > 1:
        raise ValueError(f"`first={first:g}` s must be less than `duration={duration:g}` s.")
    if num_times is None:
        num_times = math.ceil(_A_DECADE * math.log10(known("num_times", ratio))) + 1
    check_whole("num_times", num_times, 2)
    return _at_rest(duration, first, num_times)


@compiled
def _at_rest(duration, first, num_times: int) -> Motion:
    # Equal steps as long as the first one, then in proportion: no step is shorter than the first.
    part = jnp.linspace(0, 1, num_times, dtype=duration.dtype)
    grown = first * jnp.maximum((duration / first) ** part, jnp.arange(1, num_times + 1))
    times = jnp.minimum(grown * (duration / grown[-1]), duration)
    return Motion(jnp.zeros_like(times), times=times)


def ramp(
    velocity: ScalarLike,
    duration: ScalarLike,
    grid: Grid | None = None,
    num_times: int | None = None,
) -> Motion:
    """Returns a motion along x at one velocity, in equal steps.

    **Arguments:**

    - `velocity`: v [m/s].
    - `duration`, `grid`, `num_times`: as in `start`.

    **Returns:** the motion.

    **Raises:** `ValueError` for a refused argument.
    """
    return start(velocity, duration, velocity, grid, num_times)


def start(
    velocity: ScalarLike,
    duration: ScalarLike,
    before: ScalarLike = 0.0,
    grid: Grid | None = None,
    num_times: int | None = None,
) -> Motion:
    """Returns a motion along x that goes smoothly from one velocity to another, such as from rest.

    The velocity is before + (v - before)(3x² - 2x³), x = t/duration: a brake if v = 0.

    **Arguments:**

    - `velocity`: v at the end [m/s].
    - `duration`: of the motion [s].
    - `before`: velocity at the beginning [m/s].
    - `grid`: of the surface, which then moves by half a spacing in a step; None for 128 steps.
    - `num_times`: number of steps, in place of the grid's.

    **Returns:** the motion.

    **Raises:** `ValueError` for a refused argument.
    """
    velocity, before = scalar("velocity")(velocity), scalar("before")(before)
    duration = positive("duration", "[s]")(duration)
    if num_times is None and grid is not None:  # the longest step is at the higher velocity
        way = jnp.maximum(jnp.abs(velocity), jnp.abs(before)) * duration
        num_times = max(math.ceil(known("num_times", way / grid.spacing[0]) / CHOSEN_STEP), 1)
    num_times = _STEPS if num_times is None else num_times
    check_whole("num_times", num_times, 1)
    return _between(before, velocity, duration, num_times)


@compiled
def _between(before, after, duration, num_times: int) -> Motion:
    """The motion from one velocity to another."""
    part = jnp.arange(1, num_times + 1, dtype=duration.dtype) / num_times
    moved = before * part + (after - before) * (part**3 - part**4 / 2)
    return Motion(duration * moved, times=duration * part)


def in_steps(table: Motion, grid: Grid) -> Motion:
    """Returns a measured motion from its first row on, in steps that the grid resolves."""
    rows = components(table.displacement)
    ways = jnp.abs(jnp.diff(rows, axis=0)) / grid.spacing[: rows.shape[1]]
    counts = np.maximum(np.ceil(known("grid", jnp.sum(ways, axis=1)) / CHOSEN_STEP), 1)
    place = np.concatenate([i + np.arange(1, n + 1) / n for i, n in enumerate(counts)])
    at = lambda column: jnp.interp(place, np.arange(len(column)), column - column[0])  # noqa: E731
    moved = jnp.stack([at(column) for column in rows.T], axis=1)
    return Motion(moved.reshape(-1, *table.displacement.shape[1:]), times=at(table.times))


def table_of(times: Numbers, displacement: Numbers) -> Motion:
    """Times and displacements, at least two, of which the times ascend."""
    table = Motion(displacement, times=times)
    ends = jnp.asarray(table.times)
    check_ascending(2, times=ends)
    check_values("displacement", table.displacement, "a displacement [m] must be finite")
    check_path(table.displacement, len(ends), 2)
    return table


def known(name: str, number: Array | int) -> np.ndarray:
    """Returns a number as an array of NumPy; it must be known."""
    if not is_concrete(number):
        raise ValueError(
            f"`{name}` is needed inside of a program (`jit`, `vmap`, `grad`), where the motion is "
            "not known."
        )
    return np.asarray(number)
