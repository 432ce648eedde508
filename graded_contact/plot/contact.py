"""The figure of one contact: heights, pressure and gap."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..contacts.law import HardWall
from ..core.checks import as_float
from ..core.display import unit_of
from ..sliding.result import Sliding
from ..surfaces.surface import Surface
from .style import COLOURS, PAGE, PRESSURES, figure_of, finished, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset

# Words, unit, colours of a map, exponent of their scale, and the colour of a profile.
LOOKS = {
    "heights": ("height into the solid", "m", "cividis", 1.0, COLOURS[0]),
    # Most of the contact is far from its peak.
    "pressure": ("contact pressure", "Pa", PRESSURES, 0.5, COLOURS[1]),
    "gap": ("gap", "m", "magma", 1.0, COLOURS[2]),
}
FINEST_OUTLINE = 1024  # points along an edge that an outline can show


@finished
def plot_sliding(
    sliding: "Sliding | Dataset",
    surface: Surface,
    velocity: ArrayLike | Sequence[float] = 0.0,
    *,
    axes: Any = None,
) -> "Figure":
    """Returns a figure of heights, contact pressure and gap: maps, or lines of a profile.

    The contact has an outline on the map of the heights, and is thick on a profile. Pressure is
    white out of contact; gap is white in contact. The colours of the pressure follow the square
    root. Colour bars have arrows where outliers are beyond the scale.

    **Arguments:**

    - `sliding`: a result of `slide`, or anything else with `pressure` [Pa], `gap` [m] and, unless
      that is the hard wall, the `law` of contact.
    - `surface`: the surface that slides.
    - `velocity`: of the surface [m/s], as in `slide`. An arrow shows its direction if it is not 0.
    - `axes`: three panels to draw in, by default of a new figure.
    """
    heights, size = np.asarray(surface.heights), np.asarray(surface.grid.size)
    pressure, gap, level = np.asarray(sliding.pressure), np.asarray(sliding.gap), level_of(sliding)
    touches = level > 0
    fields = {
        "heights": heights - np.mean(heights),
        "pressure": np.where(touches, pressure, np.nan),
        "gap": np.where(touches, np.nan, np.maximum(gap, 0)),
    }
    if heights.ndim == 1:
        shown = panels(axes, "a;b;c", (PAGE, 4.4), sharex=True)
    else:
        tall = 1.0 + 2.1 * float(np.clip(size[1] / size[0], 0.5, 2.0))
        shown = panels(axes, "abc", (PAGE, tall), sharex=True, sharey=True)
    for panel, (name, values) in zip(shown, fields.items(), strict=True):
        _draw_field(panel, name, values, size)
        panel.label_outer()
    _draw_outline(shown[0], level, size)
    _draw_direction(shown[1], np.atleast_1d(as_float(velocity, "velocity")))
    return figure_of(shown[0])


def _draw_field(axes: "Axes", name: str, values: np.ndarray, size: np.ndarray) -> None:
    """Draws a field named in `LOOKS` over a period [m]: a map with its bar, or a profile.

    Where a map is white, because values are NaN, a line runs at zero.
    """
    from matplotlib.colors import PowerNorm
    from matplotlib.ticker import MaxNLocator

    words, base, colours, exponent, colour = LOOKS[name]
    low, high, extend = _range_of(values)
    unit, scale = unit_of(base, max(abs(low), abs(high)))
    if values.ndim == 1:
        draw_profile(axes, scale * np.nan_to_num(values), size, color=colour)
        axes.set_ylabel(f"{words}\n[{unit}]")
        return
    norm = PowerNorm(exponent, scale * low, scale * high)
    image = draw_map(axes, scale * values, size, cmap=colours, norm=norm)
    figure_of(axes).colorbar(
        image,
        ax=axes,
        orientation="horizontal",
        shrink=0.9,
        pad=0.02,
        ticks=MaxNLocator(5),
        extend=extend,
        label=f"{words} [{unit}]",
    )


def _range_of(values: np.ndarray) -> tuple[float, float, str]:
    """Returns the range to draw, and the ends with outliers as colour bars name them.

    Outliers are further from the median than twice the distance within which 99 % of points lie.
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 0.0, "neither"
    least, lower, median, upper, most = np.quantile(finite, [0, 0.005, 0.5, 0.995, 1])
    low, high = max(least, 2 * lower - median), min(most, 2 * upper - median)
    low = 0 if 0 <= low < 0.05 * high else low  # a scale from zero reads better
    ends = ("neither", "min", "max", "both")
    return low, high, ends[(low > least) + 2 * (high < most)]


