"""How a page looks: sliders and tools beside figures, numbers above them."""

import html
import io
from typing import Any, Protocol, runtime_checkable

import numpy as np
import panel as pn

from ..core.display import with_unit
from .figures import HEIGHT, PALETTES, Bars, Map, Response, Sweep
from .model import Contact, Curves, Derivatives, Model
from .section import Section
from .shown import shown_field
from .sliders import Sliders
from .tools import Tools, layer_name

SIDE = 304  # pixels
WIDE: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 0}
STYLES = """
.head {display: flex; gap: 30px; align-items: baseline; white-space: nowrap; color: #2b2f36;
  font-family: system-ui, sans-serif}
.head b {font-size: 19px; font-weight: 600; font-variant-numeric: tabular-nums}
.head span {font-size: 12px; color: #5b616b; display: block}
.title {font-size: 14px; font-weight: 600; width: 340px; height: 38px; overflow: hidden;
  white-space: normal; line-height: 1.3}
.say {font: 12px system-ui, sans-serif; line-height: 1.35; max-height: 84px; overflow-y: auto;
  overflow-wrap: anywhere}
.refused {color: #a33600} .told {color: #5b616b}
.state {white-space: nowrap; font: 12px system-ui, sans-serif; color: #5b616b}
"""
DOWNLOADS = {"csv": "Curves (CSV)", "h5": "Everything (HDF5)", "pdf": "Figure (PDF)"}


@runtime_checkable
class Listener(Protocol):
    """What a view tells of."""

    def turned(self) -> None:
        """A slider moved."""

    def pinned(self, wanted: bool) -> None:
        """Curves are to be kept for comparison, or dropped."""

    def save(self, name: str) -> None:
        """The scene is to be saved."""

    def take(self, kind: str) -> bytes:
        """What is shown, as a file of a kind of `DOWNLOADS`."""
        ...


