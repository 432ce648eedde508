"""Measured surfaces from files; `preparation` then treats the heights.

Instruments' files are read by SurfaceTopography (the extra `io`,
https://github.com/ContactEngineering), which knows some fifty formats of profilometers and
microscopes; plain text, OpenCRG roads and NumPy's files by the other modules of this folder.
"""

import os
import warnings
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..core.checks import Numbers, check_positive, short
from ..core.display import with_unit
from ..core.files import Refusal
from ..surfaces.preparation import Periodic, surface_from_heights
from ..surfaces.surface import Surface
from .decisions import Log, settled
from .length_headings import same_unit
from .registry import opening, read_as
from .scan import Scan
from .units import metres

SAME_PROPORTIONS = 0.02  # between the proportions of edges that are meant to be equal
GAP = 3  # steps of a line scan, beyond which the points between are missing


def read_surface(
    path: str | os.PathLike,
    *,
    periodic: Periodic | None = "harmonic",
    shape: int | tuple[int, ...] | None = None,
    size: Numbers | None = None,
    unit: str | None = None,
    channel: str | int | None = None,
    columns: dict[Literal["x", "y", "z"], str | int] | None = None,
) -> Surface:
    """Returns a measured surface, or a profile from a line scan, made periodic.

    Read are the formats of instruments that SurfaceTopography knows, OpenCRG roads, grids of ESRI
    and Surfer, HDF5, NumPy's `.npy` and `.npz`, and text: a matrix of heights, columns x z or x y
    z; also zips of these, and those of contact.engineering. The content decides which format it is.
    Whole numbers 0, 1, 2, ... beside heights count points unless a unit stands with them. A line
    scan that is not equally spaced is interpolated linearly to its median step; points x y z that
    are scattered by at most 5 % of a step are taken on their grid. Heights of 1e37 and more, in any
    unit, are missing points; equal ones far from all others count, with a warning.

    x runs to the right and y upwards in the picture that the microscope shows, and in figures. The
    first line of a file is the top of the picture, also in text. Points x y z, axes in the first
    row and column, Surfer's grids, and roads (y to the left) have y of their own; arrays of NumPy
    and HDF5 are `[x, y]`, as `Surface.heights`.

    **Arguments:**

    - `path`: the file.
    - `periodic`, `shape`: see `surface_from_heights`.
    - `size`: edge lengths [m], for a file that does not state them or their unit. It overrides
      those of an `.npz`; other files that state them refuse it. One number means a square.
    - `unit`: length unit of those numbers of the file whose unit it does not state ("um", "nm",
      "mil", ...); of an `.npz` it overrides the stated one.
    - `channel`: name or index of the channel, or of the measurement in a container; None takes
      the file's default height channel, of JPK's files the measured heights on the way forth.
    - `columns`: of a table or a sheet, which column is x, z and, for a grid, y: by name or by
      number from 1, such as `{"x": "Distance", "z": 3}`. Needed where the names do not tell.

    **Returns:** the surface, with its history.

    **Raises:** `FileNotFoundError` for a missing file, `ImportError` without the extra,
    `ValueError` for an unreadable or damaged file, naming the arguments that would help.
    """
    if size is not None:
        check_positive("size", np.asarray(size), "[m]")
    path = Path(path)
    if columns is not None:
        _check_columns(columns)
    options = {"channel": channel, "size": size, "unit": unit, "columns": columns}
    scan, factor, known = _scan_in(path, options, periodic)
    heights = factor * scan.heights
    points = " x ".join(map(str, heights.shape))
    lengths = " x ".join(with_unit(float(edge), "m") for edge in known)
    log = scan.log
    log.begin(f"Read {points} points of {lengths} from {scan.source} of {path.name}.")
    if scan.positions is not None:
        # The period of a line is its span and one mean step.
        count = len(scan.positions)
        period = float(np.ptp(scan.positions)) * count / (count - 1)
        positions = scan.positions * (known[0] / period)
        heights, known = _at_equal_steps(positions, heights, log)
    elif heights.ndim == 2 and min(heights.shape) > 0:
        pixel = known / np.array(heights.shape)
        if np.max(pixel) > 1.05 * np.min(pixel):
            pixels = f"Its pixels of {pixel[0]:.3g} m by {pixel[-1]:.3g} m are not square"
            log.note(f"{pixels}: if the file was cut short, its heights are stretched.")
    try:
        return surface_from_heights(
            heights, known, periodic=periodic, shape=shape,
            history=(*log.history, *log.assumed),
        )  # fmt: skip
    except ValueError as error:
        raise ValueError(f"`path={path}`: {error}") from error


def _check_columns(columns: Any) -> None:
    """Refuses columns that are none of a profile, a grid or a line of heights."""
    kinds = ({"z"}, {"x", "z"}, {"x", "y", "z"})
    if not isinstance(columns, dict) or set(columns) not in kinds:
        raise ValueError(f"`columns={short(columns)}` must name x and z, or x, y and z.")
    if not all(isinstance(each, str | int) and each != 0 for each in columns.values()):
        raise ValueError(f"`columns={short(columns)}` must be names, or numbers from 1.")


