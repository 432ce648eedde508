"""Chunks of a sweep on the workers of `dask.distributed` (the extra `cluster`).

The function goes to each worker once, by cloudpickle, and is compiled there once. A worker that
dies is replaced, and its chunk done again.

How XLA splits long sums depends on the number of cores that a process has: from 256² points on, the
last digits of a worker with one core differ from those of a process with two.
"""

import contextlib
import functools
import os
from collections.abc import Callable, Iterator
from typing import Any

import jax

from ..files.results import FAILED
from .chunk import Columns, chunk_program, run_chunk


@contextlib.contextmanager
def local_workers(count: int) -> Iterator[Any]:
    """Gives a client whose `count` worker processes share out this machine's cores.

    **Raises:** `ImportError` without the extra `cluster`.
    """
    distributed = _distributed()
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    with (
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        addresses = sorted(client.scheduler_info(n_workers=-1)["workers"])
        for i, address in enumerate(addresses if cores else ()):
            own = cores[i::count] or cores
            client.run(_use_cores, own, workers=[address])
        yield client


def on_workers(
    client: Any, function: Callable, size: int, parts: list[Columns], kept: list
) -> Iterator[tuple[int, list[Columns], list[str]]]:
    """Yields the number of a chunk, its points' arrays and how they ended, as they finish.

    **Arguments:**

    - `client`: of `dask.distributed`.
    - `function`: as in `sweep`.
    - `size`: of the program's chunk.
    - `parts`: columns of each chunk.
    - `kept`: of each chunk the names of what its points keep, or None.
    """
    distributed = _distributed()
    import cloudpickle

    packed = client.scatter(cloudpickle.dumps((function, size, jax.config.read("jax_enable_x64"))))
    futures = {
        client.submit(_on_worker, packed, columns, keep, pure=False): number
        for number, (columns, keep) in enumerate(zip(parts, kept, strict=True))
    }
    try:
        for future in distributed.as_completed(list(futures)):
            number = futures.pop(future)
            count = len(next(iter(parts[number].values())))
            if future.status == "finished":
                yield number, *future.result()
            else:  # its worker died again and again
                reason = f"{FAILED}{type(future.exception()).__name__}: {future.exception()}"
                yield number, [{}] * count, [reason] * count
    finally:
        client.cancel(list(futures))


@functools.lru_cache(maxsize=4)
def _unpacked(packed: bytes) -> tuple[Callable, int]:
    import cloudpickle

    function, size, double = cloudpickle.loads(packed)
    jax.config.update("jax_enable_x64", double)
    return chunk_program(function, size), size


def _on_worker(packed: bytes, columns: Columns, keep: Any) -> tuple[list[Columns], list[str]]:
    program, size = _unpacked(packed)
    return run_chunk(program, columns, size, keep)


def _use_cores(cores: list[int]) -> None:
    os.sched_setaffinity(0, cores)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise ImportError(
            "Workers need dask.distributed: `pip install 'graded_contact[cluster]'`."
        ) from error
    return distributed
