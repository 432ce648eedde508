"""From measured heights to a surface: crop, level, fill holes, make periodic.

What is done to the data is recorded, in order, in `Surface.history`, and what it does to the
roughness in `Surface.steps`.

A part of a rough surface is made periodic by subtracting a harmonic function (L. Moisan, J. Math.
Imaging Vis. 39 (2011) 161, doi:10.1007/s10851-010-0227-1): among all functions that jump by as much
from one edge to the opposite one, it has the smallest slopes. Waves are joined within their own
length of an edge. There they lose some slope, which a common factor restores.
"""

import dataclasses
import functools
from typing import Literal

import numpy as np
from jaxtyping import ArrayLike

from ..core.checks import Numbers, check_whole
from ..core.display import with_unit
from ..fields.grid import Grid
from .holes import fill_holes, grown, region_note
from .reading_steps import ReadingStep, step
from .rescaling import resample
from .scan_lines import AlongAxis, jump_warnings, levelled
from .surface import Surface

TAPER = 0.1  # length of the window's flank at either end of an axis, relative to the axis
MOST_GAIN = 1.1  # factor that restores the slope: on forms without roughness it would have no limit
Periodic = Literal["harmonic", "mirror", "window", "open"]
Fill = Literal["low", "harmonic"]
TALLEST = 1e5  # [m], higher than any mountain
FEWEST_MARKS = 3  # equal extreme heights that look like marks of missing points
FAR = 10  # times the range of all other heights


def surface_from_heights(
    heights: ArrayLike,
    size: Numbers,
    *,
    periodic: Periodic | None = "harmonic",
    shape: int | tuple[int, ...] | None = None,
    region: Numbers | None = None,
    fill: Fill | None = "low",
    rim: int = 0,
    level_lines: AlongAxis | None = None,
    history: tuple[str, ...] = (),
    steps: tuple[ReadingStep, ...] = (),
    assumed: tuple[str, ...] = (),
) -> Surface:
    """Returns measured heights as a periodic surface of zero mean.

    In this order: a region is cut out; lines are levelled, if asked; a least-squares plane through
    the measured points is subtracted (not with `periodic` None, where it would open a seam, or
    "open"); missing points are filled; the edges are made to meet; the surface is resampled.
    `Surface.measured` marks what was filled or tapered, `Surface.steps` holds the roughness after
    each step.

    **Arguments:**

    - `heights`: [m], shape `(nx, ny)` or `(nx,)`; NaN, infinite or masked where missing.
    - `size`: edge lengths [m], shape `(ndim,)`; one number means a square.
    - `periodic`: `"harmonic"` subtracts the smooth function that has the jumps between opposite
      edges, and restores the rms slope; `"mirror"` reflects, which doubles each axis: all heights
      remain, with kinks at the seams; `"window"` multiplies by a cosine-flanked (Tukey) window
      that falls to zero over the outer tenth at either end of each axis, then scales the heights to
      restore their rms; `"open"` keeps heights and tilt, and the body ends at the edges: a window
      (`Surface.periodic` is False), such as of an indenter; None uses the heights unchanged and
      refuses them if the edges do not meet.
    - `shape`: number of points of the result; None uses that of the data.
    - `region`: the part to use, `[x0, x1, y0, y1]` or for a profile `[x0, x1]` [m] from the first
      point; None uses all. If points are missing, the history names the largest complete part.
    - `fill`: `"low"` lets the surface sink from the heights around a hole towards the lowest
      measured ones, somewhat steeper than it is rough, which keeps it out of contact; `"harmonic"`
      solves Laplace's equation, the smoothest that joins the heights around; None refuses missing
      points.
    - `rim`: how many rings of measured points around each hole to discard with it. Optical
      instruments report spikes there, which the filling would continue; the history has a
      warning when the rims are much rougher.
    - `level_lines`: "x" or "y" shifts each line along this axis by the median of its differences
      from the line before. It takes out the jumps of a microscope between its lines, and with them
      all waves and the tilt that only lead across the lines. A warning reports jumps.
    - `history`, `steps`, `assumed`: to begin those of the surface with.

    **Returns:** the surface, with its history.

    **Raises:** `ValueError` for a refused argument.
    """
    check_whole("rim", rim, 0)
    values = np.ma.filled(np.ma.asarray(heights, float), np.nan)
    values = np.where(np.isfinite(values), values, np.nan)
    edges = np.asarray(Grid(values.shape, size).size, float)  # refuses a wrong number of axes
    _check_measured(values[np.isfinite(values)])
    highest = np.nanmax(np.abs(values))
    if highest > TALLEST:
        raise ValueError(f"`heights` reach {highest:.3g} m: damaged, or of another `unit`.")
    spacing = edges / np.array(values.shape)
    warnings = [*assumed, *mark_warnings(values)]
    prepared = _Prepared(values, spacing, list(history), list(steps), warnings)
    # A line scan at unequal steps has its roughness as read among the steps already.
    prepared.record("equally spaced" if steps else "read")
    if region is not None:
        prepared.crop(region)
    if level_lines is not None:
        prepared.level_lines(level_lines)
    prepared.level(rim, tilted=periodic in (None, "open"))
    if prepared.num_missing:
        prepared.fill(fill, rim)
    surface = prepared.closed(periodic)
    return surface if shape is None else resample(surface, shape)


