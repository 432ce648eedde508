"""Designs of scenes, run: the mean field decides, contact polishes and verifies.

mean_field_problem ─ minimise ─> designed ─┐
contacts, gradients ─ minimise ─> polished ┼─> contact on unseen surfaces ─> report, missed
                                 before ───┘
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..blocks.compliance import effective_modulus
from ..blocks.stack import Stack
from ..core.checks import Numbers, as_float, within
from ..core.display import shown
from ..core.memory import DERIVATIVE, check_memory
from ..core.parameters import paths, with_values
from ..mean_field.mean_field import MeanField
from ..studies.dataset import NOT_STARTED
from ..studies.objectives import distance, friction_curve, loss_tangent, ripple
from ..studies.search import Constraints, Design, Objective, minimise
from ..studies.store import Store
from ..studies.sweep import sweep
from ..surfaces.surface import Surface
from .design_scene import DesignScene
from .run_scene import scene_fields
from .scene import refuse_liquids
from .surface_source import RandomSurface
from .theory import refuse_extrapolated

WAVES = 65  # in the band of a flat loss tangent
POLISHING_STEPS = 6
POLISHING = 10  # approximate number of evaluations

Progress = Callable[[str, int, int], None]
Parameters = dict[str, Float[Array, "..."]]


@shown()
class Candidate(NamedTuple):
    """A block, its mean field and its contacts.

    **Fields:**

    - `stack`: the block.
    - `field`: the mean field at each velocity.
    - `friction`, `contact_area`: by contact [1], shape (surfaces, velocities); without verification
      there are no surfaces.
    """

    stack: Stack
    field: MeanField
    friction: Float[np.ndarray, "surfaces velocities"]
    contact_area: Float[np.ndarray, "surfaces velocities"]


@shown("design", "polished", "candidates")
class DesignResults(NamedTuple):
    """The design of a scene, and the contacts that verify it.

    **Fields:**

    - `study`: the scene and its table [design].
    - `design`: by the mean field.
    - `polished`: by the contact solver, or None.
    - `candidates`: "before", "designed" and, if polished, "polished".
    """

    study: DesignScene
    design: Design
    polished: Design | None
    candidates: dict[str, Candidate]


def run_design(
    study: DesignScene, *, store: Store | None = None, progress: Progress | None = None
) -> DesignResults:
    """Returns the design of a scene, and the contacts that verify it.

    **Arguments:**

    - `study`: what to design.
    - `store`: stores every evaluation and every contact at once. The same study continues from
      there; another study uses the entries that both have in common.
    - `progress`: called with the current step, the number done and the total, after every
      evaluation and solve. An exception in it ends the design.

    **Raises:** `ValueError` for bounds and limits that nothing satisfies, a start outside the
    bounds, or a block with friction from frequencies at which its materials were not measured (more
    than 1 %, by mean field, unless [load] has `extrapolate = true`); `RuntimeError` if a contact or
    the mean field is not solved to its tolerance.
    """
    check_design(study)
    own, say = study.scene.stack, progress or (lambda *_: None)
    objective, constraints = mean_field_problem(study)
    with within("[design]"):
        design = minimise(
            objective, study.lower, study.upper, {path: paths(own)[path] for path in study.lower},
            constraints=constraints, num_starts=study.starts, seed=study.seed, store=store,
            progress=lambda i, value: say(f"design, value {value:.4g}", i, study.starts),
        )  # fmt: skip
    say("design", study.starts, study.starts)
    stacks = {"before": own, "designed": with_values(own, design.parameters)}
    polished = None
    if study.polish:
        polished = _polish(study, design, store, say)
        stacks["polished"] = with_values(own, polished.parameters)
    candidates = {}
    for name, stack in stacks.items():
        field = design_mean_field(study, stack)
        solved = _contacts(study, stack, 0, store, partial(say, f"contact, {name}"))
        candidates[name] = Candidate(stack, field, *solved)
    return DesignResults(study, design, polished, candidates)


def check_design(study: DesignScene) -> None:
    """Raises `ValueError` for what `run_design` refuses before its first evaluation.

    These are contacts that need more memory than is free, friction from frequencies at which the
    block's materials were not measured, and a liquid under waves at rest.
    """
    source, own = study.scene.surface, study.scene.stack
    if study.verify and isinstance(source, RandomSurface):
        with within("[grid]"):
            check_memory("shape", "this design", design_fields(study), source.grid.shape)
    rough = study.spectrum if isinstance(study.spectrum, Surface) else source
    assert isinstance(rough, Surface | RandomSurface)
    # The mean field of a spectrum has no waves at rest; contacts and a surface's modes have.
    on_grid = study.verify or isinstance(rough, Surface)
    stiffness_at_rest = study.stiffness is not None and study.stiffness.omega == 0
    if (on_grid and rough.grid.ndim == 2) or stiffness_at_rest:
        refuse_liquids(study.scene)
    refuse_extrapolated(
        study.scene, own, rough.grid, lambda: design_mean_field(study, own).extrapolated_friction
    )


def design_fields(study: DesignScene) -> float:
    """Returns how many fields of the size of its surface the contacts of a study take."""
    fields = 2 * study.verify + DERIVATIVE if study.polish else 1
    return fields + scene_fields(dataclasses.replace(study.scene, fields="none"))


def mean_field_problem(study: DesignScene) -> tuple[Objective, Constraints | None]:
    """Returns the objective and the constraints of a design, as functions of parameters.

    Both are for `minimise`, or any other search: they take a dict of numbers by path.
    """
    stack, constraints = study.scene.stack, _constraints(study)
    if study.band is not None:

        def flatness(values: Parameters) -> Float[Array, ""]:
            tangents = band_tangents(study, with_values(stack, values))
            return jnp.mean(jnp.stack([ripple(tangent) for tangent in tangents]))

        return flatness, constraints
    before = design_mean_field(study, stack).friction

    def objective(values: Parameters) -> Float[Array, ""]:
        changed = with_values(stack, values)
        return _objective(study, design_mean_field(study, changed).friction, before)

    return objective, constraints


def _polish(study: DesignScene, design: Design, store: Store | None, say: Progress) -> Design:
    """A few steps from the design, by the contact solver's gradients on surfaces of their own."""
    stack, count, done = study.scene.stack, study.verify, 0
    # Other surfaces than those of the verification, which the search must not have seen.
    heights = jnp.stack([_heights(study, count + i) for i in range(count)])
    friction, _ = _contacts(study, stack, count, store, partial(say, "polish, before"))
    before, velocities = np.mean(friction, axis=0), jnp.asarray(study.scene.velocity)

    def objective(values: Parameters) -> Float[Array, ""]:
        changed = with_values(stack, values)

        def on(rough: Array) -> Array:
            return jax.lax.map(lambda v: _contact(study, changed, rough, v)[0], velocities)

        return _objective(study, jnp.mean(jax.lax.map(on, heights), axis=0), before)

    def after_evaluation(_: int, value: float) -> None:
        nonlocal done
        done += 1
        say(f"polish, value {value:.4g}", min(done, POLISHING), POLISHING)

    say("polish", 0, POLISHING)
    polished = minimise(
        objective, study.lower, study.upper, design.parameters,
        constraints=_constraints(study), num_starts=1, max_steps=POLISHING_STEPS, store=store,
        progress=after_evaluation,
    )  # fmt: skip
    say("polish", POLISHING, POLISHING)
    return polished


