"""A scene with sliders in the browser: friction, contact, and derivatives.

slider ──> update ──> curve ──> contact ──> errors and warnings ──> derivatives
              └── a later move ends the computation between two of these stages
"""

import asyncio
import html
import os
from pathlib import Path
from typing import Any, cast

import numpy as np
import panel as pn
import param

from ..core.display import UNKNOWN, with_error
from ..core.quantities import quantity_of
from ..plot import COLOURS
from ..plot.sweeps import title_of
from ..scenes.scene import Scene, read_scene
from .curves import SHOWN, Curves
from .figures import WIDTHS, Lines, Maps, pictures_of
from .numbers import STEPS, Number, save

DEMO = Path(__file__).parents[1] / "scenes" / "demo.toml"
MOST_CHANGES = 12  # of the largest derivatives
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
# The numbers stay in sight; on a phone the curves stand above the sliders, the maps below.
GRID = """
:host {display: grid !important; gap: 0 20px; padding: 0 12px; box-sizing: border-box;
  grid-template: "head head" auto "side curves" auto "side maps" auto "side ." 1fr / 330px 1fr}
.head {grid-area: head; position: sticky !important; top: 0; z-index: 5; background: white}
.side {grid-area: side} .curves {grid-area: curves} .maps {grid-area: maps}
@media (max-width: 800px) {
  :host {grid-template: "head" auto "curves" auto "side" auto "maps" auto / minmax(0, 1fr)}
}
"""
ROW = """
:host {display: grid !important; gap: 4px 12px;
  grid-template-columns: repeat(COUNT, minmax(0, 1fr))}
@media (max-width: 800px) {:host {grid-template-columns: minmax(0, 1fr)}}
"""
# Phones draw a page without this line as wide as on a desk.
VIEWPORT = """<script>document.head.insertAdjacentHTML("beforeend",
'<meta name="viewport" content="width=device-width, initial-scale=1">')</script>"""
TEXT = """
* {font-family: system-ui, sans-serif; color: #2b2f36; margin: 0}
.numbers {display: flex; flex-wrap: wrap; gap: 2px 28px; align-items: baseline}
h1 {font-size: 14px; padding: 6px 0 2px} b {font-size: 18px; font-variant-numeric: tabular-nums}
span {display: block; font-size: 11px; color: #5b616b} p {font-size: 12px; line-height: 1.4}
.refused {color: #a33600}
@media (max-width: 800px) {.numbers {gap: 2px 14px} b {font-size: 13px}}
"""


class Slider(pn.viewable.Viewer):
    """A slider of one number with a field for an exact one; `value` is in SI."""

    value = param.Number()

    def __init__(self, number: Number):
        super().__init__(value=number.value)
        self.number = number
        self._slider = pn.widgets.IntSlider(
            label=number.title, start=0, end=STEPS, show_value=False, **WIDE
        )
        self.field = pn.widgets.FloatInput(width=94, margin=(12, 0, 0, 8))
        self._show()
        self._slider.param.watch(lambda event: self._slid(event.new), "value")
        self.field.param.watch(lambda event: self._typed(event.new), "value")
        self.param.watch(lambda _: self._show(), "value")

    def __panel__(self) -> Any:
        return pn.Row(self._slider, self.field, **WIDE)

    def _typed(self, shown: float | None) -> None:
        if shown is None or shown == self.number.shown(self.value):
            self._show()
        else:
            self.value = shown / self.number.factor

    def _slid(self, step: int) -> None:
        if step != self.number.step_of(self.value):
            self.value = self.number.at(step)

    def _show(self) -> None:
        self._slider.value = self.number.step_of(self.value)
        self.field.value = self.number.shown(self.value)


