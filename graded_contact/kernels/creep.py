"""How a block creeps under each wave of pressure: its memory in time, from complex frequencies.

After a unit impulse of pressure at t = 0 a wave q has the displacement K(q, t), whose Laplace
transform is M(q, ω = -is). On a hyperbola around all relaxation rates, for t0 <= t <= T,

    K(q, t) = Re Σ_k w_k M(q, -i s_k) exp(s_k t),

whatever the layers and their laws are: a node k is one equation y' = s_k y + p of first order. The
nodes follow Weideman & Trefethen in closed form; the angle is the best of a row. 32 of them
leave errors of an exponential of any rate, relative to its start, of 1e-8, 6e-7, 1e-5, 8e-5 for
T/t0 = 1e2, 1e3, 1e4, 1e5. Eight more for each two decades beyond keep them below 3e-4, up to 64
nodes for 1e12 (`tests/sliding/test_slide_transient.py`). For one time alone 14 are enough for
rounding: so the creep under a constant pressure, J = ∫K, and its integral are computed for the
length of each step.

M depends on |q| only, and M over the creep at the last time is smooth in log |q|: all is computed
at few wavenumbers and interpolated by polynomials through Chebyshev nodes. So a response on a grid
is linear in the few numbers of its table, and so is all that is linear in a kernel, as on a window.

J. A. C. Weideman & L. N. Trefethen, Math. Comp. 76 (2007) 1341,
doi:10.1090/S0025-5718-07-01945-X.
"""

import math
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..blocks.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack, moduli_of
from ..core.checks import is_concrete
from ..core.compilation import compiled, compiled_loop
from ..core.derivative import derivative_apart, still
from ..response.compliance import compliance_or_nan, compliance_parts
from ..response.grading import check_profiles, graded_tolerance
from .table import barycentric

_FEWEST, _NODES_OF_STEP = 32, 14
LONGEST = 1e12  # longest time over shortest: rounding of a double moves the shortest step by 1e-4
_WAVES = 64  # wavenumbers in the table; five decades of them leave 1e-7
_ANGLES = np.linspace(np.pi / 4, np.pi / 2, 402)[1:-1]
_CHECKED = 24  # times at which the memory is compared with one made for a single time


class Contour(NamedTuple):
    """Nodes s_k [1/s] of a hyperbola, one of each conjugate pair, and their weights w_k [1/s]."""

    nodes: Complex[Array, " nodes"]
    weights: Complex[Array, " nodes"]


def contour(first: Float[Array, ""], last: Float[Array, ""], count: int) -> Contour:
    """Returns the nodes for times from `first` to `last` [s]."""
    first, last = jax.lax.stop_gradient((first, last))
    angle, ratio = jnp.asarray(_ANGLES, last.dtype), last / first
    bend = (np.pi - 2 * angle) * ratio + 4 * angle - np.pi
    width = jnp.arccosh(bend / ((4 * angle - np.pi) * jnp.sin(angle)))
    best = jnp.argmax((np.pi**2 - 2 * np.pi * angle) / width)
    angle, width = angle[best], width[best]
    scale = (4 * np.pi * angle - np.pi**2) / width * count / last
    x = 1j * (jnp.arange(count, dtype=last.dtype) + 0.5) * width / count - angle
    return Contour(scale * (1 + jnp.sin(x)), scale * width / (count * np.pi) * jnp.cos(x))


def node_count(steps: Float[Array, " steps"]) -> int:
    """Returns how many nodes the memory of steps [s] needs; the fewest if they are not known."""
    if not is_concrete(steps := still(steps)):
        return _FEWEST
    known = np.asarray(steps)
    decades = np.log10(np.sum(known) / np.min(known))
    return _FEWEST + 8 * max(0, math.ceil((decades - 5) / 2))


class Creep(eqx.Module):
    """The memory of a block at some wavenumbers, first of pressure, then of traction, if it counts.

    All responses along z are divided by the final `aged`, Q(q) [m], for interpolation between the
    wavenumbers; of a traction it is without the factor i q·e/|q|.

    **Fields:**

    - `log_q`: ends of log |q|, shape `(2,)`.
    - `longest`: |q| J(T) at the end of all steps [m/Pa], shape `(waves,)`.
    - `nodes`: s_k [1/s].
    - `kernels`: w_k M(q, -i s_k), shape `(forces, nodes, waves)`.
    - `now`: I(Δ)/Δ of each step Δ: what a force that grows to 1 within it leaves.
    - `whole`: J(Δ): what a constant force of 1 leaves; both of shape `(forces, steps, waves)`.
    - `aged`: J(t) of pressure, of the times t at which the steps end, shape `(steps, waves)`.
    - `error`: estimated error of the displacements, relative [1].
    """

    log_q: Float[Array, "2"]
    longest: Float[Array, " waves"]
    nodes: Complex[Array, " nodes"]
    kernels: Complex[Array, "forces nodes waves"]
    now: Float[Array, "forces steps waves"]
    whole: Float[Array, "forces steps waves"]
    aged: Float[Array, "steps waves"]
    error: Float[Array, ""]

    def shares(self, q: Float[Array, " points"]) -> Float[Array, "waves points"]:
        """Returns the factors of a table for its response [m/Pa] at wavenumbers [rad/m]."""
        low, high = self.log_q
        share = barycentric((2 * jnp.log(q) - low - high) / (high - low), _WAVES).T
        return share * (jnp.exp(jnp.log(self.longest) @ share) / q)


