"""Transient motion: the problem of a case with times, and its solve, also on other grids.

The steps follow one another in segments of about √n. A derivative differentiates the contact of
each step. It keeps the contacts, and computes the memory once more from the first step of each
segment on.
"""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array

from ...contacts.inputs import check_gap, loading_of
from ...contacts.operators.operator import Field, nonzero
from ...contacts.solution import ContactSolution
from ...contacts.solver.nested_solve import DouglasRachford
from ...core.checks import is_concrete, within
from ...core.compilation import compiled, compiled_loop, varying
from ...core.derivative import largest, still
from ...core.memory import check_memory
from ...fields.grid import Grid
from ...kernels.creep import creep_of, node_count
from ...materials.coverage import coverage
from ..case import COUPLED, GROUND, Case, Numerics, facts_of
from ..errors.neighbours import NEIGHBOURS_RTOL
from ..formulas import lengths
from ..motion.motion import components
from ..number import Found
from ..shear import is_coupled, shear_stress
from ..transient_problem import TransientProblem, steps_of
from .step_inputs import steps_given
from .steps import OF_STEPS, STEP_CONTACT, Advance
from .waves import TransientWaves

_FIELDS = 4, 30  # of a body: for each node of its memory, and beside them
_WINDOW = 1.4  # times these on a window, for the responses of its table


def transient_problem(case: Case) -> TransientProblem:
    """Returns the problem of a case with displacements at times."""
    surface, times = case.surface, case.times
    grid, count = surface.grid, len(times)
    facts = facts_of(case)
    path = None if surface.periodic else _path_of(case)
    stress = shear_stress(case.shear, jnp.ones((), surface.heights.dtype), case.temperature)
    load = check_gap(not surface.periodic, GROUND in facts, **case.load)
    loading = loading_of(case.law, surface.heights[None], count, **load)
    given = next(value for value in loading if value is not None)
    given = jnp.broadcast_to(given.ravel(), count)
    if case.approach is not None:  # by the lowest place, which half the grid lacks
        given = given + jnp.mean(surface.heights)
    problem = TransientProblem(  # pyright: ignore[reportCallIssue] (`operator` is a property)
        bodies=case.bodies, creeps=(), heights=surface.heights, grid=grid, law=case.law,
        times=times, displacement=case.displacement, given=given,
        shear=stress, prescribed=case.prescribed, facts=facts, path=path,
        measured_ranges=tuple(map(coverage, case.bodies)),
        block_heights=None if case.block_surface is None else case.block_surface.heights,
    )  # fmt: skip
    forces = 1 + components(case.displacement).shape[1] if is_coupled(case.shear) else 1
    of_node, others = _FIELDS
    of_body = of_node * node_count(steps_of(times)) + others
    fields = of_body * forces * len(case.bodies) * (1 if path is None else _WINDOW)
    shape, itemsize = problem.memory_grid.shape, surface.heights.dtype.itemsize
    check_memory("surface", "a transient solve", fields, shape, itemsize)
    return _with_creeps(problem)


def _path_of(case: Case) -> tuple[int, ...]:
    """The points of the part of the block over which the window of a case moves."""
    # Inside of a program what is known stays known only if nothing of JAX's touches it.
    moved, size = (
        given if is_concrete(given) else still(given)
        for given in (case.displacement, case.surface.grid.size)
    )
    if not (is_concrete(moved) and is_concrete(size)):
        raise ValueError(
            "`displacement` must be known on a window, outside of `jit` and `vmap`: the bodies "
            "remember all of its path. Derivatives are allowed."
        )
    path = np.array(case.surface.grid.shape)
    steps = np.asarray(size) / path
    for axis, column in enumerate(np.asarray(moved).reshape(len(moved), -1).T):
        far = math.ceil(np.ptp([0, *column]) / steps[axis] - 1e-6)
        path[axis] = scipy.fft.next_fast_len(int(path[axis]) + far) if far else path[axis]
    return tuple(path.tolist())


def _with_creeps(problem: TransientProblem) -> TransientProblem:
    """The problem with the memories of its bodies."""
    creeps, coupled = [], COUPLED in problem.facts
    for name, body in zip(("`stack`:", "`counterface`:"), problem.bodies, strict=False):
        with within(name):
            creeps.append(creep_of(body, problem.waves_between, steps_of(problem.times), coupled))
    return dataclasses.replace(problem, creeps=tuple(creeps))


