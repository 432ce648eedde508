"""Observables: the numbers of a contact under sliding, each one function with its entry.

The formulas hold for steady sliding, for cycles and on windows: the operator of the contact knows
its fields (`contacts/operator.py`). Arrays over time are those of a cycle.

On the moving surface the pressure σ exerts the traction τ = -⟨σ ∇w⟩ [Pa] against the motion; w is
the displacement of the block. Its power τ·v, and in a cycle that of the load ⟨σ ∂w/∂t⟩ at a fixed
point of the surface, add up to the dissipation -Σ ω Im M |σ_qω|² over all waves of both signs,
which is never negative for a passive solid. At a fixed point of the block, w changes at the rate
U* iωM U σ, so that both sides agree to rounding.

In contact ∇w = ∇h, and for the continuous problem ⟨σ ∇w⟩ = ⟨σ ∇h⟩ exactly. On a grid the two
differ by ⟨σ ∇u⟩, which arises at the edges of the contact. `friction` uses the slope of the
displacement, which converges faster (ten times less error at 8 points per shortest wavelength,
`benchmarks/bench_contact.py`). `geometric_friction` uses the slope of the surface. The difference
of the two is the error of the grid.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..contacts import area
from ..contacts.operator import nonzero
from ..core.derivative import largest
from ..core.quantities import observable
from ..fields.frequency import direction_and_speed, wave_frequencies
from ..fields.grid import (
    coordinates,
    derivative,
    multiplicity,
    odd_wavevector,
)
from .motion import odd_frequencies, refined
from .result import CyclicSliding, Found, Sliding
from .shear import shear_field, shear_over_load, shear_parts

of_steady, of_cycle = (functools.partial(observable, cycle=kind) for kind in (False, True))
FOUR = "#.4g"  # a format of columns


# What several observables share.


def shared(formula: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Returns a formula that each program computes once, see `AbstractSliding.compute`."""

    @functools.wraps(formula)
    def run(found):
        known = vars(found).get("_shared", {})  # outside a program nothing is kept
        if formula not in known:
            known[formula] = formula(found)
        return known[formula]

    return run


@shared
def loaded(found: Found) -> tuple[Array, Array]:
    """The pressure on the cell, and its own displacement, which balances energy to rounding."""
    pressure = found.operator.on_cell(found.pressure)
    return pressure, found.operator.displace(pressure) + lift(found)


@shared
def tractions_on(found: Found) -> list[Array]:
    """The tangential traction on the block along each of its components [Pa], on the cell."""
    pressure, indicator, stress = found.pressure, contact_indicator(found), found.shear
    assert stress is not None
    if isinstance(found, CyclicSliding):
        speeds = lengths(found.motion_of_surface[0])
        at = lambda p, i, speed: shear_field(p, i, dataclasses.replace(stress, speed=speed))  # noqa: E731
        size = jax.vmap(at)(pressure, indicator, speeds)
    else:
        size = shear_field(pressure, indicator, stress)
    return [found.operator.on_cell(size * part) for part in found.directions]


@shared
def lift(found: Found) -> Array:
    """The displacement along z under the traction that the kernel does not contain [m]."""
    if found.coupling is None or found.coupling.in_kernel:
        return jnp.zeros((), found.pressure.dtype)
    return found.coupling.lifted(found.operator, tractions_on(found))


def displaced(found: Found) -> tuple[Array, Array]:
    """Pressure and displacement on the cell; the solution's own where it has one everywhere."""
    if "window" in found.facts:
        return loaded(found)
    return found.pressure, found.contact.displacement


def along_motion(found: Found) -> list[Array]:
    """q of each wave along the velocity [rad/m]; in a cycle along each axis that it moves on."""
    if isinstance(found, CyclicSliding):
        return list(odd_wavevector(found.grid)[: found.moved.shape[1]])
    # ω = -q·v of a unit velocity, with the other sign.
    return [-wave_frequencies(found.cell, direction_and_speed(found.velocity)[0])]


