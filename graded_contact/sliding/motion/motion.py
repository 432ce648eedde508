"""Motions of a surface over a block: s(t) over a period, or at the ends of steps.

A wave of the surface at q excites the block at the frequencies of exp(-i q·s(t)): up to q v, v
being the highest speed. So a motion is sampled finely enough if the surface moves by no more than a
spacing of the grid from one time to the next; above 2 spacings it is refused.
"""

import math
from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from ...core.checks import check_type, is_concrete, numbers, optional, scalar
from ...core.compilation import compiled
from ...core.display import shown, with_unit
from ...fields.grid import Grid
from ...kernels.periodic import period_frequencies

# At a largest step of 0.5 spacings the mean friction is off by 5e-5 or less, at 1 by 2e-3 or less,
# at 2 by 1 to 18 %, at 4 by 5 to 72 %.
CHOSEN_STEP = 0.5
LARGEST_STEP = 2.0
_OPEN = 0.2  # of the extent of a record: a gap that its next row does not close
_REFINED = 64  # times as many for the length of the path


@shown("num_times", "times", "displacement", "period", "highest_speed", units=False, unset=False)
class Motion(eqx.Module):
    """A motion of the surface over the block.

    **Fields:**

    - `displacement`: s [m], shape `(nt,)` along x, or `(nt, 2)`: at equally spaced times of a
      period, or at the ends of steps, since t = 0.
    - `period`: T [s]; None for a transient motion.
    - `times`: ends of the steps of a transient motion [s], shape `(nt,)`; else None.
    """

    displacement: Float[Array, "nt ..."] = eqx.field(converter=numbers("displacement"))
    period: Float[Array, ""] | None = eqx.field(converter=optional(scalar("period")), default=None)
    times: Float[Array, " nt"] | None = eqx.field(
        converter=optional(numbers("times")), default=None
    )

    def __check_init__(self):
        if (self.period is None) == (self.times is None):
            raise ValueError("`period` or `times` is needed, not both.")

    @property
    def repeats(self) -> bool:
        """Whether it has a period."""
        return self.period is not None

    @property
    def num_times(self) -> int:
        """How many times it has."""
        return len(self.displacement)

    @property
    def highest_speed(self) -> Float[Array, ""]:
        """The largest distance from one time to the next over the time between them [m/s]."""
        ways = jnp.sqrt(jnp.sum(_steps(self.displacement, self.times is not None) ** 2, axis=1))
        if self.period is not None:
            return jnp.max(ways) * self.num_times / self.period
        return jnp.max(ways / jnp.diff(jnp.asarray(self.times), prepend=0))

    def then(self, other: "Motion") -> "Motion":
        """Returns this transient motion and then another one, which begins where this one ends."""
        check_type("other", other, Motion)
        if self.times is None or other.times is None:
            raise ValueError("`other` must be a transient motion that follows a transient motion.")
        moved = jnp.concatenate([self.displacement, self.displacement[-1] + other.displacement])
        return Motion(moved, times=jnp.concatenate([self.times, self.times[-1] + other.times]))


def _steps(displacement, from_rest: bool = False):
    """Distances from each time to the next one, along each axis; also from s = 0 to the first."""
    rows = displacement.reshape(len(displacement), -1)
    steps = abs(rows[1:] - rows[:-1])
    return jnp.concatenate([abs(rows[:1]), steps]) if from_rest else steps


def step_length(displacement, spacing, from_rest: bool = False):
    """Returns the largest distance, in spacings along x plus y; in NumPy of what NumPy has."""
    moved = _steps(displacement, from_rest)
    return (moved / spacing[: moved.shape[1]]).sum(axis=1).max()


def check_path(displacement: Array, count: int, axes: int) -> None:
    """Raises `ValueError` unless a displacement has `count` times, along x or along two axes."""
    allowed = [(count, *more) for more in ((), (2,))[:axes]]
    if displacement.shape not in allowed:
        raise ValueError(
            f"`displacement` has shape {displacement.shape}; {' or '.join(map(str, allowed))} is "
            "needed, one for each of the times."
        )


