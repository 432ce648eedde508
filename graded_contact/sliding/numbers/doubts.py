"""Observables that show whether the numbers of a contact can be trusted."""

import functools
from collections.abc import Iterable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...core.caveats import DOUBTFUL
from ...core.derivative import largest
from ...core.quantities import (
    CYCLE,
    KINDS,
    TRANSIENT,
    Above,
    observable,
    of_cycle,
    of_steady,
    of_transient,
)
from ...fields.grid import to_field, to_spectrum
from ...materials.coverage import coverage, is_unknown, unknown_share
from ..energy import exchange, frequencies, losses, powers_of_traction
from ..facts import COUNTERFACE, WINDOW
from ..formulas import (
    all_tractions,
    along_motion,
    counterface_displacement,
    displaced,
    lengths,
    loaded,
    mean_load,
    moved_where_loaded,
    rests,
    slopes,
    touching,
)
from ..motion.over_period import rate_of
from ..motion.periodic import Motion
from ..motion.transient import SingleMotion
from ..result import CyclicSliding, Found, Sliding, TransientSliding
from .area import mean_gap
from .cycle import load_work
from .load import approach

EXTRAPOLATED = 0.01  # of the friction, from frequencies at which a material was not measured
# Small strains neglect slope²/2, the excess of an arc over its chord.
STEEPEST = (2 * DOUBTFUL) ** 0.5


def _unmeasured(what: str) -> str:
    return (
        f"{{value:.0%}} of the {what} on points that were filled or tapered, not measured. "
        "Crop to a `region` without them, or read with `periodic='mirror'`."
    )


def _lost(found: Found) -> Array:
    """The power that both bodies dissipate [W/m²]."""
    return _sum_of(map(jnp.sum, losses(found)))


def _sum_of(parts: Iterable[Array]) -> Array:
    return functools.reduce(jnp.add, parts)


def _share_unmeasured(found: Sliding, weight: Array) -> Array:
    """The share of a weight on points that were not measured."""
    if found.problem.measured is None:
        return jnp.zeros((), found.pressure.dtype)
    return jnp.sum(weight * (1 - found.problem.measured)) / nonzero(jnp.sum(weight))


@observable("", "1", "relative difference of friction work and dissipation")
def energy_imbalance(found: Found) -> Array:
    """Work of hysteresis, and of the load, against dissipation in both bodies, relative [1].

    With coupling also the work of the shear on the bodies.
    """
    exchanged, size = exchange(found)
    for power in powers_of_traction(found):
        exchanged += jnp.mean(power)
        size += jnp.mean(jnp.abs(power))
    imbalance = jnp.abs(exchanged - _lost(found)) / nonzero(size)
    return jax.lax.stop_gradient(imbalance)  # of rounding


@observable(
    "", "1", "rms slope of the block, weighted by the pressure",
    warns=Above(
        STEEPEST,
        "The block's rms slope where it carries the load is {value:.2g}. The model assumes small "
        f"strains: above an rms slope of {STEEPEST:.2g} the neglected terms exceed {DOUBTFUL:.0%}.",
    ), kinds=KINDS,
)  # fmt: skip
def slope_in_contact(found: Found) -> Array:
    """Rms slope of the block where it carries the load [1], the largest of all times.

    It is the size of the strains there. The friction of a hard wall never exceeds it.
    """
    return largest(slopes(found, *displaced(found)))


@observable(
    "", "1", "rms slope of the counterface, weighted by the pressure", needs=[COUNTERFACE],
    warns=Above(
        STEEPEST,
        "The rms slope of the counterface's displacement where it carries the load is "
        "{value:.2g}: its strains are not small.",
    ),
)  # fmt: skip
def counterface_slope(found: Found) -> Array:
    """Rms slope of the counterface's displacement where it carries the load [1]; 0 if it is
    rigid."""
    if found.problem.counterface is None:
        return jnp.zeros((), found.pressure.dtype)
    pressure = loaded(found)[0]
    return largest(slopes(found, pressure, counterface_displacement(found, pressure)))


@of_steady(
    "", "1", "share of the contact area on filled or tapered points",
    warns=Above(DOUBTFUL, _unmeasured("contact area lies")),
)  # fmt: skip
def unmeasured_area(found: Sliding) -> Array:
    """Share of the contact area on points that were filled or tapered, not measured [1].

    0 where `Surface.measured` is None.
    """
    return _share_unmeasured(found, touching(found).astype(found.pressure.dtype))


