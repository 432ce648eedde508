"""Memory: estimates before anything is allocated, and what a process keeps for its next fields.

Each kind of solve takes a number of fields as large as the heights, and the compiler the same
amount for every grid. The numbers are upper limits of what was measured in double and single
precision: `benchmarks/bench_memory.py` compares them with the peaks of whole processes.
"""

import ctypes
import math
import os
import platform
from pathlib import Path

import jax

SURFACE = 7.0  # fields of drawing or transforming a surface
KERNEL = 2.0
CONTACT = 20.0
SLIDING = 24.0  # a kernel, a contact with it, and its total error
CYCLE = 42.0  # fields over space and time
CYCLE_COUNTERFACE = 8.0  # more for a counterface: its kernel, and the displacement that lags
DERIVATIVE = 20.0  # more for a derivative
COMPILER = 8e8  # bytes of compiling, which are not freed
POINT = 8000  # bytes of a sweep's point, most of it in the printed table
SMALL = 2**30  # bytes below which nothing is checked
KEPT = 1.6  # times the fields of a solve, in a process that keeps freed memory
KEPT_BELOW = 2**29 - 1  # bytes of a field; a larger one, as of 8192² points, is returned
# Numbers of `mallopt` in glibc: M_TRIM_THRESHOLD, M_MMAP_THRESHOLD and M_ARENA_MAX.
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
_process = {"keeps": False}


def keep_freed_memory() -> bool:
    """Makes large solves on a CPU faster: this process keeps freed memory for its next fields.

    The C library of Linux (glibc) returns large blocks to the system and asks for each page again.
    If it keeps blocks of less than 512 MiB, a solve of 1024² to 4096² points takes 14 to 28 % less
    time and up to 1.6 times the memory. Other grids gain nothing, and one large `jit` compiles
    15 % slower. Call the function at the start of a program, before JAX computes anything: later it
    has less effect. `graded-contact` calls it.

    **Returns:** whether the C library is glibc; elsewhere nothing changes.
    """
    if platform.libc_ver()[0] != "glibc":
        return False
    library = ctypes.CDLL(None)
    options = {_TRIM_THRESHOLD: 2**30, _MMAP_THRESHOLD: KEPT_BELOW, _ARENA_MAX: 1}
    for option, value in options.items():
        library.mallopt(option, value)
    _process["keeps"] = True
    return True


def return_freed_memory() -> None:
    """Returns freed memory to the system, also in a process that keeps it for its next fields."""
    if platform.libc_ver()[0] == "glibc":
        ctypes.CDLL(None).malloc_trim(0)


def memory_of(fields: float, shape: tuple[int, ...], itemsize: int = 8) -> float:
    """Returns the bytes of a solve that takes so many fields of a shape."""
    field = math.prod(shape) * itemsize
    kept = KEPT if _process["keeps"] and field < KEPT_BELOW else 1
    return COMPILER + kept * fields * field


def check_memory(name: str, purpose: str, fields: float, shape, itemsize=8, devices=1) -> None:
    """Raises `ValueError` if a solve needs more memory than is free, and names a grid that fits.

    **Arguments:**

    - `name`: of the argument that has the shape.
    - `purpose`: what needs the memory, for the message.
    - `fields`: that the solve takes, such as `CONTACT`.
    - `shape`, `itemsize`: of a field.
    - `devices`: over how many the grid lies. Those of a CPU share the memory of their process.
    """
    needed = memory_of(fields, shape, itemsize)
    free = available_memory() if needed >= SMALL else None
    if free is None:
        return
    if devices > 1:
        free *= jax.process_count() if jax.default_backend() == "cpu" else devices
    if needed > free:
        sides = ((2**k,) * len(shape) for k in range(30, 1, -1))
        fit = next((side for side in sides if memory_of(fields, side, itemsize) <= free), None)
        raise ValueError(
            f"`{name}` is refused: {purpose} of {_times(shape)} points takes about "
            f"{in_gigabytes(needed)} of memory, and {in_gigabytes(free)} are free. "
            f"{'None' if fit is None else f'One of {_times(fit)}'} would fit."
        )


def check_points(name: str, count: int) -> None:
    """Raises `ValueError` if a sweep of so many points needs more memory than there is."""
    free = available_memory() if count * POINT >= SMALL else None
    if free is not None and count * POINT > free:
        raise ValueError(
            f"`{name}` is refused: {count} points of a sweep take about "
            f"{in_gigabytes(count * POINT)} of memory. {int(free // POINT)} would fit."
        )


def in_gigabytes(size: float) -> str:
    """Returns a number of bytes as text."""
    return f"{size / 1e9:.2g} GB" if size < 1e10 else f"{size / 1e9:.0f} GB"


def available_memory() -> float | None:
    """Returns the free memory [bytes] of the device of JAX, or None if unknown."""
    if jax.default_backend() != "cpu":
        known = jax.local_devices()[0].memory_stats() or {}
        most = known.get("bytes_limit")
        return None if most is None else most - known.get("bytes_in_use", 0)
    known = [*_of_machine(), *_of_groups()]
    return max(min(known), 0) if known else None


def _of_machine() -> list[float]:
    """Free bytes of the machine; on other systems than Linux, all bytes."""
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            return [int(line.split()[1]) * 1024]
    try:
        return [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    except (AttributeError, OSError, ValueError):
        return []


def _of_groups() -> list[float]:
    """Free bytes of the control groups of this process (containers, batch systems)."""
    found = []
    for line in _lines("/proc/self/cgroup"):
        _, controllers, group = line.split(":", 2)
        root, names = "/sys/fs/cgroup", ("memory.max", "memory.current", "inactive_file")
        if "memory" in controllers.split(","):  # the first version
            root = "/sys/fs/cgroup/memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        elif controllers:
            continue
        # In a container the group's own path may not be visible, its root is.
        place = Path(root + group)
        for folder in (place, *place.parents):
            # A group without a limit has the word "max"; a parent may have one all the same.
            limit, used = (_lines(folder / name) for name in names[:2])
            if limit and used and limit[0].isdigit():
                # The kernel frees inactive pages of files on demand.
                rows = map(str.split, _lines(folder / "memory.stat"))
                cached = sum(int(row[1]) for row in rows if row[0] == names[2])
                found.append(int(limit[0]) - int(used[0]) + cached)
    return found


def _lines(path: str | Path) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
