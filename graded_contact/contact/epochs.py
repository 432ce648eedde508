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

from ..grid import interpolate, resample_spectrum, to_field, to_spectrum
from .held_points import most_eliminated
from .law import AbstractLaw
from .newton_steps import newton_round
from .on_grid import OnGrid, as_guess, full_or, on_grid, start_of
from .solver import (
    Iterated,
    Prescribed,
    first_mode,
    participation,
    penalty_for,
    pressure_unit,
    root_mean_square,
    slope,
    watch_of,
)
from .splitting import CYCLE, Splitting, draft, gap_error, iterate, rounding_error

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


class Scene(NamedTuple):
    """The contact on a grid, and a typical pressure."""

    kernel: Array
    heights: Array
    waves: Array
    unit: Array


class Progress(NamedTuple):
    """Where a solve stands on one grid."""

    z: Array
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
        """With those of the epochs, each half a one beside its steps and one to begin again."""
        return self.pairs + share * (self.steps + self.newton_pairs + 1.5 * self.epochs - 1)


@eqx.filter_jit
def scenes(kernel, heights, prescribed: Prescribed, shapes) -> list[Scene]:
    shape, scenes = heights.shape, []
    kernel = jnp.where(first_mode(kernel.shape), 0, kernel)
    heights = heights - jnp.mean(heights)
    spectrum = to_spectrum(heights)
    for level in shapes:
        near, waves, rough = resample_spectrum(kernel, shape, level), spectrum, heights
        if level != shape:
            share = float(np.prod(level) / np.prod(shape))
            waves = resample_spectrum(spectrum, shape, level) * share
            rough = to_field(waves, level)
        scenes.append(Scene(near, rough, waves, pressure_unit(near, rough, prescribed)))
    return scenes


@eqx.filter_jit
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
    near, rough, waves, unit = scene
    guess, touching, pairs = None, 0.0, 0.5 if plan.finest else 0.5 * (1 + plan.share)
    if before is not None:
        if isinstance(before, tuple):
            coarse, last = before
            share = plan.share * coarse.heights.size / rough.size
            pairs = last.all_pairs(share) + 1.5 * share + (pairs - 0.5)
            solid, near_law = coarse.at(last.factor)
            _, y, _ = _meet(solid, near_law, last.z)
            before = coarse.at_load(y) * coarse.unit
        touching = jnp.mean(before > 0, dtype=rough.dtype)
        guess = as_guess(near, law, prescribed, unit, interpolate(before, rough.shape))
        pairs = pairs + plan.share
    problem = on_grid(near, rough, waves, law, prescribed, unit, guess)
    how = plan.how(problem, rtol)
    if guess is not None and plan.hard:
        guess, taken = full_or(problem, guess, touching)
        pairs = pairs + plan.share * taken
    z = start_of(problem, guess)
    z, drafted = draft(problem.splitting(1.0), z, max_steps=plan.draft_steps, **how)
    pairs = pairs + plan.share * jnp.where(drafted > 0, drafted + 0.5, 0.0)
    one, none, no = jnp.ones((), z.dtype), jnp.asarray(0), jnp.asarray(False)
    state = Progress(
        z, one, none, drafted, none, one * jnp.inf, ~no, ~no, no, none, 0 * one, no, pairs * one
    )
    if plan.geared and not in_parts:
        return problem, gear_up(problem, state, rtol, plan)
    return problem, _epochs(problem, state, how, plan)


def _epochs(problem: OnGrid, state: Progress, how, plan: Plan) -> Progress:
    """Iterates, again and again with another penalty if it takes long, unless Newton steps help."""

    def epoch(state):
        limit = jnp.where(state.settled, 0, state.steps)
        limit = jnp.clip(limit, _EPOCH, plan.max_steps - state.steps)
        solid, near = problem.at(state.factor)
        last = iterate(Splitting(solid, near.proximal), state.z, max_steps=limit, **how)
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
        return jax.lax.cond(due, begin_again, lambda same, *_: same, state, solid, near)

    def begin_again(state, solid, near):
        """The same pressures and gaps with the penalty for the area in contact by now."""
        _, y, gap = _meet(solid, near, state.z)
        change = penalty_for(state.factor * problem.kernel, participation(y), near)
        state = state._replace(z=y + change * gap, factor=state.factor * change)
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
        solid, _ = problem.at(state.factor)
        z, coat, pairs, settled = newton_round(
            state.factor * problem.kernel,
            state.factor * problem.heights,
            problem.target,
            state.z,
            solid(state.z),
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


def _meet(solid: Callable, law: AbstractLaw, z):
    """The pressures of solid and law, x and y, and the gap at which the law has the latter."""
    x = solid(z)
    v = 2 * x - z
    y = law.proximal(v)
    return x, y, y - v


@eqx.filter_jit
def found(problem: OnGrid, state: Progress, rtol) -> Iterated:
    """The contact where a solve ended on the finest grid."""
    solid, law = problem.at(state.factor)
    factor, ended = state.factor, ~state.going_on
    x, y, gap = _meet(solid, law, state.z)
    # Where rounding ended the solve, the residual is noise, most of it out of contact.
    error = jax.lax.cond(
        ended & (state.error > rtol),
        lambda: jnp.minimum(state.error, rounding_error(factor * problem.kernel, law, x, y, gap)),
        lambda: state.error,
    )
    # The displacement has the stiff waves of the law's pressure and the soft ones of the
    # solid's: each would magnify what is left of the error in the others.
    pressure = problem.at_load(y)
    stiff = to_field(solid.filter * to_spectrum(pressure - x), x.shape)
    solid_gap = (state.z - x + (pressure - x) - stiff) / factor
    held = slope(law, y - gap)
    offset = root_mean_square(stiff) + root_mean_square(pressure - y)
    gaps = gap_error(factor * problem.kernel, held, offset, (1 - held) * (y - x), gap)
    unit, length = problem.unit, problem.length
    return Iterated(
        pressure=pressure * unit,
        gap=gap * (length / factor),
        mismatch=(x - y) * unit,
        displacement=(solid_gap + problem.heights) * length,
        error=error,
        gap_error=gaps * (length / factor),
        ended=ended,
        num_steps=state.drafted + state.steps,
        num_fft_pairs=state.all_pairs(1.0) + 3.5,
    )
