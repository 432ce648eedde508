"""The numbers that a page varies: loads and numbers of the bodies that the scene file states.

Each is saved at its place there: a material that several layers share has one number there, and one
slider.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit

from ..core.display import unit_of
from ..core.parameters import paths
from ..core.quantities import in_brackets, quantity_of
from ..plot.sweeps import title_of
from ..scenes.scene import Scene, parse_scene

STEPS = 400  # of a slider
FACTOR, FACTOR_OF_VELOCITY = 30.0, 1e3  # a slider goes from 1/factor to factor of its number
KELVINS = 40.0  # up and down
MOST_ENTRIES = 12  # of an array whose entries have sliders
NOT_VARIED = ("seed", "direction")
ENTRY = re.compile(r"(.*\.(?!layers)\w+)\[(\d+)\]")  # of an array: "base.material.times[2]"

Place = tuple[str | int, ...]


class Number(NamedTuple):
    """A number that a page varies.

    **Fields:**

    - `paths`: its names at the points of `Scene.case`; several if layers share a material.
    - `place`: keys in the scene file.
    - `group`, `label`: where and how the page shows it.
    - `unit`, `factor`: in which the page shows it, and 1 SI in it.
    - `value`, `low`, `high`: in the scene, and the range of its slider [SI]; logarithmic if
      it is positive.
    """

    paths: tuple[str, ...]
    place: Place
    group: str
    label: str
    unit: str
    factor: float
    value: float
    low: float
    high: float

    @property
    def title(self) -> str:
        """The label with the unit."""
        return self.label + in_brackets(self.unit)

    def at(self, step: int) -> float:
        """Returns the number [SI] at a step of the slider, to four digits in the shown unit."""
        share = step / STEPS
        if self.low > 0:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        return float(f"{value * self.factor:.4g}") / self.factor

    def step_of(self, value: float) -> int:
        """Returns the nearest step of the slider; an end of it for a number beyond."""
        scale = np.log if self.low > 0 else float
        low, high, at = map(scale, (self.low, self.high, np.clip(value, self.low, self.high)))
        return round(STEPS * (at - low) / (high - low))

    def shown(self, value: float) -> float:
        """Returns a number [SI] in the shown unit, to six digits."""
        return float(f"{value * self.factor:.6g}")


def varied_numbers(scene: Scene) -> dict[str, Number]:
    """Returns the numbers that a page varies, by their names: loads, then numbers of the bodies.

    A number that the scene file leaves out, or that is 0, does not vary.
    """
    document, middle = tomlkit.parse(scene.text).unwrap(), middle_point(scene)
    values = {name: float(at) for name, at in middle.items() if name not in NOT_VARIED}
    of_bodies = paths(scene.bodies)
    for path, number in of_bodies.items():
        name, entry = path.removeprefix("stack."), ENTRY.fullmatch(path)
        long = entry is not None and of_bodies[entry[1]].size > MOST_ENTRIES
        idle = ".shift." in name and "temperature" not in scene.axes
        if number.ndim == 0 and number != 0 and not long and not idle:
            values.setdefault(name, float(number))
    found: dict[Place, list[str]] = {}
    for name in values:
        if (place := keys_of(document, name)) is not None:
            found.setdefault(place, []).append(name)
    return {n[0]: number_at(place, tuple(n), values[n[0]]) for place, n in found.items()}


def middle_point(scene: Scene) -> dict[str, Any]:
    """Returns the point in the middle of the axes of a scene."""
    return {name: values[len(values) // 2] for name, values in scene.axes.items()}


def keys_of(document: Any, name: str) -> Place | None:
    """Returns the keys of a number in the tables of a scene, or None if they leave it out."""
    for table in ("sweep", "load"):
        if name in document.get(table, {}):
            return table, name
    place, table = (), document
    for word in re.findall(r"\w+", name):
        key: Any = int(word) if word.isdigit() else word
        if key == "profile" and "profile" not in table:
            continue  # the materials of a graded layer stand in its own table
        if key not in (range(len(table)) if isinstance(table, list) else table):
            return None
        place, table = (*place, key), table[key]
        if isinstance(table, str) and table in document["materials"]:
            place, table = ("materials", table), document["materials"][table]
    return place


def number_at(place: Place, names: tuple[str, ...], value: float) -> Number:
    """Returns a number of a scene with its words, its unit and its range."""
    name, entry, quantity = names[0], ENTRY.fullmatch(names[0]), quantity_of(names[0])
    unit, factor = "1" if quantity is None else quantity.unit, 1.0
    group, label = str(place[0]), title_of(name)
    if group == "materials":
        group = str(place[1])
        words = str(place[2]) if quantity is None else quantity.meaning
        label = f"{group}: {words}" + (f" {int(entry[2]) + 1}" if entry else "")
    low, high = range_of(name, unit, value)
    if unit in ("m", "Pa", "s"):
        unit, factor = unit_of(unit, abs(value))
    group += ": more" if entry else ""
    return Number(names, place, group, label, unit, factor, value, low, high)


def range_of(name: str, unit: str, value: float) -> tuple[float, float]:
    """Returns the ends of a slider."""
    if unit == "K":
        return value - KELVINS, value + KELVINS
    if name.endswith("poisson"):
        return 0.0, 0.5
    if value < 0:
        return 2 * value, 0.0
    factor = FACTOR_OF_VELOCITY if name == "velocity" else FACTOR
    return value / factor, value * factor


def save(scene: Scene, values: Mapping[str, float], path: Path) -> None:
    """Writes a scene with other values of its numbers to a new file; its comments stay.

    A number that did not change stays as it is written, such as a list of velocities.

    **Raises:** `FileExistsError`; `ValueError` if paths of the scene do not lead to its files from
    the new one.
    """
    document: Any = tomlkit.parse(scene.text)
    for name, number in varied_numbers(scene).items():
        if values[name] != number.value:
            *way, last = number.place
            table = document
            for key in way:
                table = table[key]
            table[last] = values[name]
    text = tomlkit.dumps(document)
    parse_scene(text, path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("x", encoding="utf-8") as file:
        file.write(text)
