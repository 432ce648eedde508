"""Heights in files of instruments (read by SurfaceTopography), of NumPy, of roads, and in zips.

Roads are OpenCRG files (ASAM OpenCRG 1.2, https://www.asam.net/standards/detail/opencrg/). A header
of text names the channels; the elevations follow, one row per step along the reference line, as
text of 10 or 20 characters a number ("LRFI", "LDFI") or as big-endian floats ("KRBI", "KDBI"). x
runs along the reference line (u), y to the left of it (v). The elevation is that over the reference
line, whose bends, slope and banking are left out.
"""

import io
import math
import re
import warnings
import zipfile
from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from ...core.warnings import USUAL
from ...roughness.surface import step
from ..paths import check_archive
from ..units import length_unit, metres

UNPACKED = 1e9  # bytes of all that a zip holds
MOST_POINTS = 2**28
_BESIDE = {".txt", ".md", ".pdf", ".xml", ".json", ".csv", ".html", ".jpg", ".png", ".tif", ".bmp"}
_SIZE = re.compile(
    r"(?:((?:physical_?)?sizes?)|(?:pixel(?:_?size)?|spacing)s?)(?:_([a-z]+))?", re.IGNORECASE
)


_MARK = re.compile(rb"^\$ROAD_CRG", re.MULTILINE | re.IGNORECASE)
_DATA = re.compile(rb"^\$\$[^\n]*\n", re.MULTILINE)
_POSITION = re.compile(r"at\s+v\s*=\s*([-+.\deE]+)")
_PARAMETER = re.compile(r"^\s*(\w+)\s*=\s*([-+.\deE]+)")


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


class Refusal(Exception):
    """A reason to refuse a file, to be completed with its path."""


def equally_spaced(values: np.ndarray, within: float) -> bool:
    """Returns whether numbers are equally spaced within this part of their step."""
    even = np.linspace(values[0], values[-1], len(values))
    step = abs(values[-1] - values[0]) / (len(values) - 1)
    return bool(np.max(np.abs(values - even)) <= within * step)


def chosen(channel: str | int | None, names: Sequence[str], what: str) -> int:
    """Returns the index of the channel; without a choice there must be only one."""
    if isinstance(channel, int) and 0 <= channel < len(names):
        return channel
    if channel in names:
        return names.index(channel)
    if channel is None and len(names) == 1:
        return 0
    lacking = (
        "pass `channel`, one of" if channel is None else f"it has no `channel={channel!r}`, only"
    )
    raise Refusal(f"{what}; {lacking} {list(names)[:20]}")


# Instruments.


def surface_topography() -> Any:
    """The library that reads some fifty formats, imported when first needed: it takes seconds."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import SurfaceTopography
    except ImportError as error:
        raise ImportError(
            "This file needs the package SurfaceTopography: pip install graded_contact[io]"
        ) from error
    return SurfaceTopography


def read_instrument(content: bytes, channel: str | int | None) -> Scan:
    """Returns the topography that SurfaceTopography reads from a file; it may raise any error."""
    if content.startswith(b"PK"):
        _check_size(content)
    with surface_topography().open_topography(io.BytesIO(content)) as reader:
        if content.startswith(b"PK") and type(reader).__name__ == "HGTReader":
            raise ValueError("this reader takes any 2 n² bytes")
        info, index = _choose_channel(reader, channel)
        points = info.nb_grid_pts or ()
        if math.prod(np.atleast_1d(points).tolist()) > MOST_POINTS:
            raise Refusal(f"it has {points} points; at most {MOST_POINTS} are read")
        sizes = info.physical_sizes
        topography = reader.topography(
            channel_index=index,
            **({} if sizes else {"physical_sizes": (1.0,) * info.dim}),
            **({} if info.unit else {"unit": "m"}),
        )
        if topography.is_uniform:
            heights, positions = topography.heights(), None
        else:
            x, heights = topography.positions_and_heights()
            positions = np.asarray(x, float) - np.min(x)
        return Scan(
            np.ma.filled(np.ma.asarray(heights, float), np.nan),
            f"channel {info.name!r}",
            size=None if sizes is None else np.asarray(sizes, float),
            unit=info.unit,
            lateral_unit=info.unit,
            positions=positions,
            periodic=bool(info.is_periodic),
        )


def _check_size(content: bytes) -> None:
    try:
        check_archive(io.BytesIO(content), UNPACKED)
    except ValueError as error:
        raise Refusal(str(error)) from None


def names_in(content: bytes) -> list[str]:
    """Returns the names of the files in a zip."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [entry.filename for entry in archive.infolist() if not entry.is_dir()]


def unpacked(content: bytes, channel: str | int | None) -> tuple[bytes, str]:
    """Returns the file in a zip that holds heights, and its name.

    It is the one that `channel` names, or the only one besides texts and pictures. If the parts
    of an `.x3p` lie in a folder it is the same `.x3p` without the folder.
    """
    _check_size(content)
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


