"""Heights in plain text: a matrix, a line scan x z, or points x y z, in any usual layout.

A row of text is a line along x, as in the exports of microscopes. Lines before the numbers are a
header. Words between the numbers ("nan", "---", "BAD") are missing points, and are reported. What
could be read in two ways is refused.
"""

import itertools
import re

import numpy as np

from ...core.files import Refusal
from .. import cells
from ..cells import Row, Sheet, TextLayout, is_missing, is_number
from ..registry import File, reader
from ..scan import MOST_POINTS, Scan, equally_spaced, from_lines
from ..units import length_unit

_LONGEST = 10_000_000  # characters of a line
_BARE_UNIT = re.compile(r"^\W*(unit|einheit)", re.IGNORECASE)
_OF_HEIGHTS = re.compile(r"unit|einheit|height|höhe|\bz\b|value|wert|topograph|depth", re.I)
_OF_LENGTHS = re.compile(r"width|length|size|pixel|step|spacing|lateral|area|range|\b[xy]\b", re.I)
_EQUAL = 1e-3  # of a step: how far points may lie from equal spacing
_BESIDE = 0.05  # of a step: how far points may lie beside a grid
_SAID = 0.002  # of a step: from where on the history says so
_BETWEEN = 0.25  # of the largest gap: gaps between lines of scattered points
_MOST_WORDS = 8  # different ones that can all mean a missing point


@reader("text", "heights", knows=lambda file: file.text is not None, rank=2)
def read_text(file: File) -> Scan:
    """Returns the heights in a text without a header that SurfaceTopography knows."""
    text, encoding = file.decoded or ("", "")
    lines = cells.lines_of(text, _LONGEST)
    return heights_in(cells.text_sheet(lines, _layout(lines), encoding, MOST_POINTS))


def _layout(lines: list[str]) -> TextLayout:
    """The layout in which most cells are numbers, unless commas have two meanings."""
    lines = [line for line in lines if line.strip() and not cells.COMMENT.match(line)]
    layout = cells.text_layout(lines, 1)
    if layout[:2] != (",", "."):
        return layout
    parts = [line.split(",") for line in lines[-60:]]
    remedy = "write decimal points, or separate the columns by semicolons"
    if any(re.fullmatch(r"\s*0\d+\s*", part) for line in parts for part in line):
        raise Refusal(f"its commas seem to be decimal marks and to separate columns too; {remedy}")
    whole = re.compile(r"\s*[-+]?\d+,\d+\s*")
    if all(map(whole.fullmatch, lines[-60:])):
        if np.all(np.diff([float(left) for left, _ in parts]) > 0):
            raise Refusal(f"its commas may be decimal marks or separate two columns; {remedy}")
        return TextLayout(None, ",")
    return layout


def heights_in(sheet: Sheet) -> Scan:
    """Returns the heights in the rows of a sheet, or raises `Refusal`."""
    known = (row for row in sheet.rows if not row.comment)
    body = list(itertools.dropwhile(lambda row: not _is_data(row.cells), known))
    if not body:
        raise Refusal("it holds no table of numbers")
    values, header = _values(body, notes := []), [r for r in sheet.rows if r.line < body[0].line]
    if values.shape[1] == 1:
        scan = Scan(values[:, 0], "one line of heights", unit=_matrix_unit(header))
    else:
        read = {2: _line_scan, 3: _grid_points}.get(values.shape[1], _matrix_scan)
        scan = read(values, header)
    if sheet.name:
        return scan._replace(source=sheet.layout, notes=(*notes, *scan.notes))
    return scan._replace(notes=(f"Read as {sheet.layout}.", *notes, *scan.notes))


def _is_data(cells: list[str]) -> bool:
    """Whether cells hold numbers, and otherwise only marks of missing points."""
    known = [cell for cell in cells if not is_missing(cell)]
    return bool(known) and all(map(is_number, known))


def _values(rows: list[Row], notes: list[str]) -> np.ndarray:
    """The numbers in rows of equal width, NaN for words; a single row becomes a column."""
    width = len(rows[0].cells)
    ragged = next((row for row in rows if len(row.cells) != width), None)
    if ragged is not None:
        cells = f"{len(ragged.cells)} cells, those before it {width}"
        raise Refusal(f"line {ragged.line} has {cells}")
    full = [place for place in range(width) if any(row.cells[place] for row in rows)]
    values = np.full((len(rows), full[-1] + 1 - full[0]), np.nan)
    words: dict[str, None] = {}
    for row, numbers in zip(rows, values, strict=True):
        cells = row.cells[full[0] : full[-1] + 1]
        good = [is_number(cell) for cell in cells]
        numbers[good] = [float(cell) for cell, known in zip(cells, good, strict=True) if known]
        lost = [cell[:40] for cell, known in zip(cells, good, strict=True) if not known]
        odd = next((cell for cell in lost if any(map(str.isdigit, cell))), None)
        if odd:
            raise Refusal(f"line {row.line} holds {odd!r}, which is no number")
        words |= dict.fromkeys(lost)
        if len(words) > _MOST_WORDS:
            raise Refusal(f"line {row.line} contains {lost[-1]!r}, earlier lines other words")
    if values.size < 4:
        raise Refusal("it holds no table of numbers")
    if words:
        notes.append(f"Missing points are written {', '.join(map(repr, words))}.")
    return values.T if len(values) == 1 else values


def _column_units(header: list[Row], width: int) -> list[str | None]:
    """The unit in the heading of each column, from the last two rows above."""
    units: list[str | None] = [None] * width
    for row in header[-2:]:
        if len(row.cells) == len(units):
            found = map(length_unit, row.cells)
            units = [unit or old for unit, old in zip(found, units, strict=True)]
    return units


def _matrix_unit(header: list[Row]) -> str | None:
    """The unit of heights that the header names, if it names one only."""
    lines = [row.text for row in header]
    lines = [line for line in lines if _OF_HEIGHTS.search(line) or _BARE_UNIT.search(line)]
    units = {length_unit(line) for line in lines if not _OF_LENGTHS.search(line)} - {None}
    return units.pop() if len(units) == 1 else None


def _line_scan(values: np.ndarray, header: list[Row]) -> Scan:
    x, z = values.T
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
    lateral, unit = _column_units(header, 2)
    if lateral is None and np.array_equal(x - x[0], np.arange(num)) and x[0] in (0, 1):
        notes.append("The first column counts the points; it is no position.")
        return Scan(z, "a column of heights", unit=unit, notes=tuple(notes))
    size = np.array([(x[-1] - x[0]) * num / (num - 1)])
    positions = None if equally_spaced(x, _EQUAL) else x - x[0]
    return Scan(z, "a line scan", size, unit, lateral, positions, notes=tuple(notes))


def _grid_points(values: np.ndarray, header: list[Row]) -> Scan:
    """Points x y z of a grid, in any order; those that the file leaves out are missing."""
    x, y, z = values.T
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
    lateral, across, unit = _column_units(header, 3)
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
        raise Refusal(f"its points x y z form no grid along {name}: {remedy}")
    return place.astype(int), float(step), off


def _matrix_scan(values: np.ndarray, header: list[Row]) -> Scan:
    unit, lateral, corner = _matrix_unit(header), None, None
    labels = [_axis_step(values[0, 1:]), _axis_step(values[1:, 0])]
    if labels[0] is None and header:  # the labels of columns may be in the header
        cells = header[-1].cells
        if len(cells) == values.shape[1] and all(map(is_number, cells[1:])):
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
        of = "of x and y, and of the heights unless the header names another"
        notes.append(f"The unit {corner!r} in its corner is that {of}.")
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
