"""Figures of a motion in time: the hysteresis loop, numbers over time, a film."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.display import unit_of, with_time, with_unit
from ..surfaces.surface import Surface
from .contact import LOOKS, draw_map, draw_profile
from .style import PAGE, entitle, figure_of, finished, mosaic_of, panels
from .sweeps import MOVING, common_numbers, draw_line, lines_of, plot_sweep, shown_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

    from ..sliding.result import CyclicSliding, TransientSliding

MOST_FRAMES = 12  # of a transient, in one figure


@finished
def plot_cycle(cycle: "CyclicSliding | Dataset", *, axes: Any = None) -> "Figure":
    """Returns a figure of the hysteresis loop, and of friction and contact area over the period.

    The loop is the friction over the displacement. Friction is positive where it opposes a motion
    along +x, or along `direction` of a scene.

    **Arguments:**

    - `cycle`: a solution of `slide_cycle` for a motion along x, or the results of a scene with
      [motion]: one line for each of its solves.
    - `axes`: three panels to draw in, by default of a new figure.
    """
    results = _over_time(cycle, ("friction", "contact_area"))
    loop, friction, area = panels(axes, "abc", (PAGE, 2.6))
    place, time, force, share = (
        shown_in(results, name)
        for name in ("surface_displacement", "time", "friction", "contact_area")
    )
    for line, look in lines_of(results, "time"):
        # The first time is drawn once more at the end of the period.
        whole = line.isel(time=np.append(np.arange(line.sizes["time"]), 0))
        whole = whole.assign_coords(time=np.linspace(0, 1, whole.sizes["time"]))
        # A motion that ends where it began makes a closed loop.
        steps = np.abs(np.diff(whole[place.name]))
        closed = steps[-1] <= 3 * np.max(steps[:-1], initial=0)
        draw_line(loop, whole if closed else line, place, force, **look)
        draw_line(friction, whole, time, force, **look)
        draw_line(area, whole, time, share, **look)
    for panel in (loop, friction):
        panel.axhline(0, color="0.6", linewidth=0.6)
        panel.set_ylabel(force.label)
    loop.set_xlabel(place.label.replace(" of the surface over the block", ""))
    for panel in (friction, area):
        panel.set_xlabel("time over the period")
    area.set(ylabel=share.label, ylim=(0, None))
    figure = figure_of(loop)
    entitle(figure, common_numbers(results))
    return figure


def plot_transient(
    transient: "TransientSliding | Dataset", names: Sequence[str] | None = None, *, axes: Any = None
) -> "Figure":
    """Returns a figure of friction, contact area, load and mean gap over time.

    Results of a seal have their leakage, or flow, as well. A surface that rests has no friction.
    Time is logarithmic if the last step is more than ten times as long as the first. After a long
    rest it is the time since the last start or stop, and lines at rest have dashes.

    **Arguments:**

    - `transient`: a solution of `slide_transient` for a motion along x, or the results of a scene
      with a transient motion.
    - `names`: of the numbers over time, in place of these.
    - `axes`: a panel for each name to draw in, by default of a new figure.
    """
    shown = (*(names or MOVING), "time_since_change")
    return plot_sweep(_over_time(transient, shown), names, "time", axes=axes)


@finished
def plot_film(
    moving: "CyclicSliding | TransientSliding | Dataset",
    surface: Surface,
    times: Sequence[int] | None = None,
    *,
    axes: Any = None,
) -> "Figure":
    """Returns a figure of the contact pressure at some times of a motion, in one scale.

    It is seen from the surface, over which the block moves. Pressure is white out of contact; its
    colours follow the square root. One time makes one frame of a film, with the scale of the whole
    motion.

    **Arguments:**

    - `moving`: a solution of `slide_cycle` or `slide_transient`, or anything else with `pressure`
      [Pa] over time and, unless it is a cycle, `field_times` [s].
    - `surface`: the surface that moves.
    - `times`: indices of the times whose pressure is stored; by default four, a quarter of the
      period T apart, or of a transient twelve at most, with the last.
    - `axes`: a panel for each time to draw in, by default of a new figure.
    """
    from matplotlib.colors import PowerNorm

    pressure, size = np.asarray(moving.pressure), np.asarray(surface.grid.size)
    words, base, colours, exponent, colour = LOOKS["pressure"]
    count, high = len(pressure), float(np.max(pressure))
    seconds = getattr(moving, "field_times", getattr(moving, "field_time", None))
    # Quarters show both directions of a motion to and fro.
    indices = [i * count // 4 for i in range(4)] if times is None else list(times)
    if seconds is not None and times is None:
        number = min(count, MOST_FRAMES)
        indices = [(i + 1) * count // number - 1 for i in range(number)]
    unit, factor = unit_of(base, high)
    label = f"{words} [{unit}]"
    is_map = surface.grid.ndim == 2
    tall = 2.0 * float(np.clip(size[-1] / size[0], 0.5, 2.0)) if is_map else 1.9
    rows = -(-len(indices) // 4)
    columns = -(-len(indices) // rows)
    whole = (PAGE * max(columns, 2) / 4, tall * rows)
    shown = panels(axes, mosaic_of(len(indices), columns), whole, sharex=True, sharey=True)
    loads = np.mean(pressure, axis=tuple(range(1, pressure.ndim)))
    changes = np.ptp(loads) > 1e-3 * np.max(loads)
    # One scale for all times: only then can frames be compared.
    norm = PowerNorm(exponent, 0, factor * high)
    image: Any = None
    for panel, i in zip(shown, indices, strict=True):
        if is_map:
            values = np.where(pressure[i] > 0, factor * pressure[i], np.nan)
            image = draw_map(panel, values, size, cmap=colours, norm=norm)
        else:
            draw_profile(panel, factor * pressure[i], size, color=colour)
            panel.set(ylabel=label, ylim=(0, 1.05 * factor * high))
        when = f"$t/T$ = {i / count:.3g}" if seconds is None else with_time(float(seconds[i]))
        panel.set_title(f"{when}, {with_unit(float(loads[i]), 'Pa')}" if changes else when)
        panel.label_outer()
    figure = figure_of(shown[0])
    if is_map:
        figure.colorbar(image, ax=shown, label=label, shrink=0.9)
    return figure


def _over_time(found: Any, names: Sequence[str]) -> "Dataset":
    """Returns results as they are, and the numbers over time of a solution as results."""
    import xarray

    if hasattr(found, "data_vars"):
        if "peak_friction_error" in found and "friction_error" not in found:
            found = found.assign(friction_error=found["peak_friction_error"])
        return found
    problem = found.problem
    moved = np.asarray(problem.displacement)
    if moved.ndim > 1:
        raise ValueError(
            f"a motion along x is needed; the displacement has the shape {moved.shape}."
        )
    # Over a period time has no unit.
    period = getattr(problem, "period", None)
    time = np.asarray(problem.times) / (1.0 if period is None else float(period))
    numbers = {name: ("time", np.asarray(getattr(found, name))) for name in names}
    numbers["surface_displacement"] = ("time", moved)
    about = {"units": "s" if period is None else "1"}
    return xarray.Dataset(numbers, {"time": ("time", time, about)})
