"""One homogeneous slab under a wave of surface traction: bounded factors that never cancel.

In the frame of the wavevector, with z out of the body, take (t, s) = (-iσ_L, σ_3) and
(U, w) = (-iw_L, w_3): then everything is real for real moduli. A slab is described by the
compliance Q of its upper face when the lower is clamped, the stiffness G of its lower face when
the upper is free, and the transmission P between them. With the compliance c of what lies
below, the upper face has

    c' = Q + P c (1 + G c)⁻¹ Pᵀ,

all in units of 2/(E_r q) with E_r = E/(1 - ν²) of the slab. Q, G, P are 2×2; their entries are
sums of decaying exponentials in x = q d, so that nothing grows for thick slabs, and the small
differences of thin ones are written out as series, so that nothing cancels. The determinant of
c is carried along: for a free laminate the product c11 c22 - c12² loses every digit of it.

The factors are those of the quasi-static Navier equations (the paper's slab matrices M1 to M4
for constant ν, rearranged); `docs/theory.md` derives them.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

# ψ(y) = 2 e^-y (sinh y - y) = e^-y y³ Σ_k 2 y^2k/(2k+3)!; 13 terms reach rounding at y = 2.
_PSI_SERIES = [2.0 / float(np.prod(np.arange(1.0, 2 * k + 4))) for k in range(13)]
# e^-350 squared underflows to nothing in float64; larger q d would only make inf × 0.
_DEEP = 350.0


class Compliance(NamedTuple):
    """In-plane compliance [[c11, c12], [c12, c22]] of a face, and its determinant.

    In units of 2/(E_r q), and of its square for the determinant.
    """

    c11: Inexact[Array, "*w"]
    c12: Inexact[Array, "*w"]
    c22: Inexact[Array, "*w"]
    det: Inexact[Array, "*w"]


class Slab(NamedTuple):
    """Factors Q, G, P = [[p11, p12], [p21, p22]] and determinants of one slab (see above)."""

    q11: Inexact[Array, "*w"]
    q12: Inexact[Array, "*w"]
    q22: Inexact[Array, "*w"]
    det_q: Inexact[Array, "*w"]
    g11: Inexact[Array, "*w"]
    g12: Inexact[Array, "*w"]
    g22: Inexact[Array, "*w"]
    det_g: Inexact[Array, "*w"]
    p11: Inexact[Array, "*w"]
    p12: Inexact[Array, "*w"]
    p21: Inexact[Array, "*w"]
    p22: Inexact[Array, "*w"]


def half_space(e: Inexact[Array, "..."]) -> Compliance:
    """Returns the compliance of a half space; `e` = 1 - 2ν."""
    one = jnp.ones_like(e)
    return Compliance(one, -e / (1 + e), one, (1 + 2 * e) / (1 + e) ** 2)


def clamped(slab: Slab) -> Compliance:
    """Returns the compliance of a slab whose lower face is held."""
    return Compliance(slab.q11, slab.q12, slab.q22, slab.det_q)


def free(x: Float[Array, "*#w"], e: Inexact[Array, "*#w"]) -> Compliance:
    """Returns the compliance of a slab whose lower face carries no traction."""
    t = _terms(x, e)
    return Compliance(
        t.f1 / t.f2,
        -(t.x2 + e * t.s2) / ((1 + e) * t.f2),
        (t.sc + t.x1) / t.f2,
        t.delta / ((1 + e) ** 2 * t.f2),
    )


def factors(x: Float[Array, "*#w"], e: Inexact[Array, "*#w"]) -> Slab:
    """Returns the factors of a slab of x = q d [1] and `e` = 1 - 2ν; real for real `e`."""
    t = _terms(x, e)
    x, e1, e2, om = t.x, t.e1, t.e2, t.om
    b = 1 + e
    p = 2 * b * e1 / t.delta
    return Slab(
        q11=((1 + 2 * e) * t.sc + t.x1) / t.delta,
        q12=(t.x2 - (1 + 2 * e) * e * t.s2) / (b * t.delta),
        q22=(2 * e * t.sc + t.f1) / t.delta,
        det_q=(4 * e * b * t.s2 + t.f2) / (b**2 * t.delta),
        g11=b**2 * (t.sc + t.x1) / t.delta,
        g12=-b * (t.x2 + e * t.s2) / t.delta,
        g22=b**2 * t.f1 / t.delta,
        det_g=b**2 * t.f2 / t.delta,
        p11=p * (b * (1 + e2) - x * om),
        p12=-p * (x * (1 + e2) + e * om),
        p21=p * (x * (1 + e2) - e * om),
        p22=p * (b * (1 + e2) + x * om),
    )


def stack_on(below: Compliance, slab: Slab, ratio: Inexact[Array, "..."]) -> Compliance:
    """Returns the compliance of a slab's upper face, with `below` bonded to its lower face.

    `ratio` is E_r of the slab over E_r in whose units `below` is given.
    """
    c11, c12, c22 = (ratio * c for c in below[:3])
    det = ratio * ratio * below.det
    s = slab
    n = 1 + s.g11 * c11 + 2 * s.g12 * c12 + s.g22 * c22 + s.det_g * det
    h11, h12, h22 = c11 + det * s.g22, c12 - det * s.g12, c22 + det * s.g11
    # a = P H, then (P H Pᵀ)/n
    a11, a12 = s.p11 * h11 + s.p12 * h12, s.p11 * h12 + s.p12 * h22
    a21, a22 = s.p21 * h11 + s.p22 * h12, s.p21 * h12 + s.p22 * h22
    return Compliance(
        s.q11 + (a11 * s.p11 + a12 * s.p12) / n,
        s.q12 + (a11 * s.p21 + a12 * s.p22) / n,
        s.q22 + (a21 * s.p21 + a22 * s.p22) / n,
        (s.det_q + s.q22 * c11 + 2 * s.q12 * c12 + s.q11 * c22 + det) / n,
    )


class _Terms(NamedTuple):
    """Hyperbolic functions of a slab, all times 4 e^-2x."""

    x: Float[Array, "*w"]
    e1: Float[Array, "*w"]
    e2: Float[Array, "*w"]
    om: Float[Array, "*w"]
    s2: Float[Array, "*w"]
    sc: Float[Array, "*w"]
    x1: Float[Array, "*w"]
    x2: Float[Array, "*w"]
    f1: Float[Array, "*w"]
    f2: Float[Array, "*w"]
    delta: Inexact[Array, "*w"]


def _terms(x, e) -> _Terms:
    x = jnp.minimum(x, _DEEP)
    e1 = jnp.exp(-x)
    e2 = e1 * e1
    om = -jnp.expm1(-2 * x)
    s2 = om * om
    x2 = 4 * x * x * e2
    return _Terms(
        x=x,
        e1=e1,
        e2=e2,
        om=om,
        s2=s2,
        sc=om * (1 + e2),
        x1=4 * x * e2,
        x2=x2,
        f1=_psi(2 * x, e2),
        f2=_psi(x, e1) * (om + 2 * x * e1),
        delta=4 * e2 * (1 + e) ** 2 + x2 + (1 + 2 * e) * s2,
    )


def _psi(y, decay):
    """ψ(y) = 2 e^-y (sinh y - y), given e^-y."""
    small = y < 2
    near, far = jnp.where(small, y, 1), jnp.where(small, 2, y)
    squared = near * near
    series = jnp.zeros_like(y)
    for coefficient in reversed(_PSI_SERIES):
        series = series * squared + coefficient
    return jnp.where(small, decay * near * squared * series, -jnp.expm1(-2 * far) - 2 * far * decay)
