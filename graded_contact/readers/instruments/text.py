"""Heights in plain text: a matrix, a line scan x z, or points x y z, in any usual layout.

A row of text is a line along x, as in the exports of microscopes. Lines before the numbers are a
header. Words between the numbers ("nan", "---", "BAD") are missing points, and are reported. What
could be read in two ways is refused.
"""

import contextlib
import math
import re
from typing import NamedTuple

import numpy as np

from ...core.files import Refusal
from ..cells import COMMENT, LONGEST, TextLayout, is_missing, lines_of, text_layout
from ..registry import File, reader
from ..scan import Scan, equally_spaced, from_lines
from ..units import length_unit

_BARE_UNIT = re.compile(r"^\W*(unit|einheit)", re.IGNORECASE)
_OF_HEIGHTS = re.compile(r"unit|einheit|height|höhe|\bz\b|value|wert|topograph|depth", re.I)
_OF_LENGTHS = re.compile(r"width|length|size|pixel|step|spacing|lateral|area|range|\b[xy]\b", re.I)
_QUOTED = re.compile(r'(?:^|[\t;, ])"[^"]*[\t;, ][^"]*"')  # a cell with a separator
_EQUAL = 1e-3  # of a step: how far points may lie from equal spacing
_BESIDE = 0.05  # of a step: how far points may lie beside a grid
_SAID = 0.002  # of a step: from where on the history says so
_BETWEEN = 0.25  # of the largest gap: gaps between lines of scattered points
_MOST_WORDS = 8  # different ones that can all mean a missing point


class _Table(NamedTuple):
    """Numbers of a text, NaN where missing; the header's lines, and the layout."""

    values: np.ndarray
    header: list[str]
    layout: TextLayout
    notes: list[str]


@reader("text", "heights", knows=lambda file: file.text is not None, rank=2)
def read_text_file(file: File) -> Scan:
    """Returns the heights in a text without a header that SurfaceTopography knows."""
    return read_text(file.text or "")


def read_text(text: str) -> Scan:
    """Returns the heights in a text, or raises `Refusal`."""
    table = _table(lines_of(text))
    if len(table.values) == 1:
        table = table._replace(values=table.values.T)
    if table.values.shape[1] == 1:
        scan = Scan(table.values[:, 0], "one line of heights", unit=_matrix_unit(table.header))
    else:
        scan = {2: _line_scan, 3: _grid_points}.get(table.values.shape[1], _matrix_scan)(table)
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
    mark = layout.separator
    spare = width > 1 and mark and all(line.rstrip(" ").endswith(mark) for line in body.values())
    rows: list[list[float]] = []
    words: dict[str, None] = {}
    for number, line in body.items():
        cells = layout.split(line)
        if len(cells) != width:
            raise Refusal(f"line {number} has {len(cells)} cells, those before it {width}")
        cells = cells[: width - 1] if spare else cells
        rows.append(_numbers(line, number, cells, layout))
        lost = [cell[:20] for cell, value in zip(cells, rows[-1], strict=True) if value != value]
        words |= dict.fromkeys(lost)
        if len(words) > _MOST_WORDS:
            raise Refusal(f"line {number} contains {[*words][-1]!r}, earlier lines other words")
    values = np.array(rows)
    if values.size < 4:
        raise Refusal("it holds no table of numbers")
    notes = [f"Read as text with {layout}."]
    if words:
        notes.append(f"Missing points are written {', '.join(map(repr, words))}.")
    return _Table(values, header, layout, notes)


def _layout(lines: list[str]) -> TextLayout:
    """The layout in which most cells are numbers, unless commas have two meanings."""
    layout = text_layout(lines, 1)
    if layout != (",", "."):
        return layout
    parts = [line.split(",") for line in lines[-60:]]
    remedy = "write decimal points, or separate the columns by semicolons"
    if any(re.fullmatch(r"\s*0\d+\s*", cell) for cells in parts for cell in cells):
        raise Refusal(f"its commas seem to be decimal marks and to separate columns too; {remedy}")
    whole = re.compile(r"\s*[-+]?\d+,\d+\s*")
    if all(map(whole.fullmatch, lines[-60:])):
        if np.all(np.diff([float(left) for left, _ in parts]) > 0):
            raise Refusal(f"its commas may be decimal marks or separate two columns; {remedy}")
        return TextLayout(None, ",")
    return layout


def _is_data(cells: list[str]) -> bool:
    """Whether cells hold numbers, and otherwise only marks of missing points."""
    known = [cell for cell in cells if not is_missing(cell)]
    return bool(known) and None not in map(_number, known)


