"""Numbers that show whether the others can be trusted, and their limits."""

import functools
from collections.abc import Iterable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...core.derivative import largest
from ...fields.grid import to_field, to_spectrum, wavenumber
from ...materials.coverage import is_unknown, unknown_share
from ..case import PERIODIC, WINDOW
from ..energy import exchange, frequencies, losses, powers_of_traction
from ..formulas import along_motion, counterface_displacement, displaced, loaded, shared, slopes
from ..limits import WARN_ABOVE, Above, NumberOf
from ..motion.motion import step_length
from ..number import Found, observable
from ..transient_problem import TransientProblem, steps_of

EXTRAPOLATED = 0.01  # of the friction, from frequencies at which a material was not measured
_ABSENT = 1e-9  # part of the largest squared slope of a wave below which there is no wave
# Small strains neglect slope²/2, the excess of an arc over its chord.
STEEPEST = (2 * WARN_ABOVE) ** 0.5

TOO_STEEP = Above(
    STEEPEST,
    "The rms slope of a body where it carries the load is {value:.2g}. The model assumes small "
    f"strains: above an rms slope of {STEEPEST:.2g} the neglected terms exceed {WARN_ABOVE:.0%}.",
)
NOT_MEASURED = Above(
    WARN_ABOVE,
    "{value:.0%} of the friction arises on points that were filled or tapered, not measured. Crop "
    "to a part of the surface without them.",
)
BEYOND_SHORTEST = Above(
    0,
    "Waves shorter than {value:.2g} m add to friction, and the surface has none: the last octave "
    f"of its waves makes more than {WARN_ABOVE:.0%}.",
    of=lambda number: np.where(
        number("last_octave_friction") > WARN_ABOVE, number("shortest_wave"), 0
    ),
)
BEYOND_FREQUENCIES = Above(
    EXTRAPOLATED,
    "{value:.0%} of the friction comes from frequencies or a temperature at which a material was "
    "not measured: its modulus there is an extrapolation.",
)
BEYOND_TIMES = Above(
    EXTRAPOLATED,
    "A material was not measured at {value:.0%} of the times between the shortest step and the "
    "end, by their logarithm: its modulus there is an extrapolation.",
)
ON_THE_RIM = Above(
    1e-3,
    "{value:.2g} of the load acts on the outermost points of a non-periodic surface. Take a larger "
    "surface, unless the body ends there.",
)
TOO_FAST = Above(
    1 + WARN_ABOVE,
    "The surface moves by up to {value:.2g} spacings of the grid from one time to the next: the "
    "times do not resolve how the shortest waves move. Take more times.",
)


def _apart(number: NumberOf):
    return np.isnan(number("friction")) & (number("slope_in_contact") == 0)


def _never_loaded(number: NumberOf):
    return np.all(number("load") == 0, axis=-1)


APART = Above(
    0, "The surfaces do not touch: there is no load, so friction is not defined.", of=_apart
)
NEVER_LOADED = Above(
    0, "The surfaces never touch: without a load there is no friction.", of=_never_loaded
)


def _sum_of(parts: Iterable[Array]) -> Array:
    return functools.reduce(jnp.add, parts)


@observable("relative difference of friction work and dissipation")
def energy_imbalance(found: Found) -> Array:
    """Work of hysteresis, and of the load, against dissipation in both bodies, relative [1].

    With coupling also the work of the shear on the bodies.
    """
    exchanged, size = exchange(found)
    for power in powers_of_traction(found):
        exchanged += jnp.mean(power)
        size += jnp.mean(jnp.abs(power))
    lost = _sum_of(map(jnp.sum, losses(found)))  # the power that both bodies dissipate
    imbalance = jnp.abs(exchanged - lost) / nonzero(size)
    return jax.lax.stop_gradient(imbalance)  # of rounding


@observable("rms slope of the bodies, weighted by the pressure", warns=TOO_STEEP)
def slope_in_contact(found: Found) -> Array:
    """Rms slope of a body where it carries the load [1], the largest of both and of all times.

    It is the size of the strains there. The friction of a hard wall never exceeds it.
    """
    steepest = largest(slopes(found, *displaced(found)))
    if found.problem.counterface is None:
        return steepest
    pressure = loaded(found)[0]
    other = slopes(found, pressure, counterface_displacement(found, pressure))
    return jnp.maximum(steepest, largest(other))


