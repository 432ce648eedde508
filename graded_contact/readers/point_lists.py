"""Heights as lists of points: a line scan x z, or points x y z of a grid, and their columns."""

from collections.abc import Mapping

import numpy as np

from ..core.files import Refusal
from .cells import Row, Sheet, holds_number
from .decisions import Log
from .length_headings import (
    HEADER_CELLS,
    HEADER_ROWS,
    bare_name,
    counts_points,
    roles_of,
    units_above,
    units_of_columns,
)
from .scan import Scan, counters, equally_spaced

EQUAL = 1e-3  # of a step: how far points may lie from equal spacing
_OFF_GRID = 0.05  # of a step: how far points may lie beside a grid
_SAID = 0.002  # of a step: from where on the history says so
_BETWEEN = 0.25  # of the largest gap: gaps between lines of scattered points
CHOICE = "`columns`, such as {'x': 2, 'z': 3}"
COUNTED = "whose positions count the points"


def picked(sheet: Sheet, columns: Mapping[str, str | int]) -> Sheet:
    """Returns the columns x, y and z of a sheet that the user names; other rows are unchanged."""
    wanted = [columns[role] for role in "xyz" if role in columns]
    texts = [name for name in wanted if isinstance(name, str)]
    names, above = _row_of_names(sheet.rows, texts) if texts else ([], -1)
    places = [n - 1 if isinstance(n, int) else _place(names, n) for n in wanted]
    if min(places) < 0 or len(set(places)) < len(places):
        raise Refusal(f"`columns={dict(columns)}` must name different columns, counted from 1")
    rows = []
    for row in sheet.rows:
        if len(row.cells) > max(places) and row.line >= above:
            row = row._replace(cells=[row.cells[place] for place in places])
        elif all(map(holds_number, row.cells)):  # a row of numbers that is cut short
            continue
        rows.append(row)
    return sheet._replace(rows=rows)


def _row_of_names(rows: list[Row], texts: list[str]) -> tuple[list[str], int]:
    """The names of the columns, and their line: the first that has all these texts."""
    for row in rows:
        if all(_place(row.cells, text) >= 0 for text in texts):
            return row.cells, row.line
    seen = next((row.cells for row in rows if row.num_numbers == 0 and len(row.cells) > 1), [])
    raise Refusal(f"no line has the columns {texts}; there are {seen[:20]}")


def _place(names: list[str], text: str) -> int:
    """The place of a column: its name is the text, perhaps but for case and unit; else -1."""
    for known in (names, [*map(str.lower, names)], [*map(bare_name, names)]):
        same = [place for place, name in enumerate(known) if name in (text, text.lower())]
        if len(same) == 1:
            return same[0]
    return -1


def by_names(rows: list[Row]) -> dict[str, int] | None:
    """Returns the columns of x, z or of x, y, z by the first line that names them, from 1."""
    for row in rows[:HEADER_ROWS]:
        roles = roles_of(row.cells)
        if roles.count("x") == roles.count("z") == 1 and roles.count("y") < 2:
            return {role: roles.index(role) + 1 for role in "xyz" if role in roles}
    return None


def named_places(header: list[Row], width: int) -> tuple[list[int], list[str]] | None:
    """Returns the places of x, z or of x, y, z by their names, and the names of other columns.

    None if the names do not tell, or if they are in order and alone.
    """
    if width > HEADER_CELLS:
        return None
    row = next((row for row in header[:-3:-1] if len(row.cells) == width and any(row.cells)
                and any(roles_of(row.cells))), None)  # fmt: skip
    if row is None:
        return None
    roles = roles_of(row.cells)
    counts = {role: roles.count(role) for role in "xyz"}
    if width == 3 and counts["x"] == 1 and not counts["y"] and not counts["z"]:
        raise Refusal(f"the names {row.cells} do not tell its heights: choose by {CHOICE}")
    if counts["x"] != 1 or counts["y"] > 1 or not counts["z"]:
        return None
    if counts["z"] > 1:
        several = [name for name, role in zip(row.cells, roles, strict=True) if role == "z"]
        raise Refusal(f"it has several columns of heights, {several}: choose by {CHOICE}")
    places = [roles.index(role) for role in "xyz" if counts[role]]
    others = [name for place, name in enumerate(row.cells) if place not in places]
    return None if places == list(range(width)) else (places, others)


