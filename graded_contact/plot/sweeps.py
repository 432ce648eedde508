"""Figures of scenes: friction and contact area over the varied quantities."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.quantities import OBSERVABLES
from ..scenes.results import SEED_ERROR, has_numbers, over_seeds, solve_states, warnings_of
from ..studies.dataset import NOT_STARTED
from .style import (
    COLOURS,
    PAGE,
    PRESSURES,
    TEMPERATURES,
    entitle,
    few_powers_of_ten,
    legend_below,
    letters,
    new_figure,
    ordered,
    styled,
)
from .words import label_of, title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import DataArray, Dataset

DRAWN = ("friction", "contact_area_smooth")
ERROR = "_standard_error"
DOUBTFUL = "doubtful: see the caveats"
NOTHING = "No solve succeeded: no figure is drawn."
DASHES = ("-", "--", ":", "-.")
MANY = len(COLOURS)  # values with a colour each
THIN = 0.4  # points, of the lines of single surfaces


@styled
def plot_sweep(results: "Dataset", *, all_seeds: bool = False) -> "Figure":
    """Returns a figure of friction and contact area against velocity.

    If there is one velocity they are drawn against the last axis that has several points. The area
    is the sub-pixel one. The first of the other axes has a colour for each value, the rest have
    dashes. Over several surfaces (`seed`) lines are means, and bands are their standard errors.
    Bars, and the bands of one surface, are standard errors by materials, where these are known. A
    solve that did not converge has a hollow marker, one with a caveat a cross, one that failed a
    triangle and one that was not started a stroke, both at the bottom.

    **Arguments:**

    - `results`: the result of `run_scene`.
    - `all_seeds`: draws a thin line for each surface in addition.

    **Raises:** `ValueError` if no solve succeeded, and for the results of a scene with [motion].
    """
    lines = _lines(results, all_seeds=all_seeds)
    return _drawn(lines, lines.varied[0] if lines.varied else None)


@styled
def plot_reduced(results: "Dataset") -> "Figure":
    """Returns a figure of friction and contact area against a_T times velocity.

    If temperature only shifts the times of one law, they fall on one curve. They need not if it
    also changes moduli (b_T), or acts on parts of the block only. Otherwise as `plot_sweep`.

    **Arguments:**

    - `results`: the result of `run_scene` for several temperatures.

    **Raises:** `ValueError` with the reason if there is no such curve.
    """
    if "reduced_velocity" not in results:
        reason = "No master curve: the results have no axis of temperatures."
        raise ValueError(results.attrs.get("master_curve", reason))
    figure = _drawn(_lines(results, "reduced_velocity"), "temperature")
    entitle(figure, results.attrs["master_curve"].replace("a_T", "$a_T$"))
    return figure


@styled
def plot_compare(results: "Sequence[Dataset]", names: Sequence[str]) -> "Figure":
    """Returns a figure of friction and contact area of several results, one colour for each.

    **Arguments:**

    - `results`: the result of `run_scene`, over the same axes. Points may differ; axes of one point
      and seeds do not matter.
    - `names`: of the results, for the legend.

    **Raises:** `ValueError` if they vary different axes, or are of scenes with [motion].
    """
    every = [_lines(one) for one in results]
    first = every[0]
    for lines, name, one in zip(every, names, results, strict=True):
        if (lines.along, lines.varied) != (first.along, first.varied):
            raise ValueError(
                f"{name!r} varies {_words(lines)}, and {names[0]!r} {_words(first)}: results over "
                "the same axes can be compared."
            )
        for what in (first.along, *first.varied, *DRAWN):
            here, there = _unit(one[what]), _unit(results[0][what])
            if here != there:
                raise ValueError(
                    f"{name!r} has `{what}` in {here}, and {names[0]!r} in {there}: results in the "
                    "same units can be compared."
                )
    figure = new_figure(PAGE, 2.9)
    for axes, quantity in zip(figure.subplots(1, 2), DRAWN, strict=True):
        for i, (lines, name) in enumerate(zip(every, names, strict=True)):
            dashes = _dashes(lines, lines.varied)
            for j, line in enumerate(lines.each):
                style = {"linestyle": dashes[j], "color": COLOURS[i % len(COLOURS)]}
                _draw(axes, line, quantity, style, None if j else name)
            _finish(axes, lines, quantity)
    _legend(figure, first, dashed=first.varied)
    return figure


class _Lines(NamedTuple):
    """Results as lines along one axis, one for each combination of the others but the seed.

    **Fields:**

    - `along`: name of the axis.
    - `varied`: the other axes with several values.
    - `each`: of each line the quantities (means over the seeds, with their standard errors), `x`,
      `state` and `doubtful` along the axis, and `NAME_each` over the seeds if all are drawn; the
      numbers on the other axes are its coordinates.
    - `scene`: the TOML text.
    - `surfaces`: number of seeds; 0 without such an axis.
    """

    along: str
    varied: list[str]
    each: "list[Dataset]"
    scene: str
    surfaces: int


def _lines(results: "Dataset", along: str | None = None, *, all_seeds: bool = False) -> _Lines:
    """The lines of results along an axis: by default velocity, or the last with several points."""
    if not np.any(has_numbers(results)):
        raise ValueError(NOTHING)
    if "time" in results.dims:
        raise ValueError(
            "`results` holds motions in time: steady sliding is needed; `plot_cycle` draws motions."
        )
    axes = [str(axis) for axis in results["message"].dims]
    longer = [axis for axis in axes if results.sizes[axis] > 1 and axis != "seed"]
    if along is None:
        along = "velocity" if "velocity" in longer or not longer else longer[-1]
    follows = "velocity" if along == "reduced_velocity" else along
    others = [axis for axis in axes if axis not in (follows, "seed")]
    state = solve_states(results)
    doubts = [caveat.where for caveat in warnings_of(results)]
    doubtful = state.copy(data=np.any([np.zeros(state.shape, bool), *doubts], axis=0))
    middle, apart = results, {}
    if "seed" in axes:
        middle = over_seeds(results)
        state, doubtful = solve_states(middle), doubtful.any("seed")
        if all_seeds:
            apart = {f"{name}_each": results[name] for name in DRAWN}
    names = [name + end for name in DRAWN for end in ("", ERROR, SEED_ERROR)]
    lines = middle[[name for name in names if name in middle]]
    lines = lines.assign(apart | {"x": results[along], "state": state, "doubtful": doubtful})
    lines = lines.sortby(follows)
    each = [
        lines.isel(dict(zip(others, index, strict=True)))
        for index in np.ndindex(*(results.sizes[axis] for axis in others))
    ]
    varied = [axis for axis in others if results.sizes[axis] > 1]
    scene = results.attrs.get("scene", "")
    return _Lines(along, varied, each, scene, results.sizes.get("seed", 0))


def _drawn(lines: _Lines, coloured: str | None) -> "Figure":
    """Lines with a colour for each value on one axis if it is varied, and dashes for the others."""
    figure = new_figure(PAGE, 2.9)
    dashed = [name for name in lines.varied if name != coloured]
    numbers = [line[coloured].item() if coloured in lines.varied else 0 for line in lines.each]
    values = list(dict.fromkeys(numbers))
    scale = TEMPERATURES if coloured == "temperature" else PRESSURES
    colours = COLOURS if len(values) <= MANY else ordered(len(values), scale)
    # The legend names some of many.
    named = values if len(values) <= MANY else values[:: -(-len(values) // MANY)]
    dashes = _dashes(lines, dashed)
    for axes, quantity in zip(figure.subplots(1, 2), DRAWN, strict=True):
        for i, line in enumerate(lines.each):
            new = numbers[i] in named and numbers[i] not in numbers[:i]
            label = _label(lines, line, coloured) if new and coloured in lines.varied else None
            style = {"linestyle": dashes[i], "color": colours[values.index(numbers[i])]}
            _draw(axes, line, quantity, style, label)
        _finish(axes, lines, quantity)
    _legend(figure, lines, dashed)
    line = lines.each[0]
    fixed = [str(name) for name in line.coords if not line[name].ndim and name not in lines.varied]
    entitle(figure, ", ".join(_label(lines, line, name) for name in fixed))
    return figure


def _label(lines: _Lines, line: "Dataset", name: str) -> str:
    return f"{title_of(name, lines.scene)} {label_of(line[name])}"


def _combinations(lines: _Lines, names: Sequence[str]) -> list[tuple[str, ...]]:
    """The numbers of each line on some axes, with units."""
    return [tuple(_label(lines, line, name) for name in names) for line in lines.each]


def _dashes(lines: _Lines, names: Sequence[str]) -> list[str]:
    """Dashes for each line by its numbers on some axes; of many combinations they repeat."""
    each = _combinations(lines, names)
    order = list(dict.fromkeys(each))
    return [DASHES[order.index(one) % len(DASHES)] for one in each]


def _legend(figure: "Figure", lines: _Lines, dashed: Sequence[str]) -> None:
    """Explains colours, dashes, bands and bars below the panels, and names these."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    extra: dict[str, Any] = {}
    combinations = list(dict.fromkeys(_combinations(lines, dashed))) if dashed else []
    for combination, dashes in zip(combinations, DASHES, strict=False):
        extra[", ".join(combination)] = Line2D([], [], color="0.4", linestyle=dashes)
    if lines.surfaces > 1:
        extra[f"mean of {lines.surfaces} surfaces ± standard error"] = Patch(color="0.8")
    if any(f"{name}{ERROR}" in lines.each[0] for name in DRAWN):
        bar = Line2D([], [], color="0.4", marker="|", ls="")
        extra["± standard error by materials"] = bar if lines.surfaces > 1 else Patch(color="0.8")
    if any(f"{name}_each" in lines.each[0] for name in DRAWN):
        extra["each surface"] = Line2D([], [], color="0.4", linewidth=THIN)
    if any(np.any(line["doubtful"]) for line in lines.each):
        extra[DOUBTFUL] = Line2D([], [], color="black", marker="x", markersize=7, ls="")
    letters(figure.axes)
    legend_below(figure, extra)


