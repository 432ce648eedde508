"""Figures of a motion in time: the hysteresis loop, numbers over time, a film."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.display import time_unit, unit_of, with_time, with_unit
from ..core.escaping import in_figure
from ..core.quantities import CYCLE, FIELDS, TRANSIENT, in_brackets, quantity_of
from ..scenes.results import FLOWS, LEAKAGE
from ..surfaces.surface import Surface
from .contact import LOOKS, draw_map, draw_profile
from .inputs import DATASETS, FILM, check_drawn
from .style import PAGE, colours_of, draw_closed, entitle, finished, new_figure
from .words import fluid_of, label_of, place_of, title_of

_FRAMES = 12  # of what happens once, in one figure
_GEOMETRIC = 10.0  # times the first step, of the last one of a logarithmic axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import Dataset

    from ..sliding.result import CyclicSliding, TransientSliding


@finished
def plot_cycle(cycle: "CyclicSliding | Dataset") -> "Figure":
    """Returns a figure of the hysteresis loop, and of friction and contact area over the period.

    The loop is the friction over the displacement. Friction is positive where it opposes a motion
    along +x, or along `direction` of a scene. The area is the sub-pixel one. A band
    is the estimated error of the peak friction, where it is known: results of a scene have it, a
    solution after it was printed.

    **Arguments:**

    - `cycle`: a solution of `slide_cycle` for a motion along x, or the result of `Plan.run` for a
      scene with [motion]: one line for each of its solves.
    """
    check_drawn("cycle", cycle, CYCLE, DATASETS[CYCLE])
    names = "surface_displacement", "friction", "contact_area"
    lines = _over_time(cycle, CYCLE, *names, "peak_friction_error")
    figure = new_figure(PAGE, 2.6)
    loop, over_time, area = figure.subplots(1, 3)
    unit, factor = unit_of("m", max(float(np.ptp(line[names[0]])) for line in lines))
    for line, colour in zip(lines, colours_of(len(lines)), strict=False):
        # The first time is drawn once more at the end of the period.
        place, friction, share = (np.append(line[name], line[name][0]) for name in names)
        times = np.linspace(0, 1, len(place))
        # A motion that ends where it began makes a closed loop.
        steps = np.abs(np.diff(place))
        ends = slice(None, None if steps[-1] <= 3 * np.max(steps[:-1], initial=0) else -1)
        of_loop = factor * place[ends], friction[ends]
        loop.plot(*of_loop, color=colour, label=line["label"] or None)
        over_time.plot(times, friction, color=colour)
        error, what = line["peak_friction_error"], "error of the peak friction"
        _draw_band(loop, *of_loop, error, colour, what)
        _draw_band(over_time, times, friction, error, colour, what)
        area.plot(times, share, color=colour)
    for axes in (loop, over_time):
        axes.axhline(0, color="0.6", linewidth=0.6)
        axes.set_ylabel("friction coefficient")
    loop.set_xlabel(f"displacement [{unit}]")
    for axes in (over_time, area):
        axes.set_xlabel("time over the period")
    area.set(ylabel="contact area fraction", ylim=(0, None))
    entitle(figure, _fixed(cycle))
    return figure


@finished
def plot_transient(history: "TransientSliding | Dataset") -> "Figure":
    """Returns a figure of friction, contact area, load and mean gap over time.

    A surface that rests has no friction. Time is logarithmic if the last step is more than ten
    times as long as the first. Leakage, or flows, are drawn, too, if results have some that are not
    0; a triangle at the bottom is a time at which the gap is closed. Bands are the estimated
    errors, where they are known: results of a scene have them, a solution after it was printed.

    **Arguments:**

    - `history`: a solution of `slide_transient` for a motion along x, or the result of `Plan.run`
      for a scene with [motion] `once = true`: one line for each of its solves.
    """
    check_drawn("history", history, TRANSIENT, DATASETS[TRANSIENT])
    names = ["friction", "contact_area", "load", "mean_gap"]
    results: Any = history
    if hasattr(history, "dims"):
        flows = LEAKAGE if LEAKAGE[0] in results else FLOWS
        names += [n for n in flows if n in results and np.any(results[n] > 0)]
    ends = [name + end for name in names for end in ("", "_error")]
    lines = _over_time(history, TRANSIENT, "time", "surface_displacement", *ends)
    if not np.any(lines[0]["surface_displacement"]):
        names = names[1:]
    columns = len(names) if len(names) < 5 else 3
    rows = -(-len(names) // columns)
    figure = new_figure(PAGE, 2.3 * rows)
    panels = [figure.add_subplot(rows, columns, i + 1) for i in range(len(names))]
    times = lines[0]["time"]
    unit, factor = time_unit(times[-1])
    for axes, name in zip(panels, names, strict=True):
        quantity, flows = quantity_of(name), name in (*FLOWS, *LEAKAGE)
        assert quantity is not None
        symbol, scale = quantity.unit, 1.0
        if symbol in ("m", "Pa"):
            symbol, scale = unit_of(symbol, max(float(np.nanmax(line[name])) for line in lines))
        for line, colour in zip(lines, colours_of(len(lines)), strict=False):
            values, error = line[name], line[f"{name}_error"]
            closed = flows & (values == 0)  # a logarithm has no 0
            known = np.isfinite(values) & ~closed  # a flow at some times only
            shown = factor * times[known], scale * values[known]
            # What is known at some times only is not joined.
            style = {"linestyle": "none", "marker": "o", "markersize": 3} if flows else {}
            axes.plot(*shown, color=colour, label=line["label"] or None, **style)
            error = None if error is None else scale * error[known]
            _draw_band(axes, *shown, error, colour, "estimated error")
            if np.any(closed):
                draw_closed(axes, factor * times[closed], colour)
        axes.set(xlabel=f"time [{unit}]", ylabel=name.replace("_", " ") + in_brackets(symbol))
        if flows:
            axes.set_yscale("log")
        elif name != "friction":
            axes.set_ylim(0, None)
        if len(times) > 1 and times[-1] - times[-2] > _GEOMETRIC * times[0]:
            axes.set_xscale("log")
    entitle(figure, _fixed(history))
    if any(name in LEAKAGE for name in names):
        entitle(figure, fluid_of(results))
    return figure


@finished
def plot_film(
    cycle: "CyclicSliding | TransientSliding | Dataset",
    surface: Surface,
    times: Sequence[int] | None = None,
) -> "Figure":
    """Returns a figure of the contact pressure at some times of a motion, in one scale.

    It is seen from the surface, over which the block moves. Pressure is white out of contact; its
    colours follow the square root. One time makes one frame of a film, with the scale of the whole
    motion.

    **Arguments:**

    - `cycle`: a solution of `slide_cycle` or `slide_transient`, or the first of
      `kept_contact(results, index)`.
    - `surface`: the surface that moves.
    - `times`: numbers of the times, of a history among those whose fields are kept; by default
      four, a quarter of the period T apart, or of the kept ones twelve at most, with the last.
    """
    from matplotlib.colors import PowerNorm

    check_drawn("cycle", cycle, CYCLE, TRANSIENT, FILM)
    pressure, size = np.asarray(cycle.pressure), np.asarray(surface.grid.size)
    count, high = len(pressure), float(np.max(pressure))
    # Quarters show both directions of a motion to and fro.
    shown = [i * count // 4 for i in range(4)] if times is None else list(times)
    once = getattr(cycle, "field_time" if hasattr(cycle, "dims") else "field_times", None)
    if once is not None and times is None:
        number = min(count, _FRAMES)
        shown = [(i + 1) * count // number - 1 for i in range(number)]
    unit, factor = unit_of(FIELDS["pressure"].unit, high)
    label = f"{FIELDS['pressure'].meaning} [{unit}]"
    is_map = surface.grid.ndim == 2
    tall = 2.0 * float(np.clip(size[-1] / size[0], 0.5, 2.0)) if is_map else 1.9
    rows = -(-len(shown) // 4)
    columns = -(-len(shown) // rows)
    figure = new_figure(PAGE * max(columns, 2) / 4, tall * rows)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.remove()
    colours, exponent, colour = LOOKS["pressure"]
    loads = np.mean(pressure, axis=tuple(range(1, pressure.ndim)))
    changes = np.ptp(loads) > 1e-3 * np.max(loads)
    # One scale for all times: only then can frames be compared.
    norm = PowerNorm(exponent, 0, factor * high)
    image: Any = None
    panels = panels[: len(shown)]
    for axes, i in zip(panels, shown, strict=True):
        if is_map:
            values = np.where(pressure[i] > 0, factor * pressure[i], np.nan)
            image = draw_map(axes, values, size, cmap=colours, norm=norm)
        else:
            draw_profile(axes, factor * pressure[i], size, color=colour)
            axes.set(ylabel=label, ylim=(0, 1.05 * factor * high))
        when = f"$t/T$ = {i / count:.3g}" if once is None else with_time(float(once[i]))
        axes.set_title(f"{when}, {with_unit(float(loads[i]), 'Pa')}" if changes else when)
        axes.label_outer()
    if is_map:
        figure.colorbar(image, ax=list(panels), label=label, shrink=0.9)
    return figure


def _fixed(found: Any) -> str:
    """The numbers that are the same in all solves of results of a scene."""
    if not hasattr(found, "dims"):
        return ""
    return in_figure(
        place_of(found.squeeze([d for d in found["message"].dims if found.sizes[d] == 1]))
    )


def _draw_band(axes: "Axes", x: Any, values: Any, error: Any, colour: Any, what: str) -> None:
    """Draws a band of an error around a line, if the error is known."""
    if error is not None:
        ends, label = (values - error, values + error), f"band: ± {what}"
        axes.fill_between(x, *ends, color=colour, alpha=0.2, linewidth=0, label=label)


def _over_time(found: Any, kind: str, *names: str) -> list[dict[str, Any]]:
    """A label, and the numbers of these names over time, of each solve; None if there is none."""
    argument = {CYCLE: "cycle", TRANSIENT: "history"}[kind]
    # One solve in memory has a single line; results of a scene have one for each solve.
    if not hasattr(found, "dims"):
        moved = np.asarray(found.displacement if kind == CYCLE else found.problem.displacement)
        if moved.ndim > 1:
            raise ValueError(
                f"`{argument}` has a displacement of shape {moved.shape}: a motion along x is "
                "needed."
            )
        own = {"surface_displacement": moved, "time": getattr(found, "times", None)}
        # Errors would take two more contacts: those that are known are drawn.
        own |= {n: found.kept.numbers.get(n) for n in names if n.endswith("_error")}
        values = {n: own[n] if n in own else getattr(found, n) for n in names}
        known = {n: None if value is None else np.asarray(value) for n, value in values.items()}
        return [{"label": "", **known}]
    lines = []
    varied = [name for name in found["message"].dims if found.sizes[name] > 1]
    for index in np.ndindex(found["message"].shape):
        at = found.isel(dict(zip(found["message"].dims, index, strict=True)))
        # What happens once is known up to a step that failed.
        enough = np.any if kind == TRANSIENT else np.all
        if not enough(np.isfinite(at["friction"])):
            continue  # failed, or not started
        words = [in_figure(f"{title_of(str(name))} {label_of(at[name])}") for name in varied]
        if "velocity" in varied:
            # The velocity is the last axis, and in a motion it decides the period.
            words[-1] = f"period {with_unit(float(at['period']), 's')}"
        known = {name: at[name].values if name in at else None for name in names}
        lines.append({"label": ", ".join(words), **known})
    if not lines:
        raise ValueError(f"`{argument}` holds no solve that succeeded.")
    return lines
