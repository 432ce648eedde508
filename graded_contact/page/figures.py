"""The figures of a page, drawn by Bokeh in the browser: only numbers travel when a slider moves."""

from collections.abc import Sequence
from typing import Any

import bokeh.models as bokeh
import numpy as np
from bokeh.palettes import cividis, magma, plasma, viridis
from bokeh.plotting import figure
from bokeh.transform import dodge

from ..core.display import unit_of
from ..core.quantities import FIELDS
from ..plot.style import COLOURS
from .knobs import Knob
from .model import Curve, Derivatives

# Pixels: of a figure, of the map, around a frame, and at the right of the map, where its bar is.
HEIGHT, TALL, ABOVE, BELOW, LEFT, RIGHT, BAR = 220, 440, 28, 46, 48, 18, 62
BLUE, ORANGE, GREEN = COLOURS[:3]
GREY, INK = "#8a8f98", "#2b2f36"
PALETTES = {
    "pressure": viridis(256), "gap": magma(256), "displacement": plasma(256),
    "heights": cividis(256),
}  # fmt: skip
FINEST_MAP = 512  # points drawn along an edge
SCALE_SHARE = 0.995  # of the points within a scale of colours

ASPECT = 1.5  # of the figure of the block
LAYERS = ("#9cc3e0", "#f3cf9b", "#a9d8c6", "#e3bfd6", "#f5e2a8", "#c5dff1")  # tints of COLOURS
BASE_COLOURS = {"half_space": "#c9cdd3", "rigid": "#6b7078", "free": "#ffffff"}
ROAD = "#4a4f57"
FINER = 8  # points drawn for one of the road
LABELLED = 0.09  # of the height drawn: thinner layers have no label
SLAB = ("top", "bottom", "left", "right")


def _page_figure(title: str, x: str, y: str, *, right: int = RIGHT, **more: Any) -> Any:
    """An empty figure of the page's style."""
    more = {"height": HEIGHT, "sizing_mode": "stretch_width", **more}
    new: Any = figure(
        title=title, x_axis_label=x, y_axis_label=y, toolbar_location="above",
        tools="pan,wheel_zoom,box_zoom,reset,save", **more,
    )  # fmt: skip
    new.toolbar.autohide, new.toolbar.logo = True, None
    new.title.text_font_size, new.title.text_color = "12px", INK
    for axis in new.axis:
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "11px"
        axis.axis_label_text_font_style, axis.axis_label_text_color = "normal", INK
        axis.minor_tick_line_color = axis.axis_line_color = GREY
        if isinstance(axis, bokeh.LogAxis):
            axis.ticker = bokeh.LogTicker(mantissas=[1, 2, 5], desired_num_ticks=4)
    new.grid.grid_line_color, new.outline_line_color = "#eceef1", None
    new.min_border_top, new.min_border_bottom, new.min_border_right = ABOVE, BELOW, right
    return new


def _new_source(*names: str) -> Any:
    empty: Any = {name: [] for name in names}  # an empty array of numbers is no array of colours
    return bokeh.ColumnDataSource(empty)


def _send(source: Any, **columns: Any) -> None:
    """Draws columns that differ from those drawn: each figure costs the browser some 20 ms."""
    if not all(np.array_equal(source.data[name], column) for name, column in columns.items()):
        source.data = columns


