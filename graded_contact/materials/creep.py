"""The two forms of a Prony series, moduli E_k with relaxation times and compliances H_j with
retardation times, converted into each other exactly.

E(s) and J(s) = 1/E(s) are rational functions whose poles and zeros on the negative axis
interlace: the rates of one form are the zeros of the other, each bracketed by its neighbours,
and the strengths are residues. N. W. Tschoegl, The Phenomenological Theory of Linear
Viscoelastic Behavior, Springer (1989), doi:10.1007/978-3-642-73602-5.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


@jax.jit
def relaxation_from_creep(
    glassy: Float[Array, ""], compliances: Float[Array, " n"], times: Float[Array, " n"]
) -> tuple[Float[Array, ""], Float[Array, " n"], Float[Array, " n"]]:
    """Returns `(equilibrium [Pa], strengths [Pa], relaxation times [s])`, longest time first.

    Of 1/E(ω) = 1/E_inf + Σ_j H_j/(1 + iω t_j), E_inf being `glassy` [Pa], H_j `compliances`
    [1/Pa] and t_j `times` [s], no two equal.
    """
    order = jnp.argsort(-times)
    rates = 1 / times[order]
    weights = glassy * compliances[order] * rates
    # J(s) = 0 at s = -λ: one root above each rate, the last below r_n + Σ a.
    roots, gaps = _increasing_roots(
        lambda root, gaps: 1 + jnp.sum(weights / gaps, axis=-1),
        rates,
        lower=rates,
        upper=jnp.append(rates[1:], rates[-1] + 2 * jnp.sum(weights)),
    )
    slope = jnp.sum(weights / gaps / gaps, axis=-1)
    equilibrium = glassy / (1 + glassy * jnp.sum(compliances))
    return equilibrium, glassy / (roots * slope), 1 / roots


@jax.jit
def creep_from_relaxation(
    equilibrium: Float[Array, ""], strengths: Float[Array, " n"], times: Float[Array, " n"]
) -> tuple[Float[Array, ""], Float[Array, " n"], Float[Array, " n"]]:
    """Returns `(glassy [Pa], compliances [1/Pa], retardation times [s])`, longest time first.

    Of E(t) = E_eq + Σ_k E_k exp(-t/τ_k) with `equilibrium` E_eq > 0, `strengths` E_k [Pa] and
    `times` τ_k [s], no two equal.
    """
    order = jnp.argsort(-times)
    rates, strengths = 1 / times[order], strengths[order]
    ratios = strengths / equilibrium
    # E(s) = 0 at s = -r: one root below each rate, the first above r_1/(1 + Σ E_k/E_eq).
    roots, gaps = _increasing_roots(
        lambda root, gaps: jnp.sum(ratios * root[:, None] / gaps, axis=-1) - 1,
        rates,
        lower=jnp.append(rates[:1] / (1 + 2 * jnp.sum(ratios)), rates[:-1]),
        upper=rates,
    )
    slope = jnp.sum(strengths * rates / gaps / gaps, axis=-1)
    return equilibrium + jnp.sum(strengths), 1 / (roots * slope), 1 / roots


def _increasing_roots(
    value: Callable[[Float[Array, " n"], Float[Array, "n n"]], Float[Array, " n"]],
    poles: Float[Array, " n"],
    lower: Float[Array, " n"],
    upper: Float[Array, " n"],
) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """Returns roots λ_i between `lower` and `upper` > 0, and the gaps poles_j - λ_i.

    `value(λ, gaps)` increases along each bracket, from pole to pole. The root of a weak branch
    nearly touches its pole, so what is sought is log |λ - nearer end|: by bisection to the last
    digit, then by one Newton step that carries the derivatives.
    """
    middle = (lower + upper) / 2
    from_lower = value(middle, poles - middle[:, None]) > 0
    end, sign = jnp.where(from_lower, lower, upper), jnp.where(from_lower, 1, -1)

    def place(step):
        return end + sign * step, (poles - end[:, None]) - (sign * step)[:, None]

    def halve(_, bracket):
        near, far = bracket
        step = (near + far) / 2
        too_far = sign * value(*place(jnp.exp(step))) > 0
        return jnp.where(too_far, near, step), jnp.where(too_far, step, far)

    far = jnp.log((upper - lower) / 2)
    reach = 0.9 * float(np.log(jnp.finfo(poles.dtype).tiny))
    # 80 halvings take a bracket of 700 e-foldings below rounding.
    near, far = jax.lax.stop_gradient(jax.lax.fori_loop(0, 80, halve, (far + reach, far)))
    step = jnp.exp((near + far) / 2)
    _, slope = jax.jvp(lambda step: value(*place(step)), (step,), (jnp.ones_like(step),))
    return place(step - value(*place(step)) / jax.lax.stop_gradient(slope))
