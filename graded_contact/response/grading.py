"""What a solver of graded layers is, and the recursion for M_zz that calls it.

There are two, `Layering` and `Riccati`. Both estimate the error of what is found; a tolerance that
is not met is an error.
"""

import abc
from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Inexact

from ..core.checks import check_tolerance
from ..rheology.measured import check_frequencies
from .column import AddGraded, Carried, Rule, climb_through, column_of
from .profile_check import check_profile
from .slab import (
    Compliance,
    factors,
    free,
    half_space,
    in_units,
    reciprocal,
    stack_on,
    times,
)
from .stack import Free, GradedLayer, Rigid, Stack

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
        self,
        climb: Callable[[AddGraded], tuple[Array, ...]],
        measure: Callable[[Sequence[Array], Sequence[Array]], Float[Array, "*w"]],
        stack: Stack,
        q: Float[Array, "..."],
        omega: Float[Array, "..."],
        rtol: float,
    ) -> tuple[tuple[Array, ...], Float[Array, "*w"]]:
        """Returns the values that `climb` finds, and their estimated error.

        **Arguments:**

        - `climb`: a recursion through the stack, given what adds a graded layer to it. It may find
          values with more axes in front.
        - `measure`: the error [1] that `differences` of these `values` are.
        - `stack`, `q`, `omega`: what it climbs through; wavenumbers [rad/m] and frequencies [rad/s]
          of equal rank.
        - `rtol`: the error to aim at.
        """


def check_profiles(stack: Stack, omega: Float[Array, "..."]) -> None:
    """Raises `ValueError` for frequencies that a table refuses, or a profile that is not usable.

    Of a profile it names the layer and the height.
    """
    check_frequencies(stack, omega)
    for i, layer in enumerate(stack.layers):
        if isinstance(layer, GradedLayer):
            check_profile(f"layers[{i}].profile", layer.profile, omega)


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


def solve_graded(
    graded_solver: AbstractGradedSolver,
    climb: Callable[[AddGraded], tuple[Array, ...]],
    measure: Callable[[Sequence[Array], Sequence[Array]], Float[Array, "*w"]],
    stack: Stack,
    q: Float[Array, "..."],
    omega: Float[Array, "..."],
    rtol: float,
    throw: bool,
) -> tuple[tuple[Array, ...], Float[Array, "*w"]]:
    """Returns what `graded_solver` finds, see there, and its error, which may be one to raise."""
    values, error = graded_solver.solve(climb, measure, stack, q, omega, rtol)
    error = jax.lax.stop_gradient(error)
    if throw:
        # Written so that NaN fails.
        values = eqx.error_if(values, jnp.any(~(error <= rtol)), _NOT_REACHED)
    return values, error


class Face(NamedTuple):
    """In-plane compliance of a face in units of 2/(E_r q), and that E_r."""

    state: Compliance
    reduced: Inexact[Array, "..."]


def surface_climb(
    stack: Stack, q: Float[Array, "..."], omega: Float[Array, "..."]
) -> Callable[[AddGraded], tuple[Array]]:
    """Returns the recursion that finds M_zz [m/Pa]."""
    column = column_of(stack, q, omega)
    face = None
    if isinstance(column.base, Rigid):
        nothing = jnp.zeros_like(q)
        face = Face(Compliance(nothing, nothing, nothing, nothing), jnp.ones_like(q))
    elif not isinstance(column.base, Free):
        face = _half_space(*column.base)

    def climb(add_graded):
        top = climb_through(column, face, _RULE, add_graded)
        return (top.state.c22 * (2 / column.unit) / (top.reduced * q),)

    return climb


def relative(differences: Sequence[Array], values: Sequence[Array]) -> Float[Array, "*w"]:
    """Returns the relative error of one value."""
    return jnp.abs(differences[0]) / jnp.abs(values[0])


def _add(
    face: Face | None, x: Array, reduced: Array, e: Array, lowest: Bool[Array, "..."] | None = None
) -> Face:
    if face is None:
        return Face(free(x, e), reduced)
    ratio = times(reciprocal(face.reduced), reduced)
    state = stack_on(face.state, factors(x, e), ratio)
    if lowest is not None:
        hanging = free(jnp.where(lowest, x, 1), e)
        state = jax.tree.map(lambda a, b: jnp.where(lowest, a, b), hanging, state)
    return Face(state, reduced)


def _half_space(reduced: Array, e: Array) -> Face:
    return Face(half_space(e), reduced)


def _numbers(face: Face, reference: Array, inverse: bool) -> Carried:
    state = in_units(face.state, reference / face.reduced)
    return Carried(invert(state) if inverse else state)


def _face(numbers: Carried, reference: Array, inverse: bool, _: Array) -> Face:
    return Face(invert(numbers.plane) if inverse else numbers.plane, reference)


_RULE = Rule(_add, _half_space, _numbers, _face)


def invert(c: Compliance) -> Compliance:
    """Returns the inverse of a symmetric 2×2 matrix that carries its determinant."""
    return Compliance(c.c22 / c.det, -c.c12 / c.det, c.c11 / c.det, 1 / c.det)