def without_index(values: np.ndarray, header: list[Row]) -> np.ndarray:
    """Returns columns x z or x y z of a file without their names, without counters before them."""
    if values.shape[1] not in (3, 4) or not counters(values[:, 0]):
        return values
    if any(row.num_numbers == 0 and len(row.cells) == values.shape[1] for row in header[-2:]):
        raise Refusal(f"its columns are not told by their names: choose by {CHOICE}")
    if values.shape[1] == 3 and not equally_spaced(values[:, 1], EQUAL):
        raise Refusal(f"its first column counts the lines: choose the others by {CHOICE}")
    return values[:, 1:]


def _units_over(header: list[Row], width: int) -> tuple[list[str | None], str | None, str | None]:
    """The units of positions and of heights in the last column, and one for all numbers."""
    *lengths, heights = units_of_columns(header, width)
    above = units_above(header)
    return [u or above.lengths for u in lengths], heights or above.of_heights, above.shared


def line_scan(values: np.ndarray, header: list[Row], given: bool, log: Log) -> Scan:
    """Returns a line scan of columns x z; whether x was `given` by the user."""
    x, z = values.T
    known = np.isfinite(x)
    if not np.all(known):
        log.note(f"Left out {np.sum(~known)} lines without a position.")
        x, z = x[known], z[known]
    steps = np.diff(x)
    if np.sum(steps < 0) > np.sum(steps > 0):
        x, z, steps = x[::-1], z[::-1], -steps[::-1]
    back = np.sum(steps <= 0)
    if back > 0.01 * len(steps):
        raise Refusal(f"its first column (the position) goes back and forth; {CHOICE} names others")
    if back:
        log.note(f"Sorted {back} points whose position stepped back.")
        x, first = np.unique(x, return_index=True)
        z = z[first]
    num = len(x)
    if num < 4:
        raise Refusal("it has fewer than 4 points")
    (lateral,), unit, shared = _units_over(header, 2)
    if counts_points(lateral) or (lateral is None and not given and counters(x)):
        heights = np.full(int(np.ptp(x)) + 1, np.nan)
        if heights.size > 20 * num:
            raise Refusal("most of its points are missing")
        heights[np.rint(x - x[0]).astype(int)] = z
        source = f"a column of heights {COUNTED}"
        return Scan(heights, source, unit=unit, log=log)
    size = np.array([(x[-1] - x[0]) * num / (num - 1)])
    positions = None if equally_spaced(x, EQUAL) else x - x[0]
    lateral = lateral or shared
    return Scan(z, "a line scan", size, unit, lateral, positions, log=log)


def grid_points(values: np.ndarray, header: list[Row], given: bool, log: Log) -> Scan:
    """Returns points x y z of a grid, in any order; those that the file leaves out are missing."""
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
    (lateral, across), unit, shared = _units_over(header, 3)
    if lateral != across:
        raise Refusal(f"its x is in {lateral!r} and its y in {across!r}")
    counted = counters(np.unique(x)) or counters(np.unique(y))
    if counts_points(lateral) or (lateral is None and not given and counted):
        return Scan(heights, f"points x y z {COUNTED}", unit=unit, log=log)
    size = np.array(shape) * np.array(steps)
    if off > _SAID:
        beside = f"Its x and y lie up to {off:.1%} of a step beside a grid"
        log.note(f"{beside}; the heights are taken on it.")
    return Scan(heights, "points x y z", size, unit, lateral or shared, log=log)


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
        raise Refusal(f"its points x y z have fewer than 4 values of {name}; for others: {CHOICE}")
    step = span / max(round(span / float(np.median(gaps))), 1) if len(gaps) else span
    place = np.rint((axis - low) / step)
    if clouds and len(gaps):
        step, low = np.polyfit(place, axis, 1)
        place = np.rint((axis - low) / step)
    off = float(np.max(np.abs(axis - low - place * step)) / step)
    if len(gaps) < 3 or off > _OFF_GRID:
        remedy = "interpolate them onto one, for instance by `scipy.interpolate.griddata`"
        raise Refusal(f"its points x y z form no grid along {name}: {remedy}")
    return place.astype(int), float(step), off
