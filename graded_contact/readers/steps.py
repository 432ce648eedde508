"""Which tables of a sheet are read, and which of their steps.

A test may have several steps: an amplitude sweep, then a frequency sweep, then a ramp of
temperature. A step begins at its title, or where a column such as "Action Name" changes. If a
frequency sweep is among the steps, those at one frequency are left out: they do not belong to it.
"""

import itertools
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..materials.measured import ISOTHERM_GAP
from .cells import Row, Sheet
from .columns import CONSTANT, SAME, MeasuredTable, measured_table
from .registry import Options
from .side_by_side import isotherms_beside
from .tables import Column, Table, credible, find_tables, title_above
from .units import SI

# The whole name of a column that holds the numbers or names of steps.
_COLUMN = re.compile(
    r"(?i)(?:test\s+)?(?:action|steps?|segment|interval|sequence|schritt|abschnitt|intervalle?|[eé]tape)"
    r"(?:[\s_-]*(?:name|no|nr|number|index|id|#))?\.?(?:\s*[\[(].*[\])])?"
)
_AMPLITUDES = (
    re.compile(r"(?i)strain|d[eé]formation|dehnung|amplitude"),
    re.compile(r"(?i)stress|contrainte|spannung"),
)
WIDER = 1.5  # factor within which the amplitude of a frequency sweep stays
FEWEST = 3  # rows, or frequencies, that show what a step holds constant
RUN = 6  # rows of one frequency and temperature inside a table that names no steps
LONG = 10  # of them, from which on the amplitude need not be seen to grow


class Step(NamedTuple):
    """Rows measured in one step of a test; its number counts from 1 in the order of the file."""

    number: int
    title: str
    rows: list[Row]

    def __str__(self) -> str:
        title = f" {self.title!r}" if self.title else ""
        lines = f"lines {self.rows[0].line}-{self.rows[-1].line}"
        return f"step {self.number}{title} ({lines}, {len(self.rows)} rows)"


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
    steps = _steps(tables)
    if options.step:
        steps = [step for name in options.step for step in _steps_named(steps, str(name))]
        lines = {row.line for step in steps for row in step.rows}
        tables = [table.only(lines) for table in tables]
    tables = sorted((table for table in tables if table.rows), key=lambda table: -len(table.rows))
    if not tables or len(tables[0].rows) < 2:
        raise ValueError("no table of numbers is found; rows of at least two numbers are needed")
    found, refusals = [], []
    each_with_steps = list(zip(tables, _each(tables, steps), strict=True))
    for table, own in each_with_steps:
        try:
            measured = measured_table(table, options)
            found.append((table, measured if options.step else _swept(measured, own)))
        except ValueError as error:
            refusals.append(error)
    if not found:
        raise refusals[0]
    chosen, measured = max(found, key=lambda pair: rank(pair[1]))
    others = []
    for table, own in each_with_steps:
        titled = ", ".join(str(step) for step in own if step.title)
        if table is not chosen:
            others.append(f"{table.place} with {titled}" if titled else table.place)
        elif options.step:
            measured.log.note(f"Read only {', '.join(map(str, own))}.")
    if others:
        measured.log.note(f"Left out tables of other columns: {', '.join(others)}.")
    return measured


def rank(measured: MeasuredTable) -> tuple[int, int]:
    """Returns what decides between tables: a frequency sweep, then the number of rows."""
    rows = measured.table.rows
    if measured.kind != "frequency":
        return 1, len(rows)
    swept = measured.table.blocks > 1 or _varies(_known(measured, "frequency", rows))
    return 2 * swept, len(rows)


# Steps of a file.


def _steps(tables: Sequence[Table]) -> list[Step]:
    """The steps of all tables in the order of the file."""
    parts = []
    for table in tables:
        # Side by side, a column of names would belong to one curve only.
        places = [i for i, name in enumerate(table.names) if _COLUMN.fullmatch(name)]
        for segment in table.segments:
            title = title_above(segment.titles)
            parts += _parts(segment.data, title, places if table.blocks == 1 else [])
    parts.sort(key=lambda part: part[1][0].line)
    return [Step(number, *part) for number, part in enumerate(parts, start=1)]


def _each(tables: Sequence[Table], steps: Sequence[Step]) -> list[list[Step]]:
    """The steps of each table."""
    table_at = {row.line: i for i, table in enumerate(tables) for row in table.rows}
    found: list[list[Step]] = [[] for _ in tables]
    for step in steps:
        if (i := table_at.get(step.rows[0].line)) is not None:
            found[i].append(step)
    return found


