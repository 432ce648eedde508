"""A page: sliders and tools next to figures, bound to the parameters of a session."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn

from ..core.display import number, with_error
from ..core.escaping import in_html
from ..readers.moduli import read_moduli
from ..readers.topography import read_surface
from ..scenes.described import base_name, layers_in_words
from .document import Document
from .downloads import ShownPoint
from .figures import Bars, BlockPicture, Map, new_lines
from .session import Session
from .tabs import PADDED, STYLES, WIDE, LayersTab, data_tab, paragraph, save_tab
from .widgets import Browser, Slider
from .wording import for_page

NO_LENGTH = 1e-15  # m; a gap below it is one of rounding
SIDE = 304  # pixels
# On a phone the numbers and the upper figures, side by side in a strip, stay above the sliders; the
# other figures are below.
PHONE = "@media (max-width: 899px)"
HEAD = """:host {position: sticky; top: 0; z-index: 3; background: white; padding: 4px 12px;
  border-bottom: 1px solid #e3e6ea; box-sizing: border-box}"""
ASIDE = f""":host {{flex: 1 1 {SIDE}px; min-width: 0; padding-bottom: 8px}}
@media (min-width: 900px) {{:host {{position: sticky; top: 64px; height: calc(100vh - 64px);
  overflow: hidden auto; max-width: {SIDE}px; border-right: 1px solid #e3e6ea}}}}
{PHONE} {{:host {{order: 2}}}}"""
OPEN = f"{PHONE} {{:host {{display: contents !important}}}}"  # its parts have places of their own
STRIP = f"""{PHONE} {{:host {{order: 1; position: sticky; top: 64px; z-index: 2; background: white;
  flex: 0 0 100%; border-bottom: 1px solid #e3e6ea}}
  div[id^=flexbox] {{flex-wrap: nowrap !important; overflow-x: auto}}
  div[id^=flex-item] > * {{flex: 0 0 270px !important}}}}"""
BELOW = f"{PHONE} {{:host {{order: 3; flex: 0 0 100%}}}}"
# The tabs that are not shown are in the page, and would make it as high as the highest of them.
TABS = ":host > [style*=hidden] {height: 0; overflow: hidden}"
TEXT: dict[str, Any] = {"stylesheets": [STYLES], "margin": (0, 8), **PADDED}
MAPS = {
    "pressure": "pressure", "gap": "gap", "displacement": "displacement", "surface": "heights",
}  # fmt: skip


class Page(pn.viewable.Viewer):
    """A scene with sliders, for a browser or a notebook, which computes when it is shown.

    **Arguments:**

    - `document`: the scene.
    - `folder`: the page writes into this folder only.
    """

    def __init__(self, document: Document, folder: Path):
        super().__init__()
        self.session = Session(document, folder)
        self.sliders: list[Slider] = []
        self._plots, self._knobs = pn.Column(stylesheets=[OPEN], **WIDE), pn.Column(**WIDE)
        self._layers = LayersTab(self.session)
        self._field: Any = pn.widgets.RadioButtonGroup(
            options=MAPS, variant="outline", color="primary", margin=(4, 48),
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._field.param.watch(lambda _: pn.state.execute(self._show_map, schedule=True), "value")
        self._layout = self._laid_out()
        watch = self.session.param.watch
        watch(self._show_model, "model")
        watch(self._show_curves, ["curves", "pinned"])
        watch(self._show_point, "shown")
        if not pn.state.curdoc:  # After all others: figures of a notebook are sent by hand.
            push = lambda *_: pn.io.push_notebook(self._layout)  # noqa: E731
            watch(push, list(self.session.param), precedence=1)
            self._field.param.watch(push, "value", precedence=1)

    def __panel__(self) -> Any:
        return self._layout

    def _laid_out(self) -> pn.FlexBox:
        session, here = self.session, self.session.param
        spinner = pn.indicators.LoadingSpinner(
            value=here.busy, visible=here.busy, size=20, margin=(8, 4, 4, 8)
        )
        status = pn.pane.HTML(pn.bind(paragraph, here.status), **TEXT | {"margin": (10, 8)})
        pin = pn.widgets.Toggle(
            label="Pin curves and numbers to compare", **PADDED, disabled=here.shown.rx.is_(None),
        )  # fmt: skip
        pin.param.watch(
            lambda event: session.show(pinned=session.shown if event.new else None), "value"
        )
        tabs = pn.Tabs(
            ("Sliders", self._knobs), ("Layers", self._layers),
            ("Data", data_tab(session, self._layers.material)), ("Save", save_tab(session)),
            sizing_mode="stretch_width", margin=(2, 4), stylesheets=[TABS],
        )  # fmt: skip
        browser = Browser(width=0, margin=0)
        browser.param.watch(lambda _: pn.state.execute(session.update), "ready")
        side = pn.Column(
            pn.Row(spinner, status, browser, **WIDE),
            pin,
            pn.pane.HTML(pn.bind(_said, here.refused, here.message, here.error), **TEXT),
            pn.pane.HTML(pn.bind(_warnings, here.shown), **TEXT),
            tabs,
            stylesheets=[ASIDE], **WIDE,
        )  # fmt: skip
        head = pn.pane.HTML(
            pn.bind(_headline, here.shown, here.pinned), stylesheets=[STYLES, HEAD],
            sizing_mode="stretch_width", margin=0, styles={"flex": "1 0 100%"}, min_height=56,
        )  # fmt: skip
        main = pn.Column(self._plots, **WIDE, styles=_flex("1000 1 600px"), stylesheets=[OPEN])
        return pn.FlexBox(head, side, main, styles={"background": "white"}, gap="0", **WIDE)

    def _show_model(self, _: Any) -> None:
        """New sliders and figures, for another scene."""
        model = self.session.model
        self.sliders = [
            Slider(knob, value) for knob, value in zip(model.knobs, model.values, strict=True)
        ]
        for i, slider in enumerate(self.sliders):
            set_value = partial(self.session.set_value, model, i)
            slider.param.watch(lambda event, set_value=set_value: set_value(event.new), "value")
            slider.param.watch(self._show_refusals, "refusal")
        self._show_refusals()  # none: the fields are new
        self._knobs[:] = self.sliders
        heated = model.document.scene.heating is not None
        self._lines, self._bars = new_lines(model.waves, heated), Bars(model.knobs, heated)
        self._block, self._map = BlockPicture(), Map(np.asarray(model.surface.grid.size))
        lines, chart = self._lines, pn.Column(self._field, _pane_of(self._map.figure), **WIDE)
        chart.styles = _flex("0 1 480px")
        upper = (lines["friction"], lines["contact_area"], self._block)
        lower = [_pane_of(lines[name].figure, "1 1 220px") for name in ("modulus", "loss_tangent")]
        right = pn.Column(_pane_of(self._bars.figure), pn.FlexBox(*lower, gap="0", **WIDE),
                          **WIDE, styles=_flex("1 1 440px"))  # fmt: skip
        self._plots[:] = [
            pn.FlexBox(
                *(_pane_of(part.figure, "1 1 270px") for part in upper),
                gap="0",
                stylesheets=[STRIP],
                **WIDE,
            ),
            pn.FlexBox(chart, right, gap="0", stylesheets=[BELOW], **WIDE),
        ]
        self._layers.show(model.document.content)

    def _show_refusals(self, *_: Any) -> None:
        found = (slider.refusal for slider in self.sliders)
        self.session.show(refused=" ".join(filter(None, found)))

    def _show_curves(self, *events: Any) -> None:
        pinned = self.session.pinned
        for line in self._lines.values():
            line.show(self.session.curves, pinned and pinned.curves)
        if any(event.name == "curves" for event in events):
            self._bars.fade(0.35)

    def _show_map(self) -> None:
        """Draws the chosen field of the contact."""
        if self.session.shown is None:
            return
        name, contact = str(self._field.value), self.session.shown.contact
        heights = np.asarray(contact.heights)
        fields = masked_fields(contact) | {"heights": heights - np.mean(heights)}
        if name == "displacement":
            fields[name] = np.asarray(contact.displacement)
        self._map.show(name, fields[name])

    def _show_point(self, event: Any) -> None:
        """Draws the contact, its point among the curves, and the block; then errors; then bars."""
        shown, contact = event.new, event.new.contact
        if shown.derivatives is not None:
            self._bars.show(shown.model.stepped(shown.values), shown.derivatives)
            return
        content = shown.document.content
        for name in ("friction", "contact_area"):
            self._lines[name].mark(content["load"]["velocity"], *shown.number(name))
        if shown.warnings is not None:
            return
        self._show_map()
        names = [*layers_in_words(content, ", "), base_name(content)]
        thickness = [layer["thickness"] for layer in content.get("layers", [])]
        self._block.show(
            np.array(thickness), names, content["base"]["kind"], np.asarray(contact.heights),
            float(shown.model.surface.grid.size[0]),
        )  # fmt: skip


def _pane_of(figure: Any, flex: str = "") -> Any:
    size: dict[str, Any] = {"width": figure.width} if figure.sizing_mode == "fixed" else WIDE
    pane = pn.pane.Bokeh(figure, **{**size, "margin": 0})
    return pn.Column(pane, **WIDE, styles=_flex(flex)) if flex and size is WIDE else pane


def _flex(wanted: str) -> dict[str, str]:
    return {"flex": wanted, "min-width": "0", "max-width": "100%"}


def _said(refused: str, message: str, error: bool) -> str:
    return paragraph(refused, error=True) + paragraph(message, error)


def _warnings(shown: ShownPoint | None) -> str:
    if shown is None:
        return ""
    of_law = "Curves of the mean field are those of a hard wall, without [law]."
    scene = shown.model.document.scene
    known = [of_law] if scene.law is not None else []
    of_files = [for_page(text, read_moduli) for text in scene.assumed]
    of_files += [for_page(text, read_surface) for text in shown.model.surface.warnings]
    return paragraph(" ".join([*of_files, *(shown.warnings or ()), *known]))


def _headline(shown: ShownPoint | None, pinned: ShownPoint | None) -> str:
    """Title and numbers of a point, with their differences from a pinned one."""
    if shown is None:
        return ""
    now, before = shown.contact, pinned and pinned.contact
    # What is in `u` does not fit beside the numbers on a phone.
    cells = {
        "friction": ("friction<u> μ</u>", 1, ""),
        "contact_area": ("contact area<u> A/A₀</u>", 100, ""), "mean_gap": ("mean gap", 1, "m"),
    }  # fmt: skip
    if now.heated is not None:
        cells["surface_rise"] = ("contact above bulk", 1, "K")
    text = f'<div class="title">{in_html(shown.document.content["title"])}</div>'
    for name, (title, scale, unit) in cells.items():
        change = ""
        if unit == "K":  # it has no error of its own
            value = float(getattr(now, name))
            spelt = f"{number(value, '.3g')} K"
        else:
            (value, error), noise = shown.number(name), now.noise.get(unit, 0.0)
            if unit == "m":
                noise = max(noise, NO_LENGTH)
            scaled, error = scale * value, scale * error
            spelt = with_error(scaled, error, unit, noise)
            if spelt.startswith("("):  # powers of ten are left to the error
                spelt = f"{number(scaled, '.5g', error)} ± {error:.2g}"
            spelt += " %" * (scale == 100)
        old = np.nan if before is None else float(getattr(before, name))
        if old and np.isfinite(value / old):
            change = f"<i>{100 * (value / old - 1):+.3g} %<u> from pinned</u></i>"
        text += f"<div><span>{title}{change}</span><b>{spelt}</b></div>"
    return f'<div class="head">{text}</div>'


def masked_fields(sliding):
    """Returns pressure [Pa] and gap [m], NaN where there is none: out of contact, and in it."""
    pressure, gap = np.asarray(sliding.pressure), np.asarray(sliding.gap)
    touches = pressure > 0
    return {
        "pressure": np.where(touches, pressure, np.nan),
        "gap": np.where(touches, np.nan, np.maximum(gap, 0)),
    }