@of_steady(
    "", "1", "share of the hysteresis on filled or tapered points",
    column=("on points not\nmeasured", ".1%"),
    warns=Above(DOUBTFUL, _unmeasured("friction arises")),
)  # fmt: skip
def unmeasured_friction(found: Sliding) -> Array:
    """The same share of the tangential traction |σ ∂w/∂x_v| [1].

    Tractions up and down the slopes nearly cancel in friction.
    """
    pressure, displacement = displaced(found)
    (q,) = along_motion(found)
    slope = to_field(1j * q * to_spectrum(displacement), pressure.shape)
    return _share_unmeasured(found, found.operator.on_surface(jnp.abs(pressure * slope)))


@observable(
    "", "1", "share of the friction where no modulus was measured",
    warns=Above(
        EXTRAPOLATED,
        "{value:.0%} of the friction comes from frequencies or a temperature at which a material "
        "was not measured: its modulus there is an extrapolation.",
    ),
)  # fmt: skip
def extrapolated_friction(found: Found) -> Array:
    """Share of the dissipation at frequencies at which a material was not measured [1].

    Its modulus there is an extrapolation. See `coverage`; a material of the body that dissipates.
    """
    counterface, omega = found.problem.counterface, frequencies(found)
    ranges = (
        found.problem.measured_range,
        None if counterface is None else counterface.measured_range,
    )
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


@of_transient(
    "", "1", "share of the times, by their logarithm, at which no modulus was measured",
    warns=Above(
        EXTRAPOLATED,
        "A material was not measured at {value:.0%} of the times between the shortest step and the "
        "end, by their logarithm: its modulus there is an extrapolation.",
    ),
)  # fmt: skip
def extrapolated_times(found: TransientSliding) -> Array:
    """Share of the times t, from the shortest step to the end, for which 1/t was not measured [1].

    Counted by the logarithm of t; the larger one of both bodies.
    """
    rates = SingleMotion(found.times, found.problem.displacement).rates
    known = [one for body in found.problem.bodies if (one := coverage(body)) is not None]
    shares = [unknown_share(*rates, one) for one in known]
    return jax.lax.stop_gradient(functools.reduce(jnp.maximum, shares, jnp.zeros_like(rates[0])))


@of_steady(
    "", "1", "approach over the thickness of layers on a rigid base", needs=[WINDOW],
    warns=Above(
        0.2 - 1e-3,  # from 20 % on, whatever the error of the solve
        "The body moved into the layers by {value:.0%} of their thickness above the rigid base. "
        f"The model assumes small strains: above 20% the neglected terms exceed {DOUBTFUL:.0%}.",
    ),
)  # fmt: skip
def compression(found: Sliding) -> Array:
    """How far a body on a window moved into layers on a rigid base, over their thickness [1].

    0 on another base. With a counterface the larger of both: each has its share of the approach.
    """
    problem, none = found.problem, jnp.zeros((), found.pressure.dtype)
    counterface = problem.counterface
    if counterface is None:
        return none if problem.thickness is None else approach(found) / problem.thickness
    bodies = (problem.block, problem.thickness), (counterface.operator, counterface.thickness)
    whole = jnp.sum(moved_where_loaded(found, found.operator))
    parts = (
        jnp.sum(moved_where_loaded(found, operator)) / nonzero(whole) / thickness
        for operator, thickness in bodies
        if thickness is not None
    )
    return approach(found) * functools.reduce(jnp.maximum, parts, none)


@of_steady(
    "", "1", "share of the load on the rim of the window", needs=[WINDOW],
    warns=Above(
        1e-3,
        "{value:.2g} of the load acts on the rim of the window. Take a larger window, unless the "
        "body ends there.",
    ),
)  # fmt: skip
def rim_load(found: Sliding) -> Array:
    """Share of the load on the outermost points of a window [1]; NaN without a load."""
    rim = np.full(found.grid.shape, WINDOW in found.facts)
    rim[(slice(1, -1),) * found.grid.ndim] = False
    return jnp.sum(found.pressure, where=rim) / jnp.sum(found.pressure)


@of_cycle(
    "", "1", "difference of two forms of the load's work, over the dissipation",
    warns=Above(
        DOUBTFUL,
        "The work of the load has an error of about {value:.0%} of the dissipated energy: the "
        "load or the gap changes too fast for the number of times. Take more times, or let a "
        "jump last several of them.",
    ),
)  # fmt: skip
def load_mismatch(found: CyclicSliding) -> Array:
    """Difference of `load_work` from -∮ σ0 dū, its other form, over the energy dissipated [1].

    It is the error of grid and times; 0 without dissipation.
    """
    by_gap = -jnp.mean(mean_load(found) * rate_of(mean_gap(found), found.period))
    lost = _lost(found)
    return jnp.abs(load_work(found) / found.period - by_gap) / nonzero(lost)


