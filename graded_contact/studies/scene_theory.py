"""The mean field of a scene, beside its contacts."""

from typing import Any

from ..files.scene import RandomSurface, Scene
from ..persson.mean_field import MeanField, mean_field_friction
from ..roughness.surface import Surface, radial_spectrum
from .extrapolation import velocity_vector


def mean_field_at(scene: Scene, surface: Surface, index: tuple[int, ...]) -> MeanField:
    """Returns the mean field at one of a scene's points, of any accuracy that it has.

    **Arguments:**

    - `surface`: of the scene.
    - `index`: of the point, along the axes.
    """
    point = {name: at[i] for (name, at), i in zip(scene.axes.items(), index, strict=True)}
    return mean_field_friction(
        scene.block(point),
        roughness_of(scene, surface),
        pressure=point["pressure"],
        velocity=velocity_vector(point["velocity"], scene.direction),
        graded_solver=scene.graded_solver,
        throw=False,
    )


def roughness_of(scene: Scene, surface: Surface) -> Any:
    """Returns the roughness as the mean field takes it; a profile by its waves."""
    if surface.heights.ndim == 1:
        return surface
    if isinstance(scene.surface, RandomSurface):
        return scene.surface.spectrum
    return radial_spectrum(surface)
