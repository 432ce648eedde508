"""Measured surfaces: reading files, filling missing points, levelling, making periodic.

Files are read by SurfaceTopography (the extra `io`, https://github.com/ContactEngineering), which
knows some fifty formats of profilometers and microscopes, and numpy's `.npy` and `.npz`. What is
done to the data is recorded, in order, in `Surface.history`.
"""

import contextlib
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from ._checks import Numbers, check_positive
from .grid import Grid
from .surface import Surface, resample

TAPER = 0.1  # length of the window's flank at either end of an axis, relative to the axis
PERIODIC = ("window", "mirror", None)
FILL = ("harmonic", None)


def read_surface(
    path: str | os.PathLike,
    *,
    periodic: str | None = "window",
    shape: int | tuple[int, ...] | None = None,
    size: Numbers | None = None,
    unit: str | None = None,
    fill: str | None = "harmonic",
    rim: int = 0,
    channel: str | int | None = None,
) -> Surface:
    """Returns a measured surface, or a profile from an equally spaced line scan, made periodic.

    **Arguments:**

    - `path`: the file.
    - `periodic`, `shape`, `fill`, `rim`: as in `surface_from_heights`.
    - `size`: edge lengths [m], for a file that does not tell; refused otherwise.
    - `unit`: length unit of the file's numbers ("um", "nm", ...), for a file that does not tell;
      refused otherwise.
    - `channel`: name or index of the channel; None takes the file's default height channel.

    A missing file raises `FileNotFoundError`, an unreadable or damaged one `ValueError`.
    """
    path = Path(path)
    if size is not None:
        check_positive("size", np.asarray(size), "[m]")
    _check_choices(periodic, fill, rim)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    library = _surface_topography()
    warned: list[str] = []
    with (
        _reading(path, warned),
        path.open("rb") as stream,
        library.open_topography(stream) as reader,
    ):
        info, index = _choose_channel(reader, channel)
        factor = _metres(info, unit)
        known = _known_size(info, size, factor)
        scan = reader.topography(
            channel_index=index,
            **({} if info.physical_sizes else {"physical_sizes": tuple(known / factor)}),
            **({} if info.unit else {"unit": unit}),
        )
        if not scan.is_uniform:
            raise _Refusal("its points are not equally spaced")
        if info.is_periodic and periodic is not None:
            raise _Refusal("it declares itself periodic; pass `periodic=None`")
        heights = factor * np.ma.filled(np.ma.asarray(scan.heights(), float), np.nan)
    points, lengths = " x ".join(map(str, heights.shape)), " x ".join(f"{s:.4g}" for s in known)
    source = f"Read {points} points of {lengths} m from channel {info.name!r} of {path.name}."
    if min(heights.shape) > 0:
        pixel = np.asarray(known) / np.array(heights.shape)
        if np.max(pixel) > 1.05 * np.min(pixel):
            warned.append(
                f"Its pixels of {pixel[0]:.3g} m by {pixel[-1]:.3g} m are not square: if the file "
                "was cut short, its heights are stretched."
            )
    options = {"periodic": periodic, "shape": shape, "fill": fill, "rim": rim}
    try:
        return surface_from_heights(heights, known, **options, history=(source, *warned))
    except ValueError as error:
        raise ValueError(f"`path={path}`: {error}") from error


