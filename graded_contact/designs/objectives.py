"""Objectives: those of the table [design], and functions of a stack for any search.

The functions use the response and the mean field only, and take milliseconds. Verify and improve
their results by contact solves (`slide`).
"""

import dataclasses
from collections.abc import Callable
from typing import Annotated, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..blocks.stack import Stack
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_together,
    check_values,
)
from ..core.compilation import compiled
from ..core.display import shown
from ..mean_field.mean_field import RTOL, MeanField, mean_field_of, reached
from ..mean_field.refinement import NODES, Nodes, misses, solve_refined
from ..response.compliance import effective_modulus
from ..scenes.scene import Scene
from ..scenes.scene_checks import refuse_tables
from ..scenes.schema import Key
from ..sliding.case import Case
from ..surfaces.spectrum_table import Spectrum
from .limits import CRITERIA, Criteria

WAVES = 65  # in the band of a flat loss tangent


def loss_tangent(
    stack: Stack,
    q: Numbers,
    velocity: Numbers,
) -> Float[Array, "..."]:
    """Returns Im E_eff/Re E_eff [1] of the whole stack at `q` [rad/m] for sliding along q.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers [rad/m], positive.
    - `velocity`: [m/s], positive.

    **Returns:** Im E_eff/Re E_eff [1], shape of `q` and `velocity` together.
    """
    q, velocity = as_float(q, "q"), as_float(velocity, "velocity")
    check_positive("velocity", velocity, "[m/s]")
    check_together(q=q, velocity=velocity)
    modulus = effective_modulus(stack, q, q * velocity)
    return modulus.imag / modulus.real


def ripple(values: Numbers) -> Float[Array, ""]:
    """Returns the variance of the logarithm of positive values [1]: 0 where they are flat.

    `ripple(loss_tangent(stack, q, velocity))` over a band of q is small if the band is damped
    evenly; `jnp.max(...)/jnp.min(...)` is easier to read, but has kinks.

    **Arguments:**

    - `values`: positive, any shape.

    **Returns:** the variance [1].
    """
    values = as_float(values, "values")
    check_positive("values", values, "")
    return jnp.var(jnp.log(values))


def distance(values: Numbers, target: Numbers) -> Float[Array, ""]:
    """Returns the mean square of |ln(values/target)| [1], also of complex values.

    For target curves: of `effective_modulus(stack, q, omega)`, of friction at given speeds, ...

    **Arguments:**

    - `values`, `target`: of the same unit, real or complex, of shapes that broadcast.

    **Returns:** the mean square [1].
    """
    values, target = jnp.asarray(values), jnp.asarray(target)
    logs: Inexact[Array, ...] = jnp.log(values / target)
    return jnp.mean(jnp.real(logs * jnp.conj(logs)))


def friction_curve(
    stack: Stack,
    spectrum: Spectrum,
    *,
    pressure: ScalarLike,
    velocities: Numbers,
    strain_per_slope: ScalarLike | None = None,
) -> MeanField:
    """Returns the mean field at each velocity, along a first axis of every array of it.

    **Arguments:**

    - `stack`, `spectrum`, `pressure`, `strain_per_slope`: as in `mean_field_friction`.
    - `velocities`: along x [m/s], shape `(n,)`.

    **Returns:** a `MeanField` whose arrays have the velocities as their first axis.
    """
    velocities = as_float(velocities, "velocities")
    if velocities.ndim != 1:
        raise ValueError(f"`velocities` has shape {velocities.shape}; one axis is needed.")
    check_values("velocities", velocities, "velocities [m/s] must be finite")
    pressure = as_scalar(pressure, "pressure")
    check_positive("pressure", pressure, "[Pa]")
    case = Case(stack, spectrum, velocity=0.0, pressure=pressure, strain_per_slope=strain_per_slope)
    return reached(refined_curve(case, velocities)[0])


def refined_curve(
    case: Case, velocities: Float[Array, " n"], nodes: Nodes = NODES
) -> tuple[MeanField, Nodes]:
    """Returns the mean field of a case at velocities along x, as `friction_curve`, and the nodes of
    its quadrature, of which it begins with `nodes`. It may miss its tolerance."""

    def solve(nodes: Nodes) -> tuple[MeanField, Array]:
        fields = _fields_at(case, velocities, nodes)
        return fields, misses(fields.error, RTOL)

    return solve_refined(solve, nodes)


@compiled
def _fields_at(case: Case, velocities: Float[Array, " n"], nodes: Nodes) -> MeanField:
    def at(velocity: Array) -> MeanField:
        moving = dataclasses.replace(case, velocity=velocity)
        return mean_field_of(moving, throw=False, **nodes._asdict())

    # Not `vmap`: the data of one velocity stay in the cache.
    return jax.lax.map(at, velocities)