def _choose_channel(reader: Any, channel: str | int | None) -> tuple[Any, int]:
    channels = list(reader.channels)
    if not channels:
        raise ValueError("no channel of heights was found")
    if channel is None:
        index = channels.index(reader.default_channel)
    else:
        index = chosen(channel, [info.name for info in channels], "it is refused")
    return channels[index], index


def metres_of_library(unit: str) -> float | None:
    """Metres per unit as SurfaceTopography spells it, or None."""
    from SurfaceTopography.Support.UnitConversion import get_unit_conversion_factor

    try:
        return float(get_unit_conversion_factor(unit, "m"))
    except (ValueError, TypeError):
        return None


def read_arrays(content: bytes, channel: str | int | None, size: Any, unit: str | None) -> Scan:
    """Returns the heights in a `.npy` or `.npz` file.

    An `.npz` may hold unit and size besides. Their names are its author's choice, so `size` and
    `unit` override them.
    """
    if content.startswith(b"PK"):
        _check_size(content)
    loaded = np.load(io.BytesIO(content), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Scan(_real(loaded), "an array")
    arrays = {name: array for name in loaded.files if (array := _array(loaded, name)) is not None}
    wide = {name: a for name, a in arrays.items() if a.ndim == 2 and min(a.shape) >= 4}
    lines = {name: a for name, a in arrays.items() if a.ndim == 1 and len(a) >= 4}
    names = list(wide or lines)
    name = names[chosen(channel, names, "it holds several or no arrays of heights")]
    texts = [a for key, a in arrays.items() if key.lower() in ("unit", "units") and a.size == 1]
    found = [str(text.astype(str).item()) for text in texts if text.dtype.kind in "US"]
    own = length_unit(name) or (found[0] if found else None)
    scan = Scan(_real(arrays[name]), f"array {name!r}", unit=own)
    scan = scan if size is not None else _with_size(scan, arrays, unit)
    return scan._replace(unit=None) if unit is not None else scan


def _array(loaded: Any, name: str) -> np.ndarray | None:
    """An array of a bundle; None for Python objects, which could run code."""
    try:
        return loaded[name]
    except ValueError as error:
        if "allow_pickle" in str(error):
            return None
        raise


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
        if whole and array.dtype.kind in "iu" and np.array_equal(array, shape):
            continue  # a number of points
        if suffix and metres(suffix) is None:
            continue
        size = np.broadcast_to(np.ravel(array) * (1 if whole else shape), shape.shape).astype(float)
        lateral = suffix or _lateral_unit(name, scan, size, unit or scan.unit)
        found[name] = scan._replace(size=size, lateral_unit=lateral)
        edges.append((metres(str(lateral)) or 1.0) * size)
    if not all(np.allclose(edge, edges[0], rtol=0.01) for edge in edges):
        raise Refusal(
            f"its {' and '.join(map(repr, found))} contradict each other; pass `size` [m]"
        )
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


def _real(values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "iuf":
        raise Refusal(f"its array is of {values.dtype}, not of real numbers")
    return np.where(np.isfinite(values), values, np.nan).astype(float)


# Roads.


def is_road(content: bytes) -> bool:
    return _MARK.search(content[:100_000]) is not None


def read_road(content: bytes) -> Scan:
    """Returns the elevations of a road [m], or raises `Refusal`."""
    end = _DATA.search(content)
    if end is None:
        raise Refusal("its header does not end: no line begins with '$$'")
    sections = _sections(content[: end.start()].decode("latin-1"))
    if "ROAD_CRG_FILE" in sections:
        raise Refusal("it refers to another OpenCRG file; read that one")
    road = _parameters(sections.get("ROAD_CRG", []))
    changes = _parameters(sections.get("ROAD_CRG_MODS", []))
    form, channels = _channels(sections.get("KD_DEFINITION", []))
    sides = [i for i, (name, _) in enumerate(channels) if name.startswith("long section")]
    if len(sides) < 4:
        raise Refusal(f"it has {len(sides)} long sections; at least 4 are needed")
    units = {channels[i][1] for i in sides}
    factor = metres(units.pop()) if len(units) == 1 else None
    if factor is None:
        raise Refusal("its long sections are not all in one unit of length")
    rows = _payload(content[end.end() :], form, len(channels))
    heights = factor * rows[:, sides] * changes.get("SCALE_Z_GRID", 1.0)
    step = road.get("REFERENCE_LINE_INCREMENT", 0.0)
    if not (np.isfinite(step) and step > 0):
        raise Refusal("it has no REFERENCE_LINE_INCREMENT, a length above 0")
    if {"REFERENCE_LINE_START_U", "REFERENCE_LINE_END_U"} <= set(road):
        rows = (road["REFERENCE_LINE_END_U"] - road["REFERENCE_LINE_START_U"]) / step + 1
        if len(heights) < rows - 1:  # rows without any elevation at the end are dropped
            raise Refusal(f"it has {len(heights)} of {rows:.0f} rows of elevations: cut short")
    notes = []
    across = _positions([channels[i][0] for i in sides], road)
    heights, width = _interpolated(heights, across, notes)
    if len(sides) < len(channels):
        notes.append("Heading, slope and banking of the reference line were left out.")
    left_out = ", ".join(sorted(set(changes) - {"SCALE_Z_GRID"}))
    if left_out:
        notes.append(f"The file's modifiers {left_out} were left out.")
    size = np.array([len(heights) * step, heights.shape[1] * width])
    return Scan(heights, "an OpenCRG road", size, "m", "m", notes=tuple(notes))


def _sections(header: str) -> dict[str, list[str]]:
    """The lines of each section, without comments."""
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    for line in header.splitlines():
        if line.startswith("$"):
            name = re.match(r"\$(\w*)", line)
            lines = sections.setdefault(name.group(1).upper() if name else "", [])
        elif not line.startswith("*"):
            lines.append(line.split("!")[0].rstrip())
    return sections


def _parameters(lines: list[str]) -> dict[str, float]:
    found = (_PARAMETER.match(line) for line in lines)
    return {match.group(1).upper(): _float(match.group(2)) for match in found if match}


def _channels(lines: list[str]) -> tuple[str, list[tuple[str, str]]]:
    """The code of the format, and the name and unit of each channel."""
    form, channels = "KRBI", []
    for line in lines:
        if line.startswith("#:"):
            form = line[2:].strip().upper()
        elif line.upper().startswith("D:"):
            name, _, unit = line[2:].partition(",")
            channels.append((" ".join(name.lower().split()), unit.strip()))
    if not re.fullmatch("[LK][RD][FB]I?", form):
        raise Refusal(f"its format {form[:10]!r} is not known; LRFI, LDFI, KRBI and KDBI are")
    return form, channels


def _payload(content: bytes, form: str, num_channels: int) -> np.ndarray:
    """The rows of numbers, NaN where missing."""
    double = form[1] == "D"
    if form[2] == "B":
        width = 8 if double else 4
        values = np.frombuffer(content[: len(content) // width * width], f">f{width}").astype(float)
        rows = values[: len(values) // num_channels * num_channels].reshape(-1, num_channels)
    else:
        rows = _text_rows(content.decode("latin-1"), 20 if double else 10, num_channels)
    used = np.any(np.isfinite(rows), axis=1)
    rows = rows[: np.max(np.nonzero(used)[0]) + 1] if np.any(used) else rows[:0]
    if len(rows) < 4:
        raise Refusal(f"it has {len(rows)} rows of elevations; at least 4 are needed")
    return np.where(np.isfinite(rows), rows, np.nan)


def _text_rows(text: str, width: int, num_channels: int) -> np.ndarray:
    """Rows of numbers of equal width; a row may go on in the next line."""
    rows, row = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.rstrip()
        cells = [line[i : i + width].strip() for i in range(0, len(line), width)]
        row += [np.nan if cell.startswith("*") else _float(cell) for cell in cells]
        if len(row) > num_channels:
            raise Refusal(f"row {number} of its elevations has too many numbers")
        if len(row) == num_channels:
            rows.append(row)
            row = []
    if row:
        raise Refusal("its last row of elevations is cut short")
    return np.array(rows, float).reshape(-1, num_channels)


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise Refusal(f"it holds {cell[:20]!r} where a number is needed") from None


def _positions(names: list[str], road: dict[str, float]) -> np.ndarray:
    """The positions of the long sections, v [m]."""
    found = [_POSITION.search(name) for name in names]
    given = [match for match in found if match]
    if given:
        if len(given) < len(names):
            raise Refusal("only some of its long sections have a position")
        return np.array([_float(match.group(1)) for match in given])
    if "LONG_SECTION_V_INCREMENT" in road:
        step = road["LONG_SECTION_V_INCREMENT"]
    elif {"LONG_SECTION_V_RIGHT", "LONG_SECTION_V_LEFT"} <= set(road):
        span = road["LONG_SECTION_V_LEFT"] - road["LONG_SECTION_V_RIGHT"]
        step = span / (len(names) - 1)
    else:
        raise Refusal("it has no distance between its long sections")
    return step * np.arange(len(names))


def _interpolated(
    heights: np.ndarray, across: np.ndarray, notes: list[str]
) -> tuple[np.ndarray, float]:
    """Heights at equal steps across the road, and the step [m]."""
    gaps = np.diff(across)
    if not (np.all(np.isfinite(gaps)) and np.all(gaps > 0)):
        raise Refusal("the positions of its long sections do not ascend")
    if equally_spaced(across, 1e-3):
        return heights, float(np.mean(gaps))
    step = float(np.min(gaps))
    num = round((across[-1] - across[0]) / step) + 1
    if num > 100 * len(across):
        raise Refusal("its long sections are spaced too unequally")
    even = np.linspace(across[0], across[-1], num)
    notes.append(
        f"Its long sections, {step:.3g} to {np.max(gaps):.3g} m apart, were interpolated linearly "
        f"to {num} equally spaced ones."
    )
    return np.stack([np.interp(even, across, row) for row in heights]), float(even[1] - even[0])