class Page(pn.viewable.Viewer):
    """A page of one scene, at the middle of each of its axes.

    **Fields:**

    - `sliders`: by the names of the numbers, such as "velocity" and "layers[0].thickness".
    - `curve`, `contact`, `change`: the latest, or None.
    - `numbers`: of the contact, with their errors, NaN until these are known.
    - `warnings`: about these numbers.
    - `pinned`: curve and numbers to compare with, or None.

    **Arguments:**

    - `curves`: of the scene.
    - `folder`: where scenes are saved.
    """

    def __init__(self, curves: Curves, folder: str | os.PathLike = "."):
        super().__init__()
        self.curves, self.folder = curves, Path(folder)
        self.curve = self.contact = self.change = self.pinned = None
        self.numbers: dict[str, tuple[float, float]] = {}
        self.warnings, self._drawn = [], []
        self._call, self._turn = 0, asyncio.Lock()
        self.sliders = {name: Slider(number) for name, number in curves.numbers.items()}
        self._head, self._said, self._matters, self.saved = (
            pn.pane.HTML(stylesheets=[TEXT], **WIDE) for _ in range(4)
        )
        self._busy = pn.indicators.LoadingSpinner(size=18, value=True, margin=(2, 8))
        named = zip(("friction", "contact_area"), COLOURS, strict=False)
        self._lines = [Lines(*line) for line in named] if curves.has_curve else []
        steady_maps = curves.kind == "steady" and curves.surface.grid.ndim == 2
        self._maps = Maps(curves.surface) if steady_maps else None
        self._pictures = pn.Column(**WIDE)
        self.pin = pn.widgets.Toggle(label="Pin to compare", **WIDE)
        self.ask = pn.widgets.Toggle(label="What matters here?", **WIDE)
        self.file_name = pn.widgets.TextInput(label="Save as", value="explored.toml", **WIDE)
        self.save_button = pn.widgets.Button(label="Save the scene", **WIDE)
        self._layout = self._laid_out()
        for slider in self.sliders.values():
            slider.param.watch(self.update, "value")
        self.ask.param.watch(self.update, "value")
        self.pin.param.watch(lambda event: self._pin(event.new), "value")
        self.save_button.on_click(lambda _: self.save())

    def __panel__(self) -> Any:
        pn.state.onload(self.update)
        return self._layout

    def _laid_out(self) -> pn.Column:
        groups: dict[str, list[Slider]] = {}
        for slider in self.sliders.values():
            groups.setdefault(slider.number.group, []).append(slider)
        cards = [
            pn.Card(*some, title=group, collapsed=group.endswith("more"), **WIDE)
            for group, some in groups.items()
        ]
        title = f"<h1>{html.escape(self.curves.scene.title)}</h1>{VIEWPORT}"
        title = pn.pane.HTML(title, stylesheets=[TEXT], **WIDE)
        below = (self.pin, self.ask, self.file_name, self.save_button, self.saved)
        maps = [] if self._maps is None else self._maps.maps.values()
        areas = {
            "head": (title, self._head, self._busy),
            "curves": (self._said, side_by_side(self._lines)),
            "side": (*cards, *below),
            "maps": (side_by_side(maps), self._pictures, self._matters),
        }
        parts = [pn.Column(*some, css_classes=[name], **WIDE) for name, some in areas.items()]
        return pn.Column(*parts, stylesheets=[GRID], **WIDE)

    @property
    def values(self) -> dict[str, float]:
        """The values of the sliders [SI]."""
        return {name: slider.value for name, slider in self.sliders.items()}

    async def update(self, *_: Any) -> None:
        """Computes curve and contact; a later call ends this one between two stages."""
        self._call += 1
        call, values = self._call, self.values
        stages = (
            ("Mean field", self._compute_curve, self._show_lines),
            ("Contact", self._compute_contact, self._show_contact),
            ("Errors", self._compute_errors, self._show_numbers),
            ("Derivatives", self._compute_change, self._show_change),
        )
        for words, compute, show in stages:
            async with self._turn:
                if call != self._call:
                    return
                self._busy.param.update(visible=True, label=f"{words} …")
                try:
                    await asyncio.to_thread(compute, values)
                except (ValueError, RuntimeError, OSError, MemoryError) as error:
                    self._said.object = paragraph(error, "refused")
                    break
                if call == self._call:
                    pn.state.execute(show, schedule=True)
        self._busy.visible = False

    # The stages compute in a thread; the page then shows their results.

    def _compute_curve(self, values: dict[str, float]) -> None:
        self.curves.case(values)  # refuses what no body has
        self.curve = self.curves.curve(values)

    def _compute_contact(self, values: dict[str, float]) -> None:
        self.contact, self.warnings = self.curves.contact(values), []
        found = self.curves.shown(self.contact)
        self.numbers = {name: (number, np.nan) for name, number in found.items()}
        self._drawn = [] if self._maps else pictures_of(self.curves, self.contact)

    def _compute_errors(self, values: dict[str, float]) -> None:
        errors = self.curves.shown(self.contact, "_error")
        self.numbers = {name: (at, errors[name]) for name, (at, _) in self.numbers.items()}
        self.warnings = cast(Any, self.contact).warnings

    def _compute_change(self, values: dict[str, float]) -> None:
        self.change = self.curves.what_matters(values) if self.ask.value else None

    def _show_lines(self) -> None:
        for line in self._lines:
            line.show(cast(Any, self.curve), self.pinned and self.pinned[0])

    def _show_contact(self) -> None:
        self._show_numbers()
        for line in self._lines:
            y = self.numbers[line.name][0]
            line.contact.data = {"x": [self.values["velocity"]], "y": [y]}
        if self._maps:
            self._maps.show(self.contact)
        self._pictures[:] = self._drawn

    def _show_numbers(self) -> None:
        pinned = {} if self.pinned is None else self.pinned[1]
        cells = []
        for name, (number, error) in self.numbers.items():
            words = title_of(name)
            if name in pinned:
                change = 100 * (number / pinned[name][0] - 1)
                words += f", {change:+.1f} % of the pinned {in_words(name, *pinned[name])}"
            text = in_words(name, number, error)
            cells.append(f"<div><b>{text}</b><span>{words}</span></div>")
        self._head.object = f"<div class=numbers>{''.join(cells)}</div>"
        self._said.object = "".join(paragraph(f"Warning: {text}") for text in self.warnings)

    def _show_change(self) -> None:
        name = title_of(SHOWN[self.curves.kind][0])
        rows = [f"{percent:+.2f} %: {label}" for label, percent in (self.change or {}).items()]
        head = [f"Change of the {name} by +1 % of each number:"] if rows else []
        self._matters.object = "".join(map(paragraph, head + rows[:MOST_CHANGES]))

    def _pin(self, pinned: bool) -> None:
        self.pinned = (self.curve, self.numbers) if pinned else None
        self._show_numbers()
        self._show_lines()

    def save(self) -> None:
        """Saves the scene with the values of the sliders, or says why not."""
        path = self.folder / self.file_name.value
        try:
            save(self.curves.scene, self.values, path)
        except (ValueError, OSError) as error:
            self.saved.object = paragraph(f"Not saved: {error}", "refused")
        else:
            self.saved.object = paragraph(f"Saved {path}.")


