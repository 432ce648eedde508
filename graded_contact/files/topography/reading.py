"""Measured surfaces: reading files, cropping, filling missing points, levelling, making periodic.

Instruments' files are read by SurfaceTopography (the extra `io`,
https://github.com/ContactEngineering), which knows some fifty formats of profilometers and
microscopes; plain text, OpenCRG roads and NumPy's files by the modules beside this one. What is
done to the data is recorded, in order, in `Surface.history`, and what it does to the roughness in
`Surface.steps`.
"""

import contextlib
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from ..._checks import Numbers, check_positive, door
from ...grid import Grid
from ...surface import Step, Surface, resample, step
from .holes import filled, grown, largest_rectangle
from .library import metres_of_library, read_arrays, read_instrument
from .road import is_road, read_road
from .scan import Refusal, Scan, metres
from .text import decoded, read_text

TAPER = 0.1  # length of the window's flank at either end of an axis, relative to the axis
PERIODIC = ("window", "mirror", None)
FILL = ("low", "harmonic", None)
LOW = 0.01  # the share of measured heights below the level to which filled holes sink
STEEPER = 1.5  # than its rms slope the surface sinks from the mean height into a hole
LARGEST = 1e5  # [m], higher than any mountain
GAP = 3  # steps of a line scan, beyond which the points between are missing


@door
def read_surface(
    path: str | os.PathLike,
    *,
    periodic: str | None = "window",
    shape: int | tuple[int, ...] | None = None,
    size: Numbers | None = None,
    unit: str | None = None,
    region: Numbers | None = None,
    fill: str | None = "low",
    rim: int = 0,
    channel: str | int | None = None,
) -> Surface:
    """Returns a measured surface, or a profile from a line scan, made periodic.

    Read are the formats of instruments that SurfaceTopography knows, OpenCRG roads, NumPy's `.npy`
    and `.npz`, and text: a matrix of heights (x along a row), two columns x z, three columns x y z.
    A line scan that is not equally spaced is interpolated linearly to its median step.

    **Arguments:**

    - `path`: the file.
    - `periodic`, `shape`, `region`, `fill`, `rim`: as in `surface_from_heights`.
    - `size`: edge lengths [m], for a file that does not tell; refused otherwise. One number means a
      square.
    - `unit`: length unit of the file's numbers ("um", "nm", ...), for a file that does not tell;
      refused otherwise.
    - `channel`: name or index of the channel; None takes the file's default height channel.

    **Raises:** `FileNotFoundError` for a missing file, `ImportError` without the extra,
    `ValueError` for an unreadable or damaged file, naming all that has to be passed besides.
    """
    path = Path(path)
    if size is not None:
        check_positive("size", np.asarray(size), "[m]")
    _check_choices(periodic, fill, rim)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    warned: list[str] = []
    with _reading(path, warned):
        scan = _scan(path, channel)
        factor, known = _scales(scan, size, unit)
        if scan.periodic and periodic is not None:
            raise Refusal("it declares itself periodic; pass `periodic=None`")
    heights = factor * scan.heights
    points, lengths = " x ".join(map(str, heights.shape)), " x ".join(f"{s:.4g}" for s in known)
    source = f"Read {points} points of {lengths} m from {scan.source} of {path.name}."
    notes, steps = [source, *scan.notes, *warned], []
    if scan.positions is not None:
        positions = scan.positions * (known[0] / _reach(scan.positions))
        steps.append(_step_of_line(positions, heights))
        heights, known = _equally_spaced(positions, heights, notes)
    elif heights.ndim == 2 and min(heights.shape) > 0:
        pixel = known / np.array(heights.shape)
        if np.max(pixel) > 1.05 * np.min(pixel):
            notes.append(
                f"Its pixels of {pixel[0]:.3g} m by {pixel[-1]:.3g} m are not square: if the file "
                "was cut short, its heights are stretched."
            )
    options = {"periodic": periodic, "shape": shape, "region": region, "fill": fill, "rim": rim}
    try:
        return surface_from_heights(
            heights, known, **options, history=tuple(notes), steps=tuple(steps)
        )
    except ValueError as error:
        raise ValueError(f"`path={path}`: {error}") from error


