"""The inputs of each step of a transient motion: its length, its way, and what its memory needs."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex

from ..transient_problem import TransientProblem


class StepInputs(NamedTuple):
    """The inputs of a step."""

    length: Array
    shift: Array  # s [m], along each component
    way: Array  # how far the surface moves [m]
    next_length: Array  # of the step after this one
    next_way: Array
    given: Array
    tables: tuple[Array, ...]  # `now`, `whole` and `aged` of the `Creep` of each force
    decay: Array  # exp(s_k Δ)
    from_old: Array  # of the step before
    from_new: Array
    slot: Array  # where its fields are kept
    index: Array
    counts: Array  # False for a step that only fills up the last segment


def steps_given(problem: TransientProblem, kept: tuple[int, ...]) -> StepInputs:
    """The inputs of all steps."""
    count = len(problem.times)
    lengths, way = problem.steps
    tables = tuple(
        jnp.stack([creep.now[kind], creep.whole[kind], creep.aged * (kind == 0)], 1)
        for kind in [0, *[1] * (way.shape[1] if len(problem.creeps[0].kernels) > 1 else 0)]
        for creep in problem.creeps
    )
    # The nodes follow from the times: all bodies have equal ones.
    z = problem.creeps[0].nodes * lengths[:, None]
    twice = _rest_of_exponential(z)
    once = 1 + z * twice  # (exp(z) - 1)/z
    before = lambda row: jnp.concatenate([jnp.zeros_like(row[:1]), row[:-1]])  # noqa: E731
    slots = np.full(count, len(kept))
    slots[list(kept)] = np.arange(len(kept))
    return StepInputs(
        length=lengths, shift=problem.moved, way=way, given=problem.given,
        next_length=jnp.roll(lengths, -1), next_way=jnp.roll(way, -1, axis=0),
        tables=tables, decay=jnp.exp(z), from_old=before(lengths[:, None] * (once - twice)),
        from_new=before(lengths[:, None] * twice), slot=jnp.asarray(slots),
        index=jnp.arange(count), counts=jnp.ones(count, bool),
    )  # fmt: skip


def _rest_of_exponential(z: Complex[Array, "..."]) -> Complex[Array, "..."]:
    """(exp(z) - 1 - z)/z², of small z by its series."""
    small = jnp.abs(z) < 1
    near, far = jnp.where(small, z, 0), jnp.where(small, 1, z)
    series = jnp.ones_like(z)
    for k in range(20, 2, -1):
        series = 1 + series * near / k
    return jnp.where(small, series / 2, (jnp.exp(far) - 1 - far) / far**2)