@eqx.filter_jit
def design_mean_field(
    study: DesignScene, stack: Stack, velocities: Numbers | None = None
) -> MeanField:
    """Returns the mean field of a stack at the velocities of the study, or at others [m/s]."""
    scene = study.scene
    return friction_curve(
        stack, study.spectrum, pressure=scene.pressure[0],
        velocities=scene.velocity if velocities is None else velocities,
        graded_solver=scene.graded_solver, strain_per_slope=scene.strain_per_slope,
    )  # fmt: skip


def _objective(study: DesignScene, friction: Array, before: Numbers) -> Float[Array, ""]:
    """The objective, from the friction at each velocity and the friction before."""
    if study.goal is not None:
        goal = study.goal * (as_float(before) if study.relative else 1)
        # 1 where it is reached: a value whose relative changes mean something.
        return jnp.exp(distance(friction, goal))
    # The geometric mean: a velocity with little friction counts as much as one with much.
    mean = jnp.exp(jnp.mean(jnp.log(friction)))
    return mean if study.objective == "minimise_friction" else -mean


def _constraints(study: DesignScene) -> Constraints | None:
    own, stiffness, limit = study.scene.stack, study.stiffness, study.total_thickness
    if stiffness is None and limit is None:
        return None

    def constraints(values: Parameters) -> Float[Array, " limits"]:
        stack, parts = with_values(own, values), []
        if stiffness is not None:
            # Two one-sided limits, relative as `minimise` wants them.
            change = limited_modulus(study, stack) / limited_modulus(study, own) - 1
            parts += [stiffness.within - change, stiffness.within + change]
        if limit is not None:
            parts.append(1 - total_thickness(stack) / limit)
        return jnp.stack(parts)

    return constraints


