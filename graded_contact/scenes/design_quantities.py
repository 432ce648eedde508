"""What a design is judged by: friction, contact area, ... of a block, by mean field and by contact.

Objective and limits are functions of these quantities, whichever of the two gives them.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.compliance import effective_modulus
from ..blocks.stack import Stack
from ..core.checks import Numbers, as_float
from ..core.derivative import largest
from ..core.parameters import with_values
from ..mean_field.mean_field import MeanField
from ..sliding.result import CyclicSliding, Sliding
from ..sliding.slide import solve
from ..studies.objectives import distance, friction_curve, loss_tangent, ripple
from ..surfaces.surface import Surface
from .design_scene import DesignScene
from .surface_source import RandomSurface

WAVES = 65  # in the band of a flat loss tangent
BY_MEAN_FIELD = ("friction", "contact_area")

Values = Mapping[str, Float[Array, "..."]]  # parameters by path
Quantities = Mapping[str, Float[Array, " velocities"]]

# Of a cycle the mean over the times, or the highest pressure of all times.
OF_CONTACT: dict[str, Callable[[Any], Array]] = {
    "friction": lambda found: found.mean_friction if found.is_cycle else found.friction,
    "contact_area": lambda found: jnp.mean(found.contact_area),
    "mean_gap": lambda found: jnp.mean(found.mean_gap),
    "peak_pressure": lambda found: largest(found.pressure),
    "peak_over_mean": lambda found: found.peak_friction / found.mean_friction,
}


@eqx.filter_jit
def design_mean_field(
    study: DesignScene, stack: Stack, velocities: Numbers | None = None
) -> MeanField:
    """Returns the mean field of a stack at the velocities of the study, or at others [m/s]."""
    scene = study.scene
    return friction_curve(
        stack, study.spectrum, pressure=scene.pressure[0],
        velocities=scene.velocity if velocities is None else velocities,
        strain_per_slope=scene.strain_per_slope,
    )  # fmt: skip


def has_mean_field(study: DesignScene) -> bool:
    """Returns whether there is a mean field of the scene: no motion, no window."""
    return study.scene.motion is None and getattr(study.spectrum, "periodic", True)


def mean_field_quantities(study: DesignScene, stack: Stack) -> Quantities:
    """Returns what the mean field knows of a stack."""
    field = design_mean_field(study, stack)
    return {name: getattr(field, name) for name in BY_MEAN_FIELD}


def search_surfaces(study: DesignScene) -> list[Surface]:
    """Returns the surfaces of a search by contact: of each seed of the scene, or of its file."""
    source = study.scene.surface
    if not isinstance(source, RandomSurface):
        return [source.build()]
    return [source.drawn(source.seed + i) for i in range(source.seeds or 1)]


def contact_at(
    study: DesignScene, stack: Stack, surface: Surface, velocity: Any
) -> Sliding | CyclicSliding:
    """Returns the contact of a stack on a surface at a velocity, or highest speed [m/s]."""
    scene = study.scene
    bare = dataclasses.replace(scene, stack=stack, sweep={}, temperature=None, direction=0.0)
    case = bare.case({"pressure": scene.pressure[0], "velocity": velocity}, surface)
    return solve(case, dataclasses.replace(scene.numerics, throw=True))


def contact_quantities(study: DesignScene, stack: Stack, surfaces: list[Surface]) -> Quantities:
    """Returns what the study needs of a stack, by contact: means over surfaces of one grid."""
    velocities = jnp.asarray(study.scene.velocity)

    def on(surface: Surface) -> dict[str, Array]:
        def at(velocity: Array) -> dict[str, Array]:
            found = contact_at(study, stack, surface, velocity)
            # All of one contact: what nothing uses is left out when it is compiled.
            return {name: OF_CONTACT[name](found) for name in (*BY_MEAN_FIELD, *study.quantities)}

        return jax.lax.map(at, velocities)

    if len(surfaces) == 1:
        return on(surfaces[0])
    heights, grid = jnp.stack([surface.heights for surface in surfaces]), surfaces[0].grid
    every = jax.lax.map(lambda rough: on(Surface(rough, grid)), heights)
    return jax.tree.map(lambda values: jnp.mean(values, axis=0), every)


def objective_of(
    study: DesignScene, stack: Stack, found: Quantities, before: Mapping[str, Numbers]
) -> Float[Array, ""]:
    """Returns what a search makes small.

    **Arguments:**

    - `stack`: the block.
    - `found`, `before`: quantities of this block, and of the block of the scene.
    """
    if study.band is not None:
        return jnp.mean(jnp.stack([ripple(tangent) for tangent in band_tangents(study, stack)]))
    if study.goal is not None:
        goal = study.goal * (as_float(before["friction"]) if study.relative else 1)
        # 1 where it is reached: a value whose relative changes mean something.
        return jnp.exp(distance(found["friction"], goal))
    if study.quantity == "friction_ratio":
        value = found["friction"][0] / found["friction"][1]
    else:
        # The geometric mean: a velocity with little friction counts as much as one with much.
        value = jnp.exp(jnp.mean(jnp.log(found[study.quantity])))
    return -value if study.objective.startswith("maximise") else value


def margins_of(study: DesignScene, found: Quantities) -> dict[str, Float[Array, ""]]:
    """Returns the margin of each limit whose quantity is in `found`, relative, by its name."""
    velocities = study.scene.velocity
    margins = {}
    for quantity, end, limit in study.limits or ():
        for i, v in enumerate(velocities if quantity in found else ()):
            most = "most" if end == "max" else "least"
            at = f" at {v:g} m/s" if len(velocities) > 1 else ""
            room = found[quantity][i] / limit - 1
            name = f"{quantity.replace('_', ' ')} of at {most} {limit:g}{at}"
            margins[name] = -room if end == "max" else room
    return margins


def block_margins(study: DesignScene, values: Values) -> dict[str, Float[Array, ""]]:
    """Returns the margins of the limits that need the block alone, relative, by name."""
    own, stiffness, limit = study.scene.stack, study.stiffness, study.total_thickness
    stack, margins = with_values(own, values), {}
    if stiffness is not None:
        # Two one-sided limits, relative as `minimise` wants them.
        change = limited_modulus(study, stack) / limited_modulus(study, own) - 1
        percent = f"by at most {100 * stiffness.within:.3g} %"
        margins[f"stiffness higher {percent}"] = stiffness.within - change
        margins[f"stiffness lower {percent}"] = stiffness.within + change
    if limit is not None:
        margins[f"total thickness of at most {limit:g} m"] = 1 - total_thickness(stack) / limit
    return margins


def band_tangents(study: DesignScene, stack: Stack) -> list[Float[Array, " waves"]]:
    """Returns the loss tangent over the band, at each velocity."""
    assert study.band is not None
    q = np.geomspace(*study.band, WAVES)
    return [loss_tangent(stack, q, v) for v in study.scene.velocity]


def limited_modulus(study: DesignScene, stack: Stack) -> Float[Array, ""]:
    """Returns |effective_modulus| at the wave whose stiffness is limited."""
    wave = study.stiffness
    assert wave is not None
    return jnp.abs(effective_modulus(stack, wave.q, wave.omega))


def total_thickness(stack: Stack) -> Float[Array, ""]:
    """Returns the thickness of all layers [m]."""
    return sum((layer.thickness for layer in stack.layers), start=jnp.zeros(()))
