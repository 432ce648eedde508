"""Heights in the formats of profilometers and microscopes that SurfaceTopography knows."""

import contextlib
import io
import re
import zlib
from typing import Any

import numpy as np

from ...core.files import check_unpacked, inflated
from ..registry import File, extra, reader
from ..scan import Scan, channel_of, check_count, from_lines
from ..units import metres

_RAW = (
    "no mark in it tells what it is; raw numbers are read by `numpy.fromfile(path, dtype)` and "
    "saved by `numpy.save` as .npy, which is read here"
)
# The two bytes that begin a stream of zlib: method and window, then what makes 31 divide them.
_HEADS = re.compile(
    b"|".join(
        re.escape(bytes([window, check]))
        for window in range(0x08, 0x88, 0x10)
        for check in range(256)
        if (256 * window + check) % 31 == 0 and not check & 0x20  # which needs a dictionary
    )
)
_WAY_BACK = re.compile(r"(?i)re-?trace|backward|\bbwd\b|rückw")  # the way back of a scan


@reader("instrument", "heights", knows=lambda file: not (file.columns and file.text), rank=1)
def read_instrument(file: File) -> Scan:
    """Returns the topography that SurfaceTopography reads from a file; it may raise any error.

    Raises `Refusal` for more than `at_most` bytes, unpacked. Zips and HDF5 are checked before.
    """
    content, at_most = file.content, file.at_most
    if file.text is None and not content.startswith(b"PK"):
        _check_streams(content, at_most)
    SurfaceTopography = extra("SurfaceTopography")  # takes seconds
    try:
        opened = SurfaceTopography.open_topography(io.BytesIO(content))
    except SurfaceTopography.Exceptions.CannotDetectFileFormat:
        raise ValueError(_RAW) from None
    with opened as library:
        if type(library).__name__ == "HGTReader":  # it takes any 2 n² bytes
            raise ValueError(_RAW)
        channels: list[Any] = list(library.channels)
        if not channels:
            raise ValueError("no channel of heights was found")
        names = [info.name for info in channels]
        index = channels.index(_usual(channels, library.default_channel))
        if file.channel is not None:
            index = channel_of(file.channel, names, "it has several channels")
        info = channels[index]
        check_count(info.nb_grid_pts or (), at_most)
        sizes = info.physical_sizes
        if file.text is not None and not (sizes and info.unit):
            raise ValueError("text without a known header: this reader takes much for numbers")
        lacking: dict[str, Any] = {} if sizes else {"physical_sizes": (1.0,) * info.dim}
        lacking |= {} if info.unit else {"unit": "m"}
        topography = library.topography(channel_index=index, **lacking)
        if topography.is_uniform:
            heights, positions = topography.heights(), None
        else:
            x, heights = topography.positions_and_heights()
            positions = np.asarray(x, float) - np.min(x)
        heights = np.ma.filled(np.ma.asarray(heights, float), np.nan)
        heights = from_lines(heights.T) if heights.ndim == 2 else heights  # its y runs downwards
        size = None if sizes is None else np.asarray(sizes, float)
        # Of two quantities, such as a length and a voltage, it is a pair.
        unit = None if info.unit is None else str(info.unit)
        scan = Scan(
            heights, f"channel {info.name!r}", size, unit, unit, positions, bool(info.is_periodic)
        )
        others = ", ".join(repr(name) for name in dict.fromkeys(names) if name != info.name)
        if others:
            scan.log.note(f"It also has the channels {others}; `channel` chooses.")
        return scan


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
            _WAY_BACK.search(name) is not None,
            measured is None,
            re.search("(?i)smooth", name) is not None,
            re.match("(?i)height|topo|z", name) is None,
            info is not default,
        )

    if _WAY_BACK.search(str(default.name)) or any(not rank(info)[1] for info in lengths):
        return min(lengths, key=rank, default=default)
    return default


def _check_streams(content: bytes, at_most: float) -> None:
    """Raises `Refusal` if the streams of zlib in a file unpack to more bytes.

    Readers of MAT, MNT and TIFF unpack without a limit.
    """
    size = 0
    whole = memoryview(content)
    for head in _HEADS.finditer(content):
        with contextlib.suppress(zlib.error):  # the two bytes may mean anything
            for length in inflated(whole[head.start() :], at_most):
                size += length
                check_unpacked(size, at_most)
