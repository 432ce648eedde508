"""What makes the numbers of a scene doubtful before it is solved, in sentences.

A number in another unit is wrong by 1000 mostly: loads are compared with the moduli, lengths with
the grid. The numbers of [design] are judged in the same way.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import numpy as np

from ..core.display import with_unit
from ..fields.grid import Grid
from ..materials.material import AbstractMaterial
from .scene import Scene

# A wrong unit is wrong by 1000 mostly.
USUAL = {
    "thickness": (1e-9, 1.0, "m"),  # of a layer
    "gap": (1e-11, 1.0, "m"),
    "pressure": (1e-6, 1e12, "Pa"),
    "stress": (1e-6, 1e12, "Pa"),
}
_SMALL_BESIDE = 0.3  # of the load
_LEAST_PRESSURE = 10.0  # by the weight of 1 mm of rubber [Pa]; on soft solids less is usual
# Of loads over the softest and the stiffest relaxed modulus, of thicknesses over the spacing of the
# grid and over its edge, of limits of stresses over the load [1].
_PRESSURES, _THICKNESSES, _LEAST_STRESS = (1e-5, 1e3), (1e-3, 1e4), 1e-3

UsualSizes = Mapping[str, tuple[float, float]]


def doubts_of(scene: Scene, grid: Grid) -> Iterator[str]:
    """Yields what makes the numbers of a scene on a grid doubtful."""
    usual = usual_beside(scene, grid)
    yield from doubts_about(usual, "pressure", scene.pressure, "[load]")
    for owner, body in (("", scene.stack), ("counterface.", scene.counterface)):
        for i, layer in enumerate(() if body is None else body.layers):
            path = f"{owner}layers[{i}].thickness"
            values = np.append(scene.sweep.get(path, []), layer.thickness)
            yield from doubts_about(usual, "thickness", values, path.removesuffix(".thickness"))
    fluid = scene.fluid
    if fluid is None or not np.size(scene.pressure):  # an approach has no pressure yet
        return
    least = float(np.min(scene.pressure))
    if fluid.pressure_difference > _SMALL_BESIDE * least:
        ours, most = (with_unit(value, "Pa") for value in (least, fluid.pressure_difference))
        yield (
            f"The fluid's pressure difference of {most} is not small beside the load of {ours}: "
            "it lifts the surface, which the model leaves out."
        )


def usual_beside(scene: Scene, grid: Grid) -> UsualSizes:
    """Returns the lowest and the highest usual pressure, stress [Pa], thickness and gap [m]."""
    is_material = lambda node: isinstance(node, AbstractMaterial)  # noqa: E731
    parts = jax.tree.leaves((scene.stack, scene.counterface), is_leaf=is_material)
    relaxed = [float(abs(part.modulus(0.0))) for part in parts if is_material(part)]
    moduli = [one for one in relaxed if one > 0]  # of a liquid it is 0
    highest = _PRESSURES[1] * max(moduli, default=math.inf)
    loads = scene.pressure if np.size(scene.pressure) else [0.0]
    edge = float(np.max(grid.size))
    return {
        "pressure": (min(_LEAST_PRESSURE, _PRESSURES[0] * min(moduli, default=0.0)), highest),
        "stress": (_LEAST_STRESS * np.min(loads), highest),
        "thickness": (_THICKNESSES[0] * float(np.min(grid.spacing)), _THICKNESSES[1] * edge),
        "gap": (0.0, edge),
    }


def doubts_about(usual: UsualSizes, name: str, values: Any, where: str) -> Iterator[str]:
    """Yields a sentence for the lowest and for the highest value of a kind, if it is unusual."""
    values = np.ravel(values)
    for value in dict.fromkeys([np.min(values), np.max(values)] if values.size else []):
        if sentence := unusual(name, float(value), *usual[name]):
            yield f"{where}: {sentence}"


def unusual(name: str, value: float, at_least: float = 0.0, at_most: float = math.inf) -> str:
    """Returns a warning if a number [SI] is outside of its range in `USUAL`, or nothing.

    The range is narrower if `at_least` and `at_most` say so.
    """
    low, high, unit = USUAL[name]
    low, high = max(low, at_least), min(high, at_most)
    if low <= value <= high:
        return ""
    here, first, last = (with_unit(n, unit) if unit else f"{n:.2g}" for n in (value, low, high))
    return f"The {name} of {here} is unusual (usual are {first} to {last}): check units."
