"""The derivative of a contact solution, attached to a solution found without one.

At a solution every point obeys σ = P(v) with v = σ - ρu: P is the proximal map of the law at the
penalty ρ. With its slope s = dP/dv at each point (the hard wall: 1 in contact and 0 outside; a
smooth law: k/(k + ρ), k = -dσ/du) and its change R = ∂P/∂θ dθ with the law's parameters,

    (1 - s) dσ + ρ s (M dσ + dū) = R - ρ s (dM σ - dh),

with the change of the mean pressure prescribed. If that of the mean gap ū is prescribed instead, so
much of the response to a load alone is added that ū changes as it should. Points join or leave the
contact of a hard wall with σ = 0, so to first order the set of contact is fixed; where a point has
σ = 0 and u = 0 at once the derivative is one-sided, that of the set as it was found. The same holds
where the pressure just reaches a hardness.

With dσ = e + √|s| τ, where e has the right mean, the unknown τ obeys A τ = b with
A = ε(1 - s) + √|s| ρM √|s| and ε the sign of s: the adjoint of A is that of the kernel conj(M), so
the solver that found the contact finds derivatives in forward and in reverse mode.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..fields.grid import to_field, to_spectrum
from .law import AbstractLaw
from .solver import LinearSolver, Prescribed, nonzero, slope


class Inputs(NamedTuple):
    """What a contact follows from."""

    kernel: Inexact[Array, "*half"]
    heights: Float[Array, "*shape"]
    law: AbstractLaw
    prescribed: Prescribed


class State(NamedTuple):
    """A contact: pressure [Pa], displacement of zero mean [m] and mean gap [m]."""

    pressure: Float[Array, "*shape"]
    displacement: Float[Array, "*shape"]
    mean_gap: Float[Array, ""]


def attach_gradient(
    inputs: Inputs,
    state: State,
    gap: Float[Array, "*shape"],
    penalty: Float[Array, ""],
    linear: LinearSolver,
    rtol: Float[Array, ""],
) -> State:
    """Returns `state` unchanged, with its derivative by `inputs`.

    `state` must solve the contact problem, with the pressure that the law has at `gap`; this is
    not checked. The price of a derivative is one call of `linear` in either mode.
    """
    return _attached(inputs, state, gap, penalty, linear, rtol)


@eqx.filter_custom_jvp
def _attached(inputs, state, gap, penalty, linear, rtol):
    return state


@_attached.def_jvp
def _attached_jvp(primals, tangents):
    inputs, state, gap, penalty, linear, rtol = primals
    change: Inputs = tangents[0]
    # Attached again, so that a derivative of the rule itself moves with the state.
    state = _attached(*primals)
    moving = state.displacement - inputs.heights + jnp.mean(inputs.heights) + state.mean_gap
    v = state.pressure - penalty * (gap + (moving - jax.lax.stop_gradient(moving)))
    s = slope(inputs.law.in_units(1.0, 1 / penalty), v)
    by_law, by_kernel, by_heights = _given_changes(inputs, change, state, penalty, v)
    held = nonzero(jnp.mean(s))

    def respond(rhs, known, d_load):
        """dσ under a change of the load, the part `known` of it aside, and what closes dū."""
        share = (d_load - jnp.mean(known)) / held
        known = known + share * s
        rhs = rhs - share * (1 - s) - penalty * displace(inputs.kernel, known)
        return known + _in_contact(penalty * inputs.kernel, s, rhs, linear, rtol)

    def opened(d_pressure, given):
        """The change of the mean gap with a pressure, and with what else is given."""
        moved = displace(inputs.kernel, d_pressure)
        return jnp.mean(given - (1 - s) * d_pressure - penalty * s * moved) / (penalty * held)

    rhs = by_law - penalty * (by_kernel - by_heights)
    given = by_law - penalty * s * (by_kernel - by_heights)
    d_load, d_gap = change.prescribed
    d_pressure = respond(rhs, by_law, 0.0 if d_load is None else d_load)
    if inputs.prescribed.pressure is not None:
        d_gap = opened(d_pressure, given)
    else:
        # The load follows from the gap, by the response to a load alone.
        d_gap = jnp.zeros_like(penalty) if d_gap is None else d_gap
        none = jnp.zeros_like(v)
        by_load = respond(none, none, 1.0)
        missing = d_gap - opened(d_pressure, given)
        d_pressure = d_pressure + by_load * (missing / nonzero(opened(by_load, none)))
    d_displacement = displace(inputs.kernel, d_pressure) + by_kernel
    return state, State(d_pressure, d_displacement, d_gap)


def _given_changes(inputs: Inputs, change: Inputs, state: State, penalty, v):
    """R of the law, dM σ and dh without its mean, each 0 where nothing changes."""
    by_law = by_kernel = by_heights = jnp.zeros_like(v)
    if jax.tree.leaves(change.law):
        d_law = _fill_with_zeros(change.law, inputs.law)
        respond = lambda law: law.in_units(1.0, 1 / penalty).proximal(v)  # noqa: E731
        by_law = jax.jvp(respond, (inputs.law,), (d_law,))[1]
    if change.kernel is not None:
        by_kernel = displace(change.kernel, state.pressure)
    if change.heights is not None:
        by_heights = change.heights - jnp.mean(change.heights)
    return by_law, by_kernel, by_heights


def _in_contact(kernel, s, rhs, linear: LinearSolver, rtol):
    """√|s| τ of zero mean, where A τ = √|s| rhs."""
    root = root_of(s)
    sign = jnp.where(s < 0, -1, 1)

    def project(field):
        return without_mean(field, root)

    def operate(tau):
        inside = project(tau)
        pressed = displace(kernel, root * inside)
        return project(sign * (1 - s) * inside + root * pressed) + tau - inside

    def solver_for(kernel):
        def run(_, rhs):
            inside = project(rhs)
            return project(linear(kernel, s, inside, rtol=rtol)) + rhs - inside

        return run

    return root * jax.lax.custom_linear_solve(
        operate,
        project(root * rhs),
        solve=solver_for(kernel),
        transpose_solve=solver_for(jnp.conj(kernel)),
    )


def root_of(s: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Returns √|s|, 0 in all orders where the law holds the pressure."""
    held = s != 0  # √ alone has an infinite slope where it does not
    return jnp.where(held, jnp.sqrt(jnp.where(held, jnp.abs(s), 1)), 0)


def without_mean(
    field: Float[Array, "*shape"], root: Float[Array, "*shape"]
) -> Float[Array, "*shape"]:
    """Returns τ less its part along √|s|: a given load leaves no mean of √|s| τ."""
    return field - root * (jnp.sum(root * field) / nonzero(jnp.sum(root * root)))


def displace(
    kernel: Inexact[Array, "*half"], field: Float[Array, "*shape"]
) -> Float[Array, "*shape"]:
    """Returns M σ without its mean."""
    spectrum = (kernel * to_spectrum(field)).at[(0,) * field.ndim].set(0)
    return to_field(spectrum, field.shape)


def _fill_with_zeros(tangents, primals):
    """The tangents, with those that are known to be zero made so."""
    return jax.tree.map(
        lambda p, t: jnp.zeros_like(p) if t is None and p is not None else t,
        primals,
        tangents,
        is_leaf=lambda x: x is None,
    )
