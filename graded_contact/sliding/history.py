"""A rough rigid surface in a motion that happens once: start, dwell, braking, steps of the load.

Before t = 0 nothing touches. The times cut the history into steps, in each of which the pressure
grows linearly. In the frame of the block a wave of the pressure leaves the displacement

    u_n = I(Δ)/Δ p_n + [J(Δ) - I(Δ)/Δ] p_(n-1) + Re Σ_k w_k M(s_k) exp(s_k Δ) y_k

at the end of a step Δ (`blocks/creep.py`): the first term has a real and positive kernel, the
others are known. So each step is one ordinary contact of the heights less what is known, in the
frame of the surface, started from the pressure before:

    y, p, s(t) ──> displacement that is known ──> contact ──> p ──> y        (one scan)

A derivative is that of the contact of each step. It keeps the contacts, and computes the memory
once more from every √n-th step on.
"""

import dataclasses
import functools
import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.ad_checkpoint import checkpoint_name
from jaxtyping import Array, Complex

from ..blocks.creep import NODES, creep_of
from ..contacts.abstract_solver import Inputs, Loading
from ..contacts.inputs import loading_of
from ..contacts.law import check_one_law
from ..contacts.nested_solve import DouglasRachford
from ..contacts.operator import Field, nonzero, work_of_waves
from ..contacts.solution import RESULTS, ContactSolution
from ..contacts.solve import contact_of
from ..core.checks import check_squares, is_concrete
from ..core.compilation import jit
from ..core.derivative import largest
from ..core.memory import check_memory
from ..fields.devices import required
from ..fields.grid import Grid, odd_wavevector, to_field, to_spectrum
from ..materials.coverage import coverage
from .area import contact_area, contact_area_pixels
from .case import Case
from .facts import facts_of
from .formulas import edges_of, indicator_of, lengths, slopes
from .grid_errors import UNSEEN_AREA, unseen_area
from .history_problem import BlockWaves, HistoryProblem, OneStep, steps_of
from .numerics import Numerics
from .problem import SteadyProblem
from .resolution import NEIGHBOURS_RTOL
from .result import Sliding, TransientSliding
from .shear import is_coupled, shear_over_load, shear_stress, unless_negative


class HistoryState(NamedTuple):
    """What a history carries from step to step.

    The memory of the nodes, real and imaginary parts for those of the waves; waves of pressure and
    displacement in the block; the pressure; traction; works; the kept fields; the first failure.
    """

    memory: tuple[Array, Array]
    old: Array
    before: Array
    moved: Array
    pressure: Array
    rise: Array
    traction: Array
    works: Array
    kept: Any
    result: RESULTS
    failed: Array


class _Step(NamedTuple):
    """What a step is given."""

    length: Array
    shift: Array  # s [m], along each component
    way: Array  # how far the surface moves [m]
    given: Array
    now: Array  # tables of `Creep`
    whole: Array
    aged: Array
    decay: Array  # exp(s_k Δ)
    from_old: Array  # of the step before
    from_new: Array
    slot: Array  # where its fields are kept
    index: Array
    counts: Array  # False for a step that only fills up the last segment


