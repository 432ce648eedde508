"""Figures of contacts, sweeps and stacks, with axes in units that suit their size.

Figures are made without pyplot: they need no display, and nobody has to close them. Save one with
`figure.savefig(path)`. The colours of lines are those of M. Okabe and K. Ito, told apart by people
with any kind of colour vision.
"""

from .contact import plot_sliding
from .designs import plot_design
from .figures import COLOURS
from .materials import plot_fit, plot_master_curve, plot_response
from .sensitivities import plot_sensitivity
from .sweeps import plot_compare, plot_reduced, plot_sweep

__all__ = [
    "COLOURS", "plot_compare", "plot_design", "plot_fit", "plot_master_curve", "plot_reduced",
    "plot_response", "plot_sensitivity", "plot_sliding", "plot_sweep",
]  # fmt: skip