def _draw(
    axes: "Axes", line: "Dataset", quantity: str, style: dict[str, Any], label: str | None
) -> None:
    """Draws a line with a band of the error over seeds and bars of that by materials, and marks
    points by their state."""
    x, values, state = (line[name].values for name in ("x", quantity, "state"))
    colour = style["color"]
    axes.plot(x, values, **style, label=label)
    band = next((end for end in (SEED_ERROR, ERROR) if quantity + end in line), None)
    if band is not None:
        error = line[quantity + band].values
        axes.fill_between(x, values - error, values + error, color=colour, alpha=0.2, linewidth=0)
    if f"{quantity}_each" in line:
        each = line[f"{quantity}_each"].transpose(..., "seed").values
        axes.plot(x, each, color=colour, linewidth=THIN)
    if quantity + ERROR in line:
        error = line[quantity + ERROR]
        axes.errorbar(x, values, error, fmt="none", ecolor=colour, capsize=2)
    for word, face in (("", colour), ("not converged", "white")):
        at = state == word
        if np.any(at):
            marker: dict[str, Any] = {"color": colour, "markerfacecolor": face, "label": word}
            axes.plot(x[at], values[at], "o", **marker)
    for word, mark in (("failed", "^"), (NOT_STARTED, "|")):
        at = state == word
        if np.any(at):
            axes.plot(x[at], np.zeros(at.sum()), mark, color=colour, clip_on=False, label=word)
    at = line["doubtful"].values
    if np.any(at):
        axes.plot(
            x[at], values[at], "kx", markersize=9, markeredgewidth=1.2,
            zorder=1.9,  # behind the markers, whose faces show states
        )  # fmt: skip


