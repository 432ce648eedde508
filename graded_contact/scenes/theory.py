"""Results of a scene without solving its contacts: mean field and materials.

Errors of materials are propagated to the friction; the mean field shows which frequencies matter.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
import scipy

from ..core.parameters import places
from ..materials.material import Prony
from ..materials.shift import require_shift
from ..mean_field.mean_field import MeanField, mean_field_of
from ..sliding.bodies import TwoBodies
from ..studies.parameter_covariance import Errors
from ..studies.uncertainty import Sensitivity, sensitivity
from ..surfaces.statistics import isotropic_spectrum
from ..surfaces.surface import Surface
from .scene import Scene
from .scene_checks import refuse_tables
from .surface_source import RandomSurface

MODULI_PER_DECADE = 8  # frequencies of a table of moduli
SLOWER = 0.01  # waves across the velocity excite lower frequencies than those along it


def mean_field_at(scene: Scene, surface: Surface, index: tuple[int, ...]) -> MeanField | None:
    """Returns the mean field at one of a scene's points, also if it misses its tolerance.

    None for a profile and for a scene with a [law]: the mean field is that of a hard wall.

    **Arguments:**

    - `surface`: of the scene.
    - `index`: of the point, along the axes.
    """
    if scene.law is not None or surface.grid.ndim == 1:
        return None
    point = {name: at[i] for (name, at), i in zip(scene.axes.items(), index, strict=True)}
    return _mean_field(scene, surface, point)


def _mean_field(
    scene: Scene, surface: Surface, point: Mapping[str, Any], **changed: Any
) -> MeanField:
    """At a hard wall without heat, of a scene with changed fields; as `mean_field_at`."""
    without = dict(heating=None, motion=None, law=None, block_surface=None)
    scene = dataclasses.replace(scene, **without, **changed)
    case, rough = scene.case(point, surface), roughness_of(scene, surface)
    return mean_field_of(case, rough, throw=False)


def roughness_of(scene: Scene, surface: Surface) -> Any:
    """Returns the roughness as the mean field takes it.

    **Raises:** `ValueError` for a scene with a [law], which the mean field does not have.
    """
    refuse_tables(scene, "The mean field", "law")
    if isinstance(scene.surface, RandomSurface):
        return scene.surface.spectrum
    return isotropic_spectrum(surface)


def mean_fields(scene: Scene, surface: Surface, bodies: TwoBodies) -> list[MeanField]:
    """Returns the mean field at each velocity and the highest pressure of a scene.

    **Arguments:**

    - `surface`: of the scene.
    - `bodies`: of one of its points.
    """
    given = {**bodies._asdict(), "sweep": {}, "temperature": None, "shear": None}
    points = [{"pressure": np.max(scene.pressure), "velocity": v} for v in scene.velocity]
    return [_mean_field(scene, surface, point, **given) for point in points]


def errors_of_bodies(scene: Scene) -> Errors | None:
    """Returns the errors of the numbers of both bodies of a scene, or None without errors.

    A material at several places has the same errors at all of them.
    """
    names, blocks = [], []
    for _, material, known in scene.errors:
        at = places(TwoBodies(scene.stack, scene.counterface), material)
        at = [place.removeprefix("stack.") for place in at]
        if at:
            names += [f"{place}.{path}" for place in at for path in known.paths]
            # The errors of one material act at all its places together.
            blocks.append(np.tile(known.directions, len(at)))
    return Errors(tuple(names), scipy.linalg.block_diag(*blocks)) if names else None


def what_decides(scene: Scene, surface: Surface) -> dict[tuple[str, float], Sensitivity]:
    """Returns which frequencies of its materials decide the friction of a scene.

    The mean field of an isotropic surface gives them for each series with errors: at the slowest, a
    middle and the fastest velocity that is not 0, the highest pressure, the first temperature and
    the block of the file, without [sweep]. A window has none.

    **Arguments:**

    - `scene`, `surface`: what was run.

    **Returns:** the sensitivity by the name of the material and the velocity [m/s]; frequencies are
    those at the scene's temperature.
    """
    speeds = np.unique(np.abs(scene.velocity[scene.velocity != 0]))
    found = {}
    for name, material, _ in scene.errors if surface.periodic and surface.grid.ndim == 2 else ():
        if not isinstance(material, Prony) or not places(scene.stack, material):
            continue
        for speed in np.unique(speeds[[0, len(speeds) // 2, -1]] if len(speeds) else speeds):
            found[name, float(speed)] = _decided_by(scene, surface, material, speed)
    return found


def _decided_by(scene: Scene, surface: Surface, material: Prony, speed: float) -> Sensitivity:
    grid = surface.grid
    ends = SLOWER * 2 * np.pi / np.max(grid.size), np.pi / np.min(grid.spacing)
    # From the slowest wave across the velocity to the shortest wave along it.
    count = int(MODULI_PER_DECADE * np.log10(ends[1] / ends[0])) + 2
    omega, factor = np.geomspace(*ends, count) * speed, 1.0
    point = {"pressure": np.max(scene.pressure), "velocity": speed}
    if scene.temperature is not None:
        point["temperature"] = np.ravel(scene.temperature)[0]
        factor = float(require_shift(material.shift).factor(point["temperature"]))

    def friction(table: Any) -> jax.Array:
        # By identity: another material with the same numbers stays.
        swapped = jax.tree.map(
            lambda node: table if node is material else node,
            TwoBodies(scene.stack, scene.counterface),
            is_leaf=lambda node: node is material,
        )
        given = {**swapped._asdict(), "sweep": {}, "shear": None, "direction": 0.0}
        return _mean_field(scene, surface, point, **given).friction

    # The table is about the temperature at which the material is written.
    found = sensitivity(friction, material, omega * factor)
    return Sensitivity(found.omega / factor, found.storage, found.loss)
