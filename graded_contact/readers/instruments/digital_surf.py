"""Heights in files of Mountains (Digital Surf): maps `.sur` and profiles `.pro`, also compressed.

A header of 512 bytes, a comment, a private zone, then whole numbers of 16 or 32 bits, a line along
x at a time; see Gwyddion's `surffile.c` and hyperspy's `rsciio.digitalsurf`. In a compressed file
the numbers are zlib streams, whose sizes are listed before them.
"""

import struct
import zlib

import numpy as np

from ...core.files import Refusal, check_unpacked
from ..registry import File, reader
from ..scan import Scan, check_count, from_lines
from ..units import metres

_BEGINS = {b"DIGITAL SURF": False, b"DSCOMPRESSED": True}
_HEADER = 512
# Offset and form of each number in the header.
_OFFSETS_OF = {
    "objects": (14, "<H"), "special": (86, "<H"), "bits": (98, "<H"), "least": (100, "<i"),
    "num_x": (108, "<i"), "num_y": (112, "<i"), "step_x": (120, "<f"), "step_y": (124, "<f"),
    "step_z": (128, "<f"), "inversion": (290, "<H"), "comment": (334, "<H"), "private": (336, "<H"),
}  # fmt: skip
_NAME_Z, _STEP_UNITS = 164, 180  # texts of 16 bytes
_MISSING_OFFSET = -2  # beside the least number


@reader("mountains", "heights", knows=lambda file: file.content[:12] in _BEGINS)
def read_digital_surf(file: File) -> Scan:
    """Returns the heights of a map or a profile; raises `Refusal` for what is no height."""
    content, at_most = file.content, file.at_most
    head = content[:_HEADER]
    of = {name: struct.unpack_from(form, head, at)[0] for name, (at, form) in _OFFSETS_OF.items()}
    texts = [_header_text(head[at : at + 16]) for at in range(_STEP_UNITS, _STEP_UNITS + 48, 16)]
    (lateral, across, unit), name = texts, _header_text(head[_NAME_Z : _NAME_Z + 16])
    if metres(unit) is None:
        raise Refusal(f"its {name or 'z'!r} is in {unit!r}: it holds no heights")
    num_x, num_y = of["num_x"], of["num_y"]
    if of["bits"] not in (16, 32) or min(num_x, num_y) < 1:
        raise Refusal(f"its header is damaged: {num_x} x {num_y} points of {of['bits']} bits")
    check_count((num_x, num_y), at_most)
    start = _HEADER + of["comment"] + of["private"]
    numbers = _unzipped(content, start, at_most) if _BEGINS[content[:12]] else content[start:]
    size = num_x * num_y * of["bits"] // 8
    if len(numbers) < size:
        raise Refusal(f"it has {len(numbers)} of {size} bytes of heights: cut short")
    raw = np.frombuffer(numbers[:size], f"<i{of['bits'] // 8}").reshape(num_y, num_x)
    heights = of["step_z"] * raw.astype(float) * (-1 if of["inversion"] in (1, 2, 3) else 1)
    if of["special"] == 1:
        heights[raw == of["least"] + _MISSING_OFFSET] = np.nan
    if of["inversion"] in (2, 3):
        heights = np.flip(heights, 3 - of["inversion"])
    first = ", the first of several objects" * (of["objects"] > 1)
    source = f"{name!r}{first}" if name else f"heights{first}"
    if num_y == 1:
        return Scan(heights[0], source, np.array([num_x * of["step_x"]]), unit, lateral)
    factors = metres(lateral), metres(across)
    if None in factors:
        raise Refusal(f"its x is in {lateral!r} and its y in {across!r}: a length is needed")
    steps = np.array([of["step_x"], of["step_y"]]) * factors
    return Scan(from_lines(heights), source, steps * (num_x, num_y), unit, "m")


def _header_text(field: bytes) -> str:
    """A text of the header; old files write the micro sign of MS-DOS."""
    text = field.split(b"\0")[0].decode("latin-1").strip()
    return text.replace("æm", "µm")


def _unzipped(content: bytes, at: int, at_most: float) -> bytes:
    """The bytes of the zlib streams that are listed here."""
    (count,) = struct.unpack_from("<I", content, at)
    sizes = struct.unpack_from(f"<{2 * count}I", content, at + 4)
    check_unpacked(sum(sizes[::2]), at_most)
    at += 4 + 8 * count
    parts = []
    for plain, packed in zip(sizes[::2], sizes[1::2], strict=True):
        if plain:  # no part may be larger than it is listed; 0 would be no limit
            parts.append(zlib.decompressobj().decompress(content[at : at + packed], plain))
        at += packed
    return b"".join(parts)
