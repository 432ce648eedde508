"""The figures of a page, drawn by Bokeh in the browser: only numbers travel when a knob turns."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    FactorRange,
    Legend,
    LinearColorMapper,
    LogAxis,
    LogTicker,
    Range1d,
)
from bokeh.palettes import magma, viridis
from bokeh.plotting import figure
from bokeh.transform import dodge

from ..core.display import unit_of
from ..plot.style import COLOURS
from .knobs import Knob
from .model import Contact, Curves, Derivatives

# Pixels: of a figure and of what is around its frame; to the right, also with a bar of colours.
HEIGHT, ABOVE, BELOW, LEFT, RIGHT, BAR = 240, 28, 46, 48, 18, 62
LENGTHS = {1e3: "rad/mm", 1e6: "rad/µm", 1e9: "rad/nm"}
BLUE, ORANGE, GREEN = COLOURS[:3]
GREY, INK = "#8a8f98", "#2b2f36"
TINTS = ("#9cc3e0", "#f3cf9b", "#a9d8c6", "#e3bfd6", "#f5e2a8", "#c5dff1")  # of COLOURS
BASE = "#c9cdd3"
LARGEST_MAP = 512  # points drawn along an edge
ASIDE = 0.995  # of the points lie within a scale


def new_figure(
    title: str, x: str, y: str, *, frame: float = 0.0, right: int = RIGHT, **more: Any
) -> Any:
    """An empty figure of the page's style; its frame may be `frame` times as wide as high."""
    tools = "pan,wheel_zoom,box_zoom,reset,save"
    more = {"height": HEIGHT, "sizing_mode": "stretch_width", "min_width": 240, **more}
    if frame:
        wide = round(min(max(frame, 1 / 3), 2) * (HEIGHT - ABOVE - BELOW))
        more |= {"sizing_mode": "fixed", "width": wide + LEFT + right, "min_border_left": LEFT}
    found: Any = figure(
        title=title,
        x_axis_label=x,
        y_axis_label=y,
        tools=tools,
        toolbar_location="above",
        **more,
    )
    found.toolbar.autohide, found.toolbar.logo = True, None
    found.title.text_font_size, found.title.text_color = "12px", INK
    for axis in found.axis:
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "11px"
        axis.axis_label_text_font_style, axis.axis_label_text_color = "normal", INK
        axis.minor_tick_line_color = axis.axis_line_color = GREY
        if isinstance(axis, LogAxis):
            axis.ticker = LogTicker(mantissas=[1, 2, 5], desired_num_ticks=4)
    found.grid.grid_line_color, found.outline_line_color = "#eceef1", None
    found.min_border_top, found.min_border_bottom = ABOVE, BELOW
    found.min_border_right = right
    return found


def new_source(*names: str) -> Any:
    """Columns of these names, empty."""
    empty: Any = {name: [] for name in names}  # an empty array of numbers is no array of colours
    return ColumnDataSource(empty)


def send(source: Any, **columns: Any) -> None:
    """Draws these columns, unless they are drawn: each figure costs the browser some 20 ms."""
    if not all(np.array_equal(source.data[name], column) for name, column in columns.items()):
        source.data = columns


class Lines:
    """A curve of the scene, that of a pinned one, and the point of the contact."""

    def __init__(self, title: str, x: str, y: str, colour: str, **more: Any):
        self.figure = new_figure(title, x, y, **more)
        if more.get("y_axis_type") != "log":
            self.figure.y_range.start = 0
        self._line, self._pinned, self._point = (new_source("x", "y") for _ in range(3))
        self.figure.line("x", "y", source=self._pinned, color=GREY, line_dash=(5, 4), line_width=2)
        self.figure.line("x", "y", source=self._line, color=colour, line_width=2.2)
        self.figure.scatter(
            "x", "y", source=self._point, size=9, fill_color=colour, line_color="white"
        )

    def show(self, x: np.ndarray, y: np.ndarray) -> None:
        send(self._line, x=x, y=y)

    def mark(self, x: float, y: float) -> None:
        """Moves the point."""
        send(self._point, x=[x], y=[y])

    def pin(self, x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray) -> None:
        """Draws a curve to compare with; an empty one is none."""
        send(self._pinned, x=x, y=y)


def _both(lines: Sequence[Lines], curves: Curves, pinned: Curves | None):
    """How each of `lines` shows and pins, with the curves to be shown and pinned."""
    none = Curves(*(np.zeros(0),) * len(Curves._fields))
    yield [line.show for line in lines], curves
    yield [line.pin for line in lines], pinned or none


class Response:
    """Composite modulus and loss tangent against the wavenumber, the highest being `highest`."""

    def __init__(self, highest: float):
        self._unit = max((unit for unit in LENGTHS if unit <= highest), default=1e3)
        q = f"wavenumber q [{LENGTHS[self._unit]}]"
        log = {"x_axis_type": "log"}
        self.modulus = Lines("Composite modulus", q, "|E| [MPa]", GREEN, y_axis_type="log", **log)
        self.loss = Lines("Composite loss tangent", q, "tan δ [1]", GREEN, **log)

    def show(self, curves: Curves, pinned: Curves | None) -> None:
        for lines, draw in _both((self.modulus, self.loss), curves, pinned):
            q = draw.q / self._unit
            lines[0](q, draw.modulus / 1e6)
            lines[1](q, draw.loss_tangent)


