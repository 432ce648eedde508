"""A page: sliders and tools next to figures, bound to the parameters of a session."""

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn

from ..core.display import number, with_error
from ..core.escaping import in_html
from ..plot.contact import masked_fields
from ..scenes.described import base_name, layer_name, layers_in_words
from . import document as tables
from .downloads import Shown, to_csv, to_hdf5
from .entries import read_entry
from .figures import Bars, BlockPicture, Map, new_lines
from .session import Session
from .widgets import LARGEST_DROP, Browser, Dropper, Slider

SIDE = 304  # pixels
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
SMALL: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (4, 8)}
STYLES = """
.head {display: flex; flex-wrap: wrap; gap: 2px 30px; align-items: baseline; color: #2b2f36;
  font-family: system-ui, sans-serif}
.head b {font-size: 19px; font-weight: 600; font-variant-numeric: tabular-nums}
.head span, .head i {font-size: 12px; color: #5b616b; display: block}
.head i {display: inline; margin-left: 6px}
.title {font-size: 14px; font-weight: 600; flex: 1 1 260px; max-width: 420px; line-height: 1.3;
  overflow-wrap: anywhere}
.say {font: 12px system-ui, sans-serif; line-height: 1.35; overflow-wrap: anywhere;
  color: #5b616b}
.error {color: #a33600}
"""
# On a phone the sliders are below the numbers, and the figures below the sliders.
HEAD = """:host {position: sticky; top: 0; z-index: 2; background: white; padding: 4px 12px;
  border-bottom: 1px solid #e3e6ea; box-sizing: border-box}"""
ASIDE = f""":host {{flex: 1 1 {SIDE}px; min-width: 0; padding-bottom: 8px}}
@media (min-width: 900px) {{:host {{position: sticky; top: 64px; height: calc(100vh - 64px);
  overflow: hidden auto; max-width: {SIDE}px; border-right: 1px solid #e3e6ea}}}}"""
HALF: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (4, 8), "min_width": 60}
TEXT: dict[str, Any] = {"stylesheets": [STYLES], "margin": (0, 8), **SMALL}
MAPS = {
    "pressure": "pressure", "gap": "gap", "displacement": "displacement", "surface": "heights",
}  # fmt: skip
# How to make a part of a surface periodic, in words and in the words of `read_surface`.
EDGES = {
    "joined (harmonic)": "harmonic", "mirrored: twice as long": "mirror",
    "tapered to zero": "window", "periodic already": "none",
}  # fmt: skip
NEW_MATERIAL = "a new elastic material"
LONGEST_NAME = 40  # of a new material


