"""Heights in plain text: a matrix, a line scan x z, or points x y z, in any usual layout.

A row of text is a line along x, as in the exports of microscopes. Lines before the numbers are a
header. Words between the numbers ("nan", "---", "BAD") are missing points, and are reported. What
could be read in two ways is refused.
"""

import io
import re
from typing import NamedTuple

import numpy as np

from .cells import COMMENT, LONGEST, TextLayout, is_missing, lines_of, text_layout
from .formats import Scan, equally_spaced
from .paths import Refusal
from .units import length_unit

_BARE_UNIT = re.compile(r"^\W*(unit|einheit)", re.IGNORECASE)
_OF_HEIGHTS = re.compile(r"unit|einheit|height|höhe|\bz\b|value|wert|topograph|depth", re.I)
_OF_LENGTHS = re.compile(r"width|length|size|pixel|step|spacing|lateral|area|range|\b[xy]\b", re.I)
_QUOTED = re.compile(r'(?:^|[\t;, ])"[^"]*[\t;, ][^"]*"')  # a cell with a separator
_EQUAL = 1e-3  # of a step: how far points may lie from equal spacing
_MOST_WORDS = 8  # different ones that can all mean a missing point


class _Table(NamedTuple):
    """Numbers of a text, NaN where missing; the header's lines, and the layout."""

    values: np.ndarray
    header: list[str]
    layout: TextLayout
    notes: list[str]


def read_text(text: str) -> Scan:
    """Returns the heights in a text, or raises `Refusal`."""
    table = _table(lines_of(text))
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
    if max(map(len, lines), default=0) > LONGEST:
        raise Refusal("its lines are too long for a table")
    body = {
        number: line
        for number, line in enumerate(lines, start=1)
        if line.strip() and not COMMENT.match(line) and not line.lstrip().startswith("*")
    }
    if not any(map(_QUOTED.search, body.values())):
        body = {number: line.replace('"', "") for number, line in body.items()}
    layout = _layout(list(body.values()))
    first = next((number for number, line in body.items() if _is_data(layout.cells(line))), None)
    if first is None:
        raise Refusal("it holds no table of numbers")
    header = [line.strip() for line in lines[: first - 1] if line.strip()]
    body = {number: line for number, line in body.items() if number >= first}
    width = len(layout.split(body[first]))
    spare = width > 1  # a separator at the end of every line
    for number, line in body.items():
        cells = layout.split(line)
        if len(cells) != width:
            raise Refusal(f"line {number} has {len(cells)} cells, those before it {width}")
        spare = spare and cells[-1] == ""
    values = _numbers(body, layout)
    if spare:
        values = values[:, :-1]
    if values.size < 4:
        raise Refusal("it holds no table of numbers")
    notes = [f"Read as text with {layout}."]
    words: list[str] = []
    lost = ~np.isfinite(values)
    for number, missing in zip(body, lost, strict=True):
        if np.any(missing):
            cells = layout.split(body[number])
            words = list(dict.fromkeys([*words, *(cells[i][:20] for i in np.flatnonzero(missing))]))
        if len(words) > _MOST_WORDS:
            raise Refusal(
                f"line {number} contains {words[-1]!r}; earlier lines contain other words"
            )
    if words:
        notes.append(f"Missing points are written {', '.join(map(repr, words))}.")
    return _Table(np.where(lost, np.nan, values), header, layout, notes)


def _layout(lines: list[str]) -> TextLayout:
    """The layout in which most cells are numbers, unless commas have two meanings."""
    layout = text_layout(lines, 1)
    if layout != (",", "."):
        return layout
    parts = [line.split(",") for line in lines[-60:]]
    if any(re.fullmatch(r"\s*0\d+\s*", cell) for cells in parts for cell in cells):
        raise Refusal(
            "its commas seem to be decimal marks and to separate columns too: whole numbers do not "
            "begin with 0; write decimal points, or separate the columns by semicolons"
        )
    if all(
        len(p) == 2 and re.fullmatch(r"\s*[-+]?\d+", p[0]) and re.fullmatch(r"\d+\s*", p[1])
        for p in parts
    ):
        if np.all(np.diff([float(p[0]) for p in parts]) > 0):
            raise Refusal(
                "its commas may be decimal marks or separate two columns; write decimal points, or "
                "separate the columns by semicolons"
            )
        return TextLayout(None, ",")
    return layout


def _is_data(cells: list[str]) -> bool:
    """Whether cells hold numbers, and otherwise only marks of missing points."""
    numbers = [_number(cell) is not None and not is_missing(cell) for cell in cells]
    return any(numbers) and all(
        number or is_missing(cell) for number, cell in zip(numbers, cells, strict=True)
    )


