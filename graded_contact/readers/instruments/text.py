"""Heights in plain text: a matrix, a line scan x z, or points x y z, in any usual layout.

A row of text is a line along x, as in the exports of microscopes. Lines before the numbers are a
header. Words between the numbers ("nan", "---", "BAD") are missing points, and are reported; labels
of lines and columns are left out, or are coordinates if they are lengths ("2 um"). What could be
read in two ways is refused.
"""

import dataclasses
import itertools
import re

import numpy as np

from ...core.files import Refusal
from .. import cells
from ..cells import Row, Sheet, TextLayout, holds_number, is_missing
from ..decisions import Log
from ..length_headings import Units, counts_points, units_above, units_in, units_of_columns
from ..point_lists import by_names, grid_points, line_scan, named_places, picked, without_index
from ..registry import File, reader
from ..scan import MOST_HEIGHTS, Scan, counters, equally_spaced, from_lines
from ..units import metres

_LONGEST_LINE_OF_HEIGHTS = 10_000_000  # characters of a line
_MOST_WORDS = 8  # different ones that can all mean a missing point


@reader("text", "heights", knows=lambda file: file.text is not None, rank=2)
def read_text(file: File) -> Scan:
    """Returns the heights in a text without a header that SurfaceTopography knows."""
    text, encoding = file.decoded or ("", "")
    lines = cells.lines_of(text, _LONGEST_LINE_OF_HEIGHTS)
    return heights_in(cells.text_sheet(lines, _layout(lines), encoding, MOST_HEIGHTS), file)


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


def heights_in(sheet: Sheet, file: File) -> Scan:
    """Returns the heights in the rows of a sheet of a file, or raises `Refusal`."""
    if file.columns:
        sheet = picked(sheet, file.columns)
    log = Log()
    if not sheet.name:
        log.note(f"Read as {sheet.layout}.")
    if not file.columns:
        sheet = _without_labels(sheet, log)
    known = [row for row in sheet.rows if not row.comment]
    body = list(itertools.dropwhile(lambda row: not _is_data(row.cells), known))
    if not body:
        named = None if file.columns else by_names(sheet.rows)
        if named is None:
            last = f"; it ends with {known[-1].cells[:4]}" if known else ""
            raise Refusal(f"it holds no table of numbers{last}")
        return heights_in(sheet, dataclasses.replace(file, columns=named))  # others have words
    used = _used(body)
    width = len(body[0].cells)
    header = [row._replace(cells=row.cells[used]) if len(row.cells) == width else row
              for row in sheet.rows if row.line < body[0].line]  # fmt: skip
    values = _values([row._replace(cells=row.cells[used]) for row in body], log)
    if not file.columns:
        if found := named_places(header, values.shape[1]):
            places, others = found
            values, header = values[:, places], [_cells_at(row, places, values) for row in header]
            if others:
                log.note(f"Left out the columns {others}.")
        elif len(without := without_index(values, header).T) < values.shape[1]:
            values = without.T
            log.note("The first column counts the lines, and was left out.")
    if (width := values.shape[1]) == 1:
        unit = units_of_columns(header, 1)[0] or units_above(header).of_heights
        scan = Scan(values[:, 0], "one line of heights", unit=unit, log=log)
    elif width in (2, 3):
        scan = (line_scan if width == 2 else grid_points)(values, header, bool(file.columns), log)
    else:
        scan = _matrix_scan(values, header, file.unit, log)
    return scan.but(source=sheet.layout if sheet.name else scan.source, named=bool(file.columns))


def _without_labels(sheet: Sheet, log: Log) -> Sheet:
    """A matrix without the words that label its lines, or with numbers for lengths.

    The unit of the lengths is written where row and column cross.
    """
    rows = [row for row in sheet.rows if not row.comment]
    body = list(itertools.dropwhile(lambda row: not _is_labelled(row), rows))
    labels = [row.cells[0] for row in body]
    apart = len(set(labels)) == len(labels) >= 4
    if not (apart and all(map(_is_labelled, body))) or by_names(sheet.rows):
        return sheet
    head = rows[len(rows) - len(body) - 1] if len(body) < len(rows) else Row(0, [""])
    edges = [_length(cell) for cell in (*head.cells[1:], *labels)]
    if any(edges):
        units = {edge and metres(edge[1]) for edge in edges}
        if None in units or len(units) > 1 or len(head.cells) != len(body[0].cells):
            raise Refusal(
                f"its lines begin with {labels[0]!r} and so on, below {head.cells[:3]}: lengths of "
                "one unit are needed along both axes, or none"
            )
        numbers = [edge[0] for edge in edges if edge]
        corner = f"{head.cells[0]}; x, y [{next(edge[1] for edge in edges if edge)}]"
        width = len(head.cells) - 1
        changed = {head.line: [corner, *numbers[:width]]}
        changed |= {row.line: [number, *row.cells[1:]]
                    for row, number in zip(body, numbers[width:], strict=True)}  # fmt: skip
        log.note("Lengths in its first row and first column are x and y.")
    else:
        cut = [head, *body] if _is_data(head.cells[1:]) else body
        changed = {row.line: row.cells[1:] for row in cut}
        log.note(f"Left out the labels of its lines, such as {labels[0]!r}.")
    rows = [row._replace(cells=changed.get(row.line, row.cells)) for row in sheet.rows]
    return sheet._replace(rows=rows)


def _is_labelled(row: Row) -> bool:
    """Whether a row is a word and at least four numbers."""
    label, *others = row.cells or [""]
    word = not (holds_number(label) or is_missing(label))
    return word and len(others) >= 4 and _is_data(others)


