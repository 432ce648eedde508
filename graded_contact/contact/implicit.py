"""The derivative of a contact solution, attached to a solution found without one.

At the solution let A be the set of points in contact. Off A the pressure is 0; on A the gap is,
M σ - h + ū = 0; and the mean pressure is the load. Points join or leave A with σ = 0, so to first
order A stands still and

    P M P dσ = P (dh - dM σ),   P f = f - ⟨f⟩_A on A, 0 off A,

with the load's change spread over A beforehand. Where a point has σ = 0 and u = 0 at once the
derivative is one-sided, and what is returned is that of the set A as found. In reverse mode the
one linear solve is that of the adjoint kernel, conj(M).
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact

from ..grid import to_field, to_spectrum

# Solves P M P s = r for s = P s, given (M, A, r = P r). A pytree, so that it may hold tracers.
LinearSolve = Callable[
    [Inexact[Array, "*half"], Bool[Array, "*shape"], Float[Array, "*shape"]],
    Float[Array, "*shape"],
]


def attach_gradient(
    pressure: Float[Array, "*shape"],
    kernel: Inexact[Array, "*half"],
    heights: Float[Array, "*shape"],
    load: Float[Array, ""],
    contact: Bool[Array, "*shape"],
    solve: LinearSolve,
) -> Float[Array, "*shape"]:
    """Returns `pressure` unchanged, with its derivative by `kernel`, `heights` and `load`.

    `pressure` must solve the contact problem of these inputs; this is not checked. The price of
    a derivative is one call of `solve` in either mode.
    """
    return _attached((kernel, heights, load), pressure, contact, solve)


@eqx.filter_custom_jvp
def _attached(inputs, pressure, contact, solve):
    return pressure


@_attached.def_jvp
def _attached_jvp(primals, tangents):
    (kernel, _, _), pressure, contact, solve = primals
    d_kernel, d_heights, d_load = tangents[0]

    def project(field):
        mean = jnp.sum(jnp.where(contact, field, 0)) / jnp.sum(contact)
        return jnp.where(contact, field - mean, 0)

    def displace(kernel, field):
        return to_field(kernel * to_spectrum(field), field.shape)

    def solver_for(kernel):
        # Off the range of P the operator is the identity, which makes it regular.
        return lambda _, rhs: solve(kernel, contact, project(rhs)) + rhs - project(rhs)

    spread = jnp.zeros_like(pressure)
    if d_load is not None:
        spread = jnp.where(contact, d_load / jnp.mean(contact, dtype=pressure.dtype), 0)
    rhs = -displace(kernel, spread)
    if d_heights is not None:
        rhs = rhs + d_heights
    if d_kernel is not None:
        rhs = rhs - displace(d_kernel, pressure)
    change = jax.lax.custom_linear_solve(
        lambda s: project(displace(kernel, project(s))) + s - project(s),
        project(rhs),
        solve=solver_for(kernel),
        transpose_solve=solver_for(jnp.conj(kernel)),
    )
    return pressure, spread + change
