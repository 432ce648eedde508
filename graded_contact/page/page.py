"""A scene with sliders in the browser: friction, contact, and what matters.

slider ──> update ──> curve ──> contact ──> errors and warnings ──> what matters
              └── a later move ends the computation between two of these stages
"""

import asyncio
import html
import os
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import param

from ..core.display import UNKNOWN, unit_of, with_error
from ..core.quantities import quantity_of
from ..plot import COLOURS
from ..plot.sweeps import title_of
from ..scenes.scene import Scene, parse_scene, read_scene
from .curves import SHOWN, Curves
from .figures import WIDTHS, Bars, Lines, Maps, pictures_of
from .numbers import STEPS, Number
from .save import save

REST = 0.3  # s without a move before errors and derivatives are computed
EXPECTED = (ValueError, RuntimeError, OSError, MemoryError)
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
FLOW = ":host {display: flex !important; flex-flow: row wrap; gap: 4px 12px} * {flex: 1 1 280px}"
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
    """A slider of one number with a field for an exact one; `value` is in SI.

    **Arguments:**

    - `number`: what it varies.
    - `check`: raises `ValueError` for a value that is refused.
    """

    value = param.Number()

    def __init__(self, number: Number, check: Callable[[float], None]):
        super().__init__(value=number.value)
        self.number, self._check = number, check
        unit = "" if number.unit == "1" else f" [{number.unit}]"
        self._slider = pn.widgets.IntSlider(
            label=number.label + unit, start=0, end=STEPS, show_value=False, **WIDE
        )
        self.field = pn.widgets.TextInput(width=86, margin=(0, 0, 0, 8))
        self._hint = pn.pane.HTML(width=86, margin=(0, 0, 0, 8), stylesheets=[TEXT])
        self.refusal = pn.pane.HTML(visible=False, stylesheets=[TEXT], **WIDE)
        self._shown = False  # whether the widgets show `value`
        self._show()
        self._slider.param.watch(lambda event: self._slid(event.new), "value")
        self.field.param.watch(lambda event: self.enter(event.new), "value")
        self.param.watch(lambda _: self._show(), "value")

    def __panel__(self) -> Any:
        beside = pn.Column(self._hint, self.field, margin=0, width=94)
        return pn.Column(pn.Row(self._slider, beside, **WIDE), self.refusal, **WIDE)

    def enter(self, text: str) -> None:
        """Takes the text of the field, or says why not; the field then keeps it."""
        if self._shown:
            return
        try:
            value = self.number.read(text)
            self._check(value)
        except ValueError as error:
            self.refusal.param.update(object=paragraph(str(error), "refused"), visible=True)
            return
        self.value = value
        self._show()

    def _slid(self, step: int) -> None:
        if not self._shown:
            self.value = self.number.at(step)

    def _show(self) -> None:
        self._shown, number = True, self.number
        self._slider.value = number.step_of(self.value)
        self.field.value = number.text(self.value)
        self._hint.object = f"<span>{number.hint(self.value) or '&nbsp;'}</span>"
        self.refusal.visible = False
        self._shown = False


