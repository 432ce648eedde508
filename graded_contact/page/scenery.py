"""The numbers of a scene at one point, by their paths, and the tables that contain them.

A change of numbers is one step, `with_values(scenery, {path: number})`. From the changed scenery
follow its contact (`Scenery.case`) and its file (`with_numbers`).
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw
from ..core.parameters import arrays
from ..fields.frequency import velocity_along
from ..materials.shift import shifts_in
from ..scenes.scene import Scene
from ..scenes.surface_source import RandomSurface, Sphere
from ..sliding.case import Case, Heating
from ..sliding.shear import AbstractShear
from ..surfaces.rescaling import rescale
from ..surfaces.spectrum import SelfAffine
from ..surfaces.spectrum_table import SpectrumTable
from ..surfaces.statistics import isotropic_spectrum, statistics
from ..surfaces.surface import Surface
from .document import Document, material_table

Number = Float[Array, ""]
KEPT_KEYS = ("errors", "assumed")  # keys of a material whose series is written branch by branch


class ReadSurface(eqx.Module):
    """A surface that was read, rescaled to a rms height [m]."""

    rms_height: Number
    surface: Surface

    def build(self) -> Surface:
        """Returns the surface."""
        return rescale(self.surface, rms_height=self.rms_height)


class Scenery(eqx.Module):
    """What decides the contact of a page: a scene at one pressure and one velocity.

    **Fields:**

    - `pressure` [Pa], `velocity` [m/s], `temperature` [K]: one number each. If the scene has no
      temperature, it is the common reference of the materials, or None.
    - `stack`, `surface`: the block; and what the surface is built of.
    - `shear`, `heating`, `law`, `strain_per_slope`, `direction`: as in `Scene`.
    - `spectrum`: of a surface that is not random, over its mean square, or None for a profile.
    """

    pressure: Number
    velocity: Number
    temperature: Number | None
    stack: Stack
    surface: RandomSurface | Sphere | ReadSurface
    shear: AbstractShear | None
    heating: Heating | None
    law: AbstractLaw
    strain_per_slope: float | None
    direction: float = eqx.field(static=True)
    spectrum: SpectrumTable | None

    def case(self, surface: Any = None) -> Case:
        """Returns the case of these numbers, on another surface than its own, or a spectrum."""
        stack, temperature = self.stack, self.temperature
        return Case(
            stack=stack if temperature is None else stack.at(temperature),
            surface=self.surface.build() if surface is None else surface, pressure=self.pressure,
            velocity=velocity_along(self.velocity, self.direction), law=self.law, shear=self.shear,
            temperature=temperature, heating=self.heating, strain_per_slope=self.strain_per_slope,
        )  # fmt: skip

    def roughness(self) -> Any:
        """Returns what the mean field takes for the surface."""
        if isinstance(self.surface, RandomSurface) and self.surface.grid.ndim == 2:
            return self.surface.spectrum
        if self.spectrum is None:
            raise ValueError("A profile has no mean field.")
        square = jnp.var(self.surface.build().heights)
        return eqx.tree_at(lambda s: s.values, self.spectrum, self.spectrum.values * square)


def scenery_of(scene: Scene, surface: Surface) -> Scenery:
    """Returns the numbers of a scene of one point, whose surface is built."""
    number, temperature = jnp.asarray, _common_temperature(scene)
    source, spectrum = scene.surface, None
    if isinstance(source, Sphere):
        source = source._replace(radius=number(source.radius))
    elif not isinstance(source, RandomSurface):
        source = ReadSurface(statistics(surface).rms_height, surface)
    if not isinstance(source, RandomSurface) and surface.grid.ndim == 2:
        table = isotropic_spectrum(surface)
        spectrum = SpectrumTable(table.q, table.values / jnp.var(surface.heights))
    return Scenery(
        pressure=number(scene.pressure[0]), velocity=number(scene.velocity[0]), stack=scene.stack,
        temperature=None if temperature is None else number(temperature), surface=source,
        shear=scene.shear, heating=scene.heating, law=scene.contact_law, spectrum=spectrum,
        strain_per_slope=scene.strain_per_slope, direction=float(scene.direction),
    )  # fmt: skip


def _common_temperature(scene: Scene) -> float | None:
    if scene.temperature is not None:
        return float(scene.temperature)
    references = {round(float(law.reference), 6) for law in shifts_in(scene.stack)}
    if len(references) != 1:
        return None
    try:
        eqx.filter_eval_shape(scene.stack.at, reference := references.pop())
    except ValueError:  # a material without a law
        return None
    return reference


def part_at(tree: Any, path: str) -> Any:
    """Returns the part of `tree` at a path: a material at "stack.layers[0].material"."""
    for word in path.replace("[", ".").replace("]", "").split("."):
        tree = tree[int(word)] if word.isdigit() else getattr(tree, word)
    return tree


def table_key(scenery: Any, path: str) -> str:
    """Returns the key of the tables for the number at a path."""
    if path == "surface.spectrum.amplitude" and isinstance(scenery.surface.spectrum, SelfAffine):
        return scenery.surface.spectrum.prescribed
    return path.rpartition(".")[2]


def layer_of(path: str) -> int:
    """Returns the index of the layer to which a path leads."""
    return int(path.partition("[")[2].partition("]")[0])


def with_numbers(document: Document, before: Any, after: Any) -> Document:
    """Returns the scene with the numbers of `after` in its tables, where those of `before` differ.

    Both are a `Scenery`, or what has the `stack` of one.

    A series with a changed modulus is written branch by branch.
    """
    document, materials = document.copied(), document.scene.materials
    content, new = document.content, arrays(after)
    for path, old in arrays(before).items():
        if np.array_equal(old, new[path]):
            continue
        owner, _, last = path.rpartition(".")
        head, name = path.partition(".")[0], materials.get(owner.removeprefix("stack."))
        if name is not None:
            table = content["materials"][name]
            if last in ("equilibrium", "strengths", "times"):
                kept = {key: table[key] for key in KEPT_KEYS if key in table}
                content["materials"][name] = material_table(part_at(after, owner)) | kept
                continue
        elif head == "stack":
            part = owner.rpartition(".")[2]  # a bond or a shape has a table of its own
            if part == "shift":
                raise ValueError(f"no table takes the number at {path.removeprefix('stack.')!r}.")
            table = content["layers"][layer_of(path)]
            table = table[part] if part in ("bond", "shape") else table
        else:
            table = content[head if owner else "load"]
        if np.ndim(new[path]):
            raise ValueError(f"no table takes the numbers at {path.removeprefix('stack.')!r}.")
        # The digits that tell the number from its neighbours in its precision.
        table[table_key(after, path)] = float(str(np.asarray(new[path])))
        if path == "surface.rms_height":
            table.pop("rms_slope", None)  # a file takes one of the two
    return document
