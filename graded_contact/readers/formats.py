"""Heights in files of instruments (read by SurfaceTopography) and of NumPy, and in zips."""

import contextlib
import io
import math
import re
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from ..core.warnings import USUAL
from ..surfaces.surface import step
from .paths import Refusal, check_unpacked
from .units import length_unit, metres

MOST_POINTS = 2**28
BYTES_OF_POINT = 4  # unpacked; fewer in files that are hardly packed
CHUNK = 2**16  # bytes
MARK = 0.99e37  # in any unit; 1e37, 1e38 and the largest float32 are in use
_BESIDE = {".txt", ".md", ".pdf", ".xml", ".json", ".csv", ".html", ".jpg", ".png", ".tif", ".bmp"}
_SIZE = re.compile(
    r"(?:((?:physical_?)?sizes?)|(?:pixel(?:_?size)?|spacing)s?)(?:_([a-z]+))?", re.IGNORECASE
)
_BACK = re.compile(r"(?i)re-?trace|backward|\bbwd\b|rückw")  # the way back of a scan


class Scan(NamedTuple):
    """The heights in a file, in its own units.

    **Fields:**

    - `heights`: in `unit`, shape `(nx, ny)` or `(nx,)`; NaN where missing.
    - `source`: the part of the file, in words.
    - `size`: edge lengths in `lateral_unit`, shape `(ndim,)`; None if the file has none.
    - `unit`, `lateral_unit`: of heights and lengths; None if the file has none.
    - `positions`: of the points of a profile in `lateral_unit`, ascending, if unequally spaced.
    - `periodic`: whether the file declares the surface periodic.
    - `notes`: how it was understood, one sentence each.
    """

    heights: np.ndarray
    source: str
    size: np.ndarray | None = None
    unit: str | None = None
    lateral_unit: str | None = None
    positions: np.ndarray | None = None
    periodic: bool = False
    notes: tuple[str, ...] = ()


class NoHeights(ValueError):
    """A known format without a channel in a unit of length."""


def equally_spaced(values: np.ndarray, within: float) -> bool:
    """Returns whether numbers are equally spaced within this part of their step."""
    even = np.linspace(values[0], values[-1], len(values))
    step = abs(values[-1] - values[0]) / (len(values) - 1)
    return bool(np.max(np.abs(values - even)) <= within * step)


def marked_as_missing(heights: np.ndarray) -> np.ndarray:
    """Returns which heights are marks of missing points, such as 1e38; instruments have no NaN."""
    return np.abs(heights) >= MARK


def chosen(channel: str | int | None, names: Sequence[str], what: str) -> int:
    """Returns the index of the channel; without a choice there must be only one."""
    if isinstance(channel, int) and 0 <= channel < len(names):
        return channel
    if channel in names:
        return names.index(channel)
    if channel is None and len(names) == 1:
        return 0
    wrong = "" if channel is None else f", not {channel!r}"
    raise Refusal(f"{what}; pass `channel`, one of {list(names)[:20]}{wrong}")


# Instruments.


