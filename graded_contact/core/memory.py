"""Estimates of the memory of a computation, before anything is allocated.

A contact needs fewer than twenty fields as large as the heights. Layers add little if the kernel is
computed in blocks, and much on a grid of one dimension. The numbers of fields were measured:
`benchmarks/bench_memory.py` compares them with the peaks of whole processes. Compiling adds the
same amount for every grid, and each point of a sweep adds a row of its table and file.
"""

import math
import os
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np

# Fields as large as the heights, by the bytes of a number.
SURFACE = {8: 6.0, 4: 7.0}  # the surface, its modes, and the random words of these
CONTACT = 12.5  # without the history of the acceleration; up to 8 more in a custom program
HISTORY = {8: 0.625, 4: 1.25}  # of each iterate of it
KERNEL = 1.5
CYCLE = 22.0  # more in space and time, measured at 128 x 128 points and times
DERIVATIVE = 20.0  # more for a derivative
BLOCK_ROWS = 16  # of a kernel whose moduli differ from point to point
COMPILER = 8e8  # bytes of compiling a contact, which are not freed
POINT = 8000  # bytes of a sweep's point, most of it in the printed table
SMALL = 2**30  # bytes below which nothing is checked


def surface_memory(shape: tuple[int, ...], itemsize: int) -> float:
    """Returns the bytes of drawing or transforming a surface."""
    return SURFACE[itemsize] * math.prod(shape) * itemsize


def kernel_memory(
    shape: tuple[int, ...], itemsize: int, num_numbers: int = 0, oblique: bool = False
) -> float:
    """Returns the bytes of the kernel of a stack.

    **Arguments:**

    - `shape`, `itemsize`: of the heights.
    - `num_numbers`: of the stack: thicknesses, moduli, relaxation times.
    - `oblique`: whether moduli differ within a row, as for sliding that is not along x.
    """
    rows = 1 if len(shape) == 1 else min(BLOCK_ROWS, shape[0]) * oblique
    # Each branch of each material at each point of these rows, complex on half of them.
    branches = num_numbers / 2 * rows * shape[-1]
    return (KERNEL * math.prod(shape) + branches) * itemsize


def contact_memory(shape: tuple[int, ...], itemsize: int, history: int) -> float:
    """Returns the bytes of a contact whose acceleration stores `history` iterates."""
    fields = CONTACT + HISTORY[itemsize] * (history + 1)
    return COMPILER + fields * math.prod(shape) * itemsize


def sliding_memory(
    shape: tuple[int, ...], itemsize: int, num_numbers: int, oblique: bool, history: int
) -> float:
    """Returns the bytes of a kernel, and of a contact with it; arguments as above."""
    contact = contact_memory(shape, itemsize, history) + math.prod(shape) * itemsize
    return max(kernel_memory(shape, itemsize, num_numbers, oblique), contact)


def cycle_memory(shape: tuple[int, ...], itemsize: int, history: int) -> float:
    """Returns the bytes of a contact in space and time, fields of `shape`, with its kernel."""
    return contact_memory(shape, itemsize, history) + CYCLE * math.prod(shape) * itemsize


def check_memory(
    name: str,
    shape: tuple[int, ...],
    needed: Callable[[tuple[int, ...]], float],
    purpose: str,
    devices: int = 1,
) -> None:
    """Raises `ValueError` if a grid needs more memory than is free, and names one that fits.

    **Arguments:**

    - `name`: of the argument that has the shape.
    - `shape`: of the grid.
    - `needed`: bytes that a grid of a shape needs, beyond what is allocated.
    - `purpose`: what needs them, for the message.
    - `devices`: over how many the grid lies. Those of a CPU share the memory of their process.
    """
    if needed(shape) < SMALL:
        return
    free = available_memory()
    if free is not None and devices > 1:
        free *= jax.process_count() if jax.default_backend() == "cpu" else devices
    if free is None or needed(shape) <= free:
        return
    fit = next((2**k for k in range(30, 1, -1) if needed((2**k,) * len(shape)) <= free), None)
    fits = "None" if fit is None else f"One of {_times((fit,) * len(shape))}"
    raise ValueError(
        f"`{name}` is refused: {purpose} of {_times(shape)} points takes about "
        f"{in_gigabytes(needed(shape))} of memory, and {in_gigabytes(free)} are free. {fits} would "
        "fit."
    )


def check_points(name: str, count: int) -> None:
    """Raises `ValueError` if a sweep of so many points needs more memory than there is."""
    free = available_memory() if count * POINT >= SMALL else None
    if free is not None and count * POINT > free:
        raise ValueError(
            f"`{name}` is refused: {count} points of a sweep take about "
            f"{in_gigabytes(count * POINT)} of memory, and {in_gigabytes(free)} are free. "
            f"{int(free // POINT)} would fit."
        )


def in_gigabytes(size: float) -> str:
    """Returns a number of bytes as text."""
    return f"{size / 1e9:.2g} GB" if size < 1e10 else f"{size / 1e9:.0f} GB"


def available_memory() -> float | None:
    """Returns the free memory [bytes] of the device of JAX, or None if unknown."""
    if jax.default_backend() != "cpu":
        known = jax.local_devices()[0].memory_stats() or {}
        if "bytes_limit" not in known:
            return None
        return known["bytes_limit"] - known.get("bytes_in_use", 0)
    known = [size for size in (_of_machine(), *_of_groups()) if size is not None]
    return max(min(known), 0) if known else None


def _of_machine() -> float | None:
    """Free bytes of the machine; on other systems than Linux, all bytes."""
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None


def _of_groups() -> list[float]:
    """Free bytes of the control groups of this process (containers, batch systems)."""
    found = []
    for line in _lines("/proc/self/cgroup"):
        _, controllers, group = line.split(":", 2)
        if controllers == "":
            names = ("memory.max", "memory.current", "inactive_file")
            place = Path("/sys/fs/cgroup" + group)
        elif "memory" in controllers.split(","):
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
            place = Path("/sys/fs/cgroup/memory" + group)
        else:
            continue
        # In a container the group's own path may not be visible, its root is.
        for folder in (place, *place.parents):
            limit, used = (_lines(folder / name) for name in names[:2])
            if limit and used and limit[0].isdigit():
                cached = [row.split()[1] for row in _lines(folder / "memory.stat")
                          if row.startswith(names[2] + " ")]  # fmt: skip
                found.append(int(limit[0]) - int(used[0]) + int((cached or ["0"])[0]))
    return found


def _lines(path: str | Path) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


def num_numbers(tree: object) -> int:
    """Returns how many numbers a stack, or any other tree, has."""
    return sum(int(np.size(leaf)) for leaf in jax.tree.leaves(tree))
