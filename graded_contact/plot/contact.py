"""Figures of one contact: maps, or the lines of a profile."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import ArrayLike

from ..core.checks import as_float
from ..core.display import unit_of
from ..friction.sliding import Sliding
from ..roughness.surface import Surface
from .style import COLOURS, GAPS, HEIGHTS, PAGE, PRESSURES, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset


@styled
def plot_sliding(
    sliding: "Sliding | Dataset", surface: Surface, velocity: ArrayLike | Sequence[float] = 0.0
) -> "Figure":
    """Returns a figure of heights, contact pressure and gap: maps, or lines of a profile.

    Points out of contact are left white in the map of the pressure, points in contact in that of
    the gap. The colours of the pressure follow the square root: most of the contact is far from
    its peak. Scales leave out what lies far beyond 99 % of the points; their labels tell how far.

    **Arguments:**

    - `sliding`: a solution of `slide`, or the first of `contact_at(results, index)`.
    - `surface`: the surface that slides.
    - `velocity`: that of the surface [m/s], as `slide` takes it: its direction is shown by an
      arrow, unless it is zero.
    """
    heights, pressure = np.asarray(surface.heights), np.asarray(sliding.pressure)
    gap, touches = np.maximum(np.asarray(sliding.gap), 0), pressure > 0
    quantities = [
        ("height (into the solid)", "m", heights - np.mean(heights), HEIGHTS),
        ("contact pressure", "Pa", np.where(touches, pressure, np.nan), PRESSURES),
        ("gap", "m", np.where(touches, np.nan, gap), GAPS),
    ]
    draw = _profiles if surface.grid.ndim == 1 else _maps
    figure = draw(np.asarray(surface.grid.size), quantities)
    _show_direction(figure.axes[1], np.atleast_1d(as_float(velocity, "velocity")))
    return figure


def _maps(size: np.ndarray, quantities: list) -> "Figure":
    from matplotlib.colors import PowerNorm
    from matplotlib.ticker import MaxNLocator

    unit, factor = unit_of("m", np.max(size))
    figure = new_figure(PAGE, 1.0 + 2.1 * float(np.clip(size[1] / size[0], 0.5, 2.0)))
    for axes, (label, base, values, colours) in zip(
        figure.subplots(1, 3, sharex=True, sharey=True), quantities, strict=True
    ):
        low, high, extend = _range(values)
        value_unit, scale = unit_of(base, max(abs(low), abs(high)))
        image = axes.imshow(
            scale * values.T,
            origin="lower",
            extent=(0, factor * size[0], 0, factor * size[1]),
            cmap=colours,
            norm=PowerNorm(0.5 if base == "Pa" else 1, scale * low, scale * high),
        )
        bar = figure.colorbar(
            image, ax=axes, orientation="horizontal", shrink=0.9, pad=0.02, ticks=MaxNLocator(5),
            extend=extend,
        )  # fmt: skip
        bar.set_label(f"{label} [{value_unit}]{_outliers(extend, values, base)}")
        axes.grid(visible=False)
        axes.spines[:].set_visible(True)
        axes.set_xlabel(f"$x$ [{unit}]")
        axes.xaxis.set_major_locator(MaxNLocator(4))
    figure.axes[0].set_ylabel(f"$y$ [{unit}]")
    return figure


def _profiles(size: np.ndarray, quantities: list) -> "Figure":
    unit, factor = unit_of("m", size[0])
    figure = new_figure(PAGE, 4.4)
    panels = figure.subplots(3, 1, sharex=True)
    for axes, (label, base, values, _), colour in zip(panels, quantities, COLOURS, strict=False):
        low, high, extend = _range(values)
        value_unit, scale = unit_of(base, max(abs(low), abs(high)))
        x = factor * size[0] * np.arange(len(values)) / len(values)
        # Where a map is left blank, a line runs at zero.
        axes.plot(x, scale * np.where(np.isnan(values), 0, values), color=colour)
        if extend != "neither":
            low, margin = min(low, 0), 0.05 * (high - min(low, 0))
            axes.set_ylim(scale * (low - margin), scale * (high + margin))
        axes.set_ylabel(f"{label}\n[{value_unit}]{_outliers(extend, values, base)}")
    panels[-1].set_xlabel(f"$x$ [{unit}]")
    return figure


def _range(values: np.ndarray) -> tuple[float, float, str]:
    """The range to draw, and at which ends values lie beyond it, in the words of colour bars.

    It ends with the values, unless outliers are further from the median than twice the distance
    within which 99 % of the points lie, 0.5 % being beyond either side.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 0.0, "neither"
    least, lower, median, upper, most = np.quantile(known, [0, 0.005, 0.5, 0.995, 1])
    low, high = max(least, 2 * lower - median), min(most, 2 * upper - median)
    low = 0 if 0 <= low < 0.05 * high else low
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    return low, high, extend.get((low > least, high < most), "neither")


def _outliers(extend: str, values: np.ndarray, base: str) -> str:
    """What a label says of the values [base] beyond a range."""
    if extend == "neither":
        return ""
    ends = (np.nanmin(values), np.nanmax(values))
    units = [unit_of(base, abs(end)) for end in ends]
    least, most = (
        f"{factor * end:.3g} {unit}" for end, (unit, factor) in zip(ends, units, strict=True)
    )
    reach = {"min": f"down to {least}", "max": f"up to {most}", "both": f"from {least} to {most}"}
    return f"\noutliers {reach[extend]}"


def _show_direction(axes: "Axes", velocity: np.ndarray) -> None:
    """An arrow along the velocity, one component or two, in the upper part of a panel."""
    from matplotlib.patheffects import withStroke
    from matplotlib.text import OffsetFrom

    speed = np.linalg.norm(velocity)
    if speed == 0:
        return
    along = np.pad(velocity / speed, (0, 2 - len(velocity)))
    # Places in points from there: an arrow in the units of the axes would be oblique.
    around = OffsetFrom(axes, (0.5, 0.84), "points")
    halo = [withStroke(linewidth=4, foreground="white")]
    axes.annotate(
        "sliding", tuple(30 * along), xycoords=around, xytext=tuple(-14 * along), textcoords=around,
        ha="center", va="center", path_effects=halo, zorder=5,
        arrowprops={"arrowstyle": "-|>", "color": "black", "path_effects": halo},
    )  # fmt: skip
