"""Input checks for waves; error control of graded layers.

An error above the tolerance is raised.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..blocks.profile import check_profile
from ..blocks.stack import GradedLayer, Stack, check_at_rest, is_graded
from ..blocks.tolerance import REFUSED_BELOW, AbstractGradedSolver
from ..core.checks import Numbers, as_float, as_numbers, check_tolerance, check_values, is_concrete
from ..fields.frequency import as_velocity
from ..fields.grid import Grid
from .layering import Layering

NOT_REACHED = (
    "The tolerance was not reached in a graded layer: its profile varies too sharply. Put "
    "boundaries between layers at its jumps and list its kinks in `breaks`, take "
    "`graded_solver=Riccati()`, or give the solver a larger `rtol`."
)


def check_profiles(stack: Stack, omega: Inexact[Array, "..."]) -> None:
    """Raises `ValueError` for a profile that is not usable, naming the layer and the height."""
    for i, layer in enumerate(stack.layers):
        if isinstance(layer, GradedLayer):
            check_profile(f"layers[{i}].profile", layer.profile, omega)


def as_waves(stack: Stack, **arrays: Numbers) -> tuple[Array, ...]:
    """Returns components of wavevectors [rad/m] and, the last, `omega` [rad/s], of equal rank.

    So a modulus is computed once for each entry of `omega`. Refuses what is not finite, does not
    broadcast, or is outside of what the materials and profiles of the stack allow.
    """
    waves = {
        name: (as_numbers if name == "omega" else as_float)(value, name)
        for name, value in arrays.items()
    }
    for name, value in waves.items():
        check_values(name, value, "wavenumbers and frequencies must be finite")
    if is_concrete(waves["omega"]) and np.any(np.asarray(waves["omega"]) == 0):
        check_at_rest(stack)
    check_profiles(stack, waves["omega"])
    rank = len(jnp.broadcast_shapes(*(value.shape for value in waves.values())))
    return tuple(x.reshape((1,) * (rank - x.ndim) + x.shape) for x in waves.values())


def checked_velocity(stack: Stack, grid: Grid, velocity: Numbers) -> Float[Array, "..."]:
    """Returns the velocity as an array, refused where a stack has no response to its waves."""
    velocity = as_velocity(velocity, grid)
    if grid.ndim == 2 or (is_concrete(velocity) and not np.any(np.asarray(velocity))):
        check_at_rest(stack)
    if is_graded(stack):  # waves across the velocity are at rest
        highest = jnp.sqrt(jnp.sum(velocity**2)) * jnp.pi / grid.spacing[0]
        check_profiles(stack, jnp.stack([0 * highest, highest]))
    return velocity


def solver_of(stack: Stack) -> AbstractGradedSolver:
    """Returns the solver of the graded layers of a stack."""
    return Layering() if stack.graded_solver is None else stack.graded_solver


def graded_tolerance(stack: Stack, like: Array) -> float:
    """Returns the tolerance of a stack, refusing what the dtype of `like` cannot reach."""
    rtol = solver_of(stack).rtol
    if rtol is None:
        return 1e-9 if like.dtype == jnp.float64 else 1e-4
    check_tolerance("rtol", rtol, like, floor_factor=REFUSED_BELOW)
    return float(rtol)


def solve_graded(climb, measure, stack, q, omega, rtol, throw):
    """Returns values and error of a recursion through a stack, by the solver of its graded layers.

    With `throw` a larger error than `rtol` raises.
    """
    # Without graded layers the recursion is exact to rounding.
    if not is_graded(stack):
        return climb(None), jnp.zeros_like(q)
    values, error = solver_of(stack).solve(climb, measure, stack, q, omega, rtol)
    # Without a number, as where the steps of `Riccati` do not suffice, the error has no limit.
    error = jax.lax.stop_gradient(jnp.where(jnp.isnan(error), jnp.inf, error))
    if throw:
        values = eqx.error_if(values, jnp.any(error > rtol), NOT_REACHED)
    return values, error
