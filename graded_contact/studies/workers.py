"""Points solved by the workers of `dask.distributed` (the extra `cluster`).

The function goes to each worker once, by cloudpickle, and is compiled there once. A task holds a
few points, about `SECONDS` of work. dask replaces a worker that dies, and solves its points again.
"""

import contextlib
import functools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from typing import Any

import jax

from ..core.checks import check_whole
from .dataset import LOST
from .program import Program, Task, runner, trace
from .store import Point

PATIENCE = 30  # seconds to wait for a scheduler or a first worker
SECONDS, MOST = 1.0, 64  # of a task, and its largest number of points
# Local workers start within `STARTING` seconds, and each of W gives `GAIN` of this process
# (`benchmarks/bench_sweep.py`, two cores: 5 s; 0.65 to 0.9 at 128², 0.7 at 512²).
STARTING, GAIN = 10.0, 0.7
OPTIONS = (
    "jax_enable_x64", "jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)  # fmt: skip
SETTINGS = {  # of dask, for local workers
    "distributed.scheduler.allowed-failures": 1,
    # A worker that does not return sooner is lost; the default of 15 s is short on a busy machine.
    "distributed.deploy.lost-worker-timeout": "1 hour",
}
# Ctrl-C reaches all processes of a terminal; only the caller handles it.
DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
_compiling = threading.Lock()


def check_workers(workers: Any, client: Any) -> None:
    """Raises `ValueError` unless at most one is given, and `workers` is a number or "auto"."""
    if workers is not None and client is not None:
        raise ValueError("`workers` and `client` (a scheduler) are given: only one can solve.")
    if workers not in (None, "auto"):
        check_whole("workers", workers, 1)


def num_cores() -> int:
    """Returns how many cores this process may use."""
    # A container or a batch system may allow fewer cores than the machine has.
    allowed = getattr(os, "sched_getaffinity", None)  # of Linux
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def pays(left: float, compiling: float) -> bool:
    """Returns whether local workers save more time than they take to start and to compile.

    **Arguments:**

    - `left`: seconds that this process would still take.
    - `compiling`: seconds that it took to compile.
    """
    return left * (1 - 1 / (GAIN * num_cores())) > STARTING + compiling


@contextlib.contextmanager
def connected(workers: int | None, client: Any) -> Iterator[Any]:
    """Gives a client of dask: `client`, one of the scheduler at the address `client`, or one with
    `workers` new processes on this machine.

    **Raises:** `ImportError` without the extra `cluster`; `OSError` if no scheduler answers.
    """
    try:
        import distributed
        from dask import config
    except ImportError as error:
        raise ImportError(
            "Workers need dask.distributed: `pip install 'graded_contact[cluster]'`."
        ) from error
    if isinstance(client, str):
        with distributed.Client(client, timeout=PATIENCE, set_as_default=False) as joined:
            yield joined
    elif client is not None:
        yield client
    else:
        with (
            config.set(SETTINGS),
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, silence_logs=50,
                dashboard_address="127.0.0.1:0", preload=[DEAF],
            ) as cluster,
            distributed.Client(cluster, set_as_default=False) as own,
        ):  # fmt: skip
            yield own


def on_workers(
    client: Any, program: Program, tasks: dict[int, Task]
) -> Iterator[tuple[int, Point]]:
    """Yields the results of points as they end, in any order.

    Points whose worker died too often (twice for local workers, four times by dask's default) are
    tried again one by one, and at last with no other at any worker; one that fails then is `LOST`.

    **Arguments:**

    - `client`: of `dask.distributed`.
    - `program`: what to solve.
    - `tasks`: by the numbers of the points.

    **Raises:** `TimeoutError` if there is no worker; `ConnectionError` if the scheduler ends;
    `RuntimeError` if a worker has another version of what the program is made of.
    """
    import cloudpickle
    from distributed import KilledWorker, as_completed

    client.wait_for_workers(1, timeout=PATIENCE)
    ended, running, queue, size = as_completed(loop=client.loop), {}, deque(tasks), 1
    suspects, alone = deque(), False  # points that were single when a worker died

    def submit(numbers):
        future = client.submit(_solve_there, packed, [tasks[i] for i in numbers], pure=False)
        running[future] = numbers
        ended.add(future)

    def hand_out():
        places = max(1, sum(client.nthreads().values()))
        while queue and len(running) < places:  # more would wait at a worker, and die with it
            # The last tasks are small, so that no worker waits long for another.
            share = -(-len(queue) // (2 * places))
            submit([queue.popleft() for _ in range(min(size, share))])
        if suspects and not running:
            submit([suspects.popleft()])
            return True
        return False

    try:
        # A separate task: dask repeats it if all workers with its result have died.
        options = {name: getattr(jax.config, name) for name in OPTIONS}
        # Packed twice: to unpack the function may start XLA, which must wait for the options.
        code = cloudpickle.dumps((program.function, program.point, program.steps))
        code = cloudpickle.dumps((options, program.key, code))
        packed = client.submit(bytes, code, pure=False)
        alone = hand_out()
        for future in ended:
            numbers, error = running.pop(future), future.exception()
            if error is None:
                found, seconds = future.result()
                # Small enough to store results often, large enough to hide the scheduler's time.
                size = max(1, min(MOST, int(SECONDS * len(numbers) / max(seconds, 1e-6))))
                yield from zip(numbers, found, strict=True)
            elif not isinstance(error, KilledWorker):
                raise error
            elif alone:
                yield numbers[0], Point({}, LOST)
            elif len(numbers) == 1:  # another one may have been at the worker that died
                suspects.append(numbers[0])
            else:
                for i in numbers:
                    submit([i])
            future.release()
            alone = hand_out()
    except (OSError, CancelledError) as error:
        text = f"The scheduler {client.scheduler.address} does not answer: {error}."
        raise ConnectionError(f"{text} Finished points are in the store, if any.") from error
    finally:
        with contextlib.suppress(OSError):
            client.cancel(list(running))


def _solve_there(packed: bytes, tasks: list[Task]) -> tuple[list[Point], float]:
    with _compiling:  # a worker may have several threads
        solve = _unpacked(packed)
    start = time.perf_counter()
    return [solve(task) for task in tasks], time.perf_counter() - start


@functools.lru_cache(maxsize=2)
def _unpacked(packed: bytes) -> Callable[[Task], Point]:
    import cloudpickle

    options, key, function = cloudpickle.loads(packed)
    for option, value in options.items():
        jax.config.update(option, value)
    program = trace(*cloudpickle.loads(function))
    # Results of two versions of JAX or of this package must not meet in one study.
    if program.key != key:
        raise RuntimeError(
            "A worker makes another program of `function`: its libraries have other versions."
        )
    return runner(program)