class CurveFigure:
    """A curve of the scene, the pinned one, and the point of the contact.

    **Arguments:**

    - `name`: of the curve in `Model.curves`.
    - `title`, `x`, `y`: words.
    - `colour`: of the curve.
    - `scale`: units of the axes [SI].
    - `log`: whether the ordinate is logarithmic.
    """

    def __init__(
        self, name: str, title: str, x: str, y: str, colour: str, scale: tuple, log: bool = False
    ):
        self.name, self._scale = name, scale
        ordinate: Any = {"y_axis_type": "log"} if log else {"y_range": bokeh.DataRange1d(start=0)}
        self.figure = _page_figure(title, x, y, x_axis_type="log", **ordinate)
        self._line, self._pinned = (_new_source("x", "y") for _ in range(2))
        self._point = _new_source("x", "y", "low", "high")
        self.figure.line("x", "y", source=self._pinned, color=GREY, line_dash=(5, 4), line_width=2)
        self.figure.line("x", "y", source=self._line, color=colour, line_width=2.2)
        style = {"fill_color": colour, "line_color": "white"}
        bar = {"x0": "x", "x1": "x", "y0": "low", "y1": "high"}
        self.figure.segment(source=self._point, color=colour, line_width=2, **bar)
        self.figure.scatter("x", "y", source=self._point, size=9, **style)

    def show(self, curves: dict[str, Curve], pinned: dict[str, Curve] | None) -> None:
        """Draws the curve, and a pinned one if there is one."""
        for source, data in ((self._line, curves), (self._pinned, pinned)):
            x = y = np.zeros(0)
            if data is not None:
                x, y = data[data[self.name].along].numbers, data[self.name].numbers
            _send(source, x=x / self._scale[0], y=y / self._scale[1])

    def mark(self, x: float, y: float, error: float) -> None:
        """Moves the point to an abscissa, and an ordinate with a bar of its error [SI]."""
        ends = {"y": y, "low": y - error, "high": y + error}
        ends = {name: [end / self._scale[1]] for name, end in ends.items()}
        _send(self._point, x=[x / self._scale[0]], **ends)


def new_lines(waves: tuple[float, float], heated: bool) -> dict[str, CurveFigure]:
    """Returns the figures of the curves of `Model.curves`, by name.

    **Arguments:**

    - `waves`: lowest and highest wavenumber [rad/m].
    - `heated`: whether the contact has the heat of friction, which the curves leave out.
    """
    units = {1e3: "rad/mm", 1e6: "rad/µm", 1e9: "rad/nm"}
    wave = max((unit for unit in units if unit <= waves[1]), default=1e3)
    q, v = f"wavenumber q [{units[wave]}]", "velocity [m/s]"
    theory = "mean field without heat" if heated else "mean field"
    friction, area = f"Friction: {theory}, • contact", f"Contact area: {theory}, • contact"
    lines = (
        CurveFigure("modulus", "Composite modulus", q, "|E| [MPa]", GREEN, (wave, 1e6), log=True),
        CurveFigure("loss_tangent", "Composite loss tangent", q, "tan δ", GREEN, (wave, 1)),
        CurveFigure("friction", friction, v, "μ", BLUE, (1, 1)),
        CurveFigure("contact_area", area, v, "A/A₀ [%]", ORANGE, (1, 0.01)),
    )
    for line in lines[:2]:  # two or three decades
        line.figure.xaxis.ticker = bokeh.FixedTicker(
            ticks=log_ticks(waves[0] / wave, waves[1] / wave)
        )
        line.figure.xaxis.formatter = bokeh.BasicTickFormatter()
    return {line.name: line for line in lines}


def log_ticks(low: float, high: float) -> list[float]:
    """Returns numbers for the labels of a logarithmic axis: three, two or one for each decade."""
    decades = np.log10(high / low)
    each = (1, 2, 5) if decades <= 2.5 else (1, 3) if decades <= 4 else (1,)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [float(f"{k}e{power}") for power in powers for k in each]


