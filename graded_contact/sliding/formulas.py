"""Common parts of observables: fields, tractions and slopes of a contact under sliding.

The formulas hold for steady sliding, for cycles and on windows: the operator of the contact knows
its fields (`contacts/operators/operator.py`). Arrays over time belong to a cycle.

On the moving surface the pressure σ exerts the traction τ = -⟨σ ∇(w - h_b)⟩ [Pa] against the
motion: the power of this force, and of the load, is what the bodies take. w is the displacement of
the block, h_b are the heights of its own surface, if it is rough. The slope is the interface's:
where the bodies touch it is also the slope of h - w_c, w_c being the displacement of the
counterface. On a grid the two differ by the slope of the gap at the edges of contact, and heights
have more of this error than displacements (`friction.py`). So if both bodies are rough, each form
counts by the part of the other body in the mean square slope: the bodies may be exchanged.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..contacts import area
from ..contacts.operators.operator import nonzero
from ..core.derivative import largest, root_or_zero
from ..fields.frequency import direction_and_speed, wave_frequencies
from ..fields.grid import Grid, derivative, odd_wavevector
from .case import WINDOW
from .motion.motion import refined
from .number import Found
from .problem import CycleProblem, SteadyProblem
from .shear import shear_field, shear_parts

_NO_LOAD = 1e-9  # of the mean size of the pressure


def shared(formula: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Returns a formula that each program computes once, see `Kept`."""

    @functools.wraps(formula)
    def run(found):
        known = found.kept.formulas
        if known is None:
            return formula(found)
        if formula not in known:
            known[formula] = formula(found)
        return known[formula]

    return run


def mean_load(found: Found, pressure: Array | None = None) -> Array:
    """The mean pressure, in a cycle at each time [Pa]."""
    # Of the cell, which is larger than a window.
    on_cell = loaded(found)[0] if pressure is None else pressure
    return found.operator.at_each_time(jnp.mean, on_cell)


@shared
def loaded(found: Found) -> tuple[Array, Array]:
    """The pressure on the cell, and the displacement of the block under it.

    This displacement, unlike the solution's, balances energy to rounding.
    """
    pressure = found.operator.on_cell(found.pressure)
    return pressure, displaced_by(found, pressure)


def displaced_by(found: Found, pressure: Array) -> Array:
    """The displacement of the block under a pressure, and under the traction of the contact [m]."""
    return found.problem.block.displace(pressure) + _lifted(found)


def interface(found: Found, pressure: Array, moved: Array) -> Array:
    """The surface at which the bodies touch under a pressure that displaces the block [m]."""
    if isinstance(found.problem, SteadyProblem) or found.problem.block_heights is None:
        return moved
    problem = found.problem
    of_counterface = problem.heights
    if problem.counterface is not None:
        of_counterface = of_counterface - counterface_displacement(found, pressure)
    return touching_at(problem.roughness, problem.grid, moved - problem.passing, of_counterface)


def touching_at(roughness: Sequence[Array], grid: Grid, block: Array, counterface: Array) -> Array:
    """The interface of two rough bodies [m], from the surfaces of both under their pressure."""

    def squared(heights):
        slope = [derivative(heights, grid, axis) for axis in range(heights.ndim)]
        return jnp.mean(jnp.stack(slope) ** 2)

    surface, own = map(squared, roughness)
    own = own / nonzero(surface + own)
    return (1 - own) * block + own * counterface


def counterface_displacement(found: Found, pressure: Array) -> Array:
    """The displacement of the counterface under a pressure, into it, on the cell [m]."""
    assert found.problem.counterface is not None
    return found.problem.counterface.displace(pressure, _on_counterface(found))


@shared
def tractions_on(found: Found) -> list[Array]:
    """The tangential traction on the block along each of its components [Pa], on the cell."""
    pressure, indicator, stress = found.pressure, indicator_of(found), found.shear
    assert stress is not None
    edges = edges_of(found)
    if isinstance(found.problem, CycleProblem):
        speeds = lengths(found.motion_of_surface[0])
        law = lambda speed: dataclasses.replace(stress, speed=speed)  # noqa: E731
        at = lambda p, i, speed: shear_field(p, i, edges, law(speed))  # noqa: E731
        size = jax.vmap(at)(pressure, indicator, speeds)
    else:
        size = shear_field(pressure, indicator, edges, stress)
    return [found.operator.on_cell(size * part) for part in found.directions]


