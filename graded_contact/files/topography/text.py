"""Heights in plain text: a matrix, a line scan x z, or points x y z, in any usual layout.

A row of text is a line along x, as in the exports of microscopes. Numbers may have decimal commas;
columns are separated by tabs, semicolons, commas or spaces. Lines before the numbers are a header.
Words between the numbers ("nan", "---", "BAD") stand for missing points, and are told. What could
be read in two ways is refused.
"""

import re
from typing import NamedTuple

import numpy as np

from .scan import Refusal, Scan, unit_in

_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", None: "spaces"}
_MISSING = {"", "nan", "inf", "-inf", "+inf", "infinity", "-infinity", "-nan", "+nan"}
_COMMENT = re.compile(r"^\s*(#|%|!|//|\*)")
_BARE_UNIT = re.compile(r"^\W*(unit|einheit)", re.IGNORECASE)
_OF_HEIGHTS = re.compile(r"unit|einheit|height|höhe|\bz\b|value|wert|topograph|depth", re.I)
_OF_LENGTHS = re.compile(r"width|length|size|pixel|step|spacing|lateral|area|range|\b[xy]\b", re.I)
_EQUAL = 1e-3  # of a step: how far points may lie from equal spacing
_LONGEST = 10_000_000  # characters of a line


class _Table(NamedTuple):
    """Numbers of a text, NaN where missing; the header's lines, and how it was split."""

    values: np.ndarray
    header: list[str]
    separator: str | None
    notes: list[str]


