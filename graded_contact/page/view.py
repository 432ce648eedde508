"""A page: sliders and tools next to figures, bound to the parameters of a session."""

import html
import io
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn

from ..core.display import with_unit
from ..plot.contact import masked_fields
from . import document as scenes
from .document import Document
from .downloads import Shown, to_csv, to_hdf5, to_pdf
from .figures import HEIGHT, Bars, Block, Map, new_lines
from .session import Session
from .widgets import LARGEST, Dropper, Slider

SIDE = 304  # pixels
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
SMALL: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (4, 8)}
STYLES = """
.head {display: flex; gap: 30px; align-items: baseline; white-space: nowrap; color: #2b2f36;
  font-family: system-ui, sans-serif}
.head b {font-size: 19px; font-weight: 600; font-variant-numeric: tabular-nums}
.head span {font-size: 12px; color: #5b616b; display: block}
.title {font-size: 14px; font-weight: 600; width: 340px; height: 38px; overflow: hidden;
  white-space: normal; line-height: 1.3}
.say {font: 12px system-ui, sans-serif; line-height: 1.35; max-height: 84px; overflow-y: auto;
  overflow-wrap: anywhere; color: #5b616b}
.error {color: #a33600}
"""
TEXT: dict[str, Any] = {"stylesheets": [STYLES], "margin": (0, 8), "width": SIDE - 20}
# How to make a part of a surface periodic, in words and in the words of `read_surface`.
EDGES = {
    "joined (harmonic)": "harmonic", "mirrored: twice as long": "mirror",
    "tapered to zero": "window", "periodic already": "none",
}  # fmt: skip
NEW = "a new elastic material"


