"""The style of all figures: colours, widths of a journal's columns, fonts, panels and legends.

The settings of the user neither act nor change. For your own figures:
`with matplotlib.rc_context(gc.plot.STYLE): ...`, or `plt.rcParams.update(gc.plot.STYLE)`.
"""

import functools
import string
import textwrap
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ParamSpec, cast

import numpy as np

if TYPE_CHECKING:  # it takes a third of a second to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")

# Of M. Okabe and K. Ito, for any kind of colour vision.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
PAGE = 7.48  # inches, 190 mm: two columns of a journal
COLOUR_BAR = "<colorbar>"  # the label of Matplotlib for the axes of one
KEY_WIDTH, LETTER_WIDTH, LINE_HEIGHT = 0.5, 0.058, 0.155  # inches, of legends
LETTERS_PER_INCH = 15  # of a title
PRESSURES, TEMPERATURES = "viridis", "plasma"
STYLE = {
    "axes.grid": True,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.prop_cycle": f"cycler(color={list(COLOURS)})",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 8,
    "figure.constrained_layout.use": True,
    "figure.dpi": 200,
    "figure.figsize": (PAGE, 2.9),
    "figure.titlesize": 8,
    "font.size": 8,
    "grid.color": "0.92",
    "grid.linewidth": 0.6,
    "image.interpolation": "nearest",
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "pdf.fonttype": 42,  # TrueType, as journals require
    "ps.fonttype": 42,
    "svg.hashsalt": "graded_contact",  # the same figure is the same file
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
}


def finished(draw: "Callable[P, Figure]") -> "Callable[P, Figure]":
    """Returns a function whose figure has the style, letters of its panels, and a legend below.

    The style is on top of Matplotlib's defaults. Given `axes` get the style alone.
    """

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> "Figure":
        import matplotlib.style

        with matplotlib.style.context(["default", STYLE]):
            figure = draw(*args, **kwargs)
            if kwargs.get("axes") is None:
                _letter_panels(figure)
                _draw_legend(figure)
            # Ticks are made when a figure is drawn, later perhaps, in the style of the user.
            for axes in figure.axes:
                axes.tick_params(labelsize=STYLE["xtick.labelsize"])
            figure.draw_without_rendering()
            return figure

    return drawn


def panels(axes: Any, mosaic: str, size: tuple[float, float], **layout: Any) -> "list[Axes]":
    """Returns the given `axes`, or if they are None the panels of a new figure.

    **Arguments:**

    - `axes`: None, one Matplotlib `Axes`, or several.
    - `mosaic`: the panels, such as "ab;cd", see `matplotlib.figure.Figure.subplot_mosaic`.
    - `size`: width and height of the figure [inches].
    - `layout`: such as `sharex=True`.

    **Raises:** `ValueError` if `axes` has another number of panels.
    """
    from matplotlib.figure import Figure

    if axes is None:
        return list(Figure(figsize=size).subplot_mosaic(mosaic, **layout).values())
    given, count = list(np.ravel(axes)), len({*mosaic} - {*".;"})
    if len(given) != count:
        raise ValueError(f"`axes` has {len(given)} panels; {count} are needed.")
    return given


def mosaic_of(count: int, columns: int) -> str:
    """Returns the mosaic of this many panels, row by row."""
    rows = -(-count // columns)
    names = string.ascii_letters[:count].ljust(rows * columns, ".")
    return ";".join(names[i : i + columns] for i in range(0, len(names), columns))


def entitle(figure: "Figure", text: str) -> None:
    """Puts a title above a figure, unless it has one."""
    width = round(LETTERS_PER_INCH * figure.get_figwidth())
    figure.suptitle(figure.get_suptitle() or textwrap.fill(text, width))


def _letter_panels(figure: "Figure") -> None:
    shown = [axes for axes in figure.axes if axes.get_label() != COLOUR_BAR]
    for axes, letter in zip(shown, string.ascii_lowercase, strict=False):
        if len(shown) > 1:
            axes.set_title(f"({letter})", loc="left", fontweight="bold")


def _draw_legend(figure: "Figure") -> None:
    """Draws one legend below all panels, where it hides no curve; the figure grows by it."""
    found: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if not found:
        return
    width = KEY_WIDTH + LETTER_WIDTH * max(map(len, found))
    columns = max(1, min(len(found), int(figure.get_figwidth() / width)))
    lines = -(-len(found) // columns)
    figure.set_figheight(figure.get_figheight() + LINE_HEIGHT * (lines + 0.5))
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=columns)


def figure_of(axes: "Axes") -> "Figure":
    """Returns the figure of axes."""
    return cast("Figure", axes.get_figure(root=True))


def at_bottom(axes: "Axes") -> dict[str, Any]:
    """Returns how to draw at the bottom of axes: their y is then from 0 to 1."""
    return {"transform": axes.get_xaxis_transform(), "clip_on": False}


def colours_of(count: int, scale: str = PRESSURES) -> Any:
    """Returns this many colours: of `COLOURS`, or if there are more, from dark to light."""
    return COLOURS[:count] if count <= len(COLOURS) else ordered(count, scale)


def ordered(count: int, scale: str = PRESSURES) -> np.ndarray:
    """Returns colours of ordered curves, from dark to light, shape `(count, 4)`."""
    from matplotlib import colormaps

    return colormaps[scale](np.linspace(0, 0.85, count))


def few_powers_of_ten(axis: Any, low: float, high: float) -> None:
    """Labels a logarithmic axis, between the powers of ten too if there are few."""
    from matplotlib.ticker import LogLocator, NullFormatter

    # Fewer than two decades would have two labels at most.
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
