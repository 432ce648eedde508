"""The tables of a sheet, each below the names of its columns.

Tables with the same names are one table in segments, such as the steps of a test. A table may also
repeat its columns side by side, one block for each curve.
"""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from .cells import Row, holds_data, is_missing, is_number
from .quantities import DIMENSIONS, OFFSETS, UNITS, Heading, parse_heading, parse_unit


class Segment(NamedTuple):
    """A part of a table: the `titles` above it, its rows of numbers, and its other rows."""

    titles: list[Row]
    data: list[Row]
    words: list[Row]


class Head(NamedTuple):
    """Names and units of the columns of one block, and where they stand."""

    place: str
    names: list[str]
    units: list[str]
    headings: list[Heading]
    blocks: int

    def label(self, place: int) -> str:
        return f"column {place + 1}" + (f" ({self.names[place]})" if self.names[place] else "")


class Column(NamedTuple):
    """A column of a table.

    - `quantity`: a key of `quantities.DIMENSIONS`.
    - `label`: how messages call it.
    - `place`: counted from 0, within a block.
    - `unit`: one of `UNITS` of its dimension.
    - `source`: whence the unit is known.
    - `deformation`: "tension", "shear" or None, as its name says.
    - `base`: of the logarithms that it holds, "10" or "e"; None for plain values.
    """

    quantity: str
    label: str
    place: int
    unit: str
    source: str
    deformation: str | None
    base: str | None

    @property
    def factor(self) -> float:
        return UNITS[DIMENSIONS[self.quantity]][self.unit]

    def si(self, cell: str) -> float:
        """Returns a cell's number in SI units; NaN if it is none, infinity if it is too large."""
        if not is_number(cell):
            return np.nan
        with np.errstate(over="ignore"):
            value = np.float64(cell)
            if self.base is not None:
                value = np.exp(value * (np.log(10) if self.base == "10" else 1))
            offset = OFFSETS[self.unit] if self.quantity == "temperature" else 0.0
            return float(self.factor * value + offset)


class NumberTable(NamedTuple):
    """Names of columns, and the segments below them."""

    head: Head
    segments: list[Segment]

    @property
    def rows(self) -> list[Row]:
        return [row for segment in self.segments for row in segment.data]

    @property
    def curves(self) -> int:
        return self.head.blocks * len(self.segments)

    def only(self, lines: set[int]) -> "NumberTable":
        """Returns the table with the rows of numbers on these lines."""
        segments = [
            segment._replace(data=[row for row in segment.data if row.line in lines])
            for segment in self.segments
        ]
        return self._replace(segments=[segment for segment in segments if segment.data])


def find_tables(rows: list[Row], named: Iterable[str]) -> list[NumberTable]:
    """Returns the tables of numbers; `named` are names of columns that are known."""
    rows = _with_signals(rows)
    starts = _starts(rows, set(named))
    if not starts:
        data = [row for row in rows if holds_data(row)]
        width = max((len(row.cells) for row in data), default=0)
        empty = [""] * width
        head = Head("no line of names", empty, empty, [parse_heading("")] * width, 1)
        above = [row for row in rows if data and row.line < data[0].line]
        return [NumberTable(head, [Segment(above, data, [])])]
    tables: dict[tuple[str, ...], NumberTable] = {}
    last = 0  # behind the numbers above
    for start, end in zip(starts, [*starts[1:], len(rows)], strict=True):
        below = rows[start + 1 : end]
        units = below[0] if below and not holds_data(below[0]) else None
        units = units if units and any(map(parse_unit, units.cells)) else None
        data = [row for row in below if _measures(row)]
        words = [row for row in below if not _measures(row) and row is not units]
        head = _head(rows[start], units)
        key = tuple(head.names)
        if key in tables and units is not None and tables[key].head.units != head.units:
            key = (*head.names, *head.units)
        table = tables.setdefault(key, NumberTable(head, []))
        if data:
            table.segments.append(Segment(rows[last:start], data, words))
            last = max(i for i in range(start, end) if _measures(rows[i])) + 1
    return [table for table in tables.values() if table.rows]


def _measures(row: Row) -> bool:
    """Whether a row holds data, and is none such as "Interval and data points: 1 29"."""
    return holds_data(row) and not re.match(r"(?i)(?:interval|abschnitt).*:", row.cells[0])


def _with_signals(rows: list[Row]) -> list[Row]:
    """Names that stand below one another, "Sig1 Time (min)", "Sig2 ...", as one row."""
    named = [i for i, row in enumerate(rows) if re.fullmatch(r"Sig\d+", row.cells[0])]
    if len(named) < 2:
        return rows
    names = Row(rows[named[-1]].line, [" ".join(rows[i].cells[1:]) for i in named])
    return [names if i == named[-1] else row for i, row in enumerate(rows) if i not in named[:-1]]


def _starts(rows: list[Row], named: set[str]) -> list[int]:
    """Where the names of columns stand: rows that name two quantities."""

    def score(row: Row) -> int:
        quantities = {parse_heading(cell).quantity for cell in row.cells} - {None}
        return len(quantities) + len(named & set(row.cells))

    words = [i for i, row in enumerate(rows) if not holds_data(row)]
    starts = [i for i in words if score(rows[i]) >= 2]
    if starts:
        return starts
    # Otherwise the last row of words before the numbers.
    first = next((i for i, row in enumerate(rows) if holds_data(row)), 0)
    above = [i for i in words if i < first and len(rows[i].cells) > 1 and not _only_units(rows[i])]
    return above[-1:]


def _only_units(row: Row) -> bool:
    return all(is_missing(cell) or parse_unit(cell) for cell in row.cells)


def _head(row: Row, units: Row | None) -> Head:
    names = stripped(row.cells)
    cells = [] if units is None else units.cells
    below = [cells[i] if i < len(cells) else "" for i in range(len(names))]
    columns = list(zip(names, below, strict=True))
    repeats = (
        width
        for width in range(2, len(names))
        if len(names) % width == 0 and columns == columns[:width] * (len(names) // width)
    )
    width = next(repeats, len(names))
    headings = [parse_heading(name) for name in names[:width]]
    return Head(f"line {row.line}", names[:width], below[:width], headings, len(names) // width)


def stripped(cells: list[str]) -> list[str]:
    """Returns the cells without the empty ones at the end."""
    count = max((i + 1 for i, cell in enumerate(cells) if cell), default=0)
    return cells[:count]


def misfit(entries: int, width: int, spaced: bool) -> bool:
    """Returns whether the entries of a row cannot be told to the columns."""
    # Where spaces separate, a missing entry would move those after it.
    return entries > width or (spaced and entries < width)


def check_widths(table: NumberTable, spaced: bool) -> None:
    """Raises `ValueError` if no row can be told to the columns."""
    width = table.head.blocks * len(table.head.names)
    entries = [len(stripped(row.cells)) for row in table.rows]
    if all(misfit(count, width, spaced) for count in entries):
        raise ValueError(
            f"line {table.rows[0].line} has {entries[0]} entries, but there are {width} columns "
            f"({table.head.place}: {listed(table.head)})"
        )


def listed(head: Head) -> str:
    """Returns how messages call the columns."""
    if any(head.names):
        return "the columns " + ", ".join(repr(name) for name in head.names)
    return f"{len(head.names)} columns without names"


def numbers_of(rows: Sequence[Row], column: Column) -> np.ndarray:
    """Returns the numbers of a column of the first block in SI units, NaN where there is none."""
    return np.array(
        [column.si(row.cells[column.place]) if column.place < len(row.cells) else np.nan
         for row in rows]
    )  # fmt: skip
