"""Names of a block and a surface, in the words of the tables of a scene."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..core.display import unit_of, with_unit
from ..core.quantities import quantity_of
from .toml import entry_text

LISTED = 4  # entries of a list that are not written one by one


def described(content: dict[str, Any]) -> str:
    """Returns the layers of a scene's tables with their thicknesses, the base, and the surface."""
    surface = content["surface"]
    kinds = {"self_affine": "a random surface", "sphere": "a sphere"}
    road = kinds.get(surface["kind"]) or Path(surface["path"]).name
    counterface = content.get("counterface")
    road = road if counterface is None else f"{road} of {_body(counterface)}"
    return f"{_body(content)} on {road}"


def in_words(content: dict[str, Any]) -> dict[str, Any]:
    """Returns what a scene's tables make, by name: bodies, materials, surfaces."""
    found: dict[str, Any] = {"block": _parts(content)}
    if graded_solver := content.get("solver", {}).get("graded_solver"):
        found["block"]["graded solver"] = _kind(graded_solver)
    if "counterface" in content:
        found["counterface"] = _parts(content["counterface"])
    found["materials"] = {n: _kind(table) for n, table in content["materials"].items()}
    found["surface"] = _kind(content["surface"])
    if "grid" in content:
        found["grid"] = ", ".join(_entries(content["grid"], "Grid"))
    if "block_surface" in content:
        found["block's own surface"] = _kind(content["block_surface"])
    return found


def _parts(content: dict[str, Any]) -> dict[str, str]:
    """The layers of a body from its surface down, and its base."""
    named = ("material", "bottom", "top", "thickness")
    layers, base = content.get("layers", []), content["base"]
    found = {}
    for i, (words, layer) in enumerate(
        zip(layers_in_words(content, ", "), layers, strict=True), start=1
    ):
        rest = {key: value for key, value in layer.items() if key not in named}
        found[f"layer {i}"] = ", ".join([words, *_entries(rest)])
    kind = base["kind"].replace("_", " ")
    found["base"] = f"{base['material']}, {kind}" if "material" in base else kind
    return found


def _kind(table: dict[str, Any]) -> str:
    """The kind of a table, and its entries."""
    kind = "random" if table["kind"] == "self_affine" else table["kind"].replace("_", " ")
    rest = {key: value for key, value in table.items() if key != "kind"}
    return ", ".join([kind, *_entries(rest, table["kind"].capitalize())])


def _entries(table: dict[str, Any], owner: str = "") -> Iterator[str]:
    """Names and values of a table, numbers with their units, long lists by their ends."""
    for key, value in table.items():
        quantity = quantity_of(key, owner)
        unit = "" if quantity is None else quantity.unit.removesuffix("1")
        numbers = value if isinstance(value, list) else [value]
        if isinstance(value, dict):
            text = f"({', '.join(_entries(value, key.capitalize()))})"
        elif len(numbers) > LISTED:
            first, last = (_entry(n, unit) for n in (numbers[0], numbers[-1]))
            text = f"{len(numbers)} from {first} to {last}"
        else:
            between = " × " if key == "shape" else " and "
            text = between.join(_entry(n, unit) for n in numbers)
        yield f"{key.replace('_', ' ')} {text}"


def _entry(value: Any, unit: str) -> str:
    """A value of a table with its unit, those of length, time and stress with a prefix."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        return entry_text(value)
    unit, factor = unit_of(unit, abs(value)) if unit in ("m", "s", "Pa") else (unit, 1.0)
    return f"{factor * value:g} {unit}".rstrip()


def _body(content: dict[str, Any]) -> str:
    return ", ".join([*layers_in_words(content, " "), base_name(content)])


def layers_in_words(content: dict[str, Any], between: str) -> list[str]:
    """Returns name and thickness of each layer of the tables, with a text between the two."""
    return [
        f"{layer_name(layer)}{between}{with_unit(layer['thickness'], 'm')}"
        for layer in content.get("layers", [])
    ]


def layer_name(layer: dict[str, Any]) -> str:
    """Returns the material of a layer of the tables, or both materials of a graded one."""
    return layer["material"] if "material" in layer else f"{layer['top']} → {layer['bottom']}"


def base_name(content: dict[str, Any]) -> str:
    """Returns the material of the base, or its kind."""
    return content["base"].get("material", content["base"]["kind"])
