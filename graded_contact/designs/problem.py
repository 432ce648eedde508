"""A design as functions of its parameters: criteria, objective and limits of a block.

The criteria are those of the mean field, or of contact; objective and limits are functions of them,
whichever of the two gives them.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..blocks.stack import Stack
from ..core.checks import Numbers, as_float
from ..core.compilation import compiled
from ..core.parameters import with_values
from ..mean_field.mean_field import MeanField, reached
from ..sliding.result import CyclicSliding, Sliding
from ..sliding.slide import slide_case
from ..studies.search import Constraints, Objective
from ..surfaces.surface import Surface
from .limits import BY_MEAN_FIELD, CRITERIA, Criteria
from .objectives import refined_curve
from .table import DesignScene

Parameters = Mapping[str, Float[Array, "..."]]  # values by path


def criteria_of(
    study: DesignScene, stack: Stack, surfaces: list[Surface] | None = None
) -> dict[str, Float[Array, " velocities"]]:
    """Returns friction, contact area and what else a design needs of a block, by name.

    **Arguments:**

    - `study`: what to design.
    - `stack`: the block.
    - `surfaces`: of one grid, for the mean over their contacts; None for the mean field.
    """
    if surfaces is None:
        field = design_mean_field(study, stack)
        return {name: getattr(field, name) for name in BY_MEAN_FIELD}
    velocities = jnp.asarray(study.scene.velocity)

    def on(surface: Surface) -> dict[str, Array]:
        return jax.lax.map(lambda v: contact_criteria(study, stack, surface, v), velocities)

    if len(surfaces) == 1:
        return on(surfaces[0])
    heights, grid = jnp.stack([surface.heights for surface in surfaces]), surfaces[0].grid
    every = jax.lax.map(lambda rough: on(Surface(rough, grid)), heights)
    return jax.tree.map(lambda values: jnp.mean(values, axis=0), every)


def design_mean_field(
    study: DesignScene, stack: Stack, velocities: Numbers | None = None
) -> MeanField:
    """Returns the mean field of a stack at the velocities of the study, or at others [m/s]."""
    case = study.case_of(stack)
    velocities = as_float(study.scene.velocity if velocities is None else velocities)
    return reached(refined_curve(case, velocities, study.nodes)[0])


def contact_criteria(
    study: DesignScene, stack: Stack, surface: Surface, velocity: Any
) -> dict[str, Array]:
    """Returns the criteria of a stack by contact at a velocity, or highest speed [m/s]."""
    return criteria_in(study, stack, design_contact(study, stack, surface, velocity))


def design_contact(
    study: DesignScene, stack: Stack, surface: Surface, velocity: Any
) -> Sliding | CyclicSliding:
    """Returns the contact of a stack at a velocity, or highest speed [m/s]."""
    scene = study.scene
    bare = dataclasses.replace(scene, stack=stack, sweep={}, temperature=None, direction=0.0)
    case = bare.case({"pressure": scene.pressure[0], "velocity": velocity}, surface)
    return cast(
        Sliding | CyclicSliding, slide_case(case, dataclasses.replace(scene.numerics, throw=True))
    )


def criteria_in(
    study: DesignScene, stack: Stack, found: Sliding | CyclicSliding
) -> dict[str, Array]:
    """Returns the criteria of a study from a contact of a stack; of "tension", also its depth,
    "tension_depth".
    """
    # All of one contact: what nothing uses is left out when it is compiled.
    names = dict.fromkeys((*BY_MEAN_FIELD, *study.criteria))
    depths = study.limits.stress_depths
    values = {}
    for name in names:
        values[name] = CRITERIA[name].of_contact(found, stack, depths)
        if CRITERIA[name].of_stress:
            values[name], values[f"{name}_depth"] = values[name]
    return values


def by_contact(study: DesignScene) -> Callable[[Parameters], Criteria]:
    """Returns the criteria by contact on the surfaces of a search, as one program."""
    own, surfaces = study.scene.stack, study.surfaces
    return compiled(lambda values: criteria_of(study, with_values(own, values), surfaces))


def design_problem(
    study: DesignScene, before: Criteria, surfaces: list[Surface] | None = None
) -> tuple[Objective, Constraints]:
    """Returns objective and constraints of a design, as functions of parameters.

    Both are for `minimise`, or any other search: they take a dict of numbers by path. The objective
    gives a pair of its number and the margins of the limits on criteria that are known.

    **Arguments:**

    - `study`: what to design.
    - `before`: criteria of the block of the scene, for an objective that is relative to it.
    - `surfaces`: as in `criteria_of`.
    """
    scene, limits = study.scene, study.limits
    if surfaces is None and study.criteria:
        _ = study.nodes  # found here, because a search traces the objective

    def objective(values: Parameters) -> tuple[Float[Array, ""], dict[str, Array]]:
        stack = with_values(scene.stack, values)
        found = criteria_of(study, stack, surfaces) if study.criteria else {}
        value = study.objective.value(stack, found, before)
        return value, limits.margins(found, scene.velocity)

    def constraints(values: Parameters) -> dict[str, Float[Array, ""]]:
        return limits.block_margins(scene.stack, with_values(scene.stack, values))

    return objective, constraints
