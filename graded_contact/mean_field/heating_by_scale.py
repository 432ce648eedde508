"""The temperature of each scale of a mean field.

Waves q make the part dQ(q) = σ0 v dμ(q) of the heat of hysteresis. Their stress decays as exp(-qz),
so this heat is distributed over the depth as 2q exp(-2qz). The modulus of a scale p is that at the
mean temperature, weighted by 2p exp(-2pz) (B. N. J. Persson, J. Phys.: Condens. Matter 18 (2006)
7789, doi:10.1088/0953-8984/18/32/025, arXiv:cond-mat/0605273). In Persson's theory the heat flows
into the depth for the duration of a large contact. Here the temperature is steady in the frame of
the surface, as in the contact (`sliding/solve/heated.py`), and the heat of waves q is distributed
along the surface as the pressure with roughness up to q. Waves s have the part d⟨σ²⟩(s) of the
power of that pressure. The mean temperature over the contact, weighted by the pressure, is

    T(p) = ∫dQ(q) ∫_{s<q} d⟨σ²⟩(s)/σ0² G(s, q, p),      k = √(s² + i s v cos φ/D),
    G = Re⟨2q (1 + r(k + 2q))/[κ k (k + 2q)(1 + 2qr)(1 + kr)]⟩,      r = 1/(2p),

where ⟨⟩ is the mean over all directions φ (for a lay, too), and r = 0 is the surface. Heat Q at the
surface, distributed as the pressure, adds Q ∫d⟨σ²⟩/σ0² Re⟨1/[κ k (1 + kr)]⟩. Q is the heat of shear
less the heat that flows into the counterface; the latter makes the mean temperatures of both
surfaces equal. Temperatures are above the mean of each plane, which is the bulk temperature.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

from ..core.compilation import compiled
from ..core.derivative import largest, still
from ..core.display import shown
from ..core.fixed_point import attach_fixed_point, find_fixed_point
from ..sliding.case import Heating
from .angles import angles
from .diffusion import mean_square_growth

_INTERVALS = 12  # between the wavenumbers at which temperatures are computed
_ANGLES = 16
_RTOL = 1e-8  # tolerance of the temperatures


@shown()
class HeatedScales(eqx.Module):
    """The temperatures of the scales of a mean field.

    **Fields:**

    - `surface_rise`: temperature of the surface above the bulk [K], mean over the contact.
    - `rises`: temperature rises at the scale of each cut-off [K], shape `(n,)`.
    - `error`: change of the temperatures in the last step over the largest rise [1].
    """

    surface_rise: Float[Array, ""]
    rises: Float[Array, " n"]
    error: Float[Array, ""]


def find_rises(
    power: Callable, heating: Heating, given: Any, most: Array
) -> tuple[Array, Array, Array]:
    """Returns the rises of the surface and of the scales [K], their last change, if that is small.

    **Arguments:**

    - `power`: of `given` and rises: q [rad/m] and the diffusion x [1], the heat of hysteresis up to
      each q and the heat of shear [W/m²], and the speed [m/s].
    - `given`: all that has derivatives.
    - `most`: the highest rise that is sought [K].
    """

    def step(values, rises):
        heating, given = values
        # Iterates may lie below the bulk.
        q, diffusion, hysteresis, shear, speed = power(given, jnp.maximum(rises, 0))
        points = scales(q[0], q[-1])
        return _rises(heating, q, diffusion, hysteresis, shear, points, speed)

    values = heating, given
    fixed = still(values)
    # The surface and every scale.
    start = jnp.zeros(_INTERVALS + 2, heating.conductivity.dtype)
    rtol = jnp.maximum(_RTOL, 100 * jnp.finfo(start.dtype).eps).astype(start.dtype)
    point = find_fixed_point(lambda x, state: (step(fixed, x), state), start, None, rtol, most)
    rises = attach_fixed_point(step, values, jax.lax.stop_gradient(point.x))
    return rises, point.error, point.error <= rtol


@compiled
def _rises(heating, q, x, heat, shear_heat, scales, speed):
    """The rises at the surface and at the scales [K]."""
    conductivity, counterface = heating.conductivity, heating.counterface_conductivity
    middle = jnp.sqrt(q[1:] * q[:-1])
    made, power = jnp.diff(heat), jnp.diff(mean_square_growth(x))
    # A wave of the pressure, and the heat of waves that are shorter; half of it of the same ones.
    together = jnp.triu(power[:, None] * made, 1) + jnp.diag(power * made / 2)
    cosine, weight = (jnp.asarray(a, q.dtype) for a in angles(_ANGLES))
    weight = weight / (2 * np.pi)
    flow = middle[:, None] * speed * cosine / heating.diffusivity
    k = jnp.sqrt(middle[:, None] ** 2 + 1j * flow)  # waves, angles
    twice, ks = 2 * middle, k[:, None]  # waves, heats, angles

    def at(r):
        wide = twice[:, None]
        green = wide * (1 + r * (ks + wide)) / (ks * (ks + wide) * (1 + wide * r) * (1 + ks * r))
        own = jnp.sum(together * (green.real @ weight)) / conductivity
        return own, jnp.sum(power * ((1 / (k * (1 + k * r))).real @ weight)) / conductivity

    own, by_flux = jax.lax.map(at, jnp.append(0.0, 1 / (2 * scales)))
    there = jnp.sum(power / middle)
    # Heat divides so that both surfaces have the same mean temperature.
    surface = own[0] + shear_heat * by_flux[0]
    left = counterface * surface / (counterface * by_flux[0] + there)
    return own + (shear_heat - left) * by_flux


def scales(low: Float[Array, ""], high: Float[Array, ""]) -> Float[Array, " m"]:
    """Returns the wavenumbers at which temperatures are computed [rad/m]."""
    t = jnp.asarray(_knots()[0], low.dtype)
    return low * (high / low) ** ((1 + t) / 2)


def between_scales(values: Float[Array, " m"], q: Float[Array, " n"]) -> Float[Array, " n"]:
    """Returns values at `q`, from the lowest to the highest, between those at `scales`.

    A polynomial in log q, by Clenshaw's sum, that does not leave the range of the values.
    """
    t = 2 * jnp.log(q / q[0]) / jnp.log(q[-1] / q[0]) - 1
    first, *rest = jnp.asarray(_knots()[1], values.dtype) @ values
    one = two = jnp.zeros_like(t)
    for coefficient in reversed(rest):
        one, two = 2 * t * one - two + coefficient, one
    return jnp.clip(first + t * one - two, -largest(-values), largest(values))


@cache
def _knots() -> tuple[np.ndarray, np.ndarray]:
    """Knots in [-1, 1], and the matrix from values there to Chebyshev's coefficients."""
    t = -np.cos(np.pi * np.arange(_INTERVALS + 1) / _INTERVALS)
    return t, np.linalg.inv(chebyshev.chebvander(t, _INTERVALS))