class Page(pn.viewable.Viewer):
    """A scene with sliders, for a browser or a notebook; `session.update` starts the computation.

    **Arguments:**

    - `document`: the scene.
    - `folder`: the page writes into this folder only.
    """

    def __init__(self, document: Document, folder: Path):
        super().__init__()
        self.session = Session(document, folder)
        self.sliders: list[Slider] = []
        self._plots, self._knobs = pn.Column(**WIDE), pn.Column(**WIDE)
        self._layers = pn.Column(**SMALL)
        self._material: Any = pn.widgets.Select(label="of material", **SMALL)
        self._layout = self._laid_out()
        watch = self.session.param.watch
        watch(self._show_model, "model")
        watch(self._show_curves, ["curves", "pinned"])
        watch(self._show_point, "shown")
        # After all others: figures of a notebook are sent by hand.
        watch(self._push, list(self.session.param), precedence=1)

    def __panel__(self) -> Any:
        return self._layout

    def _push(self, *_: Any) -> None:
        if not pn.state.curdoc:
            pn.io.push_notebook(self._layout)

    def _laid_out(self) -> pn.Row:
        session, here = self.session, self.session.param
        spinner = pn.indicators.LoadingSpinner(
            value=here.busy, visible=here.busy, size=20, margin=(8, 4, 4, 8)
        )
        status = pn.pane.HTML(pn.bind(_words, here.status), **TEXT | {"margin": (10, 2)})
        pin = pn.widgets.Toggle(
            label="Pin curves to compare", margin=(2, 8), width=SIDE - 24,
            disabled=here.curves.rx.is_(None),
        )  # fmt: skip
        pin.param.watch(
            lambda event: session.param.update(pinned=session.curves if event.new else None),
            "value",
        )
        tabs = pn.Tabs(
            ("Sliders", self._knobs), ("Layers", self._layers), ("Data", self._data()),
            ("Save", self._saving()), sizing_mode="stretch_width", margin=(2, 4),
        )  # fmt: skip
        side = pn.Column(
            pn.Row(spinner, status, margin=0),
            pin,
            pn.pane.HTML(pn.bind(_words, here.message, here.error), **TEXT),
            pn.pane.HTML(pn.bind(_warnings, here.shown), **TEXT),
            tabs,
            width=SIDE,
            margin=0,
            styles={"border-right": "1px solid #e3e6ea", "overflow": "hidden auto",
                    "height": "100vh"},
        )  # fmt: skip
        head = pn.pane.HTML(
            pn.bind(_headline, here.shown), height=46, margin=(6, 8, 0, 12),
            stylesheets=[STYLES], sizing_mode="stretch_width",
        )  # fmt: skip
        main = pn.Column(head, self._plots, sizing_mode="stretch_width", margin=(0, 6))
        return pn.Row(side, main, styles={"background": "white"}, **WIDE)

    def _data(self) -> pn.Column:
        """The tab that takes files of the user."""
        options: dict[str, Any] = {
            "unit": pn.widgets.TextInput(placeholder="um", label="unit of its numbers", width=125),
            "size": pn.widgets.FloatInput(
                value=None, placeholder="1e-3", label="edge length [m]", width=125
            ),
            "periodic": pn.widgets.Select(label="its edges", options=EDGES, **SMALL),
        }
        tab = pn.Column(**SMALL)

        def moduli() -> Any:
            return partial(scenes.with_moduli, name=str(self._material.value))

        def topography() -> Any:
            values = {name: widget.value for name, widget in options.items() if widget.value}
            return partial(scenes.with_topography, options=values)

        def dropper(change: Callable[[], Any]) -> Dropper:
            new = Dropper(**SMALL)
            new.param.watch(lambda event: self.session.show_message(event.new), "refusal")
            new.param.watch(partial(dropped, change), "value")
            return new

        def dropped(change: Callable[[], Any], event: Any) -> None:
            for name, data in event.new.items():
                self.session.take_file(name, data, change())
            # A fresh dropper: the browser shows refused files as complete too.
            tab[tab.objects.index(event.obj)] = dropper(change)

        tab[:] = [
            _heading("Your moduli (DMA or rheometer, over frequency)"),
            self._material, dropper(moduli),
            _heading("Your topography"),
            pn.Row(options["unit"], options["size"], margin=0), options["periodic"],
            dropper(topography),
            _heading(f"At most {LARGEST} MB; stored in {self.session.folder.name}"),
        ]  # fmt: skip
        return tab

    def _saving(self) -> pn.Column:
        """The tab that saves the scene and offers files."""
        wide: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (6, 8)}
        name: Any = pn.widgets.TextInput(label="name of the scene", value="explored", **wide)
        save = pn.widgets.Button(label="Save scene (TOML)", color="primary", **wide)
        save.on_click(lambda _: self.session.save(name.value))
        kinds = {
            "csv": ("Curves (CSV)", to_csv), "h5": ("Everything (HDF5)", to_hdf5),
            "pdf": ("Figure (PDF)", to_pdf),
        }  # fmt: skip
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
        model, content = self.session.model, self.session.model.document.content
        self.sliders = [Slider(knob) for knob in model.knobs]
        for i, slider in enumerate(self.sliders):
            set_value = partial(self.session.set_value, model, i)
            slider.param.watch(lambda event, set_value=set_value: set_value(event.new), "value")
            slider.param.watch(lambda event: self.session.show_message(event.new), "refusal")
        self._lines, self._bars, self._block = new_lines(model.highest), Bars(model.knobs), Block()
        self._maps = {name: Map(name, model.size) for name in ("pressure", "gap")}
        lines, maps = self._lines, self._maps
        rows = (
            (self._block, lines["modulus"], lines["loss_tangent"]),
            (lines["friction"], lines["contact_area"]),
            (maps["pressure"], maps["gap"], self._bars),
        )
        self._plots[:] = [pn.Row(*(_drawn(part.figure) for part in row), **WIDE) for row in rows]
        self._knobs[:] = self.sliders
        names = list(content["materials"])
        self._material.options = names
        chosen: Any = pn.widgets.Select(label="one more on top, of", options=[NEW, *names], **SMALL)
        add = pn.widgets.Button(label="Add layer", color="primary", **SMALL)
        add.on_click(lambda _: self.session.change(
            partial(scenes.with_layer, material=None if chosen.value == NEW else chosen.value)
        ))  # fmt: skip
        layers = []
        for i, layer in enumerate(content.get("layers", [])):
            button = pn.widgets.Button(label="Remove", width=80, margin=(2, 8))
            button.on_click(
                lambda _, i=i: self.session.change(partial(scenes.without_layer, index=i))
            )
            name = f"{i + 1}  {scenes.layer_name(layer)}"
            layers.append(pn.Row(pn.pane.Str(name, width=150, margin=(8, 8)), button, margin=0))
        base = pn.pane.Str(f"base  {_base_name(content)}", margin=(8, 8))
        heading = _heading("From the loaded surface downwards")
        self._layers[:] = [heading, *layers, base, chosen, add]

    def _show_curves(self, *events: Any) -> None:
        for line in self._lines.values():
            line.show(self.session.curves, self.session.pinned)
        if any(event.name == "curves" for event in events):
            self._bars.fade(0.35)

    def _show_point(self, event: Any) -> None:
        """Draws the contact, its point among the curves, and the block; then the derivatives."""
        shown, contact = event.new, event.new.contact
        if shown.derivatives is not None:
            self._bars.show(shown.derivatives)
            return
        for name, field in masked_fields(contact.sliding).items():
            self._maps[name].show(field)
        sliding, velocity = contact.sliding, contact.velocity
        self._lines["friction"].mark(velocity, float(sliding.friction))
        self._lines["contact_area"].mark(velocity, float(sliding.contact_area_smooth))
        content = shown.model.document.content
        settings = zip(shown.model.knobs, shown.values, strict=True)
        thickness = [value for knob, value in settings if knob.quantity == "thickness"]
        names = [
            f"{scenes.layer_name(layer)}, {with_unit(depth, 'm')}"
            for layer, depth in zip(content.get("layers", []), thickness, strict=True)
        ]
        self._block.show(
            np.array(thickness), [*names, _base_name(content)], content["base"]["kind"],
            contact.heights, float(shown.model.size[0]),
        )  # fmt: skip


