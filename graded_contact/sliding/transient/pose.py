"""Transient motion: the problem of a case with times, and its solve on other grids."""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array

from ...contacts.inputs import check_gap, loading_of
from ...contacts.operators.operator import Field
from ...contacts.solver.nested_solve import DouglasRachford
from ...core.checks import is_concrete, within
from ...core.compilation import compiled
from ...core.derivative import still
from ...core.memory import check_memory
from ...fields.grid import Grid
from ...kernels.memory import creep_of, node_count
from ...materials.coverage import coverage
from ..case import COUPLED, GROUND, Case, Numerics, facts_of
from ..errors.neighbours import NEIGHBOURS_RTOL
from ..motion.motion import components
from ..number import Found
from ..shear import is_coupled, shear_stress
from ..transient_problem import TransientProblem, steps_of
from .run import run_transient

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
    contact, numbers, failed = run_transient(problem, how, kept)
    return dict(
        contact=contact, problem=problem, recorded=numbers, failed=failed, kept_steps=kept,
        bodies=problem.bodies,
    )  # fmt: skip