def _numbers(line: str, place: int, cells: list[str], layout: TextLayout) -> list[float]:
    """The numbers in the cells of a line; NaN for words and infinities."""
    odd = "_." if layout.decimal == "," else "_"
    with contextlib.suppress(ValueError):  # words, and marks between thousands
        if not any(character in line for character in odd):
            values = [float(cell.replace(layout.decimal, ".")) for cell in cells]
            return [value if math.isfinite(value) else math.nan for value in values]
    values = []
    for cell in layout.cells(line)[: len(cells)]:
        value = _number(cell)
        if value is None and any(character.isdigit() for character in cell):
            raise Refusal(f"line {place} holds {cell[:40]!r}, which is no number")
        values.append(value if value is not None and math.isfinite(value) else math.nan)
    return values


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


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
    notes = []
    known = np.isfinite(x)
    if not np.all(known):
        notes.append(f"Left out {np.sum(~known)} lines without a position.")
        x, z = x[known], z[known]
    steps = np.diff(x)
    if np.sum(steps < 0) > np.sum(steps > 0):
        x, z, steps = x[::-1], z[::-1], -steps[::-1]
    back = np.sum(steps <= 0)
    if back > 0.01 * len(steps):
        raise Refusal("its first column (the position) goes back and forth")
    if back:
        notes.append(f"Sorted {back} points whose position stepped back.")
        x, first = np.unique(x, return_index=True)
        z = z[first]
    num = len(x)
    if num < 4:
        raise Refusal("it has fewer than 4 points")
    lateral, unit = _column_units(table)
    if lateral is None and np.array_equal(x - x[0], np.arange(num)) and x[0] in (0, 1):
        notes.append("The first column counts the points; it is no position.")
        return Scan(z, "a column of heights", unit=unit, notes=tuple(notes))
    size = np.array([(x[-1] - x[0]) * num / (num - 1)])
    positions = None if equally_spaced(x, _EQUAL) else x - x[0]
    return Scan(z, "a line scan", size, unit, lateral, positions, notes=tuple(notes))


def _grid_points(table: _Table) -> Scan:
    """Points x y z of a grid, in any order; those that the file leaves out are missing."""
    x, y, z = table.values.T
    if not np.all(np.isfinite(x) & np.isfinite(y)):
        raise Refusal("some of its points lack a position")
    (i, step_x, off_x), (j, step_y, off_y) = _grid_lines(x, "x"), _grid_lines(y, "y")
    places, steps, off = (i, j), (step_x, step_y), max(off_x, off_y)
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
    scan = Scan(heights, "points x y z", size, unit, lateral)
    note = f"Its x and y lie up to {off:.1%} of a step beside a grid; the heights are taken on it."
    return scan._replace(notes=(note,)) if off > _SAID else scan


def _grid_lines(axis: np.ndarray, name: str) -> tuple[np.ndarray, float, float]:
    """Numbers of grid lines, their distance, and how far points lie beside them, in steps."""
    low, span = axis.min(), np.ptp(axis)
    ordered = np.sort(axis)
    gaps = np.diff(ordered)
    between = gaps > _BETWEEN * np.max(gaps, initial=0)
    gaps = gaps[gaps > 1e-6 * span]  # rounding makes several levels of one
    # Scattered points make a cloud of each line; a grid may lack some lines.
    clouds = len(gaps) > 2 * np.count_nonzero(between)
    if clouds:
        cloud = np.concatenate([[0], np.cumsum(between)])
        gaps = np.diff(np.bincount(cloud, ordered - low) / np.bincount(cloud))
    if len(gaps) < 3 and not clouds:
        raise Refusal(f"its points x y z have fewer than 4 values of {name}")
    step = span / max(round(span / float(np.median(gaps))), 1) if len(gaps) else span
    place = np.rint((axis - low) / step)
    if clouds and len(gaps):
        step, low = np.polyfit(place, axis, 1)
        place = np.rint((axis - low) / step)
    off = float(np.max(np.abs(axis - low - place * step)) / step)
    if len(gaps) < 3 or off > _BESIDE:
        remedy = "interpolate them onto one, for instance by `scipy.interpolate.griddata`"
        uneven = f"their {name} is not equally spaced"
        raise Refusal(f"its points x y z form no grid, as {uneven}: {remedy}")
    return place.astype(int), float(step), off


def _matrix_scan(table: _Table) -> Scan:
    values, unit = table.values, _matrix_unit(table.header)
    lateral, corner = None, None
    labels = [_axis_step(values[0, 1:]), _axis_step(values[1:, 0])]
    if labels[0] is None and table.header:  # the labels of columns may be in the header
        cells = table.layout.cells(table.header[-1])
        if len(cells) == values.shape[1] and None not in map(_number, cells[1:]):
            labels = [_axis_step(np.array(cells[1:], float)), _axis_step(values[:, 0])]
            values = np.concatenate([np.full((1, values.shape[1]), np.nan), values])
            corner = length_unit(cells[0])
    if any(labels) and not all(labels):
        line = "row" if labels[0] else "column"
        raise Refusal(f"its first {line} increases in equal steps, like an axis: remove it")
    if not all(labels):
        return Scan(from_lines(values), "a matrix of heights", unit=unit)
    notes = ["Its first row and first column were taken as x and y."]
    if corner is not None:
        unit, lateral = unit or corner, corner
        notes.append(f"The unit {corner!r} in its corner is that of x and y, and of the heights "
                     f"unless the header names another.")  # fmt: skip
    steps = np.array([label for label in labels if label])
    along_x, along_y = np.sign(steps).astype(int)
    heights = values[1:, 1:].T[::along_x, ::along_y]
    size = np.abs(steps) * heights.shape
    return Scan(heights, "a matrix of heights", size, unit, lateral, notes=tuple(notes))


def _axis_step(values: np.ndarray) -> float | None:
    """The step of equally spaced numbers, or None."""
    if len(values) < 4 or not np.all(np.isfinite(values)) or not equally_spaced(values, 1e-4):
        return None
    return float((values[-1] - values[0]) / (len(values) - 1)) or None
