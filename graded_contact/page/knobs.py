"""What can be turned in a scene: numbers of its block, load and roughness, with their ranges.

A knob acts on the built block, so that JAX may trace its value and differentiate by it, and is
written to the tables of the scene when that is saved.
"""

import copy
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from ..core.parameters import paths, with_values
from ..files.prony_cards import export_prony
from ..files.scene import Scene
from ..files.surfaces import RandomSurface
from ..files.toml import parse_toml
from ..response.stack import Stack
from ..rheology.material import BulkShear, Elastic, Prony
from ..rheology.shift import WLF, AbstractShift, TabulatedShift
from ..roughness.surface import Surface, statistics
from .document import Document

WIDE, ROUGH = 50.0, 10.0  # how far a knob goes either way, and one of roughness, as a factor
COLD, HOT = 40.0, 80.0  # K below and above
MARGIN = 10.0  # K above the Vogel temperature

# Unit shown, how much of it is the SI unit, and the step by which sensitivities are told.
SHOWN = {
    "thickness": ("µm", 1e6), "modulus": ("MPa", 1e-6), "poisson": ("1", 1.0),
    "pressure": ("kPa", 1e-3), "velocity": ("m/s", 1.0), "temperature": ("K", 1.0),
    "rms_height": ("µm", 1e6), "rms_slope": ("1", 1.0), "hurst": ("1", 1.0),
}  # fmt: skip
STEPS = {"poisson": 0.01, "hurst": 0.01, "temperature": 1.0}  # of others 1 %


class Turn(NamedTuple):
    """What a knob acts on: its kind, and the paths in the block that it changes together."""

    kind: str
    paths: tuple[str, ...] = ()


class Knob(NamedTuple):
    """A number that can be turned.

    **Fields:**

    - `turn`: what it acts on.
    - `label`: for people.
    - `quantity`: a key of `SHOWN`.
    - `value`, `low`, `high`: where it is and may go [SI].
    - `key`: where the scene's tables have it.
    """

    turn: Turn
    label: str
    quantity: str
    value: float
    low: float
    high: float
    key: tuple[str | int, ...]

    @property
    def unit(self) -> str:
        return SHOWN[self.quantity][0]

    @property
    def factor(self) -> float:
        """Of the unit shown in one SI unit."""
        return SHOWN[self.quantity][1]

    @property
    def logarithmic(self) -> bool:
        return self.quantity not in STEPS

    @property
    def step(self) -> str:
        """The change for which sensitivities are told."""
        if self.logarithmic:
            return "+1 %"
        return f"+{STEPS[self.quantity]:g}" + ("" if self.unit == "1" else f" {self.unit}")

    def check(self, value: float | None) -> None:
        """Raises `ValueError` for a value [SI] out of range."""
        if value is None or not self.low <= value <= self.high:
            shown = "nothing" if value is None else f"{value * self.factor:.6g}"
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ValueError(
                f"`{self.label}` = {shown} is refused: from {self.low * self.factor:.6g} to "
                f"{self.high * self.factor:.6g}{unit} is allowed here."
            )


def knobs_of(document: Document, scene: Scene, surface: Surface) -> tuple[Knob, ...]:
    """Returns what can be turned, the load first.

    **Arguments:**

    - `document`, `scene`: the tables, and what they describe.
    - `surface`: of the scene.

    **Raises:** `ValueError` for a layer of no thickness.
    """
    pressure, speed = float(scene.pressure[0]), float(scene.velocity[0])
    found = [
        _wide(Turn("pressure"), "pressure", "pressure", pressure, ("load", "pressure")),
        Knob(Turn("velocity"), "velocity", "velocity", speed, *document.speeds,
             ("load", "velocity")),
    ]  # fmt: skip
    found += _temperature(scene)
    for i in range(len(scene.stack.layers)):
        thickness = float(scene.stack.layers[i].thickness)
        if thickness == 0:
            raise ValueError(f"[layers[{i}]] `thickness` = 0 is no layer: remove it.")
        turn = Turn("number", (f"layers[{i}].thickness",))
        label = f"layer {i + 1} thickness"
        found.append(_wide(turn, label, "thickness", thickness, ("layers", i, "thickness")))
    for name, places in _uses(document.content).items():
        found += _of_material(name, places, scene.stack)
    return (*found, *_roughness(scene, surface))


def _wide(turn: Turn, label: str, quantity: str, value: float, key: tuple) -> Knob:
    factor = ROUGH if quantity.startswith("rms") else WIDE
    return Knob(turn, label, quantity, value, value / factor, value * factor, key)


def _temperature(scene: Scene) -> list[Knob]:
    """A temperature, where every material has a law of it, and all count from the same."""

    def is_law(part: Any) -> bool:
        return isinstance(part, AbstractShift)

    laws: list[Any] = [law for law in jax.tree.leaves(scene.stack, is_leaf=is_law) if is_law(law)]
    references = {round(float(law.reference), 6) for law in laws}
    if not laws or (scene.temperature is None and len(references) > 1):
        return []
    value = references.pop() if scene.temperature is None else float(scene.temperature)
    try:
        scene.stack.at(value)
    except ValueError:  # a material without a law
        return []
    low, high = value - COLD, value + HOT
    for law in laws:
        if isinstance(law, TabulatedShift):
            low, high = max(low, float(law.temperatures[0])), min(high, float(law.temperatures[-1]))
        elif isinstance(law, WLF):
            low = max(low, float(law.reference - law.c2) + MARGIN)
    key = ("load", "temperature")
    return [Knob(Turn("temperature"), "temperature", "temperature", value, low, high, key)]


