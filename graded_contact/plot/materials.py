"""Figures of materials and blocks: fits, master curves, responses."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import ArrayLike

from .._checks import as_float, check_positive
from ..fitting.master import MasterCurve
from ..fitting.prony import PronyFit
from ..response.compliance import effective_modulus
from ..response.stack import Stack
from .figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CHANNELS = {
    "frequency": ("storage modulus", "loss modulus"),
    "relaxation": ("relaxation modulus",),
    "creep": ("creep compliance",),
}


def plot_response(stack: Stack, q: ArrayLike, velocity: ArrayLike | Sequence[float]) -> "Figure":
    """Returns a figure of the effective modulus and the loss tangent of a stack.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers [rad/m], shape `(n,)`, positive.
    - `velocity`: one or more sliding velocities [m/s], positive; the frequency is q v.
    """
    q, speeds = as_float(q, "q"), np.atleast_1d(np.asarray(velocity, float))
    if q.ndim != 1:
        raise ValueError(f"`q` has shape {q.shape}; one axis is needed.")
    check_positive("velocity", speeds, "[m/s]")
    figure = new_figure(8.6, 3.7)
    stiffness, loss = figure.subplots(1, 2, sharex=True)
    for i, speed in enumerate(speeds):
        modulus = np.asarray(effective_modulus(stack, q, q * speed))
        style: dict[str, Any] = {
            "color": COLOURS[i % len(COLOURS)],
            "label": f"{speed:.3g} m/s",
        }
        stiffness.loglog(q, np.abs(modulus), **style)
        loss.semilogx(q, np.imag(modulus) / np.real(modulus), **style)
    stiffness.set_ylabel("effective modulus $|2/(q M_{zz})|$ [Pa]")
    loss.set_ylabel("loss tangent")
    loss.set_ylim(bottom=0)
    for axes in (stiffness, loss):
        axes.set_xlabel("wavenumber $q$ [rad/m]")
    stiffness.legend(title="sliding velocity", frameon=False)
    return figure


def plot_fit(fit: PronyFit) -> "Figure":
    """Returns a figure of a fit: measured points and the series, and its log residuals.

    Moduli over frequency are drawn with 95 % limits. Curves and limits end where the data end.

    **Arguments:**

    - `fit`: what `fit_prony`, `fit_relaxation` or `fit_creep` returned.
    """
    figure = new_figure(7.2, 5.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    x = np.asarray(fit.data.x)
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    fitted, curves = np.asarray(fit.predict(x)), np.asarray(fit.predict(fine))
    frequency = fit.data.kind == "frequency"
    lower, upper = fit.confidence(fine) if frequency else (fine, fine)
    limits = [(lower.real, upper.real), (lower.imag, upper.imag)] if frequency else []
    for i, name in enumerate(CHANNELS[fit.data.kind]):
        colour, known = COLOURS[i], np.asarray(fit.data.weights[i]) > 0
        measured = np.asarray(fit.data.values[i])
        above.plot(x[known], measured[known], "o", color=colour, markersize=3, fillstyle="none")
        above.plot(fine, curves[i], color=colour, label=name)
        for limit in limits[i : i + 1]:
            above.fill_between(fine, *limit, color=colour, alpha=0.25, linewidth=0)
        residual = 100 * np.log(fitted[i] / measured)
        below.plot(x[known], residual[known], ".", color=colour, markersize=4)
    above.set_xscale("log")
    above.set_yscale("log")
    above.set_ylabel("compliance [1/Pa]" if fit.data.kind == "creep" else "modulus [Pa]")
    above.legend(frameon=False)
    below.axhline(0, color="black", linewidth=0.6)
    below.set_xlabel(r"angular frequency $\omega$ [rad/s]" if frequency else "time [s]")
    below.set_ylabel("ln(fit/measured)\n[%]")
    return figure


def plot_master_curve(curve: MasterCurve) -> "Figure":
    """Returns a figure of a master curve: the shifted isotherms on the series, and their shifts.

    Isotherms and shifts are coloured by temperature; bars are two standard deviations.

    **Arguments:**

    - `curve`: what `master_curve` returned.
    """
    from matplotlib import colormaps

    lifted = curve.data.lifts
    figure = new_figure(9.0, 4.6)
    shifted, *panels = (
        figure.subplot_mosaic("mma;mmb" if lifted else "mma", width_ratios=(1, 1, 1.2))
    ).values()
    data, temperatures = curve.fit.data, np.asarray(curve.temperatures)
    colours = colormaps["coolwarm"](np.linspace(0, 1, len(temperatures)))
    x, group = np.asarray(data.x), np.asarray(curve.data.group)
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    series = np.asarray(curve.fit.predict(fine))
    names, styles = CHANNELS[data.kind], ("-", "--")
    for values, weights, line, name, style, mark in zip(
        data.values, data.weights, series, names, styles, "os", strict=False
    ):
        shifted.plot(fine, line, color="black", linewidth=0.8, linestyle=style, label=name)
        for i, colour in enumerate(colours):
            there = (group == i) & (np.asarray(weights) > 0)
            shifted.plot(x[there], np.asarray(values)[there], mark, color=colour, markersize=3)
    frequency = data.kind == "frequency"
    reference = float(temperatures[curve.data.reference])
    shifted.set(
        xscale="log",
        yscale="log",
        xlabel=r"$\omega\,a_T$ [rad/s]" if frequency else "$t/a_T$ [s]",
        ylabel="compliance [1/Pa]" if data.kind == "creep" else "modulus [Pa]",
        title=f"at {reference:.2f} K",
    )
    shifted.legend(frameon=False)
    rows = [(curve.log10_shifts, r"$\log_{10} a_T$"), (curve.vertical_shifts, "$b_T$")]
    for axes, (values, label), deviation in zip(
        panels, rows, curve.shift_deviations(), strict=False
    ):
        values, bars = np.asarray(values), 2 * np.asarray(deviation)
        bars = bars * values if label == "$b_T$" else bars
        for point in zip(temperatures, values, bars, colours, strict=True):
            axes.errorbar(*point[:3], fmt="o", capsize=2, markersize=4, color=point[3])
        axes.set(xlabel="temperature [K]", ylabel=label)
    between = np.linspace(temperatures[0], temperatures[-1], 200)
    by_law = jax.vmap(curve.law.log_factor)(between) / np.log(10)
    panels[0].plot(between, by_law, color="0.4", linewidth=0.8, label=type(curve.law).__name__)
    panels[0].legend(frameon=False)
    return figure
