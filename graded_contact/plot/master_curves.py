"""Figures of measurements at several temperatures."""

from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from ..core.display import unit_of
from ..fitting.master import MasterCurve
from ..materials.measured import Measured
from .material_curves import CHANNEL_NAMES, ORDINATES
from .style import COLUMN, PAGE, TEMPERATURES, few_powers_of_ten, finished, new_figure, ordered
from .words import ZERO_CELSIUS, kelvin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@finished
def plot_master_curve(curve: MasterCurve) -> "Figure":
    """Returns a figure of a master curve: isotherms before and after the shift, and the shifts.

    Isotherms and shifts are coloured by temperature; bars are two standard deviations.

    **Arguments:**

    - `curve`: the result of `master_curve`.
    """
    measured, shifted = curve.data, curve.fit.data
    frequency = shifted.kind == "frequency"
    figure = new_figure(PAGE, 2.9)
    # b_T has a panel only where moduli were also shifted vertically.
    mosaic = "bma;bmc" if curve.isotherms.stds[1] else "bma"
    before, after, *panels = figure.subplot_mosaic(mosaic, width_ratios=(1, 1, 0.9)).values()
    colours = ordered(len(curve.temperatures), TEMPERATURES)
    group, weights = np.asarray(curve.isotherms.group), np.asarray(measured.weights)
    for axes, data in ((before, measured), (after, shifted)):
        x, channels = np.asarray(data.x), np.asarray(data.values)
        for channel, weight, mark in zip(channels, weights, "os", strict=False):
            for i, colour in enumerate(colours):
                there = (group == i) & (weight > 0)
                axes.plot(x[there], channel[there], mark, color=colour, markersize=2.5)
        axes.set(xscale="log", yscale="log")
    x = np.asarray(shifted.x)
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    series = np.asarray(curve.fit.predict(fine))
    for line, name, dash in zip(series, CHANNEL_NAMES[shifted.kind], ("-", "--"), strict=False):
        after.plot(fine, line, color="black", linewidth=0.8, linestyle=dash, label=name)
    reference = float(curve.temperatures[curve.isotherms.reference])
    before.set(xlabel=r"$\omega$ [rad/s]" if frequency else "$t$ [s]", title="as measured")
    before.set_ylabel(ORDINATES[shifted.kind])
    after.set(
        xlabel=r"$\omega\,a_T$ [rad/s]" if frequency else "$t/a_T$ [s]",
        title=f"shifted to {kelvin(reference)}",
    )
    # With one ordinate the eye sees what the shift alone did.
    after.sharey(before)
    after.tick_params(labelleft=False)
    _draw_shifts(panels, curve, colours)
    return figure