def draw_profile(axes: "Axes", values: np.ndarray, size: np.ndarray, **style: Any) -> None:
    """Draws values along a profile of this length [m]."""
    unit, factor = unit_of("m", size[0])
    axes.plot(factor * size[0] * np.arange(len(values)) / len(values), values, **style)
    axes.set_xlabel(f"$x$ [{unit}]")


def draw_map(axes: "Axes", values: np.ndarray, size: np.ndarray, **style: Any) -> Any:
    """Draws values over a period [m], x to the right and y upwards."""
    from matplotlib.ticker import MaxNLocator

    unit, factor = unit_of("m", np.max(size))
    extent = (0, factor * size[0], 0, factor * size[1])
    image = axes.imshow(values.T, origin="lower", extent=extent, **style)
    axes.grid(visible=False)
    axes.spines[:].set_visible(True)
    axes.set(xlabel=f"$x$ [{unit}]", ylabel=f"$y$ [{unit}]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
    return image


def level_of(found: Any) -> np.ndarray:
    """Returns how far points are inside contact by its law, outside negative; 0 at the edge."""
    pressure, gap = np.asarray(found.pressure), np.asarray(found.gap)
    # Gaps are scaled as the pressure is, so that an outline lies between the points.
    scale = float(np.std(pressure) / (np.std(gap) or 1))
    law = getattr(found, "law", HardWall())
    return np.asarray(law.contact_indicator(jnp.asarray(pressure), jnp.asarray(gap), scale))


def _draw_outline(axes: "Axes", level: np.ndarray, size: np.ndarray) -> None:
    """Draws the contact on a panel of the heights."""
    if level.ndim == 1:
        x, heights = axes.lines[0].get_data()
        touching = np.where(level > 0, heights, np.nan)
        axes.plot(x, touching, ".-", color=COLOURS[1], linewidth=2.5)
        return
    if np.any(level > 0) and np.any(level < 0):
        factor, step = unit_of("m", np.max(size))[1], -(-max(level.shape) // FINEST_OUTLINE)
        x, y = (
            factor * ((np.arange(n) + 0.5) * length / n)[::step]
            for n, length in zip(level.shape, size, strict=True)
        )
        level = level[::step, ::step]  # an outline finer than the picture takes long to draw
        axes.contour(x, y, level.T, levels=[0.0], colors="black", linewidths=0.5)


def _draw_direction(axes: "Axes", velocity: np.ndarray) -> None:
    """Draws an arrow along the velocity, one component or two, in the upper part of a panel."""
    from matplotlib.patheffects import withStroke

    speed = np.linalg.norm(velocity)
    if speed == 0:
        return
    along = np.pad(velocity / speed, (0, 2 - len(velocity)))
    halo = [withStroke(linewidth=4, foreground="white")]
    arrow = {"arrowstyle": "-|>", "color": "black", "path_effects": halo}
    middle: Any = {"ha": "center", "va": "center", "path_effects": halo, "zorder": 5}
    # Its length in points: an arrow in the units of the axes would be oblique.
    ends, units = ((0.5, 0.84), tuple(-44 * along)), ("axes fraction", "offset points")
    axes.annotate("sliding", *ends, *units, arrowprops=arrow, **middle)
