"""Memory: estimates before anything is allocated, and freed memory that a process keeps.

Each kind of solve takes a number of fields as large as the heights, and the compiler the same
amount for every grid. The numbers are upper limits of the peaks of whole processes that were
measured, in double and single precision.
"""

import ctypes
import math
import platform
from pathlib import Path

import jax

CONTACT = 20.0
SLIDING = 24.0  # a kernel, a contact with it, and its total error
CYCLE = 42.0  # fields over space and time
CYCLE_COUNTERFACE = 8.0  # more for a counterface: its kernel, and the displacement that lags
COMPILER = 8e8  # bytes of compiling, which are not freed
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


def check_memory(name: str, purpose: str, fields: float, shape, itemsize=8, devices=1) -> None:
    """Raises `ValueError` if a solve needs more memory than is free.

    **Arguments:**

    - `name`: of the argument that has the shape.
    - `purpose`: what needs the memory, for the message.
    - `fields`: that the solve takes, such as `CONTACT`.
    - `shape`, `itemsize`: of a field.
    - `devices`: over how many the grid lies. Those of a CPU share the memory of their process.
    """
    field = math.prod(shape) * itemsize
    kept = KEPT if _process["keeps"] and field < KEPT_BELOW else 1
    needed = COMPILER + kept * fields * field
    free = available_memory() if needed >= SMALL else None
    if free is None:
        return
    if devices > 1:
        free *= jax.process_count() if jax.default_backend() == "cpu" else devices
    if needed > free:
        raise ValueError(
            f"`{name}` is refused: {purpose} of {' x '.join(map(str, shape))} points takes about "
            f"{needed / 1e9:.3g} GB of memory, and {free / 1e9:.3g} GB are free."
        )


def available_memory() -> float | None:
    """Returns the free memory [bytes] of the device of JAX, or None if unknown."""
    if jax.default_backend() != "cpu":
        known = jax.local_devices()[0].memory_stats() or {}
        most = known.get("bytes_limit")
        return None if most is None else most - known.get("bytes_in_use", 0)
    return free_memory()


def free_memory() -> float | None:
    """Returns the free memory [bytes] of this process, or None if unknown."""
    known = [*_of_machine(), *_of_groups()]
    return max(min(known), 0) if known else None


def _of_machine() -> list[float]:
    """Free bytes of the machine; of Linux alone."""
    rows = (line.split() for line in _lines("/proc/meminfo"))
    return [int(row[1]) * 1024 for row in rows if row[0] == "MemAvailable:"]


def _of_groups() -> list[float]:
    """Free bytes of the control groups of this process (containers, batch systems)."""
    found = []
    for line in _lines("/proc/self/cgroup"):
        # In a container the group's own path may not be visible, its root is.
        place = Path("/sys/fs/cgroup" + line.rpartition(":")[2])
        for folder in (place, *place.parents):
            limit, used = (_lines(folder / name) for name in ("memory.max", "memory.current"))
            # A group without a limit has the word "max"; a parent may have one all the same.
            if limit and used and limit[0].isdigit():
                # The kernel frees inactive pages of files on demand.
                rows = map(str.split, _lines(folder / "memory.stat"))
                cached = sum(int(row[1]) for row in rows if row[0] == "inactive_file")
                found.append(int(limit[0]) - int(used[0]) + cached)
    return found


def _lines(path: str | Path) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
