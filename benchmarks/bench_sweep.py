"""Many solves: how fast, and what kills leave of them.

    python benchmarks/bench_sweep.py throughput [--sizes 128 256 512] [--points 200] [--workers 1 2]
                                                [--repeat 3] [--error 1e-4]
    python benchmarks/bench_sweep.py kills [--kills 20] [--points 200] [--seed 0]

`throughput`: friction of a tread at `points` velocities and pressures, rtol 1e-4: a plain loop over
`slide`; `sweep` in this process; by one worker with 1/W of the cores; by W workers. Apart are the
seconds until the first chunk is back (compiling or loading what is compiled, starting workers) and
the pace afterwards. Loop and `sweep` take turns, compiled before, and are compared by CPU time, of
which other programs take less. Bits are compared with those of `sweep` in this process. Then an
elastic block, beside Tamaas, if it is installed, at the same error. The constants of
`studies/engine.py` are from here.

`kills`: studies of contacts in a store. One is ended by SIGKILL at random moments, and started
again; in another workers are killed; in a third the disk is full for a while; a fourth is started
twice at once. Afterwards every point must be there once, and the study equal bit for bit to an
undisturbed one.
"""

import argparse
import contextlib
import os
import platform
import resource
import signal
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

# Transforms by one thread each give the same bits in any process.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import jax
import numpy as np
import psutil
from sweep_elastic import elastic

import graded_contact as gc
from graded_contact.files.study import Study, read_study
from graded_contact.studies.cluster import local_workers
from graded_contact.studies.sweep import sweep

jax.config.update("jax_enable_x64", True)

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


def throughput(
    sizes: list[int], points: int, workers: list[int], repeat: int, target: float
) -> None:
    print(f"{'N':>5s}  {'way':38s} {'first [s]':>10s} {'points/s':>9s}  same bits")
    for size in sizes:
        surface, axes = surface_of(size), axes_of(points)
        rub = contact(surface, gc.tyre_tread())
        jitted = jax.jit(rub)
        looped, told = in_a_loop(jitted, axes)
        row(size, "loop", told, "")
        here, told = timed(rub, axes)
        near = np.max(np.abs(here["friction"].ravel() - looped))
        row(size, "sweep, this process", told, f"loop within {near:.0e}")
        ratios = []
        for _ in range(repeat):
            loop = in_a_loop(jitted, axes, clock=time.process_time)[1][1]
            ratios.append(timed(rub, axes, clock=time.process_time)[1][1] / loop)
        told = ", ".join(f"{ratio:.2f}" for ratio in ratios)
        print(f"{size:5d}  points per CPU second by sweep / by the loop, in turns: {told}")
        for count in workers:
            rates = []
            for way, number, cores in [("one worker with 1/W of the cores", 1, count),
                                       ("W workers", count, 1)]:  # fmt: skip
                with some_cores(cores):
                    start = time.perf_counter()
                    with local_workers(number) as client:
                        up = time.perf_counter() - start
                        found, (first, rate) = timed(rub, axes, client=client)
                same = found["friction"].tobytes() == here["friction"].tobytes()
                row(size, f"sweep, {way}, W = {count}", (up + first, rate), str(same))
                rates.append(rate)
            print(f"{size:5d}  W workers / (W x one of them) = {rates[1] / rates[0] / count:.2f}")
        for way, told, errors in elastic(size, points, target, timed):
            said = "errors: pressure {:.1e}, area {:.1e}".format(*errors)
            row(size, f"elastic: {way}", told, said)


def in_a_loop(jitted, axes, clock=time.perf_counter) -> tuple[list[float], tuple[float, float]]:
    grid = np.meshgrid(*axes.values(), indexing="ij")
    each = [dict(zip(axes, at, strict=True)) for at in zip(*map(np.ravel, grid), strict=True)]
    start = clock()
    jax.block_until_ready(jitted(each[0]))
    first, start = clock() - start, clock()
    found = [float(jitted(point)["friction"]) for point in each]
    return found, (first, len(each) / (clock() - start))


def timed(rub, axes, clock=time.perf_counter, **options) -> tuple[Study, tuple[float, float]]:
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


def row(size, way, told, same):
    print(f"{size:5d}  {way:38s} {told[0]:10.2f} {told[1]:9.1f}  {same}", flush=True)


def study(place: Path, size: int, points: int, workers: int, full_after: int) -> None:
    """The process that is killed: one study into a folder."""

    def fill(done, _):
        if done >= full_after:  # no file can grow beyond a byte, as on a full disk
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))

    found = sweep(contact(surface_of(size), gc.tyre_tread()), axes_of(points),
                  store=place / "points", workers=workers or None, progress=fill)  # fmt: skip
    found.write(place / "study.h5")