def _uses(content: dict[str, Any]) -> dict[str, list[str]]:
    """Where in the block each material stands, by its name."""
    found: dict[str, list[str]] = defaultdict(list)

    def use(name: str, path: str) -> None:
        found[name].append(path)
        table = content["materials"][name]
        if table["kind"] == "bulk_shear":
            for part in ("bulk", "shear"):
                use(table[part], f"{path}.{part}")

    for i, layer in enumerate(content.get("layers", [])):
        if "material" in layer:
            use(layer["material"], f"layers[{i}].material")
        else:
            for side in ("top", "bottom"):
                use(layer[side], f"layers[{i}].profile.{side}")
    if "material" in content["base"]:
        use(content["base"]["material"], "base.material")
    return found


def part_at(tree: Any, path: str) -> Any:
    """Returns what stands at a path: a material at "layers[0].material"."""
    for word in path.replace("[", ".").replace("]", "").split("."):
        tree = tree[int(word)] if word.isdigit() else getattr(tree, word)
    return tree


def _of_material(name: str, places: list[str], stack: Stack) -> list[Knob]:
    material = part_at(stack, places[0])
    knobs = []
    key = ("materials", name)
    if isinstance(material, Elastic):
        turn = Turn("number", tuple(f"{place}.modulus" for place in places))
        modulus = float(material.young)
        knobs.append(_wide(turn, f"{name}: modulus", "modulus", modulus, (*key, "modulus")))
    if isinstance(material, Prony):
        which = "relaxed" if material.equilibrium > 0 else "glassy"
        modulus = float(material.equilibrium if which == "relaxed" else material.glassy)
        turn, label = Turn(which, tuple(places)), f"{name}: {which} modulus"
        knobs.append(_wide(turn, label, "modulus", modulus, (*key, "series")))
    felt = [place for place in places if not place.endswith((".bulk", ".shear"))]
    if felt and not isinstance(material, BulkShear):
        value = float(getattr(material, "poisson"))  # noqa: B009 (not of every material)
        turn = Turn("number", tuple(f"{place}.poisson" for place in felt))
        low, label = min(0.0, value), f"{name}: Poisson's ratio"
        knobs.append(Knob(turn, label, "poisson", value, low, 0.5, (*key, "poisson")))
    return knobs


def _roughness(scene: Scene, surface: Surface) -> list[Knob]:
    rough = scene.surface
    if not isinstance(rough, RandomSurface):
        value, key = float(statistics(surface).rms_height), ("surface", "rms_height")
        return [_wide(Turn("height"), "rms height", "rms_height", value, key)]
    which, hurst = rough.spectrum.prescribed, float(rough.spectrum.hurst)
    amplitude = float(rough.spectrum.amplitude)
    return [
        _wide(Turn("amplitude"), which.replace("_", " "), which, amplitude, ("surface", which)),
        Knob(Turn("hurst"), "Hurst exponent", "hurst", hurst, min(0.3, hurst), 1.0,
             ("surface", "hurst")),
    ]  # fmt: skip


def turned(
    stack: Stack, turns: Sequence[Turn], numbers: Float[Array | np.ndarray, " knobs"]
) -> Stack:
    """Returns the block with knobs at other values, which JAX may trace.

    **Arguments:**

    - `stack`: the block of the scene.
    - `turns`: of its knobs.
    - `numbers`: their values [SI], shape `(knobs,)`; those of load and roughness are left out.
    """
    known, values = paths(stack), {}
    for turn, number in zip(turns, numbers, strict=True):
        if turn.kind == "number":
            values |= dict.fromkeys(turn.paths, number)
        elif turn.kind in ("relaxed", "glassy"):
            for path in turn.paths:
                names = (f"{path}.equilibrium", f"{path}.strengths")
                equilibrium, strengths = (known[name] for name in names)
                whole = equilibrium + (0 if turn.kind == "relaxed" else strengths.sum())
                values |= {name: known[name] * (number / whole) for name in names}
    stack = with_values(stack, values) if values else stack
    at = [n for turn, n in zip(turns, numbers, strict=True) if turn.kind == "temperature"]
    return stack.at(at[0]) if at else stack


def written(
    document: Document, stack: Stack, knobs: Sequence[Knob], values: Sequence[float]
) -> Document:
    """Returns the scene with its knobs at these values [SI], in its tables.

    A series whose modulus was turned is written out branch by branch.
    """
    content = copy.deepcopy(document.content)
    # As written: the scene's temperature is that of its [load].
    settings = dict(zip((knob.turn for knob in knobs), values, strict=True))
    settings.pop(Turn("temperature"), None)
    block = turned(stack, tuple(settings), np.array(list(settings.values())))
    for knob, value in zip(knobs, values, strict=True):
        if value == knob.value:
            continue
        table: Any = content
        for word in knob.key[:-1]:
            table = table[word]
        if knob.key[-1] != "series":
            table[knob.key[-1]] = value
            if knob.turn.kind == "height":
                table.pop("rms_slope", None)
            continue
        card = export_prony(part_at(block, knob.turn.paths[0]), "toml")
        content["materials"][knob.key[1]] = parse_toml(card)["materials"]["material"]
    return document._replace(content=content)