def _numbers(body: dict[int, str], layout: TextLayout) -> np.ndarray:
    """The numbers of lines with equally many cells, by line number."""
    import pandas as pd

    separator = layout.separator
    lines = (" ".join(line.split()) for line in body.values()) if separator is None else (
        body.values()
    )  # fmt: skip
    text = io.StringIO("\n".join(lines))
    try:
        table = pd.read_csv(text, sep=separator or " ", decimal=layout.decimal, header=None,
                            index_col=False, dtype=float, skipinitialspace=True)  # fmt: skip
        return np.ascontiguousarray(table.to_numpy())
    except ValueError:  # some cells are words, or have marks between thousands
        return np.array(
            [[_number_or_word(cell, number) for cell in layout.cells(line)]
             for number, line in body.items()]
        )  # fmt: skip


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _number_or_word(cell: str, line: int) -> float:
    value = _number(cell)
    if value is None and any(character.isdigit() for character in cell):
        raise Refusal(f"line {line} holds {cell[:40]!r}, which is no number")
    return np.nan if value is None else value


def _column_units(table: _Table) -> list[str | None]:
    """The unit in the heading of each column, from the header's last two lines."""
    width = table.values.shape[1]
    units: list[str | None] = [None] * width
    for line in table.header[-2:]:
        cells = table.layout.split(COMMENT.sub("", line, count=1))
        cells = cells if len(cells) == width else re.split(r"[\t;,]|\s{2,}", line)
        if len(cells) == width:
            units = [length_unit(cell) or old for cell, old in zip(cells, units, strict=True)]
    return units


def _matrix_unit(header: list[str]) -> str | None:
    """The unit of heights that the header names, if it names one only."""
    lines = [line for line in header if _OF_HEIGHTS.search(line) or _BARE_UNIT.search(line)]
    units = {length_unit(line) for line in lines if not _OF_LENGTHS.search(line)} - {None}
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
        raise Refusal("its first column (the position) goes back and forth")
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
    return Scan(
        z,
        "a line scan",
        size=np.array([(x[-1] - x[0]) * num / (num - 1)]),
        unit=unit,
        lateral_unit=lateral,
        positions=None if equally_spaced(x, _EQUAL) else x - x[0],
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
    gaps = np.diff(np.unique(axis))
    gaps = gaps[gaps > 1e-6 * span]  # rounding makes several levels of one
    if len(gaps) < 3:
        raise Refusal(f"its points x y z have fewer than 4 values of {name}")
    step = span / max(round(span / float(np.median(gaps))), 1)
    place = np.rint((axis - low) / step)
    if np.max(np.abs(axis - low - place * step)) > 0.05 * step:
        raise Refusal(f"its points x y z form no grid: their {name} is not equally spaced")
    return place.astype(int), step


def _matrix(table: _Table) -> Scan:
    values, unit = table.values, _matrix_unit(table.header)
    lateral, corner = None, None
    labels = [_axis(values[0, 1:]), _axis(values[1:, 0])]
    if labels[0] is None and table.header:  # the labels of columns may be in the header
        cells = table.layout.cells(table.header[-1])
        if len(cells) == values.shape[1] and None not in map(_number, cells[1:]):
            labels = [_axis(np.array(cells[1:], float)), _axis(values[:, 0])]
            values = np.concatenate([np.full((1, values.shape[1]), np.nan), values])
            corner = length_unit(cells[0])
    if any(labels) and not all(labels):
        line = "row" if labels[0] else "column"
        raise Refusal(f"its first {line} increases in equal steps, like an axis: remove it")
    if not all(labels):
        return Scan(values.T, "a matrix of heights", unit=unit)
    notes = ["Its first row and first column were taken as x and y."]
    if corner is not None:
        unit, lateral = unit or corner, corner
        notes.append(f"The unit {corner!r} in its corner is that of x and y, and of the heights "
                     f"unless the header names another.")  # fmt: skip
    heights = values[1:, 1:].T
    size = np.array(heights.shape) * np.abs([label for label in labels if label])
    return Scan(heights, "a matrix of heights", size, unit, lateral, notes=tuple(notes))


def _axis(values: np.ndarray) -> float | None:
    """The step of equally spaced numbers, or None."""
    if len(values) < 4 or not np.all(np.isfinite(values)) or not equally_spaced(values, 1e-4):
        return None
    return float((values[-1] - values[0]) / (len(values) - 1)) or None
