"""Figures of materials: fits and master curves."""

from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from ..fitting.master import MasterCurve
from ..fitting.prony import PronyFit
from .style import PAGE, TEMPERATURES, colours_of, figure_of, finished, ordered, panels
from .sweeps import ZERO_CELSIUS, kelvin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of each kind of measurement: the ordinate, and the names of its channels.
CHANNELS = {
    "frequency": ("modulus [Pa]", "storage modulus", "loss modulus"),
    "relaxation": ("modulus [Pa]", "relaxation modulus"),
    "creep": ("compliance [1/Pa]", "creep compliance"),
}


@finished
def plot_fit(fit: PronyFit, *, axes: Any = None) -> "Figure":
    """Returns a figure of a fit: measured points and the series, and its log residuals.

    Moduli over frequency are drawn with 95 % limits. Curves and limits end where the data end.

    **Arguments:**

    - `fit`: the result of `fit_prony`.
    - `axes`: two panels to draw in, by default of a new figure.
    """
    above, below = panels(axes, "a;b", (PAGE, 3.8), sharex=True, height_ratios=(3, 1))
    x = np.asarray(fit.data.x)
    # A relaxation may start at t = 0, which has no place on a logarithmic axis.
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    fitted, curves = np.asarray(fit.predict(x)), np.asarray(fit.predict(fine))
    frequency = fit.data.kind == "frequency"
    # Only moduli over frequency have limits, one pair for each channel.
    lower, upper = fit.confidence(fine) if frequency else (fine, fine)
    limits = [(lower.real, upper.real), (lower.imag, upper.imag)] if frequency else []
    ordinate, *names = CHANNELS[fit.data.kind]
    for i, (name, colour) in enumerate(zip(names, colours_of(len(names)), strict=True)):
        known = np.asarray(fit.data.weights[i]) > 0
        measured = np.asarray(fit.data.values[i])
        above.plot(x[known], measured[known], "o", color=colour, markersize=3, fillstyle="none")
        above.plot(fine, curves[i], color=colour, label=name)
        for limit in limits[i : i + 1]:
            label = f"{name}, 95 % limits"
            above.fill_between(fine, *limit, color=colour, alpha=0.25, linewidth=0, label=label)
        # In logarithms a modulus that is too large by a factor weighs like one too small.
        residual = 100 * np.log(fitted[i] / measured)
        below.plot(x[known], residual[known], ".", color=colour, markersize=4)
    above.set(xscale="log", yscale="log", ylabel=ordinate)
    below.axhline(0, color="black", linewidth=0.6)
    words = r"angular frequency $\omega$ [rad/s]" if frequency else "time [s]"
    below.set(xlabel=words, ylabel="ln(fit/measured)\n[%]")
    return figure_of(above)


@finished
def plot_master_curve(curve: MasterCurve, *, axes: Any = None) -> "Figure":
    """Returns a figure of a master curve: isotherms before and after the shift, and the shifts.

    Isotherms and shifts are coloured by temperature; bars are two standard deviations.

    **Arguments:**

    - `curve`: the result of `master_curve`.
    - `axes`: panels to draw in, by default of a new figure: as measured, shifted, a_T and,
      with vertical shifts, b_T.
    """
    measured, shifted = curve.data, curve.fit.data
    frequency = shifted.kind == "frequency"
    # b_T has a panel only where moduli were also shifted vertically.
    mosaic = "abc;abd" if curve.isotherms.stds[1] else "abc"
    before, after, *beside = panels(axes, mosaic, (PAGE, 2.9), width_ratios=(1, 1, 0.9))
    colours = ordered(len(curve.temperatures), TEMPERATURES)
    group, weights = np.asarray(curve.isotherms.group), np.asarray(measured.weights)
    for panel, data in ((before, measured), (after, shifted)):
        x, channels = np.asarray(data.x), np.asarray(data.values)
        for channel, weight, mark in zip(channels, weights, "os", strict=False):
            for i, colour in enumerate(colours):
                there = (group == i) & (weight > 0)
                panel.plot(x[there], channel[there], mark, color=colour, markersize=2.5)
        panel.set(xscale="log", yscale="log")
    x = np.asarray(shifted.x)
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    series = np.asarray(curve.fit.predict(fine))
    ordinate, *names = CHANNELS[shifted.kind]
    for line, name, dash in zip(series, names, ("-", "--"), strict=False):
        after.plot(fine, line, color="black", linewidth=0.8, linestyle=dash, label=name)
    reference = float(curve.temperatures[curve.isotherms.reference])
    before.set(xlabel=r"$\omega$ [rad/s]" if frequency else "$t$ [s]", title="as measured")
    before.set_ylabel(ordinate)
    after.set(
        xlabel=r"$\omega\,a_T$ [rad/s]" if frequency else "$t/a_T$ [s]",
        title=f"shifted to {kelvin(reference)}",
    )
    # One ordinate shows the shift alone.
    after.sharey(before)
    after.tick_params(labelleft=False)
    _draw_shifts(beside, curve, colours)
    return figure_of(before)


def _draw_shifts(beside: "list[Axes]", curve: MasterCurve, colours: Any) -> None:
    """Draws a_T with its law and, on a second panel, b_T."""
    temperatures = np.asarray(curve.temperatures)
    celsius = temperatures - ZERO_CELSIUS
    factors, deviations = np.asarray(curve.vertical_shifts), curve.shift_deviations()
    rows = [(r"$\log_{10} a_T$", curve.log10_shifts, 1.0), ("$b_T$", factors, factors)]
    bars_are = "two standard deviations"
    for panel, (label, values, unit), deviation in zip(beside, rows, deviations, strict=False):
        bars = 2 * np.asarray(deviation) * unit  # of ln b_T
        for *point, colour in zip(celsius, np.asarray(values), bars, colours, strict=True):
            panel.errorbar(*point, fmt="o", capsize=2, color=colour, label=bars_are)
        panel.set_ylabel(label)
    beside[-1].set_xlabel("temperature [°C]")
    if len(beside) > 1:
        beside[0].sharex(beside[1])
        beside[0].tick_params(labelbottom=False)
    # The law is drawn only where shifts were measured.
    between = np.linspace(temperatures[0], temperatures[-1], 200)
    by_law = jax.vmap(curve.law.log_factor)(between) / np.log(10)
    label = f"{type(curve.law).__name__} law"
    beside[0].plot(between - ZERO_CELSIUS, by_law, color="0.4", linewidth=0.8, label=label)
