"""Figures of contacts, sweeps and stacks, with axes in units that suit their size.

All have the style `STYLE`: colours that suit any kind of colour vision, the widths of the columns
of a journal, and fonts that journals accept. Figures are made without pyplot: they need no display,
and you need not close them. Save one with `figure.savefig("name.pdf")`.
"""

from .contact import plot_dissipation, plot_distributions, plot_sliding
from .cycles import plot_cycle, plot_film, plot_transient
from .designs import plot_design, plot_history
from .master_curves import plot_master_curve, plot_van_gurp_palmen
from .material_curves import plot_fit, plot_response, plot_sensitivity
from .slider import slider
from .spectra import plot_spectra
from .style import COLOURS, COLUMN, PAGE, STYLE
from .sweeps import plot_compare, plot_leakage, plot_reduced, plot_sweep

__all__ = [
    "COLOURS", "COLUMN", "PAGE", "STYLE", "plot_compare", "plot_cycle", "plot_design",
    "plot_dissipation", "plot_distributions", "plot_film", "plot_fit", "plot_history",
    "plot_leakage", "plot_master_curve", "plot_reduced", "plot_response", "plot_sensitivity",
    "plot_sliding", "plot_spectra", "plot_sweep", "plot_transient", "plot_van_gurp_palmen",
    "slider",
]  # fmt: skip
