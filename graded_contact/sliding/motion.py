"""Usual periodic motions of a surface: reciprocating, start and stop, steady, and recorded ones.

A motion is s(t) at equally spaced times over one period. A wave of the surface at q excites the
block at the frequencies of exp(-i q·s(t)): up to q v, v being the highest speed. So a motion is
sampled finely enough if the surface moves by no more than a spacing of the grid from one time to
the next, see `Motion.largest_step`.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..blocks.periodic_kernel import period_frequencies
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_types,
    check_values,
    check_whole,
    is_concrete,
    numbers,
    scalar,
)
from ..core.display import shown
from ..fields.grid import Grid

_FINE = 16  # times between two of a recorded motion, before the highest frequencies are cut


@shown("displacement", "period", "highest_speed", units=False)
class Motion(eqx.Module):
    """A periodic motion of the surface over the block.

    **Fields:**

    - `displacement`: s [m] at equally spaced times, shape `(nt,)` along x, or `(nt, 2)`.
    - `period`: T [s].
    """

    displacement: Float[Array, "..."] = eqx.field(converter=numbers("displacement"))
    period: Float[Array, ""] = eqx.field(converter=scalar("period"))

    @property
    def highest_speed(self) -> Float[Array, ""]:
        """The largest distance between neighbouring times over the time between them [m/s]."""
        moved = jnp.sqrt(jnp.sum(_steps(self.displacement) ** 2, axis=1))
        return jnp.max(moved) * len(self.displacement) / self.period

    def largest_step(self, grid: Grid) -> Float[Array, ""]:
        """Returns the largest distance between neighbouring times, in spacings along x plus y [1].

        Above 1, take more times.
        """
        moved = _steps(self.displacement)
        return jnp.max(jnp.sum(moved / grid.spacing[: moved.shape[1]], axis=1))


def _steps(displacement):
    """Distances from each time to the next one of this period, along each axis."""
    return jnp.abs(jnp.diff(displacement.reshape(len(displacement), -1), axis=0))


@check_types
def sinusoidal(stroke: ScalarLike, frequency: ScalarLike, num_times: int = 128) -> Motion:
    """Returns the motion s = (stroke/2) sin(2π f t) along x.

    Its highest speed is π f times the stroke, so that `num_times` of 3.2 times the stroke over the
    spacing of the grid resolve it.

    **Arguments:**

    - `stroke`: distance between the turning points [m].
    - `frequency`: f [Hz].
    - `num_times`: times in a period, at least 4.

    **Returns:** the motion, with period 1/f.

    **Raises:** `ValueError` for a refused argument.
    """
    stroke, frequency = as_scalar(stroke, "stroke"), as_scalar(frequency, "frequency")
    check_values("stroke", stroke, "a stroke [m] must be finite and not negative", at_least=0)
    check_positive("frequency", frequency, "[Hz]")
    return Motion(stroke / 2 * jnp.sin(2 * np.pi * _times(num_times, stroke)), 1 / frequency)


@check_types
def start_stop(
    stroke: ScalarLike, moving: ScalarLike, dwell: ScalarLike, num_times: int = 128
) -> Motion:
    """Returns a motion along x that rests, moves by the stroke, rests, and moves back.

    Speed and acceleration are continuous: s is the polynomial of least jerk, with the highest speed
    15/8 stroke/`moving`.

    **Arguments:**

    - `stroke`: distance between the two places of rest [m].
    - `moving`: time of one way [s].
    - `dwell`: time of one rest [s]; 0 for none.
    - `num_times`: times in a period, at least 4.

    **Returns:** the motion, with period 2 (`moving` + `dwell`). It begins in the middle of a rest.

    **Raises:** `ValueError` for a refused argument.
    """
    names = ("stroke", "moving", "dwell")
    stroke, moving, dwell = map(as_scalar, (stroke, moving, dwell), names)
    check_values("stroke", stroke, "a stroke [m] must be finite and not negative", at_least=0)
    check_positive("moving", moving, "[s]")
    check_values("dwell", dwell, "a time [s] must be finite and not negative", at_least=0)
    period = 2 * (moving + dwell)
    time = period * _times(num_times, stroke)
    there = _least_jerk((time - dwell / 2) / moving)
    back = _least_jerk((time - period / 2 - dwell / 2) / moving)
    return Motion(stroke * (there - back), period)


def _least_jerk(x):
    x = jnp.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


@check_types
def steady(velocity: ScalarLike, grid: Grid, num_times: int | None = None) -> Motion:
    """Returns steady sliding along x over one cell, s = v t. It is what `slide` solves faster.

    **Arguments:**

    - `velocity`: v [m/s], not 0.
    - `grid`: the cell that the surface crosses in a period.
    - `num_times`: times in a period; None for one for each point of the grid along x.

    **Returns:** the motion, with period L/|v|.

    **Raises:** `ValueError` for a refused argument.
    """
    velocity = as_scalar(velocity, "velocity")
    if is_concrete(velocity) and velocity == 0:
        raise ValueError("`velocity=0` is refused: a surface at rest has no period. Use `slide`.")
    check_values("velocity", velocity, "a velocity [m/s] must be finite")
    length = grid.size[0] * jnp.sign(velocity)
    times = _times(grid.shape[0] if num_times is None else num_times, length)
    return Motion(length * times, length / velocity)


@check_types
def recorded(
    times: Numbers, displacement: Numbers, period: ScalarLike, num_times: int = 128
) -> Motion:
    """Returns a measured motion at equally spaced times, without frequencies that these alias.

    The table is interpolated linearly over the period; then frequencies above that of `num_times`
    are cut. It must end where it began.

    **Arguments:**

    - `times`: t [s], shape `(n,)`, ascending, less than a period from the first to the last.
    - `displacement`: s [m] at these times, shape `(n,)` or `(n, 2)`.
    - `period`: T [s].
    - `num_times`: times in a period, at least 4.

    **Returns:** the motion; its first time is the first of the table.

    **Raises:** `ValueError` for a refused argument.
    """
    times, table = as_float(times, "times"), as_float(displacement, "displacement")
    period = as_scalar(period, "period")
    check_positive("period", period, "[s]")
    check_values("displacement", table, "a displacement [m] must be finite")
    if times.ndim != 1 or table.ndim not in (1, 2) or len(table) != len(times) or len(times) < 2:
        raise ValueError(
            f"`times` has shape {times.shape} and `displacement` shape {table.shape}; one time for "
            "each row of the displacement is needed."
        )
    known = is_concrete(times) and is_concrete(period)
    if known and not (np.all(np.diff(times) > 0) and times[-1] - times[0] < period):
        raise ValueError(
            f"`times` from {times[0]:g} to {times[-1]:g} s are refused: they must ascend within "
            f"one `period` of {period:g} s, whose end is not listed."
        )
    # Finer times first: those of the result would alias what lies between them.
    fine = times[0] + period * _times(_FINE * num_times, table)
    # Its first row, a period later, closes the table.
    ends = jnp.append(times, times[0] + period)
    columns = jnp.concatenate([table, table[:1]]).reshape(len(ends), -1).T
    dense = jnp.stack([jnp.interp(fine, ends, column) for column in columns], axis=1)
    # On the highest frequency of the coarser times the sign is not known.
    waves = jnp.fft.rfft(dense, axis=0)[: (num_times + 1) // 2]
    moved = jnp.fft.irfft(waves, num_times, axis=0) / _FINE
    return Motion(moved.reshape(num_times, *table.shape[1:]), period)


def _times(num_times: int, like: Array) -> Float[Array, " nt"]:
    """Equally spaced times over the period."""
    check_whole("num_times", num_times, 4)
    return jnp.arange(num_times, dtype=like.dtype) / num_times


def components(over_time: Float[Array, "nt ..."]) -> Float[Array, "nt components"]:
    """Returns an array over time, with its components on the second axis."""
    return over_time.reshape(len(over_time), -1)


def rate_of(values: Float[Array, "nt ..."], period: Float[Array, ""]) -> Float[Array, "nt ..."]:
    """Returns the derivative by time of periodic values."""
    omega = odd_frequencies(len(values), period).reshape(-1, *[1] * (values.ndim - 1))
    return jnp.fft.irfft(1j * omega * jnp.fft.rfft(values, axis=0), len(values), axis=0)


def odd_frequencies(count: int, period: Float[Array, ""]) -> Float[Array, " nw"]:
    """Returns the frequencies ω >= 0 of a period; the highest of an even count, which has no sign,
    is 0."""
    omega = period_frequencies(count, period)
    return omega if count % 2 else omega.at[-1].set(0)
