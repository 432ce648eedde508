"""Which tables of a sheet are read, and which of their steps.

A test may have several steps: an amplitude sweep, then a frequency sweep, then a ramp of
temperature. A step begins at its title, or where a column such as "Action Name" changes. If a
frequency sweep is among the steps, those at one frequency are left out: they do not belong to it.
"""

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..materials.measured import ISOTHERM_GAP
from .cells import Row, Sheet
from .columns import SAME_FREQUENCY, MeasuredTable, measured_table
from .decisions import Options
from .side_by_side import isotherms_beside
from .tables import DataColumn, DataTable, credible, find_tables, is_credible, title_above
from .units import SI
from .ways import CONSTANT

# The whole name of a column that holds the numbers or names of steps.
_STEP_COLUMN = re.compile(
    r"(?i)(?:test\s+)?(?:action|steps?|segment|interval|sequence|schritt|abschnitt|intervalle?|[eé]tape)"
    r"(?:[\s_-]*(?:name|no|nr|number|index|id|#))?\.?(?:\s*[\[(].*[\])])?"
)
_AMPLITUDES = (
    re.compile(r"(?i)strain|d[eé]formation|dehnung|amplitude"),
    re.compile(r"(?i)stress|contrainte|spannung"),
)
WIDER = 1.5  # factor within which the amplitude of a frequency sweep stays
FEWEST_ROWS = 3  # rows, or frequencies, that show what a step holds constant
RUN = 6  # rows of one frequency and temperature inside a table that names no steps
LONG = 10  # of them, from which on the amplitude need not be seen to grow


def understand(sheet: Sheet, options: Options) -> MeasuredTable:
    """Returns the longest table on a sheet whose columns are understood, of frequency sweeps first.

    Raises `ValueError` that names the line, and all arguments that would help.
    """
    named = [name for name in options.columns.values() if isinstance(name, str)]
    tables = find_tables(sheet, named)
    if not any(isinstance(name, int) for name in options.columns.values()):
        tables = [
            isotherms_beside(table, options.units) for table in tables
        ]  # else numbers count columns
    tables, titles = _with_steps(tables)
    if options.step:
        rows = [row for table in tables for row in table.rows]
        wanted = {number for name in options.step for number in _steps_named(rows, titles, name)}
        kept = ([row for row in table.rows if row.step in wanted] for table in tables)
        tables = [table._replace(rows=rows) for table, rows in zip(tables, kept, strict=True)]
    tables = sorted((table for table in tables if table.rows), key=lambda table: -len(table.rows))
    if not tables or len(tables[0].rows) < 2:
        raise ValueError("no table of numbers is found; rows of at least two numbers are needed")
    found, refusals = [], []
    for table in tables:
        try:
            measured = measured_table(table, options)
            found.append((table, measured if options.step else _swept(measured, titles)))
        except ValueError as error:
            refusals.append(error)
    if not found:
        raise refusals[0]
    chosen, measured = max(found, key=lambda pair: rank(pair[1]))
    if options.step:
        measured.log.note(f"Read only {', '.join(_told(chosen.rows, titles).values())}.")
    others = []
    for table in (table for table in tables if table is not chosen):
        own = _told(table.rows, titles)
        titled = ", ".join(told for number, told in own.items() if titles[number])
        others.append(f"{table.place} with {titled}" if titled else table.place)
    if others:
        measured.log.note(f"Left out tables of other columns: {', '.join(others)}.")
    return measured


def rank(measured: MeasuredTable) -> tuple[int, int]:
    """Returns what decides between tables: a frequency sweep, then the number of rows."""
    if measured.kind != "frequency":
        return 1, measured.num_rows
    swept = measured.table.blocks > 1 or _frequency_varies(_known(measured, "frequency"))
    return 2 * swept, measured.num_rows


# Steps of a file.


def _with_steps(tables: Sequence[DataTable]) -> tuple[list[DataTable], dict[int, str]]:
    """The tables with the step of each row, and the titles of the steps, counted in the file."""
    parts: list[tuple[str, list[Row], list[Row]]] = []
    numbered: list[list[Row]] = [[] for _ in tables]
    for table, rows in zip(tables, numbered, strict=True):
        # Side by side, a column of names would belong to one curve only.
        places = [i for i, name in enumerate(table.names) if _STEP_COLUMN.fullmatch(name)]
        places = places if table.blocks == 1 else []
        for segment, group in itertools.groupby(table.rows, key=lambda row: row.segment):
            title = title_above(table.above[segment])
            parts += [(*part, rows) for part in _split_steps(list(group), title, places)]
    parts.sort(key=lambda part: part[1][0].line)
    for number, (_, part, rows) in enumerate(parts, start=1):
        rows += [row._replace(step=number) for row in part]
    pairs = zip(tables, numbered, strict=True)
    titles = {number: title for number, (title, *_) in enumerate(parts, start=1)}
    return [table._replace(rows=rows) for table, rows in pairs], titles


def _told(rows: Iterable[Row], titles: Mapping[int, str]) -> dict[int, str]:
    """The steps of rows in words, by their numbers."""
    groups = itertools.groupby(sorted(rows, key=lambda row: row.line), key=lambda row: row.step)
    return {
        number: _step_told(number, titles, [row.line for row in each]) for number, each in groups
    }


