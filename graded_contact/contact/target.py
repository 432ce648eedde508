"""Solves until chosen numbers are accurate, at any accuracy of the pressure.

Friction and mean gap are accurate long before the pressure is. After a solve to a few per cent, one
step of Newton's method (`error_step`) improves the numbers, and the errors after this step are
estimated. If they are too large, a solve to a smaller tolerance follows, from the result of the
step.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact

from ..fields.grid import Grid
from .adjoint import Inputs
from .area import contact_area_corrected, contact_area_smooth
from .estimates import Assessment, assess, changed, error_of, error_step
from .law import AbstractLaw
from .observables import friction, shear_friction, slope_in_contact
from .operator import displace
from .solution import ContactSolution
from .solver import AbstractContactSolver, SolverOutput, participation
from .window import on_cell, stiffness_at_edges

# Tolerance of the pressure in the first solve: largest value, and ratio to the tolerance of the
# numbers. A looser first solve makes a second solve more likely (`bench_contact.py observables`).
_LOOSEST, _LOOSER = 0.03, 100
_BOUND = 1.5
_CLOSE = 1e-3  # error over tolerance below which no step is needed
WORTHLESS = 0.1  # error of gaps over the rms height
# If friction is below this share of the rms slope, its tolerance is relative to that share. The
# tolerances of friction and area are at least this part of the grid error.
_LEAST_SHARE = 0.01
_OF_GRID = 0.1


class ObservableTarget(NamedTuple):
    """Numbers of a contact and their tolerances, all of one shape.

    **Fields:**

    - `value`: the numbers, continuous in the pressure.
    - `size`: of the numbers, or of the terms that they are differences of; it limits their digits.
    - `tolerance`: acceptable errors.
    """

    value: Float[Array, " numbers"]
    size: Float[Array, " numbers"]
    tolerance: Float[Array, " numbers"]


class Target(eqx.Module):
    """The numbers of an observable, each to a relative error unless it gives tolerances."""

    observable: Callable[[ContactSolution], Array | ObservableTarget]
    rtol: Float[Array, ""]

    def __call__(self, contact: ContactSolution) -> ObservableTarget:
        # Derivatives by what it closes over must not reach the loops of the search.
        observable, closed = jax.closure_convert(lambda c: self.observable(c), contact)
        value = observable(contact, *jax.lax.stop_gradient(closed))
        if isinstance(value, ObservableTarget):
            return value
        value = jnp.ravel(jnp.asarray(value))
        size = jnp.abs(value)
        return ObservableTarget(value, size, self.rtol * size)


class FoundContact(NamedTuple):
    """A contact and its errors.

    **Fields:**

    - `contact`: from the solver, or after a step.
    - `assessed`: the errors of the contact.
    - `errors`: those of the target numbers.
    - `reached`: whether these are within their tolerances.
    """

    contact: SolverOutput
    assessed: Assessment | None = None
    errors: Float[Array, " numbers"] | None = None
    reached: Bool[Array, ""] | None = None


class _State(NamedTuple):
    found: SolverOutput
    better: FoundContact
    rtol: Float[Array, ""]
    running: Bool[Array, ""]


def solve_until(
    inputs: Inputs,
    solver: AbstractContactSolver,
    target: Target,
    start: Float[Array, "*shape"] | None,
    describe: Callable[[SolverOutput], ContactSolution],
) -> FoundContact:
    """Returns a contact whose target numbers are within their tolerances.

    `describe` makes a solution of what a solver found.
    """
    dtype = inputs.heights.dtype
    least = 1e3 * jnp.finfo(dtype).eps

    def solve(rtol, start):
        return solver.solve(*inputs, rtol=rtol, start=start)

    def body(state: _State) -> _State:
        found, _, rtol, _ = state
        known, worst = _step(inputs, found, target, describe)
        running = ~(worst <= 1) & (found.error <= rtol) & (rtol > least)
        # The claim is first to second order in the error of the pressure.
        closer = jnp.maximum(rtol * jnp.clip(0.5 / worst, 1e-3, 0.3), least)

        def solve_closer():
            better = solve(closer, known.contact.pressure)
            pairs = known.contact.num_fft_pairs + better.num_fft_pairs
            return dataclasses.replace(better, num_fft_pairs=pairs)

        found = jax.lax.cond(running, solve_closer, lambda: found)
        return _State(found, known, closer, running)

    loosest = jnp.clip(_LOOSER * target.rtol, least, _LOOSEST).astype(dtype)
    first = solve(loosest, start)
    errors = jax.eval_shape(lambda: target(describe(first)).value)
    no_errors = jnp.zeros(errors.shape, errors.dtype)
    none = jnp.zeros_like(inputs.heights), first.error, first.error
    unknown = FoundContact(first, Assessment(*none), no_errors, jnp.asarray(False))
    state = _State(first, unknown, loosest, jnp.asarray(True))
    return jax.lax.while_loop(lambda state: state.running, body, state).better


def _step(
    inputs: Inputs, found: SolverOutput, target: Target, describe
) -> tuple[FoundContact, Float[Array, ""]]:
    """The contact after a step, its errors, and the worst of them over its tolerance."""
    better = found
    # At a given gap the load follows from small differences, of which a step knows little.
    if inputs.loading.pressure is not None:
        # A contact whose pressure is this accurate needs no step: numbers change by no more, except
        # for peaks.
        before = target(describe(found))
        bound = found.error / jnp.sqrt(participation(found.pressure))
        close = jnp.all(bound * before.size <= _CLOSE * before.tolerance) & found.ended
        better = jax.lax.cond(close, lambda: found, lambda: error_step(inputs, found))
    # The bound of the pressure's error was once exceeded by 2 %. Here no tolerance refers to it.
    better = dataclasses.replace(better, error=_BOUND * better.error)
    assessed = assess(inputs, better)
    new = target(describe(better))

    def numbers(correction):
        return target(describe(changed(inputs, better, correction))).value

    errors = error_of(numbers, new.value, assessed.correction, new.size)
    ratios = errors / jnp.where(new.tolerance > 0, new.tolerance, jnp.finfo(errors.dtype).tiny)
    rms = jnp.std(inputs.heights)
    worthless = assessed.gap_error / (WORTHLESS * jnp.where(rms > 0, rms, 1))
    worst = jnp.maximum(jnp.max(ratios), worthless)
    return FoundContact(better, assessed, errors, worst <= 1), worst


class FrictionAndArea(eqx.Module):
    """Friction and sub-pixel contact area to `friction_rtol`; `shear` as in `shear_friction`."""

    kernel: Inexact[Array, "*half"]
    heights: Float[Array, "*shape"]
    grid: Grid
    velocity: Float[Array, "..."]
    law: AbstractLaw
    rtol: Float[Array, ""]
    shear: Callable[[Array], Array] | None = None

    def __call__(self, contact: ContactSolution) -> ObservableTarget:
        grid, sigma = self.grid, on_cell(contact.pressure, self.kernel)
        heights = on_cell(self.heights, self.kernel, "symmetric")
        own = displace(self.kernel, sigma)
        mu, geometric = (friction(sigma, f, grid, self.velocity) for f in (own, heights))
        slope = slope_in_contact(sigma, own, grid)
        stiffness = stiffness_at_edges(self.kernel, grid, contact.gap.shape)
        indicator = self.law.contact_indicator(contact.pressure, contact.gap, stiffness)
        area = contact_area_smooth(indicator)
        counted = contact_area_corrected(indicator > 0).astype(area.dtype)
        by_grid = jnp.abs(jnp.stack([geometric - mu, counted - area]))
        sheared = shear_friction(contact.pressure, indicator, self.shear)
        value, size = jnp.stack([mu + sheared, area]), jnp.stack([slope + sheared, area])
        tolerance = self.rtol * jnp.maximum(jnp.abs(value), _LEAST_SHARE * size)
        tolerance = jnp.maximum(tolerance, _OF_GRID * by_grid)
        # Without contact there is no friction.
        touching = jnp.any(sigma != 0)
        value, size, tolerance = (jnp.where(touching, a, 0) for a in (value, size, tolerance))
        return ObservableTarget(value, size, tolerance)
