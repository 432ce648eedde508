"""Points of a sweep on the workers of `dask.distributed` (the extra `cluster`).

The function goes to each worker once, by cloudpickle, and is compiled there once; what is handed
out later are the numbers of a few points. A worker that dies is replaced, and its points are done
again.

XLA splits loops by the number of its threads, and with them sums: from 256² points on, the last
digits depend on it. A worker takes the number, like all that decides bits, from the process that
asks, however many cores it has.
"""

import contextlib
import functools
import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from typing import Any

import jax

from ..files.study import LOST
from .chunk import Chunk, Columns, Finished, Keep, Pace, Work, compiled_chunk, most_points
from .program import Program, identity, trace

PATIENCE = 30  # s until a scheduler or a first worker must have answered
THREADS = "PJRT_NPROC"  # of XLA, by its name in the environment
OPTIONS = (
    "jax_enable_x64", "jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)  # fmt: skip
SETTINGS = {  # of dask, for workers of our own
    "distributed.scheduler.allowed-failures": 1,
    # Where a worker is not back sooner, it is given up; 15 s are short on a busy machine.
    "distributed.deploy.lost-worker-timeout": "1 hour",
}
# Ctrl-C reaches all processes of a terminal; it is for the one that asks.
DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
_compiling = threading.Lock()


@contextlib.contextmanager
def local_workers(count: int) -> Iterator[Any]:
    """Gives a client with `count` worker processes on this machine.

    **Raises:** `ImportError` without the extra `cluster`.
    """
    distributed = _distributed()
    from dask.config import set as configured

    with (
        configured(SETTINGS),
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, memory_limit=0, dashboard_address="127.0.0.1:0",
            silence_logs=50, preload=[DEAF],
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):  # fmt: skip
        yield client


@contextlib.contextmanager
def joined(address: str) -> Iterator[Any]:
    """Gives a client of a scheduler that runs, with a worker at least.

    **Raises:** `TimeoutError` if there is none; `ValueError` for what is no address; `ImportError`
    without the extra `cluster`.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except ValueError as error:
        raise ValueError(
            f"`scheduler={address!r}` is no address such as 'tcp://host:8786': {error}."
        ) from error
    except OSError as error:
        raise TimeoutError(
            f"`scheduler={address!r}` does not answer within {PATIENCE} s ({error})."
        ) from error
    with client:
        yield client


def on_workers(client: Any, program: Program, work: Work) -> Iterator[Finished]:
    """Yields points as they end.

    Points whose workers have died too often (twice here, four times at dask's default) are tried
    alone, as often; one that fails then, is failed.

    **Arguments:**

    - `client`: of `dask.distributed`.
    - `program`, `work`: what to solve.

    **Raises:** `TimeoutError` if there is no worker; `ConnectionError` if the scheduler ends;
    `RuntimeError` if a worker has another version of what the program is made of.
    """
    distributed, address = _distributed(), client.scheduler.address
    with _connected(address):
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            raise TimeoutError(f"{address} has had no worker for {PATIENCE} s.") from error
        # A task of its own: it is done again where all who know its result have died.
        packed = client.submit(bytes, _packed(program), pure=False)
    ended = distributed.as_completed(loop=client.loop)
    running: dict[Any, tuple[list[int], bool]] = {}
    suspects: deque[int] = deque()
    pace = Pace(most_points(program))

    def submit(points, *, alone=False):
        future = client.submit(_on_worker, packed, *work.of(points), pure=False)
        running[future] = points, alone
        ended.add(future)

    def hand_out():
        with _connected(address):
            # One for each thread, so that nobody dies with another.
            places = max(1, sum(client.nthreads().values()))
            while work.queue and len(running) < places:
                share = -(-len(work.queue) // (2 * places))  # the end comes for all at once
                submit(work.take(min(pace.count, share)))
            if suspects and not running:
                submit([suspects.popleft()], alone=True)

    try:
        hand_out()
        for future in ended:
            points, alone = running.pop(future)
            error = future.exception() if future.status == "error" else None
            if not isinstance(error, distributed.KilledWorker):
                if error is not None:
                    raise error
                with _connected(address):
                    if future.cancelled():
                        raise ConnectionError("its tasks were cancelled")
                    values, messages, seconds = future.result()
                    future.release()  # or it would be done again when its worker dies
                pace.note(len(points), seconds)
                yield Finished(points, values, messages)
            elif alone:
                yield Finished(points, [{}], [LOST])
            else:
                suspects.extend(points)
            hand_out()
    finally:
        with contextlib.suppress(OSError):
            client.cancel(list(running))


@contextlib.contextmanager
def _connected(address: str) -> Iterator[None]:
    """Raises `ConnectionError` for whatever dask raises when its scheduler ends."""
    try:
        yield
    except TimeoutError:
        raise
    except OSError as error:
        raise ConnectionError(
            f"The scheduler {address} is gone: {error}. Finished points are in the store, if there "
            "is one."
        ) from error


def _packed(program: Program) -> bytes:
    import cloudpickle

    environment = {
        THREADS: os.environ.get(THREADS, str(num_cores())),
        "XLA_FLAGS": os.environ.get("XLA_FLAGS", ""),
    }
    options = {name: getattr(jax.config, name) for name in OPTIONS}
    # The function comes last, and apart: to unpack it may start XLA.
    function = cloudpickle.dumps((program.function, program.point))
    return cloudpickle.dumps((environment, options, identity(program), function))


def _on_worker(packed: bytes, columns: Columns, keep: Keep) -> tuple[list, list[str], float]:
    with _compiling:  # a worker may have several threads
        run = _unpacked(packed)
    start = time.perf_counter()
    values, messages = run(columns, keep)
    return values, messages, time.perf_counter() - start


@functools.lru_cache(maxsize=2)
def _unpacked(packed: bytes) -> Chunk:
    import cloudpickle

    environment, options, name, function = cloudpickle.loads(packed)
    os.environ.update(environment)
    for option, value in options.items():
        jax.config.update(option, value)
    program = trace(*cloudpickle.loads(function))
    if identity(program) != name:
        raise RuntimeError(
            "A worker makes another program of `function`: it has another version of JAX, of "
            "graded_contact or of a library that `function` uses."
        )
    return compiled_chunk(program)


def num_cores() -> int:
    """Returns how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise ImportError(
            "Workers need dask.distributed: `pip install 'graded_contact[cluster]'`."
        ) from error
    return distributed
