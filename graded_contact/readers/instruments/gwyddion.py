"""Channels without a unit in Gwyddion's `.gwy`, of which SurfaceTopography finds no heights.

The file is a tree of named components, see "Gwyddion native format" in the user guide
(http://gwyddion.net/documentation/user-guide-en/gwyfile-format.html).
"""

import re
import struct
from typing import Any

import numpy as np

from ...core.files import Refusal
from ..registry import File, reader
from ..scan import Scan, check_points, chosen, from_lines

_MAGIC = b"GWYP"
_ATOMS = {"b": "<?", "c": "<c", "i": "<i", "q": "<q", "d": "<d"}
_ARRAYS = {"C": "S1", "I": "<i4", "Q": "<i8", "D": "<f8"}


@reader("gwyddion", "heights", knows=lambda file: file.content.startswith(_MAGIC), rank=2)
def read_channels(file: File) -> Scan:
    """Returns the channel of heights, or of numbers without a unit; raises `Refusal`."""
    (_, container), _ = _object(file.content, len(_MAGIC))
    fields = {
        found[1]: value[1]
        for key, value in container.items()
        if (found := re.fullmatch(r"/(\d+)/data", key)) and isinstance(value, tuple)
    }
    titles = {key: str(container.get(f"/{key}/data/title") or key) for key in fields}
    if len(set(titles.values())) < len(titles):
        titles = {key: f"{key} {title}" for key, title in titles.items()}
    units = {key: _unit(field, "si_unit_z") for key, field in fields.items()}
    bare = [key for key, unit in units.items() if unit is None]
    if not bare:
        listed = ", ".join(f"{titles[key]!r} in {unit!r}" for key, unit in units.items())
        raise Refusal(f"its channels are no heights: {listed or 'there are none'}")
    names = [titles[key] for key in bare]
    key = bare[chosen(file.channel, names, "its channels have no unit")]
    field = fields[key]
    shape = field["xres"], field["yres"]
    check_points(shape, file.at_most)
    heights = from_lines(np.array(field["data"], float).reshape(shape[::-1]))
    mask = container.get(f"/{key}/mask")
    if mask is not None:
        heights[from_lines(mask[1]["data"].reshape(shape[::-1])) > 0.5] = np.nan
    size = np.abs([field.get("xreal", 0.0), field.get("yreal", 0.0)])
    lateral = _unit(field, "si_unit_xy")
    size = size if np.all(size > 0) else None
    return Scan(heights, f"channel {titles[key]!r}", size, None, lateral)


def _unit(field: dict[str, Any], key: str) -> str | None:
    unit = field.get(key)
    return (unit[1].get("unitstr") if isinstance(unit, tuple) else None) or None


def _object(content: bytes, at: int) -> tuple[tuple[str, dict[str, Any]], int]:
    """The name and components of an object, and where it ends."""
    name, at = _string(content, at)
    (size,) = struct.unpack_from("<I", content, at)
    at += 4
    end, components = at + size, {}
    if end > len(content):
        raise Refusal("it is cut short")
    while at < end:
        key, at = _string(content, at)
        components[key], at = _value(content, at + 1, chr(content[at]))
    return (name, components), end


def _value(content: bytes, at: int, kind: str) -> tuple[Any, int]:
    if kind in _ATOMS:
        return struct.unpack_from(_ATOMS[kind], content, at)[0], at + struct.calcsize(_ATOMS[kind])
    if kind == "s":
        return _string(content, at)
    if kind == "o":
        return _object(content, at)
    (count,) = struct.unpack_from("<I", content, at)
    at += 4
    if kind in _ARRAYS:
        form = np.dtype(_ARRAYS[kind])
        return np.frombuffer(content, form, count, at), at + count * form.itemsize
    values = []
    for _ in range(count):
        value, at = {"S": _string, "O": _object}[kind](content, at)
        values.append(value)
    return values, at


def _string(content: bytes, at: int) -> tuple[str, int]:
    end = content.index(b"\0", at)
    return content[at:end].decode(), end + 1