class Sweep:
    """Friction and contact area against velocity: line by mean field, point by contact."""

    def __init__(self):
        v = "velocity [m/s]"
        log = {"x_axis_type": "log"}
        self.friction = Lines("Friction: mean field, • contact", v, "μ [1]", BLUE, **log)
        self.area = Lines("Contact area: mean field, • contact", v, "A/A₀ [%]", ORANGE, **log)

    def show(self, curves: Curves, pinned: Curves | None) -> None:
        for lines, draw in _both((self.friction, self.area), curves, pinned):
            lines[0](draw.speed, draw.friction)
            lines[1](draw.speed, 100 * draw.contact_area)

    def mark(self, contact: Contact) -> None:
        self.friction.mark(contact.velocity, float(contact.sliding.friction))
        self.area.mark(contact.velocity, 100 * float(contact.sliding.contact_area_smooth))


class Bars:
    """What a step of each knob changes."""

    def __init__(self, knobs: Sequence[Knob]):
        self._labels = [f"{knob.label} {knob.step}" for knob in knobs]
        factors = FactorRange(factors=self._labels[::-1], range_padding=0.05)
        self.figure = new_figure("Change by a step of each slider", "change [%]", "",
                                 y_range=factors)  # fmt: skip
        self.figure.yaxis.axis_label = None
        self.figure.yaxis.major_label_text_font_size = "10px" if len(knobs) < 13 else "9px"
        self.figure.ygrid.grid_line_color = None
        self._source = new_source("knob", "friction", "area")
        self._glyphs = [
            self.figure.hbar(
                y=dodge("knob", shift, range=factors), right=name, height=0.34, color=colour,
                source=self._source,
            )
            for name, colour, shift in (("friction", BLUE, 0.19), ("area", ORANGE, -0.19))
        ]  # fmt: skip
        names = ("friction", "contact area")
        items = [(name, [glyph]) for name, glyph in zip(names, self._glyphs, strict=True)]
        legend: Any = Legend(items=items, orientation="horizontal",
                        label_text_font_size="10px", border_line_color=None, glyph_height=10,
                        background_fill_alpha=0.0)  # fmt: skip
        legend.padding = legend.margin = 0
        self.figure.add_layout(legend, "above")

    def show(self, derivatives: Derivatives) -> None:
        self._source.data = {
            "knob": self._labels,
            "friction": derivatives.friction,
            "area": derivatives.contact_area,
        }
        self._alpha(1.0)

    def fade(self) -> None:
        """Shows that the bars belong to an earlier point."""
        self._alpha(0.35)

    def _alpha(self, alpha: float) -> None:
        for glyph in self._glyphs:
            glyph.glyph.update(fill_alpha=alpha, line_alpha=alpha)


class Map:
    """A field of the contact, as a map or a profile; left white where there is none."""

    def __init__(self, title: str, base: str, palette: Sequence[str], size: np.ndarray):
        self._base, self._title, self._flat = base, title, len(size) == 1
        unit, self._factor = unit_of("m", float(np.max(size)))
        if self._flat:
            self.figure = new_figure(title, f"x [{unit}]", "")
            self._source = new_source("x", "y")
            self.figure.line("x", "y", source=self._source, color=palette[len(palette) // 2])
            return
        self.figure = new_figure(
            title, f"x [{unit}]", f"y [{unit}]", frame=float(size[0] / size[1]), right=BAR,
            x_range=Range1d(start=0, end=self._factor * size[0]),
            y_range=Range1d(start=0, end=self._factor * size[1]),
        )  # fmt: skip
        self.figure.grid.grid_line_color = None
        self._mapper = LinearColorMapper(palette=palette, nan_color="white", low=0, high=1)
        self._source = new_source("image")
        self.figure.image(
            "image", source=self._source, x=0, y=0, dw=self._factor * size[0],
            dh=self._factor * size[1], color_mapper=self._mapper,
        )  # fmt: skip
        bar = ColorBar(color_mapper=self._mapper, width=10, padding=4, bar_line_color=None,
                       major_label_text_font_size="10px")  # fmt: skip
        self.figure.add_layout(bar, "right")

    def show(self, field: np.ndarray, size: np.ndarray) -> None:
        known = field[np.isfinite(field)]
        high = float(np.quantile(known, ASIDE)) if known.size else 1.0
        unit, scale = unit_of(self._base, high)
        self.figure.title.text = f"{self._title} [{unit}]"
        if self._flat:
            x = self._factor * size[0] * np.arange(len(field)) / len(field)
            self._source.data = {"x": x, "y": scale * np.nan_to_num(field)}
            return
        step = -(-max(field.shape) // LARGEST_MAP)
        self._mapper.update(low=0, high=scale * high or 1.0)
        self._source.data = {"image": [(scale * field[::step, ::step].T).astype(np.float32)]}


PALETTES = {"pressure": viridis(256), "gap": magma(256)}
