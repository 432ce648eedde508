"""Figures of scenes: friction and contact area along what was varied."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files.results import Results
from .lines import MANY, QUANTITIES, STYLES, TITLES, Lines, draw, finish, label_of, lines_of
from .style import COLOURS, PAGE, PRESSURES, TEMPERATURES, entitle, new_figure, ordered, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def plot_sweep(results: Results) -> "Figure":
    """Returns a figure of friction and contact area against velocity.

    If there is one velocity they are drawn against the last axis that has several points. The area
    is the sub-pixel one. The first of the other axes tells the lines apart by colour, the rest by
    dashes. Over several surfaces (`seed`) lines are means and bands reach from the 5 % to the 95 %
    quantile. Bars are one standard error, where errors of a material are known. A solve that did
    not converge has a hollow marker, one with a caveat (`Results.caveats`) a cross; one that failed
    has a triangle and one that was not started a stroke, at the bottom.

    **Arguments:**

    - `results`: what `run_scene` gave.
    """
    lines = lines_of(results)
    return _drawn(lines, lines.varied[0] if lines.varied else "pressure")


@styled
def plot_reduced(results: Results) -> "Figure":
    """Returns a figure of friction and contact area against a_T times velocity.

    Where temperature only shifts the times of one law they fall on one curve; where it lifts moduli
    too (b_T), or acts on parts of the block only, they need not. As `plot_sweep` otherwise.

    **Arguments:**

    - `results`: what `run_scene` gave for several temperatures.

    **Raises:** `ValueError` if there is no such curve, saying why.
    """
    if "reduced_velocity" not in results.study.values:
        reason = "No master curve: the results have no axis of temperatures."
        raise ValueError(results.attributes.get("master_curve", reason))
    figure = _drawn(lines_of(results, "reduced_velocity"), "temperature")
    entitle(figure, results.attributes["master_curve"].replace("a_T", "$a_T$"))
    return figure


@styled
def plot_compare(results: Sequence[Results], names: Sequence[str]) -> "Figure":
    """Returns a figure of friction and contact area of several results, one colour for each.

    **Arguments:**

    - `results`: what `run_scene` gave, over the same axes; points may differ, and axes of one point
      and seeds do not matter.
    - `names`: what the legend calls them.

    **Raises:** `ValueError` if they vary different axes.
    """
    every = [lines_of(one) for one in results]
    first = every[0]
    for lines, name in zip(every, names, strict=True):
        if (lines.along, lines.varied) != (first.along, first.varied):
            raise ValueError(
                f"{name!r} varies {_words(lines)}, and {names[0]!r} {_words(first)}: results over "
                "the same axes can be compared."
            )
        for what in (first.along, *first.varied, *QUANTITIES):
            here, there = lines.units.get(what), first.units.get(what)
            if here != there:
                raise ValueError(
                    f"{name!r} has `{what}` in {here}, and {names[0]!r} in {there}: results in the "
                    "same units can be compared."
                )
    figure = new_figure(PAGE, 2.9)
    for axes, quantity in zip(figure.subplots(1, 2), QUANTITIES, strict=True):
        for i, (lines, name) in enumerate(zip(every, names, strict=True)):
            styles = _styles(lines, lines.varied)
            for style in styles:
                style["color"] = COLOURS[i % len(COLOURS)]
            styles[0]["label"] = name
            draw(axes, lines, quantity, styles)
            finish(axes, lines, quantity)
    _legend(figure, first, dashed=first.varied, title=None)
    return figure


def _drawn(lines: Lines, coloured: str) -> "Figure":
    """Lines told apart by colour along one axis, by dashes along the others."""
    figure = new_figure(PAGE, 2.9)
    dashed = [name for name in lines.varied if name != coloured]
    for axes, quantity in zip(figure.subplots(1, 2), QUANTITIES, strict=True):
        styles = _styles(lines, dashed)
        for style, colour, label in zip(styles, *_colours(lines, coloured), strict=True):
            style |= {"color": colour, "label": label}
        draw(axes, lines, quantity, styles)
        finish(axes, lines, quantity)
    _legend(figure, lines, dashed, TITLES.get(coloured, coloured))
    return figure


def _colours(lines: Lines, name: str) -> tuple[list[Any], list[str | None]]:
    """A colour for each line by its number on an axis, and a label for the first of each."""
    numbers = lines.others.get(name, np.zeros(len(lines.x)))
    values = list(dict.fromkeys(numbers.tolist()))
    scale = TEMPERATURES if name == "temperature" else PRESSURES
    chosen = COLOURS if len(values) <= MANY else ordered(len(values), scale)
    # Of many the legend names some.
    named = values if len(values) <= MANY else values[:: -(-len(values) // MANY)]
    labels, seen = [], set()
    for number in numbers.tolist():
        new = number in named and number not in seen
        labels.append(label_of(name, number, lines.units) if new else None)
        seen.add(number)
    return [chosen[values.index(number)] for number in numbers.tolist()], labels


def _combinations(lines: Lines, names: Sequence[str]) -> list[tuple[float, ...]]:
    """The numbers of each line on some axes."""
    columns = [lines.others[name].tolist() for name in names]
    return list(zip(*columns, strict=True)) if columns else [()] * len(lines.x)


def _styles(lines: Lines, names: Sequence[str]) -> list[dict[str, Any]]:
    """Dashes for each line by its numbers on some axes; of many combinations they come again."""
    each = _combinations(lines, names)
    order = list(dict.fromkeys(each))
    return [{"linestyle": STYLES[order.index(one) % len(STYLES)]} for one in each]


def _legend(figure: "Figure", lines: Lines, dashed: Sequence[str], title: str | None) -> None:
    from matplotlib.lines import Line2D

    handles, labels = figure.axes[0].get_legend_handles_labels()
    found = dict(zip(labels, handles, strict=True))
    combinations = list(dict.fromkeys(_combinations(lines, dashed))) if dashed else []
    for combination, style in zip(combinations, STYLES, strict=False):
        words = (label_of(n, v, lines.units) for n, v in zip(dashed, combination, strict=True))
        found[", ".join(words)] = Line2D([], [], color="0.4", linestyle=style)
    figure.axes[0].legend(found.values(), found.keys(), title=title)


def _words(lines: Lines) -> str:
    return ", ".join(f"`{name}`" for name in (*lines.varied, lines.along))