def tractions_of(found: Found, pressure: Array, profile: Array) -> Array:
    """-⟨σ ∂f/∂x⟩ [Pa] on the cell, along the motion on the last axis."""
    parts = [found.operator.traction(pressure, profile, q) for q in along_motion(found)]
    return jnp.stack(parts, axis=-1)


@shared
def _own_tractions(found: Found) -> Array:
    return tractions_of(found, *loaded(found))


@shared
def all_tractions(found: Found) -> Array:
    """The traction against the motion in a cycle, of slopes and of shear [Pa]."""
    return _own_tractions(found) + _sheared(found)[0]


def _over_load(found: Found, tractions: Array) -> Array:
    """Tractions over the load along the motion, NaN without contact."""
    if isinstance(found, Sliding):
        return tractions[0] / load(found)
    # Times without contact must not spoil the derivatives of the others.
    size = load(found)[:, None]
    over = jnp.where(size > 0, tractions / jnp.where(size > 0, size, 1), jnp.nan)
    return over.reshape(found.displacement.shape)


def frictions(found: Found, pressure: Array, indicator: Array) -> Array:
    """The friction of steady sliding, or mean and peak friction of a cycle, under a pressure.

    That of a cycle contains the shear, which acts where the indicator of contact is positive.
    """
    tractions = tractions_of(found, pressure, found.operator.displace(pressure) + lift(found))
    size = load(found, pressure)
    if isinstance(found, Sliding):
        return tractions / size
    over = tractions / jnp.where(size > 0, size, 1)[:, None]
    between, power = refined(over), _power(found, tractions)
    if found.shear is not None:
        (at, _), (along, rubbing) = (
            shear_of_cycle(found, pressure, indicator, fine) for fine in (False, True)
        )
        over = over + at / jnp.where(size > 0, size, 1)[:, None]
        fine_size = refined(size)[:, None]
        between = between + along / jnp.where(fine_size > 0, fine_size, 1)
        power = power + rubbing
    # The peak lies between two times; after a jump of the load, waves between them would be noise.
    peak = jnp.where(jnp.min(size) > 0, largest(lengths(between)), largest(lengths(over)))
    # Work over load and path: a mean of ratios would count times with little load too much.
    return jnp.stack([power / nonzero(_loaded_path(found, size)), peak])


def _loaded_path(found: Found, size: Array) -> Array:
    """The mean of load times speed [W/m²] of a cycle."""
    # At a turn the speed has a kink, which few times would smooth.
    return jnp.mean(refined(size) * lengths(refined(found.motion_of_surface[0])))


def shear_of_cycle(
    found: Found, pressure: Array, indicator: Array, fine: bool
) -> tuple[Array, Array]:
    """The traction of shear along the motion [Pa], at its times or `refined`, and its mean power.

    The law holds at the pressure and the speed of each time. At rest it has no direction and is 0.
    """
    rate, at_rest = found.motion_of_surface[0], rests(found)
    fastest = jnp.max(lengths(rate))
    times = refined if fine else (lambda over_time: over_time)

    def law(speed):
        # At rest a law, such as a power of the speed, may have no derivative.
        assert found.shear is not None
        return dataclasses.replace(found.shear, speed=jnp.where(speed > 0, speed, fastest))

    def at(pressure, indicator, speed):
        added = shear_parts(pressure, law(speed))[1]
        return area.sub_pixel_area(indicator), jnp.mean(added)

    touches, added = map(times, jax.vmap(at)(pressure, indicator, lengths(rate)))
    rate = times(rate)
    speed = lengths(rate)
    # Between the times the area is smooth, but near a turn the stress without pressure is not.
    least = jax.vmap(lambda speed: law(speed)(jnp.zeros((), pressure.dtype)))(speed)
    stress = least * touches + added
    # The Fourier series of a stop ripples.
    still = at_rest & jnp.roll(at_rest, 1)
    still = jnp.repeat(at_rest, len(speed) // len(at_rest)) if fine else still
    moves = ~still & (speed > 1e-9 * fastest)
    along = jnp.where(moves, stress / jnp.where(moves, speed, 1), 0)
    return along[:, None] * rate, jnp.mean(stress * speed)


def slopes(found: Found, pressure: Array, displacement: Array) -> Array:
    """The rms slope weighted by |pressure|, at each time; 0 without contact."""

    def slope(p, w):
        squared = sum(derivative(w, found.cell, axis) ** 2 for axis in range(found.cell.ndim))
        # With adhesion some pressures are negative.
        weight = jnp.abs(p)
        return _root(jnp.mean(weight * squared) / nonzero(jnp.mean(weight)))

    return found.operator.at_each_time(slope, pressure, displacement)


def _root(squared: Array) -> Array:
    """The square root, with the derivative 0 at 0."""
    return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1)), 0)


