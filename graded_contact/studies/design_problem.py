"""What a design makes least, and its limits, as functions of parameters."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import Numbers, as_float
from ..core.parameters import with_values
from ..fields.grid import Grid
from ..files.design_scene import DesignScene
from ..files.results import package_versions
from ..files.surfaces import RandomSurface
from ..friction.sliding import slide
from ..persson.mean_field import MeanField
from ..response.compliance import effective_modulus
from ..response.stack import Stack
from ..roughness.surface import Surface, random_surface
from .design import Constraints, Objective
from .objectives import distance, friction_curve, loss_tangent, ripple
from .store import Point, Store, fingerprint

WAVES = 65  # of a band whose loss tangent is to be flat
Progress = Callable[[str, int, int], None]
Values = dict[str, Float[Array, "..."]]


def mean_field_problem(study: DesignScene) -> tuple[Objective, Constraints | None]:
    """Returns what the design makes least, and its constraints, as functions of parameters.

    Both are for `minimise`, or any other search: they take a dict of numbers by path.
    """
    stack = study.scene.stack
    if study.band is not None:

        def objective(values: Values) -> Float[Array, ""]:
            tangents = band_tangents(study, with_values(stack, values))
            return jnp.mean(jnp.stack([ripple(tangent) for tangent in tangents]))

    else:
        before = mean_field_of(study, stack).friction

        def objective(values: Values) -> Float[Array, ""]:
            return _goal(study, mean_field_of(study, with_values(stack, values)).friction, before)

    return objective, _constraints(study)


def contact_problem(
    study: DesignScene, *, store: Store | None = None, progress: Progress | None = None
) -> tuple[Objective, Constraints | None]:
    """Returns the same of the friction by contact, meaned over the surfaces for polishing.

    `store` and `progress` are as in `run_design`.
    """
    stack, say = study.scene.stack, progress or silent
    fields, friction_before = [], []
    for i in range(study.verify):
        say("polish, before", i, study.verify)
        fields.append(heights_of(study, study.verify + i))
        friction_before.append(kept_contact(study, stack, fields[-1], store)[0])
    heights, before = jnp.stack(fields), np.mean(friction_before, axis=0)

    def objective(values: Values) -> Float[Array, ""]:
        changed = with_values(stack, values)
        friction = jax.lax.map(lambda h: _contact(study, changed, h)[0], heights)
        return _goal(study, jnp.mean(friction, axis=0), before)

    return objective, _constraints(study)


@eqx.filter_jit
def mean_field_of(study: DesignScene, stack: Stack) -> MeanField:
    scene = study.scene
    return friction_curve(
        stack,
        study.spectrum,
        pressure=scene.pressure[0],
        velocities=scene.velocity,
        graded_solver=scene.graded_solver,
    )


def _goal(study: DesignScene, friction: Array, before: Numbers) -> Float[Array, ""]:
    """What is to be small, of the friction at each velocity and of that before."""
    if study.wanted is not None:
        wanted = study.wanted * (as_float(before) if study.relative else 1)
        # 1 where it is reached: a value whose relative changes mean something.
        return jnp.exp(distance(friction, wanted))
    mean = jnp.exp(jnp.mean(jnp.log(friction)))
    return mean if study.objective == "minimise_friction" else -mean


def band_tangents(study: DesignScene, stack: Stack) -> list[Float[Array, " waves"]]:
    """The loss tangent over the band, at each velocity."""
    assert study.band is not None
    q = np.geomspace(*study.band, WAVES)
    return [
        loss_tangent(stack, q, v, graded_solver=study.scene.graded_solver)
        for v in study.scene.velocity
    ]


def _constraints(study: DesignScene) -> Constraints | None:
    own, stiffness, limit = study.scene.stack, study.stiffness, study.total_thickness
    if stiffness is None and limit is None:
        return None

    def constraints(values: Values) -> Float[Array, " limits"]:
        stack, parts = with_values(own, values), []
        if stiffness is not None:
            change = modulus_kept(study, stack) / modulus_kept(study, own) - 1
            parts += [stiffness.within - change, stiffness.within + change]
        if limit is not None:
            parts.append(1 - total_thickness(stack) / limit)
        return jnp.stack(parts)

    return constraints


def modulus_kept(study: DesignScene, stack: Stack) -> Float[Array, ""]:
    stiffness = study.stiffness
    assert stiffness is not None
    modulus = effective_modulus(
        stack, stiffness.q, stiffness.omega, graded_solver=study.scene.graded_solver
    )
    return jnp.abs(modulus)


def total_thickness(stack: Stack) -> Float[Array, ""]:
    return sum((layer.thickness for layer in stack.layers), start=jnp.zeros(()))


def silent(text: str, done: int, total: int) -> None:
    """Says nothing of the progress."""


def heights_of(study: DesignScene, index: int) -> Float[Array, "nx ny"]:
    """Heights of one of the surfaces for verification, or after these of one for polishing."""
    source = study.scene.surface
    assert isinstance(source, RandomSurface)
    key = jax.random.split(jax.random.key(source.seed), 2 * study.verify)[index]
    return random_surface(source.spectrum, source.grid, key, amplitudes=source.amplitudes).heights


def kept_contact(
    study: DesignScene, stack: Stack, heights: Array, store: Store | None
) -> tuple[np.ndarray, np.ndarray]:
    """Friction and area of a stack on a surface, from the store or for it."""
    scene = study.scene
    parts = (
        stack,
        heights,
        scene.pressure,
        scene.velocity,
        scene.solver,
        scene.tolerance,
        scene.graded_solver,
    )
    assert isinstance(scene.surface, RandomSurface)
    name = fingerprint(package_versions(), "friction and area", scene.surface.grid, *parts)
    kept = None if store is None else store.read(name)
    if kept is None:
        friction, area = map(np.asarray, _contact(study, stack, heights))
        kept = Point({"friction": friction, "contact_area": area}, "", {})
        if store is not None:
            store.write(name, kept)
    return kept.values["friction"], kept.values["contact_area"]


@eqx.filter_jit
def _contact(study: DesignScene, stack: Stack, heights: Array) -> tuple[Array, Array]:
    """Friction and sub-pixel area by contact, at each velocity."""
    scene = study.scene
    assert isinstance(scene.surface, RandomSurface)
    grid: Grid = scene.surface.grid

    def one(velocity: Array) -> tuple[Array, Array]:
        found = slide(
            stack,
            Surface(heights, grid),
            pressure=scene.pressure[0],
            velocity=velocity,
            solver=scene.solver,
            **scene.tolerance,
            graded_solver=scene.graded_solver,
        )
        return found.friction, found.contact_area_smooth

    return jax.lax.map(one, jnp.asarray(scene.velocity))
