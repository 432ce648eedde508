"""The steps of a transient solve one after the other, in segments of about √n.

A derivative is that of the contact of each step. It keeps the contacts, and computes the memory
once more from the first step of each segment on.
"""

import contextlib
import dataclasses
import math
from collections.abc import Iterator
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from ...contacts.operators.operator import nonzero
from ...core.checks import is_concrete
from ...core.compilation import compiled, compiled_loop
from ...core.derivative import largest
from ..formulas import lengths
from ..numerics import Numerics
from ..problem import TransientProblem
from .steps import STEP_CONTACT, Advance, TransientState, steps_given
from .waves import TransientWaves


@runtime_checkable
class Journal(Protocol):
    """What follows transient solves, see `followed`."""

    def begin(self, start: Any) -> tuple[int, Any]:
        """Returns the step at which a transient solve begins, and what is known there: 0 and
        `start`, or what was kept.
        """
        ...

    def keep(self, step: int, found: Any) -> None:
        """Takes what is known before a step; what this raises ends the solve."""
        ...


_journals: list[Journal] = []


@contextlib.contextmanager
def followed(journal: Journal) -> Iterator[None]:
    """Inside, each transient solve that is not traced goes on part by part, and `journal` follows
    it."""
    _journals.append(journal)
    try:
        yield
    finally:
        _journals.pop()


def run_transient(
    problem: TransientProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[TransientState, dict[str, Array]]:
    """Returns the state after the last step, and the numbers of all steps."""
    # The program is that of all bodies.
    problem, count = dataclasses.replace(problem, bodies=()), len(problem.times)
    if not _journals or not all(map(is_concrete, jax.tree.leaves(problem))):
        return _run(problem, how, kept)
    step, found = _journals[-1].begin(_before(problem, how, kept))
    while step < count:
        found = _one_segment(problem, how, kept, found, jnp.asarray(step))
        step = min(step + _length(count), count)
        _journals[-1].keep(step, found)
    state, numbers = found
    return state, _of_whole(problem, numbers)


def _length(count: int) -> int:
    """Of a segment: about √n steps, each computed once more in a derivative in reverse."""
    return math.ceil(math.sqrt(count))


def _segments(problem: TransientProblem, how: Numerics, kept: tuple[int, ...]):
    """The state before t = 0, and what advances a state by a segment from a step on."""
    advance = Advance(problem, TransientWaves(problem), how)
    steps, count = steps_given(problem, kept), len(problem.times)

    def one(state, given):
        like = jax.eval_shape(advance.step, state, given)[1]
        stay = lambda: (state, jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), like))  # noqa: E731
        return jax.lax.cond(given.counts, lambda: advance.step(state, given), stay)

    def segment(state, first):
        rows = first + jnp.arange(_length(count))
        given = jax.tree.map(lambda leaf: leaf[jnp.minimum(rows, count - 1)], steps)
        return jax.lax.scan(one, state, given._replace(counts=rows < count))

    return advance.init(len(kept)), segment


@compiled_loop
def _run(
    problem: TransientProblem, how: Numerics, kept: tuple[int, ...]
) -> tuple[TransientState, dict[str, Array]]:
    start, segment = _segments(problem, how, kept)
    count = len(problem.times)
    policy = jax.checkpoint_policies.save_only_these_names(STEP_CONTACT)
    segment = jax.checkpoint(segment, policy=policy)
    state, numbers = jax.lax.scan(segment, start, jnp.arange(0, count, _length(count)))
    numbers = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:])[:count], numbers)
    return state, _of_whole(problem, numbers)


@compiled_loop
def _before(problem: TransientProblem, how: Numerics, kept: tuple[int, ...]):
    """The state before t = 0, and room for the numbers of all steps."""
    start, segment = _segments(problem, how, kept)
    like, count = jax.eval_shape(segment, start, 0)[1], len(problem.times)
    return start, jax.tree.map(lambda a: jnp.zeros((count, *a.shape[1:]), a.dtype), like)


@compiled_loop
def _one_segment(problem: TransientProblem, how: Numerics, kept: tuple[int, ...], found, first):
    """The state and the numbers after a segment."""
    segment, (state, numbers) = _segments(problem, how, kept)[1], found
    state, new = segment(state, first)
    rows = first + jnp.arange(_length(len(problem.times)))
    return state, jax.tree.map(lambda a, b: a.at[rows].set(b, mode="drop"), numbers, new)


@compiled
def _of_whole(problem: TransientProblem, numbers: dict[str, Array]) -> dict[str, Array]:
    """The numbers of all steps, with those over the load and those of the whole."""
    load = numbers["load"]

    def over(traction):
        return jnp.where(load > 0, traction.T / jnp.where(load > 0, load, 1), jnp.nan).T

    shape, way = problem.displacement.shape, lengths(problem.steps[1])
    friction, path = over(numbers["traction"]), jnp.sum(load * way)
    return numbers | dict(
        traction=numbers["traction"].reshape(shape), friction=friction.reshape(shape),
        shear_friction=over(numbers["shear_traction"]).reshape(shape),
        # Without a way, or without a load on it, there is none.
        mean_friction=jnp.where(path > 0, numbers["work_done"][-1] / nonzero(path), jnp.nan),
        peak_friction=largest(jnp.where(load > 0, lengths(friction), 0)),
        slope_in_contact=largest(numbers["slope"]),
    )  # fmt: skip