@shared
def _lifted(found: Found) -> Array:
    """The displacement of the block along z under the traction that its kernel lacks [m]."""
    if found.coupling.lags:
        return found.coupling.lifted(found.operator, tractions_on(found))
    return jnp.zeros((), found.pressure.dtype)


def lift(found: Found) -> Array:
    """The displacement of both bodies that the kernel of the contact does not contain [m]."""
    counterface = found.problem.counterface
    if counterface is None:
        return _lifted(found)
    return _lifted(found) + counterface.beyond_kernel(found.pressure, _on_counterface(found))


def _on_counterface(found: Found) -> list[Array]:
    """The tangential traction on the counterface, opposite to that on the block [Pa]."""
    return [-part for part in tractions_on(found)] if found.coupling.lags else []


def displaced(found: Found) -> tuple[Array, Array]:
    """Pressure and displacement of the block on the cell; the solution's own if it is known."""
    if WINDOW in found.facts or found.problem.counterface is not None:
        return loaded(found)
    return found.pressure, found.contact.displacement


def along_motion(found: Found) -> list[Array]:
    """q of each wave along the velocity [rad/m]; in a cycle along each axis that it moves on."""
    if isinstance(found.problem, CycleProblem):
        return list(odd_wavevector(found.grid)[: found.moved.shape[1]])
    # ω = -q·v of a unit velocity, with the other sign.
    return [-wave_frequencies(found.cell, direction_and_speed(found.velocity)[0])]


def tractions_of(found: Found, pressure: Array, profile: Array) -> Array:
    """-⟨σ ∂f/∂x⟩ [Pa] on the cell, along the motion on the last axis."""
    parts = [found.operator.traction(pressure, profile, q) for q in along_motion(found)]
    return jnp.stack(parts, axis=-1)


@shared
def own_tractions(found: Found) -> Array:
    pressure, moved = loaded(found)
    return tractions_of(found, pressure, interface(found, pressure, moved))


@shared
def all_tractions(found: Found) -> Array:
    """The traction against the motion in a cycle, of slopes and of shear [Pa]."""
    return own_tractions(found) + sheared(found)[0]


def over_load(found: Found, tractions: Array) -> Array:
    """Tractions over the load along the motion, NaN without contact."""
    if isinstance(found.problem, SteadyProblem):
        size = mean_load(found)
        if found.law.attracts:  # pressures of both signs may leave a load of rounding
            known = jnp.abs(size) > _NO_LOAD * jnp.mean(jnp.abs(found.pressure))
            return jnp.where(known, tractions[0] / jnp.where(known, size, 1), jnp.nan)
        return tractions[0] / size
    # Times without contact must not spoil the derivatives of the others.
    size = mean_load(found)[:, None]
    over = jnp.where(size > 0, tractions / jnp.where(size > 0, size, 1), jnp.nan)
    return over.reshape(found.displacement.shape)


def frictions(found: Found, pressure: Array, indicator: Array) -> Array:
    """The friction of steady sliding, or mean and peak friction of a cycle, under a pressure.

    In a cycle, friction includes shear, which acts where the indicator of contact is positive.
    """
    moved = displaced_by(found, pressure)
    tractions = tractions_of(found, pressure, interface(found, pressure, moved))
    size = mean_load(found, pressure)
    if isinstance(found.problem, SteadyProblem):
        return tractions / size
    over = tractions / jnp.where(size > 0, size, 1)[:, None]
    between, rubbing = refined(over), power_of(found, tractions)
    if found.shear is not None:
        (at, _), (along, sheared_power) = (
            shear_of_cycle(found, pressure, indicator, fine) for fine in (False, True)
        )
        over = over + at / jnp.where(size > 0, size, 1)[:, None]
        fine_size = refined(size)[:, None]
        between = between + along / jnp.where(fine_size > 0, fine_size, 1)
        rubbing = rubbing + sheared_power
    # The peak lies between two times; after a jump of the load, waves between them would be noise.
    peak = jnp.where(jnp.min(size) > 0, largest(lengths(between)), largest(lengths(over)))
    # Work over load and path: a mean of ratios would count times with little load too much.
    peak = jnp.where(jnp.any(size > 0), peak, jnp.nan)
    return jnp.stack([over_path(found, rubbing, size), peak])


