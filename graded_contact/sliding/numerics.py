"""Numerics of a contact: tolerance, solvers, and whether a failure raises."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from ..contacts.solve import default_rtol
from ..contacts.solver.abstract_solver import AbstractContactSolver
from ..contacts.solver.nested_solve import DouglasRachford
from ..core.checks import check_type


class Numerics(eqx.Module):
    """How a contact is computed; it decides the errors of the numbers, nothing else.

    **Fields:**

    - `rtol`: requested relative error of the pressure [1]; None means 5e-5, or 5e-4 in float32.
      Static.
    - `solver`: of the contact, see `DouglasRachford`, or `AbstractContactSolver` to write one.
    - `derivative_rtol`: relative error of a derivative of the pressure [1]; None means twenty times
      `rtol`, at most 1e-3. Static.
    - `throw`: whether to raise if a solve or a kernel fails; with False see `.result`. Static.
    """

    rtol: Any = eqx.field(default=None, static=True)  # a number once `of` is called
    solver: AbstractContactSolver = DouglasRachford()
    derivative_rtol: float | None = eqx.field(default=None, static=True)
    throw: bool = eqx.field(default=True, static=True)

    def __check_init__(self):
        check_type("solver", self.solver, AbstractContactSolver)
        check_type("throw", self.throw, bool)

    def of(self, *given: Any) -> "Numerics":
        """Returns a copy whose `rtol=None` is replaced by the default for the dtype of `given`."""
        if self.rtol is not None:
            return self
        # The most precise of their numbers decides in which precision a contact is computed.
        leaves = jax.tree.leaves(eqx.filter(given, eqx.is_inexact_array))
        return dataclasses.replace(self, rtol=default_rtol(jnp.result_type(*leaves)))
