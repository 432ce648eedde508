"""Objectives and constraints for a coating, as functions of a stack.

They use the response and the mean field only, and take milliseconds. Verify and improve their
results by contact solves (`slide`).
"""

import dataclasses

import jax
import jax.numpy as jnp
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
from ..sliding.case import Case
from ..surfaces.spectrum import SelfAffine
from ..surfaces.surface import Surface


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


@check_types
def friction_between(field: MeanField, q_from: ScalarLike, q_to: ScalarLike) -> Float[Array, ""]:
    """Returns the friction that roughness between two wavenumbers adds [1].

    Over `field.friction` it is the share of a window, to be made large for a selective response,
    or, with `q_to` the last wavenumber, small for friction that fine roughness cannot change.

    **Arguments:**

    - `field`: of `mean_field_friction`.
    - `q_from`, `q_to`: wavenumbers [rad/m].

    **Returns:** the friction [1].
    """
    curve = field.against_cutoff
    at = jnp.log(jnp.stack([as_float(q_from, "q_from"), as_float(q_to, "q_to")]))
    low, high = jnp.interp(at, jnp.log(curve.cutoff), curve.friction)
    return high - low
