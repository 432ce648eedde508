"""The steps of a transient solve one after the other, in segments of about √n.

A derivative differentiates the contact of each step. It keeps the contacts, and computes the memory
once more from the first step of each segment on.
"""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...contacts.solution import ContactSolution
from ...core.compilation import compiled_loop, varying
from ...core.derivative import largest
from ..formulas import lengths
from ..numerics import Numerics
from ..transient_problem import TransientProblem
from .step_inputs import steps_given
from .steps import OF_STEPS, STEP_CONTACT, Advance
from .waves import TransientWaves


def run_transient(
    problem: TransientProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[ContactSolution, dict[str, Array], Array]:
    """Returns the contact, the numbers of all steps, and the first that failed.

    The contact has the kept fields, and the errors of all steps.
    """
    # The program is that of all bodies.
    return _run(dataclasses.replace(problem, bodies=(), measured_ranges=()), how, kept)


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
