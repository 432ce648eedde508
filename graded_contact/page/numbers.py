"""The numbers that a page varies: loads, and the numbers of the bodies of a scene.

Each has a place in the scene file, where it is saved: a material that several layers share has one
number there, and one slider.
"""

import re
from typing import Any, NamedTuple

import numpy as np
import tomlkit

from ..core.display import unit_of
from ..core.parameters import paths
from ..core.quantities import quantity_of
from ..plot.sweeps import ZERO_CELSIUS, title_of
from ..scenes.scene import Scene

STEPS = 400  # of a slider
FACTOR, FACTOR_OF_VELOCITY = 30.0, 1e3  # a slider goes from 1/factor to factor of its number
KELVINS = 40.0  # up and down
MOST_ENTRIES = 12  # of an array whose entries have sliders
NOT_VARIED = ("seed", "direction")

Place = tuple[str | int, ...]


class Number(NamedTuple):
    """A number that a page varies.

    **Fields:**

    - `paths`: its names at the points of `Scene.case`; several if layers share a material.
    - `place`: keys in the scene file.
    - `group`, `label`: where and how the page shows it.
    - `unit`, `factor`: in which the page shows it, and 1 SI in it.
    - `si`: the SI unit.
    - `value`, `low`, `high`: in the scene, and the range of its slider [SI].
    - `logarithmic`: whether the slider is.
    """

    paths: tuple[str, ...]
    place: Place
    group: str
    label: str
    unit: str
    factor: float
    si: str
    value: float
    low: float
    high: float
    logarithmic: bool

    @property
    def name(self) -> str:
        return self.paths[0]

    def at(self, step: int) -> float:
        """Returns the number [SI] at a step of the slider, to four digits in the shown unit."""
        share = step / STEPS
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        return float(f"{value * self.factor:.4g}") / self.factor

    def step_of(self, value: float) -> int:
        """Returns the nearest step of the slider; an end of it for a number beyond."""
        low, high, at = self.low, self.high, min(max(value, self.low), self.high)
        if self.logarithmic:
            low, high, at = np.log([low / low, high / low, at / low])
        return round(STEPS * (at - low) / (high - low))

    def text(self, value: float) -> str:
        """Returns a number [SI] as its field shows it."""
        return f"{value * self.factor:.6g}"

    def hint(self, value: float) -> str:
        """Returns the number in SI, if the field shows another unit; a temperature in °C."""
        if self.si == "K":
            return f"{value - ZERO_CELSIUS:.4g} °C"
        return "" if self.unit == self.si else f"{value:.4g} {self.si}"

    def read(self, text: str) -> float:
        """Returns the number [SI] of the text in its field."""
        try:
            value = float(text.strip().replace(",", ".")) / self.factor
        except ValueError:
            raise ValueError(f"{text.strip()!r} is not a number.") from None
        if not np.isfinite(value):
            raise ValueError("the number must be finite.")
        return value


def numbers_of(scene: Scene) -> dict[str, Number]:
    """Returns the numbers that a page varies, by their names: loads, then those of the bodies."""
    document = tomlkit.parse(scene.text).unwrap()
    middle, found = middle_of(scene), dict[Place, list[str]]()
    varied = [name for name in middle if name not in NOT_VARIED]
    values = {name: float(middle[name]) for name in varied}
    for path, number in paths(scene.bodies).items():
        name, whole = path.removeprefix("stack."), paths_of_whole(path)
        entries = 0 if whole is None else paths(scene.bodies)[whole].size
        idle = ".shift." in name and "temperature" not in scene.axes
        if number.ndim == 0 and float(number) != 0 and entries <= MOST_ENTRIES and not idle:
            values.setdefault(name, float(number))
    for name in values:
        found.setdefault(place_of(document, name), []).append(name)
    numbers = (number_at(place, names, values[names[0]]) for place, names in found.items())
    return {number.name: number for number in numbers}


def paths_of_whole(path: str) -> str | None:
    """Returns the path of the array of an entry, "times" for "times[2]"; else None."""
    entry = re.fullmatch(r"(.*\.\w+)\[\d+\]", path)
    return None if entry is None or entry[1].endswith("layers") else entry[1]


def middle_of(scene: Scene) -> dict[str, Any]:
    """Returns the point in the middle of the axes of a scene."""
    return {name: values[len(values) // 2] for name, values in scene.axes.items()}


def place_of(document: dict[str, Any], name: str) -> Place:
    """Returns the keys of a number in the tables of a scene, also of one left out there."""
    for table in ("sweep", "load"):
        if name in document.get(table, {}):
            return table, name
    place: Place = ()
    table: Any = document
    for word in re.findall(r"\w+", name):
        key = int(word) if word.isdigit() else word
        if key == "profile" and "profile" not in table:
            continue  # the materials of a graded layer stand in its own table
        place += (key,)
        known = isinstance(table, dict | list)
        table = table[key] if known and (isinstance(key, int) or key in table) else {}
        if isinstance(table, str) and table in document["materials"]:
            place, table = ("materials", table), document["materials"][table]
    return place


def number_at(place: Place, names: list[str], value: float) -> Number:
    """Returns a number of a scene with its words, its unit and its range."""
    name = names[0]
    quantity = quantity_of(name)
    si = "1" if quantity is None else quantity.unit
    unit, factor = unit_of(si, abs(value)) if si in ("m", "Pa", "s") else (si, 1.0)
    low, high, logarithmic = range_of(name, si, value)
    group, label = "load", title_of(name)
    if place[0] == "materials":
        words = str(place[-1]) if quantity is None else quantity.meaning
        if isinstance(place[-1], int):
            words = f"{words} {place[-1] + 1}"
        group, label = str(place[1]), f"{place[1]}: {words}"
    elif place[0] != "load":
        group = "layers" if "layers" in name else str(place[0])
    if paths_of_whole(name) is not None:
        group = f"{group}: more"
    return Number(
        paths=tuple(names),
        place=place,
        group=group,
        label=label,
        unit=unit,
        factor=factor,
        si=si,
        value=value,
        low=low,
        high=high,
        logarithmic=logarithmic,
    )


def range_of(name: str, si: str, value: float) -> tuple[float, float, bool]:
    """Returns the ends of a slider, and whether it is logarithmic."""
    if si == "K":
        return value - KELVINS, value + KELVINS, False
    if name.endswith("poisson"):
        return 0.0, 0.5, False
    if value < 0:
        return 2 * value, 0.0, False
    factor = FACTOR_OF_VELOCITY if name == "velocity" else FACTOR
    return value / factor, value * factor, True