def surface_from_heights(
    heights: ArrayLike,
    size: Numbers,
    *,
    periodic: str | None = "window",
    shape: int | tuple[int, ...] | None = None,
    region: Numbers | None = None,
    fill: str | None = "low",
    rim: int = 0,
    history: tuple[str, ...] = (),
    steps: tuple[Step, ...] = (),
) -> Surface:
    """Returns measured heights as a periodic surface of zero mean.

    In this order: a region is cut out; a least-squares plane through the measured points is
    subtracted (not with `periodic=None`, for it would open a seam); missing points are filled; the
    edges are made to meet; the surface is resampled. `Surface.measured` marks what was filled or
    tapered, and `Surface.steps` tells the roughness after each step.

    **Arguments:**

    - `heights`: [m], shape `(nx, ny)` or `(nx,)`; NaN, infinite or masked where missing.
    - `size`: edge lengths [m], shape `(ndim,)`; one number means a square.
    - `periodic`: `"window"` multiplies by a cosine-flanked (Tukey) window that falls to zero over
      the outer tenth at either end of each axis, then scales the heights to keep their rms;
      `"mirror"` reflects, doubling each axis, which keeps every height but leaves kinks at the
      seams; None takes the heights as they stand and refuses them if the edges do not meet.
    - `shape`: number of points of the result; None keeps that of the data.
    - `region`: the part to keep, `[x0, x1, y0, y1]` or for a profile `[x0, x1]` [m] from the first
      point; None keeps all. Where points are missing, the history names the largest part without.
    - `fill`: `"low"` lets the surface sink from the heights around a hole towards the lowest
      measured ones, somewhat steeper than it is rough, which keeps it out of contact; `"harmonic"`
      solves Laplace's equation, the smoothest that joins the heights around; None refuses missing
      points.
    - `rim`: how many rings of measured points around each hole to discard with it. Optical
      instruments report spikes there, which the filling would continue; the history tells when
      the rims stand out.
    - `history`, `steps`: to begin those of the surface with.

    **Raises:** `ValueError` for a refused argument.
    """
    _check_choices(periodic, fill, rim)
    values = np.ma.filled(np.ma.asarray(heights, float), np.nan)
    values = np.where(np.isfinite(values), values, np.nan)
    grid = Grid(values.shape, size)  # refuses a wrong number of axes
    edges = np.asarray(grid.size, float)
    spacing = edges / np.array(values.shape)
    notes, rows = list(history), list(steps)

    def record(name: str) -> None:
        rows.append(step(name, values, spacing))

    if np.sum(np.isfinite(values)) < 4:
        raise ValueError(
            f"`heights` has {np.sum(np.isfinite(values))} measured points; at least 4 are needed."
        )
    if np.nanmax(np.abs(values)) > LARGEST:
        raise ValueError(
            f"`heights` reach {np.nanmax(np.abs(values)):.3g} m: the file is damaged, or `unit` is "
            "not that of its numbers."
        )
    record("equally spaced" if rows else "read")
    if region is not None:
        values = values[_part(region, values.shape, spacing)]
        edges = spacing * np.array(values.shape)
        points = " x ".join(map(str, values.shape))
        notes.append(f"Cut out `region={np.asarray(region).tolist()}`, {points} points.")
        record("cropped")
    missing = np.isnan(values)
    num_missing = int(np.sum(missing))
    for _ in range(rim):
        missing = grown(missing)
    known = values[~missing]
    if known.size < 4:
        raise ValueError(f"`heights` has {known.size} measured points; at least 4 are needed.")
    plane, slopes = _plane(values, missing, edges)
    residual = (values - plane)[~missing]
    if np.std(residual) <= 1e-12 * np.max(np.abs(known)):
        raise ValueError("`heights` is a plane: no roughness is left after levelling.")
    if periodic is None:
        values = values - np.mean(known)
    else:
        values = values - plane
        slope = ", ".join(f"{value:.3g}" for value in slopes)
        notes.append(f"Subtracted a plane of slope ({slope}).")
        record("tilt removed")
    measured = np.where(missing, 0.0, 1.0)
    if num_missing:
        around = np.sqrt(np.mean(values[grown(missing) & ~missing] ** 2))
        notes.append(_region_note(missing, spacing))
        values = _fill(np.where(missing, np.nan, values), missing, spacing, fill)
        notes.append(
            _filling_note(missing, num_missing, fill, rim, around, float(np.std(residual)))
        )
        record("filled")
    if periodic == "window":
        values, taper, factor = _window(values)
        measured = measured * taper
        notes.append(
            f"Tapered the outer {100 * TAPER:g} % at either end of each axis to zero (Tukey "
            f"window) and multiplied the heights by {factor:.4g} to keep the rms height."
        )
        record("tapered")
    elif periodic == "mirror":
        for axis in range(values.ndim):
            values, measured = (
                np.concatenate([field, np.flip(field, axis)], axis) for field in (values, measured)
            )
        edges = 2 * edges
        notes.append("Reflected about the end of each axis, doubling it.")
        record("mirrored")
    else:
        _check_seams(values)
        notes.append("Taken as periodic.")
    surface = Surface(
        heights=values - np.mean(values),
        grid=Grid(values.shape, edges),
        history=tuple(notes),
        measured=None if np.all(measured == 1) else measured,
        steps=tuple(rows),
    )
    return surface if shape is None else resample(surface, shape)