class Page(pn.viewable.Viewer):
    """A scene with sliders, for a browser or a notebook, which computes when it is shown.

    **Arguments:**

    - `document`: the scene.
    - `folder`: the page writes into this folder only.
    """

    def __init__(self, document: tables.Document, folder: Path):
        super().__init__()
        self.session = Session(document, folder)
        self.sliders: list[Slider] = []
        self._plots, self._knobs = pn.Column(**WIDE), pn.Column(**WIDE)
        self._layers = pn.Column(**WIDE)
        self._chosen: Any = pn.widgets.Select(
            label="Add a layer of", options={NEW_MATERIAL: ""}, value="", **SMALL
        )
        self._material: Any = pn.widgets.Select(label="of material", **SMALL)
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
        status = pn.pane.HTML(pn.bind(_words, here.status), **TEXT | {"margin": (10, 8)})
        pin = pn.widgets.Toggle(
            label="Pin curves and numbers to compare", **SMALL, disabled=here.shown.rx.is_(None),
        )  # fmt: skip
        pin.param.watch(
            lambda event: session.show(pinned=session.shown if event.new else None), "value"
        )
        tabs = pn.Tabs(
            ("Sliders", self._knobs), ("Layers", self._adding()), ("Data", self._data()),
            ("Save", self._saving()), sizing_mode="stretch_width", margin=(2, 4),
        )  # fmt: skip
        browser = Browser(width=0, margin=0)
        browser.param.watch(lambda _: pn.state.execute(session.update), "ready")
        side = pn.Column(
            pn.Row(spinner, status, browser, **WIDE),
            pin,
            pn.pane.HTML(pn.bind(_words, here.message, here.error), **TEXT),
            pn.pane.HTML(pn.bind(_warnings, here.shown), **TEXT),
            tabs,
            stylesheets=[ASIDE], **WIDE,
        )  # fmt: skip
        head = pn.pane.HTML(
            pn.bind(_headline, here.shown, here.pinned), stylesheets=[STYLES, HEAD],
            sizing_mode="stretch_width", margin=0, styles={"flex": "1 0 100%"}, min_height=56,
        )  # fmt: skip
        main = pn.Column(self._plots, **WIDE, styles=_flex("1000 1 600px"))
        return pn.FlexBox(head, side, main, styles={"background": "white"}, gap="0", **WIDE)

    def _adding(self) -> pn.Column:
        """The tab that adds layers, above those of the scene: so its button stays in its place."""
        name: Any = pn.widgets.TextInput(
            label="name of the new material", value=tables.NEW_NAME, max_length=LONGEST_NAME,
            disabled=self._chosen.param.value.rx.bool(), **SMALL,
        )  # fmt: skip
        add = pn.widgets.Button(label="Add layer", color="primary", **SMALL)
        add.on_click(lambda _: self.session.change(
            partial(tables.with_layer, material=self._chosen.value or None, name=name.value)
        ))  # fmt: skip
        return pn.Column(self._chosen, name, add, self._layers, **SMALL)

    def _data(self) -> pn.Column:
        """The tab that takes files of the user."""
        options: dict[str, Any] = {
            "unit": pn.widgets.TextInput(placeholder="um", label="unit of its heights", **HALF),
            "size": pn.widgets.TextInput(placeholder="1e-3", label="edge length [m]", **HALF),
            "periodic": pn.widgets.Select(label="its edges", options=EDGES, **SMALL),
        }
        tab = pn.Column(**SMALL)
        last: list[Any] = []  # name and data of the last topography

        def moduli(name: str, data: bytes) -> None:
            change = partial(tables.with_moduli, name=str(self._material.value))
            self.session.take_file(name, data, change)

        def topography(name: str, data: bytes) -> None:
            if last:  # the fields are those of the file before
                last.clear()
                for field, widget in options.items():
                    widget.value = "harmonic" if field == "periodic" else ""
            last[:] = [name, data]
            read_again()

        def read_again(*_: Any) -> None:
            if not last:
                return
            (file, data), given = last, options.items()
            values = {name: widget.value for name, widget in given if widget.value}
            try:
                if size := values.pop("size", ""):
                    values["size"] = read_entry(size, "m")
            except ValueError as error:
                text = f"`edge length`: {size} is refused: {error}. Enter a length, such as 1 mm."
                self.session.show_message(text)
                return
            self.session.take_file(file, data, partial(tables.with_topography, options=values))

        for widget in options.values():
            widget.param.watch(read_again, "value")

        def dropper(take: Callable[[str, bytes], None]) -> Dropper:
            def dropped(event: Any) -> None:
                for name, data in event.new.items():
                    take(name, data)
                # A fresh dropper: the browser shows refused files as complete too.
                tab[tab.objects.index(event.obj)] = dropper(take)

            new = Dropper(**SMALL)
            new.param.watch(lambda event: self.session.show_message(event.new), "refusal")
            new.param.watch(dropped, "value")
            return new

        tab[:] = [
            _heading("Your moduli over frequency (DMA, rheometer), or isotherms at several "
                     "temperatures"),
            self._material, dropper(moduli),
            _heading("Your topography"),
            pn.Row(options["unit"], options["size"], **WIDE), options["periodic"],
            dropper(topography),
            _heading("Unit, length and edges apply to the file that you dropped last; for the next "
                     "one they are empty again."),
            _heading(f"At most {LARGEST_DROP} MB; stored in {self.session.folder.name}"),
        ]  # fmt: skip
        return tab

    def _saving(self) -> pn.Column:
        """The tab that saves the scene and offers files."""
        wide: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (6, 8)}
        name: Any = pn.widgets.TextInput(label="name of the scene", value="explored", **wide)
        save = pn.widgets.Button(label="Save scene (TOML)", color="primary", **wide)
        save.on_click(lambda _: self.session.save(name.value))
        kinds = {"csv": ("Curves (CSV)", to_csv), "h5": ("Everything (HDF5)", to_hdf5)}
        downloads = [
            pn.widgets.FileDownload(
                callback=lambda write=write: io.BytesIO(write(self.session.shown)), label=label,
                filename=f"explored.{kind}", disabled=self.session.param.shown.rx.is_(None), **wide,
            )
            for kind, (label, write) in kinds.items()
        ]  # fmt: skip
        return pn.Column(name, save, *downloads, **WIDE)

    def _show_model(self, _: Any) -> None:
        """New sliders and figures, for another scene."""
        model = self.session.model
        self.sliders = [
            Slider(knob, value) for knob, value in zip(model.knobs, model.values, strict=True)
        ]
        for i, slider in enumerate(self.sliders):
            set_value = partial(self.session.set_value, model, i)
            slider.param.watch(lambda event, set_value=set_value: set_value(event.new), "value")
            slider.param.watch(lambda event: self.session.show_message(event.new), "refusal")
        self._knobs[:] = self.sliders
        heated = model.document.scene.heating is not None
        self._lines, self._bars = new_lines(model.waves, heated), Bars(model.knobs, heated)
        self._block, self._map = BlockPicture(), Map(model.size)
        lines, chart = self._lines, pn.Column(self._field, _drawn(self._map.figure), **WIDE)
        chart.styles = _flex("0 1 480px")
        upper = (self._block, lines["friction"], lines["contact_area"])
        lower = [_drawn(lines[name].figure, "1 1 220px") for name in ("modulus", "loss_tangent")]
        right = pn.Column(_drawn(self._bars.figure), pn.FlexBox(*lower, gap="0", **WIDE),
                          **WIDE, styles=_flex("1 1 440px"))  # fmt: skip
        self._plots[:] = [
            pn.FlexBox(*(_drawn(part.figure, "1 1 270px") for part in upper), gap="0", **WIDE),
            pn.FlexBox(chart, right, gap="0", **WIDE),
        ]
        self._show_layers(model.document.content)

    def _show_layers(self, content: dict[str, Any]) -> None:
        """The layers of the scene, each with a button that removes it."""
        change, names = self.session.change, list(content["materials"])
        self._material.options = names
        self._chosen.options = {NEW_MATERIAL: ""} | {name: name for name in names}
        rows = []
        for i, layer in enumerate(content.get("layers", [])):
            button = pn.widgets.Button(label="Remove", width=80, margin=(2, 8), align="center")
            button.on_click(lambda _, i=i: change(partial(tables.without_layer, index=i)))
            rows.append(pn.Row(_heading(f"{i + 1}  {layer_name(layer)}"), button, **WIDE))
        top, base = "From the loaded surface downwards", f"base  {base_name(content)}"
        self._layers[:] = [_heading(top), *rows, _heading(base)]

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
        """Draws the contact, its point among the curves, and the block; then the derivatives."""
        shown, contact = event.new, event.new.contact
        if shown.derivatives is not None:
            self._bars.show(shown.model.stepped(shown.values), shown.derivatives)
            return
        self._show_map()
        content = shown.document.content
        for name in ("friction", "contact_area"):
            number, error = (float(getattr(contact, n)) for n in (name, f"{name}_error"))
            self._lines[name].mark(content["load"]["velocity"], number, error)
        names = [*layers_in_words(content, ", "), base_name(content)]
        thickness = [layer["thickness"] for layer in content.get("layers", [])]
        self._block.show(
            np.array(thickness), names, content["base"]["kind"], np.asarray(contact.heights),
            float(shown.model.size[0]),
        )  # fmt: skip


