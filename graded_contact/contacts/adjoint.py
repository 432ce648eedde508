"""The derivative of a contact solution, attached after the solve.

At a solution every point obeys σ = P(v) with v = σ - ρu: P is the proximal map of the law at the
penalty ρ. With its slope s = dP/dv at each point (the hard wall: 1 in contact and 0 outside; a
smooth law: k/(k + ρ), k = -dσ/du) and its change R = ∂P/∂θ dθ with the law's parameters,

    (1 - s) dσ + ρ s (M dσ + dū) = R - ρ s (dM σ - dh),

with the change of the mean pressure or of the mean gap ū prescribed. Points join or leave the
contact of a hard wall with σ = 0, so to first order the set of contact is fixed; where a point has
σ = 0 and u = 0 at once the derivative is one-sided and belongs to the computed set, as where
the pressure just reaches a hardness.

With dσ = e + √|s| τ, where e has the right mean, the unknown τ obeys A τ = b with
A = ε(1 - s) + √|s| ρM √|s| and ε the sign of s: the adjoint of A has the kernel conj(M), so
the solver of the contact also solves for derivatives in forward and in reverse mode.

The iteration takes 24 to 70 FFT pairs. GMRES and BiCGStab, preconditioned by the inverse kernel on
the set of contact, take 35 to 81 and store 20 fields more (scenes of `bench_contact.py gradient` at
N = 256, to 1e-6). If few points are in contact a dense system is solved instead (`active_set.py`),
because the iteration takes thousands of steps if moduli are far apart.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..core.compilation import one_by_one, varying
from ..core.derivative import root_or_zero
from ..fields.devices import required
from .operators.operator import AbstractOperator, Field, Scalar, Solid, nonzero
from .solver.abstract_solver import Inputs, run_steps, slope
from .solver.active_set import green_of, most_eliminated, solve_on_few
from .solver.splitting import Splitting, draft

MAX_STEPS = 20_000  # of a linear solve


def solve_linear(
    operator: AbstractOperator, weights: Field, rhs: Field, rtol, free_mean: bool, max_steps: int
) -> Field:
    """Returns τ with ε(1 - s)τ + √|s| ρM √|s| τ = rhs, ε being the sign of s.

    **Arguments:**

    - `operator`: ρM, or its adjoint.
    - `weights`: s, the slope of the law's proximal map at each point.
    - `rhs`: the right side.
    - `rtol`: relative error that ends it.
    - `free_mean`: whether the mean of √|s| τ is free; else it is 0, and `rhs` has no part along
      √|s|.
    - `max_steps`: largest number of steps.

    **Returns:** τ, NaN if it did not converge.
    """
    root, sign = jnp.sqrt(jnp.abs(weights)), jnp.where(weights < 0, -1, 1).astype(rhs.dtype)
    few, eliminated = _on_few(operator, weights, root, sign, rhs, free_mean)
    share = jnp.maximum(jnp.mean(root), 1 / root.size)
    solid = Solid(operator, jnp.ones((), rhs.dtype), free_mean)
    proximal = jax.tree_util.Partial(_proximal, root, sign, rhs)
    splitting = Splitting(solid, jnp.zeros_like(share), proximal, rtol, share)
    steps: Any = jnp.where(few, 0, max_steps)  # none if the system was eliminated
    z, _ = draft(splitting, root * rhs, max_steps=steps)
    last = run_steps(splitting, z, steps)
    x = splitting.solid.resolve(last.z)
    tau = jnp.where(few, eliminated, sign * (rhs + root * (2 * x - last.z)))
    found = jnp.where(few, jnp.all(jnp.isfinite(eliminated)), ~last.running)
    return jnp.where(found, tau, jnp.nan)


def _on_few(operator: AbstractOperator, weights, root, sign, rhs, free_mean: bool):
    """Whether few points are in contact, and if so τ."""
    room, green = most_eliminated(operator, rhs), green_of(operator, rhs.shape)
    if room == 0 or green is None:
        return jnp.asarray(False), rhs
    few = jnp.sum(weights != 0) <= room
    total = None if free_mean else jnp.zeros((), rhs.dtype)

    def eliminate(_):
        found = solve_on_few(root, green, sign * (1 - weights), rhs, total, room)
        return jnp.where(root > 0, found, rhs), varying(jnp.asarray(False))

    # A loop of one turn: under `vmap` both branches of a condition would be computed. Its end is a
    # constant: XLA takes what it computes out of a loop that might have more turns.
    return few, jax.lax.while_loop(lambda state: state[1], eliminate, varying((rhs, few)))[0]


def _proximal(root, sign, rhs, v):
    return root * sign * (rhs + root * v)


class State(NamedTuple):
    """A contact: pressure [Pa], displacement of zero mean [m] and mean gap [m]."""

    pressure: Field
    displacement: Field
    mean_gap: Float[Array, "..."]


@eqx.filter_custom_jvp
def attach_gradient(
    inputs: Inputs, state: State, gap: Field, penalty: Scalar, rtol: Scalar, throw: bool
) -> State:
    """Returns `state` unchanged, with its derivative by `inputs`.

    `state` must solve the contact problem, with the pressure that the law has at `gap`; this is
    not checked. A derivative costs one linear solve in either mode.
    """
    return state


@attach_gradient.def_jvp
def _attached_jvp(primals, tangents):
    inputs, state, gap, penalty, rtol, throw = primals
    change: Inputs = tangents[0]
    operator = inputs.operator
    # Attached again, so that a derivative of the rule itself moves with the state.
    state = attach_gradient(*primals)
    moving = state.displacement - inputs.heights + jnp.mean(inputs.heights) + state.mean_gap
    v = state.pressure - penalty * (gap + (moving - jax.lax.stop_gradient(moving)))
    s = slope(inputs.law.in_units(1.0, 1 / penalty).proximal, v)
    by_law, by_operator, by_heights = _given_changes(inputs, change, state, penalty, v)
    d_load, given_gap = change.loading
    d_gap = jnp.zeros_like(state.mean_gap) if given_gap is None else given_gap
    free_mean = inputs.loading.pressure is None
    rhs = by_law - penalty * (by_operator - by_heights)
    if free_mean:
        rhs, d_load = rhs - penalty * d_gap, None
    elif d_load is None:
        d_load = 0.0
    d_pressure = response(operator.scaled(penalty), s, by_law, rhs, d_load, rtol, throw=throw)
    d_displacement = operator.displace(d_pressure) + by_operator
    if not free_mean:
        left = by_law - (1 - s) * d_pressure - penalty * s * (d_displacement - by_heights)
        d_gap = operator.mean(left) / (penalty * nonzero(operator.mean(s)))
    return state, State(d_pressure, d_displacement, d_gap)


_NOT_A_NUMBER = (
    "A derivative of the contact is not a number: its linear solve did not converge (loosen "
    "`derivative_rtol`), or it follows from a derivative that is not a number. Friction without a "
    "load has no derivative."
)


def _given_changes(inputs: Inputs, change: Inputs, state: State, penalty, v):
    """R of the law, dM σ and dh without its mean, each 0 where nothing changes."""
    by_law = by_operator = by_heights = jnp.zeros_like(v)
    if jax.tree.leaves(change.law):
        d_law = _fill_with_zeros(change.law, inputs.law)
        respond = lambda law: law.in_units(1.0, 1 / penalty).proximal(v)  # noqa: E731
        by_law = jax.jvp(respond, (inputs.law,), (d_law,))[1]
    if jax.tree.leaves(change.operator):
        d_operator = _fill_with_zeros(change.operator, inputs.operator)
        moved = lambda operator: operator.displace(state.pressure)  # noqa: E731
        by_operator = jax.jvp(moved, (inputs.operator,), (d_operator,))[1]
    if change.heights is not None:
        by_heights = change.heights - jnp.mean(change.heights)
    return by_law, by_operator, by_heights


def response(
    operator: AbstractOperator, s, known, rhs, load, rtol, max_steps=MAX_STEPS, throw=False
) -> Field:
    """Returns the change dσ with (1 - s) dσ + s (ρM dσ + ρ dū) = (1 - s) `known` + s `rhs`.

    **Arguments:**

    - `operator`: ρM.
    - `s`: slope of the law's proximal map at each point.
    - `known`, `rhs`: the right side where the law fixes the pressure, and where the gap.
    - `load`: mean of dσ, with dū free; or None for dū = 0.
    - `rtol`, `max_steps`: of the linear solve.
    - `throw`: whether it raises if the result is not a number.
    """
    if load is not None:
        share = (load - operator.mean(known)) / nonzero(operator.mean(s))
        known = known + share * s
        rhs = rhs - share * (1 - s)
    rhs = rhs - operator.displace(known)
    how = load is None, max_steps, throw
    return known + _in_contact(operator, s, rhs, rtol, *how)


def _in_contact(
    operator: AbstractOperator, s, rhs, rtol, free_mean: bool, max_steps: int, throw: bool
):
    """√|s| τ, of zero mean unless that is free, where A τ = √|s| rhs."""
    root = root_or_zero(jnp.abs(s))
    sign = jnp.where(s < 0, -1, 1)

    def project(field):
        if free_mean:
            return field
        # A given load leaves no mean of √|s| τ.
        return field - root * (operator.mean(root * field) / nonzero(operator.mean(root * root)))

    def operate(tau):
        inside = project(tau)
        pressed = operator.displace(root * inside)
        return project(sign * (1 - s) * inside + root * pressed) + tau - inside

    @eqx.filter_jit  # traced once for both modes
    @one_by_one
    def solve(operator, s, rhs, rtol):
        tau = solve_linear(operator, s, rhs, rtol, free_mean, max_steps)
        if not throw:
            return tau
        good = ~jnp.any(jnp.isnan(jax.lax.stop_gradient(tau)))
        return required(tau, good, lambda number, bad: eqx.error_if(number, bad, _NOT_A_NUMBER))

    # The adjoint system has the conjugate kernel, so that the same solver serves both modes.
    def solver_for(operator):
        def run(_, rhs):
            inside = project(rhs)
            tau = solve(operator, s, inside, rtol)
            return project(tau) + rhs - inside

        return run

    turned = operator.with_kernel(jnp.conj(operator.kernel))
    return root * jax.lax.custom_linear_solve(
        operate, project(root * rhs), solver_for(operator), solver_for(turned)
    )


def opening_by_load(operator: AbstractOperator, s: Field, rtol) -> Array:
    """Returns ρ dū/dp of a contact whose points have the slopes s; `operator` is ρM."""
    nothing, one = jnp.zeros_like(s), jnp.ones((), s.dtype)
    change = response(operator, s, nothing, nothing, one, rtol)
    left = (1 - s) * change + s * operator.displace(change)
    return -operator.mean(left) / nonzero(operator.mean(s))


def _fill_with_zeros(tangents, primals):
    """The tangents, with zeros in place of None."""
    fill = lambda p, t: jnp.zeros_like(p) if t is None and p is not None else t  # noqa: E731
    return jax.tree.map(fill, primals, tangents, is_leaf=lambda x: x is None)