class Page(pn.viewable.Viewer):
    """A page of one scene, at the middle of each of its axes.

    **Fields:**

    - `sliders`: by the names of the numbers, such as "velocity" and "layers[0].thickness".
    - `curve`, `contact`, `change`: what was computed last, or None.
    - `pinned`: curve and numbers to compare with, or None.

    **Arguments:**

    - `curves`: of the scene.
    - `folder`: where scenes are saved.
    """

    def __init__(self, curves: Curves, folder: str | os.PathLike = "."):
        super().__init__()
        self.curves, self.folder = curves, Path(folder)
        self.curve = self.contact = self.change = self.pinned = None
        self._known: dict[str, tuple[float, float]] = {}
        self._call, self._turn, self._compiled = 0, asyncio.Lock(), set()
        self.sliders = {
            name: Slider(number, lambda value, name=name: self._check(name, value))
            for name, number in curves.numbers.items()
        }
        html_pane: Any = {"stylesheets": [TEXT], **WIDE}
        self._head, self._said = pn.pane.HTML(**html_pane), pn.pane.HTML(**html_pane)
        self._busy = pn.indicators.LoadingSpinner(size=18, value=True, margin=(2, 8))
        self._status = pn.pane.HTML(**html_pane)
        named = zip(("friction", "contact_area"), COLOURS, strict=False)
        self._lines = [Lines(*line) for line in named] if curves.has_curve else []
        steady_maps = curves.kind == "steady" and curves.surface.grid.ndim == 2
        self._maps = Maps(curves.surface) if steady_maps else None
        self._pictures = pn.Column(**WIDE)
        self._bars = Bars(SHOWN[curves.kind][0])
        self._bars_pane = pn.pane.Bokeh(self._bars.figure, visible=False, **WIDE)
        self.pin = pn.widgets.Toggle(label="Pin to compare", **WIDE)
        self.ask = pn.widgets.Toggle(label="What matters here?", **WIDE)
        self.file_name = pn.widgets.TextInput(label="Save as", value="explored", **WIDE)
        self.save_button = pn.widgets.Button(label="Save the scene", **WIDE)
        self.saved = pn.pane.HTML(**html_pane)
        self._layout = self._laid_out()
        for slider in self.sliders.values():
            slider.param.watch(self.update, "value")
        self.ask.param.watch(self.update, "value")
        self.pin.param.watch(lambda event: self._pin(event.new), "value")
        self.save_button.on_click(lambda _: self.save())
        self._show_numbers()

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
        head = pn.Column(title, self._head, pn.Row(self._busy, self._status, **WIDE), **WIDE)
        below = (self.pin, self.ask, self.file_name, self.save_button, self.saved)
        side = pn.Column(*cards, *below, **WIDE)
        flow: Any = {"stylesheets": [FLOW], **WIDE}
        maps = [] if self._maps is None else self._maps.maps.values()
        areas = {
            "head": head,
            "curves": pn.Column(self._said, pn.Column(*(panes(self._lines)), **flow), **WIDE),
            "side": side,
            "maps": pn.Column(
                pn.Column(*panes(maps), **flow), self._pictures, self._bars_pane, **WIDE
            ),
        }
        for name, part in areas.items():
            part.css_classes = [name]
        return pn.Column(*areas.values(), stylesheets=[GRID], **WIDE)

    @property
    def values(self) -> dict[str, float]:
        """The values of the sliders [SI]."""
        return {name: slider.value for name, slider in self.sliders.items()}

    def _check(self, name: str, value: float) -> None:
        self.curves.check(self.values | {name: value})

    async def update(self, *_: Any) -> None:
        """Computes what the sliders ask for; a later call ends this one between two stages."""
        self._call += 1
        call, values = self._call, self.values
        for stage in (self._compute_curve, self._compute_contact, self._judge, self._ask_what):
            if stage == self._judge:
                await asyncio.sleep(REST)
            async with self._turn:
                if call != self._call:
                    return
                self._say_busy(stage)
                try:
                    show = await asyncio.to_thread(stage, values)
                except EXPECTED as error:
                    self._said.object = paragraph(str(error), "refused")
                    break
                if call == self._call:
                    pn.state.execute(show, schedule=True)
                self._compiled.add(stage)
        self._busy.param.update(value=False, visible=False)
        self._status.object = ""

    def _say_busy(self, stage: Callable) -> None:
        first = "" if stage in self._compiled else ": the first time takes some seconds"
        words = {
            self._compute_curve: "Computing the mean field",
            self._compute_contact: "Computing the contact",
            self._judge: "Estimating its errors",
            self._ask_what: "Computing derivatives",
        }
        self._busy.param.update(value=True, visible=True)
        self._status.object = paragraph(f"{words[stage]}{first}.")

    # The stages: each computes in a thread, and returns what shows it.

    def _compute_curve(self, values: dict[str, float]) -> Callable[[], None]:
        self.curve = self.curves.curve(values) if self.curves.has_curve else None
        return self._show_lines

    def _compute_contact(self, values: dict[str, float]) -> Callable[[], None]:
        self.contact = found = self.curves.contact(values)
        names = SHOWN[self.curves.kind]
        numbers = [float(np.ravel(at)[-1]) for at in found.compute(*names)]
        drawn = []
        if self._maps is None:
            drawn = pictures_of(self.curves, found, self.curves.velocity(values))

        def show() -> None:
            self._known = {n: (at, np.nan) for n, at in zip(names, numbers, strict=True)}
            self._said.object = ""
            self._show_numbers()
            for line in self._lines:
                y = self._known[line.name][0]
                line.contact.data = {"x": [values["velocity"]], "y": [y]}
            if self._maps is None:
                self._pictures[:] = drawn
            else:
                self._maps.show(found)

        return show

    def _judge(self, _: dict[str, float]) -> Callable[[], None]:
        errors = [
            float(np.ravel(at)[-1])
            for at in self.contact.compute(*(f"{name}_error" for name in self._known))
        ]
        warnings = self.contact.warnings

        def show() -> None:
            pairs = zip(self._known.items(), errors, strict=True)
            self._known = {name: (number, error) for (name, (number, _)), error in pairs}
            self._said.object = "".join(paragraph(f"Warning: {text}") for text in warnings)
            self._show_numbers()

        return show

    def _ask_what(self, values: dict[str, float]) -> Callable[[], None]:
        asked = self.ask.value
        self.change = self.curves.what_matters(values) if asked else None

        def show() -> None:
            self._bars_pane.visible = asked
            if self.change is not None:
                self._bars.show(self.change)

        return show

    def _show_lines(self) -> None:
        for line in self._lines:
            line.show(self.curve, None if self.pinned is None else self.pinned[0])

    def _show_numbers(self) -> None:
        pinned = {} if self.pinned is None else self.pinned[1]
        cells = []
        for name in SHOWN[self.curves.kind]:
            text = "…" if name not in self._known else in_words(name, *self._known[name])
            words = title_of(name)
            if name in pinned and name in self._known:
                change = 100 * (self._known[name][0] / pinned[name][0] - 1)
                words += f", {change:+.1f} % of the pinned {in_words(name, *pinned[name])}"
            cells.append(f"<div><b>{text}</b><span>{words}</span></div>")
        self._head.object = f"<div class=numbers>{''.join(cells)}</div>"

    def _pin(self, pinned: bool) -> None:
        self.pinned = (self.curve, self._known) if pinned else None
        self._show_numbers()
        self._show_lines()

    def save(self) -> None:
        """Saves the scene with the values of the sliders, or says why not."""
        try:
            path = save(
                self.curves.scene,
                self.curves.numbers,
                self.values,
                self.folder,
                self.file_name.value,
            )
        except (ValueError, OSError) as error:
            self.saved.object = paragraph(f"Not saved: {error}", "refused")
            return
        self.saved.object = paragraph(f"Saved {path}.")


