"""The headline table of this commit, in about three minutes: `python -m benchmarks`.

Elastic contact beside Tamaas and ContactMechanics at equal true error (the extra `bench` has them),
friction with its gradient, kernels of layers, the total error against seconds, and first calls.
Nothing is stored: the site shows rows of the whole sections.
Single sections with other options: `bench_contact.py`, `bench_response.py`, `bench_fit.py`,
`bench_uncertainty.py`.
"""

import importlib.util
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
SECTIONS = {
    "Elastic contact at equal true error": (
        "bench_contact elastic --sizes 256 512 --targets 1e-4 --loads 0.01 0.1"
        " --mechanics-up-to 256 --tries 2 --repeat 3"
    ),
    "Friction and its gradient": (
        "bench_contact gradient --sizes 256 --bodies tread+coat --loads 0.1"
    ),
    "Kernels of layered blocks": (
        "bench_response speed --sizes 1024 --bodies 1_layer 3_layers graded --repeat 3"
    ),
    "Total error against seconds": (
        "bench_contact total --sizes 64 128 --finest 512 --numbers contact_area"
    ),
    "First calls": "bench_contact first --calls slide gradient total_error",
}
PEERS = ("tamaas", "ContactMechanics")


def main() -> None:
    """Runs each section in a process of its own."""
    missing = [name for name in PEERS if importlib.util.find_spec(name) is None]
    begun = spent()
    for title, section in SECTIONS.items():
        script, *options = section.split()
        if missing and title.startswith(("Elastic", "Total")):
            print(f"\n## {title}: left out, {', '.join(missing)} is not installed")
            continue
        print(f"\n## {title}", flush=True)
        before = spent()
        command = [sys.executable, FOLDER / f"{script}.py", *options]
        subprocess.run(command, check=True, env={**os.environ, "GRADED_CONTACT_ONLY_PRINT": "1"})
        print("# {:.0f} s, {:.0f} s of a core".format(*spent() - before))
    print("\n{:.0f} s, {:.0f} s of a core".format(*spent() - begun))


def spent() -> np.ndarray:
    """Returns the time, and the time of all cores in the processes that ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([time.perf_counter(), used.ru_utime + used.ru_stime])


if __name__ == "__main__":
    main()