def _check_choices(periodic: Any, fill: Any, rim: Any) -> None:
    if isinstance(rim, bool) or not isinstance(rim, int) or rim < 0:
        raise ValueError(f"`rim={rim}` is refused: a whole number of at least 0 is needed.")
    for name, value, choices in (("periodic", periodic, PERIODIC), ("fill", fill, FILL)):
        if value not in choices:
            raise ValueError(f"`{name}={value!r}` is refused: use one of {choices}.")


@contextlib.contextmanager
def _reading(path: Path, warned: list[str]) -> Iterator[None]:
    """Turns whatever a reader raises on a damaged file into `ValueError`, collects its warnings."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield
    except Refusal as error:
        raise ValueError(f"`path={path}` is refused: {error}.") from None
    except ImportError:
        raise
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


def _scan(path: Path, channel: str | int | None) -> Scan:
    """The heights in a file, by the reader that its content asks for."""
    content = path.read_bytes()
    if content.startswith(b"\x93NUMPY") or (path.suffix == ".npz" and content[:2] == b"PK"):
        return read_arrays(content, channel)
    if is_road(content):
        return read_road(content)
    text = decoded(content)
    if text is None:
        return read_instrument(path, channel)
    # Text with a header of its own is the library's; it takes much else for a table of numbers.
    try:
        scan = read_instrument(path, channel)
    except Refusal:
        raise
    except Exception:  # it raises many kinds, also where it is not installed
        return read_text(text)
    told = scan.unit is not None and scan.size is not None
    return scan if told else read_text(text)


def _scales(scan: Scan, size: Any, unit: str | None) -> tuple[float, np.ndarray]:
    """Metres per unit of the heights, and the edge lengths [m]; asks for all that is not told."""
    told = (scan.unit, *((scan.lateral_unit,) if scan.size is not None else ()))
    lacking = {"unit": None in told and unit is None, "size": scan.size is None and size is None}
    if any(lacking.values()):
        hints = {"unit": "`unit`, for instance 'um'", "size": "`size` [m]"}
        names = [name for name, absent in lacking.items() if absent]
        asked = ", and ".join(hints[name] for name in names)
        raise Refusal(f"it does not tell its {' and '.join(names)}; pass {asked}")
    if None not in told and unit is not None:
        raise Refusal(f"it is in {scan.unit!r}; leave out `unit={unit!r}`")
    factors = []
    for name in told:
        spelt = unit if name is None else name
        factor = metres(str(spelt)) or metres_of_library(str(spelt))
        if factor is None:
            named = f"`unit={unit!r}`" if name is None else f"{scan.source} in {name!r}"
            raise Refusal(f"{named} is not a length, such as 'm', 'um' or 'nm'")
        factors.append(factor)
    if scan.size is not None:
        known = factors[-1] * scan.size
        if size is not None:
            raise Refusal(f"it tells its size, {known} m; leave out `size`")
        if not (np.all(np.isfinite(known)) and np.all(known > 0)):
            raise Refusal(f"its size of {known} m is no length")
        return factors[0], known
    num_axes = scan.heights.ndim
    edges = np.array(size, float)
    if edges.shape not in ((), (num_axes,)):
        raise Refusal(f"`size` has shape {edges.shape}, it needs {num_axes} lengths")
    return factors[0], np.broadcast_to(edges, (num_axes,))


def _reach(positions: np.ndarray) -> float:
    """The period that the points of a line stand for: one mean step more than their span."""
    return float(np.ptp(positions)) * len(positions) / (len(positions) - 1)


def _step_of_line(positions: np.ndarray, heights: np.ndarray) -> Step:
    """The roughness of a line scan as read, each slope counted by its length."""
    apart = np.diff(positions)
    uneven = step("read", heights, [1.0])
    squares = (np.diff(heights) / apart) ** 2 * apart
    known = np.isfinite(squares)
    slope = np.sqrt(np.sum(squares[known]) / max(float(np.sum(apart[known])), 1e-300))
    return uneven._replace(rms_slope=float(slope))


def _equally_spaced(
    positions: np.ndarray, heights: np.ndarray, notes: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """A line scan at equal steps, NaN in its gaps, and its length [m]."""
    known = np.isfinite(heights)
    positions, heights = positions[known], heights[known]
    if len(positions) < 4:
        raise ValueError(f"`heights` has {len(positions)} measured points; at least 4 are needed.")
    apart = np.diff(positions)
    typical = float(np.median(apart))
    if not np.ptp(positions) <= 100 * len(positions) * typical:
        raise ValueError("`heights` are spaced too unequally: cut the scan into parts.")
    num = int(np.ptp(positions) / typical) + 1
    even = positions[0] + typical * np.arange(num)
    values = np.interp(even, positions, heights)
    values[(apart > GAP * typical)[np.clip(np.searchsorted(positions, even) - 1, 0, None)]] = np.nan
    notes.append(
        f"Its points, {np.min(apart):.3g} to {np.max(apart):.3g} m apart, are not equally spaced: "
        f"interpolated linearly to {num} points {typical:.4g} m apart; {np.sum(np.isnan(values))} "
        f"in gaps of more than {GAP} steps count as missing."
    )
    return values, np.array([typical * num])


def _part(region: Numbers, shape: tuple[int, ...], spacing: np.ndarray) -> tuple[slice, ...]:
    """The points in a region [m]."""
    limits = np.asarray(region, float)
    size = spacing * np.array(shape)
    wanted = "[x0, x1, y0, y1]" if len(shape) == 2 else "[x0, x1]"
    if limits.shape != (2 * len(shape),) or not np.all(np.isfinite(limits)):
        raise ValueError(f"`region={limits.tolist()}` is refused: it must be {wanted} [m].")
    ends = np.rint(limits.reshape(-1, 2) / spacing[:, None]).astype(int)
    if np.any(ends < 0) or np.any(ends[:, 1] > shape) or np.any(ends[:, 1] - ends[:, 0] < 4):
        raise ValueError(
            f"`region={limits.tolist()}` is refused: {wanted} must lie in the map of "
            f"{' x '.join(f'{s:.4g}' for s in size)} m and hold at least 4 points along each axis."
        )
    return tuple(slice(first, last) for first, last in ends)


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
    values: np.ndarray, missing: np.ndarray, spacing: np.ndarray, fill: str | None
) -> np.ndarray:
    if fill is None:
        raise ValueError(
            f"`heights` has {np.sum(missing)} missing points; pass `fill='low'` to fill them."
        )
    known = values[~missing]
    scale = np.max(np.abs(known))
    bottom = float(np.quantile(known, LOW)) / scale
    slope = step("", values, spacing).rms_slope / scale
    descent = (np.mean(known) / scale - bottom) / (STEEPER * slope) if slope > 0 else np.inf
    length = max(descent, 2 * float(np.max(spacing))) if fill == "low" else np.inf
    return scale * filled(np.where(missing, 0, values / scale), missing, spacing, bottom, length)


def _region_note(missing: np.ndarray, spacing: np.ndarray) -> str:
    """What part of the map lacks nothing."""
    part = largest_rectangle(missing)
    points = np.prod([p.stop - p.start for p in part])
    if min(p.stop - p.start for p in part) < 4:
        return "No part of it of 4 points along each axis was measured completely."
    ends = [f"{end * apart:.6g}" for p, apart in zip(part, spacing, strict=True)
            for end in (p.start, p.stop)]  # fmt: skip
    return (
        f"Its largest completely measured part is `region=[{', '.join(ends)}]`, "
        f"{100 * points / missing.size:.2g} % of the points."
    )


def _filling_note(
    missing: np.ndarray, num_missing: int, fill: str | None, rim: int, around: float, spread: float
) -> str:
    rings = f", with {rim} ring(s) of measured points around them," if rim else ""
    how = "sinking from their rims" if fill == "low" else "with harmonic functions"
    note = (
        f"Filled {num_missing} missing points ({100 * num_missing / missing.size:.2g} %){rings} "
        f"{how}."
    )
    if around > 3 * spread:
        note += (
            f" Their rims stand out, with rms height {around:.3g} m against {spread:.3g} m of all "
            f"measured points: they may be artefacts, see `rim={rim + 1}`."
        )
    return note


def _window(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The tapered heights with their rms restored, the window, and the factor that restored it."""
    window = np.ones(values.shape)
    for axis, n in enumerate(values.shape):
        x = (np.arange(n) + 0.5) / n
        edge = np.minimum(np.minimum(x, 1 - x) / TAPER, 1)
        taper = np.sin(np.pi / 2 * edge) ** 2
        window = window * np.expand_dims(taper, [a for a in range(values.ndim) if a != axis])
    tapered = window * (values - np.mean(values))
    if np.std(tapered) <= 1e-6 * np.std(values):
        raise ValueError("`heights` vary only at the edges, where the window removes them.")
    factor = float(np.std(values) / np.std(tapered))
    return factor * tapered, window, factor


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
