"""Sliders for knobs, each with a field for an exact number in the unit of its label."""

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import panel as pn

from .knobs import Knob

STEPS = 400  # positions of a slider
DIGITS = 4  # of a number that a slider gives: what is shown is what is used
FIELD = """input {height: 28px; min-height: 28px; padding: 2px 6px !important}
.bk-spin-btn {display: none !important}"""
STYLE = ":host {--design-primary-color: #0072B2;} label {font-size: 12px; margin-bottom: -2px;}"


class Prompt(pn.widgets.FloatSlider):
    """A slider that tells its value at once, not when Panel has waited 50 ms for more."""

    _priority_changes: ClassVar[list[str]] = ["value"]


class Slider:
    """One knob: a slider, logarithmic where the knob is, and a field.

    **Arguments:**

    - `knob`: what is turned.
    - `turned`: called after a change.
    - `refused`: called with what is wrong with a number in the field.
    """

    def __init__(self, knob: Knob, turned: Callable[[], None], refused: Callable[[str], None]):
        self.knob, self.value = knob, knob.value
        self._turned, self._refused, self._following = turned, refused, False
        low, high = self._place(knob.low), self._place(knob.high)
        self._slider: Any = Prompt(
            label=f"{knob.label} [{knob.unit}]", start=low, end=high, step=(high - low) / STEPS,
            value=self._place(knob.value), show_value=False, sizing_mode="stretch_width",
            margin=(1, 4, 1, 8), stylesheets=[STYLE],
        )  # fmt: skip
        self._field: Any = pn.widgets.FloatInput(
            value=self._shown(),
            width=70,
            margin=(4, 8, 0, 0),
            align="end",
            stylesheets=[FIELD],
        )
        self._slider.param.watch(self._slid, "value")
        self._field.param.watch(self._typed, "value")
        self.view = pn.Row(self._slider, self._field, sizing_mode="stretch_width", margin=0)

    def _place(self, value: float) -> float:
        return math.log10(value) if self.knob.logarithmic else value

    def _shown(self) -> float:
        return float(f"{self.value * self.knob.factor:.6g}")

    def _slid(self, event: Any) -> None:
        if self._following:
            return
        value = 10**event.new if self.knob.logarithmic else event.new
        value = min(max(float(f"{value:.{DIGITS}g}"), self.knob.low), self.knob.high)
        if value != self.value:
            self._set(value, self._field, self._shown)

    def _typed(self, event: Any) -> None:
        if self._following:
            return
        value = None if event.new is None else float(f"{event.new / self.knob.factor:.12g}")
        try:
            self.knob.check(value)
        except ValueError as error:
            self._refused(str(error))
            self._follow(self._field, self._shown())
            return
        assert value is not None
        self._set(value, self._slider, lambda: self._place(self.value))

    def _set(self, value: float, other: Any, shown: Callable[[], float]) -> None:
        self.value = value
        self._follow(other, shown())
        self._turned()

    def _follow(self, widget: Any, value: float) -> None:
        self._following = True
        widget.value = value
        self._following = False


class Sliders:
    """Sliders of all knobs; `values` are where they stand [SI]."""

    def __init__(
        self,
        knobs: Sequence[Knob],
        turned: Callable[[], None],
        refused: Callable[[str], None],
    ):
        self._sliders = [Slider(knob, turned, refused) for knob in knobs]
        self.view = pn.Column(
            *(slider.view for slider in self._sliders), sizing_mode="stretch_width", margin=0
        )

    @property
    def values(self) -> tuple[float, ...]:
        return tuple(slider.value for slider in self._sliders)