@dataclasses.dataclass
class _Prepared:
    """Heights [m] at points of distance `spacing` [m], and the steps so far."""

    values: np.ndarray
    spacing: np.ndarray
    notes: list[str]
    rows: list[ReadingStep]
    assumed: list[str]

    def record(self, name: str, *notes: str) -> None:
        self.rows.append(step(name, self.values, self.spacing))
        self.notes.extend(notes)

    def crop(self, region: Numbers) -> None:
        limits, shape = np.asarray(region, float), self.values.shape
        fits = limits.shape == (2 * len(shape),) and np.all(np.isfinite(limits))
        ends = np.rint(limits.reshape(-1, 2) / self.spacing[:, None]) if fits else np.zeros((1, 2))
        if not (np.all(ends >= 0) and np.all(ends[:, 1] <= shape) and np.all(np.diff(ends) >= 4)):
            form = "[x0, x1]" if len(shape) == 1 else "[x0, x1, y0, y1]"
            edges = " x ".join(f"{edge:.4g}" for edge in self.spacing * np.array(shape))
            where = f"in the map of {edges} m, with 4 points or more along each axis"
            raise ValueError(f"`region={limits.tolist()}` is refused: {form} [m] must lie {where}.")
        self.values = self.values[tuple(slice(*pair) for pair in ends.astype(int).tolist())]
        points = " x ".join(map(str, self.values.shape))
        self.record("cropped", f"Cut out `region={np.asarray(region).tolist()}`, {points} points.")

    def level_lines(self, lines: AlongAxis) -> None:
        if self.values.ndim == 1:
            raise ValueError(f"`level_lines={lines!r}` is refused: a profile is one line.")
        self.values = levelled(self.values, lines)
        self.record("lines levelled")
        left = with_unit(self.rows[-1].rms_height, "m"), f"{self.rows[-1].rms_slope:.3g}"
        how = "by the median of its differences from the line before"
        rest = "rms height {} and slope {} are left".format(*left)
        self.notes.append(f"Shifted each line along {lines} {how}: {rest}.")

    def level(self, rim: int, *, tilted: bool) -> None:
        """Counts rims as missing, and subtracts the plane or, if it stays `tilted`, the mean."""
        self.missing = np.isnan(self.values)
        self.num_missing = int(np.sum(self.missing))
        self.missing = grown(self.missing, rim)
        known = self.values[~self.missing]
        _check_measured(known)
        # The least-squares plane through the measured points, about the middle of the map, where
        # mean and slopes are independent unless points are missing.
        shape = self.values.shape
        axes = np.meshgrid(*[(np.arange(n) + 0.5) / n - 0.5 for n in shape], indexing="ij")
        basis = np.stack([np.ones(shape), *axes], axis=-1)
        coefficients = np.linalg.lstsq(basis[~self.missing], known)[0]
        plane = basis @ coefficients
        # That of the roughness, with which rims of holes are compared.
        flat = np.where(self.missing, np.nan, self.values - plane)
        self.spread = float(np.nanstd(flat))
        if self.spread <= 1e-12 * np.max(np.abs(known)):
            raise ValueError("`heights` is a plane: no roughness is left after levelling.")
        self.assumed.extend(jump_warnings(flat, self.spacing))
        if tilted:
            self.values = self.values - np.mean(known)
            return
        self.values = self.values - plane
        slopes = coefficients[1:] / (self.spacing * np.array(shape))
        slope = ", ".join(f"{value:.3g}" for value in slopes)
        self.record("tilt removed")
        left = self.rows[-1]
        rest = f"rms height {with_unit(left.rms_height, 'm')} and slope {left.rms_slope:.3g}"
        self.notes.append(f"Subtracted a plane of slope ({slope}): {rest} are left.")

    def fill(self, fill: str | None, rim: int) -> None:
        missing, count = self.missing, self.num_missing
        if fill is None:
            raise ValueError(f"`heights` has {count} missing points; pass `fill='low'`.")
        # Optical instruments report spikes at the rims of holes, which the filling would continue.
        around = np.sqrt(np.mean(self.values[grown(missing, 1) & ~missing] ** 2))
        self.values = fill_holes(self.values, missing, self.spacing, fill == "low")
        rings = f", with {rim} ring(s) of measured points around them," if rim else ""
        low = "below their surroundings, so that they do not touch"
        how = low if fill == "low" else "with harmonic functions"
        share = f"{100 * count / missing.size:.2g} %"
        note = f"Filled {count} missing points ({share}){rings} {how}."
        if around > 3 * self.spread:
            times = f"{around / self.spread:.2g} times the rms height of all measured points"
            note += f" Their rims stand out by {times}. They may be artefacts, see `rim={rim + 1}`."
        self.record("filled", region_note(missing, self.spacing), note)

    def join(self) -> None:
        """Subtracts the harmonic function that has the jumps at the edges."""
        before = step("", self.values, self.spacing)
        # The periodic solution of ∇²s = what the jumps at the edges add to ∇² of the heights.
        values, ndim = self.values, self.values.ndim
        jumps, symbol = np.zeros(values.shape), np.zeros(values.shape)
        apart = self.spacing / np.min(self.spacing)
        for axis, (n, pixel) in enumerate(zip(values.shape, apart, strict=True)):
            ends = np.moveaxis(jumps, axis, 0)
            jump = (np.take(values, -1, axis) - np.take(values, 0, axis)) / pixel**2
            ends[0] += jump
            ends[-1] -= jump
            waves = (2 * np.cos(2 * np.pi * np.arange(n) / n) - 2) / pixel**2
            symbol += np.expand_dims(waves, [a for a in range(ndim) if a != axis])
        symbol.flat[0] = 1.0  # the mean of the jumps is zero
        joint = np.real(np.fft.ifftn(np.fft.fftn(jumps) / symbol))
        self.values = self.values - joint
        after = step("", self.values, self.spacing)
        if after.rms_height <= 1e-12 * before.rms_height:
            raise ValueError("`heights` has no roughness left after its edges were joined.")
        # Waves near the edges lost some slope; a form without roughness must not be blown up.
        factor = min(before.rms_slope / after.rms_slope, MOST_GAIN)
        self.values = factor * self.values
        less = (
            f"subtracting a harmonic function of rms height {with_unit(float(np.std(joint)), 'm')}"
        )
        shown = f"{factor:.4g}"
        restored = f" and multiplied the heights by {shown} to restore the rms slope"
        self.record("joined", f"Joined opposite edges by {less}{restored * (shown != '1')}.")

    def closed(self, periodic: str | None) -> Surface:
        """The surface with joined edges."""
        measured = np.where(self.missing, 0.0, 1.0)
        if periodic == "harmonic":
            self.join()
        elif periodic == "window":
            self.values, taper, factor = _window(self.values)
            measured = measured * taper
            kept = f"multiplied the heights by {factor:.4g} to keep the rms height"
            tapered = f"Tapered {100 * TAPER:g} % at either end of each axis to zero"
            self.record("tapered", f"{tapered} and {kept}.")
        elif periodic == "mirror":
            width = [(0, n) for n in self.values.shape]
            self.values = np.pad(self.values, width, "symmetric")
            measured = np.pad(measured, width, "symmetric")
            self.record("mirrored", "Reflected about the end of each axis, doubling it.")
        elif periodic == "open":
            self.notes.append("Taken as a body that ends at the edges.")
        else:
            _check_seams(self.values)
            self.notes.append("Taken as periodic.")
        heights, history, steps = self.values - np.mean(self.values), self.notes, self.rows
        grid = Grid(heights.shape, self.spacing * np.array(heights.shape))
        measured = None if np.all(measured == 1) else measured
        repeats = periodic != "open"
        kept = (repeats, tuple(self.assumed))
        return Surface(heights, grid, tuple(history), measured, tuple(steps), *kept)


