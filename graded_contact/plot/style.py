"""The one style of all figures: colours, sizes of a journal's columns, fonts, and units.

A figure has this style when it is made, drawn and saved. The settings of the user neither act nor
change. For your own figures: `with matplotlib.rc_context(gc.plot.STYLE): ...`, or in a notebook
`plt.rcParams.update(gc.plot.STYLE)`.
"""

import functools
import re
import string
import textwrap
import unicodedata
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

if TYPE_CHECKING:  # it takes a third of a second to import
    from matplotlib.figure import Figure

P = ParamSpec("P")
T = TypeVar("T")

# Of M. Okabe and K. Ito, for any kind of colour vision.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
COLUMN, PAGE = 3.54, 7.48  # inches, 90 and 190 mm
COLOUR_BAR = "<colorbar>"  # the label of Matplotlib for the axes of one
KEY_WIDTH, LETTER_WIDTH, LINE_HEIGHT = 0.5, 0.058, 0.155  # inches, of legends
HEIGHTS, PRESSURES, GAPS, TEMPERATURES = "cividis", "viridis", "magma", "plasma"
STYLE = {
    "axes.grid": True,
    "axes.axisbelow": True,
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
    "image.cmap": PRESSURES,
    "image.interpolation": "nearest",
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "pdf.fonttype": 42,  # TrueType, as journals require
    "ps.fonttype": 42,
    "svg.hashsalt": "graded_contact",  # the same figure is the same file
    "xtick.labelsize": 7,
    "xtick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.labelsize": 7,
    "ytick.major.width": 0.6,
    "ytick.minor.width": 0.4,
}  # fmt: skip


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Returns a function that makes its figure in the style."""

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        import matplotlib.style

        # On top of the defaults of Matplotlib, not of the settings of the user.
        with matplotlib.style.context(["default", STYLE]):
            return draw(*args, **kwargs)

    return drawn


def finished(draw: "Callable[P, Figure]") -> "Callable[P, Figure]":
    """Returns a function whose figure has the style, letters of its panels, and a legend below."""

    @styled
    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> "Figure":
        figure = draw(*args, **kwargs)
        panels = [axes for axes in figure.axes if axes.get_label() != COLOUR_BAR]
        for axes, letter in zip(panels, string.ascii_lowercase, strict=False):
            if len(panels) > 1:
                axes.set_title(f"({letter})", loc="left", fontweight="bold")
        _draw_legend(figure)
        return figure

    return drawn


# The class is made at the first figure: to import Matplotlib takes long.
@functools.cache
def _styled_figure() -> "type[Figure]":
    from matplotlib.figure import Figure

    class StyledFigure(Figure):
        """A figure in the style also when it is drawn, which makes its ticks, and saved."""

        draw, savefig = styled(Figure.draw), styled(Figure.savefig)

    return StyledFigure


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure [inches] with a constrained layout; it needs no display."""
    return _styled_figure()(figsize=(width, height))


@styled
def entitle(figure: "Figure", text: str) -> None:
    """Puts a line above a figure, and above an earlier one; broken where it is too long."""
    titles = [title for title in (text, *_titles(figure)) if title]
    figure.set_label("\n".join(titles))
    # About 15 letters of the title's size fit into an inch.
    width = round(15 * figure.get_figwidth())
    # A word must not break between a $ and its backslash, see `in_figure`.
    wrap = functools.partial(textwrap.fill, width=width, break_long_words=False)
    figure.suptitle("\n".join(map(wrap, titles)))


def _titles(figure: "Figure") -> list[str]:
    """The titles of a figure, as its label keeps them: unbroken, one in each line."""
    return str(figure.get_label()).splitlines()


def caption(figure: "Figure") -> str:
    """Returns what the panels of a figure show, from their letters and labels, and its titles."""
    panels = []
    for axes in figure.axes:
        bars = [drawn.colorbar.ax for drawn in (*axes.images, *axes.collections) if drawn.colorbar]
        title, of = axes.get_title(), bars[0] if bars else axes
        shown = " against ".join(filter(None, (of.get_ylabel(), of.get_xlabel())))
        if axes.get_label() != COLOUR_BAR:
            shown = f"{title}: {shown}" if title and bars else title or shown
            panels.append(f"{axes.get_title(loc='left')} {shown}".strip())
    shown = " ".join("; ".join(panels).split())  # labels of axes have several lines
    shown = re.sub(r" \[[^]]*\]", "", shown)
    sentences = filter(None, (shown, *_titles(figure)))
    text = " ".join(f"{text[0].upper()}{text[1:].removesuffix('.')}." for text in sentences)
    text = re.sub(r"(?<=\. )[a-z]", lambda letter: letter[0].upper(), text)
    # A $ after a backslash is one of the text, see `in_figure`.
    return re.sub(r"(?<!\\)\$(.*?)\$", lambda math: _plain(math[1]), text).replace(r"\$", "$")


def _plain(text: str) -> str:
    """A formula of TeX in words: "log10 a_T" for r"\\log_{10} a_T"."""
    words = {r"\mathrm": "", "_{10}": "10", "^*": "*", r"\,": " ", "{": "", "}": ""}
    for old, new in words.items():
        text = text.replace(old, new)
    greek = {name: unicodedata.lookup(f"GREEK SMALL LETTER {name}") for name in
             ("mu", "sigma", "omega", "delta")}  # fmt: skip
    return re.sub(r"\\([a-z]+)", lambda found: greek.get(found[1], found[1]), text)


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


def at_bottom(axes: Any) -> dict[str, Any]:
    """How to draw at the bottom of axes: their y is then from 0 to 1."""
    return {"transform": axes.get_xaxis_transform(), "clip_on": False}


def draw_closed(axes: Any, x: np.ndarray, colour: Any) -> None:
    """Draws where no fluid passes a gap: triangles at the bottom."""
    label = "closed: no flow"
    axes.plot(x, np.zeros(len(x)), "v", color=colour, label=label, **at_bottom(axes))


def ordered(count: int, colours: str = PRESSURES) -> np.ndarray:
    """Colours of ordered curves, from dark to light, shape `(count, 4)`."""
    from matplotlib import colormaps

    return colormaps[colours](np.linspace(0, 0.85, count))


def colours_of(count: int, colours: str = PRESSURES) -> Any:
    """Colours of this many curves: those of `COLOURS` if they suffice, otherwise ordered ones."""
    return COLOURS if count <= len(COLOURS) else ordered(count, colours)


def few_powers_of_ten(axis: Any, low: float, high: float) -> None:
    """Labels a logarithmic axis, between the powers of ten too if there are few."""
    from matplotlib.ticker import LogLocator, NullFormatter

    # Fewer than two decades would have two labels at most.
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