def lengths(vectors: Array) -> Array:
    """The lengths of vectors on the second axis, with the derivative 0 at 0."""
    return _root(jnp.sum(vectors**2, axis=1))


def rests(found: Found) -> Array:
    """Whether the surface rests from each time of a cycle to the next one."""
    moved, size = found.moved, found.grid.size[: found.moved.shape[1]]
    steps = jnp.roll(moved, -1, axis=0) - moved
    steps = lengths(steps - size * jnp.round(steps / size))  # the last may be by whole cells
    return steps <= 1e-6 * jnp.max(steps)


def _power(found: Found, tractions: Array) -> Array:
    """The mean power of tractions over a cycle [W/m²]."""
    return jnp.mean(jnp.sum(tractions * found.motion_of_surface[0], axis=1))


@shared
def frequencies(found: Found) -> Array:
    """ω of each wave of the pressure [rad/s]; the highest of an even number of times is 0."""
    if isinstance(found, Sliding):
        return wave_frequencies(found.cell, found.velocity)
    count = len(found.pressure)
    omega = odd_frequencies(count, found.period)
    signed = jnp.concatenate([omega, -omega[1 : (count + 1) // 2][::-1]])
    return signed.reshape(-1, *[1] * found.grid.ndim)


@shared
def dissipation_of_waves(found: Found) -> Array:
    """Returns the power lost in each wave and its conjugate [W/m²], on the half spectrum."""
    pressure, omega = loaded(found)[0], frequencies(found)
    if found.coupling is None:
        return found.operator.dissipation(pressure, omega)
    forces, moved = waves_of(found)
    work = sum(jnp.imag(jnp.conj(f) * u) for f, u in zip(forces, moved, strict=True))
    return jnp.asarray(-omega * work * multiplicity(pressure.shape))


@shared
def waves_of(found: Found) -> tuple[list[Array], list[Array]]:
    """Waves of pressure and tractions [Pa], and of the displacements along them [m]."""
    assert found.coupling is not None
    return found.coupling.waves(found.operator, loaded(found)[0], tractions_on(found))


@shared
def exchange(found: Found) -> tuple[Array, Array]:
    """Power that the pressure exchanges with the block, and the sum of its sizes [W/m²]."""
    pressure, operator, omega = loaded(found)[0], found.operator, frequencies(found)
    if found.coupling is None:
        rate = operator.filtered(1j * omega * operator.compliance, pressure)
    else:
        rate = rates_of(found)[0]
    power = pressure * rate
    return jnp.mean(power), jnp.mean(jnp.abs(power))


@shared
def rates_of(found: Found) -> list[Array]:
    """The rates of the displacements of `waves_of` at a fixed point of the block [m/s]."""
    shape = loaded(found)[0].shape
    waves = (1j * frequencies(found) * u * math.prod(shape) for u in waves_of(found)[1])
    return [found.operator.to_field(w, shape) for w in waves]


@shared
def touching(found: Found) -> Array:
    return contact_indicator(found) > 0


def _share_of(found: Found, formula: Callable[..., Array], *fields: Array) -> Array:
    """An area at each time, in the dtype of the pressure."""
    return found.operator.at_each_time(formula, *fields).astype(found.pressure.dtype)


def moved_where_loaded(found: Found, operator: Any, field: Array | float = 0.0) -> Array:
    """How far a window moves where it is loaded, less a field; and the block's mean part of it."""
    pressure, weight = operator.on_cell(found.pressure), jnp.abs(found.pressure)
    weight = jax.lax.stop_gradient(jnp.where(jnp.sum(weight) > 0, weight, 1))
    moved = operator.on_surface(operator.displace(pressure)) - field
    mean = operator.kernel[(0,) * operator.kernel.ndim].real * jnp.mean(pressure)
    return jnp.stack([jnp.sum(weight * moved) / jnp.sum(weight), mean])


# Load and gap.


@of_steady(
    r"\bar\sigma", "Pa", "mean contact pressure", needs=["load follows"],
    column=("pressure\n[Pa]", FOUR),
)  # fmt: skip
def mean_pressure(found: Sliding) -> Array:
    """Mean pressure [Pa]."""
    return found.contact.mean_pressure


@of_steady(r"\delta", "m", "approach", needs=["ground"], column=("approach\n[m]", ".3e"))
def approach(found: Sliding) -> Array:
    """How far a body on a window moved into the block after its first touch [m].

    Relative to the block far away; NaN if that displacement has no limit, see `solve_contact`.
    Negative if nothing touches.
    """
    if "window" not in found.facts:
        raise ValueError("Only a body on a window has an `approach`; use `mean_gap`.")
    moved, mean = moved_where_loaded(found, found.operator, found.heights + found.gap)
    ground = found.kernel[(0,) * found.kernel.ndim] != 0
    return moved + jnp.where(ground, mean, jnp.nan) + largest(found.heights)


@of_steady("", "1", "share of the load on the rim of the window", needs=["window"])
def rim_load(found: Sliding) -> Array:
    """Share of the load on the outermost points of a window [1]; NaN without a load."""
    rim = np.full(found.grid.shape, "window" in found.facts)
    rim[(slice(1, -1),) * found.grid.ndim] = False
    return jnp.sum(found.pressure, where=rim) / jnp.sum(found.pressure)


@of_steady("M", "N m", "moment of the pressure about the middle of the window", stored=False)
def moment(found: Sliding) -> Array:
    """Moment of the pressure about the middle of a window [N m], of a line [N].

    Force times distance along each axis.
    """
    forces = found.pressure * jnp.prod(found.grid.spacing)
    arms = (place - jnp.mean(place) for place in coordinates(found.grid))
    return jnp.stack([jnp.sum(forces * arm) for arm in arms])


# Friction, motion and energy.


@of_cycle(r"\bar\mu", "1", "work of friction over load and path", column=("friction\n(mean)", FOUR))
def mean_friction(found: CyclicSliding) -> Array:
    """Work over ∮ load |v| dt [1], 0 without motion; under steady sliding the friction."""
    return frictions(found, loaded(found)[0], contact_indicator(found))[0]


@of_cycle(
    r"\bar\mu_\mathrm{shear}", "1", "part of the mean friction from shear in the contact",
    needs=["sheared"], column=("shear\n(mean)", FOUR),
)  # fmt: skip
def mean_shear_friction(found: CyclicSliding) -> Array:
    """The part of `mean_friction` from shear in the contact area, with `shear` [1]."""
    return shear_power(found) / nonzero(_loaded_path(found, load(found)))


@of_cycle(
    r"\mu_\mathrm{max}", "1", "largest friction coefficient of a cycle",
    column=("friction\n(peak)", FOUR),
)  # fmt: skip
def peak_friction(found: CyclicSliding) -> Array:
    """The largest |friction|, also between the times [1]."""
    return frictions(found, loaded(found)[0], contact_indicator(found))[1]


@of_cycle("W", "J/m²", "work of friction in a cycle", column=("work\n[J/m²]", FOUR))
def work(found: CyclicSliding) -> Array:
    """Work of friction per area and cycle, that of shear included [J/m²]."""
    return (_power(found, _own_tractions(found)) + shear_power(found)) * found.period


@of_cycle(r"W_\sigma", "J/m²", "work of the load in a cycle")
def load_work(found: CyclicSliding) -> Array:
    """Work of the load on the block per area and cycle [J/m²].

    The sum of both, less the work of shear, is dissipated in the block.
    """
    return (exchange(found)[0] - _power(found, _own_tractions(found))) * found.period


@of_cycle("P", "W/m²", "mean power that the block dissipates", column=("power\n[W/m²]", FOUR))
def dissipated_power(found: CyclicSliding) -> Array:
    """Mean power lost in the block per area [W/m²]."""
    return jnp.sum(dissipation_of_waves(found))


@of_cycle("P", "W/m²", "power dissipated at each frequency", stored=False)
def dissipation(found: CyclicSliding) -> Array:
    """Its parts at the frequencies ω = 2π k/T, k = 0, 1, ..., shape `(nt//2 + 1,)`."""
    lost = dissipation_of_waves(found)
    lost, count = jnp.sum(lost, axis=tuple(range(1, lost.ndim))), len(lost)
    # A frequency and its negative are one entry.
    half, other = lost[: count // 2 + 1], lost[count // 2 + 1 :][::-1]
    return half.at[1 : len(other) + 1].add(other)


@of_cycle(
    r"\delta", "1", "phase of the traction before the displacement, in radians",
    column=("phase\n[rad]", ".3f"),
)  # fmt: skip
def phase(found: CyclicSliding) -> Array:
    """By which the first harmonic of the traction leads that of the displacement [rad].

    0 for a spring, π/2 for a dashpot; 0 without motion.
    """
    fields = all_tractions(found), found.motion_of_surface[1]
    force, moved = (jnp.fft.rfft(a, axis=0)[1] for a in fields)
    lead = jnp.sum(force * jnp.conj(moved))
    # The angle of 0 has no derivative.
    return jnp.angle(jnp.where(jnp.abs(lead) > 0, lead, 1))


@observable(r"\mu", "1", "friction coefficient", over_time=True, column=("friction", FOUR))
def friction(found: Found) -> Array:
    """Force opposing the motion over the load [1], hysteresis and shear together.

    It is >= 0 for passive materials in steady sliding, and NaN without contact. In a cycle it is
    positive where it opposes a motion along +x; over the displacement it draws the hysteresis loop.
    """
    if isinstance(found, CyclicSliding):
        return _over_load(found, all_tractions(found))
    return hysteresis_friction(found) + shear_friction(found)


@of_steady(
    r"\mu_\mathrm{hys}",
    "1",
    "friction from the slopes, without coupling the hysteresis",
    column=("hysteresis", FOUR),
)
def hysteresis_friction(found: Found) -> Array:
    """The part of the friction from the slopes [1]; without coupling it is lost in the block.

    With coupling it may be negative: `block_friction` is the part that the block loses.
    """
    return _over_load(found, _own_tractions(found))


@of_steady(
    r"\mu_\mathrm{shear}", "1", "friction coefficient of shear in the contact",
    column=("shear", FOUR),
)  # fmt: skip
def shear_friction(found: Found) -> Array:
    """The part from shear in the contact area [1]; 0 without `shear`."""
    if isinstance(found, CyclicSliding):
        return _over_load(found, _sheared(found)[0])
    return shear_over_load(found.pressure, contact_indicator(found), found.shear)


@observable(
    r"\Delta T", "K", "temperature of the contact above the bulk", needs=["heated"],
    column=("contact above\nbulk [K]", FOUR),
)  # fmt: skip
def surface_rise(found: Found) -> Array:
    """Temperature of the contact above the bulk, with heating [K]; the mean over a cycle."""
    assert found.heated is not None
    return found.heated.surface_rise


@observable(
    r"\mu_\mathrm{geo}", "1", "friction coefficient from the surface slope", over_time=True,
    stored=False,
)  # fmt: skip
def geometric_friction(found: Found) -> Array:
    """Friction with hysteresis from the surface's slope instead of the block's [1].

    Its difference from `friction` shows the error of the grid.
    """
    pressure = loaded(found)[0]
    heights = found.operator.on_cell(found.heights, "symmetric")
    tractions = tractions_of(found, pressure, jnp.broadcast_to(heights, pressure.shape))
    if isinstance(found, CyclicSliding):
        return _over_load(found, tractions + _sheared(found)[0])
    return _over_load(found, tractions) + shear_friction(found)


@of_cycle(r"\tau", "Pa", "shear stress that opposes the motion", over_time=True)
def traction(found: CyclicSliding) -> Array:
    """τ [Pa], the shear stress on the whole area, of hysteresis and shear together."""
    return all_tractions(found).reshape(found.displacement.shape)


@of_cycle(r"\sigma_0", "Pa", "mean pressure at each time", over_time=True)
def load(found: Found, pressure: Array | None = None) -> Array:
    """Mean pressure [Pa]."""
    # Of the cell, which is larger than a window.
    on_cell = loaded(found)[0] if pressure is None else pressure
    return found.operator.at_each_time(jnp.mean, on_cell)


# Contact area and gap.


@observable("A/A_0", "1", "contact area fraction", over_time=True, column=("contact\narea", ".5f"))
def contact_area(found: Found) -> Array:
    """Fraction of the surface in contact [1], with edges between the points."""

    def share(indicator, pressure):
        # Where the body flows, the pressure ends at its edge at once: its load needs this area.
        return jnp.maximum(area.sub_pixel_area(indicator), jnp.mean(pressure) / found.law.bounds[1])

    return _share_of(found, share, contact_indicator(found), found.pressure)


@observable("A/A_0", "1", "share of points in contact", over_time=True)
def contact_area_pixels(found: Found) -> Array:
    """Fraction of the points in contact [1]: 4 to 20 % more than the area, without a derivative."""
    return _share_of(found, area.counted_area, touching(found))


@of_cycle("t_c/T", "1", "share of the times at which the surfaces touch")
def time_in_contact(found: CyclicSliding) -> Array:
    """Share of the times at which the surfaces touch [1]."""
    return jnp.mean(contact_area_pixels(found) > 0, dtype=found.pressure.dtype)


@observable(r"\bar u", "m", "mean gap", over_time=True, column=("mean gap\n[m]", ".3e"))
def mean_gap(found: Found) -> Array:
    """Mean of the gap [m]."""
    gap = found.contact.mean_gap
    return gap.reshape(gap.shape[: -found.grid.ndim]) if isinstance(found, CyclicSliding) else gap


@observable("", "Pa", "how far points are inside contact or outside", stored=False)
@shared
def contact_indicator(found: Found) -> Array:
    """How far points are inside contact or outside [Pa], see `AbstractLaw.contact_indicator`."""
    stiffness = area.edge_stiffness(found.operator.at_edges, found.cell)
    return found.law.contact_indicator(found.pressure, found.gap, stiffness)


# Shear in the contact.


@shared
def _sheared(found: Found) -> tuple[Array, Array]:
    """The tractions of shear along the motion at the times of a cycle [Pa], and the mean power."""
    if found.shear is None:
        return jnp.zeros_like(found.moved), jnp.zeros((), found.pressure.dtype)
    given = found, loaded(found)[0], contact_indicator(found)
    return shear_of_cycle(*given, False)[0], shear_of_cycle(*given, True)[1]


def shear_power(found: Found) -> Array:
    """Mean power of shear in a cycle [W/m²]."""
    return _sheared(found)[1]
