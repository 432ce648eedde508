"""Objectives: those of the table [design], and functions of a stack for any search.

The functions use the response and the mean field only, and take milliseconds. Verify and improve
their results by contact solves (`slide`).
"""

import abc
import dataclasses
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..blocks.compliance import effective_modulus
from ..blocks.stack import Stack
from ..core.checks import (
    Numbers,
    as_float,
    as_scalar,
    check_positive,
    check_together,
    check_types,
    check_values,
)
from ..mean_field.mean_field import MeanField, mean_field_of
from ..scenes.scene import Scene, refuse_tables
from ..scenes.schema import Key
from ..sliding.case import Case
from ..surfaces.spectrum import SelfAffine
from ..surfaces.surface import Surface
from .limits import CRITERIA, Found

WAVES = 65  # in the band of a flat loss tangent


@check_types
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


@check_types
def friction_curve(
    stack: Stack,
    spectrum: SelfAffine | Surface | tuple[Numbers, Numbers],
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
    check_positive("pressure", as_scalar(pressure, "pressure"), "[Pa]")
    case = Case(stack, spectrum, velocity=0.0, pressure=pressure, strain_per_slope=strain_per_slope)
    # Not `vmap`: the data of one velocity stay in the cache.
    return jax.lax.map(lambda v: mean_field_of(dataclasses.replace(case, velocity=v)), velocities)


@dataclasses.dataclass(frozen=True, eq=False)
class AbstractObjective(abc.ABC):
    """What a search makes small, in a scene. Other fields are keys of [design].

    **Fields:**

    - `name`: the key `objective` of [design].
    - `scene`: its velocities are those of the design.
    """

    name: str
    scene: Scene = dataclasses.field(repr=False)

    criteria = ("friction",)  # that it needs
    goal = None  # friction at each velocity, or if `relative`, over that of the scene's block
    relative = False
    band = ()  # wavenumbers [rad/m] between which a loss tangent is flat

    @abc.abstractmethod
    def value(self, stack: Stack, found: Found, before: Found) -> Float[Array, ""]:
        """Returns a number of a block that is small if the block is good.

        **Arguments:**

        - `stack`: the block.
        - `found`: its criteria.
        - `before`: criteria of the scene's block, if the objective is `relative`.
        """


@dataclasses.dataclass(frozen=True, eq=False)
class Extreme(AbstractObjective):
    """A criterion that is made large or small: its geometric mean over the velocities.

    A friction ratio is the friction at the first of two velocities over that at the second.
    """

    def __post_init__(self):
        count = len(self.scene.velocity)
        if self.is_ratio and count != 2:
            raise ValueError(
                f'the objective "{self.name}" needs two velocities in [load], not {count}.'
            )

    @property
    def is_ratio(self) -> bool:
        """Whether it is the ratio of friction at two velocities."""
        return self.name.endswith("friction_ratio")

    @property
    def criteria(self):
        return ("friction",) if self.is_ratio else (self.name.partition("_")[2],)

    def value(self, stack, found, before):
        values = found[self.criteria[0]]
        # The geometric mean: a velocity with little friction counts as much as one with much.
        mean = values[0] / values[1] if self.is_ratio else jnp.exp(jnp.mean(jnp.log(values)))
        return -mean if self.name.startswith("maximise") else mean


@dataclasses.dataclass(frozen=True, eq=False)
class Friction(AbstractObjective):
    """Friction near a goal at each velocity.

    **Fields:**

    - `target`: friction [1], one number or one for each velocity.
    - `ratio`: instead of `target`, to the friction of the scene's own block [1].
    """

    target: list[float] | None = None
    ratio: list[float] | None = None

    def __post_init__(self):
        if (self.target is None) == (self.ratio is None):
            both = "has `target` and `ratio`" if self.target else "lacks `target` or `ratio`"
            raise ValueError(f'the objective "friction" {both}: give one of them.')
        key, count = "ratio" if self.relative else "target", len(self.scene.velocity)
        goal = np.array(getattr(self, key))
        if len(goal) not in (1, count):
            raise ValueError(
                f"`{key}` has {len(goal)} numbers; one, or one for each of the {count} "
                "velocities, is needed."
            )
        check_positive(key, goal, "[1]")

    @property
    def relative(self):
        return self.ratio is not None

    @property
    def goal(self):
        return np.broadcast_to(self.target or self.ratio, len(self.scene.velocity))

    def value(self, stack, found, before):
        goal = self.goal * (as_float(before["friction"]) if self.relative else 1)
        # 1 where it is reached: a value whose relative changes mean something.
        return jnp.exp(distance(found["friction"], goal))


@dataclasses.dataclass(frozen=True, eq=False)
class FlatLossTangent(AbstractObjective):
    """A loss tangent that is flat over a band of wavenumbers, at each velocity.

    **Fields:**

    - `q_from`, `q_to`: wavenumbers between which it is flat [rad/m].
    """

    q_from: float
    q_to: float

    criteria = ()

    def __post_init__(self):
        if not 0 < self.q_from < self.q_to < np.inf:
            raise ValueError(
                f"`q_from` = {self.q_from}, `q_to` = {self.q_to} must be positive [rad/m] and in "
                "this order."
            )
        refuse_tables(self.scene, f'the objective "{self.name}"', "motion")
        if self.scene.strain_per_slope is not None:
            raise ValueError(
                f'the objective "{self.name}" does not take the key `strain_per_slope` of [load]: '
                "a loss tangent is that of the materials' own amplitudes."
            )

    @property
    def band(self):
        return self.q_from, self.q_to

    def tangents(self, stack: Stack) -> list[Float[Array, " waves"]]:
        """Returns the loss tangent over the band, at each velocity."""
        q = np.geomspace(*self.band, WAVES)
        return [loss_tangent(stack, q, v) for v in self.scene.velocity]

    def value(self, stack, found, before):
        return jnp.mean(jnp.stack([ripple(tangent) for tangent in self.tangents(stack)]))


OBJECTIVES: dict[str, type[AbstractObjective]] = {
    f"{way}_{name}": Extreme
    for name in (*CRITERIA, "friction_ratio")
    for way in ("maximise", "minimise")
}
OBJECTIVES |= {"friction": Friction, "flat_loss_tangent": FlatLossTangent}
OBJECTIVE = Key("objective", Annotated[str, *OBJECTIVES])
