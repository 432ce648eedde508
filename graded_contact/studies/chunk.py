"""Several points by one compiled program: in this process, or in any other.

The points of a chunk are a loop whose length is an argument of the program, so that any number of
points takes the same program and gives the same bits, whatever was kept from an earlier run.
"""

import logging
import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.problem import RESULTS
from ..files.study import FAILED
from .program import Program, code_of
from .store import reason_of

MOST = 64  # points of a chunk,
BYTES = 2**26  # and of what it returns, beyond one point
SECONDS = 1.0  # that a chunk shall take
MOST_COMPILED = 8  # programs kept for the next study with other numbers
_COMPILED: dict[str, Any] = {}
# JAX prints a traceback for each point that fails, whose reason is kept.
_CALLBACKS = logging.getLogger("jax._src.callback")

Columns = dict[str, np.ndarray]  # scalars of several points, by name
Keep = Sequence[Collection[str]] | None  # names of what to keep of each point; None: all
Chunk = Callable[[Columns, Keep], tuple[list[Columns], list[str]]]


class Finished(NamedTuple):
    """Points that ended, by their places among the columns: their arrays, and how they ended."""

    points: list[int]
    values: list[Columns]
    messages: list[str]


class Work:
    """Points that are to be solved.

    **Fields:**

    - `columns`: one number per point by name, those of other points included.
    - `keep`: as above, of all points.
    - `queue`: places of the points that nobody has taken.
    """

    def __init__(self, columns: Columns, keep: Keep, missing: Iterable[int]):
        self.columns, self.keep, self.queue = columns, keep, deque(missing)

    def take(self, count: int) -> list[int]:
        return [self.queue.popleft() for _ in range(min(count, len(self.queue)))]

    def of(self, points: list[int]) -> tuple[Columns, Keep]:
        columns = {name: column[points] for name, column in self.columns.items()}
        return columns, self.keep and [self.keep[i] for i in points]


class Pace:
    """How many points are handed out together: as many as take about `SECONDS`.

    **Fields:**

    - `count`: of the next chunk.
    - `seconds`: that a point of the last one took.
    """

    def __init__(self, most: int):
        self.count, self.most, self.seconds = 1, most, math.inf

    def note(self, count: int, seconds: float) -> None:
        self.seconds = seconds / count
        wanted = int(SECONDS / max(self.seconds, 1e-6))
        self.count = max(1, min(wanted, 2 * self.count, self.most))


def most_points(program: Program) -> int:
    """Returns how many points a chunk has at most."""
    return max(1, min(MOST, BYTES // bytes_of(program)))


def bytes_of(program: Program) -> int:
    """Returns the bytes of what a point gives."""
    return sum(math.prod(x.shape) * x.dtype.itemsize for x in jax.tree.leaves(program.like))


def compiled_chunk(program: Program) -> Chunk:
    """Returns what maps columns of up to `most_points` points to the arrays of each point and to
    how it ended, "" where it succeeded.

    If a chunk fails its points are tried one by one, to tell which.
    """
    size = most_points(program)
    numbers = jax.device_put(program.numbers)

    @jax.jit
    def loop(numbers, columns, count):
        start = jax.tree.map(lambda x: jnp.zeros((size, *x.shape), x.dtype), program.like)

        def add(i, found):
            here = program(numbers, {name: column[i] for name, column in columns.items()})
            return jax.tree.map(lambda all, new: all.at[i].set(new), found, here)

        return jax.lax.fori_loop(0, count, add, start)

    blank = {name: np.full(size, value) for name, value in program.point.items()}
    key = code_of(program)
    if key not in _COMPILED:
        while len(_COMPILED) >= MOST_COMPILED:
            del _COMPILED[next(iter(_COMPILED))]
        _COMPILED[key] = loop.lower(numbers, blank, size).compile()
    ready = _COMPILED[key]

    def run(columns, keep):
        count = len(next(iter(columns.values())))
        filled = {name: np.resize(column, size) for name, column in columns.items()}
        _CALLBACKS.addFilter(_silent)
        try:
            values, ends = jax.tree.map(np.asarray, ready(numbers, filled, count))
        except (ValueError, RuntimeError) as error:
            reason = FAILED + reason_of(error)
            if count == 1:
                return [{}], [reason]
            work = Work(columns, keep, ())
            alone = [run(*work.of([i])) for i in range(count)]
            return [v for vs, _ in alone for v in vs], [m for _, ms in alone for m in ms]
        finally:
            _CALLBACKS.removeFilter(_silent)
        names = keep or [values] * count
        # Copies: a part of the whole would keep all of it in memory.
        points = [{name: np.array(values[name][i]) for name in names[i]} for i in range(count)]
        return points, [RESULTS[jax.tree.map(lambda a, i=i: a[i, ...], ends)] for i in range(count)]

    return run


def _silent(record: logging.LogRecord) -> bool:
    return False


def in_this_process(run: Chunk, work: Work, pace: Pace) -> Iterator[Finished]:
    """Yields points as they end."""
    while points := work.take(pace.count):
        start = time.perf_counter()
        values, messages = run(*work.of(points))
        pace.note(len(points), time.perf_counter() - start)
        yield Finished(points, values, messages)
