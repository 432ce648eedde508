"""Knobs: numbers of a scene's block, load and roughness that the page varies, with their ranges.

A knob acts on the built block, so that JAX can trace its value and differentiate. Saving a scene
writes the value into its tables.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..core.parameters import paths, with_values
from ..materials.material import BulkShear, Elastic, Prony
from ..materials.shift import WLF, TabulatedShift, shifts_in
from ..scenes.scene import Scene
from ..scenes.surface_source import RandomSurface
from ..surfaces.statistics import statistics
from ..surfaces.surface import Surface
from .document import Document, material_table
from .entries import read_entry

WIDE_FACTOR, ROUGH_FACTOR = 50.0, 10.0  # the range of a knob in both directions; of roughness
COLDER, HOTTER = 40.0, 80.0  # K
ABOVE_VOGEL = 10.0  # K above the Vogel temperature, where WLF diverges

# By the quantity of a knob: the unit on the page, and the SI unit in this unit.
PAGE_UNITS = {
    "thickness": ("µm", 1e6), "modulus": ("MPa", 1e-6), "poisson": ("1", 1.0),
    "pressure": ("kPa", 1e-3), "velocity": ("m/s", 1.0), "temperature": ("K", 1.0),
    "rms_height": ("µm", 1e6), "rms_slope": ("1", 1.0), "hurst": ("1", 1.0),
    "stress": ("kPa", 1e-3), "steepness": ("1", 1.0),
    "conductivity": ("W/(m K)", 1.0), "diffusivity": ("mm²/s", 1e6),
}  # fmt: skip
# Fields of a law of shear, and of heating: labels and quantities of their knobs.
PARTS = {
    "shear": {
        "stress": ("shear stress", "stress"), "peak": ("largest shear stress", "stress"),
        "velocity": ("velocity of the peak of shear", "velocity"),
        "steepness": ("steepness of the peak of shear", "steepness"),
    },
    "heating": {
        "conductivity": ("conductivity of the block", "conductivity"),
        "diffusivity": ("diffusivity of the block", "diffusivity"),
        "counterface_conductivity": ("conductivity of the counterface", "conductivity"),
    },
}  # fmt: skip
LINEAR_STEPS = {"poisson": 0.01, "hurst": 0.01, "temperature": 1.0}  # others: 1 %


class Target(NamedTuple):
    """What a knob changes: a kind of number, and the paths in the block that change together."""

    kind: str
    paths: tuple[str, ...] = ()


class Knob(NamedTuple):
    """A number that the page varies.

    **Fields:**

    - `target`: what it changes.
    - `label`: on the page.
    - `quantity`: a key of `PAGE_UNITS`.
    - `value`, `low`, `high`: in the scene, and its range [SI].
    - `key`: its place in the scene's tables.
    """

    target: Target
    label: str
    quantity: str
    value: float
    low: float
    high: float
    key: tuple[str | int, ...]

    @property
    def unit(self) -> str:
        return PAGE_UNITS[self.quantity][0]

    @property
    def factor(self) -> float:
        """The SI unit in the unit on the page."""
        return PAGE_UNITS[self.quantity][1]

    @property
    def logarithmic(self) -> bool:
        return self.quantity not in LINEAR_STEPS

    def step_size(self, value: float) -> float:
        """Returns the change [SI] for which the page shows derivatives, at a value [SI]."""
        if self.logarithmic:
            return 0.01 * value
        step = LINEAR_STEPS[self.quantity]
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


def knobs_of(document: Document, scene: Scene, surface: Surface) -> tuple[Knob, ...]:
    """Returns the knobs of a scene, the load first.

    **Arguments:**

    - `document`, `scene`: the tables, and their scene.
    - `surface`: of the scene.

    **Raises:** `ValueError` for a layer of zero thickness.
    """
    pressure, speed = float(scene.pressure[0]), float(scene.velocity[0])
    velocity, thicknesses = Target("velocity"), []
    for i, layer in enumerate(scene.stack.layers, start=1):
        value, target = float(layer.thickness), Target("number", (f"layers[{i - 1}].thickness",))
        if value == 0:
            raise ValueError(f"`layer {i} thickness` = 0 is refused: remove the layer.")
        key = ("layers", i - 1, "thickness")
        thicknesses.append(_wide(target, f"layer {i} thickness", "thickness", value, key))
    return (
        _wide(Target("pressure"), "pressure", "pressure", pressure, ("load", "pressure")),
        Knob(velocity, "velocity", "velocity", speed, *document.speeds, ("load", "velocity")),
        *_temperature(scene),
        *thicknesses,
        *_of_materials(document.content, scene.stack),
        *_roughness(scene, surface),
        *_parts(scene),
    )


def _wide(target: Target, label: str, quantity: str, value: float, key: tuple) -> Knob:
    factor = ROUGH_FACTOR if quantity.startswith("rms") else WIDE_FACTOR
    return Knob(target, label, quantity, value, value / factor, value * factor, key)


def _temperature(scene: Scene) -> Iterator[Knob]:
    """A temperature, if every material has a law for it and all laws have one reference."""
    laws = shifts_in(scene.stack)
    references = {round(float(law.reference), 6) for law in laws}
    if not laws or (scene.temperature is None and len(references) > 1):
        return
    value = references.pop() if scene.temperature is None else float(scene.temperature)
    try:
        scene.stack.at(value)
    except ValueError:  # a material without a law
        return
    # Tables of shifts end, and WLF diverges: no slider goes there.
    low, high = value - COLDER, value + HOTTER
    for law in laws:
        if isinstance(law, TabulatedShift):
            low, high = max(low, float(law.temperatures[0])), min(high, float(law.temperatures[-1]))
        elif isinstance(law, WLF):
            low = max(low, float(law.reference - law.c2) + ABOVE_VOGEL)
    name = "temperature"
    yield Knob(Target(name), name, name, value, low, high, ("load", name))


def _of_materials(content: dict[str, Any], stack: Stack) -> Iterator[Knob]:
    for name, places in _uses(content).items():
        material, key = part_at(stack, places[0]), ("materials", name)
        if isinstance(material, Elastic):
            target = Target("number", tuple(f"{place}.modulus" for place in places))
            value = float(material.young)
            yield _wide(target, f"{name}: modulus", "modulus", value, (*key, "modulus"))
        if isinstance(material, Prony):
            # A liquid has no relaxed modulus.
            which = "relaxed" if material.equilibrium > 0 else "glassy"
            value = float(material.equilibrium if which == "relaxed" else material.glassy)
            target, label = Target(which, tuple(places)), f"{name}: {which} modulus"
            yield _wide(target, label, "modulus", value, key)
        # The bulk and shear parts of a material do not use their Poisson's ratio.
        used = tuple(f"{p}.poisson" for p in places if not p.endswith((".bulk", ".shear")))
        if used and not isinstance(material, BulkShear):
            value, label = float(getattr(material, "poisson")), f"{name}: Poisson's ratio"  # noqa: B009
            low, target = min(0.0, value), Target("number", used)
            yield Knob(target, label, "poisson", value, low, 0.5, (*key, "poisson"))


def _uses(content: dict[str, Any]) -> dict[str, list[str]]:
    """The paths in the block of each material, by its name in the tables."""
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
    """Returns the part of `tree` at a path: a material at "layers[0].material"."""
    for word in path.replace("[", ".").replace("]", "").split("."):
        tree = tree[int(word)] if word.isdigit() else getattr(tree, word)
    return tree


def _roughness(scene: Scene, surface: Surface) -> Iterator[Knob]:
    rough = scene.surface
    if not isinstance(rough, RandomSurface):
        value, key = float(statistics(surface).rms_height), ("surface", "rms_height")
        yield _wide(Target("height"), "rms height", "rms_height", value, key)
        return
    which, hurst = rough.spectrum.prescribed, float(rough.spectrum.hurst)
    label, amplitude = which.replace("_", " "), float(rough.spectrum.amplitude)
    yield _wide(Target("amplitude"), label, which, amplitude, ("surface", which))
    low, key = min(0.3, hurst), ("surface", "hurst")
    yield Knob(Target("hurst"), "Hurst exponent", "hurst", hurst, low, 1.0, key)


def _parts(scene: Scene) -> Iterator[Knob]:
    """Numbers of shear and heating that are not 0; a conductivity of each layer has no knob."""
    for kind, fields in PARTS.items():
        for name, (label, quantity) in fields.items():
            value = np.asarray(getattr(getattr(scene, kind), name, 0.0))
            if value.ndim == 0 and value > 0:
                yield _wide(Target(kind, (name,)), label, quantity, float(value), (kind, name))


def changed_part(part: Any, kind: str, targets: Sequence[Target], numbers: Any) -> Any:
    """Returns the law of shear, or the heating, with its knobs at other values [SI]."""
    pairs = zip(targets, numbers, strict=True)
    values = {target.paths[0]: number for target, number in pairs if target.kind == kind}
    return with_values(part, values) if values else part


def changed_stack(
    stack: Stack, targets: Sequence[Target], numbers: Float[Array | np.ndarray, " knobs"]
) -> Stack:
    """Returns the block with knobs at other values, which JAX may trace.

    **Arguments:**

    - `stack`: the block of the scene.
    - `targets`: of its knobs.
    - `numbers`: values of the knobs [SI], shape `(knobs,)`; load and roughness are ignored.
    """
    initial, values = paths(stack), {}
    for target, number in zip(targets, numbers, strict=True):
        if target.kind == "number":
            values |= dict.fromkeys(target.paths, number)
        elif target.kind in ("relaxed", "glassy"):
            for path in target.paths:
                names = (f"{path}.equilibrium", f"{path}.strengths")
                relaxed, strengths = (initial[name] for name in names)
                # All moduli scale together, so that the relaxation times keep their meaning.
                whole = relaxed + (0 if target.kind == "relaxed" else strengths.sum())
                values |= {name: initial[name] * (number / whole) for name in names}
    stack = with_values(stack, values) if values else stack
    # Last, so that the temperature shifts the materials that the other knobs changed.
    for target, number in zip(targets, numbers, strict=True):
        stack = stack.at(number) if target.kind == "temperature" else stack
    return stack


def changed_document(
    document: Document, stack: Stack, knobs: Sequence[Knob], values: Sequence[float]
) -> Document:
    """Returns the scene with its knobs at these values [SI], in its tables.

    A series with a changed modulus is written branch by branch.
    """
    document = document.copied()
    # The tables have the block at its own reference; the temperature is in [load].
    settings = {k.target: v for k, v in zip(knobs, values, strict=True) if k.unit != "K"}
    block = changed_stack(stack, tuple(settings), np.array(list(settings.values())))
    for knob, value in zip(knobs, values, strict=True):
        if value == knob.value:
            continue
        *tables, last = knob.key
        table: Any = document.content
        for name in tables:
            table = table[name]
        table[last] = value
        if knob.target.kind == "height":
            table.pop("rms_slope", None)  # a file takes one of the two
        elif knob.target.kind in ("relaxed", "glassy"):
            table[last] = material_table(part_at(block, knob.target.paths[0]))
    return document
