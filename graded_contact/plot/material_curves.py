"""Figures of materials and blocks: responses, fits, and sensitivities to a material."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import ArrayLike

from ..blocks.stack import Stack
from ..core.checks import as_float, check_positive
from ..core.escaping import in_figure
from ..fitting.prony import PronyFit
from ..response.compliance import effective_modulus
from ..studies.uncertainty import Sensitivity
from .inputs import labelled
from .style import COLOURS, PAGE, finished, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Of each kind of measurement: the names of its channels, and the ordinate.
CHANNEL_NAMES = {
    "frequency": ("storage modulus", "loss modulus"),
    "relaxation": ("relaxation modulus",),
    "creep": ("creep compliance",),
}
ORDINATES = {
    "frequency": "modulus [Pa]", "relaxation": "modulus [Pa]", "creep": "compliance [1/Pa]",
}  # fmt: skip


@finished
def plot_response(stack: Stack, q: ArrayLike, velocity: ArrayLike | Sequence[float]) -> "Figure":
    """Returns a figure of the effective modulus and the loss tangent of a stack.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers [rad/m], shape `(n,)`, positive.
    - `velocity`: one or more sliding velocities [m/s], positive; the frequency is q v.
    """
    q, speeds = as_float(q, "q"), np.atleast_1d(as_float(velocity, "velocity"))
    if q.ndim != 1:
        raise ValueError(f"`q` has shape {q.shape}; one axis is needed.")
    check_positive("velocity", speeds, "[m/s]")
    figure = new_figure(PAGE, 2.9)
    stiffness, loss = figure.subplots(1, 2, sharex=True)
    for i, speed in enumerate(speeds):
        # Waves along the motion: those across it see lower frequencies.
        modulus = np.asarray(effective_modulus(stack, q, q * speed))
        label = f"sliding velocity {speed:.3g} m/s"
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "label": label}
        stiffness.loglog(q, np.abs(modulus), **style)
        loss.semilogx(q, np.imag(modulus) / np.real(modulus), **style)
    words = "wavenumber $q$ [rad/m]"
    stiffness.set(xlabel=words, ylabel="effective modulus $|2/(q M_{zz})|$ [Pa]")
    loss.set(xlabel=words, ylabel="loss tangent", ylim=(0, None))
    return figure


@finished
def plot_fit(fit: PronyFit) -> "Figure":
    """Returns a figure of a fit: measured points and the series, and its log residuals.

    Moduli over frequency are drawn with 95 % limits. Curves and limits end where the data end.

    **Arguments:**

    - `fit`: the result of `fit_prony`.
    """
    figure = new_figure(PAGE, 3.8)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    x = np.asarray(fit.data.x)
    # A relaxation may start at t = 0, which has no place on a logarithmic axis.
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    fitted, curves = np.asarray(fit.predict(x)), np.asarray(fit.predict(fine))
    frequency = fit.data.kind == "frequency"
    # Only moduli over frequency have limits, one pair for each channel.
    lower, upper = fit.confidence(fine) if frequency else (fine, fine)
    limits = [(lower.real, upper.real), (lower.imag, upper.imag)] if frequency else []
    for i, name in enumerate(CHANNEL_NAMES[fit.data.kind]):
        colour, known = COLOURS[i], np.asarray(fit.data.weights[i]) > 0
        measured = np.asarray(fit.data.values[i])
        above.plot(x[known], measured[known], "o", color=colour, markersize=3, fillstyle="none")
        above.plot(fine, curves[i], color=colour, label=name)
        for limit in limits[i : i + 1]:
            label = f"{name}, 95 % limits"
            above.fill_between(fine, *limit, color=colour, alpha=0.25, linewidth=0, label=label)
        # In logarithms a modulus that is too large by a factor weighs like one too small.
        residual = 100 * np.log(fitted[i] / measured)
        below.plot(x[known], residual[known], ".", color=colour, markersize=4)
    above.set(xscale="log", yscale="log", ylabel=ORDINATES[fit.data.kind])
    below.axhline(0, color="black", linewidth=0.6)
    words = r"angular frequency $\omega$ [rad/s]" if frequency else "time [s]"
    below.set(xlabel=words, ylabel="ln(fit/measured)\n[%]")
    return figure


@finished
def plot_sensitivity(
    sensitivity: Sensitivity | Mapping[str, Sensitivity], *, of: str = "friction"
) -> "Figure":
    """Returns a figure of the parts of a master curve on which a quantity depends.

    One panel shows loss moduli, the other storage moduli, over the frequency. The area under a
    curve is the relative change of the quantity over the relative change of all these moduli.

    **Arguments:**

    - `sensitivity`: the result of `sensitivity`; or several, by their labels.
    - `of`: name of the quantity.
    """
    by_label = labelled("sensitivity", sensitivity, Sensitivity)
    figure = new_figure(PAGE, 2.9)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    channels = (("loss", "loss modulus $E''$"), ("storage", "storage modulus $E'$"))
    for axes, (name, title) in zip(panels, channels, strict=True):
        for i, (label, curve) in enumerate(by_label.items()):
            values = getattr(curve, name)
            axes.semilogx(
                curve.omega, values, color=COLOURS[i % len(COLOURS)], label=in_figure(label)
            )
        axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)
        axes.set(xlabel=r"angular frequency $\omega$ [rad/s]", title=title)
    panels[0].set_ylabel(
        f"relative change of the {in_figure(of)} over that of\nthe moduli of a decade"
    )
    return figure