@shown("name", "asked", "band", unset=False)
class DesignObjective(NamedTuple):
    """What a search makes small.

    **Fields:**

    - `name`: the key `objective` of [design].
    - `value`: gives it from a block, its criteria and, if `relative`, those of the scene's block.
    - `criteria`: names of those that it needs.
    - `goal`: friction [1] at each velocity, or if `relative` over that of the scene's block.
    - `band`: wavenumbers [rad/m] between which the loss tangent is to be flat.
    """

    name: str
    value: Callable[[Stack, Criteria, Criteria], Float[Array, ""]]
    criteria: tuple[str, ...] = ("friction",)
    goal: Float[np.ndarray, " velocities"] | None = None
    relative: bool = False
    band: tuple[float, float] | None = None

    @property
    def asked(self) -> str:
        """The goal in words, at each velocity if they differ."""
        if self.goal is None:
            return ""
        goals = ", ".join(dict.fromkeys(f"{goal:g}" for goal in self.goal))
        return f"{goals} times that of the scene's block" if self.relative else goals


def extreme(name: str, scene: Scene) -> DesignObjective:
    """Returns the objective of a large or small criterion, or ratio of friction."""
    way, _, criterion = name.partition("_")
    sign, count = -1 if way == "maximise" else 1, len(scene.velocity)

    def mean(stack, found, before):
        # The geometric mean: a velocity with little friction counts as much as one with much.
        return sign * jnp.exp(jnp.mean(jnp.log(found[criterion])))

    if criterion in CRITERIA:
        return DesignObjective(name, mean, (criterion,))
    if count != 2:
        raise ValueError(f'the objective "{name}" needs two velocities in [load], not {count}.')
    return DesignObjective(
        name, lambda stack, found, before: sign * found["friction"][0] / found["friction"][1]
    )


def near_goal(
    name: str, scene: Scene, target: list[float] | None = None, ratio: list[float] | None = None
) -> DesignObjective:
    """Returns the objective of friction near a goal; other arguments are keys of [design].

    **Arguments:**

    - `target`: friction [1], one number or one for each velocity.
    - `ratio`: instead of `target`, to the friction of the scene's own block [1].
    """
    if (target is None) == (ratio is None):
        both = "has `target` and `ratio`" if target else "lacks `target` or `ratio`"
        raise ValueError(f'the objective "{name}" {both}: give one of them.')
    key, count = "target" if ratio is None else "ratio", len(scene.velocity)
    given = np.array(target or ratio)
    if len(given) not in (1, count):
        raise ValueError(
            f"`{key}` has {len(given)} numbers; one, or one for each of the {count} velocities, is "
            "needed."
        )
    check_positive(key, given, "[1]")
    goal = np.broadcast_to(given, count)

    def value(stack, found, before):
        wanted = goal * (1 if ratio is None else as_float(before["friction"]))
        # 1 where it is reached: a value whose relative changes mean something.
        return jnp.exp(distance(found["friction"], wanted))

    return DesignObjective(name, value, goal=goal, relative=ratio is not None)


def flat_loss_tangent(name: str, scene: Scene, q_from: float, q_to: float) -> DesignObjective:
    """Returns the objective of a loss tangent that is flat over a band, at each velocity.

    **Arguments:**

    - `q_from`, `q_to`: wavenumbers between which it is flat [rad/m].
    """
    if not 0 < q_from < q_to < np.inf:
        ends = f"`q_from` = {q_from}, `q_to` = {q_to}"
        raise ValueError(f"{ends} must be positive [rad/m] and in this order.")
    refuse_tables(scene, f'the objective "{name}"', "motion")
    if scene.strain_per_slope is not None:
        raise ValueError(
            f'the objective "{name}" does not take the key `strain_per_slope` of [load]: a loss '
            "tangent is that of the materials' own amplitudes."
        )
    band, velocities = (q_from, q_to), scene.velocity

    def value(stack, found, before):
        return jnp.mean(jnp.stack([ripple(t) for t in band_tangents(stack, band, velocities)]))

    return DesignObjective(name, value, criteria=(), band=band)


def band_tangents(
    stack: Stack, band: tuple[float, float], velocities: np.ndarray
) -> list[Float[Array, " waves"]]:
    """Returns the loss tangent [1] over a band of wavenumbers, at each velocity."""
    q = np.geomspace(*band, WAVES)
    return [loss_tangent(stack, q, v) for v in velocities]


OBJECTIVES: dict[str, Callable[..., DesignObjective]] = {
    f"{way}_{name}": extreme
    for name in (*CRITERIA, "friction_ratio")
    for way in ("maximise", "minimise")
}
OBJECTIVES |= {"friction": near_goal, "flat_loss_tangent": flat_loss_tangent}
OBJECTIVE = Key("objective", Annotated[str, *OBJECTIVES])