def _drawn(figure: Any) -> Any:
    size: dict[str, Any] = {"width": figure.width} if figure.sizing_mode == "fixed" else WIDE
    return pn.pane.Bokeh(figure, height=HEIGHT, **{**size, "margin": 0})


def _heading(text: str) -> pn.pane.HTML:
    return pn.pane.HTML(_words(text), stylesheets=[STYLES], margin=(8, 8, 2, 8))


def _base_name(content: dict[str, Any]) -> str:
    return content["base"].get("material", content["base"]["kind"])


def _words(text: str, error: bool = False) -> str:
    kind = "say error" if error else "say"
    return f'<div class="{kind}">{html.escape(text)}</div>' if text else ""


def _warnings(shown: Shown | None) -> str:
    return _words(" ".join(shown.contact.sliding.caveats)) if shown else ""


def _headline(shown: Shown | None) -> str:
    if shown is None:
        return ""
    sliding = shown.contact.sliding
    numbers = {
        "friction μ [1]": f"{float(sliding.friction):.4g} ± {float(sliding.friction_error):.0e}",
        "contact area A/A₀": f"{100 * float(sliding.contact_area_smooth):.3g} %",
        "mean gap": with_unit(float(sliding.mean_gap), "m"),
        "error of the pressure": f"{float(sliding.error):.0e}",
    }
    cells = "".join(
        f"<div><span>{name}</span><b>{value}</b></div>" for name, value in numbers.items()
    )
    title = html.escape(shown.model.scene.title)
    return f'<div class="head"><div class="title">{title}</div>{cells}</div>'
