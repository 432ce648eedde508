"""Diffusion of the pressure in a contact as finer roughness is added.

Stresses are in units of the mean pressure σ0: v = V/σ0², where V is the variance that the pressure
would have in complete contact. The density P of the pressure obeys ∂P/∂v = ½ ∂²P/∂σ² and starts as
a spike at σ = 1. Points that reach σ = 0 have lost contact, so P = 0 there, and P is a Gaussian
less its mirror image (B. N. J. Persson, J. Chem. Phys. 115 (2001) 3840, doi:10.1063/1.1388626). The
contact area is A = ∫P dσ = erf(1/√(2v)), and the mean square pressure grows as d⟨σ²⟩/dv = A.

In partial contact finer roughness adds less than this, because the edges of the contact yield. The
correction `"yang_persson"` slows the diffusion: x(v) replaces v, with dx/dv = S.
S = 0.45 + 0.55 A² is of C. Yang, B. N. J. Persson, J. Phys.: Condens. Matter 20 (2008) 215214,
doi:10.1088/0953-8984/20/21/215214.
"""

from collections.abc import Callable
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf
from jaxtyping import Array, Float

Correction = Literal["none", "yang_persson"]

# Below, the area is 1 to rounding (1 - 2e-23): nothing has reached σ = 0.
_START = 0.01


@jax.jit
def area(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Returns the contact area fraction [1] after diffusion up to `x`."""
    spread = x > _START
    return jnp.where(spread, erf(1 / jnp.sqrt(2 * jnp.where(spread, x, 1))), 1)


@jax.jit
def mean_square_growth(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Returns ⟨σ²⟩ - 1 over the nominal area [1]; its derivative is the area."""
    spread = x > _START
    safe = jnp.where(spread, x, 1)
    tail = jnp.sqrt(2 * safe / np.pi) * jnp.exp(-1 / (2 * safe))
    return jnp.where(spread, (1 + safe) * area(safe) + tail - 1, x)


@jax.jit
def density(x: Float[Array, "n 1"], stress: Float[Array, "#n m"]) -> Float[Array, "n m"]:
    """Returns P at stresses [1] after diffusion up to `x`; 0 where nothing has spread."""
    safe = jnp.where(x > 0, x, 1)
    # exp(-(σ-1)²/2x) - exp(-(σ+1)²/2x), without the difference of neighbours
    images = jnp.exp(-((stress - 1) ** 2) / (2 * safe)) * -jnp.expm1(-2 * stress / safe)
    return jnp.where(x > 0, images / jnp.sqrt(2 * np.pi * safe), 0)


def mean_in_contact(function: Callable, x: Float[Array, " n"]) -> Float[Array, " n"]:
    """Returns the mean of a function of the stress [1] over the contact, after diffusion up to `x`.

    Gauss's rule over eight standard deviations on either side of σ = 1, as far as σ > 0. Where
    nothing has spread, all contact is at σ = 1.
    """
    nodes, weights = (jnp.asarray(a, x.dtype) for a in np.polynomial.legendre.leggauss(64))
    spread = jnp.sqrt(jnp.where(x > 0, x, 1))
    low, high = jnp.maximum(1 - 8 * spread, 0)[:, None], 1 + 8 * spread[:, None]
    stress = low + (high - low) * (1 + nodes) / 2
    weights = weights * density(jnp.where(x > 0, x, 1)[:, None], stress)
    values = jnp.where(x[:, None] > 0, function(stress), function(jnp.ones_like(stress)))
    return jnp.sum(weights * values, -1) / jnp.sum(weights, -1)


def _slowing(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """S = dx/dv [1] of the correction."""
    return 0.45 + 0.55 * area(x) ** 2


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def slowed(correction: Correction, v: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Returns x(v) [1], the progress of the slowed diffusion.

    The inverse v(x) = ∫dx/S is tabulated; within an interval of the table two of Newton's steps
    solve for x to rounding, with Gauss's rule for the integral from the start of the interval.
    """
    if correction == "none":
        return v
    nodes, weights = (jnp.asarray(a, v.dtype) for a in np.polynomial.legendre.leggauss(8))

    def elapsed(start, end):
        half = (end - start) / 2
        x = start[..., None] + half[..., None] * (1 + nodes)
        return half * jnp.sum(weights / _slowing(x), axis=-1)

    # At the last entry S has become constant.
    table = jnp.asarray(np.geomspace(_START, 1e24, 700), v.dtype)
    steps = elapsed(table[:-1], table[1:])
    passed = jnp.concatenate([table[:1], table[0] + jnp.cumsum(steps)])
    # A straight line through the interval starts Newton's steps.
    i = jnp.clip(jnp.searchsorted(passed, v) - 1, 0, len(table) - 2)
    start, late = table[i], v - passed[i]
    x = start + late * (table[i + 1] - start) / steps[i]
    for _ in range(2):
        x = x + (late - elapsed(start, x)) * _slowing(x)
    return jnp.where(v > _START, x, v)


@slowed.defjvp
def _slowed_jvp(correction, primals, tangents):
    x = slowed(correction, *primals)
    rate = jnp.ones_like(x) if correction == "none" else _slowing(x)
    return x, rate * tangents[0]
