"""The hyperbolic functions that a slab is made of, to the last digits."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

# 2 (sinh x - x) = x³ Σ_k 2 x^2k/(2k+3)!; 13 terms reach rounding at x = 2.
_PSI_SERIES = [2.0 / float(np.prod(np.arange(1.0, 2 * k + 4))) for k in range(13)]
# x (cosh x - 1) - 3 (sinh x - x) = x⁵ Σ_k (2k+2) x^2k/(2k+5)!, likewise.
_CHI_SERIES = [(2 * k + 2) / float(np.prod(np.arange(1.0, 2 * k + 6))) for k in range(13)]
# e^-350 squared underflows to nothing in float64; larger q d would only make inf × 0.
DEEP = 350.0


class Hyperbolic(NamedTuple):
    """e^-x, 2 e^-x sinh x and 2 e^-x (sinh x - x)."""

    e1: Float[Array, "*w"]
    om: Float[Array, "*w"]
    psi: Float[Array, "*w"]


@jax.custom_jvp
def hyperbolic(x: Float[Array, "*w"]) -> Hyperbolic:
    """Returns the functions of x >= 0 that a slab is made of, to the last digits.

    For thin slabs the difference comes first, as a series, and for thick ones the sum.
    """
    x = jnp.minimum(x, DEEP)
    e1 = jnp.exp(-x)
    thin = x < 2
    near = e1 * x * _series(_PSI_SERIES, 1, jnp.where(thin, x, 1) ** 2)
    om = jnp.where(thin, near + 2 * x * e1, 1 - e1 * e1)
    return Hyperbolic(e1, om, jnp.where(thin, near, om - 2 * x * e1))


@hyperbolic.defjvp
def _hyperbolic_jvp(primals, tangents):
    e1, om, psi = hyperbolic(*primals)
    dx = jnp.where(primals[0] < DEEP, tangents[0], 0)
    # 2 e^-x (cosh x - 1) = om²/(1 + e^-x)², without the difference
    change = Hyperbolic(-e1 * dx, 2 * e1 * e1 * dx, ((om / (1 + e1)) ** 2 - psi) * dx)
    return Hyperbolic(e1, om, psi), change


def chi(x: Float[Array, "*w"], functions: Hyperbolic) -> Float[Array, "*w"]:
    """Returns 2 e^-x [x (cosh x - 1) - 3 (sinh x - x)], given `hyperbolic(x)`."""
    e1, om, psi = functions
    thin = x < 2
    near = 2 * e1 * x * _series(_CHI_SERIES, 2, jnp.where(thin, x, 1) ** 2)
    return jnp.where(thin, near, x * (om / (1 + e1)) ** 2 - 3 * psi)


def _series(coefficients, first, squared):
    """Σ_k coefficients[k] squared^(first + k)."""
    series = jnp.full_like(squared, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        series = series * squared + coefficient
    return squared**first * series