class Bars:
    """The change by a step of each knob."""

    def __init__(self, knobs: Sequence[Knob], heated: bool):
        self._factors = factors = bokeh.FactorRange(range_padding=0.05)
        title = "Change by a step of each slider" + (" (not with heat)" if heated else "")
        self.figure = new = _page_figure(title, "change [%]", "", y_range=factors, height=260)
        new.yaxis.axis_label = None
        new.yaxis.major_label_text_font_size = "10px" if len(knobs) < 13 else "9px"
        new.ygrid.grid_line_color = None
        self._source = _new_source("knob", *Derivatives._fields)
        pairs = zip(Derivatives._fields, (BLUE, ORANGE), (0.19, -0.19), strict=True)
        self._glyphs = [
            new.hbar(
                y=dodge("knob", shift, range=factors), right=name, height=0.34, color=colour,
                source=self._source, legend_label=name.replace("_", " "),
            )
            for name, colour, shift in pairs
        ]  # fmt: skip
        legend = new.legend[0]
        new.add_layout(legend, "above")
        legend.update(
            orientation="horizontal", label_text_font_size="10px", border_line_color=None,
            glyph_height=10, background_fill_alpha=0.0, padding=0, margin=0,
        )  # fmt: skip

    def show(self, labels: list[str], derivatives: Derivatives) -> None:
        """Draws the changes, by labels of the knobs with their steps."""
        if self._factors.factors != labels[::-1]:
            self._factors.factors = labels[::-1]
        self._source.data = {"knob": labels, **derivatives._asdict()}
        self.fade(1.0)

    def fade(self, alpha: float) -> None:
        """Draws the bars with this opacity: less than 1 if they belong to an earlier point."""
        for glyph in self._glyphs:
            glyph.glyph.update(fill_alpha=alpha, line_alpha=alpha)


