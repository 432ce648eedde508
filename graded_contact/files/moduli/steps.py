"""Which tables of a sheet are read, and which of their steps.

A test may have several steps: an amplitude sweep, then a frequency sweep, then a ramp of
temperature. Their titles, or a column such as "Action Name", tell where a step begins. Where a
frequency sweep is among them, steps at one frequency are left out: they do not belong to it.
"""

import itertools
import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from .cells import Row, Sheet
from .isotherms import ISOTHERM_GAP
from .layout import HELD, SAME, Layout, Told, table_layout
from .quantities import SI
from .tables import Column, NumberTable, find_tables, numbers_of
from .titles import title_above

# The whole name of a column that tells the steps apart; their numbers or names stand in it.
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
LIMIT = 1e100
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


def understand(sheet: Sheet, told: Told) -> Layout:
    """Returns the longest table on a sheet whose columns are understood, of frequency sweeps first.

    Raises `ValueError` that names the line, and all arguments that would settle it.
    """
    named = [name for name in told.columns.values() if isinstance(name, str)]
    tables = find_tables(sheet.rows, named)
    steps = _steps(tables)
    if told.step:
        steps = _chosen(steps, told.step)
        lines = {row.line for step in steps for row in step.rows}
        tables = [table.only(lines) for table in tables]
    tables = sorted(tables, key=lambda table: -len(table.rows))
    if not tables or len(tables[0].rows) < 2:
        raise ValueError("no table of numbers is found; rows of at least two numbers are needed")
    found, refusals = [], []
    for table in filter(lambda table: table.rows, tables):
        try:
            layout = table_layout(table, told, sheet.spaced)
        except ValueError as error:
            refusals.append(error)
            continue
        found.append((table, layout if told.step else _swept(layout, table, steps)))
    if not found:
        raise refusals[0]
    table, layout = max(found, key=lambda pair: rank(pair[1]))
    if told.step:
        layout.notes.append(f"Read only {', '.join(str(s) for s in steps if _within(s, table))}.")
    others = [other for other in tables if other is not table and other.rows]
    if others:
        layout.notes.append(
            f"Left out tables of other columns: {', '.join(_named(t, steps) for t in others)}."
        )
    return layout


def rank(layout: Layout) -> tuple[int, int]:
    """Returns what decides between tables: a frequency sweep, then the number of rows."""
    rows = [row for segment in layout.segments for row in segment.data]
    if layout.kind != "frequency":
        return 1, len(rows)
    swept = layout.blocks > 1 or _varies(_numbers(layout, "frequency", rows))
    return 2 * swept, len(rows)


# Steps of a file.


def _steps(tables: Sequence[NumberTable]) -> list[Step]:
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


def _parts(table: NumberTable, rows: list[Row], title: str) -> list[tuple[str, list[Row]]]:
    """The rows of a segment, split where a column that names steps changes."""
    names = table.head.names if table.head.blocks == 1 else []
    for place, name in enumerate(names):
        if _COLUMN.fullmatch(name):
            runs = itertools.groupby(
                rows, key=lambda row: row.cells[place] if place < len(row.cells) else ""
            )
            parts = [(cell if title in ("", cell) else f"{title}, {cell}", list(run))
                     for cell, run in runs]  # fmt: skip
            if FEWEST * len(parts) <= len(rows):  # a number of each point names no step
                return parts
    return [(title, rows)]


def _chosen(steps: list[Step], names: Iterable[str | int]) -> list[Step]:
    """The steps of these numbers or titles; a part of a title stands for all that have it."""
    found = []
    for each in map(str, names):
        name = each.casefold()
        same = [s for s in steps if name == str(s.number)]
        same = same or [s for s in steps if name == s.title.casefold()]
        same = same or [s for s in steps if name in s.title.casefold()]
        if not same:
            raise ValueError(
                f"there is no `step={each!r}`; there are {', '.join(map(str, steps)) or 'none'}"
            )
        found += same
    return found


def _named(table: NumberTable, steps: list[Step]) -> str:
    """Where a table stands, and its steps that have titles."""
    mine = [str(step) for step in steps if step.title and _within(step, table)]
    return table.head.place + (f" with {', '.join(mine)}" if mine else "")


def _within(step: Step, table: NumberTable) -> bool:
    return any(row is step.rows[0] for row in table.rows)


# What a step holds constant.