def read_instrument(content: bytes, channel: str | int | None, at_most: float) -> Scan:
    """Returns the topography that SurfaceTopography reads from a file; it may raise any error.

    Raises `Refusal` for more than `at_most` bytes, unpacked. Zips and HDF5 are checked before.
    """
    if content.startswith((b"MATLAB", b"\xd0\xcf\x11\xe0")):
        _check_streams(content, at_most)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import SurfaceTopography  # takes seconds
    except ImportError as error:
        reason = "This file needs SurfaceTopography: pip install graded_contact[io]"
        raise ImportError(reason) from error
    with SurfaceTopography.open_topography(io.BytesIO(content)) as reader:
        if content.startswith(b"PK") and type(reader).__name__ == "HGTReader":
            raise ValueError("this reader takes any 2 n² bytes")
        channels: list[Any] = list(reader.channels)
        if not channels:
            raise NoHeights("no channel of heights was found")
        names = [info.name for info in channels]
        index = channels.index(_usual(channels, reader.default_channel))
        if channel is not None:
            index = chosen(channel, names, "it has several channels")
        info = channels[index]
        check_points(info.nb_grid_pts or (), at_most)
        sizes = info.physical_sizes
        lacking: dict[str, Any] = {} if sizes else {"physical_sizes": (1.0,) * info.dim}
        lacking |= {} if info.unit else {"unit": "m"}
        topography = reader.topography(channel_index=index, **lacking)
        if topography.is_uniform:
            heights, positions = topography.heights(), None
        else:
            x, heights = topography.positions_and_heights()
            positions = np.asarray(x, float) - np.min(x)
        heights = np.ma.filled(np.ma.asarray(heights, float), np.nan)
        size = None if sizes is None else np.asarray(sizes, float)
        scan = Scan(heights, f"channel {info.name!r}", size, info.unit, info.unit, positions)
        others = ", ".join(repr(name) for name in dict.fromkeys(names) if name != info.name)
        notes = (f"It also has the channels {others}; `channel` chooses.",) if others else ()
        return scan._replace(periodic=bool(info.is_periodic), notes=notes)


def _usual(channels: list[Any], default: Any) -> Any:
    """The channel of heights that a user expects: measured ones, on the way forth.

    The heights of JPK's files are measured by a sensor, or derived from the voltage of the piezo;
    and the library takes the last channel, which is a retrace.
    """
    lengths = [info for info in channels if isinstance(info.unit, str) and metres(info.unit)]

    def rank(info: Any) -> tuple[bool, ...]:
        name = str(info.name)
        measured = re.search(r"(?i)height.*measured|measured.*height", name)
        return (
            _BACK.search(name) is not None,
            measured is None,
            re.search("(?i)smooth", name) is not None,
            re.match("(?i)height|topo|z", name) is None,
            info is not default,
        )

    if _BACK.search(str(default.name)) or any(not rank(info)[1] for info in lengths):
        return min(lengths, key=rank, default=default)
    return default


def check_points(shape: Any, at_most: float) -> None:
    """Raises `Refusal` for more points than a file has that unpacks to `at_most` bytes."""
    points = math.prod(np.atleast_1d(shape).tolist())
    most = min(MOST_POINTS, at_most / BYTES_OF_POINT)
    if points > most:
        raise Refusal(f"it has {points} points; at most {most:.0f} are read at its packed size")


def _check_streams(content: bytes, at_most: float) -> None:
    """Raises `Refusal` if the streams of zlib in a file unpack to more bytes.

    SurfaceTopography's readers of MAT and MNT unpack without a limit.
    """
    size = 0
    for head in re.finditer(rb"\x78[\x01\x5e\x9c\xda]", content):
        stream = zlib.decompressobj()
        with contextlib.suppress(zlib.error):  # the two bytes may mean anything
            for start in range(head.start(), len(content), CHUNK):
                part = content[start : start + CHUNK]
                while part and not stream.eof:
                    size += len(stream.decompress(part, CHUNK))
                    check_unpacked(size, at_most)
                    part = stream.unconsumed_tail
                if stream.eof:
                    break


def names_in(content: bytes) -> list[str]:
    """Returns the names of the files in a zip."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [entry.filename for entry in archive.infolist() if not entry.is_dir()]


def file_in(content: bytes, name: str) -> bytes:
    """Returns the content of a file in a zip."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return archive.read(name)


