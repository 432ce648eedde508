"""Histories: the problem of a case with times, its steps, and the result."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..blocks.creep import NODES, creep_of
from ..blocks.stack import Stack
from ..contacts.inputs import loading_of
from ..contacts.law import check_one_law
from ..contacts.nested_solve import DouglasRachford
from ..contacts.operator import Field
from ..contacts.solution import RESULTS, ContactSolution
from ..core.checks import check_squares, is_concrete, short, within
from ..core.memory import check_memory
from ..fields.devices import required
from ..fields.grid import Grid
from .case import Case
from .facts import facts_of
from .history_problem import HistoryProblem, steps_of
from .history_steps import OF_STEPS, HistoryState, run_history
from .numerics import Numerics
from .resolution import NEIGHBOURS_RTOL
from .result import TransientSliding
from .shear import Coulomb, ShearLaw, is_coupled, shear_stress, unless_negative

_MEMORY = 4 * NODES + 30  # fields of a body


def history_problem(case: Case) -> HistoryProblem:
    """Returns the problem of a case with displacements at times."""
    surface, times = case.rough, case.times
    if not surface.periodic:
        raise ValueError(
            "`surface` is on a window (`periodic=False`) and is refused in a history: the memory "
            "of the block holds the waves of a cell, where the copies of a window's load would "
            "act, too. Put the body into a periodic cell, four radii of its contact wide or more."
        )
    check_one_law(case.law)
    check_squares("heights", surface.heights, "m")
    grid, count = surface.grid, len(times)
    coupled = is_coupled(case.shear)
    fields = fields_of_history(case.counter, case.shear)
    check_memory("surface", "a history", fields, grid.shape, surface.heights.dtype.itemsize)
    load = dict(pressure=case.pressure, mean_gap=case.mean_gap)
    loading = loading_of(case.law, surface.heights[None], count, **load)
    given = next(value for value in loading if value is not None).reshape(count)
    if coupled and not isinstance(case.shear, Coulomb):
        raise ValueError(
            "`shear` is refused: in a history only the traction of `Coulomb` can move the surface. "
            "Pass `coupled=False`."
        )
    lowest = 2 * np.pi / jnp.max(grid.size)
    highest = np.pi * jnp.sqrt(jnp.sum((np.array(grid.shape) / grid.size) ** 2))
    ends, creeps = jnp.stack([lowest, highest]), []
    for name, body in zip(("`stack`:", "`counter`:"), case.bodies, strict=False):
        with within(name):
            creeps.append(creep_of(body, ends, steps_of(times), coupled))
    stress = shear_stress(case.shear, jnp.ones((), surface.heights.dtype), case.temperature)
    return HistoryProblem(
        bodies=case.bodies, creeps=tuple(creeps), heights=surface.heights, grid=grid, law=case.law,
        times=times, displacement=case.displacement, given=unless_negative(given, stress),
        shear=stress, prescribed=case.prescribed, facts=facts_of(case),
        block_heights=None if case.block_surface is None else case.block_surface.heights,
    )  # fmt: skip


def on_grid(
    found: TransientSliding, shape: tuple[int, ...], rough: tuple[Field, ...], chosen: np.ndarray
) -> TransientSliding:
    """Returns the history of other heights on a grid of the cell, in fewer steps.

    `chosen` are the numbers of the steps whose ends stay.
    """
    problem = found.problem
    creeps, times = problem.creeps, problem.times[chosen]
    if len(chosen) < len(problem.times):
        ends = jnp.exp(creeps[0].log_q)
        coupled = creeps[0].lift is not None
        creeps = tuple(creep_of(body, ends, steps_of(times), coupled) for body in problem.bodies)
    heights, *own = rough
    problem = dataclasses.replace(
        problem, creeps=creeps, heights=heights, block_heights=own[0] if own else None,
        grid=Grid(shape, problem.grid.size), times=times,
        displacement=problem.displacement[chosen], given=problem.given[chosen],
    )  # fmt: skip
    solver = DouglasRachford(newton=is_concrete(problem.given))
    how = Numerics(rtol=NEIGHBOURS_RTOL, solver=solver, throw=False)
    kept = (len(chosen) - 1,)
    return history_of(problem, *run_history(problem, how, kept), kept)


def solve_history(case: Case, how: Numerics, fields_at: Sequence[int] = (-1,)) -> TransientSliding:
    """Returns the contact of a case with displacements at times; see `slide_history`."""
    count = len(case.times)
    kept = _steps_kept(fields_at, count)
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


def fields_of_history(counter: Stack | None, shear: ShearLaw | None) -> float:
    """Returns how many fields a history takes: of each body, twice if traction moves it."""
    return _MEMORY * (1 if counter is None else 2) * (2 if is_coupled(shear) else 1)


def _steps_kept(fields_at: Any, count: int) -> tuple[int, ...]:
    """The numbers of the steps whose fields are kept, from 0."""
    steps = np.asarray(fields_at)
    if steps.ndim != 1 or not steps.size or not np.issubdtype(steps.dtype, np.integer):
        raise ValueError(
            f"`fields_at={short(fields_at)}` must be a tuple of numbers of steps, such as (0, -1)."
        )
    for step in steps[(steps < -count) | (steps >= count)]:
        raise ValueError(
            f"`fields_at={step}` is refused: the {count} steps are 0 to {count - 1}, or -1 to "
            f"{-count} from the last."
        )
    return tuple((steps % count).tolist())


def history_of(problem, state: HistoryState, numbers, kept) -> TransientSliding:
    """Returns the result of the numbers and the state of a history."""
    pressure, gap, displacement, correction = state.kept
    over = tuple(range(1, pressure.ndim))
    contact = ContactSolution(
        pressure=pressure, gap=gap, displacement=displacement, correction=correction,
        mean_pressure=jnp.mean(pressure), mean_gap=jnp.mean(gap, axis=over),
        result=state.result, **{
            name: (jnp.sum if name.startswith("num_") else jnp.max)(numbers[f"step_{name}"])
            for name in OF_STEPS
        },
    )  # fmt: skip
    return TransientSliding(
        contact=contact, problem=problem, recorded=numbers, failed=state.failed, kept_steps=kept
    )
