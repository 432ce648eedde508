"""Names of a block and a surface, in the words of the tables of a scene."""

from pathlib import Path
from typing import Any

from ..core.display import with_unit


def described(content: dict[str, Any]) -> str:
    """Returns the layers of a scene's tables with their thicknesses, the base, and the surface."""
    surface = content["surface"]
    kinds = {"self_affine": "a random surface", "sphere": "a sphere"}
    kinds["scans"] = "a surface of several scans"
    road = kinds.get(surface["kind"]) or Path(surface["path"]).name
    counter = content.get("counter")
    road = road if counter is None else f"{road} of {_body(counter)}"
    return f"{_body(content)} on {road}"


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
