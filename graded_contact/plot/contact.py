"""Figures of one contact: fields, distributions, and the waves that make friction."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..contacts.law import HardWall
from ..core.checks import as_float
from ..core.display import unit_of, with_unit
from ..mean_field.mean_field import MeanField, pressure_distribution
from ..sliding.result import Sliding
from ..surfaces.spectrum import CutoffCurve
from ..surfaces.surface import Surface
from .style import (
    COLOURS,
    PAGE,
    PRESSURES,
    colours_of,
    few_powers_of_ten,
    figure_of,
    finished,
    panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset

# Words, symbol, unit, colours of a map, exponent of their scale, and the colour of a profile.
LOOKS = {
    "heights": ("height into the solid", "h", "m", "cividis", 1.0, COLOURS[0]),
    # Most of the contact is far from its peak.
    "pressure": ("contact pressure", r"\sigma", "Pa", PRESSURES, 0.5, COLOURS[1]),
    "gap": ("gap", "u", "m", "magma", 1.0, COLOURS[2]),
}
FINEST_OUTLINE = 1024  # points along an edge that an outline can show
BINS = 50
SHOWN_SHARE = 0.999  # of the points of a distribution
SHOWN_DEVIATIONS = 4.0  # standard deviations of the theory that a figure shows
STEPS_PER_DECADE = 10  # steps of the friction per ln q


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
    - `axes`: three panels to draw in, by default those of a new figure.
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

    words, _, base, colours, exponent, colour = LOOKS[name]
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
    ends = {(False, False): "neither", (True, False): "min", (False, True): "max"}
    return low, high, ends.get((low > least, high < most), "both")


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
    scale = np.std(pressure) / (np.std(gap) or 1)
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
    from matplotlib.text import OffsetFrom

    speed = np.linalg.norm(velocity)
    if speed == 0:
        return
    along = np.pad(velocity / speed, (0, 2 - len(velocity)))
    # Distances in points: an arrow in the units of the axes would be oblique.
    around = OffsetFrom(axes, (0.5, 0.84), "points")
    halo = [withStroke(linewidth=4, foreground="white")]
    axes.annotate(
        "sliding",
        tuple(30 * along),
        xycoords=around,
        xytext=tuple(-14 * along),
        textcoords=around,
        ha="center",
        va="center",
        path_effects=halo,
        zorder=5,
        arrowprops={"arrowstyle": "-|>", "color": "black", "path_effects": halo},
    )


@finished
def plot_distributions(
    sliding: "Sliding | Dataset", mean_field: MeanField | None = None, *, axes: Any = None
) -> "Figure":
    """Returns a figure of the distributions of contact pressure and gap.

    Densities are over the nominal area: the integral of the first is the contact area. In
    Persson's theory the pressure has a Gaussian distribution less its mirror image; the theory is
    for Gaussian heights.

    **Arguments:**

    - `sliding`: as in `plot_sliding`.
    - `mean_field`: the result of `mean_field_friction` for the same contact, to compare with.
    - `axes`: two panels to draw in, by default those of a new figure.
    """
    pressure, gap = np.ravel(sliding.pressure), np.ravel(sliding.gap)
    touches = np.ravel(level_of(sliding)) > 0
    left, right = panels(axes, "ab", (PAGE, 2.7))
    reach = 0.0
    if mean_field is not None:
        # The axis shows the theory too, whose tail may go beyond the contact's.
        deviation = float(mean_field.stress_variance[-1]) ** 0.5
        reach = float(np.nan_to_num(mean_field.pressure + SHOWN_DEVIATIONS * deviation))
    high, scale = _draw_density(left, "pressure", pressure, touches, reach, "contact")
    if mean_field is not None and reach:  # a theory that failed has no variance
        stress = np.linspace(0, high, 400)
        density = np.asarray(pressure_distribution(mean_field, stress))[-1]
        left.plot(scale * stress, density / scale, color=COLOURS[1], label="Persson's theory")
    _, scale = _draw_density(right, "gap", gap, ~touches)
    mean = float(np.mean(np.maximum(gap, 0)))  # over all points; 0 where the body flows
    label = f"mean gap {with_unit(mean, 'm')}"
    right.axvline(scale * mean, color="0.3", lw=0.8, linestyle="--", label=label)
    for panel in (left, right):
        panel.set(xlim=(0, None), ylim=(0, None))
    return figure_of(left)


def _draw_density(axes, name, values, counted, high=0.0, label=None) -> tuple[float, float]:
    """Draws the density over all points of the `values` that count, up to `high` at least.

    Returns the end of the axis [SI] and the SI unit in units of the axis.
    """
    found = values[counted & np.isfinite(values)]
    high = max(high, float(np.quantile(found, SHOWN_SHARE))) if found.size else high or 1.0
    words, symbol, base, *_ = LOOKS[name]
    unit, scale = unit_of(base, high)
    counts, edges = np.histogram(scale * found, BINS, (0, scale * high or 1))
    # Over all points, not over those that count: the integral is their share of the area.
    density = counts / (len(values) * np.diff(edges))
    axes.stairs(density, edges, fill=True, color=COLOURS[0], alpha=0.35)
    axes.stairs(density, edges, color=COLOURS[0], linewidth=0.8, label=label)
    axes.set(xlabel=f"{words} ${symbol}$ [{unit}]", ylabel=f"$P({symbol})$ [1/{unit}]")
    return high, scale


@finished
def plot_dissipation(
    curves: CutoffCurve | Mapping[str, CutoffCurve], *, axes: Any = None
) -> "Figure":
    """Returns a figure of friction over the wavenumber: up to each, and per ln q.

    The area under the steps, over ln q, is the friction that the curve gains.

    **Arguments:**

    - `curves`: the result of `cumulative_friction` or `area_against_cutoff`, or `against_cutoff` of
      a mean field; or several, by their labels.
    - `axes`: two panels to draw in, by default those of a new figure.
    """
    by_label = curves if isinstance(curves, Mapping) else {"": curves}
    total, each = panels(axes, "ab", (PAGE, 2.7), sharex=True)
    for (label, curve), colour in zip(by_label.items(), colours_of(len(by_label)), strict=True):
        q, friction = np.asarray(curve.cutoff), np.asarray(curve.friction)
        total.plot(q, friction, color=colour, label=label)
        # Steps of equal length on the logarithm, none finer than the curve.
        count = max(1, min(len(q) - 1, round(STEPS_PER_DECADE * np.log10(q[-1] / q[0]))))
        edges = np.geomspace(q[0], q[-1], count + 1)
        # The curve's own steps are uneven and would make the derivative noisy.
        steps = np.diff(np.interp(np.log(edges), np.log(q), friction)) / np.diff(np.log(edges))
        each.stairs(steps, edges, color=colour, linewidth=1.2, label=label)
    total.set(xscale="log", ylabel="friction of waves up to $q$")
    each.set_ylabel(r"$\mathrm{d}\mu/\mathrm{d}\ln q$")
    for panel in (total, each):
        panel.axhline(0, color="0.6", linewidth=0.6, zorder=0)
        panel.set_xlabel("wavenumber $q$ [rad/m]")
    every = np.concatenate([np.asarray(curve.cutoff) for curve in by_label.values()])
    few_powers_of_ten(total.xaxis, np.min(every), np.max(every))
    return figure_of(total)