class Map:
    """A field of the contact, as a map or a profile; NaN is white in a map."""

    def __init__(self, size: np.ndarray):
        self._size = size
        unit, self._factor = unit_of("m", float(np.max(size)))
        if len(size) == 1:
            self.figure = _page_figure("", f"x [{unit}]", "", height=TALL)
            self._source = _new_source("x", "y")
            self._line = self.figure.line("x", "y", source=self._source)
            return
        wide, high = (self._factor * size).tolist()
        frame = round(min(max(wide / high, 1 / 3), 2) * (TALL - ABOVE - BELOW))
        ranges = {axis: bokeh.DataRange1d(range_padding=0) for axis in ("x_range", "y_range")}
        self.figure = _page_figure(
            "", f"x [{unit}]", f"y [{unit}]", right=BAR, height=TALL, max_width=frame + LEFT + BAR,
            match_aspect=True, **ranges,
        )  # fmt: skip
        # Where there is less room the figure is less high: with another shape of its frame the axes
        # would go on beyond the field.
        self.figure.js_on_change("inner_width", bokeh.CustomJS(
            code=f"cb_obj.height = Math.round(cb_obj.inner_width * {(TALL - ABOVE - BELOW) / frame}"
            f" + {ABOVE + BELOW})"
        ))  # fmt: skip
        self.figure.grid.grid_line_color = None
        self._mapper = bokeh.LinearColorMapper(
            palette=PALETTES["gap"], nan_color="white", low=0, high=1
        )
        self._source = _new_source("image")
        place = {"x": 0, "y": 0, "dw": wide, "dh": high}
        self.figure.image("image", source=self._source, color_mapper=self._mapper, **place)
        style = {"width": 10, "padding": 4, "bar_line_color": None}
        bar = bokeh.ColorBar(color_mapper=self._mapper, major_label_text_font_size="10px", **style)
        self.figure.add_layout(bar, "right")

    def show(self, name: str, field: np.ndarray) -> None:
        """Draws a field named in `PALETTES`."""
        finite, quantity, palette = field[np.isfinite(field)], FIELDS[name], PALETTES[name]
        low, high = np.quantile(finite, (1 - SCALE_SHARE, SCALE_SHARE)) if finite.size else (0, 1)
        low = float(low) if low < 0 else 0.0
        unit, scale = unit_of(quantity.unit, max(float(high), -low))
        self.figure.title.text = f"{quantity.meaning.capitalize()} [{unit}]"
        if field.ndim == 1:
            x = self._factor * self._size[0] * np.arange(len(field)) / len(field)
            self._line.glyph.line_color = palette[len(palette) // 2]
            self._source.data = {"x": x, "y": scale * np.nan_to_num(field)}
            return
        step = -(-max(field.shape) // FINEST_MAP)
        self._mapper.update(palette=palette, low=scale * low, high=scale * float(high) or 1.0)
        self._source.data = {"image": [(scale * field[::step, ::step].T).astype(np.float32)]}


class BlockPicture:
    """Block and road before contact, to scale, around the deepest point of the road."""

    def __init__(self):
        wide = round(ASPECT * (HEIGHT - ABOVE - BELOW)) + LEFT + RIGHT
        self.figure = _page_figure(
            "Block and road, to scale", "x", "depth", sizing_mode="fixed", width=wide,
            min_border_left=LEFT, x_range=bokeh.Range1d(), y_range=bokeh.Range1d(),
        )  # fmt: skip
        self.figure.grid.grid_line_color = None
        columns = ((*SLAB, "fill"), ("x", "y", "text"), ("along", "depth"))
        self._slabs, self._names, self._road = (_new_source(*names) for names in columns)
        edges = {name: name for name in SLAB}
        self.figure.quad(source=self._slabs, fill_color="fill", line_color="white", **edges)
        self.figure.patch("along", "depth", source=self._road, color=ROAD)
        self.figure.add_layout(bokeh.LabelSet(
            x="x", y="y", text="text", source=self._names, text_font_size="11px", text_color=INK,
            text_align="center", text_baseline="middle",
        ))  # fmt: skip

    def show(
        self, thickness: np.ndarray, names: Sequence[str], base: str, heights: np.ndarray,
        length: float,
    ) -> None:  # fmt: skip
        """Draws layers [m] below the road.

        **Arguments:**

        - `thickness`, `names`: of the layers; the last name is that of the base.
        - `base`: its kind.
        - `heights`, `length`: of the surface, and its length along x [m].
        """
        solid = float(np.sum(thickness)) or length / 4
        # The base below the layers, and the road above them.
        deep, high = solid * (1.35 if base == "half_space" else 1.12), 0.45 * solid
        wide = ASPECT * (deep + high)
        unit, factor = unit_of("m", wide)
        edges = np.concatenate([[0], np.cumsum(thickness), [deep]])
        tops, bottoms, right = edges[:-1], edges[1:], factor * wide / 2
        fills = [*(LAYERS[i % len(LAYERS)] for i in range(len(thickness))), BASE_COLOURS[base]]
        _send(
            self._slabs, top=factor * tops, bottom=factor * bottoms, left=[-right] * len(tops),
            right=[right] * len(tops), fill=fills,
        )  # fmt: skip
        thick = np.flatnonzero(bottoms - tops > LABELLED * (deep + high)).tolist()
        middle, texts = factor * (tops + bottoms)[thick] / 2, [names[i] for i in thick]
        _send(self._names, x=[0.0] * len(thick), y=middle, text=texts)
        # The line of the road along x through its deepest point, which comes to x = 0.
        where = np.unravel_index(np.argmax(heights), heights.shape)
        line = np.roll(heights if heights.ndim == 1 else heights[:, where[1]], -where[0])
        waves = np.fft.rfft(line)
        waves[-1] /= 2 - len(line) % 2  # the highest wave of an even number has two directions
        fine = FINER * np.fft.irfft(waves, FINER * len(line))
        x, at = np.linspace(-wide / 2, wide / 2, 300), np.arange(len(fine)) * (length / len(fine))
        road = np.interp(x, at, fine - np.max(heights), period=length)
        along = np.concatenate([factor * x, [right, -right]])
        _send(self._road, along=along, depth=np.append(factor * road, [-2 * factor * high] * 2))
        self.figure.x_range.update(start=-right, end=right)
        self.figure.y_range.update(start=factor * deep, end=-factor * high)
        self.figure.xaxis.axis_label = f"x [{unit}]"
        self.figure.yaxis.axis_label = f"depth [{unit}]"
