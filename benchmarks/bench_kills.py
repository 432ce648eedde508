"""Runs that are killed, and sweeps that are interrupted: what remains, and how they end.

python benchmarks/bench_kills.py kills        SIGKILL at random times; the results byte by byte
python benchmarks/bench_kills.py interrupts   Ctrl-C while a Python sweep compiles and solves
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from rows import goal, run

SCENE = """
title = "a run that is killed"
[surface]
kind = "self_affine"
rms_slope = 0.2
hurst = 0.8
q_roll = 2e4
q_high = 8e4
[grid]
shape = [32, 32]
size = 1e-3
[materials.tread]
kind = "tyre_tread"
[base]
kind = "half_space"
material = "tread"
[load]
pressure = [1e5, 2e5]
velocity = {from = 1e-3, to = 1.0, points = 15}
"""
SWEEP = """
import jax, numpy as np, graded_contact as gc
jax.config.update("jax_enable_x64", True)
spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=1e3, q_roll=4e3, q_high=1.6e4)
road = gc.random_surface(spectrum, gc.Grid((64, 64), 6.3e-3), jax.random.key(0))
block = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))
friction = lambda p: gc.slide(block, road, pressure=4e5, velocity=p["velocity"]).friction
print("ready", flush=True)
found = gc.sweep(friction, {"velocity": np.geomspace(1e-3, 1, 400)})
print(int(np.isfinite(found["value"]).sum()), flush=True)
"""


def kills(count=40, seed=0):
    """Kills `graded-contact run` and starts it again, `count` times; compares with a whole run."""
    random.seed(seed)
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.toml"
        scene.write_text(SCENE, encoding="utf-8")

        def start(name):
            command = ["run", str(scene), "-o", str(Path(folder) / name)]
            return subprocess.Popen(
                [sys.executable, "-m", "graded_contact", *command],
                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            )  # fmt: skip

        begun = time.perf_counter()
        _, error = start("whole").communicate()
        whole = time.perf_counter() - begun
        print(f"# a whole run takes {whole:.1f} s {error.strip()[-300:]}", flush=True)
        killed = finished = 0
        while killed < count:
            process = start("killed")
            time.sleep(random.uniform(0.3, 0.8) * whole)
            if process.poll() is None:
                process.send_signal(signal.SIGKILL)
                killed += 1
            else:  # the next one starts from nothing
                finished += check(folder)
                for path in (Path(folder) / "killed").rglob("*"):
                    if path.is_file():
                        path.unlink()
            process.communicate()
        start("killed").communicate()
        finished += check(folder)
        goal("byte-equal after kills", f"{killed} kills, {finished} finished runs, all byte-equal")


def check(folder):
    """1 if the killed run gave the bytes of the whole one; else it stops here."""
    files = [Path(folder) / name / "scene.h5" for name in ("whole", "killed")]
    one, other = (path.read_bytes() for path in files)
    assert one == other, "the results differ"
    return 1


def interrupts(count=40, seed=0, longest=4.0):
    """Sends Ctrl-C to a Python sweep at random times, up to `longest` seconds after its start."""
    random.seed(seed)
    ends = Counter()
    for _ in range(count):
        process = subprocess.Popen(
            [sys.executable, "-c", SWEEP], env=os.environ, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        process.stdout.readline()
        time.sleep(random.uniform(0, longest))
        process.send_signal(signal.SIGINT)
        out, error = process.communicate()
        solved = "nothing returned" if not out.strip() else "results returned"
        ends[process.returncode, solved, "ignored" in error.lower()] += 1
    for (code, solved, ignored), number in sorted(ends.items()):
        print(f"exit {code:4d}  {solved:18s} ignored: {ignored}  {number}")
    bad = sum(n for (code, _, ignored), n in ends.items() if code not in (0, -2, 1) or ignored)
    goal("no crash, no Ctrl-C ignored", f"{bad} of {count}")


if __name__ == "__main__":
    run(__doc__, kills, interrupts)
