"""Files of instruments, read by SurfaceTopography, NumPy's own files, and files in a zip."""

import io
import math
import re
import warnings
import zipfile
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from ...core.warnings import USUAL
from ...roughness.surface import step
from ..paths import check_archive
from .scan import Refusal, Scan, metres, unit_in

UNPACKED = 1e9  # bytes of all that a zip holds
MOST_POINTS = 2**28
_BESIDE = {".txt", ".md", ".pdf", ".xml", ".json", ".csv", ".html", ".jpg", ".png", ".tif", ".bmp"}
_SIZE = re.compile(
    r"(?:((?:physical_?)?sizes?)|(?:pixel(?:_?size)?|spacing)s?)(?:_([a-z]+))?", re.IGNORECASE
)


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
    """Returns what SurfaceTopography makes of a file; it raises whatever it likes."""
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

    It is the one that `channel` names, or the only one besides texts and pictures. Where the parts
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
        if channel is None and len(data or names) == 1:
            channel = (data or names)[0]
        if channel not in names:
            asked = "pass `channel`, one of" if channel is None else f"it has no {channel!r}, only"
            raise Refusal(f"it is a zip of several files or none; {asked} {(data or names)[:20]}")
        return archive.read(str(channel)), str(channel)


def _choose_channel(reader: Any, channel: str | int | None) -> tuple[Any, int]:
    channels = list(reader.channels)
    names = [info.name for info in channels]
    if not channels:
        raise ValueError("no channel of heights was found")
    if channel is None:
        index = channels.index(reader.default_channel)
    elif isinstance(channel, int) and 0 <= channel < len(channels):
        index = channel
    elif channel in names:
        index = names.index(channel)
    else:
        raise Refusal(f"it has no `channel={channel!r}`, only {names}")
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
    `unit` overrule them.
    """
    if content.startswith(b"PK"):
        _check_size(content)
    loaded = np.load(io.BytesIO(content), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Scan(_real(loaded), "an array")
    arrays = {name: array for name in loaded.files if (array := _array(loaded, name)) is not None}
    wide = {name: a for name, a in arrays.items() if a.ndim == 2 and min(a.shape) >= 4}
    lines = {name: a for name, a in arrays.items() if a.ndim == 1 and len(a) >= 4}
    candidates = wide or lines
    names = list(candidates)
    if isinstance(channel, int) and 0 <= channel < len(names):
        channel = names[channel]
    if channel is None and len(names) == 1:
        channel = names[0]
    if channel not in candidates:
        asked = "pass `channel`, one of" if channel is None else f"it has no {channel!r}, only"
        raise Refusal(f"it holds several or no arrays of heights; {asked} {names}")
    texts = [a for name, a in arrays.items() if name.lower() in ("unit", "units") and a.size == 1]
    found = [str(text.astype(str).item()) for text in texts if text.dtype.kind in "US"]
    scan = Scan(
        _real(candidates[str(channel)]),
        f"array {channel!r}",
        unit=unit_in(str(channel)) or (found[0] if found else None),
    )
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
    """The heights with the size that other arrays tell, such as "size" or "pixel_size_um"."""
    shape = np.array(scan.heights.shape)
    for name, array in arrays.items():
        found = _SIZE.fullmatch(name)
        if not found or array.dtype.kind not in "iuf" or array.size not in (1, len(shape)):
            continue
        whole, suffix = found.groups()
        if whole and array.dtype.kind in "iu" and np.array_equal(array, shape):
            continue  # a number of points
        if suffix and metres(suffix) is None:
            continue
        size = np.broadcast_to(np.ravel(array) * (1 if whole else shape), shape.shape).astype(float)
        lateral = suffix or _lateral_unit(name, scan, size, unit or scan.unit)
        return scan._replace(size=size, lateral_unit=lateral)
    return scan


def _lateral_unit(name: str, scan: Scan, size: np.ndarray, unit: str | None) -> str | None:
    """The unit of a size: metres or that of the heights, by the usual slopes of rough surfaces."""
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
