"""M_zz of homogeneous layers, and its derivative without the chain rule through the recursion.

M_zz is the stationary value of a potential. Let v_i = (t, s) be the traction on the upper face of
layer i for a unit normal traction on the stack, and w_i the displacement of its lower face; v_0 is
the traction on the base. Then, with Q, G, P of `slab` and in one unit,

    M_zz = Φ = Σ_i [v_iᵀ Q_i v_i + 2 v_iᵀ P_i w_i - w_iᵀ G_i w_i] + v_0ᵀ c_0 v_0,

and M_zz has the derivative of Φ at fixed v and w by any property: a sum over layers. It
costs a second sweep, downwards, for v and w.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .column import cast_like, scan_layers, stable_shape
from .slab import Compliance, Slab, factors, hyperbolic, lower_face, reciprocal, release
from .upwards import PLANE, base_face, in_plane, inverse_size, met

# So few layers run faster unrolled; more compile faster in a loop.
_UNROLLED = 4


@jax.custom_jvp
def of_layers(q: Array, layers: tuple[Array, ...], base: Any) -> Array:
    """Returns M_zz in units of 2/(unit q) of layers (d, E_r, e), surface first, on a first axis.

    `base` as in `Column`.
    """

    def add(face, layer):
        return PLANE.add(face, q * layer[0], *layer[1:])

    face, count = _base_of(base, q), len(layers[0])
    if count > _UNROLLED:
        return _normal(scan_layers(add, face, layers, reverse=True))
    for i in reversed(range(count)):
        face = add(face, [part[i] for part in layers])
    return _normal(face)


@of_layers.defjvp
def _of_layers_jvp(primals, tangents):
    (q, layers, base), (d_q, d_layers, d_base) = primals, tangents
    d, reduced, e = layers
    x = q * d
    rows = x, reduced, e, hyperbolic(x)

    def up(face, layer):
        return cast_like(PLANE.add(face, *layer), like), face

    start, first = _base_of(base, q), jax.tree.map(lambda part: part[0], rows)
    like = stable_shape(lambda face: PLANE.add(face, *first), start)
    top, faces = jax.lax.scan(up, cast_like(start, like), rows, reverse=True)
    value = _normal(top)

    def down(v, given):
        face, (x, reduced, e, known) = given
        slab, (n, c) = factors(x, e, known), met(face, reduced)
        (h11, h12, h22), m = lower_face(c, slab, n)
        # Of thin free slabs m is so small that float32 has no square of it.
        unit = inverse_size((m,))
        inverse = unit * reciprocal(unit * m)
        t, s = _pushed(slab, v)
        w = (h11 * t + h12 * s) * inverse, (h12 * t + h22 * s) * inverse
        below = release(c, slab.g, (t, s), n, inverse)
        energy = _form(slab.q, v) + _form(slab.g, w)
        by_e = jax.jvp(lambda e: _potential(factors(x, e, known), v, w), (e,), (jnp.ones_like(e),))
        slopes = _by_thickness(e, below, w), -energy / reduced, by_e[1]
        return below, tuple(slope / reduced for slope in slopes)

    v, slopes = jax.lax.scan(down, (jnp.zeros_like(value), jnp.ones_like(value)), (faces, rows))
    changes = (q * d_layers[0] + d * d_q, *d_layers[1:])
    parts = [jnp.sum(a * b, axis=0) for a, b in zip(slopes, changes, strict=True)]
    change = functools.reduce(jnp.add, parts)
    if isinstance(base, tuple):

        def of_base(base):
            face = _base_of(base, q)
            return _form(face.state.c, v) / face.reduced

        change = change + jax.jvp(of_base, (base,), (d_base,))[1]
    return value, change


def _base_of(base, q):
    return in_plane(base_face(base, jnp.zeros_like(q)))


def _normal(face):
    return face.state.c.c22 / face.state.n / face.reduced


def _pushed(slab: Slab, v) -> tuple[Array, Array]:
    """Pᵀ v: the force of a traction on a clamped lower face."""
    return slab.p11 * v[0] + slab.p21 * v[1], slab.p12 * v[0] + slab.p22 * v[1]


def _form(c: Compliance, v) -> Array:
    """vᵀ c v."""
    return c.c11 * v[0] ** 2 + 2 * c.c12 * v[0] * v[1] + c.c22 * v[1] ** 2


def _potential(slab: Slab, v, w) -> Array:
    t, s = _pushed(slab, v)
    return _form(slab.q, v) + 2 * (t * w[0] + s * w[1]) - _form(slab.g, w)


def _by_thickness(e: Array, v, w) -> Array:
    """vᵀQ'v + 2 vᵀP'w - wᵀG'w of a thin slice, the derivatives being those at x = 0.

    A slice changes Φ by as much wherever it is put in. At the lower face, where traction and
    displacement are both small, thick layers lose nothing.
    """
    (t, s), (u, w), b = v, w, 1 + e
    shear = t * (2 / b * t - 2 * w)
    return shear + s * (2 * e / b**2 * s + 2 * (1 - e) / b * u) - 2 * u**2
