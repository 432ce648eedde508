"""Measured surfaces from files; `surfaces.preparation` then treats the heights.

Files of instruments are read by SurfaceTopography (the extra `io`), which knows 42 formats of
profilometers and microscopes; text, arrays and OpenCRG roads are read here. What a file does not
state, unit and size, the caller gives.
"""

import contextlib
import os

import h5py
import numpy as np

from ..core.checks import Numbers, check_positive
from ..core.display import with_unit
from ..core.files import read_file
from ..surfaces.preparation import Periodic, surface_from_heights
from ..surfaces.surface import Surface
from .heights import Heights, Unknown, read_array, read_hdf5, read_instrument
from .opencrg import is_road, read_road
from .source import Layout, Source, damage_named, source_of
from .text import read_matrix, read_points, words_above
from .units import metres

MISSING = 0.99e37  # in any unit: instruments mark missing points by 1e37 and more
_INSTRUMENTS = (".datx", ".nc")  # files of HDF5 that state unit and size


def read_surface(
    path: str | os.PathLike,
    *,
    unit: str | None = None,
    size: Numbers | None = None,
    columns: dict[str, str | int] | None = None,
    missing: float | None = None,
    channel: str | int | None = None,
    layout: Layout | None = None,
    periodic: Periodic = "harmonic",
    shape: int | tuple[int, ...] | None = None,
) -> Surface:
    """Returns a measured surface, or a profile from a line scan, made periodic.

    No options are needed for files of instruments that state unit and size, points
    "x [mm], y [mm], z [um]" on a grid and profiles "x [mm], z [um]" whose first line says so, and
    OpenCRG roads. Arrays (`.npy`, `.npz`, HDF5) and a text of heights alone need `unit` and `size`.

    x runs to the right and y upwards in the picture that the microscope shows: the first line of a
    text is its top. Points have x and y of their own, and so have roads (y to the left); arrays are
    `[x, y]`, as `Surface.heights`. Heights of 1e37 and more, in any unit, are missing points.

    **Arguments:**

    - `path`: the file.
    - `unit`: of the heights, and of x and y ("um", "nm", "mil"), if the file states none.
    - `size`: edge lengths [m], if the file states none. One number means a square.
    - `columns`: which column of a text, by name or number from 1, is x, z and, for a grid, y.
    - `missing`: the number that marks missing points, such as -9999.
    - `channel`: name or number of the channel of an instrument, the array or the dataset.
    - `layout`: of a text that is not plain, as in `read_moduli`; "header" is the last line above a
      matrix of heights.
    - `periodic`, `shape`: see `surface_from_heights`.

    **Returns:** the surface, with its history.

    **Raises:** `FileNotFoundError`; `ImportError` without the extra; `ValueError` for a damaged
    file, or one that needs options.
    """
    if size is not None:
        check_positive("size", np.asarray(size), "[m]")
    source = source_of(
        path,
        "read_surface",
        unit=unit,
        size=None if size is None else np.asarray(size, float).tolist(),
        columns=columns,
        missing=missing,
        channel=channel,
        layout=layout,
    )
    with damage_named(source.path):
        found, unit = _heights_in(source, unit)
        heights, edges = _in_metres(source, found, unit)
    marked = np.abs(found.heights) >= MISSING
    if missing is not None:
        marked |= found.heights == missing
    heights = np.where(marked, np.nan, heights)
    history = _history(source, found, edges, int(np.sum(marked)))
    try:
        return surface_from_heights(heights, edges, periodic=periodic, shape=shape, history=history)
    except ValueError as error:
        raise ValueError(f"`path={source.path}`: {error}") from error


def _heights_in(source: Source, unit: str | None) -> tuple[Heights, str | None]:
    """The heights in a file, by its content, and the unit that is left to use."""
    suffix = source.path.suffix.lower()
    if suffix in (".npy", ".npz"):
        return read_array(source), unit
    if h5py.is_hdf5(source.path) and suffix not in _INSTRUMENTS:
        return read_hdf5(source), unit
    content = read_file(source.path)
    if is_road(content):
        return read_road(content), unit
    if b"\0" in content and not content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return read_instrument(source, content), unit
    if (points := read_points(source)) is not None:
        return points, None
    return _heights_in_text(source, content), unit


def _heights_in_text(source: Source, content: bytes) -> Heights:
    """A matrix of numbers, or heights below words that state unit and size.

    Other words are refused, as they may state a unit, unless `layout` has the last line of them.
    """
    above = words_above(content)
    if not above or "layout" in source.options:
        return read_matrix(source)
    with contextlib.suppress(Unknown, ImportError):
        heights = read_instrument(source, content)
        if heights.unit is not None and heights.size is not None:
            return heights
    shown = [f"line {number}: {line}" for number, line in above.items()]
    lacking = {name: "..." for name in ("unit", "size") if name not in source.options}
    reason = "words stand above its numbers, and state no unit and size that are known"
    raise source.not_plain([reason], shown[-6:], layout={"header": max(above)}, **lacking)


def _in_metres(source: Source, found: Heights, unit: str | None) -> tuple[np.ndarray, np.ndarray]:
    """The heights [m] and the edge lengths [m]; refuses a file without these."""
    size = source.options.get("size")
    units = [found.unit] if found.size is None else [found.unit, found.lateral_unit]
    lacking = {"unit": "..."} if unit is None and None in units else {}
    lacking |= {"size": "..."} if size is None and found.size is None else {}
    if lacking:
        points = " x ".join(map(str, found.heights.shape))
        reason = f"{found.source} of {points} points does not state its {' and its '.join(lacking)}"
        raise source.not_plain([reason], **lacking)
    if unit is not None and None not in units:
        raise ValueError(f"it states its unit, {found.unit}: leave out `unit`")
    if size is not None and found.size is not None:
        raise ValueError(f"it states its size, {found.size}: leave out `size`")
    factor, *lateral = [_metres_per(each or str(unit)) for each in units]
    if found.size is None:
        return factor * found.heights, np.broadcast_to(np.asarray(size, float), found.heights.ndim)
    return factor * found.heights, lateral[0] * np.asarray(found.size)


def _metres_per(unit: str) -> float:
    if (factor := metres(unit)) is None:
        raise ValueError(f"{unit!r} is no unit of length, such as 'um' or 'nm'")
    return factor


def _history(source: Source, found: Heights, edges: np.ndarray, marks: int) -> tuple[str, ...]:
    """How the heights were read, one sentence each."""
    points = " x ".join(map(str, found.heights.shape))
    lengths = " x ".join(with_unit(float(edge), "m") for edge in edges)
    read = f"Read {points} points of {lengths} from {found.source} of {source.path.name}."
    notes = [read, *found.notes]
    pixel = edges / np.array(found.heights.shape)
    if np.max(pixel) > 1.05 * np.min(pixel):
        told = " x ".join(f"{step:.3g} m" for step in pixel)
        notes.append(f"Its pixels of {told} are not square: is the file cut short?")
    if found.heights.ndim == 1:
        notes.append("Contact treats a profile as ridges without end across it.")
    if marks:
        notes.append(f"{marks} heights are marks of missing points.")
    return tuple(notes)
