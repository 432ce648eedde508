"""Where the points of a study are solved: in this process, on workers of its own, or on others'.

Workers on this machine take `STARTING` seconds to come up and as long to compile, or to load what
is compiled, as this process; then W of them solve `SMALL` W times as many points as this process
does where a solve takes less than `LONG`, and `LARGE` W times beyond: one solve uses all cores,
too. Measured on two cores (`benchmarks/bench_sweep.py throughput`): 5 s with compiled programs on
disk; 0.65 to 0.9 at 128², 0.8 at 256², 0.7 at 512². Many cores were not.
"""

import importlib.util
import time
from collections.abc import Generator
from typing import Any

import jax

from ..core.checks import check_whole
from .chunk import Finished, Pace, Work, compiled_chunk, in_this_process, most_points
from .cluster import joined, local_workers, num_cores, on_workers
from .program import Program

STARTING = 10.0  # s
SMALL, LARGE = 0.8, 0.7  # gain for each worker
LONG = 0.1  # s


def check_engine(workers: Any, scheduler: str | None, client: Any) -> None:
    """Raises `ValueError` unless at most one of them is given, `workers` a number or "auto"."""
    given = {"workers": workers, "scheduler": scheduler, "client": client}
    named = [f"`{name}`" for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise ValueError(f"{' and '.join(named)} are given: one of them says where to solve.")
    if isinstance(workers, str) and workers != "auto":
        raise ValueError(f'`workers={workers!r}` must be a whole number or "auto".')
    if workers not in (None, "auto"):
        check_whole("workers", workers, 1)


def solved(
    program: Program, work: Work, workers: Any, scheduler: str | None, client: Any
) -> Generator[Finished]:
    """Yields points as they end; arguments as in `sweep`."""
    if client is not None:
        yield from on_workers(client, program, work)
    elif scheduler is not None:
        with joined(scheduler) as client:
            yield from on_workers(client, program, work)
    elif workers not in (None, "auto"):
        with local_workers(workers) as client:
            yield from on_workers(client, program, work)
    else:
        yield from _here(program, work, num_cores() if workers == "auto" else 1)


def _here(program: Program, work: Work, cores: int) -> Generator[Finished]:
    """Yields points as they end in this process, and on workers from when on they pay."""
    start = time.perf_counter()
    run = compiled_chunk(program)
    compiling = time.perf_counter() - start
    pace = Pace(most_points(program))
    can = importlib.util.find_spec("distributed") and jax.default_backend() == "cpu"
    for finished in in_this_process(run, work, pace):
        yield finished
        if can and pays(len(work.queue), pace.seconds, compiling, cores):
            break
    if work.queue:
        with local_workers(cores) as client:
            yield from on_workers(client, program, work)


def pays(left: int, seconds: float, compiling: float, cores: int) -> bool:
    """Returns whether to start workers takes less time than it saves.

    **Arguments:**

    - `left`: points to be solved.
    - `seconds`: that one takes here.
    - `compiling`: seconds that it took to compile here.
    - `cores`: as many workers.
    """
    gain = cores * (SMALL if seconds < LONG else LARGE)
    return left * seconds * (1 - 1 / gain) > STARTING + compiling