def _swept(layout: Layout, table: NumberTable, steps: list[Step]) -> Layout:
    """The table without its steps at one frequency, if others sweep the frequency."""
    if layout.kind != "frequency" or layout.blocks > 1:
        return layout
    held: list[tuple[Step, np.ndarray]] = []
    for step in steps:
        if _within(step, table):
            held += [(step, rows) for rows in _held(layout, table, step)]
    left = {step.rows[i].line for step, rows in held for i in rows}
    kept = [row for row in table.rows if row.line not in left]
    omega = _numbers(layout, "frequency", kept)
    if not left or not _varies(omega) or len(np.unique(omega[omega > 0])) < FEWEST:
        return layout
    for step, places in held:
        rows = [step.rows[i] for i in places]
        omega = np.nanmedian(_numbers(layout, "frequency", rows))
        layout.notes.append(
            f"Left out {step._replace(rows=rows)}: its frequency is held at {omega:.4g} "
            f"{SI['frequency']}{_varied(layout, table, rows)}."
        )
    layout.notes.append("`step` chooses other steps, by their number or title.")
    return layout._replace(segments=table.only({row.line for row in kept}).segments)


def _held(layout: Layout, table: NumberTable, step: Step) -> list[np.ndarray]:
    """Rows of a step at one frequency: all of them, or runs that are a sweep of something else."""
    omega = _numbers(layout, "frequency", step.rows)
    known = np.flatnonzero(np.isfinite(omega))
    enough = FEWEST if not step.title or "freq" in _plain(step.title) else 1
    if not len(known):
        return []
    if not _varies(omega):
        return [np.arange(len(omega))] if len(known) >= enough else []
    runs: list[list[int]] = [[]]
    for i in known:
        if runs[-1] and abs(omega[i] / omega[runs[-1][0]] - 1) > SAME:
            runs.append([])
        runs[-1].append(int(i))
    long = [np.array(run) for run in runs if len(run) >= RUN]
    return [run for run in long if _apart(layout, table, step, run)]


def _apart(layout: Layout, table: NumberTable, step: Step, run: np.ndarray) -> bool:
    """Whether a run of one frequency is at one temperature, and long or of varied amplitude."""
    rows = [step.rows[i] for i in run]
    kelvin = _temperatures(layout, rows)
    if np.ptp(kelvin) > ISOTHERM_GAP:
        return False
    return len(run) >= LONG or bool(_amplitudes(layout, table, rows))


def _varied(layout: Layout, table: NumberTable, rows: list[Row]) -> str:
    """What changes in rows of one frequency, in words."""
    kelvin = _temperatures(layout, rows)
    if np.ptp(kelvin) > ISOTHERM_GAP:
        return f", and its temperature goes from {kelvin[0]:.4g} to {kelvin[-1]:.4g} K"
    for name, low, high in _amplitudes(layout, table, rows):
        return f", and {name!r} goes from {low:.4g} to {high:.4g}"
    return ""


def _amplitudes(
    layout: Layout, table: NumberTable, rows: list[Row]
) -> list[tuple[str, float, float]]:
    """Columns of strain or stress that vary: name, first and last number."""
    found = []
    for pattern, (place, name) in itertools.product(_AMPLITUDES, enumerate(table.head.names)):
        if pattern.search(name) and place not in {c.place for c in layout.columns.values()}:
            column = Column("strain", name, place, "1", "", None, None)
            values = _credible(np.abs(numbers_of(rows, column)))
            values = values[np.isfinite(values)]
            if len(values) and np.max(values) > WIDER * np.min(values):
                found.append((name, float(values[0]), float(values[-1])))
    return found


def _temperatures(layout: Layout, rows: list[Row]) -> np.ndarray:
    """Those known [K]; a single 0 if none is."""
    if "temperature" not in layout.columns:
        return np.zeros(1)
    kelvin = _numbers(layout, "temperature", rows)
    known = kelvin[np.isfinite(kelvin)]
    return known if len(known) else np.zeros(1)


def _numbers(layout: Layout, quantity: str, rows: list[Row]) -> np.ndarray:
    return _credible(numbers_of(rows, layout.columns[quantity]))


def _credible(values: np.ndarray) -> np.ndarray:
    """The values that a measurement can have, whose ratios are finite; NaN for the others."""
    return np.where((values > 1 / LIMIT) & (values < LIMIT), values, np.nan)


def _varies(omega: np.ndarray) -> bool:
    known = omega[np.isfinite(omega)]
    return bool(len(known)) and bool(np.max(known) > (1 + HELD) * np.min(known))


def _plain(text: str) -> str:
    return text.casefold().replace("é", "e")
