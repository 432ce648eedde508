"""The same surface with other heights, or on another number of points."""

import dataclasses

import jax
import numpy as np
from jaxtyping import ScalarLike

from ..core.checks import check_positive
from ..fields.grid import Grid, resampled
from .spectrum import one_of_height_and_slope
from .statistics import statistics
from .surface import Surface, check_periodic


def rescale(
    surface: Surface, *, rms_height: ScalarLike | None = None, rms_slope: ScalarLike | None = None
) -> Surface:
    """Returns the surface with its heights multiplied to have this rms height [m] or slope [1].

    **Arguments:**

    - `surface`: not flat.
    - `rms_height` [m] or `rms_slope` [1]: the new value.

    **Returns:** the surface of other heights.
    """
    name, target = one_of_height_and_slope(rms_height, rms_slope)
    actual = getattr(statistics(surface), name)
    check_positive(f"statistics(surface).{name}", actual, "(a flat surface cannot be rescaled)")
    history = (*surface.history, f"Multiplied to prescribe the {name}.")
    return dataclasses.replace(
        surface, heights=surface.heights * (target / actual), history=history
    )


def resample(surface: Surface, shape: int | tuple[int, ...]) -> Surface:
    """Returns the surface on another number of points of the same cell, by its Fourier modes.

    A finer grid interpolates (modes on the old Nyquist lines are dropped); a coarser one loses the
    waves that it cannot hold.

    **Arguments:**

    - `surface`: any.
    - `shape`: number of points along each edge.

    **Returns:** the surface on the other grid, of the same size.
    """
    check_periodic(surface)
    old = surface.grid.shape
    grid = Grid(shape, surface.grid.size)
    if grid.shape == old:
        return surface
    pairs = zip(old, grid.shape, strict=True)
    nearest = np.ix_(*(np.rint(np.arange(m) * (n / m)).astype(int) % n for n, m in pairs))
    measured = None if surface.measured is None else surface.measured[nearest]
    note = f"Resampled from {old} to {grid.shape} points by Fourier modes."
    heights = jax.jit(resampled, static_argnums=1)(surface.heights, grid.shape)
    return Surface(heights, grid, (*surface.history, note), measured, warnings=surface.warnings)
