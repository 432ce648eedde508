"""From measured heights to a surface: level, fill holes, make periodic.

What is done to the data is recorded, in order, in `Surface.history`. Scan lines are levelled, and
spikes removed, by SurfaceTopography or NumPy before; a part of a map is a slice of its array.

A part of a rough surface is made periodic by subtracting a harmonic function (L. Moisan, J. Math.
Imaging Vis. 39 (2011) 161, doi:10.1007/s10851-010-0227-1): among all functions that jump by as much
from one edge to the opposite one, it has the smallest slopes. Waves are joined within their own
length of an edge. There they lose some slope, which a common factor restores.
"""

from typing import Literal

import numpy as np
from jaxtyping import ArrayLike

from ..core.checks import Numbers, check_type
from ..core.display import with_unit
from ..fields.grid import Grid
from .holes import filled, rms_slope
from .rescaling import resample
from .surface import Surface

MOST_GAIN = 1.1  # factor that restores the slope: on forms without roughness it would have no limit
Periodic = Literal["harmonic", "mirror", "open"]
FEWEST_MARKS = 3  # equal extreme heights that look like marks of missing points
FAR = 10  # times the range of all other heights
SPIKE = 10  # distance from the mean over the rms height; 1e-22 of Gaussian heights are beyond


def surface_from_heights(
    heights: ArrayLike,
    size: Numbers,
    *,
    periodic: Periodic = "harmonic",
    shape: int | tuple[int, ...] | None = None,
    history: tuple[str, ...] = (),
) -> Surface:
    """Returns measured heights as a periodic surface of zero mean.

    In this order: a least-squares plane through the measured points is subtracted (not with
    `periodic="open"`); missing points sink; the edges are made
    to meet; the surface is resampled. Holes sink from the heights around them towards the lowest
    measured ones, somewhat steeper than the surface is rough, which keeps them out of contact;
    `Surface.measured` marks them.

    **Arguments:**

    - `heights`: [m], shape `(nx, ny)` or `(nx,)`; NaN, infinite or masked where missing.
    - `size`: edge lengths [m], shape `(ndim,)`; one number means a square.
    - `periodic`: `"harmonic"` subtracts the smooth function that has the jumps between opposite
      edges, and restores the rms slope; `"mirror"` reflects, which doubles each axis: all heights
      remain, with kinks at the seams; `"open"` keeps heights and tilt, and the body ends at the
      edges (`Surface.periodic` is False), such as an indenter. Heights that are periodic already
      are a `Surface(heights, Grid(shape, size))`.
    - `shape`: number of points of the result; None: as many as the data have.
    - `history`: first sentences of the history of the surface.

    **Returns:** the surface, with its history and warnings.

    **Raises:** `ValueError` for a refused argument.
    """
    check_type("periodic", periodic, "harmonic", "mirror", "open")
    values = np.ma.filled(np.ma.asarray(heights, float), np.nan)
    missing = ~np.isfinite(values)
    edges = np.asarray(Grid(values.shape, size).size, float)  # refuses a wrong number of axes
    if np.sum(~missing) < 4:
        raise ValueError(f"`heights` must have 4 measured points or more, not {np.sum(~missing)}.")
    spacing, notes = edges / np.array(values.shape), list(history)
    plane, rise = _plane(values, missing)
    warnings = mark_warnings(values) or _spike_warnings((values - plane)[~missing])
    if periodic == "open":
        values = values - np.mean(values[~missing])
    else:
        values = values - plane
        slope = ", ".join(f"{value:.3g}" for value in rise / edges)
        notes.append(f"Subtracted a plane of slope ({slope}).")
    if np.any(missing):
        values = filled(values, missing, spacing)
        share = f"{100 * np.mean(missing):.2g} %"
        notes.append(f"Filled {np.sum(missing)} missing points ({share}) below their surroundings.")
    if periodic == "harmonic":
        values, note = _tapered(values, spacing)
        notes.append(note)
    elif periodic == "mirror":
        width = [(0, n) for n in values.shape]
        values, missing = (np.pad(field, width, "symmetric") for field in (values, missing))
        notes.append("Reflected about the end of each axis, doubling it.")
    else:
        notes.append("Taken as a body that ends at the edges.")
    surface = Surface(
        values - np.mean(values),
        Grid(values.shape, spacing * np.array(values.shape)),
        tuple(notes),
        np.where(missing, 0.0, 1.0) if np.any(missing) else None,
        periodic=periodic != "open",
        warnings=tuple(warnings),
    )
    return surface if shape is None else resample(surface, shape)


def _plane(values: np.ndarray, missing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least-squares plane through the measured points, and its rise along each edge [m]."""
    # About the middle of the map, where mean and slopes are independent unless points are missing.
    axes = np.meshgrid(*[(np.arange(n) + 0.5) / n - 0.5 for n in values.shape], indexing="ij")
    basis = np.stack([np.ones(values.shape), *axes], axis=-1)
    known = values[~missing]
    coefficients = np.linalg.lstsq(basis[~missing], known)[0]
    plane = basis @ coefficients
    if np.std(known - plane[~missing]) <= 1e-12 * np.max(np.abs(known)):
        raise ValueError("`heights` must not be a plane: no roughness is left after levelling.")
    return plane, coefficients[1:]


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


def _spike_warnings(known: np.ndarray) -> list[str]:
    """A sentence on a point that is far from all others, of levelled heights [m]."""
    peak = np.max(np.abs(known)) / np.std(known)
    if peak <= SPIKE:
        return []
    return [
        f"A point is {peak:.3g} rms heights from the mean plane, as spikes of instruments and dust "
        "are: make it NaN, or use a slice of the heights without it."
    ]


def _tapered(values: np.ndarray, spacing: np.ndarray) -> tuple[np.ndarray, str]:
    """The heights less the harmonic function that has the jumps at the edges, and a sentence."""
    # The periodic solution of ∇²s = what the jumps at the edges add to ∇² of the heights.
    jumps, symbol = np.zeros(values.shape), np.zeros(values.shape)
    apart = spacing / np.min(spacing)
    for axis, (n, pixel) in enumerate(zip(values.shape, apart, strict=True)):
        ends = np.moveaxis(jumps, axis, 0)
        jump = (np.take(values, -1, axis) - np.take(values, 0, axis)) / pixel**2
        ends[0] += jump
        ends[-1] -= jump
        waves = (2 * np.cos(2 * np.pi * np.arange(n) / n) - 2) / pixel**2
        symbol += np.expand_dims(waves, [a for a in range(values.ndim) if a != axis])
    symbol.flat[0] = 1.0  # the mean of the jumps is zero
    joint = np.real(np.fft.ifftn(np.fft.fftn(jumps) / symbol))
    joined = values - joint
    if np.std(joined) <= 1e-12 * np.std(values):
        raise ValueError("`heights` must vary between their edges, which were joined.")
    # Waves near the edges lost some slope; a form without roughness must not be blown up.
    factor = min(rms_slope(values, spacing) / rms_slope(joined, spacing), MOST_GAIN)
    rms = with_unit(float(np.std(joint)), "m")
    return factor * joined, (
        f"Joined opposite edges by subtracting a harmonic function of rms height {rms}, and "
        f"multiplied the heights by {factor:.4g} to restore the rms slope."
    )