def over_path(found: Found, power: Array, size: Array) -> Array:
    """The power of a cycle over load and path [1]: 0 without motion, NaN without contact."""
    return jnp.where(jnp.any(size > 0), power / nonzero(loaded_path(found, size)), jnp.nan)


def loaded_path(found: Found, size: Array) -> Array:
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
    edges, fastest = edges_of(found), jnp.max(lengths(rate))
    times = refined if fine else (lambda over_time: over_time)

    def law(speed):
        # At rest a law, such as a power of the speed, may have no derivative.
        assert found.shear is not None
        return dataclasses.replace(found.shear, speed=jnp.where(speed > 0, speed, fastest))

    def at(pressure, indicator, speed):
        added = shear_parts(pressure, law(speed))[1]
        return area.sub_pixel_area(indicator, edges), jnp.mean(added)

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
    slope = lambda p, w: weighted_slope(p, w, found.cell)  # noqa: E731
    return found.operator.at_each_time(slope, pressure, displacement)


def weighted_slope(pressure: Array, displacement: Array, cell: Grid) -> Array:
    """The rms slope weighted by |pressure|; 0 without contact."""
    squared = sum(derivative(displacement, cell, axis) ** 2 for axis in range(cell.ndim))
    weight = jnp.abs(pressure)  # with adhesion some pressures are negative
    return root_or_zero(jnp.mean(weight * squared) / nonzero(jnp.mean(weight)))


def lengths(vectors: Array) -> Array:
    """The lengths of vectors on the second axis, with the derivative 0 at 0."""
    return root_or_zero(jnp.sum(vectors**2, axis=1))


def rests(found: Found) -> Array:
    """Whether the surface rests from each time of a cycle to the next one."""
    moved, size = found.moved, found.grid.size[: found.moved.shape[1]]
    steps = jnp.roll(moved, -1, axis=0) - moved
    steps = lengths(steps - size * jnp.round(steps / size))  # the last may be by whole cells
    return steps <= 1e-6 * jnp.max(steps)


def power_of(found: Found, tractions: Array) -> Array:
    """The mean power of tractions over a cycle [W/m²]."""
    return jnp.mean(jnp.sum(tractions * found.motion_of_surface[0], axis=1))


@shared
def touching(found: Found) -> Array:
    return indicator_of(found) > 0


@shared
def indicator_of(found: Found) -> Array:
    """How far points are inside contact or outside [Pa], see `AbstractLaw.contact_indicator`."""
    stiffest = stiffness_at_edges(found)[1]
    return found.law.contact_indicator(found.pressure, found.gap, stiffest)


@shared
def stiffness_at_edges(found: Found) -> tuple[Array, Array]:
    """The softest and the stiffest that an edge of contact can be [Pa/m], see `edge_stiffness`."""
    load = found.operator.at_each_time(jnp.mean, found.pressure)
    return area.edge_stiffness(found.operator.at_edges(load), found.cell)


@shared
def edges_of(found: Found) -> area.Edges:
    """The stiffness and the cuts at the edges of contact."""
    softest, stiffest = stiffness_at_edges(found)
    cuts = area.cuts_of(found.heights, WINDOW not in found.facts)
    return area.Edges(softest / stiffest, cuts)


@shared
def sheared(found: Found) -> tuple[Array, Array]:
    """The tractions of shear along the motion at the times of a cycle [Pa], and the mean power."""
    if found.shear is None:
        return jnp.zeros_like(found.moved), jnp.zeros((), found.pressure.dtype)
    given = found, loaded(found)[0], indicator_of(found)
    return shear_of_cycle(*given, False)[0], shear_of_cycle(*given, True)[1]


def shear_power(found: Found) -> Array:
    """Mean power of shear in a cycle [W/m²]."""
    return sheared(found)[1]
