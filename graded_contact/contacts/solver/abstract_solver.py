"""The interface of contact solvers, and their common parts: units, a penalty, a loop of steps.

`solve_contact` and `slide` accept any `AbstractContactSolver`. The contact that it finds gets its
derivatives afterwards (`adjoint.py`), so a contact solver is never differentiated.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ...core.anderson import sums
from ...core.compilation import varying
from ..law import AbstractLaw
from ..operators.operator import AbstractOperator, Field, Scalar


class Loading(NamedTuple):
    """The loading: a mean pressure [Pa] or a mean gap [m]. The other one is None.

    One number, or of the shape of the operator's means.
    """

    pressure: Float[Array, "..."] | None
    gap: Float[Array, "..."] | None


class Inputs(NamedTuple):
    """The inputs of a contact; pressures and lengths in SI units, or all in others."""

    operator: AbstractOperator
    heights: Field
    law: AbstractLaw
    loading: Loading


class SolverOutput(eqx.Module):
    """The contact that a solver found.

    **Fields:**

    - `pressure`: of the law [Pa], shape of the heights; its mean is the prescribed one, if any.
    - `gap`: at which the law has this pressure [m].
    - `displacement`: of the solid under its pressure, up to a mean [m].
    - `error`: estimated relative error of the pressure (root mean square) [1]. Under a law that
      attracts the result claims at least `law.softness` times as much. All other errors are
      estimated afterwards (`estimates.py`).
    - `ended`: whether the solver stopped by itself: at `rtol`, or where rounding hides the rest.
    - `num_steps`: on the finest grid.
    - `num_fft_pairs`: of all grids, coarse ones counted by their size.
    """

    pressure: Field
    gap: Field
    displacement: Field
    error: Scalar
    ended: Bool[Array, ""]
    num_steps: Array
    num_fft_pairs: Scalar


class AbstractContactSolver(eqx.Module):
    """An algorithm that finds contacts, and its settings.

    **Fields:**

    - `finds_unstable`: whether equilibria may be unstable under laws that attract. If the grid does
      not resolve the attraction, the contact then ends with `RESULTS.unresolved`.
    """

    finds_unstable: ClassVar[bool] = False

    @abstractmethod
    def solve(
        self, operator: AbstractOperator, heights: Field, law: AbstractLaw, loading: Loading,
        *, rtol: Scalar, start: Field | None,
    ) -> SolverOutput:  # fmt: skip
        """Returns the contact of heights with a solid.

        Called once inside `jax.jit`, without derivatives. A problem that the solver does not accept
        raises `ValueError`; a failure that only values show is reported by `error` and `ended`.
        A loop of steps is written by `run_steps`.

        **Arguments:**

        - `operator`: M, of a pressure [Pa] the displacement [m]; under steady sliding `.kernel` is
          M [m/Pa] on the half spectrum, real or complex. See `operator.py`.
        - `heights`: h [m], positive into the solid, of any mean.
        - `law`: gives pressures point by point, see `AbstractLaw`.
        - `loading`: the mean pressure or the mean gap.
        - `rtol`: requested relative error of the pressure [1].
        - `start`: a pressure [Pa] to begin from, or None.
        """


def run_steps(steps: Any, start: Array, max_steps: Array | int) -> Any:
    """Returns the last state of an iteration: where it is done, or after `max_steps`.

    **Arguments:**

    - `steps`: the iteration, an object with three methods: `init(start)` returns the first state,
      `step(state)` the next, and `done(state)` whether a state is the last. A state has the
      attribute `num_steps`.
    - `start`: argument of `steps.init`.
    - `max_steps`: limit of the state's `num_steps`.

    **Returns:** the state after the last `steps.step`.
    """

    def running(state):
        return ~steps.done(state) & (state.num_steps < max_steps)

    return jax.lax.while_loop(running, lambda state: steps.step(state), varying(steps.init(start)))


def participation(pressure: Field) -> Scalar:
    """Returns ⟨|σ|⟩²/⟨σ²⟩, a measure of the loaded area fraction [1], at least one point's."""
    total, squared = sums(jnp.abs(pressure), pressure**2)
    return participation_of(total, squared, pressure.size)


def participation_of(total, squared, count: int):
    """Returns the participation from sums of |σ| and σ² over `count` points."""
    return jnp.maximum(total**2 / jnp.where(squared > 0, squared, 1), 1) / count


def slope(proximal: Callable, v: Field) -> Field:
    """Returns dy/dv of a law's proximal map: 1 where it fixes the gap, 0 where the pressure."""
    return jax.jvp(proximal, (v,), (jnp.ones_like(v),))[1]
