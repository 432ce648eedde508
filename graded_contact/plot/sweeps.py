"""Figures of scenes: friction and contact area over the varied quantities."""

import itertools
import re
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.caveats import Caveat
from ..core.escaping import in_figure
from ..core.quantities import STEADY, in_brackets, quantity_of
from ..readers.measured_friction import MeasuredFriction
from ..scenes.results import (
    FLOWS,
    LEAKAGE,
    SEED_ERROR,
    has_numbers,
    is_of_each,
    over_seeds,
    solve_states,
    warnings_of,
    without_friction,
)
from ..studies.dataset import NOT_STARTED
from . import style
from .inputs import DATASETS, check_drawn
from .words import fluid_of, kelvin, label_of, title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset

DRAWN, AT_REST = ("friction", "contact_area"), ("contact_area", "mean_gap")
ERROR, BAR = "_standard_error", "_bar"
NOTHING = "No solve succeeded: no figure is drawn."
DASHES = ("-", "--", ":", "-.")
THIN = 0.4  # points, of the lines of single surfaces
# A marker by the state of a solve, and whether it is filled; points without numbers are at 0.
MARKERS = {"": ("o", True), "not converged": ("o", False), "failed": ("^", True),
           NOT_STARTED: ("|", True)}  # fmt: skip


class _Lines(NamedTuple):
    """Results as lines along one axis, one for each combination of the others but the seed.

    **Fields:**

    - `along`: name of the axis.
    - `varied`: the other axes with several values.
    - `each`: of each line the quantities (means over the seeds, with their standard errors), their
      bars, `x`, `state` and `doubtful` along the axis, and `NAME_each` over the seeds if all are
      drawn; the numbers on the other axes are its coordinates.
    - `surfaces`: number of seeds; 0 without such an axis.
    - `drawn`: the quantities, one for each panel.
    - `doubts`: why points are doubtful, in short sentences, and whether all points are.
    - `measured`: friction that is laid over them, or None.
    """

    along: str
    varied: list[str]
    each: "list[Dataset]"
    surfaces: int
    drawn: tuple[str, ...]
    doubts: list[tuple[str, bool]]
    measured: MeasuredFriction | None = None


@style.finished
def plot_sweep(
    results: "Dataset", *, all_seeds: bool = False, measured: MeasuredFriction | None = None
) -> "Figure":
    """Returns a figure of friction and contact area against velocity.

    Where all friction is rounding, as at rest, it is one of contact area and mean gap.
    If there is one velocity they are drawn against the last axis that has several points. The area
    is the sub-pixel one. The first of the other axes has a colour for each value, the rest have
    dashes. Over several surfaces (`seed`) lines are means, and bands are their standard errors.
    Bars are the estimated errors of the numbers, of surfaces the largest; where standard errors by
    materials are known, the root of the sum of both squares. A solve that did not converge has
    a hollow marker, a doubtful one a cross, with the reason in the legend; one that failed has a
    triangle and one that was not started a stroke, both at the bottom.

    **Arguments:**

    - `results`: the result of `Plan.run`, or of `sweep` for a function that returns a `Sliding`.
    - `all_seeds`: draws a thin line for each surface in addition.
    - `measured`: friction of `readers.read_friction`, which is laid over that of the results, with
      bars for its errors and a marker for each of its temperatures.

    **Raises:** `ValueError` if no solve succeeded, and for other results, as of a [motion].
    """
    lines = _with_measured(_lines(results, all_seeds=all_seeds), measured)
    return _coloured(lines, lines.varied[0] if lines.varied else "")


@style.finished
def plot_leakage(results: "Dataset") -> "Figure":
    """Returns a figure of the leakage along x and along y against the load.

    Without [fluid] it is one of the conductances. Where the gap is closed, no fluid passes: a
    triangle at the bottom. Otherwise as `plot_sweep`.

    **Arguments:**

    - `results`: the result of `Plan.run` for a scene with [fluid], or with `flow` in [observe].

    **Raises:** `ValueError` if there is no flow in the results.
    """
    check_drawn("results", results, DATASETS[STEADY])
    if FLOWS[0] not in results:
        raise ValueError("`results` have no leakage: the scene needs the table [fluid].")
    drawn = LEAKAGE if LEAKAGE[0] in results else FLOWS
    along = "pressure" if results.sizes["pressure"] > 1 else None
    lines = _lines(results, along, drawn=drawn)
    figure = _coloured(lines, lines.varied[0] if lines.varied else "")
    style.entitle(figure, fluid_of(results))
    return figure


