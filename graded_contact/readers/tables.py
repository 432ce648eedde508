"""Tables of numbers: a line of names with units, and numbers below it.

A plain table needs no option. A table in another layout, or with other names, is refused, and the
error shows its lines and the call to write. What looks likely stands in that call, never in the
numbers.
"""

import io
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.files import read_file
from .layouts import (
    SEPARATORS,
    SPACES,
    Section,
    cells_of,
    likely_layout,
    likely_marks,
    number_in,
    numbers_in,
    pointed,
    sections_of,
    text_lines,
)
from .source import Layout, NotPlain, Source, damage_named
from .units import OFFSETS, UNITS, parse_unit, split_heading

_SHOWN = 3  # lines of a table in a message
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
_EMPTY = ("", "-", "nan", "n/a", "na")
_NUMBER = re.compile(r"[-+.]?\d[-+\d.,'e]*", re.IGNORECASE)  # of any mark
_COMMA = re.compile(r"(?:^|[\t; ])[-+]?\d+,\d+(?:$|[\t; e])")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}\.\d{3}")

LAYOUT = ("header", "end", "section", "sheet", "separator", "decimal")


class DataColumn(NamedTuple):
    """A column: its place from 0, its name (may be empty), and its unit, None if there is none."""

    place: int
    name: str
    unit: str | None

    @property
    def label(self) -> str:
        """Its number and name, for messages."""
        return f"column {self.place + 1}" + f" ({self.name})" * bool(self.name)


class DataTable(NamedTuple):
    """A table as it was read.

    **Fields:**

    - `source`: the file with its options.
    - `columns`: with names and units.
    - `rows`: cells, by the number of their line in the file.
    """

    source: Source
    columns: list[DataColumn]
    rows: dict[int, list[str]]

    @property
    def lines(self) -> np.ndarray:
        """The numbers of the lines in the file."""
        return np.array(list(self.rows))

    def not_plain(self, reasons: Sequence[str], **options: Any) -> NotPlain:
        """Returns the error that shows the names and the first lines."""
        heads = [f"{c.name} [{c.unit}]" if c.unit else c.name for c in self.columns]
        shown = [f"names: {' | '.join(heads)}"] * any(heads)
        first = list(self.rows.items())[:_SHOWN]
        shown += [f"line {number}: {' | '.join(row)}" for number, row in first]
        return self.source.not_plain(reasons, shown, **options)

    def numbers(self, column: DataColumn, dimension: str, unit: str) -> np.ndarray:
        """Returns the numbers of a column in SI units, NaN for empty cells."""
        cells = [row[column.place] for row in self.rows.values()]
        values = [number_in(cell) for cell in cells]
        for line, cell, value in zip(self.rows, cells, values, strict=True):
            # "05" stands behind a decimal comma that separates cells.
            if re.match(r"[-+]?0\d", cell) or (value is None and cell.lower() not in _EMPTY):
                comma = {"decimal": ","} if re.fullmatch(r"[-+]?\d+,\d+", cell) else {}
                reason = f"line {line}, {column.label}: {cell[:40]!r} is no number"
                raise self.source.not_plain([reason], layout=comma)
        self._check_points(column, cells)
        numbers = np.array([np.nan if value is None else value for value in values], float)
        return UNITS[dimension][unit] * numbers + OFFSETS.get(unit, 0.0)

    def _check_points(self, column: DataColumn, cells: list[str]) -> None:
        """Refuses 250 beside 3.250, which may be 3250."""
        pointed = [cell for cell in cells if "." in cell]
        thousands = [cell for cell in pointed if _THOUSANDS.fullmatch(cell)]
        if "decimal" in self.source.options.get("layout", {}) or len(pointed) == len(cells):
            return
        if thousands == pointed and any(cell.endswith("0") for cell in thousands):
            reason = f"{column.label}: the point of {thousands[0]} may stand between thousands"
            raise self.not_plain([reason], layout={"decimal": "..."})


def read_table(source: Source) -> DataTable:
    """Returns the table of a text or a workbook.

    The option `layout` of the source has:

    - "header": number of the line of names, from 1. By default the first line that is not empty; a
      line of numbers has no names, and the comment ("#") above it is used if it fits. A line of
      units may stand below.
    - "end": number of the last line of numbers.
    - "section": name of a table in a text with several.
    - "sheet": of a workbook with several.
    - "separator": between cells; by default a tab, semicolon or comma if the last line has one,
      else spaces.
    - "decimal": the decimal mark, by default a point.
    """
    layout = source.options.get("layout", {})
    if unknown := sorted(set(layout) - set(LAYOUT)):
        raise ValueError(f"`layout` has {unknown}: use {list(LAYOUT)}.")
    content = read_file(source.path)
    header, lines, named = layout.get("header", 0), {}, []
    if content.startswith(_WORKBOOKS):
        rows = _rows_of_book(source, content, layout)
    else:
        header, lines = _chosen_lines(source, text_lines(content), layout)
        separator = _separator(lines, layout)
        rows = _rows_of_text(source, lines, header, separator)
        named = _comment_above(lines, rows, separator)
    names = rows.pop(header, []) if header else _popped_words(rows) or named
    if names and all(number_in(cell) is not None for cell in names):
        raise source.not_plain([f"line {header} has numbers, no names"])
    units = _popped_words(rows)
    width = len(rows[max(rows)]) if rows else 0
    odd = [f"line {n} has {len(row)} cells" for n, row in rows.items() if len(row) != width]
    if odd or len(rows) < 2:
        raise _uneven(source, [*odd[:1], f"its last line has {width}"], lines)
    names = names if len(names) == width else [""] * width
    units = units if len(units) == width else [""] * width
    return DataTable(source, [_column(i, names[i], units[i]) for i in range(width)], rows)


