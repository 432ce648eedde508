"""What lies below a face, as a recursion upwards carries it through slabs and graded layers.

It is stored as homogeneous coordinates (n, c11, c12, c22, det)/n, so that a clamped (n > 0 alone)
and a free face (det > 0 alone) are ordinary starting points and layers may have no thickness.

The antiplane part (shear waves with displacement along e_T, see `matrix`) obeys the scalar form of
the recursion of `slab`, with transmission 1/cosh(q d) and both factors tanh(q d), in units of
1/(μ q), μ the shear modulus. For thin layers on a rigid base, and for a free sheet with ν = 1/2,
c11 and c_T agree to the last digit, and C_xy is their difference. Therefore it is one more
coordinate, (1 - ν) c11 n_t - n c_t, with a recursion whose terms are all as small as the result.
The exception are several free sheets of one modulus with ν = 1/2: there C_xy is 0.5 (q d)² C_xx,
and its error is the rounding of C_xx.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Inexact

from ..blocks.bond import Give
from ..blocks.stack import Free, Rigid
from .column import Carried, Column, Face, Rule, face_in, scaled
from .slab import Compliance, factors, half_space, in_units, lower_face, split_of, times, upwards


class Below(NamedTuple):
    """Compliance of a face, by homogeneous coordinates, in units of 2/(E_r q) and 1/(μ q).

    In plane c = [[c11, c12], [c12, c22]]/n with determinant det/n; antiplane c_t/n_t, None where
    M_zz alone is asked for.
    """

    n: Inexact[Array, "*w"]
    c: Compliance
    n_t: Any = None
    c_t: Any = None
    split: Any = None  # (1 - ν) c11 n_t - n c_t


def base_face(column: Column, like: Array) -> Face:
    """Returns the state of the base's face, of the shape and dtype of `like`."""
    none, one = jnp.zeros_like(like), jnp.ones_like(like)
    # A rigid base has no compliance; that of a free face is infinite: n = 0, and det = 1.
    if isinstance(column.base, Rigid):
        return Face(Below(one, Compliance(none, none, none, none), one, none, none), one, one)
    if isinstance(column.base, Free):
        return Face(Below(none, Compliance(none, none, none, one), none, one, none), one, one)
    return jax.tree.map(lambda part: part + none, _half_space(*column.base))


def in_plane(face: Face) -> Face:
    """Returns a face without its antiplane part, which M_zz does not need."""
    return face._replace(state=Below(*face.state[:2]))


def _half_space(reduced: Array, e: Array) -> Face:
    one = jnp.ones_like(e)
    return face_in(Below(one, half_space(e), one, one, -(1 - e) / 2), reduced, e)


def _numbers(face: Face, reference: Array, inverse: Array) -> Carried:
    n, (c11, c12, c22, det), n_t, c_t, _ = face.state
    stiff, stiff_t = reference / face.reduced, reference / face.shear
    either = partial(jnp.where, inverse > 0)
    n, c = either(det, n), (either(c22, c11), either(-c12, c12), either(c11, c22), either(n, det))
    plane = in_units(Compliance(*(part / n for part in c)), either(1 / stiff, stiff))
    if n_t is None:
        return Carried(plane)
    return Carried(plane, either(c_t, n_t) ** -1 * either(n_t / stiff_t, c_t * stiff_t))


def _face(numbers: Carried, reference: Array, inverse: Array, e: Array) -> Face:
    (c11, c12, c22, det), antiplane, _ = numbers
    one, shear = jnp.ones_like(det), (1 + e) / 2  # 2 μ over E_r
    either = partial(jnp.where, inverse > 0)
    n = either(det, one)
    c = Compliance(either(c22, c11), either(-c12, c12), either(c11, c22), either(one, det))
    if antiplane is None:
        return face_in(Below(n, c), reference, e)
    n_t, c_t = either(antiplane / shear, one), either(one, antiplane * shear)
    return face_in(Below(n, c, n_t, c_t, shear * c.c11 * n_t - n * c_t), reference, e)