def decoded(content: bytes) -> str | None:
    """Returns the content of a text file, or None if it is none."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    if b"\0" in content[:100_000] or not content.strip():
        return None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    odd = sum(not (character.isprintable() or character.isspace()) for character in text[:10_000])
    return None if odd > 0.01 * len(text[:10_000]) else text


def read_text(text: str) -> Scan:
    """Returns the heights in a text, or raises `Refusal`."""
    table = _table(text.splitlines())
    if len(table.values) == 1:
        table = table._replace(values=table.values.T)
    width = table.values.shape[1]
    if width == 1:
        scan = Scan(table.values[:, 0], "one line of heights", unit=_matrix_unit(table.header))
    elif width == 2:
        scan = _line_scan(table)
    elif width == 3:
        scan = _points(table)
    else:
        scan = _matrix(table)
    return scan._replace(notes=(*table.notes, *scan.notes))


def _table(lines: list[str]) -> _Table:
    if max(map(len, lines), default=0) > _LONGEST:
        raise Refusal("its lines are too long for a table")
    separator, decimal = _layout(lines)
    header: list[str] = []
    rows: list[list[float]] = []
    words: dict[str, int] = {}
    width = spare = 0
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        if _COMMENT.match(line):
            header += [] if rows else [line.strip()]
            continue
        cells = _split(line, separator, decimal)
        if not rows:
            if not _starts_data(cells, len(lines)):
                header.append(line.strip())
                continue
            width = len(cells)
        if len(cells) != width:
            raise Refusal(f"line {number} has {len(cells)} cells, those before it {width}")
        spare += cells[-1] == ""
        rows.append([_number(cell, number, words) for cell in cells])
    values = np.array(rows, float).reshape(len(rows), width)
    if spare == len(rows) and width > 1:  # a separator at the end of every line
        words[""] -= spare
        values = values[:, :-1]
    if values.size < 4:
        raise Refusal("it holds no table of numbers")
    values[~np.isfinite(values)] = np.nan
    mark = " and decimal commas" if decimal == "," else ""
    notes = [f"Read as text with {_SEPARATORS[separator]}{mark}."]
    spelt = ", ".join(repr(word) for word, count in words.items() if count)
    if spelt:
        notes.append(f"Missing points are written {spelt}.")
    return _Table(values, header, separator, notes)


def _layout(lines: list[str]) -> tuple[str | None, str]:
    """The separator and the decimal mark under which most cells are numbers."""
    sample = [line for line in lines if line.strip() and not _COMMENT.match(line)][-60:]

    def score(candidate):
        cells = [cell for line in sample for cell in _split(line[:10_000], *candidate)]
        numbers = sum(map(_is_number, cells))
        return 2 * numbers - (len(cells) - numbers - cells.count(""))

    best = max(((s, d) for d in ".," for s in _SEPARATORS), key=score)
    parts = [line.split(",") for line in sample]
    if best == (",", ".") and any(re.fullmatch(r"\s*0\d+\s*", cell) for p in parts for cell in p):
        raise Refusal(
            "its commas seem to be decimal marks and to separate columns too: whole numbers do not "
            "begin with 0; write decimal points, or separate the columns by semicolons"
        )
    if best == (",", ".") and all(
        len(p) == 2 and re.fullmatch(r"\s*[-+]?\d+", p[0]) and re.fullmatch(r"\d+\s*", p[1])
        for p in parts
    ):
        first = np.array([float(p[0]) for p in parts])
        if np.all(np.diff(first) > 0):
            raise Refusal(
                "its commas may be decimal marks or separate two columns; write decimal points, or "
                "separate the columns by semicolons"
            )
        return None, ","
    return best


def _split(line: str, separator: str | None, decimal: str) -> list[str]:
    cells = [cell.strip().strip('"').strip() for cell in line.split(separator)]
    return [cell.replace(",", ".") for cell in cells] if decimal == "," else cells


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def _starts_data(cells: list[str], num_lines: int) -> bool:
    """Whether the numbers begin here: with nothing else, and no lone number above a table."""
    numbers = [_is_number(cell) and cell.lower() not in _MISSING for cell in cells]
    known = all(n or cell.lower() in _MISSING for n, cell in zip(numbers, cells, strict=True))
    return known and any(numbers)


def _number(cell: str, line: int, words: dict[str, int]) -> float:
    if _is_number(cell):
        value = float(cell)
        if np.isfinite(value):
            return value
    elif any(character.isdigit() for character in cell):
        raise Refusal(f"line {line} holds {cell[:40]!r}, which is no number")
    words[cell[:20]] = words.get(cell[:20], 0) + 1
    if len(words) > 8:
        raise Refusal(f"line {line} holds {cell[:40]!r}, and before it stand other words")
    return np.nan


def _column_units(table: _Table) -> list[str | None]:
    """The unit in the heading of each column, from the header's last two lines."""
    width = table.values.shape[1]
    units: list[str | None] = [None] * width
    for line in table.header[-2:]:
        cells = [c.strip() for c in _COMMENT.sub("", line, count=1).split(table.separator)]
        cells = cells if len(cells) == width else re.split(r"[\t;,]|\s{2,}", line)
        if len(cells) == width:
            units = [unit_in(cell) or old for cell, old in zip(cells, units, strict=True)]
    return units


def _matrix_unit(header: list[str]) -> str | None:
    """The unit of heights that the header names, if it names one only."""
    lines = [line for line in header if _OF_HEIGHTS.search(line) or _BARE_UNIT.search(line)]
    units = {unit_in(line) for line in lines if not _OF_LENGTHS.search(line)} - {None}
    return units.pop() if len(units) == 1 else None


def _line_scan(table: _Table) -> Scan:
    x, z = table.values.T
    known = np.isfinite(x)
    notes = []
    if not np.all(known):
        notes.append(f"Left out {np.sum(~known)} lines without a position.")
        x, z = x[known], z[known]
    steps = np.diff(x)
    if np.sum(steps < 0) > np.sum(steps > 0):
        x, z, steps = x[::-1], z[::-1], -steps[::-1]
    if np.sum(steps <= 0) > 0.01 * len(steps):
        raise Refusal("its first column, the position, goes back and forth")
    lateral, unit = _column_units(table)
    if np.any(steps <= 0):
        notes.append(f"Sorted {np.sum(steps <= 0)} points whose position stepped back.")
        x, first = np.unique(x, return_index=True)
        z = z[first]
    num = len(x)
    if num < 4:
        raise Refusal("it has fewer than 4 points")
    if lateral is None and np.array_equal(x - x[0], np.arange(num)) and x[0] in (0, 1):
        notes.append("The first column counts the points; it is no position.")
        return Scan(z, "a column of heights", unit=unit, notes=tuple(notes))
    span = x[-1] - x[0]
    even = np.linspace(x[0], x[-1], num)
    equal = np.max(np.abs(x - even)) <= _EQUAL * span / (num - 1)
    return Scan(
        z,
        "a line scan",
        size=np.array([span * num / (num - 1)]),
        unit=unit,
        lateral_unit=lateral,
        positions=None if equal else x - x[0],
        notes=tuple(notes),
    )