def check_resolved(given: str, displacement: Array | np.ndarray, grid: Grid) -> None:
    """Raises `ValueError` if the times cannot resolve how the waves of a grid move.

    `given` tells in words what is refused.
    """
    if not (is_concrete(displacement) and is_concrete(grid.size)):
        return
    step = float(step_length(np.asarray(displacement), np.asarray(grid.size) / grid.shape))
    if step > LARGEST_STEP:
        enough = fast(len(displacement) * step / CHOSEN_STEP)
        raise ValueError(
            f"{given} is refused: the surface moves by up to {step:.3g} spacings of the grid from "
            f"one time to the next, and {LARGEST_STEP:g} are the most. A motion without jumps "
            f"needs {enough} times."
        )


def fast(least: float) -> int:
    """A multiple of 4 without prime factors above 5: transforms are fast, turns are at a time."""
    return 4 * cast(int, scipy.fft.next_fast_len(math.ceil(min(least, 1e15) / 4), real=True))


def check_closed(displacement: Array, cell: Grid | None = None) -> None:
    """Raises `ValueError` for a motion whose end is further from its start than its rows explain.

    With a `cell` the surface may advance by whole cells.
    """
    known = is_concrete(displacement) and (cell is None or is_concrete(cell.size))
    if not known or len(displacement) < 4:
        return
    rows = np.asarray(displacement).reshape(len(displacement), -1)
    apart, extent = rows[-1] - rows[0], np.ptp(rows, axis=0)
    if cell is not None:
        size = np.asarray(cell.size)[: rows.shape[1]]
        apart = apart - size * np.round(apart / size)
        extent = np.minimum(extent, size)
    # The last row is a step before the end; a record of few rows takes long steps.
    steps = np.max(np.abs(np.diff(rows, axis=0)), axis=0)
    if np.any(np.abs(apart) > np.maximum(4 * steps, _OPEN * extent)):
        beyond = "" if cell is None else " of whole cells"
        far = with_unit(float(np.linalg.norm(apart)), "m")
        raise ValueError(
            f"`displacement` is refused: its end is {far} from its start{beyond}, but a cycle ends "
            "where it began. Use `slide_transient` for a transient motion, or let the surface "
            "advance by whole cells, see `slide_cycle`."
        )


# Values at equally spaced times of a period.


def components(over_time: Float[Array, "nt ..."]) -> Float[Array, "nt components"]:
    """Returns an array over time, with its components on the second axis."""
    return over_time.reshape(len(over_time), -1)


def rate_of(values: Float[Array, "nt ..."], period: Float[Array, ""]) -> Float[Array, "nt ..."]:
    """Returns the derivative by time of periodic values."""
    omega = odd_frequencies(len(values), period).reshape(-1, *[1] * (values.ndim - 1))
    return jnp.fft.irfft(1j * omega * jnp.fft.rfft(values, axis=0), len(values), axis=0)


@compiled
def refined(values: Float[Array, "nt ..."]) -> Float[Array, "more ..."]:
    """Returns periodic values at `_REFINED` times as many times, by their Fourier series."""
    count = len(values)
    waves = jnp.fft.rfft(values, axis=0)
    if count % 2 == 0:  # the highest frequency is now two, of both signs
        waves = waves.at[-1].divide(2)
    return jnp.fft.irfft(waves, _REFINED * count, axis=0) * _REFINED


def odd_frequencies(count: int, period: Float[Array, ""]) -> Float[Array, " nw"]:
    """Returns the frequencies ω >= 0 of a period; the highest of an even count, which has no sign,
    is 0."""
    omega = period_frequencies(count, period)
    return omega if count % 2 else omega.at[-1].set(0)
