"""Monotone splines, of tables of moduli, of shifts and of profiles."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def monotone_cubic(
    nodes: Float[Array, " n"], values: Float[Array, " n"], x: Float[Array, "*w"]
) -> Float[Array, "*w"]:
    """Returns the Fritsch-Carlson monotone cubic interpolant at `x`, as SciPy's PCHIP.

    F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021.
    """
    h, secant = jnp.diff(nodes), jnp.diff(values) / jnp.diff(nodes)
    if len(values) == 2:
        slopes = jnp.broadcast_to(secant, (2,))
    else:
        left, right = secant[:-1], secant[1:]
        # At an extremum of the values the slope is 0, so that the curve does not overshoot them.
        same = left * right > 0
        w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        safe_left, safe_right = jnp.where(same, left, 1), jnp.where(same, right, 1)
        inner = jnp.where(same, (w1 + w2) / (w1 / safe_left + w2 / safe_right), 0)
        ends = [_end_slope(h[i], h[j], secant[i], secant[j]) for i, j in ((0, 1), (-1, -2))]
        slopes = jnp.concatenate([ends[0][None], inner, ends[1][None]])
    # Beyond the nodes the first or the last cubic continues.
    i = jnp.clip(jnp.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
    t = (x - nodes[i]) / h[i]
    rise = values[i + 1] - values[i]
    a, b = slopes[i] * h[i], slopes[i + 1] * h[i]
    return values[i] + t * (a + t * ((3 * rise - 2 * a - b) + t * (a + b - 2 * rise)))


def _end_slope(h0, h1, secant0, secant1):
    slope = ((2 * h0 + h1) * secant0 - h0 * secant1) / (h0 + h1)
    slope = jnp.where(slope * secant0 <= 0, 0, slope)
    # More than three secants would leave the values of the first interval.
    steep = (secant0 * secant1 < 0) & (jnp.abs(slope) > 3 * jnp.abs(secant0))
    return jnp.where(steep, 3 * secant0, slope)
