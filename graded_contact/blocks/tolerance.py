"""The interface of the solvers of graded layers, `Layering` and `Riccati`, and their tolerances.

A recursion (`column`) passes a graded layer by the solver of its stack. Each estimates the error of
its result.
"""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from ..core.checks import check_tolerance
from ..core.display import shown

# Rounding: what no refinement removes, and the tightest tolerance worth trying.
_FLOOR, REFUSED_BELOW = 100.0, 400.0


@shown()
class AbstractGradedSolver(eqx.Module):
    """A way to pass the graded layers of a stack.

    **Fields:**

    - `rtol`: relative tolerance; by default 1e-9, in float32 1e-4. Static.
    """

    rtol: eqx.AbstractVar[float | None]

    @abc.abstractmethod
    def solve(
        self, climb: Callable, measure: Callable, stack: Any, q: Array, omega: Array, rtol: float
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


def as_tolerance(rtol: float | None) -> float | None:
    """Returns the field `rtol` of a solver, refused if no dtype can reach it."""
    if rtol is None:
        return None
    check_tolerance("rtol", rtol, np.zeros(0), floor_factor=REFUSED_BELOW)
    return float(rtol)


def rounding(like: Array) -> float:
    """Returns the relative error that no refinement removes, for the dtype of `like`."""
    return _FLOOR * float(jnp.finfo(like.dtype).eps)