def _scan_in(path: Path, options: dict[str, Any], periodic) -> tuple[Scan, float, Any]:
    """The heights in a file, metres per unit, and edge lengths [m]."""
    with opening(path, **options) as file, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scan = read_as(file, "heights").without_marks()
        if file.columns and not scan.named:
            raise Refusal("it is no table of columns; leave out `columns`")
        if (ndim := scan.heights.ndim) not in (1, 2):
            shape = f"{scan.source} has {ndim} axes, its shape is {scan.heights.shape}"
            raise Refusal(f"{shape}: heights have one axis or two")
        factor, edges = _metres_and_edges(scan, options["size"], options["unit"])
        if scan.periodic and periodic is not None:
            raise Refusal("it declares itself periodic; pass `periodic=None`")
    kinds = UserWarning | RuntimeWarning
    for entry in caught:
        if issubclass(entry.category, kinds):
            scan.log.note(f"The reader warned: {entry.message}")
    unit = options["unit"]
    if unit is not None and scan.unit is not None and _numbers_without_unit(scan, options["size"]):
        stated = f"as the file states the heights in {scan.unit!r}"
        scan.log.note(f"`unit={unit!r}` counts for its edges alone, {stated}.")
    return scan, factor, edges


def _numbers_without_unit(scan: Scan, size: Any) -> list[str]:
    """The numbers that count and whose unit the file does not state, in words."""
    found = ["the heights"] * (scan.unit is None)
    if scan.size is not None and scan.lateral_unit is None and size is None:
        found.append(f"the edges {' x '.join(f'{edge:.6g}' for edge in scan.size)}")
    return found


def _metres_and_edges(scan: Scan, size: Any, unit: str | None) -> tuple[float, np.ndarray]:
    """Metres per unit of the heights, and the edge lengths [m]; refuses a file without these."""
    stated = (scan.unit,) if scan.size is None else (scan.unit, scan.lateral_unit)
    for name in filter(None, stated):
        _metres_per_unit(name, f"{scan.source} in {name!r}")
    option = f"`unit={unit!r}`"
    given = np.nan if unit is None else _metres_per_unit(unit, option)
    fills = _numbers_without_unit(scan, size)  # then it is no unit of what is stated
    lacking, wanted = [], []
    if fills and unit is None:
        lacking.append(f"the unit of {' and of '.join(fills)}")
        edges = f"`size` [m], or the `unit` of these edges; the heights are in {scan.unit!r}"
        wanted.append(edges if scan.unit else "`unit`, for instance 'um'")
    if scan.size is None and size is None:
        lacking.append("the edge lengths")
        wanted.append("`size` [m]")
    if lacking:
        missing, options = " and ".join(lacking), ", and ".join(wanted)
        raise Refusal(f"it does not state {missing} of {scan.source}; pass {options}")
    own = settled("a height", scan.unit, None if fills else unit, option=option, alike=same_unit)
    factor = given if own is None else _metres_per_unit(own, option)
    if scan.size is None:
        num_axes, edges = scan.heights.ndim, np.array(size, float)
        if edges.shape not in ((), (num_axes,)):
            raise Refusal(f"`size` has shape {edges.shape}, it needs {num_axes} lengths")
        return factor, np.broadcast_to(edges, (num_axes,))
    if size is not None and scan.lateral_unit is None:
        return factor, _edges_of_size(scan.size, size)
    lateral = given if scan.lateral_unit is None else _metres_per_unit(scan.lateral_unit, option)
    known = lateral * scan.size
    if size is not None:
        raise Refusal(f"it states its size, {known} m; leave out `size`")
    if not (np.all(np.isfinite(known)) and np.all(known > 0)):
        raise Refusal(f"its size of {known} m is no length")
    return factor, known


def _metres_per_unit(unit: str, named: str) -> float:
    """Metres per unit; refuses what is no unit of length."""
    factor = metres(unit)
    if factor is None:
        raise Refusal(f"{named} is not a length, such as 'm', 'um' or 'nm'")
    return factor


def _edges_of_size(edges: np.ndarray, size: Any) -> np.ndarray:
    """The given size [m] of a file that states its edges in an unknown unit."""
    if np.shape(size) not in ((), edges.shape):
        raise Refusal(f"`size` has shape {np.shape(size)}, it needs {len(edges)} lengths")
    units = np.asarray(size, float) / edges
    if not np.ptp(units) <= SAME_PROPORTIONS * np.max(np.abs(units)):
        raise Refusal(f"its edges are as {edges.tolist()}, and those of `size={size}` are not")
    return units * edges


def _at_equal_steps(positions, heights, log: Log) -> tuple:
    """A line scan at equal steps, NaN in its gaps, and its length [m]."""
    known = np.isfinite(heights)
    positions, heights = positions[known], heights[known]
    if len(positions) < 4:
        raise ValueError(f"`heights` has {len(positions)} measured points; at least 4 are needed.")
    apart = np.diff(positions)
    typical = float(np.median(apart))
    if not np.ptp(positions) <= 100 * len(positions) * typical:
        raise ValueError("`heights` are spaced too unequally: cut the scan into parts.")
    num = int(np.ptp(positions) / typical) + 1
    even = positions[0] + typical * np.arange(num)
    values = np.interp(even, positions, heights)
    values[(apart > GAP * typical)[np.clip(np.searchsorted(positions, even) - 1, 0, None)]] = np.nan
    ends = f"{np.min(apart):.3g} to {np.max(apart):.3g} m apart"
    new = f"interpolated linearly to {num} points {typical:.4g} m apart"
    lost = f"{np.sum(np.isnan(values))} in gaps of more than {GAP} steps count as missing"
    log.note(f"Its points, {ends}, are not equally spaced: {new}; {lost}.")
    return values, np.array([typical * num])
