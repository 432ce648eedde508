"""Figures of a design: its objective and limits before and after, and the search."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..blocks.stack import materials_of
from ..core.escaping import in_figure
from ..core.quantities import in_brackets
from ..designs.limits import BY_MEAN_FIELD, CRITERIA
from ..designs.objectives import loss_tangent
from ..designs.problem import design_mean_field
from ..designs.results import DesignResults
from ..designs.table import DesignScene
from ..materials.table import Tabulated
from ..mean_field.angles import LAST_COSINE
from ..mean_field.mean_field import MeanField
from ..studies.evaluations import numbers_in
from ..studies.search import Design
from .style import COLOURS, PAGE, few_powers_of_ten, finished, new_figure
from .words import title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CURVE_POINTS = 41


@finished
def plot_design(results: DesignResults) -> "Figure":
    """Returns a figure of a design: objective and limits over velocity, before and after.

    Lines are the mean field; points with bars are contact, mean and standard deviation over the
    surfaces; crosses are what is required. Grey is beyond a limit. A design of friction alone or of
    the loss tangent also has the loss tangent.

    **Arguments:**

    - `results`: the result of `DesignPlan.run`.
    """
    study = results.study
    names = study.criteria or ("friction",)
    tangents = names == ("friction",)  # a band has no criteria
    count = len(names) + tangents
    rows = -(-count // 3)
    figure = new_figure(PAGE, 2.9 * rows)
    panels = figure.subplots(rows, -(-count // rows), squeeze=False).ravel()
    for name, axes in zip(names, panels, strict=False):
        _draw_criterion(axes, results, name)
    if tangents:
        _draw_tangents(panels[1], results)
    for axes in panels[count:]:
        axes.remove()
    return figure


def _draw_criterion(axes: "Axes", results: DesignResults, name: str) -> None:
    """Draws a criterion over velocity, before and after, and its limits."""
    study, about = results.study, CRITERIA[name]
    velocity, count, drawn = study.scene.velocity, study.verify, []
    by = f"contact, mean ± standard deviation of {count} surfaces" if count > 1 else "contact"
    for (which, candidate), colour in zip(
        results.candidates.items(), ("0.45", *COLOURS), strict=False
    ):
        if candidate.field is not None and name in BY_MEAN_FIELD:
            # Contacts are solved at few speeds; the mean field costs little and draws a curve.
            speeds = _curve_velocities(study, candidate.field)
            values = np.asarray(getattr(design_mean_field(study, candidate.stack, speeds), name))
            drawn.append((speeds, values, None, "-", colour, f"{which}, mean field"))
        if len(solved := candidate.contacts[name]):
            spread = solved.std(0, ddof=1) if len(solved) > 1 else None
            drawn.append((velocity, solved.mean(0), spread, "o", colour, f"{which}, {by}"))
    if name == "friction" and study.objective.goal is not None:
        own = results.candidates["before"].judged("friction")[1] if study.objective.relative else 1
        goal = study.objective.goal * np.mean(np.atleast_2d(own), 0)
        drawn.append((velocity, goal, None, "x", "black", "required"))
    limits = [limit for limit in study.limits if limit.criterion == name]
    sizes = [*(np.max(np.abs(values)) for _, values, *_ in drawn), *(x.value for x in limits)]
    unit, factor = about.shown_in(max(sizes))
    for x, values, spread, form, color, label in drawn:
        bars = None if spread is None else factor * spread
        axes.errorbar(x, factor * values, bars, fmt=form, color=color, label=label, capsize=2)
    axes.set(xscale="log", xlabel="sliding velocity [m/s]", ylabel=about.label + in_brackets(unit))
    top = 1.05 * max(axes.get_ylim()[1], factor * max(sizes))
    for limit in limits:
        ends = (factor * limit.value, top) if limit.end == "max" else (0, factor * limit.value)
        axes.axhspan(*ends, color="0.93", zorder=0, label="beyond a limit")
    axes.set_ylim(0, top)


def _draw_tangents(axes: "Axes", results: DesignResults) -> None:
    """Draws the loss tangent at the middle speed, over the waves of the road and of the band."""
    study, field = results.study, results.candidates["before"].field
    cell, spacing = np.max(study.grid.size), np.min(study.grid.spacing)
    waves = 2 * np.pi / np.array([cell, 2 * spacing])
    if field is not None:
        waves = np.ravel(field.against_cutoff.cutoff)
    ends = [np.min(waves), np.max(waves), *(study.objective.band or ())]
    q = np.geomspace(min(ends), max(ends), 200)
    speed = float(np.exp(np.mean(np.log(study.scene.velocity))))
    for candidate, colour in zip(results.candidates.values(), ("0.45", *COLOURS), strict=False):
        axes.plot(q, loss_tangent(candidate.stack, q, speed), color=colour)
    if study.objective.band:
        axes.axvspan(*study.objective.band, color="0.93", zorder=0, label="band of the design")
    axes.set(
        xscale="log", xlabel="wavenumber $q$ [rad/m]", ylabel=f"loss tangent at {speed:.3g} m/s"
    )
    axes.set_ylim(bottom=0)


def _curve_velocities(study: DesignScene, field: MeanField) -> Float[np.ndarray, " velocities"]:
    """Velocities [m/s] about those of the study, at which its materials were measured."""
    first, last = study.scene.velocity.min() / 100, study.scene.velocity.max() * 100
    waves = np.asarray(field.against_cutoff.cutoff).reshape(-1)[[0, -1]]
    for material in materials_of(study.scene.stack):
        if isinstance(material, Tabulated):
            # The slowest wave nearly across the velocity, and the fastest along it.
            first = max(first, float(material.omega[0]) / (waves[0] * LAST_COSINE))
            last = min(last, float(material.omega[-1]) / waves[1])
    return np.geomspace(first, last, CURVE_POINTS)


@finished
def plot_history(design: Design, *, scene: str = "") -> "Figure":
    """Returns a figure of a search: objective, constraints and parameters of each evaluation.

    All starts are in the first panel, the best in colour; constraints and parameters are its own,
    the latter over what they came to.

    **Arguments:**

    - `design`: of `minimise`, `studies.minimise_expected`, or `.design` of a scene's results.
    - `scene`: the TOML text of a scene, whose materials name the parameters.
    """
    from matplotlib.ticker import MaxNLocator

    best = design.best
    history, names = best.history, numbers_in(design.parameters)[0]
    figure = new_figure(PAGE, 2.9)
    constrained = history.margins.size > 0
    value, *limits, parameters = figure.subplots(1, 3 if constrained else 2)
    for run in design.runs:
        style = {"color": COLOURS[0], "zorder": 3} if run is best else {"color": "0.7"}
        value.plot(np.arange(1, 1 + len(run.history.values)), run.history.values, ".-", **style)
    tried = np.concatenate([run.history.values for run in design.runs])
    # A logarithmic axis needs positive values, and is worth it from two decades on.
    if 0 < 100 * np.min(tried) < np.max(tried):
        value.set_yscale("log")
    value.set_ylabel("objective")
    evaluation = np.arange(1, 1 + len(history.values))
    for axes in limits:
        for i, margins in enumerate(history.margins.T):
            axes.plot(evaluation, margins, ".-", label=f"(b) {in_figure(design.constraints[i])}")
        ends = axes.get_ylim()
        # Grey is not allowed.
        axes.axhspan(min(ends[0], 0), 0, color="0.93", zorder=0)
        axes.set_ylim(ends)
        axes.set_ylabel("constraint (0 or more allowed)")
    letter = "c" if constrained else "b"
    # Relative to the result, because parameters have unlike units and sizes.
    ratios = history.parameters / np.array(best.parameters)
    for name, ratio in zip(names, ratios.T, strict=True):
        label = f"({letter}) {in_figure(title_of(name, scene))}"
        parameters.plot(evaluation, ratio, ".-", label=label)
    parameters.set_ylabel("parameter / result")
    if np.max(ratios) > 3 * np.min(ratios):  # else a logarithmic axis has hardly a number
        parameters.set_yscale("log")
        few_powers_of_ten(parameters.yaxis, np.min(ratios), np.max(ratios))
    for axes in (value, *limits, parameters):
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        axes.set_xlabel("evaluation")
    return figure