def _chosen_lines(source: Source, lines: dict[int, str], layout: Layout) -> tuple[int, dict]:
    """The number of the line of names, 0 if it is the first, and the lines from there."""
    header, last = layout.get("header", 0), layout.get("end", np.inf)
    if "section" in layout:
        section = _section_named(source, lines, layout)
        header, last = section.header, section.last
    return header, {number: line for number, line in lines.items() if header <= number <= last}


def _section_named(source: Source, lines: dict[int, str], layout: Layout) -> Section:
    """The section of a text; refused if several have its name, or its numbers are interrupted."""
    separator = layout.get("separator") or likely_marks(lines)[0]
    found = sections_of(lines, separator, layout.get("decimal", "."))
    places = [i for i, section in enumerate(found) if section.name == layout["section"]]
    if len(places) != 1:
        names = list(dict.fromkeys(section.name for section in found if section.name))
        reason = f"{len(places) or 'no'} sections are {layout['section']!r}; it has {names}"
        raise source.not_plain([reason], layout={"section": "..."})
    section, following = found[places[0]], found[places[0] + 1 :]
    before = found[places[0] - 1].last if places[0] else 0
    after = following[0].header if following else np.inf
    outside = {n: line for n, line in lines.items() if before < n < after}
    outside = {n: line for n, line in outside.items() if not section.header <= n <= section.last}
    rows = [cells_of(line, separator, layout.get("decimal")) for line in outside.values()]
    cut = any(len(row) == section.width and numbers_in(row) > 1 for row in rows)
    if cut or (following and not (following[0].name or following[0].named)):
        shown = [f"line {n}: {line}" for n, line in lines.items() if n >= section.header]
        raise source.not_plain([f"its section {section.name!r} is interrupted"], shown[:9])
    return section


def _separator(lines: Mapping[int, str], layout: Layout) -> str:
    lowest = list(lines.values())[-1] if lines else ""
    return layout.get("separator") or next((m for m in SEPARATORS if m in lowest), SPACES)


def _rows_of_text(source: Source, lines: Mapping[int, str], header: int, separator: str) -> dict:
    """The cells of the lines that are no comments."""
    decimal = source.options.get("layout", {}).get("decimal")
    lines = {n: line for n, line in lines.items() if not line.startswith("#") or n == header}
    if decimal is None and separator != "," and any(map(_COMMA.search, lines.values())):
        raise _uneven(source, ["it has commas in its numbers"], lines)
    return {n: cells_of(line.lstrip("# "), separator, decimal) for n, line in lines.items()}


def _comment_above(lines: Mapping[int, str], rows: Mapping, separator: str) -> list[str]:
    """The cells of the comment above the first row, if there are as many words."""
    first = next(iter(rows), 0)
    above = [line for number, line in lines.items() if number < first]
    cells = cells_of(above[-1].lstrip("# "), separator) if above else []
    return cells if cells and len(cells) == len(rows[first]) and _are_words(cells) else []


def _rows_of_book(source: Source, content: bytes, layout: Layout) -> dict[int, list[str]]:
    import pandas as pd

    sheet, decimal = layout.get("sheet"), layout.get("decimal")
    with damage_named(source.path), pd.ExcelFile(io.BytesIO(content)) as book:
        names = list(map(str, book.sheet_names))
        if sheet not in names and (sheet is not None or len(names) > 1):
            raise source.not_plain([f"its sheets are {names}: choose one"], layout={"sheet": "..."})
        frame: Any = book.parse(sheet or names[0], header=None, dtype=str)
    lines = ([cell.strip() for cell in row] for row in frame.fillna("").values.tolist())
    first, last = layout.get("header", 1), layout.get("end", np.inf)
    return {
        n: pointed(row, decimal)
        for n, row in enumerate(lines, start=1)
        if any(row) and first <= n <= last
    }


def _popped_words(rows: dict[int, list[str]]) -> list[str]:
    """Takes the first row, if none of its cells is a number."""
    first = next(iter(rows), None)
    return rows.pop(first) if first is not None and _are_words(rows[first]) else []


def _are_words(cells: Sequence[str]) -> bool:
    return not any(_NUMBER.fullmatch(cell) and not parse_unit(cell) for cell in cells)


def _column(place: int, name: str, unit_below: str) -> DataColumn:
    bare, unit = split_heading(name)
    if below := unit_below.strip("[]() "):
        bare, unit = name, parse_unit(below) or below
    return DataColumn(place, bare.strip(), unit)


def _uneven(source: Source, reasons: Sequence[str], lines: Mapping[int, str]) -> NotPlain:
    """The error of a text whose lines differ, with those where its table seems to begin."""
    likely = likely_layout(lines)
    if "section" in likely:
        sections = sections_of(lines, *likely_marks(lines))
        reasons = [*reasons, f"its sections are {[s.name for s in sections if s.name]}"]
    first = likely.get("header", 0) - 1
    shown = [f"line {number}: {line}" for number, line in lines.items() if number >= first]
    return source.not_plain(reasons, shown[: _SHOWN + 1], layout=likely)
