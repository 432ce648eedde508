"""Usual periodic motions of a surface: reciprocating, start and stop, and recorded ones.

A motion is s(t) at equally spaced times over one period. A wave of the surface at q excites the
block at the frequencies of exp(-i q·s(t)): up to q v, v being the highest speed. So a motion is
sampled finely enough if the surface moves by no more than a spacing of the grid from one time to
the next. With a grid these functions choose their number of times.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ...core.checks import Numbers, check_whole, is_concrete, positive, scalar
from ...core.compilation import compiled
from ...fields.grid import Grid
from .motion import CHOSEN_STEP, Motion, check_closed, fast, step_length
from .transient import in_steps, known, table_of

as_stroke = scalar("stroke", "a stroke [m] must be finite and not negative", at_least=0)

_USUAL = 128  # times, where the grid is not known
_FEWEST = 32  # times that are chosen
# Times of a way from rest to rest: 0.1 % of its velocity is then at the upper half of the
# frequencies. A rest of 1/8 of the way has 4; the slow ends of the way look like a shorter one.
_OF_A_WAY = 32
_FINE = 16  # times between two of a recorded motion, before the highest frequencies are cut


def _count(num_times: int | None, grid: Grid | None, dash: Array, least: Array | int) -> int:
    """The number of times: the one given, or what resolves a motion along x.

    `dash` is how far its highest speed leads in a period [m], `least` the fewest times.
    """
    if num_times is not None:
        return num_times
    fewest = float(known("num_times", least))
    if grid is None:
        return fast(max(_USUAL, fewest))
    return fast(max(fewest, float(known("num_times", dash / grid.spacing[0])) / CHOSEN_STEP))


def sinusoidal(
    stroke: ScalarLike,
    frequency: ScalarLike,
    num_times: int | None = None,
    grid: Grid | None = None,
) -> Motion:
    """Returns the motion s = (stroke/2) sin(2π f t) along x.

    Its highest speed is π f times the stroke.

    **Arguments:**

    - `stroke`: distance between the turning points [m].
    - `frequency`: f [Hz].
    - `num_times`: times in a period, at least 4; None for as many as the grid needs: the surface
      then moves by at most half a spacing from one to the next. 128 without a grid.
    - `grid`: of the surface.

    **Returns:** the motion, with period 1/f.

    **Raises:** `ValueError` for a refused argument.
    """
    stroke, frequency = as_stroke(stroke), positive("frequency", "[Hz]")(frequency)
    count = _count(num_times, grid, np.pi * stroke, _FEWEST)
    return Motion(stroke / 2 * jnp.sin(2 * np.pi * _times(count, stroke)), 1 / frequency)


def start_stop(
    stroke: ScalarLike,
    moving: ScalarLike,
    dwell: ScalarLike,
    num_times: int | None = None,
    grid: Grid | None = None,
) -> Motion:
    """Returns a motion along x that rests, moves by the stroke, rests, and moves back.

    Speed and acceleration are continuous: s is the polynomial of least jerk, with the highest speed
    15/8 stroke/`moving`.

    **Arguments:**

    - `stroke`: distance between the two places of rest [m].
    - `moving`: time of one way [s].
    - `dwell`: time of one rest [s]; 0 for none.
    - `num_times`: times in a period, at least 4; None for as many as the grid needs, see
      `sinusoidal`, and at least 32 in each way from rest to rest.
    - `grid`: of the surface.

    **Returns:** the motion, with period 2 (`moving` + `dwell`). It begins in the middle of a rest.

    **Raises:** `ValueError` for a refused argument.
    """
    stroke, moving = as_stroke(stroke), positive("moving", "[s]")(moving)
    dwell = scalar("dwell", "a time [s] must be finite and not negative", at_least=0)(dwell)
    period = 2 * (moving + dwell)
    ways = period / moving
    count = _count(num_times, grid, 15 / 8 * stroke * ways, _OF_A_WAY * ways)
    return Motion(_there_and_back(stroke, moving, dwell, count), period)


@compiled
def _there_and_back(stroke, moving, dwell, count: int):
    """Displacements of `start_stop`."""
    half = moving + dwell
    time = 2 * half * _times(count, stroke) - dwell / 2
    return stroke * (_least_jerk(time / moving) - _least_jerk((time - half) / moving))


def _least_jerk(x):
    x = jnp.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def recorded(
    times: Numbers,
    displacement: Numbers,
    period: ScalarLike | None = None,
    num_times: int | None = None,
    grid: Grid | None = None,
) -> Motion:
    """Returns a measured motion, from a table that is interpolated linearly.

    With a period it has equally spaced times, without the frequencies that these alias: all
    above the highest that `num_times` resolve are cut, and with them most of the noise. The table
    must end where it began.

    Without a period the motion is transient and need not close. Each interval of the table is cut
    into equal steps, in which the surface moves by at most half a spacing.

    **Arguments:**

    - `times`: t [s], shape `(n,)`, ascending; in a cycle less than a period from first to last.
    - `displacement`: s [m] at these times, shape `(n,)` or `(n, 2)`; counted from the first, unless
      there is a period.
    - `period`: T [s]; None for a transient motion.
    - `num_times`: times in a period, at least 4; None for 128, or with a grid for more, until the
      surface moves by at most half a spacing from one to the next.
    - `grid`: of the surface; needed by a transient motion.

    **Returns:** the motion; its first time is the first of the table.

    **Raises:** `ValueError` for a refused argument.
    """
    rows = table_of(times, displacement)
    if period is None:
        if grid is None:
            raise ValueError("`period` is needed, or for a transient motion the `grid`.")
        return in_steps(rows, grid)
    at, table = jnp.asarray(rows.times), rows.displacement
    period = positive("period", "[s]")(period)
    if is_concrete(at) and is_concrete(period) and not at[-1] - at[0] < period:
        raise ValueError(
            f"`times` from {at[0]:g} to {at[-1]:g} s are refused: they must be within one "
            f"`period` of {period:g} s, whose end is not listed."
        )
    check_closed(table)
    count = _USUAL if num_times is None else num_times
    moved = _resampled(at, table, period, count)
    if num_times is None and grid is not None:
        # More times keep more of the noise, so that they are not known beforehand.
        while (step := float(known("num_times", step_length(moved, grid.spacing)))) > CHOSEN_STEP:
            count = fast(max(count + 1, count * step / CHOSEN_STEP))
            moved = _resampled(at, table, period, count)
    return Motion(moved, period)


@compiled
def _resampled(times, table, period, count: int) -> Float[Array, "nt ..."]:
    """A table of displacements at equally spaced times."""
    # Finer times first: the few of the result would alias what lies between them.
    fine = times[0] + period * _times(_FINE * count, table)
    # Its first row, a period later, closes the table.
    ends = jnp.append(times, times[0] + period)
    columns = jnp.concatenate([table, table[:1]]).reshape(len(ends), -1).T
    dense = jnp.stack([jnp.interp(fine, ends, column) for column in columns], axis=1)
    # On the highest frequency of the coarser times the sign is not known.
    waves = jnp.fft.rfft(dense, axis=0)[: (count + 1) // 2]
    moved = jnp.fft.irfft(waves, count, axis=0) / _FINE
    return moved.reshape(count, *table.shape[1:])


def _times(num_times: int, like: Array) -> Float[Array, " nt"]:
    """Equally spaced times over the period."""
    check_whole("num_times", num_times, 4)
    return jnp.arange(num_times, dtype=like.dtype) / num_times
