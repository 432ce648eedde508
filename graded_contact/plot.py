"""Figures of contacts, sweeps and stacks, with axes in units that suit their size.

Figures are made without pyplot: they need no display, and nobody has to close them. Save one with
`figure.savefig(path)`. The colours of lines are those of M. Okabe and K. Ito, told apart by people
with any kind of colour vision.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import ArrayLike

from ._checks import as_float, check_positive
from .files.results import NOT_STARTED, Fields, Results
from .fitting.master import MasterCurve
from .fitting.prony import PronyFit
from .response.compliance import effective_modulus
from .response.stack import Stack
from .sliding import Sliding
from .studies.objectives import friction_curve, loss_tangent
from .studies.report_design import curve_velocities
from .studies.run_design import DesignResults
from .surface import Surface

if TYPE_CHECKING:  # it takes a third of a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DOTS_PER_INCH = 160
_CHANNELS = {
    "frequency": ("storage modulus", "loss modulus"),
    "relaxation": ("relaxation modulus",),
    "creep": ("creep compliance",),
}
_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


def plot_sliding(
    sliding: Sliding | Fields, surface: Surface, velocity: ArrayLike | Sequence[float] = 0.0
) -> "Figure":
    """Returns a figure of heights, contact pressure and gap: maps, or lines of a profile.

    Points out of contact are left white in the map of the pressure, points in contact in that of
    the gap. The colours of the pressure follow the square root: most of the contact is far from
    its peak. Scales leave out what lies far beyond 99 % of the points; their labels tell how far.

    **Arguments:**

    - `sliding`: a solution of `slide`, or one of the `fields` of `Results`.
    - `surface`: the surface that slides.
    - `velocity`: that of the surface [m/s], as `slide` takes it: its direction is shown by an
      arrow, unless it is zero.
    """
    heights, pressure = np.asarray(surface.heights), np.asarray(sliding.pressure)
    gap, touches = np.maximum(np.asarray(sliding.gap), 0), pressure > 0
    quantities = [
        ("height (into the solid)", "m", heights - np.mean(heights), "cividis"),
        ("contact pressure", "Pa", np.where(touches, pressure, np.nan), "viridis"),
        ("gap", "m", np.where(touches, np.nan, gap), "magma"),
    ]
    draw = _profiles if surface.grid.ndim == 1 else _maps
    figure = draw(np.asarray(surface.grid.size), quantities)
    _show_direction(figure.axes[1], np.atleast_1d(as_float(velocity, "velocity")))
    return figure


def plot_sweep(results: Results) -> "Figure":
    """Returns a figure of friction and contact area against velocity, one line per pressure.

    The area is the sub-pixel one. A solve that did not converge has a hollow marker, one with a
    caveat (`Results.caveats`) a cross; one that failed has a triangle and one that was not started
    a stroke, on the axis of velocities.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = _figure(8.6, 3.7)
    panels = [
        ("friction coefficient", results.friction),
        ("contact area / nominal area\n(sub-pixel)", results.contact_area_smooth),
    ]
    velocity = results.velocity
    order = np.argsort(velocity, kind="stable")
    doubtful = np.any([np.zeros_like(results.converged), *(c.where for c in results.caveats)], 0)
    for axes, (label, values) in zip(figure.subplots(1, 2), panels, strict=True):
        for i, pressure in enumerate(results.pressure):
            colour = COLOURS[i % len(COLOURS)]
            unit, factor = _unit("Pa", pressure)
            axes.plot(
                velocity[order],
                values[i, order],
                color=colour,
                label=f"{factor * pressure:.3g} {unit}",
            )
            for state, face in (("", colour), ("not converged", "white")):
                chosen = results.state[i] == state
                axes.plot(
                    velocity[chosen],
                    values[i, chosen],
                    "o",
                    color=colour,
                    markerfacecolor=face,
                    label=state if np.any(chosen) else None,
                )
            for state, mark in (("failed", "^"), (NOT_STARTED, "|")):
                without = velocity[results.state[i] == state]
                if len(without):
                    zeros = np.zeros(len(without))
                    axes.plot(without, zeros, mark, color=colour, clip_on=False, label=state)
        crossed, at = np.nonzero(doubtful)
        axes.plot(
            velocity[at],
            values[crossed, at],
            "kx",
            markersize=13,
            markeredgewidth=1.5,
            zorder=1.9,  # behind the markers, whose faces tell states
            label="doubtful: see the caveats" if len(at) else None,
        )
        if np.all(velocity > 0):
            axes.set_xscale("log")
            if np.max(velocity) < 100 * np.min(velocity):  # too few powers of ten to tell values
                axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
                axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_ylim(0, 1.08 * np.fmax.reduce(values, axis=None, initial=0) or None)
        axes.set_xlabel("sliding velocity [m/s]")
        axes.set_ylabel(label)
    figure.axes[0].legend(title="mean pressure", frameon=False)
    return figure


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
    figure = _figure(8.6, 3.7)
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
    figure = _figure(7.2, 5.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    x = np.asarray(fit.data.x)
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    fitted, curves = np.asarray(fit.predict(x)), np.asarray(fit.predict(fine))
    frequency = fit.data.kind == "frequency"
    lower, upper = fit.confidence(fine) if frequency else (fine, fine)
    limits = [(lower.real, upper.real), (lower.imag, upper.imag)] if frequency else []
    for i, name in enumerate(_CHANNELS[fit.data.kind]):
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
    figure = _figure(9.0, 4.6)
    shifted, *panels = (
        figure.subplot_mosaic("mma;mmb" if lifted else "mma", width_ratios=(1, 1, 1.2))
    ).values()
    data, temperatures = curve.fit.data, np.asarray(curve.temperatures)
    colours = colormaps["coolwarm"](np.linspace(0, 1, len(temperatures)))
    x, group = np.asarray(data.x), np.asarray(curve.data.group)
    fine = np.geomspace(np.min(x[x > 0]), np.max(x), 300)
    series = np.asarray(curve.fit.predict(fine))
    names, styles = _CHANNELS[data.kind], ("-", "--")
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


def plot_design(results: DesignResults) -> "Figure":
    """Returns a figure of a design: friction over velocity, and the loss tangent, before and after.

    Lines are the mean field's; points with bars are contact, mean and standard deviation over the
    surfaces.

    **Arguments:**

    - `results`: what `run_design` returned.
    """
    study, scene = results.study, results.study.scene
    before = results.candidates["before"].field
    velocities = curve_velocities(study, before)
    curve = jax.jit(
        lambda stack: (
            friction_curve(
                stack,
                study.spectrum,
                pressure=scene.pressure[0],
                velocities=velocities,
                graded=scene.graded,
            ).friction
        )
    )
    cutoff = before.against_cutoff.cutoff
    ends = (np.min(cutoff), np.max(cutoff))
    band = study.band or ends
    q = np.geomspace(min(ends[0], band[0]), max(ends[1], band[1]), 200)
    speed = float(np.exp(np.mean(np.log(scene.velocity))))
    figure = _figure(8.6, 3.7)
    friction, loss = figure.subplots(1, 2)
    colours = ("0.45", *COLOURS)
    for (name, candidate), colour in zip(results.candidates.items(), colours, strict=False):
        friction.plot(velocities, curve(candidate.stack), color=colour, label=name)
        loss.plot(q, loss_tangent(candidate.stack, q, speed, graded=scene.graded), color=colour)
        if study.verify:
            solved = candidate.friction
            spread = solved.std(0, ddof=1) if len(solved) > 1 else None
            friction.errorbar(
                scene.velocity, solved.mean(0), spread, fmt="o", capsize=3, color=colour
            )
    if study.band is not None:
        loss.axvspan(*study.band, color="0.93", zorder=0)
    friction.set(xscale="log", xlabel="sliding velocity [m/s]", ylabel="friction coefficient")
    loss.set(
        xscale="log", xlabel="wavenumber $q$ [rad/m]", ylabel=f"loss tangent at {speed:.3g} m/s"
    )
    for axes in (friction, loss):
        axes.set_ylim(bottom=0)
    friction.legend(frameon=False)
    return figure


def _maps(size: np.ndarray, quantities: list) -> "Figure":
    from matplotlib.colors import PowerNorm
    from matplotlib.ticker import MaxNLocator

    unit, factor = _unit("m", np.max(size))
    figure = _figure(10.2, 1.2 + 2.9 * float(np.clip(size[1] / size[0], 0.5, 2.0)))
    for axes, (label, base, values, colours) in zip(
        figure.subplots(1, 3, sharex=True, sharey=True), quantities, strict=True
    ):
        low, high, extend = _range(values)
        value_unit, scale = _unit(base, max(abs(low), abs(high)))
        image = axes.imshow(
            scale * values.T,
            origin="lower",
            extent=(0, factor * size[0], 0, factor * size[1]),
            cmap=colours,
            interpolation="nearest",
            norm=PowerNorm(0.5 if base == "Pa" else 1, scale * low, scale * high),
        )
        bar = figure.colorbar(
            image, ax=axes, orientation="horizontal", shrink=0.9, pad=0.02, ticks=MaxNLocator(5),
            extend=extend,
        )  # fmt: skip
        bar.set_label(f"{label} [{value_unit}]{_outliers(extend, values, base)}")
        axes.set_xlabel(f"$x$ [{unit}]")
        axes.xaxis.set_major_locator(MaxNLocator(4))
    figure.axes[0].set_ylabel(f"$y$ [{unit}]")
    return figure


def _profiles(size: np.ndarray, quantities: list) -> "Figure":
    unit, factor = _unit("m", size[0])
    figure = _figure(7.2, 6.0)
    panels = figure.subplots(3, 1, sharex=True)
    for axes, (label, base, values, _), colour in zip(panels, quantities, COLOURS, strict=False):
        low, high, extend = _range(values)
        value_unit, scale = _unit(base, max(abs(low), abs(high)))
        x = factor * size[0] * np.arange(len(values)) / len(values)
        # Where a map is left blank, a line runs at zero.
        axes.plot(x, scale * np.where(np.isnan(values), 0, values), color=colour)
        if extend != "neither":
            low, margin = min(low, 0), 0.05 * (high - min(low, 0))
            axes.set_ylim(scale * (low - margin), scale * (high + margin))
        axes.set_ylabel(f"{label}\n[{value_unit}]{_outliers(extend, values, base)}")
    panels[-1].set_xlabel(f"$x$ [{unit}]")
    return figure


def _range(values: np.ndarray) -> tuple[float, float, str]:
    """The range to draw, and at which ends values lie beyond it, in the words of colour bars.

    It ends with the values, unless outliers are further from the median than twice the distance
    within which 99 % of the points lie, 0.5 % being beyond either side.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 0.0, "neither"
    least, lower, median, upper, most = np.quantile(known, [0, 0.005, 0.5, 0.995, 1])
    low, high = max(least, 2 * lower - median), min(most, 2 * upper - median)
    low = 0 if 0 <= low < 0.05 * high else low
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    return low, high, extend.get((low > least, high < most), "neither")


def _outliers(extend: str, values: np.ndarray, base: str) -> str:
    """What a label says of the values [base] beyond a range."""
    if extend == "neither":
        return ""
    ends = (np.nanmin(values), np.nanmax(values))
    units = [_unit(base, abs(end)) for end in ends]
    least, most = (
        f"{factor * end:.3g} {unit}" for end, (unit, factor) in zip(ends, units, strict=True)
    )
    reach = {"min": f"down to {least}", "max": f"up to {most}", "both": f"from {least} to {most}"}
    return f"\noutliers {reach[extend]}"


def _show_direction(axes: "Axes", velocity: np.ndarray) -> None:
    """An arrow along the velocity, one component or two, in the upper part of a panel."""
    from matplotlib.patheffects import withStroke
    from matplotlib.text import OffsetFrom

    speed = np.linalg.norm(velocity)
    if speed == 0:
        return
    along = np.pad(velocity / speed, (0, 2 - len(velocity)))
    # Places in points from there: an arrow in the units of the axes would be askew.
    around = OffsetFrom(axes, (0.5, 0.84), "points")
    halo = [withStroke(linewidth=4, foreground="white")]
    axes.annotate(
        "sliding", tuple(30 * along), xycoords=around, xytext=tuple(-14 * along), textcoords=around,
        ha="center", va="center", path_effects=halo, zorder=5,
        arrowprops={"arrowstyle": "-|>", "color": "black", "path_effects": halo},
    )  # fmt: skip


def _figure(width: float, height: float) -> "Figure":
    """An empty figure [inches] with a constrained layout, and its own font sizes and spines."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")


def _unit(base: str, largest: float) -> tuple[str, float]:
    """The unit in which `largest` [base] is between 1 and 1000, and its reciprocal in `base`."""
    exponent = 3 * int(np.floor(np.log10(largest) / 3 + 1e-9)) if largest > 0 else 0
    exponent = min(max(exponent, min(_PREFIXES)), max(_PREFIXES))
    return f"{_PREFIXES[exponent]}{base}", 10.0**-exponent
