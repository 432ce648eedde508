"""Figures of results over the quantities that a scene or a sweep varies."""

import re
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.display import time_unit, unit_of
from ..core.quantities import in_brackets, quantity_of
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import DataArray, Dataset

ZERO_CELSIUS = 273.15  # K
SLIDING, AT_REST = ("friction", "contact_area"), ("contact_area", "mean_gap")
MOVING = ("friction", "contact_area", "load", "mean_gap")
LEAKAGES = ("leakage_along_x", "leakage_along_y")
CONDUCTANCES = ("flow_along_x", "flow_along_y")
FLOWS = ("flow", "leakage", "conductance")  # in the names of what is 0 in a closed gap
DASHES = ("-", "--", ":", "-.")
MOST_LABELS = 12  # in a legend
COLUMNS = 4  # of panels beside each other
LABEL_WIDTH = 30  # letters of an ordinate
GEOMETRIC = 10.0  # times the first step, of the last one of a logarithmic axis of time
SEED_ERROR = "_seed_error"


@style.finished
def plot_sweep(
    results: "Dataset",
    names: Sequence[str] | None = None,
    along: str | None = None,
    *,
    axes: Any = None,
) -> "Figure":
    """Returns a figure with a panel for each name, and a line for each point of the other axes.

    The first of the other axes has a colour for each value, the rest have dashes. Over several
    surfaces (`seed`) lines are means, and bands their standard errors. Bars (over time: bands) are
    estimated errors. A solve that did not converge has a hollow marker, one without a number a
    triangle at the bottom.

    - Leakage of a seal: `plot_sweep(results, ["leakage_along_x"], along="pressure")`.
    - A master curve over a_T v: `plot_sweep(results, along="reduced_velocity")`.
    - A motion over time: `plot_sweep(results, along="time")`.
    - Several results: `plot_sweep(xarray.concat([a, b], "block").assign_coords(block=["a", "b"]))`.

    **Arguments:**

    - `results`: the result of `run_scene` or `sweep`.
    - `names`: of the numbers; by default friction and contact area, at rest area and mean gap.
    - `along`: name of an axis, or of another number; by default time, the velocity, or the last
      axis with several points.
    - `axes`: a panel for each name to draw in, by default those of a new figure.

    **Raises:** `ValueError` if `results` lack a name, or have no numbers.
    """
    along = along or _default_axis(results)
    names = tuple(names or _default_names(results))
    for name in (*names, along):
        if name not in results:
            raise ValueError(f"`results` have no {name!r}; they have {', '.join(results)}.")
    if not any(np.any(np.isfinite(results[name])) for name in names):
        raise ValueError("`results` have no numbers to draw: no solve succeeded.")
    columns = len(names) if len(names) <= COLUMNS else 3
    size = (style.PAGE, 2.9 if len(names) < 3 else 2.3 * -(-len(names) // columns))
    shown = style.panels(axes, style.mosaic_of(len(names), columns), size)
    lines, x = list(lines_of(results, along)), shown_in(results, along)
    for panel, name in zip(shown, names, strict=True):
        y = shown_in(results, name)
        for line, look in lines:
            draw_line(panel, line, x, y, **look)
        _choose_scales(panel, results, x, y)
    if results.sizes.get("seed", 1) > 1:
        label = f"mean of {results.sizes['seed']} surfaces ± standard error"
        shown[-1].plot([], [], color="0.8", linewidth=6, label=label)
    figure = shown[0].get_figure(root=True)
    style.entitle(figure, place_of(results))
    return figure


class Shown(NamedTuple):
    """A number of results as a figure shows it: its name, its label with the unit, 1 SI in it."""

    name: str
    label: str
    factor: float


def shown_in(results: "Dataset", name: str) -> Shown:
    """Returns how a figure shows a number of results."""
    quantity = quantity_of(name)
    unit = results[name].attrs.get("units", "" if quantity is None else quantity.unit)
    largest, factor = float(np.nanmax(np.abs(results[name].values))), 1.0
    words = "$a_T$ × sliding velocity" if name == "reduced_velocity" else title_of(name)
    if unit == "s":
        unit, factor = time_unit(largest)
        words = name.replace("_", " ")  # the time of a transient is not over a period
    elif unit in ("m", "Pa"):
        unit, factor = unit_of(unit, largest)
    return Shown(name, words + in_brackets(unit), factor)


def lines_of(results: "Dataset", along: str) -> "Iterator[tuple[Dataset, dict[str, Any]]]":
    """Yields each line of results along an axis, and how to draw it."""
    if "seed" in results.dims:
        results = over_seeds(results)
    follows = along if along in results.dims else str(results[along].dims[-1])
    rest = [name for name in axes_of(results) if name != follows]
    varied = [name for name in rest if results.sizes[name] > 1]
    scale = style.TEMPERATURES if varied[:1] == ["temperature"] else style.PRESSURES
    colours = style.colours_of(results.sizes[varied[0]] if varied else 1, scale)
    shape = tuple(results.sizes[name] for name in rest)
    every = -(-int(np.prod(shape)) // MOST_LABELS)
    dashes: dict[tuple[int, ...], str] = {}
    for count, index in enumerate(np.ndindex(shape)):
        line = results.isel(dict(zip(rest, index, strict=True)))
        first, *others = [i for i, name in zip(index, rest, strict=True) if name in varied] or [0]
        dash = dashes.setdefault(tuple(others), DASHES[len(dashes) % len(DASHES)])
        label = ", ".join(f"{title_of(name)} {label_of(line[name])}" for name in varied)
        look = {"color": colours[first], "linestyle": dash}
        yield line.sortby(follows), look | {"label": "" if count % every else label}


def draw_line(axes: "Axes", line: "Dataset", x: Shown, y: Shown, **look: Any) -> None:
    """Draws a number over another: the line, its errors, and the states of its solves."""
    at, values = x.factor * line[x.name].values, y.factor * line[y.name].values
    over_time, colour, bottom = "time" in line[y.name].dims, look["color"], style.at_bottom(axes)
    closed = (values == 0) & is_flow(y.name)
    values = np.where(closed, np.nan, values)  # a logarithm has no 0
    if over_time and is_flow(y.name):  # known at some times only: these are not joined
        look |= {"linestyle": "none", "marker": "o", "markersize": 3}
    axes.plot(at, values, **look)
    if np.any(closed):
        zeros = np.zeros(np.sum(closed))
        axes.plot(at[closed], zeros, "v", color=colour, label="closed: no flow", **bottom)
    if y.name + SEED_ERROR in line:
        _draw_band(axes, at, values, y.factor * line[y.name + SEED_ERROR].values, colour)
    if f"{y.name}_error" in line:
        error = y.factor * np.broadcast_to(line[f"{y.name}_error"].values, values.shape)
        if over_time:
            _draw_band(axes, at, values, error, colour, "band: ± estimated error")
        else:
            error, label = np.where(np.isfinite(error), error, np.nan), "bars: ± estimated error"
            axes.errorbar(at, values, error, fmt="none", ecolor=colour, capsize=2, label=label)
    if not over_time:
        _draw_states(axes, line, at, values, closed, colour)


def _draw_band(axes, at, values, error, colour, label="") -> None:
    ends = values - error, values + error
    axes.fill_between(at, *ends, color=colour, alpha=0.2, linewidth=0, label=label)


def _draw_states(axes, line, at, values, closed, colour) -> None:
    """Draws a marker for each solve: full, hollow, or at the bottom if there is no number."""
    message = line["message"].values if "message" in line else np.full(at.shape, "")
    failed = ~np.isfinite(values) & ~closed
    partial = (message != "") & ~failed
    good = ~failed & ~partial
    axes.plot(at[good], values[good], "o", color=colour, clip_on=False)
    hollow: dict[str, Any] = {"color": colour, "markerfacecolor": "white"}
    if np.any(partial):
        here = at[partial], values[partial]
        axes.plot(*here, "o", label="not converged", clip_on=False, **hollow)
    if np.any(failed):
        here = at[failed], np.zeros(np.sum(failed))
        axes.plot(*here, "^", label="failed", **hollow, **style.at_bottom(axes))


def over_seeds(results: "Dataset") -> "Dataset":
    """Returns the means over the surfaces that were solved, with standard errors `NAME_seed_error`.

    An estimated error is the largest of all surfaces; a message is that of the first that has one.
    """
    allowed = {*axes_of(results), "time"}
    names = [n for n, v in results.data_vars.items() if "seed" in v.dims and {*v.dims} <= allowed]
    message = results["message"]
    solved = results[names].drop_vars("message").where(message == "")
    means = solved.mean("seed", keep_attrs=True)
    spread = solved.std("seed", ddof=1) / solved.count("seed") ** 0.5
    errors = [name for name in solved if str(name).endswith("_error")]
    found = means.assign({n: solved[n].max("seed", keep_attrs=True) for n in errors})
    found = found.assign({f"{name}{SEED_ERROR}": spread[name] for name in spread})
    return found.assign(message=message.isel(seed=(message != "").argmax("seed")))


def axes_of(results: "Dataset") -> tuple[str, ...]:
    """Returns the names of the axes of the solves."""
    dims = results["message"].dims if "message" in results else results.dims
    return tuple(str(name) for name in dims)


def _default_axis(results: "Dataset") -> str:
    if "time" in results.dims:
        return "time"
    longer = [name for name in axes_of(results) if results.sizes[name] > 1 and name != "seed"]
    return "velocity" if "velocity" in longer or not longer else longer[-1]


def _default_names(results: "Dataset") -> Sequence[str]:
    if "time" in results.dims:
        rests = "surface_displacement" in results and not np.any(results["surface_displacement"])
        flows = LEAKAGES if LEAKAGES[0] in results else CONDUCTANCES
        names = (*(MOVING[1:] if rests else MOVING), *flows)
        return [n for n in names if n in results and "time" in results[n].dims]
    at_rest = "velocity" in results and not np.any(results["velocity"])
    return AT_REST if at_rest else SLIDING


def is_flow(name: str) -> bool:
    """Returns whether a number is a flow through the gap, which is 0 in a closed one."""
    return any(word in name for word in FLOWS)


def _choose_scales(axes: "Axes", results: "Dataset", x: Shown, y: Shown) -> None:
    """Names the axes of a panel and chooses their scales."""
    at = x.factor * results[x.name].values
    at = at[np.isfinite(at)]  # a temperature without a shift has no reduced velocity
    low, high = np.min(at), np.max(at)
    if x.name == "time":
        log = low > 0 and len(at) > 1 and at[-1] - at[-2] > GEOMETRIC * at[0]
    else:
        log = low > 0 and (x.name.endswith("velocity") or high >= 10 * low)
    if log:
        axes.set_xscale("log")
        style.few_powers_of_ten(axes.xaxis, low, high)
    axes.set(xlabel=x.label, ylabel=textwrap.fill(y.label, LABEL_WIDTH))
    values = results[y.name].values
    if is_flow(y.name) and np.nanmax(values) > 0:
        axes.set_yscale("log")
    elif np.nanmin(values) >= 0:
        axes.set_ylim(0, 1.04 * axes.get_ylim()[1])  # markers need room above


def title_of(name: str) -> str:
    """Returns the name of an axis or a number in words: "layer 1 thickness"."""
    path = re.fullmatch(r"(\w*\.)?(?:layers\[(\d+)\]|(base))\.(.*?)(?:\[(\d+)\])?", name)
    quantity = quantity_of(name)
    if quantity is None:
        return name.replace("_", " ")
    if path is None:
        return quantity.meaning
    body, layer, base, _, entry = path.groups()
    place = base or f"layer {int(layer) + 1}"
    words = quantity.meaning.removeprefix("layer ") + (f" {int(entry) + 1}" if entry else "")
    return f"{(body or '').replace('.', ' ')}{place} {words}"


def label_of(number: "DataArray") -> str:
    """Returns a number of an axis with a common unit, a temperature also in °C."""
    value, unit = number.item(), number.attrs.get("units", "")
    if isinstance(value, str):
        return value
    if unit == "K":
        return kelvin(value)
    if unit in ("", "1", "rad"):
        return f"{value:.5g}" + (" rad" if unit == "rad" else "")
    unit, factor = unit_of(unit, abs(value))
    return f"{factor * value:.3g} {unit}"


def kelvin(value: float) -> str:
    """Returns a temperature [K] also in °C: "293.15 K (20 °C)"."""
    # 0.0 is added because -0.0 would be written with its sign.
    celsius = f"{round(value - ZERO_CELSIUS, 2) + 0.0:g}".replace("-", "−")
    return f"{value:.5g} K ({celsius} °C)"


def place_of(results: "Dataset") -> str:
    """Returns the numbers that all solves have alike: "mean pressure 400 kPa"."""
    fixed = [str(name) for name in results.coords if results[name].size == 1]
    fixed = [name for name in fixed if name not in ("seed", "time", "field_time", "x", "y")]
    return ", ".join(f"{title_of(name)} {label_of(results[name].squeeze())}" for name in fixed)