def side_by_side(figures: Any) -> pn.Column:
    """Returns figures beside each other, or on a phone below each other."""
    shown = [pn.pane.Bokeh(one.figure, margin=0, **WIDTHS) for one in figures]
    return pn.Column(*shown, stylesheets=[ROW.replace("COUNT", str(len(shown)))], **WIDE)


def paragraph(text: object, kind: str = "") -> str:
    """Returns a text as HTML."""
    return f'<p class="{kind}">{html.escape(str(text))}</p>'


def in_words(name: str, number: float, error: float) -> str:
    """Returns a number of a contact with its error in a unit that suits it."""
    quantity = quantity_of(name)
    assert quantity is not None
    words = with_error(number, error, "" if quantity.unit == "1" else quantity.unit)
    return words.replace(f"± {UNKNOWN}", "± …")  # it is computed after the number


def explore(scene: Scene | str | os.PathLike = DEMO, folder: str | os.PathLike = ".") -> Page:
    """Returns a page with a slider for every number of a scene, for a notebook.

    **Arguments:**

    - `scene`: a scene or the path of its file; by default the scene of the command `demo`.
    - `folder`: where scenes are saved.
    """
    pn.extension()
    return Page(Curves(scene if isinstance(scene, Scene) else read_scene(scene)), folder)


def serve(
    scene_file: str | os.PathLike | None, folder: str | os.PathLike, port: int, show: bool
) -> None:
    """Shows the page of a scene in the browser of this machine, until Ctrl-C."""
    first = explore(scene_file or DEMO, folder)
    title = first.curves.scene.title or "graded_contact"
    how: dict[str, Any] = {"address": "localhost", "port": port, "show": show, "title": title}
    pn.serve(lambda: Page(first.curves, folder), **how)
