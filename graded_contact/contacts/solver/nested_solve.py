"""The fast solver: splitting on nested grids, and Newton steps where the splitting is slow.

    for each grid, from the coarsest to the finest:
        start     the pressure of the coarser grid (or springs), a draft in single precision
        epochs    the splitting (`splitting.py`); after 50, 100, 200, ... steps a new penalty
                  for the current contact area
        Newton    semismooth Newton steps (`semismooth_newton.py`), if the splitting would need
                  more than as many steps again; then the splitting confirms the contact

This is the only place where Python looks at values: outside `jit` Newton steps are compiled when
the first solve needs them.
"""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...core.checks import check_type, check_whole, is_concrete
from ...core.compilation import compiled, compiled_loop, varying
from ...fields.grid import interpolate, resample_spectrum, to_field, to_spectrum
from ..law import AbstractLaw, HardWall
from .abstract_solver import AbstractContactSolver, Loading, SolverOutput, participation, run_steps
from .active_set import most_eliminated
from .grid_problem import GridProblem, GridSettings, OneGrid, SolveState
from .semismooth_newton import newton_round, takes_newton_steps
from .splitting import RELAXATION, draft

# All within 2 % of the fewest FFT pairs of viscoelastic contacts.
_COARSENING = 4  # from grid to grid; 2 takes more pairs and compiles more programs
_COARSE_ERROR = 0.02  # tolerance on coarse grids, which only give a start
_EPOCH = 50  # steps before a new penalty; later epochs double the number of steps
_NEWTON_FROM = 1 / 16  # share of the points that a grid with Newton steps has at least
_NEWTON_UP_TO = 2**21  # points; on larger grids Newton steps need too much memory
_SMALL = 0.125  # share of points in contact along an axis, up to which Newton steps pay
_FEW = 100  # steps on coarse grids and in drafts, where Newton steps follow
_STEPS, _MOST = 4000, 64_000  # default `max_steps`, on grids of `_POINTS` and smaller ones
_POINTS = 2**16
_ATTRACTED = 0.5  # relaxation under an attraction; at 0.95 some soft bodies did not converge
_COLD_PARTICIPATION = 0.05  # ⟨σ⟩²/⟨σ²⟩ without a start

_NOTHING, _EPOCH_NEXT, _NEWTON_NEXT = 0, 1, 2  # next action on a grid


