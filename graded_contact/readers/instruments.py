"""Heights in files of profilometers and microscopes, by SurfaceTopography."""

import importlib
import io
from typing import Any

import numpy as np

from .arrays import Heights, from_lines
from .source import Source
from .units import metres


class Unknown(ValueError):
    """A file that SurfaceTopography does not read."""

    def __init__(self, reason: object):
        told = " ".join(str(reason).split())[:120]
        super().__init__(
            f"no format of SurfaceTopography ({told}). Unpack a zip. Export other files as text "
            "whose first line is `x [mm], y [mm], z [um]`, or call "
            "`surfaces.surface_from_heights(heights, size)`"
        )


def read_instrument(source: Source, content: bytes) -> Heights:
    """Returns the topography that SurfaceTopography reads from a file.

    **Raises:** `ImportError` without the extra; `Unknown`; other errors for a damaged file.
    """
    try:
        library: Any = importlib.import_module("SurfaceTopography")
    except ImportError as error:
        remedy = "pip install graded_contact[io]"
        raise ImportError(f"`path={source.path}` needs SurfaceTopography: {remedy}") from error
    try:
        file = library.open_topography(io.BytesIO(content))
        channels, usual = list(file.channels), file.default_channel
    except Exception as error:  # libraries raise many kinds
        raise Unknown(error) from None
    with file:
        if type(file).__name__ == "HGTReader" and source.path.suffix.lower() != ".hgt":
            raise Unknown("no mark tells what it is")  # it takes any bytes
        index = _index(source, channels, usual)
        info = channels[index]
        lacking: dict[str, Any] = {} if info.unit else {"unit": "m"}
        if not info.physical_sizes:
            lacking["physical_sizes"] = (1.0,) * info.dim
        topography = file.topography(channel_index=index, **lacking)
    if not topography.is_uniform:
        raise ValueError(
            "it is not equally spaced: interpolate its heights (`to_uniform` of "
            "SurfaceTopography), and call `surfaces.surface_from_heights(heights, size)`"
        )
    heights = np.ma.filled(np.ma.asarray(topography.heights(), float), np.nan)
    if heights.ndim == 2:
        heights = from_lines(heights.T)  # its y runs downwards
    size = None if info.physical_sizes is None else np.asarray(info.physical_sizes, float)
    unit = None if info.unit is None else str(info.unit)
    others = [each.name for each in channels if each.name != info.name]
    notes = (f"It also has the channels {others}; `channel` chooses.",) if others else ()
    return Heights(heights, f"channel {info.name!r}", size, unit, unit, notes)


def _index(source: Source, channels: list[Any], usual: Any) -> int:
    """The channel by its name or number; the usual one if no other has heights."""
    channel, names = source.options.get("channel"), [info.name for info in channels]
    with_lengths = [info for info in channels if metres(str(info.unit)) is not None]
    if channel is None and len(with_lengths) < 2:
        return channels.index(usual)
    if isinstance(channel, int) and 0 <= channel < len(names):
        return channel
    if names.count(channel) == 1:
        return names.index(channel)
    raise source.not_plain(
        [f"it has the channels {dict(enumerate(names))}: choose one by its name or number"],
        channel="...",
    )
