"""Figures of a motion in time: the hysteresis loop, friction and area over time, a film."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.display import unit_of, with_unit
from ..core.escaping import in_figure
from ..core.quantities import FIELDS
from ..surfaces.surface import Surface
from .contact import LOOKS, draw_map, draw_profile
from .style import PAGE, colours_of, finished, new_figure
from .words import label_of, title_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

    from ..sliding.result import CyclicSliding


@finished
def plot_cycle(cycle: "CyclicSliding | Dataset") -> "Figure":
    """Returns a figure of the hysteresis loop, and of friction and contact area over the period.

    The loop is the friction over the displacement. Friction is positive where it opposes a motion
    along +x, or along `direction` of a scene. The area is the sub-pixel one.

    **Arguments:**

    - `cycle`: a solution of `slide_cycle` for a motion along x, or the result of `Plan.run` for a
      scene with [motion]: one line for each of its solves.
    """
    lines = _over_time(cycle)
    figure = new_figure(PAGE, 2.6)
    loop, over_time, area = figure.subplots(1, 3)
    unit, factor = unit_of("m", max(float(np.ptp(moved)) for _, moved, *_ in lines))
    for (label, *line), colour in zip(lines, colours_of(len(lines)), strict=False):
        # The first time is drawn once more at the end of the period.
        place, friction, share = (np.append(values, values[0]) for values in line)
        times = np.linspace(0, 1, len(place))
        # A motion that ends where it began makes a closed loop.
        steps = np.abs(np.diff(place))
        ends = slice(None, None if steps[-1] <= 3 * np.max(steps[:-1], initial=0) else -1)
        loop.plot(factor * place[ends], friction[ends], color=colour, label=label or None)
        over_time.plot(times, friction, color=colour)
        area.plot(times, share, color=colour)
    for axes in (loop, over_time):
        axes.axhline(0, color="0.6", linewidth=0.6)
        axes.set_ylabel("friction coefficient")
    loop.set_xlabel(f"displacement [{unit}]")
    for axes in (over_time, area):
        axes.set_xlabel("time over the period")
    area.set(ylabel="contact area fraction", ylim=(0, None))
    return figure


@finished
def plot_film(
    cycle: "CyclicSliding | Dataset", surface: Surface, times: Sequence[int] | None = None
) -> "Figure":
    """Returns a figure of the contact pressure at some times of a cycle, in one scale.

    It is seen from the surface, over which the block moves. Pressure is white out of contact; its
    colours follow the square root. One time makes one frame of a film, with the scale of the whole
    cycle.

    **Arguments:**

    - `cycle`: a solution of `slide_cycle`, or the first of `kept_contact(results, index)`.
    - `surface`: the surface that moves.
    - `times`: numbers of the times; by default four, a quarter of the period T apart.
    """
    from matplotlib.colors import PowerNorm

    pressure, size = np.asarray(cycle.pressure), np.asarray(surface.grid.size)
    count, high = len(pressure), float(np.max(pressure))
    # Quarters show both directions of a motion to and fro.
    shown = [i * count // 4 for i in range(4)] if times is None else list(times)
    unit, factor = unit_of(FIELDS["pressure"].unit, high)
    label = f"{FIELDS['pressure'].meaning} [{unit}]"
    is_map = surface.grid.ndim == 2
    tall = 2.0 * float(np.clip(size[-1] / size[0], 0.5, 2.0)) if is_map else 1.9
    figure = new_figure(PAGE * max(len(shown), 2) / 4, tall)
    panels = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    colours, exponent, colour = LOOKS["pressure"]
    # One scale for all times: only then can frames be compared.
    norm = PowerNorm(exponent, 0, factor * high)
    image: Any = None
    for axes, i in zip(panels, shown, strict=True):
        if is_map:
            values = np.where(pressure[i] > 0, factor * pressure[i], np.nan)
            image = draw_map(axes, values, size, cmap=colours, norm=norm)
        else:
            draw_profile(axes, factor * pressure[i], size, color=colour)
            axes.set(ylabel=label, ylim=(0, 1.05 * factor * high))
        axes.set_title(f"$t/T$ = {i / count:.3g}")
        axes.label_outer()
    if is_map:
        figure.colorbar(image, ax=list(panels), label=label, shrink=0.9)
    return figure


def _over_time(cycle: Any) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """A label, and displacement, friction and area over time, of each solve."""
    # One solve in memory has a single line; results of a scene have one for each solve.
    if not hasattr(cycle, "dims"):
        moved = np.asarray(cycle.displacement)
        if moved.ndim > 1:
            raise ValueError(
                f"`cycle` has a displacement of shape {moved.shape}: a motion along x is needed."
            )
        return [("", moved, np.asarray(cycle.friction), np.asarray(cycle.contact_area))]
    if "time" not in cycle.dims:
        raise ValueError(
            "`cycle` holds steady sliding: results of a scene with [motion] are needed."
        )
    lines, names = [], ("surface_displacement", "friction", "contact_area")
    varied = [name for name in cycle["message"].dims if cycle.sizes[name] > 1]
    for index in np.ndindex(cycle["message"].shape):
        at = cycle.isel(dict(zip(cycle["message"].dims, index, strict=True)))
        if not np.all(np.isfinite(at["friction"])):
            continue  # failed, or not started
        words = [in_figure(f"{title_of(str(name))} {label_of(at[name])}") for name in varied]
        if "velocity" in varied:
            # The velocity is the last axis, and in a motion it decides the period.
            words[-1] = f"period {with_unit(float(at['period']), 's')}"
        lines.append((", ".join(words), *(at[name].values for name in names)))
    if not lines:
        raise ValueError("`cycle` holds no solve that succeeded.")
    return lines
