"""Channels without a unit in Gwyddion's `.gwy`, of which SurfaceTopography finds no heights.

The file is a tree of named components, see "Gwyddion native format" in the user guide
(http://gwyddion.net/documentation/user-guide-en/gwyfile-format.html).
"""

import io
import re
import struct
from typing import Any

import numpy as np

from ...core.files import Refusal
from ..registry import File, reader
from ..scan import Scan, channel_of, check_count, from_lines

_GWYDDION_MAGIC = b"GWYP"
_ATOMS = {"b": "<?", "c": "<c", "i": "<i", "q": "<q", "d": "<d"}
_ARRAYS = {"C": "S1", "I": "<i4", "Q": "<i8", "D": "<f8"}


@reader("gwyddion", "heights", knows=lambda file: file.content.startswith(_GWYDDION_MAGIC), rank=2)
def read_channels(file: File) -> Scan:
    """Returns the channel of heights, or of numbers without a unit; raises `Refusal`."""
    _, container = _component(io.BytesIO(file.content[len(_GWYDDION_MAGIC) :]), "o")
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
    key = bare[channel_of(file.channel, names, "its channels have no unit")]
    field = fields[key]
    shape = field["xres"], field["yres"]
    check_count(shape, file.at_most)
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


def _component(stream: io.BytesIO, kind: str) -> Any:
    """The next value; of an object, its name and components."""
    if kind in _ATOMS:
        return struct.unpack(_ATOMS[kind], stream.read(struct.calcsize(_ATOMS[kind])))[0]
    if kind == "s":
        end = stream.getvalue().index(b"\0", stream.tell())
        return stream.read(end + 1 - stream.tell())[:-1].decode()
    name = _component(stream, "s") if kind == "o" else ""
    (count,) = struct.unpack("<I", stream.read(4))
    if kind in _ARRAYS:
        form = np.dtype(_ARRAYS[kind])
        return np.frombuffer(stream.read(count * form.itemsize), form, count)
    if kind in "SO":
        return [_component(stream, kind.lower()) for _ in range(count)]
    end, components = stream.tell() + count, {}
    while stream.tell() < end:
        key = _component(stream, "s")
        components[key] = _component(stream, stream.read(1).decode())
    return name, components