def _length(cell: str) -> tuple[str, str] | None:
    """A number and its unit of length, as "2 um" has them."""
    found = re.fullmatch(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([^\W\d]+)", cell[:40])
    number, unit = found.groups() if found else ("", "")
    number = number.replace(",", ".")
    return (number, unit) if holds_number(number) and metres(unit) else None


def _cells_at(row: Row, places: list[int], values: np.ndarray) -> Row:
    """A row above the numbers with the cells of some columns, if it has a cell for each."""
    if len(row.cells) != values.shape[1]:
        return row
    return row._replace(cells=[row.cells[place] for place in places])


def _is_data(cells: list[str]) -> bool:
    """Whether cells hold numbers, and otherwise only marks of missing points."""
    known = [cell for cell in cells if not is_missing(cell)]
    return bool(known) and all(map(holds_number, known))


def _used(rows: list[Row]) -> slice:
    """The columns from the first to the last that is not empty, of rows of equal width."""
    width = len(rows[0].cells)
    ragged = next((row for row in rows if len(row.cells) != width), None)
    if ragged is not None:
        cells = f"{len(ragged.cells)} cells, those before it {width}"
        raise Refusal(f"line {ragged.line} has {cells}")
    full = [place for place in range(width) if any(row.cells[place] for row in rows)]
    return slice(full[0], full[-1] + 1)


def _values(rows: list[Row], log: Log) -> np.ndarray:
    """The numbers in rows, NaN for words; a single row becomes a column."""
    values = np.full((len(rows), len(rows[0].cells)), np.nan)
    words: dict[str, None] = {}
    for row, numbers in zip(rows, values, strict=True):
        cells = row.cells
        good = [holds_number(cell) for cell in cells]
        numbers[good] = [float(cell) for cell, known in zip(cells, good, strict=True) if known]
        lost = [cell[:40] for cell, known in zip(cells, good, strict=True) if not known]
        if row is rows[0] and lost == [""] == cells[:1]:  # where two axes cross
            continue
        odd = next((cell for cell in lost if any(map(str.isdigit, cell))), None)
        if odd:
            raise Refusal(f"line {row.line} holds {odd!r}, which is no number")
        words |= dict.fromkeys(lost)
        if len(words) > _MOST_WORDS:
            raise Refusal(f"line {row.line} contains {lost[-1]!r}, earlier lines other words")
    if values.size < 4:
        raise Refusal("it holds no table of numbers")
    if words:
        log.note(f"Missing points are written {', '.join(map(repr, words))}.")
    return values.T if len(values) == 1 else values


def _matrix_scan(values: np.ndarray, header: list[Row], given: str | None, log: Log) -> Scan:
    """A matrix of heights, which may have axes, or counters, in its first row and column."""
    units, corner = units_above(header), Units()
    if header and len(header[-1].cells) == values.shape[1]:
        first, *labels = header[-1].cells
        if all(map(holds_number, labels)):  # with a word where row and column cross
            units, corner = units_above(header[:-1]), units_in([first])
            values = np.concatenate([[[np.nan, *map(float, labels)]], values])
    lengths = units.lengths or corner.of_lengths
    labels = values[0, 1:], values[1:, 0]
    steps, counted = [_axis_step(each) for each in labels], [counters(each) for each in labels]
    known = lengths is not None and not counts_points(lengths)
    if all(step or count for step, count in zip(steps, counted, strict=True)):
        coordinates = known or not any(counted)
        lines = values[1:, 1:]
        scan = _with_axes(lines, steps, log) if coordinates else _counted(lines, *labels)
    elif corner.lengths is not None:
        raise Refusal("its x in the first row or y in the first column are not equally spaced")
    elif counters(values[0]) and not known:
        scan = _counted(values[1:], along=values[0])
    elif counters(values[:, 0]) and not known:
        scan = _counted(values[:, 1:], across=values[:, 0])
    elif any(steps) or any(counted):
        line = "row" if steps[0] or counted[0] else "column"
        raise Refusal(f"its first {line} increases in equal steps, like an axis: remove it")
    else:
        scan = Scan(from_lines(values), "a matrix of heights")
    lengths, unit = lengths or units.shared, units.of_heights or corner.heights
    if unit is None and corner.shared is not None and given is None:
        unit = corner.shared
        log.assume(f"The heights are in {unit!r}, as x and y; otherwise pass `unit`.")
    lengths = lengths if scan.size is not None else None
    return scan.but(unit=unit, lateral_unit=lengths, log=log)


def _counted(lines: np.ndarray, along=None, across=None) -> Scan:
    """Heights beside counters of their points, as pandas writes them; lines may be left out."""
    for axis, counts in ((1, along), (0, across)):
        if counts is not None and counters(counts):
            places = np.rint(counts - counts[0]).astype(int)
            if places[-1] >= 2 * len(places):
                raise Refusal("most of the points that it counts are missing")
            shape = list(lines.shape)
            shape[axis] = places[-1] + 1
            whole = np.full(shape, np.nan)
            np.moveaxis(whole, axis, 0)[places] = np.moveaxis(lines, axis, 0)
            lines = whole
    return Scan(from_lines(lines), "a matrix of heights whose points are counted beside it")


def _with_axes(heights: np.ndarray, steps: list[float | None], log: Log) -> Scan:
    """Heights below x in the first row and beside y in the first column."""
    apart = np.array(steps, float)
    along_x, along_y = np.sign(apart).astype(int)
    heights = heights.T[::along_x, ::along_y]
    log.note("Its first row and first column were taken as x and y.")
    return Scan(heights, "a matrix of heights", np.abs(apart) * heights.shape)


def _axis_step(values: np.ndarray) -> float | None:
    """The step of equally spaced numbers, or None."""
    if len(values) < 4 or not np.all(np.isfinite(values)) or not equally_spaced(values, 1e-4):
        return None
    return float((values[-1] - values[0]) / (len(values) - 1)) or None
