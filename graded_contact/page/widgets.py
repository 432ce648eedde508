"""Widgets of a page that Panel lacks: sliders of knobs, the browser, and places to drop files."""

import weakref
from typing import Any, ClassVar

import panel as pn
import param

from ..plot.sweeps import ZERO_CELSIUS
from .knobs import Knob

POSITIONS = 400  # of a slider
SLIDER_DIGITS = 4  # of a number from a slider: the page shows the number that it uses

SLIDER = """
.knob {display: grid; grid-template-columns: 1fr 76px; gap: 0 8px; align-items: center;
  font: 12px system-ui, sans-serif; color: #2b2f36; padding: 2px 0}
label {grid-column: 1; overflow-wrap: anywhere} output {color: #5b616b; font-size: 11px}
input {width: 100%; box-sizing: border-box; margin: 0; accent-color: #0072B2}
input[type=text] {font: 13px system-ui, sans-serif; padding: 3px 6px; border: 1px solid #c3c8cf;
  border-radius: 4px}
input[aria-invalid=true] {border-color: #a33600; outline: 1px solid #a33600}
"""
LARGEST_DROP = 64  # MB of one file
UPLOAD_CHUNK = 4_000_000  # bytes of one message
UNFINISHED = 4 * LARGEST_DROP  # MB of unfinished uploads of all pages together


class Slider(pn.custom.JSComponent):
    """A slider of one knob, logarithmic if the knob is, with a field for an exact number.

    The browser shows and speaks the value in the unit of the knob.
    """

    value = param.Number(doc="Value of the knob [SI].")
    refusal = param.String(doc="Why the last text in the field is not used; or empty.")
    about = param.Dict(doc="The knob, for the browser.")
    # Panel waits 50 ms for more of other changes.
    _priority_changes: ClassVar[list[str]] = ["value"]
    _stylesheets: ClassVar[list[str]] = [SLIDER]
    _esm = """
export function render({model}) {
  const {label, unit, low, high, logarithmic, factor, steps, digits, zero} = model.about
  const box = document.createElement("div")
  box.className = "knob"
  box.innerHTML = `<label></label><output></output>
    <input type="range" min="0" max="${steps}"><input type="text" inputmode="decimal">`
  const [words, hint, slider, field] = box.children
  const named = unit == "1" ? label : `${label} [${unit}]`
  words.textContent = named
  slider.setAttribute("aria-label", label)
  field.setAttribute("aria-label", named)
  const position = value => steps * (logarithmic
    ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low))
  const at = share => logarithmic ? low * (high / low) ** share : low + (high - low) * share
  const draw = () => {
    const number = String(+(model.value * factor).toPrecision(6))
    hint.textContent = zero ? `${+(model.value - zero).toFixed(2)} °C` : ""
    slider.value = position(model.value)
    field.value = number
    const said = unit == "1" ? number : `${number} ${unit}`
    slider.setAttribute("aria-valuetext", zero ? `${said}, ${hint.textContent}` : said)
    slider.title = said
    field.setAttribute("aria-invalid", "false")
  }
  slider.addEventListener("input", () => {
    const value = +at(slider.value / steps).toPrecision(digits)
    model.value = Math.min(Math.max(value, low), high)
    draw()
  })
  field.addEventListener("change", () => model.send_msg(field.value))
  field.addEventListener("keydown", event => {
    if (event.key != "Enter") return
    field.blur()  // in JupyterLab the key alone changes nothing
    field.focus()
  })
  model.on("value", draw)
  model.on("msg:custom", refused => {
    if (!refused) draw()
    field.setAttribute("aria-invalid", refused)
  })
  draw()
  return box
}
"""

    def __init__(self, knob: Knob, value: float):
        names = ("label", "unit", "low", "high", "logarithmic", "factor")
        about: dict[str, Any] = {name: getattr(knob, name) for name in names}
        about["zero"] = ZERO_CELSIUS if knob.unit == "K" else 0
        about |= {"steps": POSITIONS, "digits": SLIDER_DIGITS}
        super().__init__(value=value, about=about, sizing_mode="stretch_width", margin=(1, 8))
        self._knob = knob
        # The field then shows the new value in place of a refused text.
        self.param.watch(lambda _: self.param.update(refusal=""), "value")

    def _handle_msg(self, data: Any) -> None:  # called by Panel
        self.enter(str(data))

    def enter(self, text: str) -> None:
        """Takes the text of the field, or says why not; the field then keeps it, to be mended."""
        self.refusal = ""
        try:
            self.value = self._knob.read(text)
        except ValueError as error:
            self.refusal = str(error)
        self._send_msg(bool(self.refusal))


class Browser(pn.custom.JSComponent):
    """The browser of a page: says when it shows the page."""

    ready = param.Boolean(doc="Whether the page is shown: changes before that are lost.")
    _esm = """
export function render({model}) {
  // Phones draw a page without this line as wide as on a desk.
  const meta = Object.assign(document.createElement("meta"), {name: "viewport",
    content: "width=device-width, initial-scale=1"})
  document.head.append(meta)
  model.on("after_render", () => { model.ready = true })
  return document.createElement("span")
}
"""


class Dropper(pn.widgets.FileDropper):
    """A place to drop a file of `LARGEST_DROP` MB at most, also if a browser sends more.

    A new file replaces an unfinished one. `refusal` is the reason why a file was refused.
    """

    refusal = param.String()
    _rename: ClassVar[dict[str, Any]] = {"refusal": None}
    _all: ClassVar[weakref.WeakSet["Dropper"]] = weakref.WeakSet()

    def __init__(self, **params: Any):
        super().__init__(
            max_file_size=f"{LARGEST_DROP}MB", chunk_size=UPLOAD_CHUNK, previews=[], **params
        )
        self._all.add(self)

    @property
    def unfinished(self) -> int:
        """Bytes of unfinished files."""
        return sum(len(part) for parts in self._file_buffer.values() for part in parts)

    def _process_event(self, event: Any) -> None:
        # The limit of Panel holds in the browser only, and a client may send what it likes.
        name, data = event.data.get("name"), event.data.get("data", b"")
        if event.event_name == "upload_event":
            if event.data.get("chunk") == 1:
                self._file_buffer.clear()
                self.refusal = ""
            elif name not in self._file_buffer:
                return  # the rest of a refused file
            reason = ""
            if self.unfinished + len(data) > LARGEST_DROP * 10**6:
                reason = f"it has more than {LARGEST_DROP} MB."
            elif sum(each.unfinished for each in self._all) + len(data) > UNFINISHED * 10**6:
                reason = "the server is receiving too many files. Try again later."
            if reason:
                self._file_buffer.clear()
                self.refusal = f"`{name}` is refused: {reason}"
                return
        super()._process_event(event)
