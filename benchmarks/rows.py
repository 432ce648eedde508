"""What all benchmarks share: options, time, goals, and rows that `results/*.csv` store.

A function is a section, its parameters are the options of the command line: `run` reads them. The
site shows the stored rows. A file is named after the command that fills it:
`bench_contact-elastic.csv` for `python benchmarks/bench_contact.py elastic`,
`bench_contact-hard--count.csv` for `... hard --count`.
"""

import argparse
import csv
import datetime
import inspect
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax
import numpy as np

import graded_contact as gc

jax.config.update("jax_enable_x64", True)
gc.core.keep_freed_memory()

RESULTS = Path(__file__).parent / "results"
MEASURED = "GRADED_CONTACT_MEASURED"  # of the environment
ONLY_PRINT = "GRADED_CONTACT_ONLY_PRINT"
_WIDTHS: dict[str, int] = {}  # of the columns printed last


def run(doc: str | None, *sections: Callable[..., None]) -> None:
    """Runs the section that the command line names, or the only one."""
    doc = doc or ""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    if len(sections) == 1:
        add_options(parser, sections[0])
    else:
        parts = parser.add_subparsers(required=True)
        for section in sections:
            text = inspect.getdoc(section) or ""
            line = text.partition("\n")[0].replace("%", "%%")
            add_options(parts.add_parser(section.__name__, help=line, description=text), section)
    given = vars(parser.parse_args())
    section = given.pop("section")
    print(f"# {where()}")
    section(**given)


def add_options(parser: argparse.ArgumentParser, section: Callable[..., None]) -> None:
    """Makes an option of each parameter; its type is that of the default, a tuple takes several."""
    parser.set_defaults(section=section)
    for name, parameter in inspect.signature(section).parameters.items():
        default, option = parameter.default, f"--{name.replace('_', '-')}"
        if default is parameter.empty:
            parser.add_argument(name)
        elif isinstance(default, bool):
            parser.add_argument(option, action="store_true")
        else:
            several = isinstance(default, tuple)
            first = next(iter(default), "") if several else default
            kind = str if first is None else type(first)
            parser.add_argument(
                option, type=kind, default=default, nargs="*" if several else None,
                help=f"default: {default}",
            )  # fmt: skip


def where() -> str:
    """Returns when and on what this run is measured, the same in processes started afterwards."""
    return os.environ.get(MEASURED) or os.environ.setdefault(MEASURED, _now_and_here())


def _now_and_here() -> str:
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M")
    names = ", ".join(f"{name} {version(name)}" for name in ("graded_contact", "jax", "numpy"))
    device = f"{jax.devices()[0].device_kind} {platform.machine()}, {os.cpu_count()} cores"
    busy = f"load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "load unknown"
    return f"{now} UTC, {device}, {busy}, {names}, {jax.numpy.ones(()).dtype}"


def timed(function: Callable[[], Any], repeat: int) -> float:
    """Returns the median time of a call that was made before [s]."""
    return statistics.median(seconds(function) for _ in range(repeat))


def seconds(function: Callable[[], Any]) -> float:
    """Returns the time of one call [s]."""
    start = time.perf_counter()
    jax.block_until_ready(function())
    return time.perf_counter() - start


def goal(text: str, reached: str) -> None:
    """Prints a goal and what was reached."""
    print(f"goal: {text} | reached: {reached}", flush=True)


def report(name: str, row: dict[str, str | float], note: str = "") -> None:
    """Prints a row, with a note behind it, and stores it."""
    show(row, note)
    if ONLY_PRINT not in os.environ:
        keep(name, row)


def show(row: dict[str, str | float], note: str = "") -> None:
    """Prints a row, under a header where the columns change; texts to the left."""
    texts = {key for key, cell in row.items() if isinstance(cell, str)}
    cells = {key: cell if key in texts else f"{cell:.4g}" for key, cell in row.items()}
    if list(row) != list(_WIDTHS):
        _WIDTHS.clear()
        # Later texts of a column may be a little longer than the first.
        _WIDTHS.update({k: max(len(k), len(c) + 6 if k in texts else 9) for k, c in cells.items()})
        _print_aligned({key: key for key in row}, texts)
    _print_aligned(cells, texts, note)


def _print_aligned(cells: dict[str, str], texts: set[str], note: str = "") -> None:
    words = (f"{c:{'<' if k in texts else '>'}{_WIDTHS[k]}s}" for k, c in cells.items())
    print("  ".join(words) + note, flush=True)


def keep(name: str, row: dict[str, str | float]) -> None:
    """Stores a row; the first row of a run replaces those of earlier runs.

    Names of columns carry their units, as in `{"time [s]": 1.0}`.
    """
    path, cells = RESULTS / f"{name}.csv", {"measured": where()}
    cells |= {k: c if isinstance(c, str | int) else f"{c:.4g}" for k, c in row.items()}
    stored = []
    if path.exists():
        with open(path, newline="", encoding="utf-8") as file:
            stored = [one for one in csv.DictReader(file) if one["measured"] == where()]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(cells), lineterminator="\n")
        writer.writeheader()
        writer.writerows([*stored, cells])


def in_processes(section, choices, **options):
    """Runs a section for each choice in a process of its own."""
    for choice in choices:
        command = [sys.executable, sys.argv[0], section, str(choice)]
        for name, value in options.items():
            command += [f"--{name}", *map(str, np.atleast_1d(value))]
        yield choice, partial(subprocess.run, command, check=True)
