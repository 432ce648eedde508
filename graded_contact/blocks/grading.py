"""The interface of the solvers of graded layers, their tolerances, and what all waves must pass.

A recursion (`column`) passes a graded layer by an `AbstractGradedSolver`. There are two, `Layering`
and `Riccati`. Both estimate the error of their result; an error above the tolerance is raised.
"""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import (
    Numbers,
    as_float,
    check_together,
    check_tolerance,
    check_values,
    is_concrete,
)
from ..materials.coverage import check_frequencies
from .profile import check_profile
from .stack import GradedLayer, Stack, check_at_rest, is_graded

# Rounding: what no refinement removes, and the tightest tolerance worth trying.
_FLOOR, _REFUSED_BELOW = 100.0, 400.0
_NOT_REACHED = (
    "The tolerance was not reached in a graded layer: its profile varies too sharply. Put "
    "boundaries between layers at its jumps and list its kinks in `breaks`, pass a larger "
    "`rtol`, or read `graded_compliance(..., throw=False).error`."
)


class AbstractGradedSolver(eqx.Module):
    """A way to pass the graded layers of a stack.

    **Fields:**

    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4. Static.
    """

    rtol: eqx.AbstractVar[float | None]

    @abc.abstractmethod
    def solve(
        self, climb: Callable, measure: Callable, stack: Stack, q: Array, omega: Array, rtol: float
    ) -> tuple[tuple[Array, ...], Array]:
        """Returns the values that `climb` finds, and their estimated error.

        **Arguments:**

        - `climb`: a recursion through the stack, given what adds a graded layer to it
          (`column.AddGraded`). It returns a tuple of arrays, with more axes in front if that adds
          some.
        - `measure`: of `differences` and these `values`: the error [1] that the differences are.
        - `stack`, `q`, `omega`: what it climbs through; wavenumbers [rad/m] and frequencies [rad/s]
          of equal rank.
        - `rtol`: the target error.
        """


def check_profiles(stack: Stack, omega: Float[Array, "..."]) -> None:
    """Raises `ValueError` for frequencies that a table refuses, or a profile that is not usable.

    Of a profile it names the layer and the height.
    """
    check_frequencies(stack, omega)
    for i, layer in enumerate(stack.layers):
        if isinstance(layer, GradedLayer):
            check_profile(f"layers[{i}].profile", layer.profile, omega)


def as_waves(stack: Stack, **arrays: Numbers) -> tuple[Array, ...]:
    """Returns components of wavevectors [rad/m] and, the last, `omega` [rad/s], of equal rank.

    So a modulus is computed once for each entry of `omega`. Refuses what is not finite, does not
    broadcast, or is outside of what the materials and profiles of the stack allow.
    """
    waves = {name: as_float(value, name) for name, value in arrays.items()}
    for name, value in waves.items():
        check_values(name, value, "wavenumbers and frequencies must be finite")
    check_together(**waves)
    if is_concrete(waves["omega"]) and np.any(np.asarray(waves["omega"]) == 0):
        check_at_rest(stack)
    check_profiles(stack, waves["omega"])
    rank = max(value.ndim for value in waves.values())
    return tuple(x.reshape((1,) * (rank - x.ndim) + x.shape) for x in waves.values())


def graded_tolerance(graded_solver: AbstractGradedSolver, rtol: float | None, like: Array) -> float:
    """Returns the tolerance to use, refusing what the dtype of `like` cannot reach."""
    rtol = graded_solver.rtol if rtol is None else rtol
    if rtol is None:
        return 1e-9 if like.dtype == jnp.float64 else 1e-4
    check_tolerance("rtol", rtol, like, floor_factor=_REFUSED_BELOW)
    return float(rtol)


def as_tolerance(rtol: float | None) -> float | None:
    """Returns the field `rtol` of a solver, refused if no dtype can reach it."""
    if rtol is None:
        return None
    check_tolerance("rtol", rtol, np.zeros(0), floor_factor=_REFUSED_BELOW)
    return float(rtol)


def rounding(like: Array) -> float:
    """Returns the relative error that no refinement removes, for the dtype of `like`."""
    return _FLOOR * float(jnp.finfo(like.dtype).eps)


def solve_graded(graded_solver, climb, measure, stack, q, omega, rtol, throw=True):
    """Returns values and error of `graded_solver`; with `throw` a larger error than `rtol` raises.

    Of a stack without graded layers the recursion is exact.
    """
    # Then the recursion is exact to rounding.
    if not is_graded(stack):
        return climb(None), jnp.zeros_like(q)
    values, error = graded_solver.solve(climb, measure, stack, q, omega, rtol)
    # Without a number, as where the steps of `Riccati` do not suffice, the error has no limit.
    error = jax.lax.stop_gradient(jnp.where(jnp.isnan(error), jnp.inf, error))
    if throw:
        values = eqx.error_if(values, jnp.any(error > rtol), _NOT_REACHED)
    return values, error
