"""The figure of a block with the road on it, both drawn to scale."""

from collections.abc import Sequence

import numpy as np
from bokeh.models import LabelSet, Range1d
from scipy.signal import resample

from ..core.display import unit_of
from .figures import INK, new_figure, new_source, send

ASPECT = 1.5  # of the frame
TINTS = ("#9cc3e0", "#f3cf9b", "#a9d8c6", "#e3bfd6", "#f5e2a8", "#c5dff1")  # of COLOURS
BASES = {"half_space": "#c9cdd3", "rigid": "#6b7078", "free": "#ffffff"}
ROAD = "#4a4f57"
FINER = 8  # points drawn for one of the road
LEAST = 0.09  # of the height drawn that words need
SLAB = ("top", "bottom", "left", "right")


class Section:
    """Block and road before they are pressed together, around the road's deepest point."""

    def __init__(self):
        self.figure = new_figure(
            "Block and road, to scale", "x", "depth", frame=ASPECT,
            x_range=Range1d(start=0, end=1), y_range=Range1d(start=1, end=0),
        )  # fmt: skip
        self.figure.grid.grid_line_color = None
        self._slabs, self._names, self._road = (
            new_source(*names)
            for names in ((*SLAB, "fill"), ("x", "y", "text"), ("along", "depth"))
        )
        self.figure.quad(
            source=self._slabs, fill_color="fill", line_color="white", **{k: k for k in SLAB}
        )
        self.figure.patch("along", "depth", source=self._road, color=ROAD)
        words = LabelSet(
            x="x", y="y", text="text", source=self._names, text_font_size="11px", text_color=INK,
            text_align="center", text_baseline="middle",
        )  # fmt: skip
        self.figure.add_layout(words)

    def show(
        self,
        thickness: np.ndarray,
        names: Sequence[str],
        base: str,
        heights: np.ndarray,
        size: np.ndarray,
    ) -> None:
        """Draws layers [m] by their `names`, the base's last, below the road."""
        solid = float(np.sum(thickness)) or float(size[0]) / 4
        # What is below the layers, and the room of the road above them.
        deep, high = solid * (1.35 if base == "half_space" else 1.12), 0.45 * solid
        wide = ASPECT * (deep + high)
        unit, factor = unit_of("m", wide)
        edges = np.concatenate([[0], np.cumsum(thickness), [deep]])
        tops, bottoms, right = edges[:-1], edges[1:], factor * wide / 2
        fills = [*(TINTS[i % len(TINTS)] for i in range(len(thickness))), BASES[base]]
        send(
            self._slabs, top=factor * tops, bottom=factor * bottoms, left=[-right] * len(tops),
            right=[right] * len(tops), fill=fills,
        )  # fmt: skip
        shown = np.flatnonzero(bottoms - tops > LEAST * (deep + high)).tolist()
        send(
            self._names, x=[0.0] * len(shown), y=factor * (tops + bottoms)[shown] / 2,
            text=[names[i] for i in shown],
        )  # fmt: skip
        x, road = _around_deepest(heights, float(size[0]), wide)
        send(
            self._road,
            along=np.concatenate([factor * x, [right, -right]]),
            depth=np.concatenate([factor * road, [-2 * factor * high] * 2]),
        )
        self.figure.x_range.update(start=-right, end=right)
        self.figure.y_range.update(start=factor * deep, end=-factor * high)
        self.figure.xaxis.axis_label = f"x [{unit}]"
        self.figure.yaxis.axis_label = f"depth [{unit}]"


def _around_deepest(
    heights: np.ndarray, length: float, wide: float
) -> tuple[np.ndarray, np.ndarray]:
    """Places and depths [m] of the road along x, its deepest point at the origin."""
    where = np.unravel_index(np.argmax(heights), heights.shape)
    line = np.roll(heights if heights.ndim == 1 else heights[:, where[1]], -where[0])
    fine = resample(line, FINER * len(line))
    x = np.linspace(-wide / 2, wide / 2, 300)
    at = np.arange(len(fine)) * (length / len(fine))
    return x, np.interp(x, at, fine - np.max(heights), period=length)
