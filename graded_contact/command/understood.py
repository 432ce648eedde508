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
from ..scenes.surface_source import RandomSurface
from ..scenes.toml import parse_toml


def print_understood(scene: Scene) -> None:
    """Prints the block from the loaded surface downwards, the surface, and what is varied."""
    tables = parse_toml(scene.text)
    known, lines = tables["materials"], {}
    for i, (layer, table) in enumerate(
        zip(scene.stack.layers, tables.get("layers", []), strict=True), start=1
    ):
        if isinstance(layer, GradedLayer):
            of = f"{table['bottom']} (below) to {table['top']} (above)"
        else:
            of = _material(table["material"], known, layer.material)
        lines[f"layer {i}"] = f"{with_unit(float(layer.thickness), 'm')} of {of}"
    base, lines["base"] = scene.stack.base, tables["base"]["kind"].replace("_", "-")
    if isinstance(base, HalfSpace):
        lines["base"] += f" of {_material(tables['base']['material'], known, base.material)}"
    kind = "random" if isinstance(scene.surface, RandomSurface) else "sphere"
    lines["surface"] = tables["surface"].get("path", kind)
    axes = scene.axes
    if scene.temperature is not None:
        axes["temperature"] = np.atleast_1d(scene.temperature)
    for name, values in axes.items():
        quantity = quantity_of(name)
        ends = dict.fromkeys((values[0].item(), values[-1].item()))
        text = " to ".join(labelled(end, quantity.unit if quantity else "") for end in ends)
        text += f", {len(values)} values" if len(values) > 1 else ""
        lines["seed" if name == "seed" else title_of(name, scene.text)] = text
    for name, text in lines.items():
        typer.echo(f"{name:22} {text}")


def _material(name: str, tables: dict[str, Any], material: AbstractMaterial) -> str:
    """The name of a material, its kind, and the range of its modulus."""
    about = ""
    if isinstance(material, Elastic):
        about = f": {with_unit(float(material.modulus(0.0)), 'Pa')}"
    elif isinstance(material, Prony):
        ends = (with_unit(float(end), "Pa") for end in (material.equilibrium, material.glassy))
        about = ": {} relaxed to {} glassy, ".format(*ends) + f"{len(material.times)} terms"
    elif isinstance(material, Tabulated):
        omega = np.asarray(material.omega)
        about = f", measured from {omega[0]:.3g} to {omega[-1]:.3g} rad/s"
    return f"{name} ({tables[name]['kind'].replace('_', ' ')}{about})"
