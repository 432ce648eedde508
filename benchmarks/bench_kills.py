"""What kills leave of a run: nothing finished is lost, and the end is the same bit for bit.

    python benchmarks/bench_kills.py run [--kills 20] [--seed 0] [--grid 128] [--points 60]
    python benchmarks/bench_kills.py design [--kills 10] [--seed 0]

`run`: a scene runs once undisturbed. Then `graded-contact run` starts again and again in another
folder, and each time is ended at a random moment by SIGKILL, SIGINT or SIGTERM, in turn, until the
kills are used up; the last start is left alone. A moment is drawn between the start of the process
and the time that the rest of the points would take, so that kills fall into importing, compiling,
solving and writing. The table says for each kill when it came, how many points were on the disk
before and after, how many of those that were there before are unchanged, and how the process ended;
then the collected file is compared with the undisturbed one. A kill within the first seconds of a
process meets Python while it imports, which then ends as any program. At last two commands are
started at once on one folder: one may be refused, nothing else, and the file must be the same.

`design`: a design of a coat, searched from several starts, polished and verified by contact, runs
once undisturbed, which tells how many evaluations and surfaces it keeps. As many of these numbers
as there are kills are drawn; each start is ended by SIGINT or SIGKILL, in turn, a random while
after the next of them is on the disk and at least one of its own: in the search, the polish or the
verification. At the end parameters and report are compared with the undisturbed ones bit for bit,
and every evaluation and surface. After SIGINT the process must end with 130.
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

from graded_contact.files.results import Results, read_results

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
KEPT = {"mean-field": "search", "polish": "polish"}  # what a file of evaluations is of


def start(scene: Path, folder: Path, verb: str = "run") -> subprocess.Popen:
    """The command on a scene, in a process of its own."""
    command = [sys.executable, "-m", "graded_contact", verb, str(scene), "-o", str(folder)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def finished(folder: Path) -> dict[str, bytes]:
    """The points on the disk, by name."""
    return {path.name: path.read_bytes() for path in (folder / "scene.points").glob("*.h5")}


def different(one: Results, other: Results) -> list[str]:
    """Names of what differs between two results, by a single bit."""
    quantities = (*one.study.axes, *one.study.values)
    names = [name for name in quantities if one[name].tobytes() != other[name].tobytes()]
    names += ["message"] * bool(np.any(one.message != other.message))
    names += ["point"] * bool(np.any(one.point != other.point))
    names += ["attributes"] * (one.attributes != other.attributes)
    if one.fields.keys() != other.fields.keys():
        return [*names, "fields"]
    for index, fields in one.fields.items():
        names += [
            f"{name} of {index}" for name in ("pressure", "gap", "displacement")
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
        "importing": "<frozen importlib" in errors or "<frozen site" in errors,
        "traceback": "Traceback" in errors,
    }


def run(place: Path, num_kills: int, draw: np.random.Generator, grid: int, points: int) -> int:
    """The section `run`; returns the number of faults."""
    scene, folder = place / "scene.toml", place / "killed"
    scene.write_text(SCENE.format(grid=grid, points=points))
    begin = time.monotonic()
    if start(scene, place / "whole").wait() != 0:
        sys.exit("the undisturbed run failed")
    print(f"undisturbed: {time.monotonic() - begin:.1f} s, {points} points")
    print(f"{'kill':>4} {'signal':8} {'at [s]':>7} {'before':>6} {'after':>6} "
          f"{'unchanged':>9} {'exit':>5}  traceback")  # fmt: skip
    faults = 0
    for i in range(num_kills):
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
    results = [read_results(place / at / "scene.h5") for at in ("whole", "killed")]
    names = different(*results)
    leftovers = [str(path.relative_to(folder)) for path in folder.rglob(".*.partial")]
    print(f"differs from the undisturbed result in: {', '.join(names) or 'nothing'}")
    print(f"left by killed writers: {', '.join(leftovers) or 'nothing'}")
    print(f"faults (points lost, tracebacks, crashes): {faults}")
    return faults + len(names) + (code != 0) + two_at_once(scene, place / "both", results[0])


def two_at_once(scene: Path, folder: Path, whole: Results) -> int:
    """Starts the command twice on one folder; returns the number of faults."""
    both = [start(scene, folder) for _ in range(2)]
    errors = [process.communicate()[1] for process in both]
    refused = ["is being written by another process" in text for text in errors]
    for process, text, was in zip(both, errors, refused, strict=True):
        print(f"two at once: exit {process.returncode}, {text.splitlines()[-1] if was else 'done'}")
    ends = [process.returncode for process in both]
    names = different(whole, read_results(folder / "scene.h5"))
    print(f"differs from the undisturbed result in: {', '.join(names) or 'nothing'}")
    return len(names) + (ends != [2 * was for was in refused])


def kept(folder: Path) -> dict[str, list[bytes]]:
    """What a design has on the disk: whole lines of evaluations, and surfaces, by their stage."""
    found = {"search": [], "polish": [], "surfaces": []}
    for path in sorted((folder / "scene-design.points").glob("[!.]*")):
        if path.suffix == ".jsonl":
            lines = path.read_bytes().split(b"\n")[1:-1]  # neither the head nor what is half
            found[KEPT[path.stem.rpartition("-")[0]]] += lines
        elif path.suffix == ".h5":
            found["surfaces"].append(path.name.encode() + path.read_bytes())
    return found


def size(found: dict[str, list[bytes]]) -> int:
    return sum(map(len, found.values()))


def num_lost(before: dict[str, list[bytes]], after: dict[str, list[bytes]]) -> int:
    return sum(len(set(part) - set(after[stage])) for stage, part in before.items())


def design(place: Path, num_kills: int, draw: np.random.Generator) -> int:
    """The section `design`; returns the number of faults."""
    scene, whole, folder = place / "scene.toml", place / "whole", place / "killed"
    scene.write_text(DESIGN)
    begin, process = time.monotonic(), start(scene, whole, "design")
    process.communicate()
    wanted, undisturbed = kept(whole), process.returncode
    counts = ", ".join(f"{stage} {len(part)}" for stage, part in wanted.items())
    print(f"undisturbed: exit {undisturbed}, {time.monotonic() - begin:.1f} s; kept: {counts}")
    print(f"{'kill':>4} {'signal':8} {'at [s]':>7} {'before':>6} {'after':>6}  "
          f"{'  '.join(wanted)}  {'lost':>4} {'exit':>5}  traceback")  # fmt: skip
    moments = np.sort(draw.choice(np.arange(1, size(wanted)), num_kills, replace=False))
    faults = 0
    for i, moment in enumerate(moments):
        number = (signal.SIGINT, signal.SIGKILL)[i % 2]
        before = kept(folder)
        least = max(moment, size(before) + 1)
        begin, process = time.monotonic(), start(scene, folder, "design")
        while process.poll() is None and size(kept(folder)) < least:
            time.sleep(0.002)
        time.sleep(draw.exponential(0.02))
        came = time.monotonic() - begin
        process.send_signal(number)
        errors = process.communicate()[1]
        after = kept(folder)
        missing = num_lost(before, after)
        expected = 130 if number == signal.SIGINT else -signal.SIGKILL
        faults += missing + ("Traceback" in errors) + (process.returncode != expected)
        parts = "  ".join(f"{len(part):{len(stage)}}" for stage, part in after.items())
        print(f"{i + 1:4} {number.name:8} {came:7.2f} {size(before):6} {size(after):6}  {parts}  "
              f"{missing:4} {process.returncode:5}  "
              f"{'yes' if 'Traceback' in errors else 'no'}", flush=True)  # fmt: skip
    before, process = kept(folder), start(scene, folder, "design")
    process.communicate()
    after = kept(folder)
    print(f"left alone: exit {process.returncode}, {size(before)} found, {size(after)} at the end")
    names = [
        name for name in ("scene-design.json", "scene-design.txt")
        if (folder / name).read_bytes() != (whole / name).read_bytes()
    ]  # fmt: skip
    names += [stage for stage in wanted if set(wanted[stage]) != set(after[stage])]
    print(f"differs from the undisturbed result in: {', '.join(names) or 'nothing'}")
    faults += num_lost(before, after) + (process.returncode != undisturbed)
    print(f"faults (of what was kept lost, tracebacks, other exits): {faults}")
    return faults + len(names)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("section", choices=["run", "design"])
    parser.add_argument("--kills", type=int, help="20 of `run`, 10 of `design`")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--grid", type=int, default=128)
    parser.add_argument("--points", type=int, default=60)
    options = parser.parse_args()
    draw = np.random.default_rng(options.seed)
    versions = ", ".join(f"{name} {version(name)}" for name in ("graded_contact", "jax", "h5py"))
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores; {versions}")
    with tempfile.TemporaryDirectory() as place:
        if options.section == "run":
            kills = options.kills or 20
            faults = run(Path(place), kills, draw, options.grid, options.points)
        else:
            faults = design(Path(place), options.kills or 10, draw)
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
