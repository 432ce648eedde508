"""The fast solver: the splitting of `splitting.py` on nested grids, and its second gear.

Coarse grids find a start for finer ones. A solve that takes long begins again with the penalty that
suits the area found in contact. Where on the finest grid more than as many steps again are to come,
Newton steps (`newton_steps.py`) may take as many FFT pairs as the splitting took so far.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from .._checks import check_whole
from ..grid import interpolate, resample_spectrum, to_field, to_spectrum
from .law import AbstractLaw
from .linear import LinearSplitting
from .newton_steps import newton_round, takes_newton_steps
from .on_grid import OnGrid, as_guess, on_grid, start_of
from .solver import (
    AbstractContactSolver,
    Iterated,
    LinearSolver,
    Prescribed,
    participation,
    penalty_for,
    pressure_unit,
    root_mean_square,
    slope,
    to_mean,
    watch_of,
)
from .splitting import (
    CYCLE,
    check_relaxation,
    draft,
    gap_error,
    iterate,
    rounding_error,
)

# All within 2 % of the fewest FFT pairs of `bench_contact.py viscoelastic`.
_COARSE_ERROR = 0.02  # of the nested coarse grids, which only give a start
_EPOCH = 50  # steps before the penalty is chosen anew; then as many as were done
_GEARED_FROM = 0.25  # of the points: grids that Newton steps are for
_SMALL = 0.125  # share along an axis of points in contact, up to which Newton steps pay
_GEARED_UP_TO = 2**21  # points: they take more memory than is planned for larger ones
_FEW = 100  # steps on coarse grids and in drafts, where Newton steps follow
_STEPS, _MOST, _POINTS = 4000, 64_000, 2**16  # steps allowed on a grid of so many points


class DouglasRachford(AbstractContactSolver):
    """Settings of the splitting. All static, but for `linear`.

    **Fields:**

    - `max_steps`: steps allowed on each grid before giving up, and in the draft of a large one;
      they are done in twos, and a Newton step counts by its FFT pairs. None for 4000, on grids of
      fewer than 2¹⁶ points for as many as cost the same, up to 64,000.
    - `relaxation`: α [1], between 0 and 1.
    - `memory`: earlier iterates that the acceleration combines; each stores two fields, on a large
      grid three quarters of one.
    - `coarsest`: nesting starts from the first grid with fewer than twice this many points a side.
    - `linear`: finds derivatives, see `AbstractContactSolver`.
    - `keep`: called with the pressure [Pa] on the finest grid now and then while a solve goes on.
    """

    max_steps: int | None = eqx.field(default=None, static=True)
    relaxation: float = eqx.field(default=0.95, static=True)
    memory: int = eqx.field(default=5, static=True)
    coarsest: int = eqx.field(default=64, static=True)
    linear: LinearSolver = LinearSplitting()
    keep: Callable[[Array], None] | None = None
    finds_unstable: ClassVar[bool] = True

    def __check_init__(self):
        if self.max_steps is not None:
            check_whole("max_steps", self.max_steps, 1)
        check_whole("memory", self.memory, 1)
        check_whole("coarsest", self.coarsest, 4)
        check_relaxation(self.relaxation)

    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        heights: Float[Array, "*shape"],
        law: AbstractLaw,
        prescribed: Prescribed,
        *,
        rtol: Float[Array, ""],
        start: Float[Array, "*shape"] | None,
    ) -> Iterated:
        """Returns the contact; `start` is a pressure [Pa] to begin from."""
        shape = heights.shape
        # A coarse grid would pull surfaces together that on the fine one stay apart.
        nested = start is None and not law.attracts
        shapes = _nested_shapes(shape, self.coarsest) if nested else [shape]
        heights = heights - jnp.mean(heights)
        spectrum = to_spectrum(heights)
        found, pressure = None, start
        pairs = jnp.asarray(0.5, heights.dtype)
        for level in shapes:
            share = float(np.prod(level) / np.prod(shape))
            finest = level == shape
            waves = spectrum if finest else resample_spectrum(spectrum, shape, level) * share
            near = resample_spectrum(kernel, shape, level)
            rough = heights if finest else to_field(waves, level)
            unit = pressure_unit(near, rough, prescribed)
            guess = None
            if pressure is not None:
                guess = as_guess(near, law, prescribed, unit, interpolate(pressure, level))
            found = self._solve_on(
                on_grid(near, rough, waves, law, prescribed, unit, guess),
                guess,
                rtol if finest else jnp.asarray(_COARSE_ERROR, rtol.dtype),
                finest,
                share >= _GEARED_FROM,
            )
            pressure = found.pressure
            pairs = pairs + share * (found.num_fft_pairs + (0 if finest else 0.5))
        assert found is not None  # there is at least one grid
        return dataclasses.replace(found, num_fft_pairs=pairs)

    def _solve_on(self, problem: OnGrid, guess, rtol, finest: bool, geared: bool) -> Iterated:
        """Solves on one grid, from a pressure or from none."""
        how: dict[str, Any] = dict(rtol=rtol, relaxation=self.relaxation, memory=self.memory)
        how["watch"] = watch_of(self.keep if finest else None, problem.unit)
        helped = takes_newton_steps(problem.law) and not problem.free_mean
        geared = geared and helped and problem.heights.size <= _GEARED_UP_TO
        alone = not helped or (finest and not geared)
        most = self.max_steps or _steps_of(problem.heights.size)
        few = most if alone else min(_FEW, most)
        z = start_of(problem, guess)
        z, drafted = draft(problem.splitting(1.0), z, max_steps=few, **how)
        last = _epochs(problem, z, how, most if geared else few, geared)
        found = _found(problem, last.z, last.factor, last.error, ~last.going_on, rtol)
        # A guess takes one pair, and a draft half a one beside its steps. An epoch takes one half,
        # beginning again 1.5, what is found 3.5.
        begun = (0.0 if guess is None else 1.0) + jnp.where(drafted > 0, drafted + 0.5, 0.0)
        pairs = (begun + last.steps + last.newton_pairs + 2.0 * last.epochs + 2).astype(z.dtype)
        return dataclasses.replace(found, num_steps=drafted + last.steps, num_fft_pairs=pairs)


class _Progress(NamedTuple):
    """Where a solve stands on one grid: `factor` is the penalty over the first."""

    z: Array
    factor: Array
    steps: Array
    epochs: Array
    error: Array
    going_on: Array
    newton_pairs: Array
    coat: Array
    settled: Array  # whether Newton steps found a contact, that the splitting is to confirm


def _epochs(problem: OnGrid, z, how, most: int, geared: bool) -> _Progress:
    """Iterates from z, again and again with another penalty if it takes long."""

    def begin_again(state):
        """The same pressures and gaps with the penalty for the area in contact by now."""
        solid, near = problem.at(state.factor)
        _, y, gap = _meet(solid, near, state.z)
        change = penalty_for(state.factor * problem.kernel, participation(y), near)
        state = state._replace(z=y + change * gap, factor=state.factor * change)
        if not geared:
            return state
        # At its pace so far the splitting needs more than as many steps again.
        slow = state.settled | (state.error > jnp.sqrt(how["rtol"]))
        slow &= jnp.mean(y > 0, dtype=y.dtype) < _SMALL**y.ndim
        return jax.lax.cond(slow, shift_gear, lambda state, _: state, state, slow)

    def shift_gear(state, slow):
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
            budget=jnp.where(slow, state.steps, 0),
        )
        pairs = state.newton_pairs + pairs + 1
        return state._replace(z=z, coat=coat, newton_pairs=pairs, settled=settled)

    def epoch(state):
        state = jax.lax.cond(state.epochs > 0, begin_again, lambda same: same, state)
        limit = jnp.clip(jnp.where(state.settled, 0, state.steps), _EPOCH, most - state.steps)
        last = iterate(problem.splitting(state.factor), state.z, max_steps=limit, **how)
        return state._replace(
            z=last.z,
            steps=state.steps + last.cycles * CYCLE,
            epochs=state.epochs + 1,
            error=last.error,
            going_on=last.going_on,
        )

    def running(state):
        return state.going_on & (state.steps + state.newton_pairs < most)

    one, none, no = jnp.ones((), z.dtype), jnp.asarray(0), jnp.asarray(False)
    start = _Progress(z, one, none, none, one * jnp.inf, ~no, none, 0 * one, no)
    return jax.lax.while_loop(running, epoch, start)


def _meet(solid: Callable, law: AbstractLaw, z):
    """The pressures of solid and law, x and y, and the gap at which the law has the latter."""
    x = solid(z)
    v = 2 * x - z
    y = law.proximal(v)
    return x, y, y - v


def _found(problem: OnGrid, z, factor, error, ended, rtol) -> Iterated:
    """The contact of z at this penalty over the first, but for what it cost."""
    solid, law = problem.at(factor)
    x, y, gap = _meet(solid, law, z)
    # Where rounding ended the solve, the residual is noise, most of it out of contact.
    error = jax.lax.cond(
        ended & (error > rtol),
        lambda: jnp.minimum(error, rounding_error(solid, law, x, y, gap)),
        lambda: error,
    )
    pressure = y if problem.free_mean else to_mean(y, problem.target, problem.law.bounds)
    # The displacement has the stiff waves of the law's pressure and the soft ones of the
    # solid's: each would magnify what is left of the error in the others.
    stiff = to_field(solid.filter * to_spectrum(pressure - x), x.shape)
    solid_gap = (z - x + (pressure - x) - stiff) / factor
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
        num_steps=jnp.asarray(0),
        num_fft_pairs=jnp.zeros((), z.dtype),
    )


def _nested_shapes(shape: tuple[int, ...], coarsest: int) -> list[tuple[int, ...]]:
    shapes = [shape]
    while min(shapes[0]) >= 2 * coarsest:
        shapes.insert(0, tuple(-(-n // 2) for n in shapes[0]))
    return shapes


def _steps_of(points: int) -> int:
    return min(_STEPS * max(_POINTS // points, 1), _MOST)
