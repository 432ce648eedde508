"""Friction from frequencies at which no material of a scene was measured is refused."""

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import ArrayLike

from ..core.warnings import EXTRAPOLATED
from ..fields.grid import Grid, wave_frequencies
from ..files.scene import Scene
from ..files.schema import within
from ..persson.mean_field import mean_field_friction
from ..response.stack import Stack
from ..rheology.measured import check_frequencies, coverage, is_unknown
from ..roughness.surface import Surface


def velocity_vector(speed: Any, direction: float) -> Any:
    """Returns the velocity as `slide` takes it: one number along x, otherwise two components."""
    if direction == 0:
        return speed
    unit = np.array([np.cos(direction), np.sin(direction)])
    # Rounding of a right angle would excite frequencies near zero.
    return speed * np.where(np.abs(unit) < 1e-12, 0, unit)


def check_frequencies_of(scene: Scene, surface: Surface) -> None:
    """Refuses, before the first solve, friction of frequencies that no material was measured at.

    What a table of moduli does not hold is refused whatever its share. A series is refused if more
    than 1 % of the friction at some velocity comes from where it only extrapolates, by the mean
    field of the surface at the highest pressure, unless [load] has `extrapolate = true` or a table
    of moduli `extrapolate = "plateau"`. Each temperature and block of [sweep] is looked at.
    """
    for point, stack in scene.blocks():
        if coverage(stack) is None:  # then of no other block
            return
        where = ", ".join(f"{name} = {value:g}" for name, value in point.items())
        with within(f"At {where}:") if where else contextlib.nullcontext():
            _check_block(scene, stack, surface)


def _check_block(scene: Scene, stack: Stack, surface: Surface) -> None:
    with within("[load] `velocity` and the surface:"):
        check_frequencies(stack, _excited(scene, surface.grid))

    def shares() -> np.ndarray:
        return np.array([
            mean_field_friction(
                stack,
                surface,
                pressure=np.max(scene.pressure),
                velocity=velocity_vector(v, scene.direction),
                graded_solver=scene.graded_solver,
                throw=False,
            ).extrapolated_friction
            for v in scene.velocity
        ])  # fmt: skip

    refuse_extrapolated(scene, stack, surface.grid, shares)


def refuse_extrapolated(
    scene: Scene, stack: Stack, grid: Grid, friction_shares: Callable[[], ArrayLike]
) -> None:
    """Refuses friction that comes from where a material only extrapolates, unless that is allowed.

    **Arguments:**

    - `scene`: its velocities.
    - `stack`: its block, at some temperature.
    - `grid`: of its surface.
    - `friction_shares`: returns the share [1] at each velocity; called if any wave is outside.

    **Raises:** `ValueError` for a share of more than 1 %.
    """
    found, excited = coverage(stack), _excited(scene, grid)
    if scene.extrapolate or found is None:
        return
    low, high = map(float, found)
    if not np.any(is_unknown(excited, (low, high))):
        return
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


def _excited(scene: Scene, grid: Grid) -> np.ndarray:
    """Frequencies [rad/s] of all waves at each velocity."""
    velocities = [velocity_vector(v, scene.direction) for v in scene.velocity]
    return np.abs([np.asarray(wave_frequencies(grid, v)) for v in velocities])