def band_tangents(study: DesignScene, stack: Stack) -> list[Float[Array, " waves"]]:
    """The loss tangent over the band, at each velocity."""
    assert study.band is not None
    q, solver = np.geomspace(*study.band, WAVES), study.scene.graded_solver
    return [loss_tangent(stack, q, v, graded_solver=solver) for v in study.scene.velocity]


def limited_modulus(study: DesignScene, stack: Stack) -> Float[Array, ""]:
    """|effective_modulus| at the wave whose stiffness is limited."""
    wave, solver = study.stiffness, study.scene.graded_solver
    assert wave is not None
    return jnp.abs(effective_modulus(stack, wave.q, wave.omega, graded_solver=solver))


def total_thickness(stack: Stack) -> Float[Array, ""]:
    return sum((layer.thickness for layer in stack.layers), start=jnp.zeros(()))


def _heights(study: DesignScene, index: Any) -> Float[Array, "nx ny"]:
    """Heights of one of the surfaces for verification, or after these of one for polishing."""
    source = study.scene.surface
    assert isinstance(source, RandomSurface)
    return source.of_key(
        jax.random.split(jax.random.key(source.seed), 2 * study.verify)[index]
    ).heights


def _contacts(
    study: DesignScene, stack: Stack, first: int, store: Store | None, say: Callable
) -> Float[np.ndarray, "2 surfaces velocities"]:
    """Friction and area of a stack on `verify` surfaces, from the store or for it."""
    names, velocity = ("friction", "contact_area"), study.scene.velocity
    if not study.verify:
        return np.zeros((2, 0, len(velocity)))

    def solved(point: dict[str, Any]) -> dict[str, Array]:
        found = _contact(study, stack, _heights(study, point["surface"]), point["velocity"])
        return dict(zip(names, found, strict=True))

    axes = {"surface": first + np.arange(study.verify), "velocity": velocity}
    found = sweep(solved, axes, store=store, progress=say)
    ends = found["message"].values
    if np.any(ends == NOT_STARTED):  # `sweep` returns what it has after an interruption
        raise KeyboardInterrupt
    if np.any(ends != ""):
        raise RuntimeError(ends[ends != ""][0])
    return np.stack([found[name].values for name in names])


def _contact(
    study: DesignScene, stack: Stack, heights: Array, velocity: Any
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Friction and sub-pixel area by contact."""
    scene = study.scene
    assert isinstance(scene.surface, RandomSurface)
    bare = dataclasses.replace(scene, stack=stack, sweep={}, temperature=None, direction=0.0)
    point = {"pressure": scene.pressure[0], "velocity": velocity}
    case = bare.case(point, Surface(heights, scene.surface.grid))
    found = case.solve(dataclasses.replace(scene.numerics, throw=True))
    return found.friction, found.contact_area