class View:
    """The widgets and figures of a page; `whole` is what Panel shows.

    **Arguments:**

    - `tools`: those of the page.
    - `listener`: what is told of what people do.
    """

    def __init__(self, tools: Tools, listener: Listener):
        self._tools, self._listener = tools, listener
        self.sliders: Sliders | None = None
        self._figures: dict[str, Any] = {}
        text: dict[str, Any] = {"stylesheets": [STYLES]}
        self._head: Any = pn.pane.HTML("", height=46, margin=(6, 8, 0, 12), **text,
                                       sizing_mode="stretch_width")  # fmt: skip
        self._refusal: Any = pn.pane.HTML("", width=SIDE - 20, margin=(0, 8), **text)
        self._note: Any = pn.pane.HTML("", width=SIDE - 20, margin=(0, 8), **text)
        self._busy: Any = pn.indicators.LoadingSpinner(value=True, size=20, margin=(8, 4, 4, 8))
        self._state: Any = pn.pane.HTML("", width=SIDE - 50, height=20, margin=(10, 2), **text)
        self._turning, self._plots = pn.Column(**WIDE), pn.Column(**WIDE)
        self._downloads = [self._download(kind, label) for kind, label in DOWNLOADS.items()]
        self._pin: Any = pn.widgets.Toggle(
            label="Pin curves to compare", margin=(2, 8), width=SIDE - 24, disabled=True
        )
        self._pin.param.watch(lambda event: listener.pinned(event.new), "value")
        tabs = pn.Tabs(
            ("Sliders", self._turning), ("Layers", tools.layers), ("Data", tools.files),
            ("Save", self._saving()), sizing_mode="stretch_width", margin=(2, 4),
        )  # fmt: skip
        side = pn.Column(
            pn.Row(self._busy, self._state, margin=0), self._pin, self._refusal, self._note, tabs,
            width=SIDE, margin=0,
            styles={"border-right": "1px solid #e3e6ea", "overflow": "hidden auto",
                    "height": "100vh"},
        )  # fmt: skip
        main = pn.Column(self._head, self._plots, sizing_mode="stretch_width", margin=(0, 6))
        self.whole = pn.Row(side, main, styles={"background": "white"}, **WIDE)

    def _saving(self) -> Any:
        wide: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": (6, 8)}
        name: Any = pn.widgets.TextInput(label="name of the scene", value="explored", **wide)
        save = pn.widgets.Button(label="Save scene (TOML)", color="primary", **wide)
        save.on_click(lambda _: self._listener.save(name.value))
        return pn.Column(name, save, *self._downloads, **WIDE)

    def _download(self, kind: str, label: str) -> Any:
        return pn.widgets.FileDownload(
            callback=lambda: io.BytesIO(self._listener.take(kind)), filename=f"explored.{kind}",
            label=label, disabled=True, sizing_mode="stretch_width", margin=(6, 8),
        )  # fmt: skip

    def show_model(self, model: Model) -> None:
        """New sliders and figures, for another scene."""
        size = np.asarray(model.surface.grid.size)
        self.sliders = Sliders(model.knobs, self._listener.turned, self.refuse)
        self._figures = f = {
            "block": Section(), "response": Response(model.highest), "sweep": Sweep(),
            "bars": Bars(model.knobs),
            "pressure": Map("Contact pressure", "Pa", PALETTES["pressure"], size),
            "gap": Map("Gap", "m", PALETTES["gap"], size),
        }  # fmt: skip
        rows = (
            (f["block"].figure, f["response"].modulus.figure, f["response"].loss.figure),
            (f["sweep"].friction.figure, f["sweep"].area.figure),
            (f["pressure"].figure, f["gap"].figure, f["bars"].figure),
        )
        self._plots[:] = [pn.Row(*map(_drawn, row), **WIDE) for row in rows]
        self._turning[:] = [self.sliders.view]
        self._tools.show(model.document)

    def show_curves(self, curves: Curves, pinned: Curves | None) -> None:
        """Draws response and mean field, and those to compare with."""
        self._figures["response"].show(curves, pinned)
        self._figures["sweep"].show(curves, pinned)
        self._pin.disabled = False

    def fade(self) -> None:
        """Shows that the bars are those of an earlier point."""
        self._figures["bars"].fade()

    def show_contact(self, model: Model, values: tuple[float, ...], contact: Contact) -> None:
        """Draws the contact, its point among the curves, and the block."""
        size = np.asarray(model.surface.grid.size)
        for name in ("pressure", "gap"):
            self._figures[name].show(shown_field(contact, name), size)
        self._figures["sweep"].mark(contact)
        content = model.document.content
        knobs = zip(model.knobs, values, strict=True)
        thickness = [value for knob, value in knobs if knob.quantity == "thickness"]
        names = [
            f"{layer_name(layer)}, {with_unit(depth, 'm')}"
            for layer, depth in zip(content.get("layers", []), thickness, strict=True)
        ]
        base = content["base"]
        self._figures["block"].show(
            np.array(thickness), [*names, base.get("material", base["kind"])],
            base["kind"], contact.heights, size,
        )  # fmt: skip
        self._head.object = _headline(model.scene.title, contact)
        self._note.object = _words("told", " ".join(contact.sliding.caveats))
        for button in self._downloads:
            button.disabled = False

    def show_derivatives(self, derivatives: Derivatives) -> None:
        """Draws what a step of each slider changes."""
        self._figures["bars"].show(derivatives)

    def refuse(self, text: str) -> None:
        """Shows why something was refused; nothing clears it."""
        self._refusal.object = _words("refused", text)

    def tell(self, text: str) -> None:
        """Shows a sentence."""
        self._refusal.object = _words("told", text)

    def state(self, text: str, busy: bool) -> None:
        """Shows what goes on."""
        self._state.object = f'<div class="state">{html.escape(text)}</div>'
        self._busy.value = self._busy.visible = busy


def _drawn(figure: Any) -> Any:
    size: dict[str, Any] = {"width": figure.width} if figure.sizing_mode == "fixed" else WIDE
    return pn.pane.Bokeh(figure, height=HEIGHT, **{**size, "margin": 0})


def _words(kind: str, text: str) -> str:
    return f'<div class="say {kind}">{html.escape(text)}</div>' if text else ""


def _headline(title: str, contact: Contact) -> str:
    found = contact.sliding
    numbers = {
        "friction μ [1]": f"{float(found.friction):.4g} ± {float(found.friction_error):.0e}",
        "contact area A/A₀": f"{100 * float(found.contact_area_smooth):.3g} %",
        "mean gap": with_unit(float(found.mean_gap), "m"),
        "error of the pressure": f"{float(found.error):.0e}",
    }
    cells = "".join(
        f"<div><span>{name}</span><b>{value}</b></div>" for name, value in numbers.items()
    )
    return f'<div class="head"><div class="title">{html.escape(title)}</div>{cells}</div>'
