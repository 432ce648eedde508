"""Widgets of a page that Panel lacks: a slider of a knob, and a place to drop a limited file."""

import math
import weakref
from typing import Any, ClassVar

import panel as pn
import param

from .knobs import Knob

STEPS = 400  # positions of a slider
DIGITS = 4  # of a number from a slider: the page shows the number that it uses
FIELD = """input {height: 28px; min-height: 28px; padding: 2px 6px !important}
.bk-spin-btn {display: none !important}"""
STYLE = ":host {--design-primary-color: #0072B2;} label {font-size: 12px; margin-bottom: -2px;}"
LARGEST = 64  # MB of one file
CHUNK = 4_000_000  # bytes of one message
UNFINISHED = 4 * LARGEST  # MB of unfinished uploads of all pages together


class _PromptSlider(pn.widgets.FloatSlider):
    """A slider that sends its value at once: Panel waits 50 ms for more."""

    _priority_changes: ClassVar[list[str]] = ["value"]


class Slider(pn.viewable.Viewer):
    """A slider of one knob, logarithmic if the knob is, with a field for an exact number."""

    value = param.Number(doc="Value of the knob [SI].")
    refusal = param.String(doc="Why the last number in the field is not used; or empty.")

    def __init__(self, knob: Knob):
        super().__init__(value=knob.value)
        self._knob = knob
        low, high = self._position(knob.low), self._position(knob.high)
        self._slider: Any = _PromptSlider(
            label=f"{knob.label} [{knob.unit}]", start=low, end=high, step=(high - low) / STEPS,
            value=self._position(knob.value), show_value=False, sizing_mode="stretch_width",
            margin=(1, 4, 1, 8), stylesheets=[STYLE],
        )  # fmt: skip
        self._field: Any = pn.widgets.FloatInput(
            value=self._rounded(), width=70, margin=(4, 8, 0, 0), align="end", stylesheets=[FIELD]
        )
        self._slider.param.watch(self._slide, "value")
        self._field.param.watch(self._enter, "value")

    def __panel__(self) -> pn.Row:
        return pn.Row(self._slider, self._field, sizing_mode="stretch_width", margin=0)

    def _position(self, value: float) -> float:
        return math.log10(value) if self._knob.logarithmic else value

    def _rounded(self) -> float:
        return float(f"{self.value * self._knob.factor:.6g}")

    def _slide(self, event: Any) -> None:
        if event.new == self._position(self.value):
            return  # it follows the field
        value = 10**event.new if self._knob.logarithmic else event.new
        value = float(f"{value:.{DIGITS}g}")
        self.value = min(max(value, self._knob.low), self._knob.high)
        self._field.value = self._rounded()

    def _enter(self, event: Any) -> None:
        if event.new == self._rounded():
            return  # it follows the slider
        self.refusal = ""
        value = None if event.new is None else float(f"{event.new / self._knob.factor:.12g}")
        try:
            value = self._knob.check(value)
        except ValueError as error:
            self.refusal = str(error)
            self._field.value = self._rounded()
            return
        self.value = value
        self._slider.value = self._position(value)


class Dropper(pn.widgets.FileDropper):
    """A place to drop a file of `LARGEST` MB at most, also if a browser sends more.

    A new file replaces an unfinished one. `refusal` is the reason why a file was refused.
    """

    refusal = param.String()
    _rename: ClassVar[dict[str, Any]] = {"refusal": None}
    _all: ClassVar[weakref.WeakSet["Dropper"]] = weakref.WeakSet()

    def __init__(self, **params: Any):
        super().__init__(max_file_size=f"{LARGEST}MB", chunk_size=CHUNK, previews=[], **params)
        self._all.add(self)

    @property
    def unfinished(self) -> int:
        """Bytes of unfinished files."""
        return sum(len(part) for parts in self._file_buffer.values() for part in parts)

    def _process_event(self, event: Any) -> None:
        name, data = event.data.get("name"), event.data.get("data", b"")
        if event.event_name == "upload_event":
            if event.data.get("chunk") == 1:
                self._file_buffer.clear()
                self.refusal = ""
            elif name not in self._file_buffer:
                return  # the rest of a refused file
            reason = ""
            if self.unfinished + len(data) > LARGEST * 10**6:
                reason = f"it has more than {LARGEST} MB."
            elif sum(each.unfinished for each in self._all) + len(data) > UNFINISHED * 10**6:
                reason = "the server is receiving too many files. Try again later."
            if reason:
                self._file_buffer.clear()
                self.refusal = f"`{name}` is refused: {reason}"
                return
        super()._process_event(event)