def _add(face: Face, x: Array, reduced: Array, e: Array) -> Face:
    """The state of a slab's upper face from that of its lower face."""
    above = face_in(None, reduced, e)
    ratio, s = reduced / face.reduced, factors(x, e)
    n, c, n_t, c_t, split = face.state
    c = in_units(c, ratio)
    h, m = lower_face(c, s, n)
    # The slab's own part, of 1/m as the rest.
    own = (times(part, by) for part, by in zip(s.q, (m, m, m, n), strict=True))
    plane = [a + b for a, b in zip(own, upwards(c, h, s), strict=True)]
    # Only ratios of coordinates matter; those of hundreds of layers would overflow.
    unit = _inverse_size((m, *plane))
    state = Below(unit * m, Compliance(*(unit * part for part in plane)))
    if n_t is not None:
        # Antiplane a slab is a scalar: both its factors are tanh x.
        ratio_t, tanh = above.shear / face.shear, jnp.tanh(x)
        c_t = ratio_t * c_t
        antiplane = (n_t + tanh * c_t, c_t + tanh * n_t)
        below = Below(n, c, n_t, c_t, ratio_t * split)
        split = _split(below, s, x, e, tanh, m, antiplane[0])
        unit_t = _inverse_size(antiplane)
        n_t, c_t = (unit_t * part for part in antiplane)
        state = state._replace(n_t=n_t, c_t=c_t, split=split * unit * unit_t)
    return above._replace(state=state)


def _join(face: Face, give: Give) -> Face:
    """The state above a bond: its springs are in series with what lies below."""
    (n, (c11, c12, c22, det), n_t, c_t, split), bond = face.state, scaled(give, face.reduced)
    (firm_n, give_n, firm_s, give_s), firm = bond, bond.normal_firmness * bond.shear_firmness
    along, across = firm_s * c11 + give_s * n, firm_n * c22 + give_n * n
    # det(c + diag(1/k_s, 1/k_n)), all of one sign.
    area = firm * det + give_s * across + firm_s * give_n * c11
    state = Below(firm * n, Compliance(firm_n * along, firm * c12, firm_s * across, area))
    if n_t is not None:
        # c11 and c_T get the same 1/k_s: what they differ by is unchanged.
        c_t = firm_s * c_t + give_s * face.shear / face.reduced * n_t
        state = state._replace(n_t=firm_s * n_t, c_t=c_t, split=firm * firm_s * split)
    return face._replace(state=state)


FULL = Rule(_add, _join, _half_space, _numbers, _face)
PLANE = FULL._replace(half_space=lambda reduced, e: in_plane(_half_space(reduced, e)))


def _split(below, s, x, e, tanh, n, n_t):
    """(1 - ν) c11 n_t - n c_t of the upper face, whose n and n_t are given; p = 1 - ν.

    p c11' = p q11 n + p (P H Pᵀ)_11 times n_t, less n times c_t' = tanh n_t + c_t/cosh², sorted so
    that what is alike is subtracted beforehand, in `split_of`.
    """
    _, (c11, c12, c22, det), one_t, c_t, split = below
    (clamped, free, p11_less_1), g = split_of(x, e), s.g
    p, both = (1 + e) / 2, g.det * det
    along = split + p * (one_t * det * g.c22 + tanh * c_t * c11)
    along = along - c_t * (g.c11 * c11 + 2 * g.c12 * c12 + g.c22 * c22)
    squared = p11_less_1 * (s.p11 + 1) + tanh * tanh  # p11² - 1/cosh²
    across = 2 * s.p11 * s.p12 * (n_t * c12 - one_t * det * g.c12)
    across = across + s.p12**2 * (n_t * c22 + one_t * det * g.c11)
    return (
        clamped * (n * n_t - both * tanh * c_t)
        + s.p11**2 * along
        + squared * c_t * (n - both)
        + p * across
        + free * det * c_t
    )


def _inverse_size(coordinates: tuple[Array, ...]) -> Any:
    """A constant that keeps homogeneous coordinates from overflowing."""
    parts = [part for x in coordinates for part in (x.real, x.imag)[: 1 + jnp.iscomplexobj(x)]]
    return 1 / sum(jnp.abs(jax.lax.stop_gradient(part)) for part in parts)