@style.finished
def plot_reduced(results: "Dataset") -> "Figure":
    """Returns a figure of friction and contact area against a_T times velocity.

    If temperature only shifts the times of one law, they fall on one curve. They need not if it
    also changes moduli (b_T), or acts on parts of the block only. Otherwise as `plot_sweep`.

    **Arguments:**

    - `results`: the result of `Plan.run` for several temperatures.

    **Raises:** `ValueError` with the reason if there is no such curve.
    """
    check_drawn("results", results, DATASETS[STEADY])
    if "reduced_velocity" not in results:
        reason = "No master curve: the results have no axis of temperatures."
        raise ValueError(results.attrs.get("master_curve", reason))
    figure = _coloured(_lines(results, "reduced_velocity"), "temperature")
    style.entitle(figure, in_figure(results.attrs["master_curve"]).replace("a_T", "$a_T$"))
    return figure


@style.finished
def plot_compare(
    results: "Sequence[Dataset]", names: Sequence[str], measured: MeasuredFriction | None = None
) -> "Figure":
    """Returns a figure of friction and contact area of several results, one colour for each.

    **Arguments:**

    - `results`: the result of `Plan.run`, over the same axes. Points may differ; axes of one point
      and seeds do not matter.
    - `names`: of the results, for the legend.
    - `measured`: as in `plot_sweep`.

    **Raises:** `ValueError` if they vary different axes, or are of scenes with [motion].
    """
    # Axes with one point do not matter, so lines are compared and not datasets.
    every = [_lines(one) for one in results]
    first = every[0]
    expected = _axes_of(first)
    colours, labels = [], []
    for i, (lines, name) in enumerate(zip(every, names, strict=True)):
        colours += [style.COLOURS[i % len(style.COLOURS)]] * len(lines.each)
        labels += [in_figure(name)] * len(lines.each)
        if (axes := _axes_of(lines)) != expected:
            raise ValueError(
                f"{name!r} varies {axes}, and {names[0]!r} varies {expected}. Compare results over "
                "the same axes, in the same units."
            )
    # All lines together: dashes stand for the same numbers in every result.
    surfaces = max(lines.surfaces for lines in every)
    together = [line for lines in every for line in lines.each]
    doubts = list(dict.fromkeys(doubt for lines in every for doubt in lines.doubts))
    drawn = AT_REST if {lines.drawn for lines in every} == {AT_REST} else DRAWN
    lines = first._replace(each=together, surfaces=surfaces, drawn=drawn, doubts=doubts)
    return _drawn(_with_measured(lines, measured), colours, labels, first.varied)


def _with_measured(lines: _Lines, measured: MeasuredFriction | None) -> _Lines:
    """Lines with measured friction; refused where there is nothing to lay it over."""
    if measured is None:
        return lines
    if lines.along != "velocity" or "friction" not in lines.drawn:
        have = f"are over {lines.along}" if lines.along != "velocity" else "have none at rest"
        raise ValueError(
            f"`measured` is refused: {measured.name} is friction over velocity, and the results "
            f"{have}."
        )
    return lines._replace(measured=measured)


def _axes_of(lines: _Lines) -> str:
    """The varied axes with their units, as an error names them."""
    line = lines.each[0]
    units = [line[name].attrs.get("units", "1") for name in (*lines.varied, "x")]
    return ", ".join(
        f"`{name}` [{unit}]" for name, unit in zip((*lines.varied, lines.along), units, strict=True)
    )