def _finish(axes: "Axes", lines: _Lines, quantity: str) -> None:
    """Names the axes of a panel and chooses their scales."""
    x = np.concatenate([line["x"] for line in lines.each])
    x = x[np.isfinite(x)]
    low, high = np.min(x), np.max(x)
    if low > 0 and (lines.along.endswith("velocity") or high >= 10 * low):
        axes.set_xscale("log")
        few_powers_of_ten(axes.xaxis, low, high)
    ends = [line[quantity] for line in lines.each]
    for end in (ERROR, SEED_ERROR):
        ends += [
            line[quantity] + line[quantity + end] for line in lines.each if quantity + end in line
        ]
    top = np.fmax.reduce(np.concatenate(ends), initial=0)
    axes.set_ylim(0, max(1.08 * top, axes.get_ylim()[1] if axes.get_ylim()[0] == 0 else 0) or None)
    title = title_of(lines.along, lines.scene)
    if lines.along == "reduced_velocity":
        title = f"$a_T$ × {title_of('velocity')}"
    unit = _unit(lines.each[0]["x"])
    axes.set_xlabel(title + (f" [{unit}]" if unit else ""))
    axes.set_ylabel(f"{OBSERVABLES[quantity].quantity.meaning} [1]")


def _unit(values: "DataArray") -> str:
    return values.attrs.get("units", "")


def _words(lines: _Lines) -> str:
    return ", ".join(f"`{name}`" for name in (*lines.varied, lines.along))
