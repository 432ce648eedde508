"""Results of a scene as lines: along one axis, one for each combination of the others."""

import itertools
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.display import unit_of
from ..files.results import Results
from ..files.study import NOT_STARTED
from .style import COLOURS, few_powers_of_ten

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {
    "pressure": "mean pressure", "velocity": "sliding velocity",
    "reduced_velocity": "$a_T$ × sliding velocity",
}  # fmt: skip
QUANTITIES = {
    "friction": "friction coefficient [1]",
    "contact_area_smooth": "contact area / nominal area [1]\n(sub-pixel)",
}
ERROR = "_standard_error"
BAND = (0.05, 0.95)  # of the surfaces
STYLES = ("-", "--", ":", "-.")
MANY = len(COLOURS)  # values told apart by colours of their own


class Lines(NamedTuple):
    """Lines of results, each of `points`; where there are seeds the mean over them.

    **Fields:**

    - `along`: the axis that the lines follow.
    - `x`: where their points lie, shape `(lines, points)`.
    - `others`: numbers of the lines on the other axes, by name, shape `(lines,)` each.
    - `middle`, `low`, `high`: quantities by name, shape `(lines, points)`; quantiles `BAND` over
      the seeds, equal to the middle where there are none. Standard errors are in the middle.
    - `state`, `doubtful`: of the points as in `Results`, of the worst seed, same shape.
    - `units`: of axes, by name.
    """

    along: str
    x: np.ndarray
    others: dict[str, np.ndarray]
    middle: dict[str, np.ndarray]
    low: dict[str, np.ndarray]
    high: dict[str, np.ndarray]
    state: np.ndarray
    doubtful: np.ndarray
    units: dict[str, str]

    @property
    def varied(self) -> list[str]:
        """The axes that tell the lines apart."""
        return [name for name, values in self.others.items() if len(np.unique(values)) > 1]


def lines_of(results: Results, along: str | None = None) -> Lines:
    """Returns the lines of results along an axis, by default velocity, or another if that is one.

    "reduced_velocity" stands for the velocity times a_T.
    """
    axes = results.study.axes
    longer = [name for name, at in axes.items() if len(at) > 1 and name != "seed"]
    if along is None:
        along = "velocity" if "velocity" in longer or not longer else longer[-1]
    follows = "velocity" if along == "reduced_velocity" else along
    others = [name for name in axes if name not in (follows, "seed")]
    order = [*others, *(["seed"] if "seed" in axes else []), follows]

    def laid(values: np.ndarray, names: list[str]) -> np.ndarray:
        """Lines along a first axis, then the seeds where they are among the names, and points."""
        kept = [name for name in axes if name in names]
        moved = np.transpose(values, [kept.index(name) for name in names])
        return moved.reshape(-1, *moved.shape[len(others) :])

    points = np.argsort(axes[follows], kind="stable")
    state, doubts = results.state, [caveat.where for caveat in results.caveats]
    doubtful = np.any([np.zeros(state.shape, bool), *doubts], axis=0)
    told = [*QUANTITIES, *(f"{name}{ERROR}" for name in QUANTITIES)]
    names = [name for name in told if name in results.study.values]
    middle = {name: results[name] for name in names}
    low = high = middle
    x = np.broadcast_to(axes[follows], tuple(map(len, (axes[name] for name in order))))
    if along == "reduced_velocity":
        x = np.transpose(results[along], [list(axes).index(name) for name in order])
    x = x.reshape(-1, *x.shape[len(others) :])
    state, doubtful = laid(state, order), laid(doubtful, order)
    if "seed" in axes:
        spread = results.study.over("seed", BAND)
        middle = {name: spread.mean[name] for name in names}
        low, high = ({n: spread.quantiles[n][i] for n in QUANTITIES} for i in range(2))
        x, state, doubtful = x[:, 0], _worst(state), np.any(doubtful, axis=1)
    without = [name for name in order if name != "seed"]
    middle, low, high = (
        {name: laid(values, without)[:, points] for name, values in part.items()}
        for part in (middle, low, high)
    )
    combined = np.array(list(itertools.product(*(axes[name] for name in others))))
    return Lines(
        along=along,
        x=x[:, points],
        others=dict(zip(others, combined.T, strict=True)),
        middle=middle,
        low=low,
        high=high,
        state=state[:, points],
        doubtful=doubtful[:, points],
        units=results.study.units,
    )


def _worst(state: np.ndarray) -> np.ndarray:
    """One word for the seeds of a point: that of most concern, of failures only if all failed."""
    lost = (state == "failed") | (state == NOT_STARTED)
    some = np.any(state != "", axis=1)
    return np.where(np.all(lost, axis=1), state[:, 0], np.where(some, "not converged", ""))


def draw(axes: "Axes", lines: Lines, quantity: str, styles: list[dict[str, Any]]) -> None:
    """Draws the lines with a band over the seeds and bars of one standard error, and marks points
    by their state."""
    for i, style in enumerate(styles):
        x, values = lines.x[i], lines.middle[quantity][i]
        colour = style["color"]
        axes.plot(x, values, **style)
        ends = lines.low[quantity][i], lines.high[quantity][i]
        if np.any(ends[0] < ends[1]):
            axes.fill_between(x, *ends, color=colour, alpha=0.2, linewidth=0)
        if quantity + ERROR in lines.middle:
            error = lines.middle[quantity + ERROR][i]
            axes.errorbar(x, values, error, fmt="none", ecolor=colour, capsize=2)
        for state, face in (("", colour), ("not converged", "white")):
            chosen = lines.state[i] == state
            if np.any(chosen):
                marker: dict[str, Any] = {"color": colour, "markerfacecolor": face, "label": state}
                axes.plot(x[chosen], values[chosen], "o", **marker)
        for state, mark in (("failed", "^"), (NOT_STARTED, "|")):
            without = x[lines.state[i] == state]
            if len(without):
                zeros = np.zeros(len(without))
                axes.plot(without, zeros, mark, color=colour, clip_on=False, label=state)
    which, at = np.nonzero(lines.doubtful)
    axes.plot(
        lines.x[which, at],
        lines.middle[quantity][which, at],
        "kx",
        markersize=9,
        markeredgewidth=1.2,
        zorder=1.9,  # behind the markers, whose faces tell states
        label="doubtful: see the caveats" if len(at) else None,
    )


def label_of(name: str, value: float, units: dict[str, str]) -> str:
    """Returns a number with its unit, as legends have it."""
    unit = units.get(name, "1")
    if unit in ("1", "K"):
        return f"{value:.5g} {unit}".removesuffix(" 1")
    unit, factor = unit_of(unit, abs(value))
    return f"{factor * value:.3g} {unit}"


def finish(axes: "Axes", lines: Lines, quantity: str) -> None:
    """Names the axes of a panel and chooses their scales."""
    x = lines.x[np.isfinite(lines.x)]
    low, high = np.min(x), np.max(x)
    if low > 0 and (lines.along.endswith("velocity") or high >= 10 * low):
        axes.set_xscale("log")
        few_powers_of_ten(axes.xaxis, low, high)
    upper = lines.middle[quantity] + lines.middle.get(quantity + ERROR, 0)
    top = np.fmax.reduce([upper, lines.high[quantity]], axis=None, initial=0)
    axes.set_ylim(0, max(1.08 * top, axes.get_ylim()[1] if axes.get_ylim()[0] == 0 else 0) or None)
    unit = lines.units.get(lines.along)
    axes.set_xlabel(TITLES.get(lines.along, lines.along) + (f" [{unit}]" if unit else ""))
    axes.set_ylabel(QUANTITIES[quantity])