@observable("share of the hysteresis on filled or tapered points", warns=NOT_MEASURED)
def unmeasured_friction(found: Found) -> Array:
    """Share on points that were filled or tapered of the tangential traction |σ ∂w/∂x_v| [1].

    Tractions up and down the slopes nearly cancel in friction.
    """
    if found.problem.measured is None:
        return jnp.zeros((), found.pressure.dtype)
    pressure, displacement = displaced(found)
    (q,) = along_motion(found)
    slope = to_field(1j * q * to_spectrum(displacement), pressure.shape)
    weight = found.operator.on_surface(jnp.abs(pressure * slope))
    return jnp.sum(weight * (1 - found.problem.measured)) / nonzero(jnp.sum(weight))


@shared
def _wavenumbers(found: Found) -> tuple[Array, Array]:
    """The lowest and the highest wavenumber of the rough surfaces [rad/m]."""
    q, waves = wavenumber(found.grid), map(to_spectrum, found.problem.roughness)
    squared = _sum_of(jnp.abs(q * one) ** 2 for one in waves)
    present = squared > _ABSENT * jnp.max(squared)
    return jnp.min(jnp.where(present, q, jnp.inf)), jnp.max(jnp.where(present, q, 0))


@observable("shortest wave of the surface", unit="m", needs=[PERIODIC])
def shortest_wave(found: Found) -> Array:
    """The shortest wave of the rough surfaces [m]."""
    return 2 * jnp.pi / _wavenumbers(found)[1]


@observable("friction share of the last octave of waves", needs=[PERIODIC], warns=BEYOND_SHORTEST)
def last_octave_friction(found: Found) -> Array:
    """Share of the hysteresis from waves less than twice as long as the shortest [1].

    It tells how much shorter waves, which were not measured, may add. 0 for roughness of a single
    octave, which has a shape of its own.
    """
    lowest, highest = _wavenumbers(found)
    lost = _sum_of(jnp.abs(body) for body in losses(found))
    half = highest / 2 * (1 + 1e-6)  # a wave of twice the length belongs to the octave before
    last = jnp.sum(jnp.where(wavenumber(found.grid) > half, lost, 0))
    return jnp.where(lowest <= half, last / nonzero(jnp.sum(lost)), 0)


@observable("share of the friction where no modulus was measured", warns=BEYOND_FREQUENCIES)
def extrapolated_friction(found: Found) -> Array:
    """Share of the dissipation at frequencies at which a material was not measured [1].

    Its modulus there is an extrapolation. See `coverage`; a material of the body that dissipates.
    """
    omega, ranges = frequencies(found), found.problem.measured_ranges
    # Under steady sliding the counterface is at rest: the block alone dissipates.
    lost = [jnp.abs(body) for body in losses(found)]
    unknown = [
        jnp.sum(jnp.where(is_unknown(omega, known), body, 0))
        for body, known in zip(lost, ranges, strict=False)
        if known is not None
    ]
    if not unknown:
        return jnp.zeros((), found.pressure.dtype)
    return _sum_of(unknown) / nonzero(_sum_of(map(jnp.sum, lost)))


@observable("logarithmic share of times without a measured modulus", warns=BEYOND_TIMES)
def extrapolated_times(found: Found) -> Array:
    """Share of the times t, from the shortest step to the end, for which 1/t was not measured [1].

    Counted by the logarithm of t; the larger one of both bodies.
    """
    times = found.problem.times
    rates = 1 / times[-1], 1 / jnp.min(steps_of(times))
    ranges = found.problem.measured_ranges
    shares = [unknown_share(*rates, known) for known in ranges if known is not None]
    return jax.lax.stop_gradient(functools.reduce(jnp.maximum, shares, jnp.zeros_like(rates[0])))


@observable("share of the load on the outermost points", needs=[WINDOW], warns=ON_THE_RIM)
def rim_load(found: Found) -> Array:
    """Share of the load on the outermost points of a non-periodic surface [1]."""
    rim = np.full(found.grid.shape, WINDOW in found.facts)
    rim[(slice(1, -1),) * found.grid.ndim] = False
    return jnp.sum(found.pressure, where=rim) / jnp.sum(found.pressure)


@observable("largest step from one time to the next, in spacings of the grid", warns=TOO_FAST)
def largest_step(found: Found) -> Array:
    """Largest distance from one time to the next, in spacings of the grid, along x plus y [1]."""
    from_rest = isinstance(found.problem, TransientProblem)
    return step_length(found.problem.displacement, found.grid.spacing, from_rest)


@observable("estimated relative error of the contact pressure")
def error(found: Found) -> Array:
    """Estimated relative error of the pressure [1]."""
    return found.contact.error


@observable("FFT pairs of the solve")
def num_fft_pairs(found: Found) -> Array:
    """FFT pairs of the solve [1]."""
    return found.contact.num_fft_pairs