def creep_of(
    stack: Stack, ends: Float[Array, "2"], steps: Float[Array, " steps"], coupled: bool = False
) -> Creep:
    """Returns the memory of a block between two wavenumbers [rad/m], for steps in time [s].

    If `coupled`, also of traction.
    """
    check_profiles(stack, -1j * jnp.ones(1, ends.dtype))
    _check_analytic(stack, steps)
    tolerance = graded_tolerance(stack, ends)
    return _creep(stack, ends, steps, tolerance, coupled, node_count(steps))


def _check_analytic(stack: Stack, steps: Array) -> None:
    """Raises `ValueError` for a law of moduli that is not analytic in ω, if it is known."""
    if not all(map(is_concrete, jax.tree.leaves((stack, steps)))):
        return
    for part in (*stack.layers, stack.base):
        if isinstance(part, Rigid | Free) or _is_analytic(part, steps):
            continue
        name = "profile" if isinstance(part, GradedLayer) else "material"
        raise ValueError(
            f"`{name}={type(getattr(part, name)).__name__}(...)` is refused: transient motion "
            "needs moduli at complex frequencies, and this law is not analytic there. Write it "
            "with 1j*omega, without |omega|, sign or real part; or fit it: "
            "`fit_prony(omega, modulus)`."
        )


@compiled
def _is_analytic(part: GradedLayer | Layer | HalfSpace, steps: Array) -> Array:
    omega = -1j * contour(jnp.min(steps), jnp.sum(steps), 8).nodes
    if isinstance(part, GradedLayer):
        law = partial(part.profile, jnp.asarray(0.5, steps.dtype))
    else:
        law = partial(moduli_of, part.material)
    # Along the imaginary axis the derivative is i times as large.
    along, across = (
        jax.jvp(lambda w: [m + 0 * w for m in law(w)], (omega,), (way + 0 * omega,))[1]
        for way in (1, 1j)
    )
    near = [
        jnp.abs(b - 1j * a) <= 1e-3 * jnp.abs(a) + 1e-30 for a, b in zip(along, across, strict=True)
    ]
    return jnp.all(jnp.stack(near))


@derivative_apart
@compiled_loop
def _creep(
    stack: Stack, ends: Array, steps: Array, rtol: float, coupled: bool, count: int
) -> Creep:
    log_q = jnp.log(ends)
    angle = np.pi * (np.arange(_WAVES) + 0.5) / _WAVES
    q = jnp.exp(jnp.mean(log_q) + jnp.cos(angle) * (log_q[1] - log_q[0]) / 2).astype(ends.dtype)
    shortest, whole = jnp.min(steps), jnp.sum(steps)
    nodes, weights = contour(shortest, whole, count)

    def compliance(q, s):
        """|q| M along z of a pressure, and if `coupled` of a traction, but for i q·e/|q|."""
        wave, omega = jnp.broadcast_arrays(q[None, :], -1j * s[:, None])
        if not coupled:
            return q * compliance_or_nan(stack, wave, omega, rtol)[None] + 0j
        (_, c12, c22, *_), _ = compliance_parts(stack, wave, omega, rtol, throw=False)
        return q * jnp.stack([c22 + 0j, c12 + 0j])

    def of_step(step):
        """K, J and I/Δ after one time alone."""
        s, w = contour(step, step, _NODES_OF_STEP)
        part = (w * jnp.exp(s * step))[:, None] * compliance(q, s)
        over = (part, part / s[:, None], part / (s**2 * step)[:, None])
        return [jnp.sum(each.real, axis=1) for each in over]

    # Between the wavenumbers the interpolation is compared with what it stands for.
    beside = jnp.cos(angle[::7] + np.pi / 2 / _WAVES) * (log_q[1] - log_q[0]) / 2
    middle = jnp.exp(jnp.mean(log_q) + beside).astype(q.dtype)
    kernels = weights[:, None] * compliance(jnp.concatenate([q, middle]), nodes)
    kernels, between = kernels[..., :_WAVES], kernels[0, :, _WAVES:]
    # What the long hyperbola leaves, from the shortest time to the whole one.
    times = jnp.exp(jnp.linspace(jnp.log(shortest), jnp.log(whole), _CHECKED))
    alone = jax.lax.map(of_step, jnp.concatenate([steps, jnp.cumsum(steps), times]))
    n = len(steps)
    creep, now = (jnp.moveaxis(part[:n], 1, 0) for part in alone[1:])
    aged = alone[1][n : 2 * n, 0]
    exact, reached = alone[0][2 * n :, 0], alone[2][2 * n :, 0]
    by_nodes = jnp.sum((kernels[0] * jnp.exp(nodes * times[:, None])[..., None]).real, axis=1)
    apart = jnp.cumsum(jnp.abs(by_nodes - exact) * times[:, None], axis=0)
    error = jnp.max(apart / reached) * jnp.log(whole / shortest) / (_CHECKED - 1)
    longest = aged[-1]
    kernels, now, creep, aged = (part / longest for part in (kernels, now, creep, aged))
    found = Creep(log_q, longest, nodes, kernels, now, creep, aged, error)
    known = found.kernels[0] @ (middle * found.shares(middle)).astype(between.dtype)
    missed = jnp.max(jnp.abs(known / between - 1))
    return eqx.tree_at(lambda c: c.error, found, jax.lax.stop_gradient(error + missed))
