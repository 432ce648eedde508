"""Rows of benchmarks, appended to `results/*.csv`: the site shows these, and nobody types numbers.

A file is named for the command that fills it: `bench_contact-elastic.csv` for `python
benchmarks/bench_contact.py elastic`, `bench_contact-hard--count.csv` for `... hard --count`. The
site shows its last run.
"""

import csv
import datetime
import os
import platform
from importlib.metadata import version
from pathlib import Path

import jax

RESULTS = Path(__file__).parent / "results"
_PRINTED: list[str] = []  # columns of the last row
MEASURED = "GRADED_CONTACT_MEASURED"  # of the environment


def where() -> str:
    """Returns when and on what this run is measured, the same in processes started afterwards."""
    return os.environ.get(MEASURED) or os.environ.setdefault(MEASURED, _now_and_here())


def _now_and_here() -> str:
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M")
    names = ", ".join(f"{name} {version(name)}" for name in ("graded_contact", "jax", "numpy"))
    device = f"{jax.devices()[0].device_kind} {platform.machine()}, {os.cpu_count()} cores"
    busy = f"load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "load unknown"
    return f"{now} UTC, {device}, {busy}, {names}, {jax.numpy.ones(()).dtype}"


def report(name: str, row: dict[str, str | float], note: str = "") -> None:
    """Prints a row, with a note behind it, and appends it; a header where the columns change."""
    if list(row) != _PRINTED:
        _PRINTED[:] = list(row)
        print("  ".join(f"{key:>9s}" for key in row))
    cells = {key: cell if isinstance(cell, str) else f"{cell:.4g}" for key, cell in row.items()}
    print(
        "  ".join(f"{cell:>{max(len(key), 9)}s}" for key, cell in cells.items()) + note, flush=True
    )
    keep(name, row)


def keep(name: str, row: dict[str, str | float]) -> None:
    """Appends a row; names of columns carry their units, as in `{"time [s]": 1.0}`."""
    path = RESULTS / f"{name}.csv"
    path.parent.mkdir(exist_ok=True)
    cells = {
        key: cell if isinstance(cell, str | int) else f"{cell:.4g}" for key, cell in row.items()
    }
    cells["measured"] = where()
    fresh = not path.exists()
    if not fresh:
        with open(path, newline="", encoding="utf-8") as file:
            head = next(csv.reader(file))
        if head != list(cells):
            raise ValueError(f"`row` has the columns {list(cells)}, but {path} has {head}.")
    with open(path, "a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(cells), lineterminator="\n")
        if fresh:
            writer.writeheader()
        writer.writerow(cells)