def _points(table: _Table) -> Scan:
    """Points x y z of a grid, in any order; those that the file leaves out are missing."""
    x, y, z = table.values.T
    if not np.all(np.isfinite(x) & np.isfinite(y)):
        raise Refusal("some of its points lack a position")
    places, steps = zip(*(_places(axis, name) for axis, name in ((x, "x"), (y, "y"))), strict=True)
    shape = tuple(int(place.max()) + 1 for place in places)
    if np.prod(shape, dtype=float) > 20 * len(z):
        raise Refusal("its points x y z form no grid")
    heights = np.full(shape, np.nan)
    if len(np.unique(np.ravel_multi_index(places, shape))) < len(z):
        raise Refusal("two of its points x y z have the same place")
    heights[places] = z
    lateral, across, unit = _column_units(table)
    if lateral != across:
        raise Refusal(f"its x is in {lateral!r} and its y in {across!r}")
    size = np.array(shape) * np.array(steps)
    return Scan(heights, "points x y z", size=size, unit=unit, lateral_unit=lateral)


def _places(axis: np.ndarray, name: str) -> tuple[np.ndarray, float]:
    """Numbers of grid lines, and their distance."""
    low, span = axis.min(), np.ptp(axis)
    levels = np.unique(axis)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-6 * span]  # rounding makes several levels of one
    if len(gaps) < 3:
        raise Refusal(f"its points x y z have fewer than 4 values of {name}")
    step = float(np.median(gaps))
    step = span / max(round(span / step), 1)
    place = np.rint((axis - low) / step)
    if np.max(np.abs(axis - low - place * step)) > 0.05 * step:
        raise Refusal(f"its points x y z form no grid: their {name} is not equally spaced")
    return place.astype(int), step


def _matrix(table: _Table) -> Scan:
    values = table.values
    labels = [_axis(values[0, 1:]), _axis(values[1:, 0])]
    if labels[0] is None and table.header:  # the labels of columns may stand in the header
        cells = _split(table.header[-1], table.separator, ".")
        if len(cells) == values.shape[1] and all(map(_is_number, cells[1:])):
            labels = [_axis(np.array(cells[1:], float)), _axis(values[:, 0])]
            values = np.concatenate([np.full((1, values.shape[1]), np.nan), values])
    if any(labels) and not all(labels):
        line = "row" if labels[0] else "column"
        raise Refusal(f"its first {line} ascends in equal steps: an axis? remove it")
    unit = _matrix_unit(table.header)
    if not all(labels):
        return Scan(values.T, "a matrix of heights", unit=unit)
    heights = values[1:, 1:].T
    size = np.array(heights.shape) * np.abs([label for label in labels if label])
    note = "Its first row and first column were taken as x and y."
    return Scan(heights, "a matrix of heights", size=size, unit=unit, notes=(note,))


def _axis(values: np.ndarray) -> float | None:
    """The step of equally spaced numbers, or None."""
    if len(values) < 4 or not np.all(np.isfinite(values)):
        return None
    step = (values[-1] - values[0]) / (len(values) - 1)
    even = np.max(np.abs(np.diff(values) - step)) <= 1e-4 * abs(step)
    return float(step) if even and step != 0 else None
