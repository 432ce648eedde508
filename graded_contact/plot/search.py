"""The figure of a search: objective, constraints and parameters of each evaluation."""

from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from .style import COLOURS, PAGE, few_powers_of_ten, figure_of, finished, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..design.search import Design


@finished
def plot_search(design: "Design", *, axes: Any = None) -> "Figure":
    """Returns a figure of a search: objective, constraints and parameters of each evaluation.

    All starts are in the first panel, the best in colour. Constraints and parameters belong to
    the best start; parameters are divided by their results.

    **Arguments:**

    - `design`: the result of `minimise`.
    - `axes`: to draw in, by default of a new figure.
    """
    from matplotlib.ticker import MaxNLocator

    best = design.best
    constrained = best.margins.size > 0
    shown = panels(axes, "abc" if constrained else "ab", (PAGE, 2.9))
    value, *limits, parameters = shown
    for run in (*(run for run in design.runs if run is not best), best):  # the best on top
        colour = COLOURS[0] if run is best else "0.7"
        value.plot(np.arange(1, 1 + len(run.values)), run.values, ".-", color=colour)
    tried = np.concatenate([run.values for run in design.runs])
    # A logarithmic axis needs positive values, and is worth it from two decades on.
    if 0 < 100 * np.min(tried) < np.max(tried):
        value.set_yscale("log")
    value.set_ylabel("objective")
    evaluation = np.arange(1, 1 + len(best.values))
    for panel in limits:
        for name, margins in zip(_names(design.constraints), best.margins.T, strict=True):
            panel.plot(evaluation, margins, ".-", label=f"(b) {name}")
        ends = panel.get_ylim()
        # Grey is not allowed.
        panel.axhspan(min(ends[0], 0), 0, color="0.93", zorder=0)
        panel.set_ylim(ends)
        panel.set_ylabel("constraint (0 or more allowed)")
    # Relative to the result, because parameters have unlike units and sizes.
    ratios = best.parameters / best.parameters[best.best]
    for name, ratio in zip(_names(design.parameters), ratios.T, strict=True):
        parameters.plot(evaluation, ratio, ".-", label=f"({'c' if constrained else 'b'}) {name}")
    parameters.set_ylabel("parameter / result")
    if np.max(ratios) > 3 * np.min(ratios):  # else a logarithmic axis has hardly a number
        parameters.set_yscale("log")
        few_powers_of_ten(parameters.yaxis, np.min(ratios), np.max(ratios))
    for panel in shown:
        panel.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        panel.set_xlabel("evaluation")
    return figure_of(value)


def _names(parameters: Any) -> list[str]:
    """The names of all numbers in a nesting."""
    return [
        jax.tree_util.keystr(path, simple=True, separator=".") + "".join(f"[{i}]" for i in index)
        for path, number in jax.tree_util.tree_leaves_with_path(parameters)
        for index in np.ndindex(np.shape(number))
    ]