def unpacked(content: bytes, channel: str | int | None) -> tuple[bytes, str]:
    """Returns the file in a zip that holds heights, and its name.

    It is the one that `channel` names, or the only one that is no text or picture. If the parts
    of an `.x3p` lie in a folder it is the same `.x3p` without the folder.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = [name for name in names_in(content) if not name.startswith("__MACOSX")]
        if "main.xml" in names:  # as in a damaged `.x3p`
            raise Refusal("its format is not known, or the file is damaged")
        folders = [name.removesuffix("main.xml") for name in names if name.endswith("/main.xml")]
        if len(folders) == 1:
            stream = io.BytesIO()
            with zipfile.ZipFile(stream, "w") as bare:
                for name in names:
                    bare.writestr(name.removeprefix(folders[0]), archive.read(name))
            return stream.getvalue(), folders[0]
        data = [name for name in names if PurePosixPath(name).suffix.lower() not in _BESIDE]
        names = names if channel in names else (data or names)
        name = names[chosen(channel, names, "it is a zip of several files or none")]
        return archive.read(name), name


# Files of NumPy.


def read_arrays(content: bytes, channel, size, unit: str | None, at_most: float) -> Scan:
    """Returns the heights in a `.npy` or `.npz` file.

    An `.npz` may also hold unit and size. Their names are its author's choice, so `size` and
    `unit` override them.
    """
    # A pickle could run code: NumPy refuses it here.
    loaded = np.load(io.BytesIO(content), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Scan(_real(loaded, at_most), "an array")
    arrays: dict[str, np.ndarray] = {}
    for name in loaded.files:
        try:
            arrays[name] = loaded[name]
        except ValueError as error:
            if "allow_pickle" not in str(error):  # other arrays are read without the objects
                raise
    wide = [name for name, a in arrays.items() if a.ndim == 2 and min(a.shape) >= 4]
    lines = [name for name, a in arrays.items() if a.ndim == 1 and len(a) >= 4]
    names = wide or lines
    name = names[chosen(channel, names, "it holds several or no arrays of heights")]
    texts = [a for key, a in arrays.items() if key.lower() in ("unit", "units") and a.size == 1]
    units = [str(text.astype(str).item()) for text in texts if text.dtype.kind in "US"]
    own = length_unit(name) or next(iter(units), None)
    scan = Scan(_real(arrays[name], at_most), f"array {name!r}", unit=own)
    scan = scan if size is not None else _with_size(scan, arrays, unit)
    return scan._replace(unit=None) if unit is not None else scan


def _with_size(scan: Scan, arrays: dict[str, np.ndarray], unit: str | None) -> Scan:
    """The heights with the size from other arrays, such as "size" or "pixel_size_um"."""
    shape = np.array(scan.heights.shape)
    found: dict[str, Scan] = {}
    edges = []
    for name, array in arrays.items():
        match = _SIZE.fullmatch(name)
        if not match or array.dtype.kind not in "iuf" or array.size not in (1, len(shape)):
            continue
        whole, suffix = match.groups()
        points = whole and array.dtype.kind in "iu" and np.array_equal(array, shape)
        if points or (suffix and metres(suffix) is None):
            continue
        size = np.broadcast_to(np.ravel(array) * (1 if whole else shape), shape.shape).astype(float)
        lateral = suffix or _lateral_unit(name, scan, size, unit or scan.unit)
        found[name] = scan._replace(size=size, lateral_unit=lateral)
        edges.append((metres(str(lateral)) or 1.0) * size)
    if not all(np.allclose(edge, edges[0], rtol=0.01) for edge in edges):
        names = " and ".join(map(repr, found))
        raise Refusal(f"its {names} contradict each other; pass `size` [m]")
    return next(iter(found.values()), scan)


def _lateral_unit(name: str, scan: Scan, size: np.ndarray, unit: str | None) -> str | None:
    """The unit of a size: metres, or that of the heights if only this gives a usual rms slope."""
    if unit is None or (factor := metres(unit)) is None:
        return unit
    low, high = USUAL["rms slope"]
    usual = []
    for lateral in dict.fromkeys((unit, "m")):
        spacing = (metres(lateral) or 1.0) * size / np.array(scan.heights.shape)
        if low < step("", factor * scan.heights, spacing).rms_slope < high:
            usual.append(lateral)
    if len(usual) != 1 and factor != 1:
        raise Refusal(f"its {name!r} may be in 'm' or in {unit!r}; pass `size` [m]")
    return usual[0] if usual else "m"


def _real(values: np.ndarray, at_most: float) -> np.ndarray:
    check_points(values.shape, at_most)
    if values.dtype.kind not in "iuf":
        raise Refusal(f"its array is of {values.dtype}, not of real numbers")
    return np.where(np.isfinite(values), values, np.nan).astype(float)
