"""Files of instruments, read by SurfaceTopography, and NumPy's own files."""

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from .scan import Refusal, Scan


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


def read_instrument(path: Path, channel: str | int | None) -> Scan:
    """Returns what SurfaceTopography makes of a file; it raises whatever it likes."""
    with path.open("rb") as stream, surface_topography().open_topography(stream) as reader:
        info, index = _choose_channel(reader, channel)
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


def _choose_channel(reader: Any, channel: str | int | None) -> tuple[Any, int]:
    channels = list(reader.channels)
    names = [info.name for info in channels]
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


def read_arrays(content: bytes, channel: str | int | None) -> Scan:
    """Returns the heights in a `.npy` or `.npz` file, which tells neither unit nor size."""
    loaded = np.load(io.BytesIO(content), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Scan(_real(loaded), "an array")
    arrays = {name: loaded[name] for name in loaded.files}
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
    return Scan(_real(candidates[str(channel)]), f"array {channel!r}")


def _real(values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "iuf":
        raise Refusal(f"its array is of {values.dtype}, not of real numbers")
    return np.where(np.isfinite(values), values, np.nan).astype(float)
