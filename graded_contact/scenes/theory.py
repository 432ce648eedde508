"""Results of a scene without solving its contacts: mean field and materials.

Friction of frequencies at which no material was measured is refused before the first solve.
Errors of materials are propagated to the friction; the mean field shows which frequencies matter.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import jax
import numpy as np
import scipy
from jaxtyping import ArrayLike

from ..blocks.stack import Stack
from ..core.checks import within
from ..core.parameters import places
from ..core.quantities import TRANSIENT
from ..fields.frequency import velocity_along, wave_frequencies
from ..fields.grid import Grid
from ..kernels.periodic import period_frequencies
from ..materials.coverage import (
    check_frequencies,
    coverage,
    is_unknown,
    may_refuse,
    unknown_share,
)
from ..materials.material import Prony
from ..materials.shift import require_shift
from ..mean_field.mean_field import MeanField, mean_field_of
from ..sliding.bodies import TwoBodies
from ..sliding.motion.transient import SingleMotion
from ..sliding.numbers.doubts import EXTRAPOLATED
from ..studies.parameter_covariance import Errors
from ..studies.uncertainty import Sensitivity, sensitivity
from ..surfaces.statistics import radial_spectrum
from ..surfaces.surface import Surface
from .scene import Scene
from .scene_checks import refuse_tables
from .surface_source import RandomSurface

MODULI_PER_DECADE = 8  # frequencies of a table of moduli
SLOWER = 0.01  # waves across the velocity excite lower frequencies than those along it


def mean_field_at(scene: Scene, surface: Surface, index: tuple[int, ...]) -> MeanField | None:
    """Returns the mean field at one of a scene's points, also if it misses its tolerance.

    None for a scene with a [law]: the mean field is that of a hard wall.

    **Arguments:**

    - `surface`: of the scene.
    - `index`: of the point, along the axes.
    """
    if scene.law is not None:
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
    """Returns the roughness as the mean field takes it; a profile by its waves.

    **Raises:** `ValueError` for a scene with a [law], which the mean field does not have.
    """
    refuse_tables(scene, "The mean field", "law")
    if surface.heights.ndim == 1:
        return surface
    if isinstance(scene.surface, RandomSurface):
        return scene.surface.spectrum
    return radial_spectrum(surface)


def check_frequencies_of(scene: Scene, surface: Surface) -> None:
    """Refuses, before the first solve, friction at frequencies outside the measurements of a
    material.

    Frequencies outside a table of moduli are refused whatever their share. A series is refused if
    more than 1 % of the friction at some velocity comes from frequencies that were not measured, by
    the mean field at the highest pressure. `extrapolate = true` in [load], or `extrapolate =
    "plateau"` of a table, allows them. Each temperature and block of [sweep] is checked.
    """
    if scene.kind == TRANSIENT:
        return _check_rates(scene)
    for point, bodies in scene.all_bodies():
        stack, counterface = bodies
        where = ", ".join(f"{name} = {value:g}" for name, value in point.items())
        with within(f"At {where}:") if where else contextlib.nullcontext():
            if counterface is not None and scene.motion is not None:
                with within("[counterface] and [motion]:"):
                    check_frequencies(counterface, _excited(scene, surface.grid))
            if coverage(stack) is None:
                continue
            with within("[load] `velocity` and the surface:"):
                check_frequencies(stack, _excited(scene, surface.grid))
            if surface.periodic:  # there is no mean field of a window
                shares = partial(_shares, scene, surface, bodies)
                refuse_extrapolated(scene, stack, surface.grid, shares)


def _check_rates(scene: Scene) -> None:
    """Refuses what happens once at rates at which a material was not measured."""
    assert isinstance(scene.motion, SingleMotion)
    rates = scene.motion.rates
    bodies = [
        (name, stack)
        for _, both in scene.all_bodies()
        for name, stack in zip(("block", "counterface"), both, strict=True)
        if stack is not None
    ]
    for body, stack in bodies:
        known = coverage(stack)
        if scene.extrapolate or known is None or may_refuse(stack):  # a table has no history
            continue
        if unknown_share(*rates, known) > EXTRAPOLATED:
            raise ValueError(
                f"[motion] needs moduli from {rates[0]:.5g} rad/s (one over its last time) to "
                f"{rates[1]:.5g} rad/s (one over its shortest step), but the materials of the "
                f"{body} were measured from {known[0]:.5g} to {known[1]:.5g} rad/s. Take other "
                "times, or set `extrapolate = true` in [load]."
            )


def _shares(scene: Scene, surface: Surface, bodies: TwoBodies) -> np.ndarray:
    """The share of the friction from frequencies that were not measured, at each velocity.

    Of several directions it is the largest.
    """
    shares = []
    for direction in np.ravel(scene.direction):
        one = dataclasses.replace(scene, direction=float(direction))
        shares.append([f.extrapolated_friction for f in mean_fields(one, surface, bodies)])
    return np.max(np.array(shares), axis=0)


def mean_fields(scene: Scene, surface: Surface, bodies: TwoBodies) -> list[MeanField]:
    """Returns the mean field at each velocity and the highest pressure of a scene.

    **Arguments:**

    - `surface`: of the scene.
    - `bodies`: of one of its points.
    """
    given = {**bodies._asdict(), "sweep": {}, "temperature": None, "shear": None}
    points = [{"pressure": np.max(scene.pressure), "velocity": v} for v in scene.velocity]
    return [_mean_field(scene, surface, point, **given) for point in points]


def refuse_extrapolated(
    scene: Scene, stack: Stack, grid: Grid, friction_shares: Callable[[], ArrayLike]
) -> None:
    """Refuses friction at frequencies where a material extrapolates, unless that is allowed.

    **Arguments:**

    - `scene`: its velocities.
    - `stack`: its block, at some temperature.
    - `grid`: of its surface.
    - `friction_shares`: returns the share [1] at each velocity; called if any wave is outside.

    **Raises:** `ValueError` for a share of more than 1 %.
    """
    found, excited = coverage(stack), _excited(scene, grid)
    if scene.extrapolate or found is None or not excites_unknown(scene, stack, grid):
        return  # the mean field is not needed
    low, high = map(float, found)
    shares = np.asarray(friction_shares())
    refused = shares > EXTRAPOLATED
    if np.any(refused):
        where = (
            f"the materials of the block were measured from {low:.3g} to {high:.3g} rad/s"
            if low <= high
            else "there is no frequency at which all materials of the block were measured, at this "
            "temperature"
        )
        speeds = np.abs(scene.velocity[refused])
        raise ValueError(
            f"[load] `velocity` and the surface excite {np.min(excited[excited > 0]):.3g} to "
            f"{np.max(excited):.3g} rad/s, but {where}: up to {np.max(shares):.0%} of the friction "
            f"at {np.sum(refused)} of {len(shares)} velocities ({np.min(speeds):.3g} to "
            f"{np.max(speeds):.3g} m/s) would come from outside. Take other velocities or another "
            "temperature, or set `extrapolate = true` in [load]."
        )


def excites_unknown(scene: Scene, stack: Stack, grid: Grid) -> bool:
    """Returns whether a wave has a frequency at which a material was not measured.

    **Arguments:**

    - `scene`: its velocities.
    - `stack`: one of its blocks.
    - `grid`: of its surface.
    """
    known = coverage(stack)
    return known is not None and bool(np.any(is_unknown(_excited(scene, grid), known)))


def _excited(scene: Scene, grid: Grid) -> np.ndarray:
    """Frequencies [rad/s] of all waves at each velocity; of a cycle, those of its times."""
    if scene.motion is not None:
        periods = scene.period_at(scene.velocity)
        return np.array([period_frequencies(scene.num_times, period) for period in periods])
    directions = map(float, np.ravel(scene.direction))
    velocities = [velocity_along(v, angle) for angle in directions for v in scene.velocity]
    # Along x alone a column of frequencies is enough.
    return np.abs(np.concatenate([np.ravel(wave_frequencies(grid, v)) for v in velocities]))


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
    for name, material, _ in scene.errors if surface.periodic else ():
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