def start(place: Path, size: int, points: int, *options: object) -> subprocess.Popen:
    place.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, __file__, "study", str(place), "--sizes", str(size), "--points",
         str(points), *map(str, options)], stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def kills(size: int, count: int, points: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        base, begin = Path(folder), time.perf_counter()
        start(base / "whole", size, points).communicate()
        whole, took = read_study(base / "whole/study.h5"), time.perf_counter() - begin
        print(f"undisturbed: {points} points of {size}² in {took:.1f} s, start included")

        lost = sum(killed(base / "killed", size, points, took, draw) for _ in range(count))
        start(base / "killed", size, points).communicate()
        check(base / "killed", f"{count} kills of the client", whole, lost, points)

        number = workers_killed(base / "workers", size, points, count // 2, draw)
        check(base / "workers", f"{number} kills of workers", whole, 0, points)

        full = start(base / "full", size, points, "--full-after", points // 2)
        said = full.communicate()[1].strip().splitlines()[-1]
        print(f"full disk: {len(kept(base / 'full'))} points kept; {said}")
        before = kept(base / "full")
        start(base / "full", size, points).communicate()
        check(base / "full", "full disk", whole, num_lost(before, kept(base / "full")), points)

        both = [start(base / "both", size, points) for _ in range(2)]
        said = [one.communicate()[1].strip().splitlines() for one in both]
        ends = [lines[-1] if lines else "no error" for lines in said]
        print("two clients:", "; ".join(ends))
        check(base / "both", "two clients", whole, 0, points)


def killed(place: Path, size: int, points: int, took: float, draw: np.random.Generator) -> int:
    """Kills a client; returns how many of the points that it found are lost or changed."""
    before, process = kept(place), start(place, size, points)
    # Half of them at any moment, most of which is the start; half after points of its own.
    wanted = len(before) + int(draw.integers(1, 2 + (points - len(before)) // 4))
    limit = time.perf_counter() + draw.uniform(0, took) * draw.choice([1, 100])
    while len(kept(place)) < wanted and time.perf_counter() < limit and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    after = kept(place)
    print(f"killed: {len(before):3d} -> {len(after):3d} points", flush=True)
    return num_lost(before, after)


def workers_killed(
    place: Path, size: int, points: int, count: int, draw: np.random.Generator
) -> int:
    """Kills workers of a study, each after points that came since the last; returns how many."""
    process, number, seen = start(place, size, points, "--workers", 2), 0, 0
    while process.poll() is None:
        time.sleep(draw.uniform(0, 1))
        if number == count or len(kept(place)) == seen:
            continue
        seen = len(kept(place))
        with contextlib.suppress(psutil.NoSuchProcess, IndexError):
            children = psutil.Process(process.pid).children()
            workers = [c for c in children if any("spawn_main" in word for word in c.cmdline())]
            workers[draw.integers(len(workers))].kill()
            number += 1
            print(f"worker killed at {seen} points", flush=True)
    process.communicate()
    return number


def kept(place: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (place / "points").glob("[!.]*.h5")}


def num_lost(before: dict[str, bytes], after: dict[str, bytes]) -> int:
    return sum(after.get(name) != data for name, data in before.items())


def check(place: Path, what: str, whole: Study, lost: int, points: int) -> None:
    found = read_study(place / "study.h5")
    same = all(found[name].tobytes() == whole[name].tobytes() for name in whole.values)
    print(f"{what}: {len(kept(place))} of {points} points kept, {lost} lost or changed; "
          f"equal bit for bit: {same and found.complete}", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("section", choices=["throughput", "kills", "study"])
    parser.add_argument("folder", nargs="?", type=Path, help="of `study`, which `kills` runs")
    parser.add_argument("--sizes", type=int, nargs="+")
    parser.add_argument("--points", type=int, default=200)
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--error", type=float, default=1e-4, help="of pressures, elastic")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--full-after", type=int, default=2**31)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if given.section == "study":
        workers = given.workers[0] if len(given.workers) == 1 else 0
        study(given.folder, given.sizes[0], given.points, workers, given.full_after)
        return
    packages = ("graded_contact", "jax", "distributed")
    print(platform.machine(), os.cpu_count(), "cores;", *(f"{p} {version(p)}" for p in packages))
    if given.section == "throughput":
        sizes = given.sizes or [128, 256, 512]
        throughput(sizes, given.points, given.workers, given.repeat, given.error)
    else:
        kills((given.sizes or [256])[0], given.kills, given.points, given.seed)


if __name__ == "__main__":
    main()
