"""The linear systems of derivatives, by the iteration that finds contacts.

It takes 24 to 70 FFT pairs where GMRES and BiCGStab, preconditioned by the inverse kernel on the
set of contact, take 35 to 81 and keep 20 fields more (the scenes of `bench_contact.py gradient` at
N = 256, to 1e-6): so no library of Krylov methods is used. Where few points are in contact their
pressures are eliminated instead (`held_points.py`): on moduli far apart the iteration would take
thousands of steps.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Inexact

from ..core.checks import check_tolerance, check_whole
from ..fields.devices import tied
from ..fields.grid import to_field
from .held_points import most_eliminated, solve_on_few
from .splitting import CYCLE, Solid, Splitting, check_relaxation, draft, iterate


class Solved(NamedTuple):
    """What the linear solver found.

    **Fields:**

    - `tau`: the solution τ.
    - `pressure`: of the solid, near √|s| τ but with better soft waves.
    - `found`: whether it is a solution.
    - `num_fft_pairs`: without those of a draft.
    """

    tau: Float[Array, "*shape"]
    pressure: Float[Array, "*shape"]
    found: Bool[Array, ""]
    num_fft_pairs: Array


class LinearSplitting(eqx.Module):
    """Settings of the splitting for a law linearised at a solution, y = s v. All static.

    **Fields:**

    - `rtol`: wanted relative error of the derivative of the pressure [1]; None for the `rtol` of
      the contact.
    - `max_steps`, `relaxation`, `memory`: as those of `DouglasRachford`.
    """

    rtol: float | None = eqx.field(default=None, static=True)
    max_steps: int = eqx.field(default=20_000, static=True)
    relaxation: float = eqx.field(default=0.95, static=True)
    memory: int = eqx.field(default=5, static=True)

    def __check_init__(self):
        if self.rtol is not None:
            check_tolerance("rtol", self.rtol, np.zeros(()))
        check_whole("max_steps", self.max_steps, 1)
        check_whole("memory", self.memory, 1)
        check_relaxation(self.relaxation)

    def __call__(
        self,
        kernel: Inexact[Array, "*half"],
        weights: Float[Array, "*shape"],
        rhs: Float[Array, "*shape"],
        *,
        rtol: Float[Array, ""],
    ) -> Float[Array, "*shape"]:
        """Returns the τ of `solve`, or fails if that did not converge."""
        if self.rtol is not None:
            check_tolerance("rtol", self.rtol, rhs)
            rtol = jnp.asarray(self.rtol, rhs.dtype)
        tau, _, found, _ = self.solve(kernel, weights, rhs, rtol=rtol)
        checked = eqx.error_if(
            jnp.asarray(-0.0),
            ~found,
            "The linear solve for a derivative of the contact did not converge. Raise "
            "`max_steps` of the solver's `linear`, or loosen its `rtol`.",
        )
        return tied(tau, checked)

    def solve(
        self,
        kernel: Inexact[Array, "*half"],
        weights: Float[Array, "*shape"],
        rhs: Float[Array, "*shape"],
        *,
        rtol: Float[Array, ""],
    ) -> Solved:
        """Returns τ with ε(1 - s)τ + √|s| ρM √|s| τ = rhs, ε being the sign of s, and more.

        **Arguments:**

        - `kernel`: ρM on the half spectrum, or for the adjoint its conjugate, 0 at q = 0.
        - `weights`: s, the slope of the law's proximal map at each point.
        - `rhs`: the right side; it and τ are orthogonal to √|s|.
        - `rtol`: relative error that ends it; that of the contact if the settings have none.
        """
        root, sign = jnp.sqrt(jnp.abs(weights)), jnp.where(weights < 0, -1, 1).astype(rhs.dtype)
        solid = Solid(kernel, jnp.ones((), rhs.dtype), False)
        few, eliminated = self._on_few(solid, weights, root, sign, rhs)
        proximal = jax.tree_util.Partial(_proximal, root, sign, rhs)
        share = jnp.maximum(jnp.mean(root), 1 / root.size)
        splitting = Splitting(solid, jnp.zeros_like(share), proximal, share)
        how: dict[str, Any] = dict(
            rtol=rtol,
            relaxation=self.relaxation,
            memory=self.memory,
            max_steps=jnp.where(few, 0, self.max_steps),
        )
        z, _ = draft(splitting, root * rhs, **how)
        last = iterate(splitting, z, **how)
        x = solid(last.z)
        tau = jnp.where(few, eliminated, sign * (rhs + root * (2 * x - last.z)))
        pressure = jnp.where(few, root * tau, x)
        ended = jnp.where(few, jnp.all(jnp.isfinite(eliminated)), ~last.going_on)
        return Solved(tau, pressure, ended, last.cycles * CYCLE)

    def _on_few(self, solid: Solid, weights, root, sign, rhs):
        """Whether few points are in contact, and if so τ."""
        room = most_eliminated(rhs)
        if room == 0:
            return jnp.asarray(False), rhs
        few = jnp.sum(weights != 0) <= room

        def eliminate(_):
            green = to_field(solid.compliance + 0j, rhs.shape)
            none = jnp.zeros((), rhs.dtype)
            found = solve_on_few(root, green, sign * (1 - weights), rhs, none, room)
            return jnp.where(root > 0, found, rhs), jnp.asarray(False)

        # A loop of one turn: under `vmap` both branches of a condition would be computed.
        return few, jax.lax.while_loop(lambda state: state[1], eliminate, (rhs, few))[0]


def _proximal(root, sign, rhs, v):
    return root * sign * (rhs + root * v)
