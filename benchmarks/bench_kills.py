"""What kills leave of a long job: nothing finished is lost, and the end is the same byte for byte.

    python benchmarks/bench_kills.py run [--kills 20] [--seed 0] [--grid 128] [--points 60]
    python benchmarks/bench_kills.py design [--kills 10] [--seed 0]
    python benchmarks/bench_kills.py sweep [--kills 20] [--seed 0] [--grid 256] [--points 200]

A job runs once undisturbed. Then it is started many times in another folder and ended by a signal:
SIGKILL, SIGINT (Ctrl-C) or SIGTERM in turn; a `sweep` by SIGKILL. One signal in four comes at a
random time after the start, while Python imports or JAX compiles. The others come a little after a
random number of new points (evaluations, surfaces) is in the store. The table prints how much was
stored before and after, how much of that is lost or changed, and how the process ended. The last
start runs to its end. Then the files of results are compared with the undisturbed ones byte for
byte. At last two processes start at once in one folder: one may be refused.

`sweep` is the function `gc.sweep` in a script. Its workers are killed, too, and the disk is full
for a while.
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
from typing import NamedTuple

# Transforms by one thread each give the same bits in any process.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import numpy as np
import psutil

SCENE = """
title = "to be killed"
[surface]
kind = "self_affine"
rms_slope = 0.2
hurst = 0.8
q_roll = 2e4
q_high = 8e4
[grid]
shape = [{grid}, {grid}]
size = 1e-3
[materials.tread]
kind = "tyre_tread"
[base]
kind = "half_space"
material = "tread"
[load]
pressure = 2e5
velocity = {{from = 0.01, to = 1.0, points = {points}}}
"""
DESIGN = """
title = "to be killed"
[surface]
kind = "self_affine"
rms_slope = 0.1
hurst = 0.8
q_roll = 2.5e3
q_high = 5e3
[grid]
shape = [32, 32]
size = 1e-2
[materials.tread]
kind = "tyre_tread"
poisson = 0.49
[materials.coat]
kind = "prony"
equilibrium = 5e6
strengths = [5e6, 1e7]
times = [1e-2, 1e-4]
poisson = 0.49
[[layers]]
material = "coat"
thickness = 2e-4
[base]
kind = "half_space"
material = "tread"
[load]
pressure = 3e5
velocity = 0.1
[solver]
rtol = 1e-5
[design]
objective = "friction"
ratio = 1.3
stiffness = {q = 2.5e3, omega = 250.0, within = 0.01}
total_thickness = 5e-4
starts = 8
verify = 2
polish = true
[design.parameters]
"layers[0].thickness" = [5e-5, 1e-3]
"layers[0].material.equilibrium" = [1e6, 2e7]
"layers[0].material.strengths[0]" = [1e6, 1e8]
"layers[0].material.times[0]" = [1e-4, 1e-1]
"""


class Job(NamedTuple):
    """What is killed.

    **Fields:**

    - `arguments`: of Python, without the folder of the results.
    - `files`: of the results.
    - `store`: the folder of finished points.
    - `signals`: that end it.
    """

    arguments: list[str]
    files: tuple[str, ...]
    store: str
    signals: tuple[signal.Signals, ...] = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)

    def start(self, folder: Path, *options: str) -> subprocess.Popen:
        folder.mkdir(exist_ok=True)
        command = [sys.executable, *self.arguments, str(folder), *options]
        return subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )

    def stored(self, folder: Path) -> set[bytes]:
        """The finished points, evaluations and surfaces on the disk."""
        found = set()
        for path in (folder / self.store).glob("[!.]*"):
            if path.name != "lock":
                found.add(path.name.encode() + path.read_bytes())
        return found

    def different(self, one: Path, other: Path) -> list[str]:
        """Names of the files of results that differ."""
        return [n for n in self.files if (one / n).read_bytes() != (other / n).read_bytes()]


def ended(process: subprocess.Popen) -> tuple[int, str]:
    """How a process ended, and the last line that it wrote."""
    lines = process.communicate()[1].strip().splitlines()
    return process.returncode, lines[-1] if lines else ""


def kills(job: Job, place: Path, count: int, draw: np.random.Generator) -> int:
    """Kills a job many times; returns the number of faults."""
    whole, folder, begin = place / "whole", place / "killed", time.monotonic()
    code, line = ended(job.start(whole))
    took, total = time.monotonic() - begin, len(job.stored(whole))
    print(f"undisturbed: exit {code} {line}, {took:.1f} s; stored: {total}")
    print(
        f"{'kill':>4} {'signal':8} {'at [s]':>7} {'before':>6} {'after':>6} {'lost':>4} {'exit':>5}"
    )
    faults = 0
    for i in range(count):
        number, before = job.signals[i % len(job.signals)], job.stored(folder)
        begin, process = time.monotonic(), job.start(folder)
        if draw.random() < 0.25:
            time.sleep(draw.uniform(0, took))
        else:
            least = len(before) + draw.integers(1, max(2, 2 * (total - len(before)) // (count - i)))
            while process.poll() is None and len(job.stored(folder)) < least:
                time.sleep(0.005)
            time.sleep(draw.exponential(0.02))
        came = time.monotonic() - begin
        process.send_signal(number)
        errors = process.communicate()[1]
        after, end = job.stored(folder), process.returncode
        lost = len(before - after)
        faults += lost
        # Python that still imports ends as any program.
        if "<frozen " not in errors:
            faults += "Traceback" in errors or end not in (code, -number, 128 + number)
        print(f"{i + 1:4} {number.name:8} {came:7.2f} {len(before):6} {len(after):6} {lost:4} "
              f"{end:5}", flush=True)  # fmt: skip
    return faults + finished(job, whole, folder, f"{count} kills")


def finished(job: Job, whole: Path, folder: Path, what: str) -> int:
    """Runs a job to its end; returns the number of faults."""
    before, undisturbed = job.stored(folder), job.stored(whole)
    code, line = ended(job.start(folder))
    after, names = job.stored(folder), job.different(whole, folder)
    lost, left = len(before - after), [*folder.rglob(".*.partial")]
    print(f"{what}, then left alone: exit {code} {line}; {len(before)} found, {lost} of them lost; "
          f"store {'the same' if after == undisturbed else 'differs'}, "
          f"results differ in {', '.join(names) or 'nothing'}", flush=True)  # fmt: skip
    return lost + len(names) + len(left) + (after != undisturbed)


def two_at_once(job: Job, place: Path) -> int:
    """Starts a job twice in one folder; returns the number of faults."""
    folder, faults = place / "both", 0
    for code, line in [ended(one) for one in [job.start(folder), job.start(folder)]]:
        print(f"two at once: exit {code} {line}")
        faults += code != 0 and "is being written by another process" not in line
    return faults + len(job.different(place / "whole", folder))


def workers_killed(job: Job, place: Path, count: int, draw: np.random.Generator) -> int:
    """Kills workers of a sweep, each after new points; returns the number of faults."""
    folder, number, seen = place / "workers", 0, 0
    process = job.start(folder, "--workers", "2")
    while process.poll() is None:
        time.sleep(draw.uniform(0, 1))
        if number == count or len(job.stored(folder)) == seen:
            continue
        seen = len(job.stored(folder))
        with contextlib.suppress(psutil.NoSuchProcess, IndexError):
            children = psutil.Process(process.pid).children()
            workers = [c for c in children if any("spawn_main" in word for word in c.cmdline())]
            workers[draw.integers(len(workers))].kill()
            number += 1
    process.communicate()
    return finished(job, place / "whole", folder, f"{number} kills of workers")


def full_disk(job: Job, place: Path, points: int) -> int:
    """Fills the disk when half of the points are stored; returns the number of faults."""
    print("full disk:", ended(job.start(place / "full", "--full-after", str(points // 2)))[1])
    return finished(job, place / "whole", place / "full", "full disk")


def study(folder: Path, size: int, points: int, workers: int | None, full_after: int) -> None:
    """The process of a sweep."""
    import jax
    from bench_sweep import axes_of, contact, surface_of

    import graded_contact as gc
    from graded_contact.files.dataset import write

    jax.config.update("jax_enable_x64", True)

    def fill(done, _):
        if done >= full_after:  # no file can grow beyond a byte, as on a full disk
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))

    rub = contact(surface_of(size), gc.tyre_tread())
    found = gc.sweep(rub, axes_of(points), store=folder / "points", workers=workers, progress=fill)
    write(folder / "study.h5", found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("section", choices=["run", "design", "sweep", "study"])
    parser.add_argument("folder", nargs="?", type=Path, help="of `study`, which `sweep` starts")
    parser.add_argument("--kills", type=int, help="10 of `design`, 20 of the others")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--grid", type=int, help="256 of `sweep`, 128 of `run`")
    parser.add_argument("--points", type=int, help="200 of `sweep`, 60 of `run`")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--full-after", type=int, default=2**31)
    given = parser.parse_args()
    sweeps = given.section in ("sweep", "study")
    grid, points = given.grid or (256 if sweeps else 128), given.points or (200 if sweeps else 60)
    if given.section == "study":
        return study(given.folder, grid, points, given.workers, given.full_after)
    versions = ", ".join(f"{name} {version(name)}" for name in ("graded_contact", "jax", "h5py"))
    print(f"{platform.machine()}, {os.cpu_count()} cores; {versions}")
    count, draw = (
        given.kills or (10 if given.section == "design" else 20),
        np.random.default_rng(given.seed),
    )
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        scene = place / "scene.toml"
        command = ["-m", "graded_contact", given.section, str(scene), "-o"]
        if given.section == "run":
            scene.write_text(SCENE.format(grid=grid, points=points))
            job = Job(command, ("scene.h5", "scene.csv"), "scene.points")
        elif given.section == "design":
            scene.write_text(DESIGN)
            job = Job(command, ("scene-design.json", "scene-design.txt"), "scene-design.points")
        else:
            script = [__file__, "--grid", str(grid), "--points", str(points), "study"]
            job = Job(script, ("study.h5",), "points", (signal.SIGKILL,))
        faults = kills(job, place, count, draw)
        if given.section != "design":
            faults += two_at_once(job, place)
        if sweeps:
            faults += workers_killed(job, place, count // 2, draw) + full_disk(job, place, points)
    print(f"faults: {faults}")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