def _lines(
    results: "Dataset", along: str | None = None, *, all_seeds: bool = False,
    drawn: tuple[str, ...] = (),
) -> _Lines:  # fmt: skip
    """The lines of results along an axis: by default velocity, or the last with several points."""
    check_drawn("results", results, DATASETS[STEADY])
    if not np.any(has_numbers(results)):
        raise ValueError(NOTHING)
    axes = [str(axis) for axis in results["message"].dims]
    longer = [axis for axis in axes if results.sizes[axis] > 1 and axis != "seed"]
    if along is None:
        along = "velocity" if "velocity" in longer or not longer else longer[-1]
    follows = "velocity" if along == "reduced_velocity" else along
    others = [axis for axis in axes if axis not in (follows, "seed")]
    state = solve_states(results)
    # A solve is doubtful if a warning concerns it, a mean if one of its surfaces is. A cross on
    # each of several points would show nothing: what concerns all is said in words.
    warnings = warnings_of(results)
    doubts = [(_reason(c), is_of_each(c, results)) for c in warnings]
    crossed = [c.where for c, (_, each) in zip(warnings, doubts, strict=True) if not each]
    doubtful = state.copy(data=np.any([np.zeros(state.shape, bool), *crossed], axis=0))
    middle, apart = results, {}
    if "seed" in axes:
        middle = over_seeds(results)
        state, doubtful = solve_states(middle), doubtful.any("seed")
        if all_seeds:
            apart = {f"{name}_each": results[name] for name in (*DRAWN, *AT_REST)}
    drawn = drawn or (AT_REST if np.all(without_friction(results)) else DRAWN)
    known = dict.fromkeys((*DRAWN, *AT_REST, *drawn))
    names = [name + end for name in known for end in ("", ERROR, SEED_ERROR)]
    lines = middle[[name for name in names if name in middle]]
    for name in known:
        errors = [middle[n] for n in (f"{name}_error", name + ERROR) if n in middle]
        if errors:
            bar = sum(error**2 for error in errors) ** 0.5
            lines[name + BAR] = bar.where(np.isfinite(bar))  # an error that is not known has none
    lines = lines.assign(apart | {"x": results[along], "state": state, "doubtful": doubtful})
    lines = lines.sortby(follows)  # scenes may list velocities in any order
    each = [
        lines.isel(dict(zip(others, index, strict=True)))
        for index in np.ndindex(*(results.sizes[axis] for axis in others))
    ]
    varied = [axis for axis in others if results.sizes[axis] > 1]
    return _Lines(along, varied, each, results.sizes.get("seed", 0), drawn, doubts)


def _reason(caveat: Caveat) -> str:
    """The beginning of a warning, up to its explanation or remedy."""
    first = re.split(r"[:.] ", caveat.sentence)[0].rstrip(".")
    return in_figure(first[0].lower() + first[1:])


