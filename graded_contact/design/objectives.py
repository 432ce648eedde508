"""Functions of a stack for objectives, by its response and the mean field: they take milliseconds.

Verify and improve designs that they lead to by contact solves (`slide`).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..blocks.stack import Stack
from ..core.checks import Numbers, as_float, check_rows, check_values, positive
from ..mean_field.mean_field import MeanField, mean_field_friction
from ..response.compliance import effective_modulus
from ..surfaces.spectrum_table import Spectrum


def loss_tangent(stack: Stack, q: Numbers, velocity: Numbers) -> Float[Array, "..."]:
    """Returns the loss tangent of the whole stack under waves that slide along q.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers [rad/m], positive.
    - `velocity`: v [m/s], positive.

    **Returns:** Im E_eff/Re E_eff at ω = q v [1], shape of `q` and `velocity` together.
    """
    q, velocity = as_float(q, "q"), positive("velocity", "[m/s]", as_float)(velocity)
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
    return jnp.var(jnp.log(positive("values", "", as_float)(values)))


def distance(values: Numbers, target: Numbers) -> Float[Array, ""]:
    """Returns the mean square of |ln(values/target)| [1], also of complex values.

    **Arguments:**

    - `values`, `target`: of the same unit and shapes that broadcast: moduli, friction at given
      speeds, ...

    **Returns:** the mean square [1].
    """
    logs: Inexact[Array, ...] = jnp.log(jnp.asarray(values) / jnp.asarray(target))
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

    **Returns:** a `MeanField` with the velocities on the first axis of its arrays.
    """

    def at(velocity: Float[Array, ""]) -> MeanField:
        return mean_field_friction(
            stack, spectrum, pressure=pressure, velocity=velocity, strain_per_slope=strain_per_slope
        )

    speeds = as_float(velocities, "velocities")
    check_rows(1, velocities=speeds)
    check_values("velocities", speeds, "velocities are finite")
    for name, number in (("pressure", pressure), ("strain_per_slope", strain_per_slope)):
        if number is not None:
            positive(name, "")(number)
    # Not `vmap`: the data of one velocity stay in the cache.
    return jax.lax.map(at, speeds)
