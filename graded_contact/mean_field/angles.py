"""Quadrature over the angle φ between a wave and the velocity.

cos φ = sech u turns a relaxation at any q v τ into poles at the distance π/2 from the real line of
u, where the trapezoidal rule converges as exp(-π²/h); u = 3 sinh s then makes the integrand decay
doubly exponentially.
"""

from functools import cache

import numpy as np

# The last angle, nearly across the velocity, represents those beyond it.
LAST_COSINE = 1 / np.cosh(15.0)
_STRETCH = 3.0


@cache
def angles(num_angles: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns cos φ at the nodes of a quarter turn, and weights that sum to the whole turn, 2π."""
    end = np.arcsinh(np.arccosh(1 / LAST_COSINE) / _STRETCH)
    s = end * np.arange(num_angles + 1) / num_angles
    cosine = 1 / np.cosh(_STRETCH * np.sinh(s))
    weight = 4 * (end / num_angles) * _STRETCH * np.cosh(s) * cosine
    weight[0] /= 2
    weight[-1] += 2 * np.pi - np.sum(weight)
    return cosine, weight
