"""Knobs: the numbers of a scenery that a page varies, with their ranges.

Every number with a usual range (`core/quantities.py`) has a knob, which acts by its path.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..core.parameters import arrays, with_values
from ..core.quantities import Usual, quantity_of
from ..materials.material import Prony
from ..materials.shift import WLF, TabulatedShift, shifts_in
from .entries import read_entry
from .scenery import Scenery, layer_of, part_at, table_key

ABOVE_VOGEL = 10.0  # K above the Vogel temperature, where WLF diverges


class Knob(NamedTuple):
    """A number that the page varies.

    **Fields:**

    - `paths`: in the scenery; their numbers change together.
    - `label`: on the page.
    - `usual`: unit, range and step of its quantity.
    - `value`, `low`, `high`: in the scene, and its range [SI].
    - `scales`: whether the value multiplies what is at the paths, as the moduli of a series, whose
      relaxation times then keep their meaning.
    """

    paths: tuple[str, ...]
    label: str
    usual: Usual
    value: float
    low: float
    high: float
    scales: bool = False

    @property
    def unit(self) -> str:
        return self.usual.unit

    @property
    def factor(self) -> float:
        """The SI unit in the unit on the page."""
        return 1 / read_entry("1", self.unit)

    @property
    def logarithmic(self) -> bool:
        return self.usual.step is None

    def step_size(self, value: float) -> float:
        """Returns the change [SI] for which the page shows derivatives, at a value [SI]."""
        step = self.usual.step
        if step is None:
            return 0.01 * value
        return step if value + step <= self.high else -step

    def stepped(self, value: float) -> str:
        """Returns the label with this change, such as "rms slope +1 %"."""
        if self.logarithmic:
            return f"{self.label} +1 %"
        unit = f" {self.unit}".removesuffix(" 1")
        return f"{self.label} {self.step_size(value):+g}{unit}".replace("-", "−")

    def read(self, text: str) -> float:
        """Returns the value [SI] of a text, see `read_entry`.

        **Raises:** `ValueError` for other texts, units of another dimension, and out of range.
        """
        low, high = (f"{at * self.factor:.6g}" for at in (self.low, self.high))
        said, unit = text.strip()[:40] or "nothing", f" {self.unit}".removesuffix(" 1")
        allowed = f"Enter a number between {low} and {high}{unit}."
        try:
            value = read_entry(text, self.unit)
        except ValueError as error:
            raise ValueError(f"`{self.label}`: {said} is refused: {error}. {allowed}") from error
        if not self.low <= value <= self.high:
            raise ValueError(f"`{self.label}`: {said} is refused. {allowed}")
        return value


def knobs_of(
    scenery: Scenery, materials: Mapping[str, str], speeds: tuple[float, float]
) -> tuple[Knob, ...]:
    """Returns the knobs of a scenery: load, thicknesses, materials, surface, shear and heating.

    **Arguments:**

    - `scenery`: of the scene.
    - `materials`: their names by their paths in the block.
    - `speeds`: lowest and highest velocity [m/s].

    **Raises:** `ValueError` for a layer of zero thickness.
    """
    found: dict[str, Knob] = {}
    for path, number in sorted(arrays(scenery).items(), key=_group):
        (owner, _, last), key = path.rpartition("."), table_key(scenery, path)
        part: Any = part_at(scenery, owner) if owner else scenery
        is_series = isinstance(part, Prony) and last == "equilibrium"
        if is_series and float(number) == 0:  # a liquid has no relaxed modulus
            key, number = "glassy", part.glassy
        quantity, laws = quantity_of(key, type(part).__name__), shifts_in(scenery.stack)
        usual = None if quantity is None or number.ndim else quantity.usual
        # The bulk and shear parts of a material do not use their Poisson's ratio.
        unused = last == "poisson" and owner.endswith((".bulk", ".shear"))
        if usual is None or unused or (path == "temperature" and not laws):
            continue
        value, name = float(number), materials.get(owner.removeprefix("stack."))
        label = usual.label if name is None else f"{name}: {usual.label}"
        if last == "thickness":
            label = f"layer {layer_of(path) + 1} {usual.label}"
            if value == 0:
                raise ValueError(f"`{label}` = 0 is refused: remove the layer.")
        if value == 0 and usual.step is None:
            continue  # no range
        low, high = speeds if path == "velocity" else usual.ends(value)
        if path == "temperature":
            low, high = _within_laws(low, high, laws)
        together = (path, f"{owner}.strengths") if is_series else (path,)
        if label in found:  # a material in several places
            together = (*found[label].paths, *together)
        found[label] = Knob(together, label, usual, value, low, high, is_series)
    return tuple(found.values())


def _group(entry: tuple[str, Any]) -> int:
    """Load and thicknesses come before materials, and these before the rest."""
    path, _ = entry
    if "." not in path or path.endswith(".thickness"):
        return 0
    return 1 if path.startswith("stack.") else 2


def _within_laws(low: float, high: float, laws: Sequence[Any]) -> tuple[float, float]:
    """A range of temperatures without those where a table of shifts ends, and WLF diverges."""
    for law in laws:
        if isinstance(law, TabulatedShift):
            low, high = max(low, float(law.temperatures[0])), min(high, float(law.temperatures[-1]))
        elif isinstance(law, WLF):
            low = max(low, float(law.reference - law.c2) + ABOVE_VOGEL)
    return low, high


def turned(scenery: Scenery, knobs: Sequence[Knob], values: Any) -> Scenery:
    """Returns the scenery with its knobs at other values [SI], which JAX may trace."""
    numbers, changed = arrays(scenery), {}
    for knob, value in zip(knobs, values, strict=True):
        for path in knob.paths:
            changed[path] = numbers[path] * (value / knob.value) if knob.scales else value
    return with_values(scenery, changed)