def _step_told(number: int, titles: Mapping[int, str], lines: Sequence[int]) -> str:
    title = f" {titles[number]!r}" if titles[number] else ""
    return f"step {number}{title} (lines {lines[0]}-{lines[-1]}, {len(lines)} rows)"


def _split_steps(rows: list[Row], title: str, places: list[int]) -> list[tuple[str, list[Row]]]:
    """The rows of a segment, split where a column that names steps changes."""
    for place in places:
        runs = itertools.groupby(rows, key=lambda row: "".join(row.cells[place : place + 1]))
        parts = [(cell if title in ("", cell) else f"{title}, {cell}", list(run))
                 for cell, run in runs]  # fmt: skip
        if FEWEST_ROWS * len(parts) <= len(rows):  # a number of each point names no step
            return parts
    return [(title, rows)]


def _steps_named(rows: list[Row], titles: Mapping[int, str], text: str | int) -> list[int]:
    """The step of this number or title; a part of a title chooses all that have it."""
    name = str(text).casefold()
    folded = {number: title.casefold() for number, title in titles.items()}
    found = (
        [number for number in titles if name == str(number)]
        or [number for number, title in folded.items() if name == title]
        or [number for number, title in folded.items() if name in title]
    )
    if not found:
        known = ", ".join(_told(rows, titles).values()) or "none"
        raise ValueError(f"there is no `step={str(text)!r}`; there are {known}")
    return found


# What a step holds constant.


def _swept(measured: MeasuredTable, titles: Mapping[int, str]) -> MeasuredTable:
    """The table without those of its steps at one frequency, if others sweep the frequency."""
    points = measured.points
    if measured.kind != "frequency" or measured.table.blocks > 1:
        return measured
    step = points["step"].to_numpy()
    parts = np.split(np.arange(len(step)), np.flatnonzero(np.diff(step)) + 1)
    constant = [run for part in parts for run in _constant_runs(measured, titles, part)]
    remaining = np.ones(len(step), bool)
    remaining[[place for run in constant for place in run]] = False
    omega = _known(measured, "frequency", remaining)
    if not constant or not _frequency_varies(omega) or len(np.unique(omega)) < FEWEST_ROWS:
        return measured
    lines = points["line"].to_numpy()
    for run in constant:
        omega = np.median(_known(measured, "frequency", run))
        kelvin = _known(measured, "temperature", run)
        amplitudes = _amplitudes(measured, run)
        changes = ""
        if np.ptp(kelvin) > ISOTHERM_GAP:
            changes = f", and its temperature goes from {kelvin[0]:.4g} to {kelvin[-1]:.4g} K"
        elif amplitudes:
            name, low, high = amplitudes[0]
            changes = f", and {name!r} goes from {low:.4g} to {high:.4g}"
        told = _step_told(int(step[run[0]]), titles, lines[run].tolist())
        at = f"its frequency is constant at {omega:.4g} {SI['frequency']}"
        measured.log.note(f"Left out {told}: {at}{changes}.")
    measured.log.note("`step` chooses other steps, by their number or title.")
    return measured._replace(points=points[remaining].reset_index(drop=True))


def _constant_runs(
    measured: MeasuredTable, titles: Mapping[int, str], part: np.ndarray
) -> list[np.ndarray]:
    """Points of a step at one frequency: all, or runs that are a sweep of something else."""
    omega = measured.points["frequency"].to_numpy()[part]
    known = is_credible(omega)
    part, omega, whole = part[known], omega[known], part
    if not len(part):
        return []
    if not _frequency_varies(omega):
        title = titles[measured.points["step"].to_numpy()[part[0]]].casefold()
        named = title and "freq" not in title.replace("é", "e")
        return [whole] if named or len(part) >= FEWEST_ROWS else []
    starts: list[int] = []
    first = np.inf
    for i, frequency in enumerate(omega):
        # A run is compared with its first row: a dense sweep has neighbours that differ by less.
        if abs(frequency / first - 1) > SAME_FREQUENCY:
            first = frequency
            starts.append(i)
    # At one temperature, and long or of varied amplitude.
    runs = [run for run in np.split(part, starts[1:]) if len(run) >= RUN]
    runs = [run for run in runs if np.ptp(_known(measured, "temperature", run)) <= ISOTHERM_GAP]
    return [run for run in runs if len(run) >= LONG or _amplitudes(measured, run)]


def _amplitudes(measured: MeasuredTable, run: np.ndarray) -> list[tuple[str, float, float]]:
    """Columns of strain or stress that vary: name, first and last number."""
    found = []
    used = {column.place for column in measured.columns.values()}
    for pattern, (place, name) in itertools.product(_AMPLITUDES, enumerate(measured.table.names)):
        if pattern.search(name) and place not in used:
            cells = (each[place] for each in measured.points["cells"].to_numpy()[run])
            values = credible(np.abs(DataColumn("strain", place).si(cells)))
            if len(values) and np.max(values) > WIDER * np.min(values):
                found.append((name, float(values[0]), float(values[-1])))
    return found


def _known(measured: MeasuredTable, quantity: str, places: Any = slice(None)) -> np.ndarray:
    """The numbers of a quantity; a single 0 if there are none."""
    if quantity not in measured.columns:
        return np.zeros(1)
    values = credible(measured.points[quantity].to_numpy()[places])
    return values if len(values) else np.zeros(1)


def _frequency_varies(omega: np.ndarray) -> bool:
    return bool(np.max(omega) > (1 + CONSTANT) * np.min(omega))
