"""What a scene means, line by line, before it is run."""

from typing import Any

import numpy as np
import typer

from ..blocks.stack import GradedLayer, HalfSpace
from ..core.display import with_unit
from ..core.quantities import quantity_of
from ..materials.material import AbstractMaterial, Elastic, Prony
from ..materials.table import Tabulated
from ..plot.words import labelled, title_of
from ..scenes.scene import Scene
from ..scenes.schema import parse_toml
from ..scenes.surface_source import RandomSurface


def print_understood(scene: Scene) -> None:
    """Prints the block from the loaded surface downwards, the surface, and what is varied."""
    tables = parse_toml(scene.text)
    known = tables["materials"]
    for i, (layer, table) in enumerate(
        zip(scene.stack.layers, tables.get("layers", []), strict=True), start=1
    ):
        if isinstance(layer, GradedLayer):
            of = f"{table['bottom']} (below) to {table['top']} (above)"
        else:
            of = _material(table["material"], known, layer.material)
        _print(f"layer {i}", f"{with_unit(float(layer.thickness), 'm')} of {of}")
    base, kind = scene.stack.base, tables["base"]["kind"].replace("_", "-")
    if isinstance(base, HalfSpace):
        kind += f" of {_material(tables['base']['material'], known, base.material)}"
    _print("base", kind)
    kind = "random" if isinstance(scene.surface, RandomSurface) else "sphere"
    _print("surface", tables["surface"].get("path", kind))
    axes = scene.axes
    if scene.temperature is not None:
        axes["temperature"] = np.atleast_1d(scene.temperature)
    for name, values in axes.items():
        _print("seed" if name == "seed" else title_of(name, scene.text), _values(name, values))


def _print(name: str, text: str) -> None:
    typer.echo(f"{name:22} {text}")


def _material(name: str, tables: dict[str, Any], material: AbstractMaterial) -> str:
    """The name of a material, its kind, and the range of its modulus."""
    about = ""
    if isinstance(material, Elastic):
        about = f": {with_unit(float(material.modulus(0.0)), 'Pa')}"
    elif isinstance(material, Prony):
        slow = float(material.equilibrium)
        ends = (slow, slow + float(np.sum(material.strengths)))
        about = ": {} relaxed to {} glassy, ".format(*(with_unit(end, "Pa") for end in ends))
        about += f"{len(material.times)} terms"
    elif isinstance(material, Tabulated):
        omega = np.asarray(material.omega)
        about = f", measured from {omega[0]:.3g} to {omega[-1]:.3g} rad/s"
    return f"{name} ({tables[name]['kind'].replace('_', ' ')}{about})"


def _values(name: str, values: np.ndarray) -> str:
    """The ends of an axis, and how many values it has."""
    known = quantity_of(name)
    ends = dict.fromkeys((values[0].item(), values[-1].item()))
    text = " to ".join(labelled(end, known.unit if known else "") for end in ends)
    return text + (f", {len(values)} values" if len(values) > 1 else "")