def surface_from_heights(
    heights: ArrayLike,
    size: Numbers,
    *,
    periodic: str | None = "window",
    shape: int | tuple[int, ...] | None = None,
    fill: str | None = "harmonic",
    rim: int = 0,
    history: tuple[str, ...] = (),
) -> Surface:
    """Returns measured heights as a periodic surface of zero mean.

    In this order: a least-squares plane through the measured points is subtracted (not with
    `periodic=None`, for it would open a seam); missing points are filled; the edges are made to
    meet; the surface is resampled.

    **Arguments:**

    - `heights`: [m], shape `(nx, ny)` or `(nx,)`; NaN, infinite or masked where missing.
    - `size`: edge lengths [m], shape `(ndim,)`; one number means a square.
    - `periodic`: `"window"` multiplies by a cosine-flanked (Tukey) window that falls to zero over
      the outer tenth at either end of each axis, then scales the heights to keep their rms;
      `"mirror"` reflects, doubling each axis, which keeps every height but leaves kinks at the
      seams; None takes the heights as they stand and refuses them if the edges do not meet.
    - `shape`: number of points of the result; None keeps that of the data.
    - `fill`: `"harmonic"` solves Laplace's equation in the holes, with SurfaceTopography; None
      refuses missing points.
    - `rim`: how many rings of measured points around each hole to discard with it. Optical
      instruments report spikes there, which the filling would spread over the hole; the history
      tells when the rims stand out.
    - `history`: sentences to begin the history with.
    """
    _check_choices(periodic, fill, rim)
    values = np.ma.filled(np.ma.asarray(heights, float), np.nan)
    notes = list(history)
    missing = ~np.isfinite(values)
    num_missing = int(np.sum(missing))
    for _ in range(rim):
        missing = _grown(missing)
    measured = values[~missing]
    if measured.size < 4:
        raise ValueError(f"`heights` has {measured.size} measured points; at least 4 are needed.")
    grid = Grid(values.shape, size)  # refuses a wrong number of axes
    edges = np.asarray(grid.size, float)
    plane, slopes = _plane(values, missing, edges)
    residual = (values - plane)[~missing]
    if np.std(residual) <= 1e-12 * np.max(np.abs(measured)):
        raise ValueError("`heights` is a plane: no roughness is left after levelling.")
    if periodic is None:
        values = values - np.mean(measured)
    else:
        values = values - plane
        slope = ", ".join(f"{value:.3g}" for value in slopes)
        notes.append(f"Subtracted a plane of slope ({slope}).")
    if num_missing:
        values = _fill(values, missing, edges, fill)
        notes.append(_filling_note(values, missing, num_missing, rim, float(np.std(residual))))
    if periodic == "window":
        values, factor = _window(values)
        notes.append(
            f"Tapered the outer {100 * TAPER:g} % at either end of each axis to zero (Tukey "
            f"window) and multiplied the heights by {factor:.4g} to keep the rms height."
        )
    elif periodic == "mirror":
        for axis in range(values.ndim):
            values = np.concatenate([values, np.flip(values, axis)], axis)
        edges = 2 * edges
        notes.append("Reflected about the end of each axis, doubling it.")
    else:
        _check_seams(values)
        notes.append("Taken as periodic.")
    values = values - np.mean(values)
    surface = Surface(heights=values, grid=Grid(values.shape, edges), history=tuple(notes))
    return surface if shape is None else resample(surface, shape)


def _check_choices(periodic: Any, fill: Any, rim: Any) -> None:
    if isinstance(rim, bool) or not isinstance(rim, int) or rim < 0:
        raise ValueError(f"`rim={rim}` is refused: a whole number of at least 0 is needed.")
    for name, value, choices in (("periodic", periodic, PERIODIC), ("fill", fill, FILL)):
        if value not in choices:
            raise ValueError(f"`{name}={value!r}` is refused: use one of {choices}.")


