"""One homogeneous slab under a wave of surface traction, by bounded factors without cancellation.

In the frame of the wavevector, with z out of the body, take (t, s) = (-iσ_L, σ_3) and
(U, w) = (-iw_L, w_3): then everything is real for real moduli. A slab is described by the
compliance Q of its upper face when the lower is clamped, the stiffness G of its lower face when
the upper is free, and the transmission P between them. With the compliance c of what lies
below, the upper face has

    c' = Q + P c (1 + G c)⁻¹ Pᵀ,

all in units of 2/(E_r q) with E_r = E/(1 - ν²) of the slab. Q, G, P are 2×2; their entries are
sums of decaying exponentials in x = q d, so that no term grows for thick slabs. The small
differences of thin slabs are series, so that no terms cancel. The determinant of c is computed
separately: for a free laminate c11 c22 - c12² has no correct digit.

The factors follow from the quasi-static Navier equations (the paper's slab matrices M1 to M4
for constant ν, rearranged); `docs/theory/response.md` derives them.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

# 2 (sinh x - x) = x³ Σ_k 2 x^2k/(2k+3)!; 13 terms reach rounding at x = 2.
_PSI_SERIES = [2.0 / float(np.prod(np.arange(1.0, 2 * k + 4))) for k in range(13)]
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


def _series(coefficients, first, squared):
    """Σ_k coefficients[k] squared^(first + k)."""
    series = jnp.full_like(squared, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        series = series * squared + coefficient
    return squared**first * series


class Compliance(NamedTuple):
    """In-plane compliance [[c11, c12], [c12, c22]] of a face, and its determinant.

    In units of 2/(E_r q), and of its square for the determinant.
    """

    c11: Inexact[Array, "*w"]
    c12: Inexact[Array, "*w"]
    c22: Inexact[Array, "*w"]
    det: Inexact[Array, "*w"]


class Slab(NamedTuple):
    """Factors Q, G (its inverse is a compliance) and P = [[p11, p12], [p21, p22]] of one slab."""

    q: Compliance
    g: Compliance
    p11: Inexact[Array, "*w"]
    p12: Inexact[Array, "*w"]
    p21: Inexact[Array, "*w"]
    p22: Inexact[Array, "*w"]


def plane_strain(modulus: Array, poisson: Array, unit: Any = 1.0) -> tuple[Array, Array]:
    """Returns E/(1 - ν²) in a unit of moduli, and e = 1 - 2ν."""
    return times(reciprocal(unit * (1 - poisson * poisson)), modulus), 1 - 2 * poisson


def in_units(c: Compliance, ratio: Inexact[Array, "..."]) -> Compliance:
    """Returns a compliance in units of 2/(E_r q) of another E_r, `ratio` times as large."""
    c11, c12, c22 = (times(ratio, part) for part in c[:3])
    return Compliance(c11, c12, c22, times(ratio * ratio, c.det))


def factors(x: Array, e: Array, known: Hyperbolic | None = None) -> Slab:
    """Returns the factors of a slab of x = q d [1] and `e` = 1 - 2ν; real for real `e`.

    `known` is `hyperbolic(x)` if it is at hand.
    """
    x = jnp.minimum(x, DEEP)
    e1, om, psi = hyperbolic(x) if known is None else known
    e2 = e1 * e1
    # Hyperbolic functions times 4 e^-2x.
    s2, sc, x1, x2 = om * om, om * (1 + e2), 4 * x * e2, 4 * x * x * e2
    # 2 e^-2x (sinh 2x - 2x), from sinh 2x - 2x = 2 (sinh x - x) + 2 sinh x (cosh x - 1)
    f1 = 2 * e1 * psi + om * s2 / (1 + e1) ** 2
    f2 = psi * (om + 2 * x * e1)
    delta = 4 * e2 * (1 + e) ** 2 + x2 + (1 + 2 * e) * s2
    b = 1 + e
    inverse = reciprocal(delta)
    p = 2 * b * e1 * inverse
    # Of thin slabs P is near 1, and rounded there it would drift in a stack of hundreds.
    thin = x < 1
    even = 2 * b * b * e1 * s2 / (1 + e1) ** 2 - x2 - (1 + 2 * e) * s2
    odd = 2 * b * e1 * x * om
    return Slab(
        Compliance(
            ((1 + 2 * e) * sc + x1) * inverse,
            (x2 - (1 + 2 * e) * e * s2) * inverse / b,
            (2 * e * sc + f1) * inverse,
            (4 * e * b * s2 + f2) * inverse / b**2,
        ),
        Compliance(
            b**2 * (sc + x1) * inverse,
            -b * (x2 + e * s2) * inverse,
            b**2 * f1 * inverse,
            b**2 * f2 * inverse,
        ),
        p11=jnp.where(thin, 1 + (even - odd) * inverse, p * (b * (1 + e2) - x * om)),
        p12=-p * (x * (1 + e2) + e * om),
        p21=p * (x * (1 + e2) - e * om),
        p22=jnp.where(thin, 1 + (even + odd) * inverse, p * (b * (1 + e2) + x * om)),
    )


def release(c: Compliance, g: Compliance, force, one, inverse) -> tuple[Array, Array]:
    """Returns the traction at a face from the force on it if it is clamped: (1 + G c/one)⁻¹ force.

    That is [one + adj c adj G] force/n, n/one being the determinant, and `inverse` 1/n.
    """
    t, n = force
    u, w = times(g.c22, t) - times(g.c12, n), times(g.c11, n) - times(g.c12, t)
    return (
        (one * t + times(c.c22, u) - times(c.c12, w)) * inverse,
        (one * n + times(c.c11, w) - times(c.c12, u)) * inverse,
    )


def lower_face(c: Compliance, slab: Slab, one: Array | int = 1) -> tuple[Any, Array]:
    """Returns m H, H = c/one (1 + G c/one)⁻¹, and m = one det(1 + G c/one).

    c is in units of the slab. Its entries and its determinant are over `one`.
    """
    (c11, c12, c22, det), g = c, slab.g
    m = one + times(g.c11, c11) + times(2 * g.c12, c12) + times(g.c22, c22) + times(g.det, det)
    return (c11 + times(g.c22, det), c12 - times(g.c12, det), c22 + times(g.c11, det)), m


def upwards(c: Compliance, h: Sequence[Array], s: Slab) -> Compliance:
    """Returns P H Pᵀ, which adds to Q, and the part of c in the determinant of Q, but for 1/m."""
    h11, h12, h22 = h
    a11, a12 = times(s.p11, h11) + times(s.p12, h12), times(s.p11, h12) + times(s.p12, h22)
    a21, a22 = times(s.p21, h11) + times(s.p22, h12), times(s.p21, h12) + times(s.p22, h22)
    return Compliance(
        times(s.p11, a11) + times(s.p12, a12),
        times(s.p21, a11) + times(s.p22, a12),
        times(s.p21, a21) + times(s.p22, a22),
        times(s.q.c22, c.c11) + times(2 * s.q.c12, c.c12) + times(s.q.c11, c.c22) + c.det,
    )


def times(factor, value):
    """A product that does not promote a real factor of a complex value to a complex one."""
    if jnp.iscomplexobj(value) and not jnp.iscomplexobj(factor):
        return jax.lax.complex(*jnp.broadcast_arrays(factor * value.real, factor * value.imag))
    return factor * value


def reciprocal(value):
    """1/z without the scaling of a general complex division: |z|² stays in range here."""
    if not jnp.iscomplexobj(value):
        return 1 / value
    squared = value.real**2 + value.imag**2
    return jax.lax.complex(value.real / squared, -value.imag / squared)
