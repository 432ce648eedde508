"""The figures of a page, drawn in the browser by Bokeh: only numbers travel when a slider moves."""

from typing import Any

import bokeh.models as bokeh
import numpy as np
import panel as pn
from bokeh import palettes
from bokeh.plotting import figure
from contourpy import contour_generator

from ..core.display import unit_of
from ..plot import plot_cycle, plot_film, plot_sliding, plot_transient
from ..plot.contact import LOOKS, level_of
from ..plot.sweeps import title_of
from ..surfaces import Surface
from .curves import Curve, Curves

WIDTHS: dict[str, Any] = {"sizing_mode": "stretch_width", "min_width": 280}
SHOWN_SHARE = 0.995  # of the points within a scale of colours
FINEST = 256  # points of a map along an edge


def new_figure(title: str, x: str, y: str, **more: Any) -> Any:
    """Returns an empty figure in the style of the page."""
    tools = "pan,wheel_zoom,box_zoom,reset,save"
    new: Any = figure(title=title, x_axis_label=x, y_axis_label=y, tools=tools, **WIDTHS, **more)
    new.toolbar.autohide, new.toolbar.logo = True, None
    new.title.text_font_size = "12px"
    new.axis.axis_label_text_font_style = "normal"
    new.grid.grid_line_color, new.outline_line_color = "#eceef1", None
    return new


def source(*names: str) -> Any:
    """Returns an empty source of data."""
    return bokeh.ColumnDataSource({name: [] for name in names})


class Lines:
    """Friction or contact area over velocity: the mean field, a pinned one, and the contact."""

    def __init__(self, name: str, colour: str):
        self.name, title = name, f"{title_of(name)}: mean field, ● contact"
        log: Any = {"x_axis_type": "log", "y_range": bokeh.DataRange1d(start=0)}
        self.figure = new_figure(title, "sliding velocity [m/s]", "", height=230, **log)
        self.curve, self.pinned, self.contact = (source("x", "y") for _ in range(3))
        self.figure.line("x", "y", source=self.pinned, color="gray", line_dash="dashed", width=2)
        self.figure.line("x", "y", source=self.curve, color=colour, width=2)
        self.figure.scatter("x", "y", source=self.contact, color=colour, size=9)

    def show(self, curve: Curve, pinned: Curve | None) -> None:
        """Draws the curve, and the pinned one if there is one."""
        for drawn, one in ((self.curve, curve), (self.pinned, pinned)):
            x, y = ([], []) if one is None else (one.velocity, getattr(one, self.name))
            drawn.data = {"x": x, "y": y}


class Map:
    """A field of the contact over a period; white where there is none."""

    def __init__(self, name: str, surface: Surface):
        self.words, self.base, colours, *_ = LOOKS[name]
        palette = getattr(palettes, colours)(256)
        unit, factor = unit_of("m", float(np.max(surface.grid.size)))
        self.size = width, height = factor * np.asarray(surface.grid.size)
        places = f"x [{unit}]", f"y [{unit}]"
        ranges: Any = {"x_range": (0, width), "y_range": (0, height), "match_aspect": True}
        self.figure = new_figure(self.words, *places, aspect_ratio=0.9, max_width=420, **ranges)
        self.image, self.outline = source("image"), source("xs", "ys")
        self.colours = bokeh.LinearColorMapper(palette=palette, low=0, high=1, nan_color="white")
        whole = {"x": 0, "y": 0, "dw": width, "dh": height}
        self.figure.image("image", source=self.image, color_mapper=self.colours, **whole)
        self.figure.multi_line(source=self.outline, color="black", line_width=0.7)
        self.figure.add_layout(bokeh.ColorBar(color_mapper=self.colours, height=10), "below")

    def show(self, values: np.ndarray) -> None:
        """Draws values [SI]."""
        low, high = np.nanquantile(values, [1 - SHOWN_SHARE, SHOWN_SHARE])
        low = min(low, 0.0)
        unit, factor = unit_of(self.base, max(-low, high))
        self.figure.title.text = f"{self.words} [{unit}]"
        self.colours.update(low=factor * low, high=factor * high)
        self.image.data = {"image": [factor * coarse(values).T]}

    def show_outline(self, level: np.ndarray) -> None:
        """Draws lines where a level crosses 0."""
        level = coarse(level)
        x, y = (
            (np.arange(n) + 0.5) * edge / n for n, edge in zip(level.shape, self.size, strict=True)
        )
        lines: Any = contour_generator(x, y, level.T).lines(0.0)
        self.outline.data = {"xs": [at[:, 0] for at in lines], "ys": [at[:, 1] for at in lines]}


def coarse(values: np.ndarray) -> np.ndarray:
    """Returns the values at no more points than a map shows."""
    step = -(-max(values.shape) // FINEST)
    return values[::step, ::step]


class Maps:
    """Heights with the outline of the contact, pressure and gap."""

    def __init__(self, surface: Surface):
        self.maps = {name: Map(name, surface) for name in LOOKS}
        heights = np.asarray(surface.heights)
        self.maps["heights"].show(heights - np.mean(heights))

    def show(self, found: Any) -> None:
        """Draws a contact."""
        pressure, gap, level = np.asarray(found.pressure), np.asarray(found.gap), level_of(found)
        touches = level > 0
        self.maps["heights"].show_outline(level)
        self.maps["pressure"].show(np.where(touches, pressure, np.nan))
        self.maps["gap"].show(gap if np.all(touches) else np.where(touches, np.nan, gap))


def pictures_of(curves: Curves, found: Any) -> list[pn.pane.Matplotlib]:
    """Returns pictures of a motion, or of a profile."""
    if curves.kind == "cycle":
        figures = plot_cycle(found), plot_film(found, curves.surface)
    elif curves.kind == "transient":
        figures = plot_transient(found), plot_film(found, curves.surface)
    else:
        figures = (plot_sliding(found, curves.surface),)
    how: Any = {"dpi": 160, "max_width": 900, "sizing_mode": "scale_width", "margin": 0}
    return [pn.pane.Matplotlib(one, **how) for one in figures]