class DouglasRachford(AbstractContactSolver):
    """Settings of the splitting. All static.

    **Fields:**

    - `max_steps`: largest number of steps on each grid, and in single precision before those of a
      large one. Steps are done in pairs, and a Newton step counts by its FFT pairs. None for 4000;
      on grids of fewer than 2¹⁶ points for as many as cost the same, up to 64,000.
    - `coarsest`: nesting starts from the first grid with fewer than twice this many points a side.
    - `newton`: whether Newton steps follow where the splitting is slow. A program without them
      compiles in two thirds of the time.
    """

    max_steps: int | None = eqx.field(default=None, static=True)
    coarsest: int = eqx.field(default=64, static=True)
    newton: bool = eqx.field(default=True, static=True)
    finds_unstable: ClassVar[bool] = True

    def __check_init__(self):
        if self.max_steps is not None:
            check_whole("max_steps", self.max_steps, 1)
        check_whole("coarsest", self.coarsest, 4)
        check_type("newton", self.newton, bool)

    def solve(self, operator, heights, law, loading, *, rtol, start):
        """Returns the contact; `start` is a pressure [Pa] to begin from."""
        shapes = [heights.shape]
        # A coarse grid would pull surfaces together that stay separate on the fine one.
        if start is None and not law.attracts:
            while (points := min(shapes[0])) >= 2 * self.coarsest:
                factor = min(_COARSENING, points // self.coarsest)
                shapes.insert(0, tuple(-(-n // factor) for n in shapes[0]))
        rtol = rtol / law.softness if law.attracts else rtol
        coarse = _coarser(operator, heights, loading, shapes[:-1]) if shapes[:-1] else []
        before = start
        for grid in [*coarse, OneGrid(operator, heights, loading)]:
            settings = self._settings(grid.heights.shape, heights.shape, law, loading, rtol)
            # Python stops where Newton steps are needed, if it can see the state.
            looks = settings.newton and is_concrete(heights)
            numbers, state = _begin(grid, law, before, settings, looks)
            problem = GridProblem(grid, *numbers)
            if looks and int(state.next) == _NEWTON_NEXT:
                state = _alternate(problem, state, settings)
            before = problem, state
        return _output(problem, state)

    def _settings(self, shape, finest_shape, law: AbstractLaw, loading: Loading, rtol):
        points, share = int(np.prod(shape)), float(np.prod(shape) / np.prod(finest_shape))
        finest = shape == finest_shape
        hard = self.newton and takes_newton_steps(law) and loading.gap is None
        newton = hard and share >= _NEWTON_FROM and points <= _NEWTON_UP_TO
        most = self.max_steps or min(_STEPS * max(_POINTS // points, 1), _MOST)
        few = most if not hard or (finest and not newton) else min(_FEW, most)
        return GridSettings(
            share=share, newton=newton, draft_steps=few, max_steps=most if newton else few,
            relaxation=_ATTRACTED if law.attracts else RELAXATION,
            rtol=rtol if finest else jnp.asarray(rtol.dtype.type(_COARSE_ERROR)),
        )  # fmt: skip


@compiled
def _coarser(operator, heights, loading: Loading, shapes):
    """The inputs on coarser grids of these shapes."""
    shape, coarse = heights.shape, []
    spectrum = to_spectrum(heights - jnp.mean(heights))
    for level in shapes:
        share = float(np.prod(level) / np.prod(shape))
        rough = to_field(resample_spectrum(spectrum, shape, level) * share, level)

        def sample(a, level=level):  # a load that varies is interpolated
            if a is None or a.ndim == 0:
                return a
            return interpolate(a, tuple(map(min, a.shape, level)))

        less = Loading(*map(sample, loading))
        coarse.append(OneGrid(operator.coarser(shape, level), rough, less))
    return coarse


@compiled_loop
def _begin(grid: OneGrid, law, before, settings: GridSettings, looks: bool):
    """The fields of a problem but its grid, which XLA would copy, and the state of its solve.

    `before` is a pressure [Pa], what was found on the grid before, or None. With `looks` the solve
    stops where Newton steps are needed, otherwise at its end.
    """
    operator, rough, loading = grid
    share, unit = settings.share, operator.pressure_unit(rough - jnp.mean(rough), *loading)
    own = 0.5 * share if share < 1 else 0.0  # of the grid's heights
    guess, touching, pairs = None, 0.0, 0.5 + own if share < 1 else own
    if before is not None:
        if isinstance(before, tuple):
            coarse, last = before
            pairs = last.pairs + share * coarse.grid.heights.size / rough.size + own
            before = coarse.at_load(coarse.meet(last)[1]) * coarse.unit
        touching = jnp.mean(before > 0, dtype=rough.dtype)
        guess = grid.guess(law, unit, interpolate(before, rough.shape))
        pairs = pairs + share
    cold = jnp.asarray(_COLD_PARTICIPATION, rough.dtype)
    loaded = cold if guess is None else participation(guess)
    penalty = operator.penalty_for(loaded, law.steepest_rise)
    length = unit / penalty
    free_mean = loading.pressure is None
    mean = jnp.asarray(loading.gap if free_mean else loading.pressure)
    mean = mean / (length if free_mean else unit)
    numbers = unit, penalty, law.in_units(unit, length), mean
    problem = GridProblem(grid, *numbers)
    if guess is not None and takes_newton_steps(law) and not problem.free_mean:
        guess, taken = problem.full_contact_or(guess, touching)
        pairs = pairs + share * taken
    z = problem.start_of(guess)
    if problem.free_mean and isinstance(law, HardWall):
        z, taken = problem.closed_or(z)
        pairs = pairs + share * taken
    one, none, no = jnp.ones((), rough.dtype), jnp.asarray(0), jnp.asarray(False)
    state = SolveState(
        z=z, shift=problem.shift(one), factor=one,
        error=one * jnp.inf, converged=no, next=jnp.asarray(_EPOCH_NEXT), confirming=no,
        coat=0 * one, drafted=none, steps=none, newton_pairs=none, pairs=one * pairs,
    )  # fmt: skip
    splitting = problem.splitting(state, settings)
    z, drafted = draft(splitting, state.z, max_steps=settings.draft_steps)
    state = state._replace(z=z, drafted=drafted, pairs=state.pairs + share * drafted)
    if settings.newton and not looks:
        return numbers, _alternate(problem, state, settings)
    return numbers, _epochs(problem, state, settings)


def _epochs(problem: GridProblem, state: SolveState, settings: GridSettings) -> SolveState:
    """Iterates; if that takes long, again with another penalty, or until Newton steps help."""
    share = settings.share

    def epoch(state: SolveState) -> SolveState:
        limit = jnp.where(state.confirming, 0, state.steps)
        limit = jnp.clip(limit, _EPOCH, settings.max_steps - state.steps)
        last = run_steps(problem.splitting(state, settings), state.z, limit)
        steps = state.steps + last.num_steps
        more = last.running & (steps + state.newton_pairs < settings.max_steps)
        state = state._replace(
            z=last.z, error=last.error, converged=~last.running, steps=steps,
            next=jnp.where(more, _EPOCH_NEXT, _NOTHING),
            pairs=state.pairs + share * (last.num_steps + 1),
        )  # fmt: skip
        return jax.lax.cond(more, begin_again, lambda same: same, state)

    def begin_again(state: SolveState) -> SolveState:
        """The same pressures and gaps with the penalty for the current area in contact."""
        _, y, gap = problem.meet(state)
        solid, law = problem.solid_at(state.factor).scaled, problem.law_at(state.factor)
        change = solid.penalty_for(participation(y), law.steepest_rise)
        factor = state.factor * change
        z, shift, pairs = y + change * gap, problem.shift(factor), state.pairs + share
        state = state._replace(z=z, shift=shift, factor=factor, pairs=pairs)
        if not settings.newton:
            return state
        # At its present rate the splitting needs more than as many steps again; few points are
        # found at once.
        few = jnp.sum(y > 0) <= most_eliminated(problem.grid.operator, y)
        slow = state.confirming | few | (state.error > jnp.sqrt(settings.rtol))
        slow &= jnp.mean(y > 0, dtype=y.dtype) < _SMALL**y.ndim
        return state._replace(next=jnp.where(slow, _NEWTON_NEXT, _EPOCH_NEXT))

    return jax.lax.while_loop(lambda state: state.next == _EPOCH_NEXT, epoch, varying(state))


@compiled_loop
def _alternate(problem: GridProblem, state: SolveState, settings: GridSettings) -> SolveState:
    """Iterates to the end, with Newton steps where the splitting is slow."""

    def newton(state: SolveState) -> SolveState:
        solid = problem.solid_at(state.factor)
        slow = state.next == _NEWTON_NEXT
        # They may take as many pairs as the splitting took so far. Under `vmap` members that are
        # not slow come here too.
        budget = jnp.where(slow, state.steps, 0)
        heights, x = problem.scaled_heights(state.factor), state.shift + solid.resolve(state.z)
        z, coat, pairs, confirming = newton_round(
            solid.scaled, heights, problem.mean, state.z, x, state.coat,
            allowed=problem.law.proximal(jnp.ones_like(state.z)) > 0,
            rtol=settings.rtol, budget=budget,
        )  # fmt: skip
        return state._replace(
            z=z, coat=coat, confirming=confirming, next=jnp.where(slow, _EPOCH_NEXT, _NOTHING),
            newton_pairs=state.newton_pairs + pairs + 2,
            pairs=state.pairs + settings.share * (pairs + 2),
        )  # fmt: skip

    def turn(state: SolveState) -> SolveState:
        state = jax.lax.cond(state.next == _NEWTON_NEXT, newton, lambda same: same, state)
        return _epochs(problem, state, settings)

    return jax.lax.while_loop(lambda state: state.next != _NOTHING, turn, varying(state))


@compiled
def _output(problem: GridProblem, state: SolveState) -> SolverOutput:
    """The contact where a solve ended on the finest grid."""
    factor = state.factor
    x, y, gap = problem.meet(state)
    # The displacement has the stiff waves of the law's pressure and the soft ones of the
    # solid's: each would magnify what is left of the error in the others.
    pressure = problem.at_load(y)
    stiff = problem.solid_at(factor).resolve(pressure - x)
    solid_gap = (state.z - x + (pressure - x) - stiff) / factor
    unit, length = problem.unit, problem.length
    without_mean = problem.scaled_heights() - (problem.mean if problem.free_mean else 0)
    return SolverOutput(
        pressure=pressure * unit, gap=gap * (length / factor),
        displacement=(solid_gap + without_mean) * length, error=state.error,
        ended=state.converged, num_steps=state.drafted + state.steps,
        num_fft_pairs=state.pairs + 3,
    )  # fmt: skip