def _surface_topography() -> Any:
    """The library that reads files, imported when first needed: it takes seconds."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import SurfaceTopography
    except ImportError as error:
        raise ImportError(
            "Measured surfaces need the package SurfaceTopography: pip install graded_contact[io]"
        ) from error
    return SurfaceTopography


class _Refusal(Exception):
    """A reason to refuse a file, to be completed with its path."""


@contextlib.contextmanager
def _reading(path: Path, warned: list[str]) -> Iterator[None]:
    """Turns whatever a reader raises on a damaged file into `ValueError`, collects its warnings."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield
    except _Refusal as error:
        raise ValueError(f"`path={path}` is refused: {error}.") from None
    except Exception as error:
        if type(error).__name__ == "CannotDetectFileFormat":
            reason = "its format is not known, or the file is damaged"
        else:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise ValueError(f"`path={path}` cannot be read: {reason}.") from error
    warned.extend(
        f"The reader warned: {entry.message}"
        for entry in caught
        if issubclass(entry.category, UserWarning | RuntimeWarning)
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
        raise _Refusal(f"it has no `channel={channel!r}`, only {names}")
    return channels[index], index


def _metres(info: Any, unit: str | None) -> float:
    """Metres per unit of the channel."""
    from SurfaceTopography.Support.UnitConversion import get_unit_conversion_factor

    if info.unit is not None and unit is not None:
        raise _Refusal(f"it is in {info.unit!r}; leave out `unit={unit!r}`")
    if info.unit is None and unit is None:
        raise _Refusal("it does not tell its unit; pass `unit`, for instance 'um'")
    try:
        return float(get_unit_conversion_factor(unit or info.unit, "m"))
    except (ValueError, TypeError) as error:
        named = f"`unit={unit!r}`" if unit else f"channel {info.name!r} in {info.unit!r}"
        raise _Refusal(f"{named} is not a length, such as 'm', 'um' or 'nm'") from error


def _known_size(info: Any, size: Numbers | None, factor: float) -> np.ndarray:
    """Edge lengths [m]."""
    if info.physical_sizes is None:
        if size is None:
            raise _Refusal("it does not tell its size; pass `size` [m]")
        if np.shape(size) not in ((), (info.dim,)):
            raise _Refusal(f"`size` has shape {np.shape(size)}, it needs {info.dim} lengths")
        return np.broadcast_to(np.asarray(size, float), (info.dim,))
    known = factor * np.asarray(info.physical_sizes, float)
    if size is not None:
        raise _Refusal(f"it tells its size, {known} m; leave out `size`")
    return known


def _plane(
    values: np.ndarray, missing: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The least-squares plane through the measured points, and its slopes [1]."""
    axes = [(np.arange(n) + 0.5) / n - 0.5 for n in values.shape]
    columns = [np.broadcast_to(x, values.shape) for x in np.meshgrid(*axes, indexing="ij")]
    basis = np.stack([np.ones(values.shape), *columns], axis=-1)
    coefficients = np.linalg.lstsq(basis[~missing], values[~missing])[0]
    return basis @ coefficients, coefficients[1:] / size


def _fill(
    values: np.ndarray, missing: np.ndarray, size: np.ndarray, fill: str | None
) -> np.ndarray:
    if fill is None:
        raise ValueError(
            f"`heights` has {np.sum(missing)} missing points; pass `fill='harmonic'` to fill them."
        )
    library = _surface_topography()
    scale = np.max(np.abs(values[~missing]))
    masked = np.ma.array(np.where(missing, 0, values / scale), mask=missing)
    if values.ndim == 1:
        scan = library.UniformLineScan(masked, float(size[0]))
    else:
        scan = library.Topography(masked, tuple(size))
    return scale * np.asarray(scan.interpolate_undefined_data_with_harmonic_function().heights())


def _grown(missing: np.ndarray) -> np.ndarray:
    """The holes and the points next to them, diagonally too."""
    for axis in range(missing.ndim):
        along = np.moveaxis(missing, axis, 0)
        grown = along.copy()
        grown[1:] |= along[:-1]
        grown[:-1] |= along[1:]
        missing = np.moveaxis(grown, 0, axis)
    return missing


def _filling_note(
    values: np.ndarray, missing: np.ndarray, num_missing: int, rim: int, spread: float
) -> str:
    rings = f", with {rim} ring(s) of measured points around them," if rim else ""
    note = (
        f"Filled {num_missing} missing points ({100 * num_missing / values.size:.2g} %){rings} "
        "with harmonic functions."
    )
    around = values[_grown(missing) & ~missing]
    height = np.sqrt(np.mean(around**2))
    if height > 3 * spread:
        note += (
            f" Their rims stand out, with rms height {height:.3g} m against {spread:.3g} m of all "
            f"measured points: they may be artefacts, see `rim={rim + 1}`."
        )
    return note


def _window(values: np.ndarray) -> tuple[np.ndarray, float]:
    """The tapered heights with their rms restored, and the factor that restored it."""
    tapered = values - np.mean(values)
    for axis, n in enumerate(values.shape):
        x = (np.arange(n) + 0.5) / n
        edge = np.minimum(np.minimum(x, 1 - x) / TAPER, 1)
        taper = np.sin(np.pi / 2 * edge) ** 2
        tapered = tapered * np.expand_dims(taper, [a for a in range(values.ndim) if a != axis])
    if np.std(tapered) <= 1e-6 * np.std(values):
        raise ValueError("`heights` vary only at the edges, where the window removes them.")
    factor = float(np.std(values) / np.std(tapered))
    return factor * tapered, factor


def _check_seams(values: np.ndarray) -> None:
    """Refuses heights whose step across the seam is unlike the steps inside."""
    for axis, name in zip(range(values.ndim), "xy", strict=False):
        steps = np.diff(values, axis=axis)
        seam = np.take(values, 0, axis) - np.take(values, -1, axis)
        inside, across = np.sqrt(np.mean(steps**2)), np.sqrt(np.mean(seam**2))
        # Twice is beyond chance for a rough edge; a profile has one seam step, which scatters.
        limit = 2 + 3 / np.sqrt(seam.size)
        if across > limit * inside:
            raise ValueError(
                f"`periodic=None` is refused: this is a surface that is not periodic. Along {name} "
                f"the heights jump by {across:.3g} m (rms) from the last point to the first, "
                f"{across / max(inside, 1e-300):.3g} times the step between neighbours (the limit "
                f"is {limit:.3g}). Pass `periodic='window'` or `periodic='mirror'`."
            )