def panes(figures: Any) -> list[pn.pane.Bokeh]:
    """Returns figures as parts of a page."""
    return [pn.pane.Bokeh(one.figure, margin=0, **WIDTHS) for one in figures]


def paragraph(text: str, kind: str = "") -> str:
    """Returns a text as HTML."""
    return f'<p class="{kind}">{html.escape(text)}</p>'


def in_words(name: str, number: float, error: float) -> str:
    """Returns a number of a contact with its error, if it is known, in a unit that suits it."""
    quantity = quantity_of(name)
    assert quantity is not None
    unit = "" if quantity.unit == "1" else quantity.unit
    if np.isfinite(error):
        return with_error(number, error, unit)
    unit, factor = unit_of(unit, abs(number)) if unit else ("", 1.0)
    return UNKNOWN if np.isnan(number) else f"{factor * number:.4g} {unit}"


def explore(
    scene: Scene | str | os.PathLike | None = None, folder: str | os.PathLike = "."
) -> Page:
    """Returns a page with a slider for every number of a scene, for a notebook.

    **Arguments:**

    - `scene`: a scene or the path of its file; by default the scene of the command `demo`.
    - `folder`: where scenes are saved.
    """
    pn.extension()
    return Page(Curves(opened(scene)), folder)


def serve(
    scene_file: str | os.PathLike | None,
    folder: str | os.PathLike,
    *,
    port: int = 5006,
    show: bool = True,
) -> None:
    """Shows the page of a scene in the browser of this machine, until Ctrl-C."""
    curves = Curves(opened(scene_file))
    pn.extension()
    pn.serve(
        lambda: Page(curves, folder),
        address="localhost",
        port=port,
        show=show,
        title=curves.scene.title or "graded_contact",
    )


def opened(scene: Scene | str | os.PathLike | None) -> Scene:
    """Returns a scene, read from its file if it is a path."""
    if isinstance(scene, Scene):
        return scene
    if scene is None:
        text = resources.files("graded_contact.scenes").joinpath("demo.toml").read_text("utf-8")
        return parse_scene(text)
    return read_scene(scene)