@observable(
    "", "1", "largest step from one time to the next, in spacings of the grid",
    warns=Above(
        1.0 + DOUBTFUL,
        "The surface moves by up to {value:.2g} spacings of the grid from one time to the next: "
        "the times do not resolve how the shortest waves move. Take more times.",
    ),
    kinds=(CYCLE, TRANSIENT),
)  # fmt: skip
def largest_step(found: CyclicSliding | TransientSliding) -> Array:
    """Largest distance from one time to the next, in spacings of the grid, along x plus y [1]."""
    if isinstance(found, TransientSliding):
        return SingleMotion(found.times, found.problem.displacement).largest_step(found.grid)
    return Motion(found.displacement, found.period).largest_step(found.grid)


@of_cycle(
    "", "1", "extent of the motion that comes back, over the cell",
    warns=Above(
        1 + 1e-3,  # a stroke as long as the cell may be rounded
        "The stroke is {value:.3g} times as long as the cell: the surface is periodic, so that "
        "the next copy of each asperity follows in its track before it turns. Take a larger cell "
        "or a shorter stroke.",
    ),
)  # fmt: skip
def stroke_over_cell(found: CyclicSliding) -> Array:
    """Extent of the motion along an axis over the edge of the cell [1], the larger one.

    Of the part that comes back: 0 under steady sliding.
    """
    back = found.motion_of_surface[1]
    return jnp.max(jnp.ptp(back, axis=0) / found.grid.size[: back.shape[1]])


@observable(
    "", "1", "path after a rest, over the cell",
    warns=Above(
        1 + 1e-3,
        "After a rest the surface moves by {value:.3g} times the cell: it is periodic, so that "
        "after each cell it meets what it left where it rested, and friction and gap change once "
        "more. Trust the times before, or take a larger cell or a shorter path.",
    ),
    kinds=(TRANSIENT,),
)  # fmt: skip
def path_after_rest(found: TransientSliding) -> Array:
    """The largest distance from where a surface rested, later, over the edge of the cell [1].

    Along one axis, the larger one; 0 without a rest, and on a window.
    """
    if WINDOW in found.facts:
        return jnp.zeros((), found.grid.size.dtype)
    x = found.problem.displacement.reshape(len(found.problem.displacement), -1)
    rested = jnp.all(jnp.diff(x, axis=0) == 0, axis=1)[:, None]
    last = [jax.lax.cummax(sign * x[1:], reverse=True) - sign * x[1:] for sign in (1, -1)]
    far = jnp.where(rested, jnp.maximum(*last), 0)
    return jnp.max(jnp.max(far, axis=0, initial=0) / found.grid.size[: x.shape[1]])


@of_cycle(
    "", "1", "ripple of the traction before a start, over its peak",
    warns=Above(
        0.01,  # smooth starts have 0.3 % or less
        "At rest, before it starts, the friction ripples by {value:.1%} of its peak. This ripple "
        "is numerical: the motion starts too suddenly for the times. Take more times, or a "
        "smoother start.",
    ),
)  # fmt: skip
def ripple_at_rest(found: CyclicSliding) -> Array:
    """Ripple of the traction at rest, before a start, over the largest traction [1].

    From time to time it changes its sign, unlike what decays. 0 for a motion without a rest.
    """
    still = rests(found)
    soon = ~(jnp.roll(still, -1) & jnp.roll(still, -2) & jnp.roll(still, -3))
    tractions = all_tractions(found)
    neighbours = (jnp.roll(tractions, 1, axis=0) + jnp.roll(tractions, -1, axis=0)) / 2
    ripple = lengths(tractions - neighbours) / 2
    before = jnp.where(jnp.roll(still, 1) & still & soon, ripple, 0)
    return jnp.max(before) / nonzero(jnp.max(lengths(tractions)))


@of_cycle(
    "", "1", "share of the velocity at the upper half of the frequencies",
    warns=Above(
        DOUBTFUL,
        "{value:.0%} of the velocity is at the upper half of the frequencies that the times "
        "resolve: the motion has kinks or jumps. Take more times, or a smoother motion.",
    ),
)  # fmt: skip
def unresolved_motion(found: CyclicSliding) -> Array:
    """Share of the velocity at the upper half of the frequencies [1]."""
    waves = jnp.abs(jnp.fft.rfft(found.motion_of_surface[0], axis=0)) ** 2
    upper = jnp.sum(waves[len(found.moved) // 4 + 1 :]) / nonzero(jnp.sum(waves))
    return jnp.sqrt(upper)


@observable(
    "", "1", "estimated relative error of the contact pressure",
    column=("error of\npressure", ".1e"), kinds=KINDS,
)  # fmt: skip
def error(found: Found) -> Array:
    """Estimated relative error of the pressure [1]."""
    return found.contact.error


@observable("", "1", "FFT pairs of the solve", column=("FFT\npairs", ".0f"), kinds=KINDS)
def num_fft_pairs(found: Found) -> Array:
    """FFT pairs of the solve [1]."""
    return found.contact.num_fft_pairs
