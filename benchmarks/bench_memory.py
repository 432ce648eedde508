"""Estimated memory of a computation, compared with the peak of its process.

    python benchmarks/bench_memory.py [--sizes 1024 2048 4096] [--bits 64 32]

Every case is a separate process. It draws a random surface (`surface`), solves its contact with a
coated tread whose kernel is computed before (`contact`), slides it over that block (`slide`), at an
angle (`oblique`), or with the derivative by the block's thickness (`derivative`). Each case runs
twice: the first run compiles, which takes memory on any grid (`first`); the second loads compiled
code (`peak`). Both are the largest resident set size of `getrusage`, less that of the second run on
64 x 64 points, which contains the libraries. Peaks and estimates are in fields of the size of the
heights. The estimate is that of `graded_contact.core.memory` for the case, and for the surface and
the kernel that exist at the same time. A ratio (estimate over peak) below 1 is a fault; on small
grids the memory that libraries keep is visible.
"""

import argparse
import itertools
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
from importlib.metadata import version

CASES = ("surface", "contact", "slide", "oblique", "derivative")
BASE = 64  # points along a side of the case that is subtracted
MODES = 8  # of the smallest grid; the spectrum is the same on all
CELL = 8e-3  # m


def measure(case: str, size: int) -> dict[str, float]:
    """Peak and estimate [bytes] of a case in this process, which must be new."""
    import jax
    import numpy as np

    import graded_contact as gc
    from graded_contact.core import memory as _memory

    first = 2 * np.pi / CELL
    spectrum = gc.SelfAffine(
        rms_slope=0.3, hurst=0.8, q_low=first, q_roll=4 * first, q_high=MODES * first
    )
    coat = gc.Layer(gc.Elastic(6.5e6, 0.49), 50e-6)
    stack = gc.Stack(layers=(coat,), base=gc.HalfSpace(gc.tyre_tread()))
    grid, velocity = gc.Grid((size, size), CELL), (0.08, 0.06) if case == "oblique" else 0.1
    surface = gc.random_surface(spectrum, grid, jax.random.key(0))

    def friction(thickness):
        layer = gc.Layer(coat.material, thickness)
        block = gc.Stack(layers=(layer,), base=stack.base)
        return gc.slide(block, surface, pressure=4e5, velocity=0.1, rtol=1e-3).friction

    if case == "contact":
        kernel = gc.stack_kernel(stack, grid, velocity)
        done = gc.solve_contact(kernel, surface.heights, 4e5, rtol=1e-3)
    elif case == "derivative":
        done = jax.grad(friction)(coat.thickness)
    elif case == "surface":
        done = surface
    else:
        done = gc.slide(stack, surface, pressure=4e5, velocity=velocity, rtol=1e-3)
    jax.block_until_ready(done)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

    # Beside the solve there are the surface, and before a contact its kernel.
    fields = {
        "surface": _memory.SURFACE,
        "contact": _memory.CONTACT + 2,
        "derivative": _memory.SLIDING + 1 + _memory.DERIVATIVE,
    }.get(case, _memory.SLIDING + 1)
    return {
        "peak": peak,
        "estimate": _memory.memory_of(fields, grid.shape, grid.size.dtype.itemsize),
    }


def apart(case: str, size: int, bits: int, cache: str) -> dict[str, float]:
    """The same in a process of its own, with a folder for what is compiled."""
    # The largest size survives the start of another program, so this process stays small.
    environment = os.environ | {
        "JAX_ENABLE_X64": str(int(bits == 64)),
        "JAX_COMPILATION_CACHE_DIR": cache,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    command = [sys.executable, __file__, "--one", case, str(size)]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True)
    if ended.returncode:
        sys.exit(f"{case} on {size} x {size} points failed: {ended.stderr[-800:]}")
    return json.loads(ended.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[1024, 2048, 4096])
    parser.add_argument("--bits", type=int, nargs="+", default=[64, 32])
    parser.add_argument("--cases", nargs="+", default=CASES, choices=CASES)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one[0], int(options.one[1]))))
        return
    versions = ", ".join(f"{name} {version(name)}" for name in ("graded_contact", "jax", "jaxlib"))
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores; {versions}")
    print(f"{'case':10} {'bits':>4} {'points':>6} {'field [MB]':>10} {'first':>6} {'peak':>6} "
          f"{'estimate':>8} {'ratio':>6}")  # fmt: skip
    faults = 0
    for bits, case in itertools.product(options.bits, options.cases):
        with tempfile.TemporaryDirectory() as cache:
            base = [apart(case, BASE, bits, cache)["peak"] for _ in range(2)][1]
            for size in options.sizes:
                field = size**2 * bits / 8
                found = [apart(case, size, bits, cache) for _ in range(2)]
                first, peak = ((one["peak"] - base) / field for one in found)
                estimate = found[1]["estimate"] / field
                faults += estimate < peak
                print(f"{case:10} {bits:4} {size:6} {field / 1e6:10.1f} {first:6.2f} {peak:6.2f} "
                      f"{estimate:8.2f} {estimate / peak:6.2f}", flush=True)  # fmt: skip
    print(f"faults (estimates below the peak): {faults}")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