@finished
def plot_van_gurp_palmen(isotherms: MasterCurve | Measured) -> "Figure":
    """Returns a figure of phase angles against |E*|, coloured by temperature.

    In this plot of M. van Gurp and J. Palmen (Rheol. Bull. 67, 1998) a shift in frequency moves no
    point: isotherms that do not fall on one curve have no master curve without vertical shifts.

    **Arguments:**

    - `isotherms`: the result of `read_moduli` or `master_curve`, of moduli over frequency; the
      latter shows its series as well.

    **Raises:** `ValueError` for relaxation and creep.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap

    kind = isotherms.kind if isinstance(isotherms, Measured) else isotherms.fit.data.kind
    if kind != "frequency":
        raise ValueError(f"`isotherms` is of kind {kind!r}; kind 'frequency' is needed.")
    temperatures, moduli = _complex_moduli(isotherms)
    figure = new_figure(COLUMN, 2.7)
    axes: Any = figure.subplots()
    colours = ordered(len(moduli), TEMPERATURES)
    sizes = np.abs(np.concatenate(moduli))
    unit, scale = unit_of("Pa", np.max(sizes))
    for values, colour in zip(moduli, colours, strict=True):
        axes.plot(scale * np.abs(values), np.rad2deg(np.angle(values)), "o", color=colour)
    if isinstance(isotherms, MasterCurve):
        x = np.asarray(isotherms.fit.data.x)
        storage, loss = isotherms.fit.predict(np.geomspace(np.min(x), np.max(x), 300))
        series = np.asarray(storage) + 1j * np.asarray(loss)
        angles = np.rad2deg(np.angle(series))
        axes.plot(scale * np.abs(series), angles, "k", linewidth=0.8, label="series")
    if temperatures is not None and len(moduli) > 1:
        temperatures = temperatures - ZERO_CELSIUS
        # Each colour ends halfway between its temperature and the next.
        ends = np.convolve(temperatures, (0.5, 0.5), "valid")
        edges = [2 * temperatures[0] - ends[0], *ends, 2 * temperatures[-1] - ends[-1]]
        norm = BoundaryNorm(edges, len(moduli))
        shown = ScalarMappable(norm, ListedColormap(colours))
        # Eight labels at most: more would overlap.
        some = temperatures[:: -(-len(temperatures) // 8)]
        figure.colorbar(
            shown, ax=axes, label="temperature [°C]", ticks=some, format="%.0f",
            spacing="proportional",
        )  # fmt: skip
    axes.set(xscale="log", xlabel=f"$|E^*|$ [{unit}]", ylabel=r"phase angle $\delta$ [°]")
    few_powers_of_ten(axes.xaxis, np.min(sizes), np.max(sizes))
    axes.set_ylim(bottom=0)
    return figure


def _complex_moduli(isotherms: MasterCurve | Measured) -> tuple[np.ndarray | None, list]:
    """Temperatures [K] if they are known, and moduli [Pa] of each isotherm, as measured."""
    if isinstance(isotherms, Measured):
        parts = isotherms.isotherms()
        moduli = [part.values[np.isfinite(part.values)] for part in parts]
        known = [np.mean(part.temperature) for part in parts if part.temperature is not None]
        return (np.array(known) if known else None), moduli
    points = isotherms.data
    # What was not measured has the weight 0.
    known = np.all(np.asarray(points.weights) > 0, axis=0)
    storage, loss = np.asarray(points.values)
    group = np.asarray(isotherms.isotherms.group)
    temperatures = np.asarray(isotherms.temperatures)
    chosen = [known & (group == i) for i in range(len(temperatures))]
    return temperatures, [storage[where] + 1j * loss[where] for where in chosen]


def _draw_shifts(panels: "list[Axes]", curve: MasterCurve, colours) -> None:
    """a_T with its law and, on a second panel, b_T."""
    temperatures = np.asarray(curve.temperatures)
    celsius = temperatures - ZERO_CELSIUS
    factors, deviations = np.asarray(curve.vertical_shifts), curve.shift_deviations()
    rows = [(r"$\log_{10} a_T$", curve.log10_shifts, 1.0), ("$b_T$", factors, factors)]
    for axes, (label, values, unit), deviation in zip(panels, rows, deviations, strict=False):
        bars = 2 * np.asarray(deviation) * unit  # the deviation of b_T is that of its logarithm
        for *point, colour in zip(celsius, np.asarray(values), bars, colours, strict=True):
            axes.errorbar(*point, fmt="o", capsize=2, color=colour, label="two standard deviations")
        axes.set_ylabel(label)
    panels[-1].set_xlabel("temperature [°C]")
    if len(panels) > 1:
        panels[0].sharex(panels[1])
        panels[0].tick_params(labelbottom=False)
    # The law is drawn only where shifts were measured.
    between = np.linspace(temperatures[0], temperatures[-1], 200)
    by_law = jax.vmap(curve.law.log_factor)(between) / np.log(10)
    panels[0].plot(
        between - ZERO_CELSIUS, by_law, color="0.4", linewidth=0.8,
        label=f"{type(curve.law).__name__} law",
    )  # fmt: skip
