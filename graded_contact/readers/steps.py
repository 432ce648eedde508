"""Which tables of a sheet are read, and which of their steps.

A test may have several steps: an amplitude sweep, then a frequency sweep, then a ramp of
temperature. A step begins at its title, or where a column such as "Action Name" changes. If a
frequency sweep is among the steps, those at one frequency are left out: they do not belong to it.
"""

import itertools
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ..materials.measured import ISOTHERM_GAP
from .cells import Row, Sheet
from .columns import CONSTANT, SAME, MeasuredTable, Options, measured_table
from .points import LIMIT
from .tables import Column, Table, find_tables, title_above
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

    def within(self, table: Table) -> bool:
        return any(row is self.rows[0] for row in table.rows)


def understand(sheet: Sheet, options: Options) -> MeasuredTable:
    """Returns the longest table on a sheet whose columns are understood, of frequency sweeps first.

    Raises `ValueError` that names the line, and all arguments that would help.
    """
    named = [name for name in options.columns.values() if isinstance(name, str)]
    tables = find_tables(sheet.rows, named)
    steps = _steps(tables)
    if options.step:
        steps = _chosen(steps, options.step)
        lines = {row.line for step in steps for row in step.rows}
        tables = [table.only(lines) for table in tables]
    tables = sorted((table for table in tables if table.rows), key=lambda table: -len(table.rows))
    if not tables or len(tables[0].rows) < 2:
        raise ValueError("no table of numbers is found; rows of at least two numbers are needed")
    found, refusals = [], []
    for table in tables:
        try:
            measured = measured_table(table, options, sheet.spaced)
        except ValueError as error:
            refusals.append(error)
            continue
        found.append((table, measured if options.step else _swept(measured, steps)))
    if not found:
        raise refusals[0]
    table, measured = max(found, key=lambda pair: rank(pair[1]))
    if options.step:
        read = ", ".join(str(step) for step in steps if step.within(table))
        measured.notes.append(f"Read only {read}.")
    others = [_named(other, steps) for other in tables if other is not table]
    if others:
        measured.notes.append(f"Left out tables of other columns: {', '.join(others)}.")
    return measured


def rank(measured: MeasuredTable) -> tuple[int, int]:
    """Returns what decides between tables: a frequency sweep, then the number of rows."""
    rows = measured.table.rows
    if measured.kind != "frequency":
        return 1, len(rows)
    swept = measured.table.blocks > 1 or _varies(_frequencies(measured, rows))
    return 2 * swept, len(rows)


# Steps of a file.


def _steps(tables: Sequence[Table]) -> list[Step]:
    """The steps of all tables in the order of the file."""
    parts = [
        (title, rows)
        for table in tables
        for segment in table.segments
        for title, rows in _parts(table, segment.data, title_above(segment.titles))
        if rows
    ]
    parts.sort(key=lambda part: part[1][0].line)
    return [Step(number, *part) for number, part in enumerate(parts, start=1)]


def _parts(table: Table, rows: list[Row], title: str) -> list[tuple[str, list[Row]]]:
    """The rows of a segment, split where a column that names steps changes."""
    names = table.names if table.blocks == 1 else []
    for place, name in enumerate(names):
        if _COLUMN.fullmatch(name):
            runs = itertools.groupby(rows, key=lambda row: "".join(row.cells[place : place + 1]))
            parts = [(cell if title in ("", cell) else f"{title}, {cell}", list(run))
                     for cell, run in runs]  # fmt: skip
            if FEWEST * len(parts) <= len(rows):  # a number of each point names no step
                return parts
    return [(title, rows)]


def _chosen(steps: list[Step], names: Iterable[str | int]) -> list[Step]:
    """The steps of these numbers or titles; a part of a title chooses all that have it."""
    found = []
    for each in map(str, names):
        name = each.casefold()
        same = (
            [s for s in steps if name == str(s.number)]
            or [s for s in steps if name == s.title.casefold()]
            or [s for s in steps if name in s.title.casefold()]
        )
        if not same:
            raise ValueError(
                f"there is no `step={each!r}`; there are {', '.join(map(str, steps)) or 'none'}"
            )
        found += same
    return found


def _named(table: Table, steps: list[Step]) -> str:
    """The place of a table, and its steps that have titles."""
    mine = [str(step) for step in steps if step.title and step.within(table)]
    return table.place + (f" with {', '.join(mine)}" if mine else "")


