"""Heights in NumPy's `.npy` and `.npz`, `[x, y]` as in `Surface.heights`."""

import io
import re

import numpy as np

from ...core.files import Refusal
from ...surfaces.holes import rms_slope
from ..registry import File, reader
from ..scan import Scan, channel_of, check_count
from ..units import length_unit, metres

_SIZE = re.compile(
    r"(?:((?:physical_?)?sizes?)|(?:pixel(?:_?size)?|spacing)s?)(?:_([a-z]+))?", re.IGNORECASE
)


def _is_numpy(file: File) -> bool:
    bundle = file.name.suffix == ".npz" and file.content.startswith(b"PK")
    return bundle or file.content.startswith(b"\x93NUMPY")


@reader("numpy", "heights", knows=_is_numpy)
def read_arrays(file: File) -> Scan:
    """Returns the heights in a `.npy` or `.npz` file.

    An `.npz` may also hold unit and size. Their names are its author's choice, so `size` and
    `unit` override them.
    """
    # A pickle could run code: NumPy refuses it here.
    loaded = np.load(io.BytesIO(file.content), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Scan(_real(loaded, file.at_most), "an array")
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
    name = names[channel_of(file.channel, names, "it holds several or no arrays of heights")]
    texts = [a for key, a in arrays.items() if key.lower() in ("unit", "units") and a.size == 1]
    units = [str(text.astype(str).item()) for text in texts if text.dtype.kind in "US"]
    own = length_unit(name) or next(iter(units), None)
    scan = Scan(_real(arrays[name], file.at_most), f"array {name!r}", unit=own)
    scan = scan if file.size is not None else _with_size(scan, arrays, file.unit)
    return scan.but(unit=None) if file.unit is not None else scan


def _with_size(scan: Scan, arrays: dict[str, np.ndarray], unit: str | None) -> Scan:
    """The heights with the size from other arrays, such as "size" or "pixel_size_um"."""
    shape = np.array(scan.heights.shape)
    found: dict[str, Scan] = {}
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
        found[name] = scan.but(size=size, lateral_unit=lateral)
    edges = [
        (metres(str(each.lateral_unit)) or 1.0) * np.array(each.size) for each in found.values()
    ]
    if not all(np.allclose(edge, edges[0], rtol=0.01) for edge in edges):
        names = " and ".join(map(repr, found))
        raise Refusal(f"its {names} contradict each other; pass `size` [m]")
    return next(iter(found.values()), scan)


def _lateral_unit(name: str, scan: Scan, size: np.ndarray, unit: str | None) -> str | None:
    """The unit of a size: metres, or that of the heights if only this gives a usual rms slope."""
    if unit is None or (factor := metres(unit)) is None:
        return unit
    low, high = 5e-4, 3.0  # usual rms slopes
    usual = []
    for lateral in dict.fromkeys((unit, "m")):
        spacing = (metres(lateral) or 1.0) * size / np.array(scan.heights.shape)
        if low < rms_slope(factor * scan.heights, spacing) < high:
            usual.append(lateral)
    if len(usual) != 1 and factor != 1:
        raise Refusal(f"its {name!r} may be in 'm' or in {unit!r}; pass `size` [m]")
    return usual[0] if usual else "m"


def _real(values: np.ndarray, at_most: float) -> np.ndarray:
    check_count(values.shape, at_most)
    if values.dtype.kind not in "iuf":
        raise Refusal(f"its array is of {values.dtype}, not of real numbers")
    return np.where(np.isfinite(values), values, np.nan).astype(float)
