"""What kills leave of a run: nothing finished is lost, and the end is the same bit for bit.

    python benchmarks/bench_kills.py [--kills 20] [--seed 0] [--grid 128] [--points 60]

A scene runs once undisturbed. Then `graded-contact run` starts again and again in another folder,
and each time is ended at a random moment by SIGKILL, SIGINT or SIGTERM, in turn, until the kills
are used up; the last start is left alone. A moment is drawn between the start of the process and
the time that the rest of the points would take, so that kills fall into importing, compiling,
solving and writing. The table says for each kill when it came, how many points were on the disk
before and after, how many of those that were there before are unchanged, and how the process ended;
the last lines compare the collected file with the undisturbed one. A kill within the first seconds
of a process meets Python while it imports, which then ends as any program.
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

import numpy as np

from graded_contact.studies.storage import AXES, FIELDS, OBSERVABLES, TEXTS, Results, read_results

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
# How a process may end, 0 if it was done before the signal.
ENDS = {number: (0, -number, 128 + number) for number in SIGNALS}
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


def start(scene: Path, folder: Path) -> subprocess.Popen:
    """The command on a scene, in a process of its own."""
    command = [sys.executable, "-m", "graded_contact", "run", str(scene), "-o", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def finished(folder: Path) -> dict[str, bytes]:
    """The points on the disk, by name."""
    return {path.name: path.read_bytes() for path in (folder / "scene.points").glob("*.h5")}


def different(one: Results, other: Results) -> list[str]:
    """Names of what differs between two results, by a single bit."""
    names = [
        name for name in (*AXES, *OBSERVABLES)
        if getattr(one, name).tobytes() != getattr(other, name).tobytes()
    ]  # fmt: skip
    names += [name for name in TEXTS if np.any(getattr(one, name) != getattr(other, name))]
    names += ["attributes"] * (one.attributes != other.attributes)
    if one.fields.keys() != other.fields.keys():
        return [*names, "fields"]
    for index, fields in one.fields.items():
        names += [
            f"{name} of {index}" for name in FIELDS
            if getattr(fields, name).tobytes() != getattr(other.fields[index], name).tobytes()
        ]  # fmt: skip
    return names


def killed(scene: Path, folder: Path, number: int, moment: float, at_point: bool) -> dict:
    """Starts the command, sends a signal, and says what came of it.

    The moment counts from the start, or (`at_point`) from the first point that is kept.
    """
    before = finished(folder)
    begin, process = time.monotonic(), start(scene, folder)
    while at_point and process.poll() is None and len(finished(folder)) == len(before):
        time.sleep(0.005)
    time.sleep(moment)
    came = time.monotonic() - begin
    process.send_signal(number)
    errors = process.communicate()[1]
    after = finished(folder)
    return {
        "seconds": came,
        "before": len(before),
        "after": len(after),
        "unchanged": sum(after.get(name) == content for name, content in before.items()),
        "ended": process.returncode,
        "importing": "importlib" in errors,
        "traceback": "Traceback" in errors,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--grid", type=int, default=128)
    parser.add_argument("--points", type=int, default=60)
    options = parser.parse_args()
    draw = np.random.default_rng(options.seed)
    versions = ", ".join(f"{name} {version(name)}" for name in ("graded_contact", "jax", "h5py"))
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores; {versions}")
    with tempfile.TemporaryDirectory() as place:
        scene, folder = Path(place) / "scene.toml", Path(place) / "killed"
        scene.write_text(SCENE.format(grid=options.grid, points=options.points))
        begin = time.monotonic()
        if start(scene, Path(place) / "whole").wait() != 0:
            sys.exit("the undisturbed run failed")
        print(f"undisturbed: {time.monotonic() - begin:.1f} s, {options.points} points")
        print(f"{'kill':>4} {'signal':8} {'at [s]':>7} {'before':>6} {'after':>6} "
              f"{'unchanged':>9} {'exit':>5}  traceback")  # fmt: skip
        faults = 0
        for i in range(options.kills):
            number = SIGNALS[i % len(SIGNALS)]
            # One in four anywhere from the start; the others while points are being made.
            at_point = bool(draw.random() > 0.25)
            moment = draw.exponential(0.3) if at_point else draw.uniform(0, 6)
            row = killed(scene, folder, number, moment, at_point)
            lost = row["before"] - row["unchanged"]
            faults += lost
            if not row["importing"]:  # Python has not begun the command: it ends as any program
                faults += row["traceback"] + (row["ended"] not in ENDS[number])
            note = "importing" if row["importing"] else "yes" if row["traceback"] else "no"
            print(f"{i + 1:4} {number.name:8} {row['seconds']:7.2f} {row['before']:6} "
                  f"{row['after']:6} {row['unchanged']:9} {row['ended']:5}  "
                  f"{note}", flush=True)  # fmt: skip
        before = finished(folder)
        code = start(scene, folder).wait()
        after = finished(folder)
        same = sum(after[name] == content for name, content in before.items())
        print(f"left alone: exit {code}, {len(before)} points found, {same} unchanged, "
              f"{len(after)} at the end")  # fmt: skip
        results = [read_results(Path(place) / at / "scene.h5") for at in ("whole", "killed")]
        names = different(*results)
        leftovers = [str(path.relative_to(folder)) for path in folder.rglob(".*.partial")]
        print(f"differs from the undisturbed result in: {', '.join(names) or 'nothing'}")
        print(f"left by killed writers: {', '.join(leftovers) or 'nothing'}")
        print(f"faults (points lost, tracebacks, crashes): {faults}")
    if names or faults or code:
        sys.exit(1)


if __name__ == "__main__":
    main()
