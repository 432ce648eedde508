"""What is known of the materials of a scene, carried to its friction."""

import dataclasses
from typing import Any

import jax
import numpy as np
from scipy.linalg import block_diag

from ..core.parameters import places
from ..files.parameter_covariance import Errors
from ..files.scene import Scene
from ..persson.mean_field import mean_field_friction
from ..rheology.material import Prony
from ..rheology.shift import require_shift
from ..roughness.surface import Surface
from .scene_theory import roughness_of
from .uncertainty import Sensitivity, sensitivity

PER_DECADE = 8  # frequencies of a table of moduli
SLOWER = 0.01  # waves across the velocity excite lower frequencies than those along it


def errors_of_stack(scene: Scene) -> Errors | None:
    """Returns what is known of the numbers of a scene's stack, None if of none.

    A material that lies at several places is off alike at all of them.
    """
    names, blocks = [], []
    for _, material, known in scene.errors:
        at = places(scene.stack, material)
        if at:
            names += [f"{place}.{path}" for place in at for path in known.paths]
            blocks.append(np.tile(known.directions, len(at)))
    return Errors(tuple(names), block_diag(*blocks)) if names else None


def what_decides(scene: Scene, surface: Surface) -> dict[tuple[str, float], Sensitivity]:
    """Returns which frequencies of its materials decide the friction of a scene.

    By the mean field of an isotropic surface, for each series of which errors are known: at the
    slowest, a middle and the fastest velocity that is not 0, the highest pressure, the first
    temperature and the block as it is written, without [sweep].

    **Arguments:**

    - `scene`, `surface`: what was run.

    **Returns:** the sensitivity by the name of the material and the velocity [m/s]; frequencies are
    those at the scene's temperature.
    """
    speeds = np.unique(np.abs(scene.velocity[scene.velocity != 0]))
    found = {}
    for name, material, _ in scene.errors:
        if not isinstance(material, Prony) or not places(scene.stack, material):
            continue
        for speed in np.unique(speeds[[0, len(speeds) // 2, -1]] if len(speeds) else speeds):
            found[name, float(speed)] = _decided_by(scene, surface, material, speed)
    return found


def _decided_by(scene: Scene, surface: Surface, material: Prony, speed: float) -> Sensitivity:
    grid, rough = surface.grid, roughness_of(scene, surface)
    ends = SLOWER * 2 * np.pi / np.max(grid.size), np.pi / np.min(grid.spacing)
    count = int(PER_DECADE * np.log10(ends[1] / ends[0])) + 2
    omega, factor, point = np.geomspace(*ends, count) * speed, 1.0, {}
    if scene.temperature is not None:
        point["temperature"] = np.ravel(scene.temperature)[0]
        factor = float(require_shift(material.shift).factor(point["temperature"]))

    def friction(table: Any) -> jax.Array:
        swapped = jax.tree.map(
            lambda node: table if node is material else node,
            scene.stack,
            is_leaf=lambda node: node is material,
        )
        block = dataclasses.replace(scene, stack=swapped, sweep={}).block(point)
        return mean_field_friction(
            block,
            rough,
            pressure=np.max(scene.pressure),
            velocity=speed,
            graded_solver=scene.graded_solver,
            throw=False,
        ).friction

    # The table is about the temperature at which the material is written.
    found = sensitivity(friction, material, omega * factor)
    return Sensitivity(found.omega / factor, found.storage, found.loss)
