"""Heights in text: points x z or x y z with names and units, or a matrix of heights."""

import numpy as np

from .columns import Heading, quantity_named, understood
from .heights import Heights, from_lines, step_of
from .layouts import number_in, text_lines
from .source import NotPlain, Source
from .tables import DataTable, read_table

_POINTS = {
    "x": Heading("length", r"x|xposition|position|distance"),
    "y": Heading("length", r"y|yposition"),
    "z": Heading("length", r"z|heights?"),
}
_WAYS = [("x", "y", "z"), ("x", "z")]
_AXIS = 0.2  # of a step: how far positions beside heights are rounded


def read_points(source: Source) -> Heights | None:
    """Returns points x z or x y z of a text; None for a text whose columns are not named so."""
    unit, given = source.options.get("unit"), source.options.get("columns")
    units = {"units": {"length": unit}} if unit else {}
    try:
        table = read_table(source._replace(options={**source.options, **units}))
    except NotPlain:
        if given:
            raise
        return None
    named = {quantity_named(column.name, _POINTS) for column in table.columns}
    if not given and not {"x", "z"} <= named:
        return None
    try:
        found = understood(table, _POINTS, _WAYS)
    except NotPlain as error:
        asked = {name: each for name, each in error.options.items() if name != "units"}
        lacking = {"unit": "..."} if unit is None and "units" in error.options else {}
        raise source.not_plain(error.reasons, error.lines, **asked, **lacking) from None
    x, *y = (found.numbers[name] for name in found.way[:-1])
    z = table.numbers(found.columns["z"], "length", "m")  # in its own unit, as its marks are
    heights, size = _grid(x, y[0], z) if y else _profile(x, z)
    name = f"points {' '.join(found.way)}"
    return Heights(heights, name, size, found.units["z"], "m", (found.told,))


def read_matrix(source: Source) -> Heights:
    """Returns the heights of a text of numbers alone; a line of text is a line along x."""
    table = read_table(source)
    lines = np.stack([table.numbers(c, "length", "m") for c in table.columns], axis=-1)
    if lines.shape[1] in (2, 3):
        reason = "it has 2 or 3 columns, as points have"
        raise table.not_plain([reason], columns={"x": "...", "z": "..."})
    _check_no_axis(table, lines)
    heights = lines[:, 0] if lines.shape[1] == 1 else from_lines(lines)
    return Heights(heights, "a text of heights")


def words_above(content: bytes) -> dict[int, str]:
    """Returns the lines above the first that begins with a number."""
    above = {}
    for number, line in text_lines(content).items():
        first = line.replace(",", " ").replace(";", " ").split()
        if not first or number_in(first[0]) is not None:
            return above
        above[number] = line
    return above


def _check_no_axis(table: DataTable, lines: np.ndarray) -> None:
    """Refuses positions in the first line or column, in equal steps but for their rounding."""
    for edge in (lines[0, 1:], lines[1:, 0]) if min(lines.shape) > 3 else ():
        even = np.linspace(edge[0], edge[-1], len(edge))
        step = abs(even[1] - even[0])
        if step > 0 and np.max(np.abs(edge - even)) <= _AXIS * step:
            reason = "its first line or column rises in equal steps, as positions do"
            remedy = "take `numpy.loadtxt`, then `surfaces.surface_from_heights(heights, size)`"
            raise table.source.not_plain([f"{reason}: {remedy}"])


def _profile(x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(x)
    step = step_of(x[order], "x")
    return z[order], np.array([step * len(x)])


def _grid(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points x y z on their grid, NaN for those that are not there."""
    lines, places = [], []
    for axis in (x, y):
        digits = 6 - int(np.floor(np.log10(max(np.ptp(axis), 1e-300))))
        values, place = np.unique(np.round(axis, digits), return_inverse=True)
        lines.append(values)
        places.append(place)
    steps = [step_of(values, name) for values, name in zip(lines, "xy", strict=True)]
    heights = np.full([len(values) for values in lines], np.nan)
    heights[tuple(places)] = z
    return heights, np.array(steps) * heights.shape
