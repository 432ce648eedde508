"""Figures: results or an object in, a Matplotlib figure out.

All have the style `STYLE`: colours that suit any kind of colour vision, the widths of the columns
of a journal, and fonts that journals accept. Figures are made without pyplot: they need no display,
and you need not close them. Save one with `figure.savefig("name.pdf")`, or give `axes` of your own.
"""

from .contact import plot_sliding
from .materials import plot_fit, plot_master_curve
from .motion import plot_cycle, plot_film, plot_transient
from .search import plot_search
from .style import COLOURS, PAGE, STYLE
from .sweeps import plot_sweep

__all__ = [
    "COLOURS",
    "PAGE",
    "STYLE",
    "plot_cycle",
    "plot_film",
    "plot_fit",
    "plot_master_curve",
    "plot_search",
    "plot_sliding",
    "plot_sweep",
    "plot_transient",
]
