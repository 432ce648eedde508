"""The speed of many solves.

    python benchmarks/bench_sweep.py [--sizes 128 256 512] [--points 200] [--workers 1 2]
                                     [--repeat 3]

Friction of a tread at `points` velocities and pressures, rtol 1e-4: a plain loop over `slide`;
`sweep` in this process; by one worker with 1/W of the cores; by W workers. The seconds until the
first results (compiling or loading, starting workers) and the speed afterwards are separate. Loop
and `sweep` are interleaved and compared by CPU time, which other programs disturb less. Bits are
compared with those of `sweep` in this process. The constants of `studies/workers.py` are from this
benchmark.
"""

import contextlib
import os
import time
from typing import Any

# Transforms by one thread each give the same bits in any process.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import jax
import numpy as np
from rows import run, show

import graded_contact as gc
from graded_contact.studies.sweep import sweep
from graded_contact.studies.workers import connected

CELL = 1e-3  # m


def surface_of(size: int) -> gc.Surface:
    q0 = 2 * np.pi / CELL
    spectrum = gc.SelfAffine(
        rms_slope=0.2, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=size / 8 * q0
    )
    return gc.random_surface(spectrum, gc.Grid((size, size), CELL), jax.random.key(0))


def contact(surface: gc.Surface, material):
    """Friction and area of a half space under a surface."""
    stack = gc.Stack(base=gc.HalfSpace(material))

    def rub(point):
        found = gc.slide(
            stack, surface, pressure=point["pressure"], velocity=point["velocity"], rtol=1e-4,
            throw=False,
        )  # fmt: skip
        return {
            "friction": found.friction,
            "contact_area": found.contact_area,
            "num_fft_pairs": found.num_fft_pairs,
            "result": found.result,
        }

    return rub


def axes_of(points: int) -> dict:
    return {"pressure": np.array([1e5, 3e5]), "velocity": np.geomspace(1e-4, 1.0, points // 2)}


def throughput(sizes=(128, 256, 512), points=200, workers=(1, 2), repeat=3):
    """Seconds to the first points and points per second of each way."""
    for size in sizes:
        surface, axes = surface_of(size), axes_of(points)
        rub = contact(surface, gc.tyre_tread())
        jitted = jax.jit(rub)
        looped, speed = in_a_loop(jitted, axes)
        row(size, "loop", speed, "")
        here, speed = timed(rub, axes)
        near = np.max(np.abs(here["friction"].values.ravel() - looped))
        row(size, "sweep, this process", speed, f"loop within {near:.0e}")
        ratios = []
        for _ in range(repeat):
            loop = in_a_loop(jitted, axes, clock=time.process_time)[1][1]
            ratios.append(timed(rub, axes, clock=time.process_time)[1][1] / loop)
        text = ", ".join(f"{ratio:.2f}" for ratio in ratios)
        print(f"{size:5d}  points per CPU second by sweep / by the loop, interleaved: {text}")
        for count in workers:
            rates = []
            for way, number, cores in [("one worker with 1/W of the cores", 1, count),
                                       ("W workers", count, 1)]:  # fmt: skip
                with some_cores(cores):
                    start = time.perf_counter()
                    with connected(number, None) as client:
                        up = time.perf_counter() - start
                        found, (first, rate) = timed(rub, axes, client=client)
                same = found.friction.values.tobytes() == here.friction.values.tobytes()
                row(size, f"sweep, {way}, W = {count}", (up + first, rate), str(same))
                rates.append(rate)
            print(f"{size:5d}  W workers / (W x one of them) = {rates[1] / rates[0] / count:.2f}")


def in_a_loop(jitted, axes, clock=time.perf_counter) -> tuple[list[float], tuple[float, float]]:
    grid = np.meshgrid(*axes.values(), indexing="ij")
    each = [dict(zip(axes, at, strict=True)) for at in zip(*map(np.ravel, grid), strict=True)]
    start = clock()
    jax.block_until_ready(jitted(each[0]))
    first, start = clock() - start, clock()
    found = [float(jitted(point)["friction"]) for point in each]
    return found, (first, len(each) / (clock() - start))


def timed(rub, axes, clock=time.perf_counter, **options) -> tuple[Any, tuple[float, float]]:
    """A study, the seconds until the first chunk is there, and points per second afterwards."""
    start, marks = clock(), []
    found = sweep(rub, axes, progress=lambda done, _: marks.append((done, clock())), **options)
    # All workers have compiled when a quarter is done.
    begun = next(mark for mark in marks if 4 * mark[0] >= marks[-1][0])
    rate = (marks[-1][0] - begun[0]) / (marks[-1][1] - begun[1])
    return found, (marks[0][1] - start, rate)


@contextlib.contextmanager
def some_cores(part: int):
    """This process, and those that it starts, with 1/part of the cores."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, cores[: max(1, len(cores) // part)])
    yield
    os.sched_setaffinity(0, cores)


def row(size, way, speed, same):
    show({"N": size, "way": way, "first [s]": speed[0], "points/s": speed[1], "same bits": same})


if __name__ == "__main__":
    run(__doc__, throughput)