def _drawn(figure: Any, flex: str = "") -> Any:
    size: dict[str, Any] = {"width": figure.width} if figure.sizing_mode == "fixed" else WIDE
    pane = pn.pane.Bokeh(figure, height=figure.height, **{**size, "margin": 0})
    return pn.Column(pane, **WIDE, styles=_flex(flex)) if flex and size is WIDE else pane


def _flex(wanted: str) -> dict[str, str]:
    return {"flex": wanted, "min-width": "0", "max-width": "100%"}


def _heading(text: str) -> pn.pane.HTML:
    return pn.pane.HTML(_words(text), stylesheets=[STYLES], margin=(8, 8, 2, 8))


def _words(text: str, error: bool = False) -> str:
    kind = 'say error" role="alert' if error else "say"
    return f'<div class="{kind}">{in_html(text)}</div>' if text else ""


def _warnings(shown: Shown | None) -> str:
    if shown is None:
        return ""
    of_law = "Curves of the mean field are those of a hard wall, without [law]."
    scene = shown.model.document.scene
    known = [of_law] if scene.law is not None else []
    of_files = *scene.assumed, *shown.model.surface.caveats
    return _words(" ".join([*of_files, *shown.contact.caveats, *known]))


def _headline(shown: Shown | None, pinned: Shown | None) -> str:
    """Title and numbers of a point, with their differences from a pinned one."""
    if shown is None:
        return ""
    now, before = shown.contact, pinned and pinned.contact
    cells = {
        "friction": ("friction μ", lambda μ: with_error(μ, float(now.friction_error))),
        "contact_area": (
            "contact area A/A₀ [%]",
            lambda area: with_error(100 * area, 100 * float(now.contact_area_error)),
        ),
        "mean_gap": (
            "mean gap",
            lambda gap: with_error(gap, float(now.mean_gap_error), "m", now.noise.get("m", 0.0)),
        ),
    }
    if now.heated is not None:
        cells["surface_rise"] = ("contact above bulk", lambda rise: f"{number(rise, '.3g')} K")
    text = f'<div class="title">{in_html(shown.document.content["title"])}</div>'
    for name, (words, spelt) in cells.items():
        value, change = float(getattr(now, name)), ""
        old = np.nan if before is None else float(getattr(before, name))
        if old and np.isfinite(value / old):
            change = f"<i>{100 * (value / old - 1):+.3g} % from pinned</i>"
        text += f"<div><span>{words}</span><b>{spelt(value)}</b>{change}</div>"
    return f'<div class="head">{text}</div>'
