"""The frequency ω = −q·v that each wave of a sliding surface has at a fixed point of the solid.

The field is exp(i(q·x + ωt)), and the surface h(x - vt) moves with +v. This is the only place where
the sign of ω is decided.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from ..core.checks import Numbers, as_float, check_values, is_concrete
from ..core.compilation import compiled
from .grid import Grid, odd_wavevector


def as_velocity(velocity: Numbers, grid: Grid | None = None) -> Float[Array, "..."]:
    """Returns a velocity along x, a number, or with two components as an array [m/s].

    **Raises:** `ValueError` unless it is finite and of a shape that suits the grid, if any.
    """
    velocity = as_float(velocity, "velocity")
    one = grid is not None and grid.ndim == 1
    if velocity.shape not in ((), (2,)) or (one and velocity.ndim):
        raise ValueError(
            f"`velocity` has shape {velocity.shape}; a number (along x) or, on a grid in two "
            "dimensions, two components are needed. For several velocities use `jax.vmap`."
        )
    check_values("velocity", velocity, "a velocity [m/s] must be finite")
    return velocity


def velocity_along(speed: Any, direction: Any) -> Any:
    """Returns a velocity at an angle from the x axis: one number along x, or two components."""
    known = is_concrete(direction)
    if known and direction == 0:  # a number, for which kernels need only a column of frequencies
        return speed
    lib = np if known else jnp
    unit = lib.stack([lib.cos(direction), lib.sin(direction)])
    # Rounding of a right angle would excite frequencies near zero.
    return speed * lib.where(lib.abs(unit) < 1e-12, 0, unit)


@compiled
def direction_and_speed(
    velocity: Float[Array, "..."],
) -> tuple[Float[Array, " components"], Float[Array, ""]]:
    """Returns the unit vector along a velocity, of one component or two, and |v| [m/s].

    At rest it is along x, and so is what a derivative of the speed means there.
    """
    velocity = jnp.atleast_1d(velocity)
    squared = jnp.sum(velocity**2)
    at_rest = squared == 0
    speed = jnp.where(at_rest, velocity[0], jnp.sqrt(jnp.where(at_rest, 1, squared)))
    along_x = jnp.arange(len(velocity)) == 0
    return jnp.where(at_rest, along_x, velocity / jnp.where(at_rest, 1, speed)), speed


def sliding_frequency(
    qx: Float[Array, "..."], qy: Float[Array, "..."] | float, velocity: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Returns ω = -q·v [rad/s] of a surface moving with `velocity`: the one place of this sign.

    `velocity` is v, along x (then ω has the shape of `qx`), or has one or two components. Across
    the velocity rounding leaves some 1e-17 where 0 is meant: another number whenever it is
    computed anew, outside of any table of moduli, and with a sign. There it is 0, with its
    derivative -q.
    """
    if velocity.size == 1:
        return -qx * velocity.reshape(())
    along, across = qx * velocity[0], qy * velocity[1]
    omega = -(along + across)
    rounding = 4 * jnp.finfo(omega.dtype).eps * jnp.abs(along)
    return omega - jax.lax.stop_gradient(jnp.where(jnp.abs(omega) <= rounding, omega, 0))


def wave_frequencies(grid: Grid, velocity: Numbers) -> Float[Array, "..."]:
    """Returns ω = -q·v [rad/s] of the waves of the half spectrum.

    What a component of q adds is 0 on its Nyquist line. `velocity` has one component (along x) or
    two; for one the result has the shape of a column, `(nx, 1)`.
    """
    qx, qy = (*odd_wavevector(grid), jnp.zeros(()))[:2]
    return sliding_frequency(qx, qy, as_float(velocity, "velocity"))
