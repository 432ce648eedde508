"""Figures of spectra of roughness."""

from typing import TYPE_CHECKING

from ..core.escaping import in_figure
from ..surfaces.joined_spectrum import JoinedSpectrum
from .style import COLUMN, colours_of, finished, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@finished
def plot_spectra(joined: JoinedSpectrum) -> "Figure":
    """Returns a figure of the spectra of several scans, and of the one that they make together.

    **Arguments:**

    - `joined`: of `joined_spectrum`.
    """
    figure = new_figure(COLUMN, 2.6)
    axes = figure.subplots()
    for scan, colour in zip(joined.scans, colours_of(len(joined.scans)), strict=False):
        axes.loglog(scan.q, scan.density, ".", color=colour, label=in_figure(scan.name))
    axes.loglog(joined.spectrum.q, joined.spectrum.values, "k-", zorder=1, label="joined")
    axes.set(xlabel="wavenumber $q$ [rad/m]", ylabel="spectrum $C$ [m$^4$]")
    return figure
