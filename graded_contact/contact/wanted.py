"""Solves until chosen numbers are known, whatever that takes of the pressure.

Friction and mean gap are known long before the pressure is. From a solve that is good to a few
per cent one step of Newton's method (`newton.py`) leads to better numbers, and what it changes them
by tells their error before; only where that is too much a closer solve follows, which begins where
the step ended.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .implicit import Inputs
from .newton import newton_step
from .solution import ContactSolution
from .solver import AbstractContactSolver, Iterated, participation, root_mean_square

# Of the pressure in the first solve: at most, and over the tolerance. A second solve costs what the
# loosest first one saves; by `bench_contact.py observables`.
_LOOSEST, _LOOSER = 0.03, 100
# Two numbers may agree by chance: this is added to their difference, in sizes of the number times
# the error of the pressure. By random scenes.
_BY_CHANCE = 0.002
_CLOSE = 1e-3  # of what is tolerable: no step is needed
WORTHLESS = 0.1  # error of gaps over the rms height


class Asked(NamedTuple):
    """What is wanted of a contact, all of one shape.

    **Fields:**

    - `value`: the numbers, continuous in the pressure.
    - `size`: what they are of the order of, unless by chance much smaller.
    - `tolerance`: acceptable errors.
    - `share`: of what a step changes them by, which is claimed as their error. A wall of some
      hardness once left 1.06.
    """

    value: Float[Array, " numbers"]
    size: Float[Array, " numbers"]
    tolerance: Float[Array, " numbers"]
    share: Float[Array, " numbers"] | float = 2.0


class Wanted(eqx.Module):
    """The numbers of an observable, each to a relative error unless it tells what it tolerates."""

    observable: Callable[[ContactSolution], Array | Asked]
    rtol: Float[Array, ""]

    def __call__(self, contact: ContactSolution) -> Asked:
        # Whatever it closes over may have derivatives, of which the search must not know.
        value = jax.lax.stop_gradient(self.observable(contact))
        if isinstance(value, Asked):
            return value
        value = jnp.ravel(jnp.asarray(value))
        size = jnp.abs(value)
        return Asked(value, size, self.rtol * size)


class Known(NamedTuple):
    """A contact, the errors of what is wanted of it, and if they are tolerable; or None."""

    contact: Iterated
    errors: Float[Array, " numbers"] | None
    reached: Bool[Array, ""] | None


class _State(NamedTuple):
    found: Iterated
    known: Known
    rtol: Float[Array, ""]
    going_on: Bool[Array, ""]


def solve_until(
    inputs: Inputs,
    solver: AbstractContactSolver,
    wanted: Wanted,
    start: Float[Array, "*shape"] | None,
    describe: Callable[[Iterated], ContactSolution],
) -> Known:
    """Returns a contact whose wanted numbers are known to their tolerances.

    `describe` makes a solution of what a solver found.
    """
    dtype = inputs.heights.dtype
    least = 1e3 * jnp.finfo(dtype).eps

    def solve(rtol, start):
        return solver.solve(*inputs, rtol=rtol, start=start)

    def body(state: _State) -> _State:
        found, _, rtol, _ = state
        known, worst = _step(inputs, found, wanted, describe)
        going_on = ~(worst <= 1) & (found.error <= rtol) & (rtol > least)
        # The claim is first to second order in the error of the pressure.
        closer = jnp.maximum(rtol * jnp.clip(0.5 / worst, 1e-3, 0.3), least)

        def solve_closer():
            better = solve(closer, known.contact.pressure)
            pairs = known.contact.num_fft_pairs + better.num_fft_pairs
            return dataclasses.replace(better, num_fft_pairs=pairs)

        found = jax.lax.cond(going_on, solve_closer, lambda: found)
        return _State(found, known, closer, going_on)

    loosest = jnp.clip(_LOOSER * wanted.rtol, least, _LOOSEST).astype(dtype)
    first = solve(loosest, start)
    errors = jax.eval_shape(lambda: wanted(describe(first)).value)
    unknown = Known(first, jnp.zeros(errors.shape, errors.dtype), jnp.asarray(False))
    state = _State(first, unknown, loosest, jnp.asarray(True))
    return jax.lax.while_loop(lambda state: state.going_on, body, state).known


def _step(inputs: Inputs, found: Iterated, wanted, describe) -> tuple[Known, Float[Array, ""]]:
    """The contact after a step, its errors, and the worst of them over what is tolerable."""
    before = describe(found)
    old = wanted(before)
    # A contact that is known this well needs no step: the change of a number is at most about
    # the pressure's, by its peaks.
    bound = found.error / jnp.sqrt(participation(found.pressure))
    close = jnp.all(bound * old.size <= _CLOSE * old.tolerance) & found.ended
    better = jax.lax.cond(close, lambda: found, lambda: newton_step(inputs, found))
    after = describe(better)
    new = wanted(after)
    by_chance = _BY_CHANCE * found.error
    errors = new.share * (jnp.abs(new.value - old.value) + by_chance * new.size)
    errors = jnp.where(close, bound * new.size, errors)
    rms = jnp.std(inputs.heights)
    gap_error = root_mean_square(after.gap - before.gap) + by_chance * rms
    gap_error = jnp.where(close, found.gap_error, gap_error)
    ratios = errors / jnp.where(new.tolerance > 0, new.tolerance, jnp.finfo(rms.dtype).tiny)
    worst = jnp.maximum(jnp.max(ratios), gap_error / (WORTHLESS * jnp.where(rms > 0, rms, 1)))
    better = dataclasses.replace(better, gap_error=gap_error)
    return Known(better, errors, worst <= 1), worst