def _parts(rows: list[Row], title: str, places: list[int]) -> list[tuple[str, list[Row]]]:
    """The rows of a segment, split where a column that names steps changes."""
    for place in places:
        runs = itertools.groupby(rows, key=lambda row: "".join(row.cells[place : place + 1]))
        parts = [(cell if title in ("", cell) else f"{title}, {cell}", list(run))
                 for cell, run in runs]  # fmt: skip
        if FEWEST * len(parts) <= len(rows):  # a number of each point names no step
            return parts
    return [(title, rows)]


def _steps_named(steps: list[Step], text: str) -> list[Step]:
    """The step of this number or title; a part of a title chooses all that have it."""
    name = text.casefold()
    found = (
        [step for step in steps if name == str(step.number)]
        or [step for step in steps if name == step.title.casefold()]
        or [step for step in steps if name in step.title.casefold()]
    )
    if not found:
        known = ", ".join(map(str, steps)) or "none"
        raise ValueError(f"there is no `step={text!r}`; there are {known}")
    return found


# What a step holds constant.


def _swept(measured: MeasuredTable, steps: list[Step]) -> MeasuredTable:
    """The table without those of its steps at one frequency, if others sweep the frequency."""
    table = measured.table
    if measured.kind != "frequency" or table.blocks > 1:
        return measured
    constant = []
    for step in steps:
        constant += [step._replace(rows=rows) for rows in _constant_runs(measured, step)]
    left = {row.line for step in constant for row in step.rows}
    remaining = [row for row in table.rows if row.line not in left]
    omega = _known(measured, "frequency", remaining)
    if not left or not _varies(omega) or len(np.unique(omega)) < FEWEST:
        return measured
    for step in constant:
        omega = np.median(_known(measured, "frequency", step.rows))
        kelvin = _known(measured, "temperature", step.rows)
        amplitudes = _amplitudes(measured, step.rows)
        changes = ""
        if np.ptp(kelvin) > ISOTHERM_GAP:
            changes = f", and its temperature goes from {kelvin[0]:.4g} to {kelvin[-1]:.4g} K"
        elif amplitudes:
            name, low, high = amplitudes[0]
            changes = f", and {name!r} goes from {low:.4g} to {high:.4g}"
        at = f"its frequency is constant at {omega:.4g} {SI['frequency']}"
        measured.log.note(f"Left out {step}: {at}{changes}.")
    measured.log.note("`step` chooses other steps, by their number or title.")
    return measured._replace(table=table.only({row.line for row in remaining}))


def _constant_runs(measured: MeasuredTable, step: Step) -> list[list[Row]]:
    """Rows of a step at one frequency: all of them, or runs that are a sweep of something else."""
    column = measured.columns["frequency"]
    rows = [row for row in step.rows if len(column.known([row]))]
    if not rows:
        return []
    omega = column.known(rows)
    if not _varies(omega):
        named = step.title and "freq" not in step.title.casefold().replace("é", "e")
        return [step.rows] if named or len(rows) >= FEWEST else []
    runs: list[list[Row]] = []
    first = np.inf
    for row, frequency in zip(rows, omega, strict=True):
        # A run is compared with its first row: a dense sweep has neighbours that differ by less.
        if abs(frequency / first - 1) > SAME:
            first = frequency
            runs.append([])
        runs[-1].append(row)
    # At one temperature, and long or of varied amplitude.
    runs = [run for run in runs if len(run) >= RUN]
    runs = [run for run in runs if np.ptp(_known(measured, "temperature", run)) <= ISOTHERM_GAP]
    return [run for run in runs if len(run) >= LONG or _amplitudes(measured, run)]


def _amplitudes(measured: MeasuredTable, rows: list[Row]) -> list[tuple[str, float, float]]:
    """Columns of strain or stress that vary: name, first and last number."""
    found = []
    used = {column.place for column in measured.columns.values()}
    for pattern, (place, name) in itertools.product(_AMPLITUDES, enumerate(measured.table.names)):
        if pattern.search(name) and place not in used:
            values = credible(np.abs(Column("strain", place).numbers(rows)))
            if len(values) and np.max(values) > WIDER * np.min(values):
                found.append((name, float(values[0]), float(values[-1])))
    return found


def _known(measured: MeasuredTable, quantity: str, rows: list[Row]) -> np.ndarray:
    """The numbers of a quantity; a single 0 if there are none."""
    column = measured.columns.get(quantity)
    values = column.known(rows) if column else np.zeros(0)
    return values if len(values) else np.zeros(1)


def _varies(omega: np.ndarray) -> bool:
    return bool(np.max(omega) > (1 + CONSTANT) * np.min(omega))
