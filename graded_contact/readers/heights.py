"""Heights as a file has them: arrays `[x, y]` of NumPy and HDF5, and files of instruments.

SurfaceTopography reads the files of profilometers and microscopes.
"""

import importlib
import io
from typing import Any, NamedTuple

import h5py
import numpy as np

from ..core.files import check_fits, read_file
from .source import Source
from .units import metres

ROUNDED = 0.02  # of a step: how far equally spaced positions may be rounded


class Heights(NamedTuple):
    """The heights in a file, in its own units; None where the file does not state a number.

    **Fields:**

    - `heights`: shape `(nx, ny)` or `(nx,)`, NaN where missing.
    - `source`: the part of the file, in words.
    - `size`: edge lengths in `lateral_unit`, shape `(ndim,)`.
    - `unit`, `lateral_unit`: of heights and lengths.
    - `notes`: sentences for the history.
    """

    heights: np.ndarray
    source: str
    size: np.ndarray | None = None
    unit: str | None = None
    lateral_unit: str | None = None
    notes: tuple[str, ...] = ()


def from_lines(lines: np.ndarray) -> np.ndarray:
    """Returns heights `[x, y]` from the lines of a picture, the topmost first."""
    return lines[::-1].T


def step_of(values: np.ndarray, name: str) -> float:
    """Returns the step of ascending numbers; raises `ValueError` unless they are equally spaced."""
    even = np.linspace(values[0], values[-1], len(values))
    step = (values[-1] - values[0]) / (len(values) - 1) if len(values) > 3 else np.nan
    if not np.max(np.abs(values - even)) <= ROUNDED * step:
        raise ValueError(
            f"its {len(values)} values of {name} are not equally spaced: interpolate the heights, "
            "for instance by `numpy.interp`, and pass them to `surface_from_heights`"
        )
    return float(step)


def read_array(source: Source) -> Heights:
    """Returns the array in a `.npy`, or the one of a `.npz` that `channel` names."""
    loaded: Any = np.load(io.BytesIO(read_file(source.path)), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return Heights(_real_numbers(loaded), "an array")
    check_fits(source.path, sum(member.file_size for member in loaded.zip.infolist()))
    arrays = {name: loaded[name] for name in loaded.files}
    name = _chosen(source, [name for name in arrays if _are_heights(arrays[name])])
    return Heights(_real_numbers(arrays[name]), f"array {name!r}")


def read_hdf5(source: Source) -> Heights:
    """Returns the dataset of an HDF5 file that `channel` names."""
    names: list[str] = []

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and _are_heights(node):
            names.append(name)

    with h5py.File(source.path) as tree:
        tree.visititems(visit)
        name = _chosen(source, names)
        node: Any = tree[name]
        check_fits(source.path, 8 * node.size)
        return Heights(_real_numbers(np.asarray(node)), f"dataset {name!r}")


def _chosen(source: Source, names: list[str]) -> str:
    channel = source.options.get("channel", names[0] if len(names) == 1 else None)
    if channel in names:
        return channel
    raise source.not_plain([f"it has the arrays {names[:20]}: choose one"], channel="...")


def _are_heights(values: Any) -> bool:
    num_axes = sum(n > 1 for n in values.shape or ())
    return values.dtype.kind in "iuf" and num_axes in (1, 2)


def _real_numbers(values: np.ndarray) -> np.ndarray:
    if not _are_heights(values):
        raise ValueError(f"an array of {values.dtype}, shape {values.shape}, has no heights")
    return np.squeeze(values).astype(float)


# Instruments --------------------------------------------------------------------------------------


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
