"""The figure of which waves make friction."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..roughness.spectrum import CutoffCurve
from .style import COLOURS, PAGE, few_powers_of_ten, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PER_DECADE = 10  # steps


@styled
def plot_dissipation(curves: CutoffCurve | Mapping[str, CutoffCurve]) -> "Figure":
    """Returns a figure of friction over the wavenumber: up to each, and per ln q.

    The area under the steps, over ln q, is the friction that the curve gains.

    **Arguments:**

    - `curves`: what `cumulative_friction` or `area_against_cutoff` returned, or `against_cutoff` of
      a mean field; or several, by their labels.
    """
    found = curves if isinstance(curves, Mapping) else {"": curves}
    figure = new_figure(PAGE, 2.7)
    total, each = figure.subplots(1, 2, sharex=True)
    for i, (label, curve) in enumerate(found.items()):
        q, friction = np.asarray(curve.cutoff), np.asarray(curve.friction)
        colour = COLOURS[i % len(COLOURS)]
        total.plot(q, friction, color=colour, label=label)
        edges = _edges(q)
        steps = np.diff(np.interp(np.log(edges), np.log(q), friction)) / np.diff(np.log(edges))
        each.stairs(steps, edges, color=colour, linewidth=1.2, label=label)
    total.set(xscale="log", ylabel="friction of waves up to $q$ [1]")
    each.set_ylabel(r"$\mathrm{d}\mu/\mathrm{d}\ln q$ [1]")
    for axes in (total, each):
        axes.axhline(0, color="0.6", linewidth=0.6, zorder=0)
        axes.set_xlabel("wavenumber $q$ [rad/m]")
    every = np.concatenate([np.asarray(curve.cutoff) for curve in found.values()])
    few_powers_of_ten(total.xaxis, np.min(every), np.max(every))
    if any(found):
        total.legend()
    return figure


def _edges(q: np.ndarray) -> np.ndarray:
    """Ends of steps of equal length on the logarithm, none finer than the curve."""
    count = max(1, min(len(q) - 1, round(PER_DECADE * np.log10(q[-1] / q[0]))))
    return np.geomspace(q[0], q[-1], count + 1)
