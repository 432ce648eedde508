"""The figure of how pressure and gap are distributed."""

from typing import TYPE_CHECKING

import numpy as np

from ..core.display import unit_of
from ..friction.sliding import Sliding
from ..persson.mean_field import MeanField, pressure_distribution
from .style import COLOURS, PAGE, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

BINS = 50
ASIDE = 0.999  # of the points are within the figure
REACH = 4.0  # standard deviations of the theory that are


@styled
def plot_distributions(
    sliding: "Sliding | Dataset", mean_field: MeanField | None = None
) -> "Figure":
    """Returns a figure of the distributions of contact pressure and gap.

    Densities are over the nominal area: that of the pressure encloses the contact area, that of the
    gap the rest. Persson's theory has for the pressure a Gaussian less its mirror image.

    **Arguments:**

    - `sliding`: a solution of `slide`, or the first of `contact_at(results, index)`.
    - `mean_field`: what `mean_field_friction` returned for the same contact, to compare with.
    """
    pressure, gap = np.ravel(sliding.pressure), np.ravel(sliding.gap)
    figure = new_figure(PAGE, 2.7)
    left, right = figure.subplots(1, 2)
    high = _end(pressure[pressure > 0])
    if mean_field is not None:
        spread = float(np.sqrt(mean_field.stress_variance[-1]))
        high = max(high, float(mean_field.pressure) + REACH * spread)
    unit, scale = unit_of("Pa", high)
    _draw(left, scale * pressure[pressure > 0], scale * high, len(pressure), "contact")
    if mean_field is not None:
        stress = np.linspace(0, high, 400)
        density = np.asarray(pressure_distribution(mean_field, stress))[-1]
        left.plot(scale * stress, density / scale, color=COLOURS[1], label="Persson's theory")
    left.set(xlabel=rf"contact pressure $\sigma$ [{unit}]", ylabel=rf"$P(\sigma)$ [1/{unit}]")
    left.legend()
    apart = gap[(pressure <= 0) & (gap > 0)]
    high = _end(apart)
    unit, scale = unit_of("m", high)
    _draw(right, scale * apart, scale * high, len(gap), None)
    mean = scale * float(np.mean(gap))
    right.axvline(mean, color="0.3", linewidth=0.8, linestyle="--", label=f"mean {mean:.3g} {unit}")
    right.set(xlabel=f"gap $u$ [{unit}]", ylabel=f"$P(u)$ [1/{unit}]")
    right.legend()
    for axes in (left, right):
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
    return figure


def _end(values: np.ndarray) -> float:
    """Where the figure ends; beyond are a few of the points."""
    return float(np.quantile(values, ASIDE)) if values.size else 1.0


def _draw(axes, values, high, points, label) -> None:
    """A histogram of some of the `points` of a grid, as a density over all of them."""
    counts, edges = np.histogram(values, BINS, (0, high or 1))
    density = counts / (points * np.diff(edges))
    axes.stairs(density, edges, fill=True, color=COLOURS[0], alpha=0.35)
    axes.stairs(density, edges, color=COLOURS[0], linewidth=0.8, label=label)