def _coloured(lines: _Lines, axis: str) -> "Figure":
    """Lines with a colour for each value on one axis, if it is varied, and dashes for the rest."""
    varies = axis in lines.varied
    numbers = [line[axis].item() if varies else 0 for line in lines.each]
    values = list(dict.fromkeys(numbers))
    scale = style.TEMPERATURES if axis == "temperature" else style.PRESSURES
    colours = style.colours_of(len(values), scale)
    named = values[:: -(-len(values) // len(style.COLOURS))]  # the legend names some of many
    labels = [
        _label(line, axis) if varies and number in named else None
        for line, number in zip(lines.each, numbers, strict=True)
    ]
    dashed = [name for name in lines.varied if name != axis]
    figure = _drawn(lines, [colours[values.index(one)] for one in numbers], labels, dashed)
    line = lines.each[0]
    fixed = [str(name) for name in line.coords if not line[name].ndim and name not in lines.varied]
    style.entitle(figure, ", ".join(_label(line, name) for name in fixed))
    return figure


def _label(line: "Dataset", name: str) -> str:
    return in_figure(f"{title_of(name, line.attrs.get('scene', ''))} {label_of(line[name])}")


def _drawn(
    lines: _Lines, colours: Sequence, labels: Sequence[str | None], dashed: Sequence[str]
) -> "Figure":
    """Lines with these colours and labels, and dashes by their numbers on the axes `dashed`."""
    figure = style.new_figure(style.PAGE, 2.9)
    panels = figure.subplots(1, 2)
    numbers = [", ".join(_label(line, name) for name in dashed) for line in lines.each]
    # The dashes repeat if there are many combinations of numbers.
    dashes: Any = dict(zip(dict.fromkeys(numbers), itertools.cycle(DASHES), strict=False))
    for axes, quantity in zip(panels, lines.drawn, strict=True):
        for line, colour, label, number in zip(lines.each, colours, labels, numbers, strict=True):
            _draw(axes, line, quantity, colour, linestyle=dashes[number], label=label)
        if quantity == "friction" and lines.measured is not None:
            _draw_measured(axes, lines.measured)
        _finish(axes, lines, quantity)
    # Lines without points are entries of the legend, of its last panel.
    entry = partial(panels[-1].plot, [], [], color="0.4")
    for text in list(dashes)[: len(DASHES)] if dashed else ():
        entry(linestyle=dashes[text], label=text)
    if lines.surfaces > 1:
        label = f"mean of {lines.surfaces} surfaces ± standard error"
        entry(color="0.8", linewidth=6, label=label)
    known = {str(name) for line in lines.each for name in line}
    if any(name + BAR in known for name in lines.drawn):
        both = any(name + ERROR in known for name in lines.drawn)
        by_materials = " and standard error by materials" * both
        entry(marker="|", ls="", label=f"bars: ± estimated error{by_materials}")
    if f"{lines.drawn[0]}_each" in known:
        entry(linewidth=THIN, label="each surface")
    for reason, each in lines.doubts:
        if each:
            entry(ls="", label=f"all points: {reason}")
        else:
            entry(color="black", marker="x", markersize=7, ls="", label=f"doubtful: {reason}")
    return figure


def _draw(axes: "Axes", line: "Dataset", quantity: str, colour: Any, **options: Any) -> None:
    """Draws a line, a band of its error over seeds, bars of its other errors, and the states."""
    x, values, state = (line[name].values for name in ("x", quantity, "state"))
    closed = (values == 0) & (quantity in (*FLOWS, *LEAKAGE))
    values = np.where(closed, np.nan, values)  # a logarithm has no 0
    bottom = style.at_bottom(axes)
    if np.any(closed):
        style.draw_closed(axes, x[closed], colour)
    axes.plot(x, values, color=colour, **options)
    if quantity + SEED_ERROR in line:
        error = line[quantity + SEED_ERROR].values
        axes.fill_between(x, values - error, values + error, color=colour, alpha=0.2, linewidth=0)
    if f"{quantity}_each" in line:
        each = line[f"{quantity}_each"].transpose(..., "seed").values
        axes.plot(x, each, color=colour, linewidth=THIN)
    if quantity + BAR in line:
        axes.errorbar(x, values, line[quantity + BAR], fmt="none", ecolor=colour, capsize=2)
    for word, (mark, filled) in MARKERS.items():
        at = state == word
        if np.any(at):
            lost = word in ("failed", NOT_STARTED)
            how: Any = bottom if lost else {"clip_on": False}
            y = np.zeros(at.sum()) if lost else values[at]
            face = colour if filled else "white"
            axes.plot(x[at], y, mark, color=colour, markerfacecolor=face, label=word, **how)
    at = line["doubtful"].values
    if np.any(at):  # behind the markers, whose faces show states
        axes.plot(x[at], values[at], "kx", markersize=9, markeredgewidth=1.2, zorder=1.9)


def _draw_measured(axes: "Axes", measured: MeasuredFriction) -> None:
    """Draws measured friction as points, with a marker for each temperature, to 1 K."""
    name, at = in_figure(measured.name), measured.temperature
    groups = np.zeros(len(measured.velocity)) if at is None else np.round(at)
    for mark, one in zip(itertools.cycle("sDv^<>ph"), np.unique(groups), strict=False):
        where = groups == one
        label = name if at is None else f"{name}, {kelvin(round(float(np.mean(at[where])), 2))}"
        error = None if measured.error is None else measured.error[where]
        axes.errorbar(
            measured.velocity[where], measured.friction[where], error, fmt=mark, color="black",
            markerfacecolor="none", capsize=2, linewidth=0.8, label=label, zorder=3,
        )  # fmt: skip


def _finish(axes: "Axes", lines: _Lines, quantity: str) -> None:
    """Names the axes of a panel and chooses their scales."""
    measured = lines.measured if quantity == "friction" else None
    x = np.concatenate([line["x"] for line in lines.each])
    if measured is not None:
        x = np.append(x, measured.velocity)
    x = x[np.isfinite(x)]  # a temperature without a shift has no reduced velocity
    low, high = np.min(x), np.max(x)
    if low > 0 and (lines.along.endswith("velocity") or high >= 10 * low):
        axes.set_xscale("log")
        style.few_powers_of_ten(axes.xaxis, low, high)
    ends = [line[quantity] for line in lines.each]
    for end in (BAR, SEED_ERROR):
        ends += [
            line[quantity] + line[quantity + end] for line in lines.each if quantity + end in line
        ]
    if measured is not None:
        above = 0.0 if measured.error is None else np.nan_to_num(measured.error)
        ends += [measured.friction + above]
    # Failed solves are NaN, which `fmax` leaves out; markers need room above.
    most = np.fmax.reduce(np.concatenate(ends), initial=0)
    if quantity in (*FLOWS, *LEAKAGE) and most > 0:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0, 1.08 * most or None)
    line = lines.each[0]
    along = lines.along.removeprefix("reduced_")
    title = title_of(along, line.attrs.get("scene", ""))
    title = in_figure(title + in_brackets(line["x"].attrs.get("units", "")))
    if lines.along == "reduced_velocity":
        title = f"$a_T$ × {title}"
    axes.set_xlabel(title)
    known = quantity_of(quantity)
    assert known is not None
    axes.set_ylabel(known.meaning + in_brackets(known.unit))