def _check_measured(known: np.ndarray) -> None:
    if known.size < 4:
        raise ValueError(f"`heights` has {known.size} measured points; at least 4 are needed.")


def mark_warnings(heights: np.ndarray) -> list[str]:
    """Returns a sentence on equal extreme heights far from all others, marks of missing points."""
    known, found = heights[np.isfinite(heights)], []
    for value in (np.min(known), np.max(known)):
        others = known[known != value]
        count = len(known) - len(others)
        if count < FEWEST_MARKS or not np.size(others) or np.ptp(others) == 0:
            continue
        if np.min(np.abs(others - value)) > FAR * np.ptp(others):
            found.append(
                f"{count} heights of {value:.8g} m lie far from all others, as marks of missing "
                "points do, and count as heights: otherwise make them NaN (`missing` of a file)."
            )
    return found


def _window(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The tapered heights with their rms restored, the window, and the factor that restored it."""
    x = [(np.arange(n) + 0.5) / n for n in values.shape]
    flanks = [np.minimum(np.minimum(x, 1 - x) / TAPER, 1) for x in x]
    window = functools.reduce(np.multiply.outer, [np.sin(np.pi / 2 * f) ** 2 for f in flanks])
    tapered = window * (values - np.mean(values))
    if np.std(tapered) <= 1e-6 * np.std(values):
        raise ValueError("`heights` vary only at the edges, where the window is zero.")
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
            times = f"{across / max(inside, 1e-300):.3g} times the step between neighbours"
            raise ValueError(
                f"`periodic=None` is refused. Along {name} the heights jump by {across:.3g} m from "
                f"the last point to the first, {times}: leave out `periodic`, or pass 'mirror'."
            )