class Advance(eqx.Module):
    """What does not change from step to step: `init`, and `step` for `lax.scan`."""

    problem: HistoryProblem
    waves: BlockWaves
    how: Numerics

    def init(self, kept: int) -> HistoryState:
        """Returns the state before t = 0, with room for the fields of so many steps."""
        problem = self.problem
        dtype, memory = problem.heights.dtype, self.waves.memory
        rest = jnp.zeros_like(memory[0])
        nodes = jnp.zeros((len(memory), 2, *rest.shape), dtype)
        field = jnp.zeros(problem.shape, dtype)
        return HistoryState(
            memory=(nodes, nodes), old=rest, before=rest, moved=rest, pressure=field, rise=field,
            traction=jnp.zeros(problem.moved.shape[1], dtype), works=jnp.zeros(3, dtype),
            kept=tuple(jnp.zeros((kept, *problem.shape), dtype) for _ in range(4)),
            result=RESULTS.successful, failed=jnp.asarray(-1),
        )  # fmt: skip

    def step(self, state: HistoryState, given: _Step) -> tuple[HistoryState, dict[str, Array]]:
        """Returns the state at the end of a step, and its numbers."""
        problem, waves = self.problem, self.waves
        turn = waves.turn(given.shift)
        operator, known, memory = self._known(state, given)
        now = operator.kernel
        known_field = to_field(waves.joined(known * turn), problem.shape)
        heights = problem.heights - known_field
        loading = (given.given, None) if problem.prescribed == "pressure" else (None, given.given)
        inputs = Inputs(operator, heights, problem.law, Loading(*loading))
        contact = contact_of(
            inputs, self.how.solver, self.how.adjoint, self.how.rtol,
            jax.lax.stop_gradient(jnp.maximum(state.pressure + given.length * state.rise, 0)), None, False,
        )  # fmt: skip
        contact = jax.tree.map(lambda leaf: checkpoint_name(leaf, _CONTACT), contact)
        spectrum = to_spectrum(contact.pressure)
        pressed = waves.split(spectrum) * jnp.conj(turn)
        moved = known + waves.split(now * spectrum) * jnp.conj(turn)
        displacement = contact.displacement + known_field
        one = Sliding(contact, SteadyProblem(
            operator=operator, heights=heights, grid=problem.grid, law=problem.law,
            velocity=jnp.ones((), heights.dtype), prescribed=problem.prescribed,
        ))  # fmt: skip
        traction, numbers = self._numbers(one, displacement, given)
        work = waves.mean_product(pressed + state.old, moved - state.moved) / 2
        by_slopes = jnp.sum((traction + state.traction) / 2 * given.way)
        by_shear = jnp.sum(numbers["shear_traction"] * given.way)
        works = state.works + jnp.stack([by_slopes + by_shear, work - by_slopes, by_shear])
        names = ("work_done", "load_work_done", "shear_work_done")
        numbers |= dict(zip(names, works, strict=True))
        fields = contact.pressure, contact.gap, displacement, contact.correction
        good = state.result == RESULTS.successful
        return HistoryState(
            memory=memory, old=pressed, before=state.old, moved=moved, pressure=contact.pressure, rise=jax.lax.stop_gradient(jnp.where(given.index>0, (contact.pressure-state.pressure)/given.length,0)),
            traction=traction, works=works,
            kept=tuple(k.at[given.slot].set(f, mode="drop") for k, f in zip(state.kept, fields, strict=True)),
            result=RESULTS.where(good, contact.result, state.result),
            failed=jnp.where(good & (contact.result != RESULTS.successful), given.index, state.failed),
        ), numbers  # fmt: skip

    def _known(self, state: HistoryState, given: _Step):
        """The block in the step, the waves that earlier pressures leave, and the new memory."""
        parts = lambda wave: jnp.stack([wave.real, wave.imag])  # noqa: E731
        old, new, waves = parts(state.before), parts(state.old), self.waves

        def add(total, node):
            real, imag, decay, before, last, weight = node
            real = real + before.real * old + last.real * new
            imag = imag + before.imag * old + last.imag * new
            real, imag = (
                decay.real * real - decay.imag * imag,
                decay.real * imag + decay.imag * real,
            )
            return total + weight.real * real - weight.imag * imag, (real, imag)

        factors = given.decay, given.from_old, given.from_new, waves.memory
        total, memory = jax.lax.scan(add, jnp.zeros_like(old), (*state.memory, *factors))
        now, whole, aged = waves.kernel(jnp.stack([given.now, given.whole, given.aged]))
        known = jax.lax.complex(*total) + waves.split(whole - now) * state.old
        return OneStep(now, aged), known, memory

    def _numbers(self, one: Sliding, displacement: Field, given: _Step):
        """The traction by slopes [Pa], and the numbers of the contact of a step."""
        problem, contact, pressure = self.problem, one.contact, one.contact.pressure
        axes = odd_wavevector(problem.grid)[: len(given.way)]
        traction = jnp.stack([jnp.sum(work_of_waves(pressure, displacement, q)) for q in axes])
        load, sheared = jnp.mean(pressure), jnp.zeros_like(traction)
        if problem.shear is not None:
            far = jnp.sqrt(jnp.sum(given.way**2))
            moves = far > 0
            unit = jnp.where(moves, given.way / jnp.where(moves, far, 1), 0)
            speed = jnp.where(moves, far, 1) / given.length
            stress = dataclasses.replace(problem.shear, speed=speed)
            size = shear_over_load(pressure, indicator_of(one), edges_of(one), stress)
            sheared = unit * jnp.where(load > 0, size * load, 0)
        return traction, dict(
            traction=traction + sheared, shear_traction=sheared, load=load,
            contact_area=contact_area(one), contact_area_pixels=contact_area_pixels(one),
            mean_gap=contact.mean_gap, slope=slopes(one, pressure, displacement),
            spread=jnp.sqrt(jnp.mean(pressure**2)),
        ) | {UNSEEN_AREA: unseen_area(one)} | {f"step_{name}": getattr(contact, name) for name in _OF_STEPS}  # fmt: skip


