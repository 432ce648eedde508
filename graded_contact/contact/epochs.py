"""What the fast solver does on one of its grids, in programs that are compiled once.

The splitting goes in epochs: a solve that takes long begins again with the penalty that suits the
area found in contact. Where more than as many steps again are to come, it is slow, and Newton steps
(`newton_steps.py`) may take as many FFT pairs as the splitting took so far.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..fields.grid import interpolate, resample_spectrum, to_field, to_spectrum
from .held_points import most_eliminated
from .law import AbstractLaw
from .newton_steps import newton_round
from .on_grid import OnGrid, Scene, as_guess, full_or, on_grid, start_of
from .solver import (
    Iterated,
    Prescribed,
    first_mode,
    participation,
    penalty_for,
    pressure_unit,
    watch_of,
)
from .splitting import CYCLE, draft, iterate

# All within 2 % of the fewest FFT pairs of `bench_contact.py viscoelastic`.
_COARSE_ERROR = 0.02  # of the nested coarse grids, which only give a start
_EPOCH = 50  # steps before the penalty is chosen anew; then as many as were done
_SMALL = 0.125  # share along an axis of points in contact, up to which Newton steps pay


class Plan(NamedTuple):
    """What is done on a grid, all static; `share` is that of its points."""

    share: float
    finest: bool
    hard: bool  # a wall at a given load
    geared: bool
    draft_steps: int
    max_steps: int
    relaxation: float
    memory: int
    keep: Callable[[Array], None] | None

    def aim(self, rtol):
        return rtol if self.finest else jnp.asarray(_COARSE_ERROR, rtol.dtype)

    def how(self, problem: OnGrid, rtol) -> dict[str, Any]:
        return dict(
            rtol=self.aim(rtol),
            relaxation=self.relaxation,
            memory=self.memory,
            watch=watch_of(self.keep, problem.unit),
        )


class Progress(NamedTuple):
    """Where a solve stands on one grid."""

    z: Array
    shift: Array  # of the splitting
    factor: Array  # the penalty over the first
    steps: Array
    drafted: Array  # steps before
    epochs: Array
    error: Array
    going_on: Array
    due: Array  # whether an epoch is to follow
    slow: Array  # whether Newton steps are, before that
    newton_pairs: Array
    coat: Array
    settled: Array  # whether Newton steps found a contact, that the splitting is to confirm
    pairs: Array  # before the first epoch, of all grids by their size

    def all_pairs(self, share: float):
        """With those of the epochs, each one beside its steps and one to begin again."""
        return self.pairs + share * (self.steps + self.newton_pairs + 2 * self.epochs - 1)


def scenes(kernel, heights, prescribed: Prescribed, shapes) -> list[Scene]:
    """The contact on grids of these shapes, the last of them its own."""
    coarse, unit = _coarser(kernel, heights, prescribed, shapes[:-1])
    return [*coarse, Scene(kernel, heights, unit)]


@eqx.filter_jit
def _coarser(kernel, heights, prescribed: Prescribed, shapes):
    shape, flat, coarse = heights.shape, heights - jnp.mean(heights), []
    spectrum = to_spectrum(flat)
    alone = jnp.where(first_mode(kernel.shape), 0, kernel)
    for level in shapes:
        share = float(np.prod(level) / np.prod(shape))
        rough = to_field(resample_spectrum(spectrum, shape, level) * share, level)
        near = resample_spectrum(alone, shape, level)
        coarse.append(Scene(near, rough, pressure_unit(near, rough, prescribed)))
    return coarse, pressure_unit(kernel, flat, prescribed)


def approach(
    scene: Scene,
    law: AbstractLaw,
    prescribed: Prescribed,
    before,
    rtol,
    plan: Plan,
    in_parts: bool,
) -> tuple[OnGrid, Progress]:
    """The contact on a grid, and how far the splitting comes, from a pressure or from none.

    `before` is a pressure [Pa], or what was found on the grid before.
    """
    numbers, state = _approach(scene, law, prescribed, before, rtol, plan, in_parts)
    return OnGrid(scene, *numbers, prescribed.pressure is None), state


@eqx.filter_jit
def _approach(scene: Scene, law, prescribed, before, rtol, plan: Plan, in_parts: bool):
    """The same without the scene: what a program returns it copies."""
    rough = scene.heights
    own = 0.0 if plan.finest else 0.5 * plan.share  # of the grid's heights
    guess, touching, pairs = None, 0.0, own if plan.finest else 0.5 + own
    if before is not None:
        if isinstance(before, tuple):
            coarse, last = before
            share = plan.share * coarse.scene.heights.size / rough.size
            pairs = last.all_pairs(share) + share + own
            _, y, _ = _meet(coarse, last)
            before = coarse.at_load(y) * coarse.unit
        touching = jnp.mean(before > 0, dtype=rough.dtype)
        guess = as_guess(scene, law, prescribed, interpolate(before, rough.shape))
        pairs = pairs + plan.share
    problem = on_grid(scene, law, prescribed, guess)
    how = plan.how(problem, rtol)
    if guess is not None and plan.hard:
        guess, taken = full_or(problem, guess, touching)
        pairs = pairs + plan.share * taken
    one, none, no = jnp.ones((), rough.dtype), jnp.asarray(0), jnp.asarray(False)
    shift = problem.shift(one)
    begun = problem.splitting(one, shift), start_of(problem, guess)
    z, drafted = draft(*begun, max_steps=plan.draft_steps, **how)
    numbers = one, none, drafted, none, one * jnp.inf
    pairs = one * (pairs + plan.share * drafted)
    state = Progress(z, shift, *numbers, ~no, ~no, no, none, 0 * one, no, pairs)
    if plan.geared and not in_parts:
        state = gear_up(problem, state, rtol, plan)
    else:
        state = _epochs(problem, state, how, plan)
    return (problem.penalty, problem.law, problem.target), state


def _epochs(problem: OnGrid, state: Progress, how, plan: Plan) -> Progress:
    """Iterates, again and again with another penalty if it takes long, unless Newton steps help."""

    def epoch(state):
        limit = jnp.where(state.settled, 0, state.steps)
        limit = jnp.clip(limit, _EPOCH, plan.max_steps - state.steps)
        splitting = problem.splitting(state.factor, state.shift)
        last = iterate(splitting, state.z, max_steps=limit, **how)
        steps = state.steps + last.cycles * CYCLE
        due = last.going_on & (steps + state.newton_pairs < plan.max_steps)
        state = state._replace(
            z=last.z,
            steps=steps,
            epochs=state.epochs + 1,
            error=last.error,
            going_on=last.going_on,
            due=due,
        )
        return jax.lax.cond(due, begin_again, lambda same: same, state)

    def begin_again(state):
        """The same pressures and gaps with the penalty for the area in contact by now."""
        _, y, gap = _meet(problem, state)
        kernel, law = problem.solid_at(state.factor).compliance, problem.law_at(state.factor)
        change = penalty_for(kernel, participation(y), law)
        factor = state.factor * change
        state = state._replace(z=y + change * gap, factor=factor, shift=problem.shift(factor))
        if not plan.geared:
            return state
        # At its pace so far the splitting needs more than as many steps again; few points are
        # found at once.
        few = jnp.sum(y > 0) <= most_eliminated(y)
        slow = state.settled | few | (state.error > jnp.sqrt(how["rtol"]))
        slow &= jnp.mean(y > 0, dtype=y.dtype) < _SMALL**y.ndim
        return state._replace(slow=slow, due=~slow)

    return jax.lax.while_loop(lambda state: state.due, epoch, state)


@eqx.filter_jit
def gear_up(problem: OnGrid, state: Progress, rtol, plan: Plan) -> Progress:
    """Iterates to the end, with Newton steps where the splitting is slow."""
    how = plan.how(problem, rtol)

    def shift(state):
        solid = problem.solid_at(state.factor)
        z, coat, pairs, settled = newton_round(
            solid.compliance,
            problem.heights(state.factor),
            problem.target,
            state.z,
            state.shift + solid(state.z),
            state.coat,
            rtol=how["rtol"],
            # Under `vmap` those that are not slow come here too.
            budget=jnp.where(state.slow, state.steps, 0),
        )
        pairs = state.newton_pairs + pairs + 2
        return state._replace(
            z=z, coat=coat, newton_pairs=pairs, settled=settled, slow=state.due, due=state.slow
        )

    def turn(state):
        state = jax.lax.cond(state.slow, shift, lambda same: same, state)
        return _epochs(problem, state, how, plan)

    return jax.lax.while_loop(lambda state: state.slow | state.due, turn, state)


def _meet(problem: OnGrid, state: Progress):
    """The pressures of solid and law, x and y, and the gap at which the law has the latter."""
    x = state.shift + problem.solid_at(state.factor)(state.z)
    v = 2 * x - state.z
    y = problem.law_at(state.factor).proximal(v)
    return x, y, y - v


@eqx.filter_jit
def found(problem: OnGrid, state: Progress) -> Iterated:
    """The contact where a solve ended on the finest grid."""
    factor = state.factor
    x, y, gap = _meet(problem, state)
    # The displacement has the stiff waves of the law's pressure and the soft ones of the
    # solid's: each would magnify what is left of the error in the others.
    pressure = problem.at_load(y)
    stiff = problem.solid_at(factor)(pressure - x)
    solid_gap = (state.z - x + (pressure - x) - stiff) / factor
    unit, length = problem.unit, problem.length
    return Iterated(
        pressure=pressure * unit,
        gap=gap * (length / factor),
        mismatch=(x - y) * unit,
        displacement=(solid_gap + problem.heights()) * length,
        error=state.error,
        ended=~state.going_on,
        num_steps=state.drafted + state.steps,
        num_fft_pairs=state.all_pairs(1.0) + 3,
    )