# What a step holds constant.


def _swept(measured: MeasuredTable, steps: list[Step]) -> MeasuredTable:
    """The table without its steps at one frequency, if others sweep the frequency."""
    table = measured.table
    if measured.kind != "frequency" or table.blocks > 1:
        return measured
    constant = [
        step._replace(rows=rows)
        for step in steps
        if step.within(table)
        for rows in _constant_runs(measured, step)
    ]
    left = {row.line for step in constant for row in step.rows}
    remaining = [row for row in table.rows if row.line not in left]
    omega = _frequencies(measured, remaining)
    if not left or not _varies(omega) or len(np.unique(omega[omega > 0])) < FEWEST:
        return measured
    for step in constant:
        omega = np.nanmedian(_frequencies(measured, step.rows))
        measured.notes.append(
            f"Left out {step}: its frequency is constant at {omega:.4g} {SI['frequency']}"
            f"{_variation(measured, step.rows)}."
        )
    measured.notes.append("`step` chooses other steps, by their number or title.")
    return measured._replace(table=table.only({row.line for row in remaining}))


def _constant_runs(measured: MeasuredTable, step: Step) -> list[list[Row]]:
    """Rows of a step at one frequency: all of them, or runs that are a sweep of something else."""
    omega = _frequencies(measured, step.rows)
    known = np.flatnonzero(np.isfinite(omega))
    named = step.title and "freq" not in step.title.casefold().replace("é", "e")
    if not len(known):
        return []
    if not _varies(omega):
        return [step.rows] if named or len(known) >= FEWEST else []
    runs: list[list[int]] = [[]]
    for i in known:
        if runs[-1] and abs(omega[i] / omega[runs[-1][0]] - 1) > SAME:
            runs.append([])
        runs[-1].append(int(i))
    found = [[step.rows[i] for i in run] for run in runs if len(run) >= RUN]
    # At one temperature, and long or of varied amplitude.
    return [
        rows
        for rows in found
        if np.ptp(_temperatures(measured, rows)) <= ISOTHERM_GAP
        and (len(rows) >= LONG or _amplitudes(measured, rows))
    ]


def _variation(measured: MeasuredTable, rows: list[Row]) -> str:
    """What changes in rows of one frequency, in words."""
    kelvin = _temperatures(measured, rows)
    if np.ptp(kelvin) > ISOTHERM_GAP:
        return f", and its temperature goes from {kelvin[0]:.4g} to {kelvin[-1]:.4g} K"
    for name, low, high in _amplitudes(measured, rows):
        return f", and {name!r} goes from {low:.4g} to {high:.4g}"
    return ""


def _amplitudes(measured: MeasuredTable, rows: list[Row]) -> list[tuple[str, float, float]]:
    """Columns of strain or stress that vary: name, first and last number."""
    found = []
    used = {column.place for column in measured.columns.values()}
    for pattern, (place, name) in itertools.product(_AMPLITUDES, enumerate(measured.table.names)):
        if pattern.search(name) and place not in used:
            column = Column("strain", name, place, "1", "", None, None)
            values = _credible(np.abs(column.numbers(rows)))
            values = values[np.isfinite(values)]
            if len(values) and np.max(values) > WIDER * np.min(values):
                found.append((name, float(values[0]), float(values[-1])))
    return found


def _temperatures(measured: MeasuredTable, rows: list[Row]) -> np.ndarray:
    """Those known [K]; a single 0 if none is."""
    if "temperature" not in measured.columns:
        return np.zeros(1)
    kelvin = _credible(measured.numbers("temperature", rows))
    known = kelvin[np.isfinite(kelvin)]
    return known if len(known) else np.zeros(1)


def _frequencies(measured: MeasuredTable, rows: list[Row]) -> np.ndarray:
    return _credible(measured.numbers("frequency", rows))


def _credible(values: np.ndarray) -> np.ndarray:
    """The values that a measurement can have, whose ratios are finite; NaN for the others."""
    return np.where((values > 1 / LIMIT) & (values < LIMIT), values, np.nan)


def _varies(omega: np.ndarray) -> bool:
    known = omega[np.isfinite(omega)]
    return bool(len(known)) and bool(np.max(known) > (1 + CONSTANT) * np.min(known))