MEMORY = 4 * NODES + 30  # fields
_CONTACT = "contact"  # what a derivative keeps of each step
_OF_STEPS = (
    "error", "gap_error", "load_error", "complementarity_error", "penetration", "num_steps",
    "num_fft_pairs",
)  # fmt: skip


def run_history(
    problem: HistoryProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[HistoryState, dict[str, Array]]:
    """Returns the state after the last step, and the numbers of all steps."""
    # The program is that of all blocks.
    return _run(dataclasses.replace(problem, stack=None, measured_range=None), how, kept)


@jit
def _run(
    problem: HistoryProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[HistoryState, dict[str, Array]]:
    advance, count = Advance(problem, BlockWaves(problem.grid, problem.creep), how), len(problem.times)
    steps = _steps(problem, kept)
    # Segments of about √n steps, each computed once more in a derivative in reverse.
    length = math.ceil(math.sqrt(count))
    segments = -(-count // length)
    rows = jnp.minimum(jnp.arange(segments * length), count - 1)
    filled = jax.tree.map(lambda leaf: leaf[rows].reshape(segments, length, *leaf.shape[1:]), steps)
    counts = (jnp.arange(segments * length) < count).reshape(segments, length)
    filled = filled._replace(counts=counts)

    def one(state, given):
        like = jax.eval_shape(advance.step, state, given)[1]
        stay = lambda: (state, jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), like))  # noqa: E731
        return jax.lax.cond(given.counts, lambda: advance.step(state, given), stay)

    policy = jax.checkpoint_policies.save_only_these_names(_CONTACT)
    segment = jax.checkpoint(lambda state, given: jax.lax.scan(one, state, given), policy=policy)
    state, numbers = jax.lax.scan(segment, advance.init(len(kept)), filled)
    numbers = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[:count], numbers)
    return state, _of_whole(problem, numbers)


def _of_whole(problem: HistoryProblem, numbers: dict[str, Array]) -> dict[str, Array]:
    """The numbers of all steps, with those over the load and those of the whole."""
    load = numbers["load"]
    over = lambda traction: (
        jnp.where(load > 0, traction.T / jnp.where(load > 0, load, 1), jnp.nan).T
    )  # noqa: E731
    shape, way = problem.displacement.shape, lengths(problem.steps[1])
    friction, path = over(numbers["traction"]), jnp.sum(load * way)
    return numbers | dict(
        traction=numbers["traction"].reshape(shape), friction=friction.reshape(shape),
        shear_friction=over(numbers["shear_traction"]).reshape(shape),
        mean_friction=numbers["work_done"][-1] / nonzero(path),
        peak_friction=largest(jnp.where(load > 0, lengths(friction), 0)),
        slope_in_contact=largest(numbers["slope"]),
    )  # fmt: skip


def _steps(problem: HistoryProblem, kept: tuple[int, ...]) -> _Step:
    """What each step is given."""
    creep, count = problem.creep, len(problem.times)
    lengths, way = problem.steps
    z = creep.nodes * lengths[:, None]
    twice = _rest_of_exponential(z)
    once = 1 + z * twice  # (exp(z) - 1)/z
    before = lambda row: jnp.concatenate([jnp.zeros_like(row[:1]), row[:-1]])  # noqa: E731
    slots = np.full(count, len(kept))
    slots[list(kept)] = np.arange(len(kept))
    return _Step(
        length=lengths, shift=problem.moved, way=way, given=problem.given, now=creep.now,
        whole=creep.whole, aged=creep.aged, decay=jnp.exp(z), from_old=before(lengths[:, None] * (once - twice)),
        from_new=before(lengths[:, None] * twice), slot=jnp.asarray(slots),
        index=jnp.arange(count), counts=jnp.ones(count, bool),
    )  # fmt: skip


def _rest_of_exponential(z: Complex[Array, "..."]) -> Complex[Array, "..."]:
    """(exp(z) - 1 - z)/z², of small z by its series."""
    small = jnp.abs(z) < 1
    near, far = jnp.where(small, z, 0), jnp.where(small, 1, z)
    series = (
        functools.reduce(lambda rest, k: rest * near / (k + 2) + 1, range(18, 0, -1), 1 + 0 * near)
        / 2
    )
    return jnp.where(small, series, (jnp.exp(far) - 1 - far) / far**2)


