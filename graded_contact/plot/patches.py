"""The figure of where a surface touches."""

from typing import TYPE_CHECKING

import numpy as np

from ..core.display import unit_of
from ..friction.sliding import Sliding
from ..roughness.surface import Surface
from .style import COLOURS, COLUMN, HEIGHTS, PAGE, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

FINEST = 1024  # points along an edge that an outline can show


@styled
def plot_outline(sliding: "Sliding | Dataset", surface: Surface) -> "Figure":
    """Returns a figure of the heights with the outline of the contact.

    The outline runs where the pressure goes over into the gap, between points of the grid. On a
    profile the contact is drawn as thick pieces.

    **Arguments:**

    - `sliding`: a solution of `slide`, or the first of `contact_at(results, index)`.
    - `surface`: the surface that slides.
    """
    from matplotlib.ticker import MaxNLocator

    heights, pressure = np.asarray(surface.heights), np.asarray(sliding.pressure)
    heights, size = heights - np.mean(heights), np.asarray(surface.grid.size)
    gap = np.maximum(np.asarray(sliding.gap), 0)
    unit, factor = unit_of("m", np.max(size))
    height_unit, scale = unit_of("m", np.max(np.abs(heights)))
    x = [factor * (np.arange(n) + 0.5) * s / n for n, s in zip(heights.shape, size, strict=True)]
    label = f"height (into the solid) [{height_unit}]"
    if heights.ndim == 1:
        figure = new_figure(PAGE, 2.2)
        axes = figure.subplots()
        axes.plot(x[0], scale * heights, color="0.6", linewidth=0.8, label="surface")
        touching = np.where(pressure > 0, scale * heights, np.nan)
        axes.plot(x[0], touching, ".-", color=COLOURS[1], linewidth=2.5, label="contact")
        axes.set(xlabel=f"$x$ [{unit}]", ylabel=label)
        axes.legend()
        return figure
    figure = new_figure(COLUMN, 0.4 + 2.7 * float(np.clip(size[1] / size[0], 0.5, 2.0)))
    axes = figure.subplots()
    extent = (0, factor * size[0], 0, factor * size[1])
    image = axes.imshow(scale * heights.T, origin="lower", extent=extent, cmap=HEIGHTS)
    # Of one size on both sides of the edge, so that it lies between their points.
    level = pressure / (np.std(pressure) or 1) - gap / (np.std(gap) or 1)
    if np.any(level > 0) and np.any(level < 0):
        step = -(-max(level.shape) // FINEST)
        x, level = [at[::step] for at in x], level[::step, ::step]
        axes.contour(*x, level.T, levels=[0.0], colors="black", linewidths=0.5)
    figure.colorbar(image, ax=axes, shrink=0.9, pad=0.02, label=label)
    axes.grid(visible=False)
    axes.spines[:].set_visible(True)
    axes.set(xlabel=f"$x$ [{unit}]", ylabel=f"$y$ [{unit}]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
    return figure
