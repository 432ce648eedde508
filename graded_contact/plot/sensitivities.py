"""Figures of what decides a quantity."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..studies.uncertainty import Sensitivity
from .style import COLOURS, PAGE, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def plot_sensitivity(
    sensitivity: Sensitivity | Mapping[str, Sensitivity], *, of: str = "friction"
) -> "Figure":
    """Returns a figure of which part of a master curve decides a quantity.

    One panel for loss moduli, one for storage moduli, over the frequency. The area under a curve is
    the relative change of the quantity per that of all these moduli.

    **Arguments:**

    - `sensitivity`: what `sensitivity` returned; or several, by their labels.
    - `of`: name of the quantity.
    """
    found = sensitivity if isinstance(sensitivity, Mapping) else {"": sensitivity}
    figure = new_figure(PAGE, 2.9)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    channels = (("loss", "loss modulus $E''$"), ("storage", "storage modulus $E'$"))
    for axes, (name, title) in zip(panels, channels, strict=True):
        for i, (label, curve) in enumerate(found.items()):
            values = getattr(curve, name)
            axes.semilogx(curve.omega, values, color=COLOURS[i % len(COLOURS)], label=label)
        axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        axes.set_xlabel("angular frequency $\\omega$ [rad/s]")
        axes.set_title(title)
    panels[0].set_ylabel(f"relative change of the {of} per that of\nthe modulus and decade [1]")
    if any(found):
        panels[0].legend()
    return figure
