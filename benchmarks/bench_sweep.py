"""Many solves: how fast, and what kills leave of them.

    python benchmarks/bench_sweep.py throughput [--sizes 128 256 512] [--points 200] [--workers 1 2]
    python benchmarks/bench_sweep.py kills [--kills 20] [--points 200] [--seed 0]

`throughput`: friction of a tread at `points` velocities and pressures, rtol 1e-4: a plain loop over
`slide`, `sweep` in this process, and `sweep` on local workers that share out the cores. Compiling,
starting workers and their first chunks are apart. The bits of all ways are compared with those of
`sweep` in this process.

`kills`: a study of contacts in a store, whose process is ended by SIGKILL at random moments and
started again; then one whose workers are killed. Afterwards every point must be there once, and the
study equal bit for bit to an undisturbed one.
"""

import argparse
import os
import platform
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

import graded_contact as gc
from graded_contact.files.study import Study, read_study
from graded_contact.studies.cluster import local_workers
from graded_contact.studies.sweep import sweep

jax.config.update("jax_enable_x64", True)

CELL = 1e-3  # m


def contact(size: int):
    """Friction and area of a tread under a self-affine surface of size² points."""
    q0 = 2 * np.pi / CELL
    spectrum = gc.SelfAffine(
        rms_slope=0.2, hurst=0.8, q_low=q0, q_roll=4 * q0, q_high=size / 8 * q0
    )
    surface = gc.random_surface(spectrum, gc.Grid((size, size), CELL), jax.random.key(0))
    stack = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))

    def rub(point):
        found = gc.slide(
            stack, surface, pressure=point["pressure"], velocity=point["velocity"], rtol=1e-4,
            throw=False,
        )  # fmt: skip
        return {
            "friction": found.friction,
            "contact_area": found.contact_area,
            "num_fft_pairs": found.contact.num_fft_pairs,
            "result": found.contact.result,
        }

    return rub


def axes_of(points: int) -> dict:
    return {"pressure": np.array([1e5, 3e5]), "velocity": np.geomspace(1e-4, 1.0, points // 2)}


def throughput(sizes: list[int], points: int, workers: list[int]) -> None:
    print(f"{'N':>5s}  {'way':24s} {'first [s]':>10s} {'rest [s]':>9s} {'points/s':>9s}  same bits")
    for size in sizes:
        rub, axes = contact(size), axes_of(points)
        grid = np.meshgrid(*axes.values(), indexing="ij")
        each = [dict(zip(axes, at, strict=True)) for at in zip(*map(np.ravel, grid), strict=True)]
        start = time.perf_counter()
        jitted = jax.jit(rub)
        jax.block_until_ready(jitted(each[0]))
        first = time.perf_counter() - start
        start = time.perf_counter()
        looped = [float(jitted(point)["friction"]) for point in each]
        row(size, "loop", first, time.perf_counter() - start, points, "")
        here, told = timed(rub, axes)
        same = np.max(np.abs(here["friction"].ravel() - looped))
        row(size, "sweep, one process", *told, points, f"loop within {same:.0e}")
        for count in workers:
            start = time.perf_counter()
            with local_workers(count) as client:
                up = time.perf_counter() - start
                found, (first, rest) = timed(rub, axes, client=client, leave_out=count)
                same = found["friction"].tobytes() == here["friction"].tobytes()
                row(size, f"sweep, {count} workers", up + first, rest, points, str(same))


def timed(rub, axes, *, leave_out: int = 1, **options) -> tuple[Study, tuple[float, float]]:
    """A study, the time to its first chunks, and that of all at the pace of the rest."""
    moments = [time.perf_counter()]
    found = sweep(rub, axes, progress=lambda *_: moments.append(time.perf_counter()), **options)
    first = moments[leave_out] - moments[0]
    pace = (moments[-1] - moments[leave_out]) / (len(moments) - 1 - leave_out)
    return found, (first, pace * (len(moments) - 1))


def row(size, way, first, rest, points, same):
    print(
        f"{size:5d}  {way:24s} {first:10.2f} {rest:9.2f} {points / rest:9.1f}  {same}", flush=True
    )


def study(folder: str, points: int, pids: str | None = None) -> None:
    """The process that is killed: one study into `folder`; with `pids` on two workers."""
    arguments = (contact(64), axes_of(points))
    place = Path(folder)
    if pids is None:
        found = sweep(*arguments, store=place / "points")
    else:
        with local_workers(2) as client:
            Path(pids).write_text(" ".join(map(str, client.run(os.getpid).values())))
            found = sweep(*arguments, store=place / "points", client=client)
    found.write(place / "study.h5")


def kills(count: int, points: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        run(Path(folder) / "whole", points).wait()
        whole, took = read_study(Path(folder) / "whole/study.h5"), time.perf_counter() - start
        print(f"undisturbed: {points} points in {took:.1f} s, start included")
        place, lost = Path(folder) / "killed", 0
        for number in range(count):
            before = kept(place)
            process = run(place, points)
            # Half of them at any moment, most of which is the start; half after points of its own.
            wanted = len(before) + int(generator.integers(1, 2 + (points - len(before)) // 4))
            limit = time.perf_counter() + generator.uniform(0, took) * (1 if number % 2 else 100)
            while len(kept(place)) < wanted and time.perf_counter() < limit:
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
            process.wait()
            after = kept(place)
            lost += sum(after.get(name) != data for name, data in before.items())
            print(f"kill {number + 1:2d}: {len(before):3d} -> {len(after):3d} points", flush=True)
        run(place, points).wait()
        check(place, whole, lost, points)
        place, lost = Path(folder) / "workers", 0
        pids = Path(folder) / "pids"
        process = run(place, points, str(pids))
        while process.poll() is None:
            time.sleep(generator.uniform(0.5, 2))
            if pids.exists() and lost < count // 2 and kept(place):
                victim = int(generator.choice(pids.read_text().split()))
                try:
                    os.kill(victim, signal.SIGKILL)
                    lost += 1
                except ProcessLookupError:
                    pass
        print(f"workers killed: {lost}")
        check(place, whole, 0, points)


def run(place: Path, points: int, pids: str | None = None) -> subprocess.Popen:
    place.mkdir(exist_ok=True)
    program = f"from bench_sweep import study\nif __name__ == '__main__':\n    study({str(place)!r}, {points}, {pids!r})\n"  # noqa: E501
    script = place / "study.py"
    script.write_text(program)
    paths = os.pathsep.join(
        filter(None, (str(Path(__file__).parent), os.environ.get("PYTHONPATH")))
    )
    return subprocess.Popen([sys.executable, str(script)], env=os.environ | {"PYTHONPATH": paths})


def kept(place: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (place / "points").glob("*.h5")}


def check(place: Path, whole: Study, lost: int, points: int) -> None:
    found = read_study(place / "study.h5")
    same = all(found[name].tobytes() == whole[name].tobytes() for name in whole.values)
    print(f"{place.name}: {len(kept(place))} of {points} points kept, {lost} lost or changed; "
          f"equal bit for bit: {same and found.complete}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("section", choices=["throughput", "kills"])
    parser.add_argument("--sizes", type=int, nargs="+", default=[128, 256, 512])
    parser.add_argument("--points", type=int, default=200)
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    packages = ("graded_contact", "jax", "distributed")
    print(platform.machine(), os.cpu_count(), "cores;", *(f"{p} {version(p)}" for p in packages))
    if given.section == "throughput":
        throughput(given.sizes, given.points, given.workers)
    else:
        kills(given.kills, given.points, given.seed)


if __name__ == "__main__":
    main()
