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

from .estimates import Assessment, assess, changed, error_of
from .implicit import Inputs
from .newton import newton_step
from .solution import ContactSolution
from .solver import AbstractContactSolver, Iterated, participation

# Of the pressure in the first solve: at most, and over the tolerance. A second solve costs what the
# loosest first one saves; by `bench_contact.py observables`.
_LOOSEST, _LOOSER = 0.03, 100
_BOUND = 1.5
_CLOSE = 1e-3  # of what is tolerable: no step is needed
WORTHLESS = 0.1  # error of gaps over the rms height


class Asked(NamedTuple):
    """What is wanted of a contact, all of one shape.

    **Fields:**

    - `value`: the numbers, continuous in the pressure.
    - `size`: what they are differences of, or their own size: it limits their digits.
    - `tolerance`: acceptable errors.
    """

    value: Float[Array, " numbers"]
    size: Float[Array, " numbers"]
    tolerance: Float[Array, " numbers"]


class Wanted(eqx.Module):
    """The numbers of an observable, each to a relative error unless it tells what it tolerates."""

    observable: Callable[[ContactSolution], Array | Asked]
    rtol: Float[Array, ""]

    def __call__(self, contact: ContactSolution) -> Asked:
        # Derivatives by what it closes over must not reach the loops of the search.
        observable, closed = jax.closure_convert(lambda c: self.observable(c), contact)
        value = observable(contact, *jax.lax.stop_gradient(closed))
        if isinstance(value, Asked):
            return value
        value = jnp.ravel(jnp.asarray(value))
        size = jnp.abs(value)
        return Asked(value, size, self.rtol * size)


class Known(NamedTuple):
    """A contact, and what is known of its errors.

    **Fields:**

    - `contact`: from the solver, or after a step.
    - `assessed`: the errors of the contact.
    - `errors`: those of the target numbers.
    - `reached`: whether these are within their tolerances.
    """

    contact: Iterated
    assessed: Assessment | None = None
    errors: Float[Array, " numbers"] | None = None
    reached: Bool[Array, ""] | None = None


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
    no_errors = jnp.zeros(errors.shape, errors.dtype)
    none = jnp.zeros_like(inputs.heights), first.error, first.error
    unknown = Known(first, Assessment(*none), no_errors, jnp.asarray(False))
    state = _State(first, unknown, loosest, jnp.asarray(True))
    return jax.lax.while_loop(lambda state: state.going_on, body, state).known


def _step(inputs: Inputs, found: Iterated, wanted, describe) -> tuple[Known, Float[Array, ""]]:
    """The contact after a step, its errors, and the worst of them over its tolerance."""
    better = found
    # At a given gap the load follows from small differences, of which a step knows little.
    if inputs.prescribed.pressure is not None:
        # Nor does a contact need one whose pressure is known this well: numbers change by no more,
        # but for peaks.
        before = wanted(describe(found))
        bound = found.error / jnp.sqrt(participation(found.pressure))
        close = jnp.all(bound * before.size <= _CLOSE * before.tolerance) & found.ended
        better = jax.lax.cond(close, lambda: found, lambda: newton_step(inputs, found))
    # The bound of the pressure's error was once exceeded by 2 %. Here no tolerance refers to it.
    better = dataclasses.replace(better, error=_BOUND * better.error)
    assessed = assess(inputs, better)
    new = wanted(describe(better))

    def numbers(correction):
        return wanted(describe(changed(inputs, better, correction))).value

    errors = error_of(numbers, new.value, assessed.correction, new.size)
    ratios = errors / jnp.where(new.tolerance > 0, new.tolerance, jnp.finfo(errors.dtype).tiny)
    rms = jnp.std(inputs.heights)
    worthless = assessed.gap_error / (WORTHLESS * jnp.where(rms > 0, rms, 1))
    worst = jnp.maximum(jnp.max(ratios), worthless)
    return Known(better, assessed, errors, worst <= 1), worst