def on_grid(
    found: Found,
    shape: tuple[int, ...],
    rough: tuple[Field, ...],
    chosen: tuple[int, ...] | None = None,
) -> Found:
    """Returns the transient solve of other heights on a grid of the cell, in all or fewer steps.

    `chosen` are the numbers of the steps whose ends stay.
    """
    problem, (heights, *own) = found.problem, rough
    path = problem.path
    if path is not None:
        points = zip(path, shape, problem.shape, strict=True)
        path = tuple(-(-n * new // old) for n, new, old in points)
    problem = dataclasses.replace(
        problem, heights=heights, block_heights=own[0] if own else None, path=path,
        grid=Grid(shape, problem.grid.size),
    )  # fmt: skip
    kept = found.kept_steps
    if chosen is not None:
        kept = (len(chosen) - 1,)
        of_steps = {name: getattr(problem, name) for name in ("times", "displacement", "given")}
        problem = dataclasses.replace(problem, **_at(of_steps, chosen))
    if path is not None or chosen is not None:
        problem = _with_creeps(problem)
    # Newton steps, which take long to compile, are not needed: each step starts close to its end.
    how = Numerics(rtol=NEIGHBOURS_RTOL, solver=DouglasRachford(newton=False), throw=False)
    return dataclasses.replace(found, **solved(problem, how, kept))


@compiled
def _at(of_steps: dict[str, Array], chosen: tuple[int, ...]) -> dict[str, Array]:
    return {name: of_each[np.array(chosen)] for name, of_each in of_steps.items()}


def solved(problem: TransientProblem, how: Numerics, kept: tuple[int, ...]) -> dict[str, Any]:
    """Returns the fields of the result of a transient solve."""
    # One program serves all bodies.
    same = dataclasses.replace(problem, bodies=(), measured_ranges=())
    contact, numbers, failed = _run(same, how, kept)
    return dict(
        contact=contact, problem=problem, recorded=numbers, failed=failed, kept_steps=kept,
        bodies=problem.bodies,
    )  # fmt: skip


@compiled_loop
def _run(
    problem: TransientProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[ContactSolution, dict[str, Array], Array]:
    advance = Advance(problem, TransientWaves(problem), how)
    steps, count = steps_given(problem, kept), len(problem.times)
    # Each step of a segment is computed once more in a derivative in reverse.
    length = math.ceil(math.sqrt(count))

    def one(state, given):
        like = jax.eval_shape(advance.step, state, given)[1]
        none = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), like)
        ways = lambda: advance.step(state, given), lambda: (state, none)
        return jax.lax.cond(given.counts, *(lambda way=way: varying(way()) for way in ways))

    def segment(state, first):
        rows = first + jnp.arange(length)
        given = jax.tree.map(lambda leaf: leaf[jnp.minimum(rows, count - 1)], steps)
        return jax.lax.scan(one, state, given._replace(counts=rows < count))

    policy = jax.checkpoint_policies.save_only_these_names(STEP_CONTACT)
    segment = jax.checkpoint(segment, policy=policy)
    start = varying(advance.init(len(kept)))
    state, numbers = jax.lax.scan(segment, start, jnp.arange(0, count, length))
    numbers = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[:count], numbers)
    pressure, gap, displacement, correction = state.kept
    of_steps = {
        name: (jnp.sum if name.startswith("num_") else jnp.max)(numbers[f"step_{name}"])
        for name in OF_STEPS
    }
    contact = ContactSolution(
        pressure=pressure, gap=gap, displacement=displacement, correction=correction,
        mean_pressure=jnp.mean(pressure), mean_gap=numbers["mean_gap"][np.array(kept)],
        result=state.result, **of_steps,
    )  # fmt: skip
    return contact, _of_whole(problem, numbers), state.failed


def _of_whole(problem: TransientProblem, numbers: dict[str, Array]) -> dict[str, Array]:
    """The numbers of all steps, and of the whole motion."""
    load = numbers["load"]

    def over(traction, without):
        return jnp.where(load > 0, traction.T / jnp.where(load > 0, load, 1), without).T

    # Load and tractions grow linearly in each step.
    loads = (load + jnp.append(0, load[:-1])) / 2
    shape, way = problem.displacement.shape, lengths(problem.steps[1])
    friction, path = over(numbers["traction"], jnp.nan), jnp.sum(loads * way)
    return numbers | dict(
        traction=numbers["traction"].reshape(shape),
        friction=friction.reshape(shape),
        shear_friction=over(numbers["shear_traction"], 0).reshape(shape),
        # Without a way, or without a load on it, there is none.
        mean_friction=jnp.where(path > 0, numbers["work_done"][-1] / nonzero(path), jnp.nan),
        mean_shear_friction=numbers["shear_work_done"][-1] / nonzero(path),
        peak_friction=largest(jnp.where(load > 0, lengths(friction), 0)),
        slope_in_contact=largest(numbers["slope"]),
    )