def history_problem(case: Case) -> HistoryProblem:
    """Returns the problem of a case with displacements at times."""
    surface, times = case.rough, case.times
    if not surface.periodic:
        raise ValueError(
            "`surface` is on a window (`periodic=False`) and is refused in a history: the memory "
            "of the block holds the waves of a cell, where the copies of a window's load would "
            "act, too. Put the body into a periodic cell several times as large as the contact."
        )
    check_one_law(case.law)
    check_squares("heights", surface.heights, "m")
    grid, count, load = (
        surface.grid,
        len(times),
        dict(pressure=case.pressure, mean_gap=case.mean_gap),
    )
    check_memory("surface", "a history", MEMORY, grid.shape, surface.heights.dtype.itemsize)
    loading = loading_of(case.law, surface.heights[None], count, **load)
    given = next(value for value in loading if value is not None).reshape(count)
    if is_coupled(case.shear):
        raise ValueError(
            "`shear` is refused: in a history the traction of a law cannot move the surface of the "
            "block, whose memory is that of pressures alone. Pass `coupled=False`."
        )
    lowest = 2 * np.pi / jnp.max(grid.size)
    highest = np.pi * jnp.sqrt(jnp.sum((np.array(grid.shape) / grid.size) ** 2))
    creep = creep_of(case.stack, jnp.stack([lowest, highest]), steps_of(times))
    stress = shear_stress(case.shear, jnp.ones((), surface.heights.dtype), case.temperature)
    return HistoryProblem(
        stack=case.stack, creep=creep, heights=surface.heights, grid=grid, law=case.law, times=times,
        displacement=case.displacement, given=unless_negative(given, stress), shear=stress,
        prescribed=case.prescribed, measured_range=coverage(case.stack), facts=facts_of(case),
    )  # fmt: skip


def on_grid(
    found: TransientSliding, shape: tuple[int, ...], heights: Field, chosen: np.ndarray
) -> TransientSliding:
    """Returns the history of other heights on a grid of the cell, in fewer steps.

    `chosen` are the numbers of the steps whose ends stay.
    """
    problem = found.problem
    creep, times = problem.creep, problem.times[chosen]
    if len(chosen) < len(problem.times):
        creep = creep_of(problem.stack, jnp.exp(creep.log_q), steps_of(times))
    problem = dataclasses.replace(
        problem, creep=creep, heights=heights, grid=Grid(shape, problem.grid.size), times=times,
        displacement=problem.displacement[chosen], given=problem.given[chosen],
    )  # fmt: skip
    solver = DouglasRachford(newton=is_concrete(problem.given))
    how = Numerics(rtol=NEIGHBOURS_RTOL, solver=solver, throw=False)
    kept = (len(chosen) - 1,)
    return history_of(problem, *run_history(problem, how, kept), kept)


def solve_history(
    case: Case, how: Numerics, fields_at: tuple[int, ...] = (-1,)
) -> TransientSliding:
    """Returns the contact of a case with displacements at times; see `slide_history`."""
    count = len(case.times)
    kept = tuple(int(i) % count for i in fields_at)
    problem = history_problem(case)
    state, numbers = run_history(problem, how, kept)
    found = history_of(problem, state, numbers, kept)
    if not how.throw:
        return found
    if is_concrete(found.failed) and np.ndim(found.failed) == 0 and found.failed >= 0:
        step = int(found.failed)
        raise RuntimeError(
            f"Step {step + 1} of {count}, which ends at {float(case.times[step]):.4g} s, failed: "
            f"{RESULTS[found.result]} With `throw=False` the numbers before it are returned."
        )
    good = found.failed < 0
    return dataclasses.replace(
        found, recorded=required(found.recorded, good, found.result.error_if),
        contact=required(found.contact, good, found.result.error_if),
    )  # fmt: skip


def history_of(problem, state: HistoryState, numbers, kept) -> TransientSliding:
    """Returns the result of the numbers and the state of a history."""
    pressure, gap, displacement, correction = state.kept
    over = tuple(range(1, pressure.ndim))
    contact = ContactSolution(
        pressure=pressure, gap=gap, displacement=displacement, correction=correction,
        mean_pressure=jnp.mean(pressure), mean_gap=jnp.mean(gap, axis=over),
        result=state.result, **{
            name: (jnp.sum if name.startswith("num_") else jnp.max)(numbers[f"step_{name}"])
            for name in _OF_STEPS
        },
    )  # fmt: skip
    return TransientSliding(contact, problem, numbers, state.failed, kept)
