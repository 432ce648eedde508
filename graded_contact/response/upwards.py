"""The recursion upwards: the compliance of all that lies below a face.

It is stored as homogeneous coordinates (n, c11, c12, c22, det)/n, so that a clamped (n > 0 alone)
and a free face (det > 0 alone) are ordinary starting points and layers may have no thickness.

The antiplane part (shear waves with displacement along e_T, see `compliance`) obeys the scalar form
of the recursion of `slab`, with transmission 1/cosh(q d) and both factors tanh(q d), in units of
1/(μ q), μ the shear modulus.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Inexact

from ..blocks.stack import Free, Rigid
from .column import Face, Rule, face_in
from .slab import Compliance, factors, in_units, lower_face, times, upwards


class Below(NamedTuple):
    """Compliance of a face, by homogeneous coordinates, in units of 2/(E_r q) and 1/(μ q).

    In plane c = [[c11, c12], [c12, c22]]/n with determinant det/n; antiplane c_t/n_t, None where
    M_zz alone is asked for.
    """

    n: Inexact[Array, "*w"]
    c: Compliance
    n_t: Any = None
    c_t: Any = None


def base_face(base: Any, like: Array) -> Face:
    """Returns the state of the face of a base of `Column`, of the shape and dtype of `like`."""
    none, one = jnp.zeros_like(like), jnp.ones_like(like)
    # A rigid base has no compliance, a free face an infinite one: n = 0, and det = 1.
    if isinstance(base, Rigid):
        return Face(Below(one, Compliance(none, none, none, none), one, none), one, one)
    if isinstance(base, Free):
        return Face(Below(none, Compliance(none, none, none, one), none, one), one, one)
    # Moduli keep their shape: often one for each row of waves.
    face = _half_space(*base)
    return face._replace(state=jax.tree.map(lambda part: part + none, face.state))


def in_plane(face: Face) -> Face:
    """Returns a face without its antiplane part, which M_zz does not need."""
    return face._replace(state=Below(*face.state[:2]))


def _half_space(reduced: Array, e: Array) -> Face:
    one = jnp.ones_like(e)
    c = Compliance(one, -e / (1 + e), one, (1 + 2 * e) / (1 + e) ** 2)
    return face_in(Below(one, c, one, one), reduced, e)


def met(face: Face, reduced: Array) -> tuple[Array, Compliance]:
    """Returns n and c of a face, in units of the slab above it of this E_r."""
    n, c = face.state[:2]
    # Only ratios of coordinates matter; over hundreds of layers the coordinates would overflow. The
    # given ones are at hand: the size of the new ones would be computed again for each of them.
    unit = inverse_size((n, *c))
    return unit * n, in_units(Compliance(*(unit * part for part in c)), reduced / face.reduced)


@jax.jit  # traced once for all layers
def _add(face: Face, x: Array, reduced: Array, e: Array, known: Any = None) -> Face:
    """The state of the upper face from the state of the lower one; `known` as in `factors`."""
    above, s = face_in(None, reduced, e), factors(x, e, known)
    n, c = met(face, reduced)
    _, _, n_t, c_t = face.state
    h, m = lower_face(c, s, n)
    # The slab's own part, of 1/m as the rest.
    own = (times(part, by) for part, by in zip(s.q, (m, m, m, n), strict=True))
    plane = [a + b for a, b in zip(own, upwards(c, h, s), strict=True)]
    state = Below(m, Compliance(*plane))
    if n_t is not None:
        # Antiplane a slab is a scalar: both its factors are tanh x.
        ratio_t, tanh = above.shear / face.shear, jnp.tanh(x)
        unit_t = inverse_size((n_t, c_t))
        n_t, c_t = unit_t * n_t, unit_t * ratio_t * c_t
        state = state._replace(n_t=n_t + tanh * c_t, c_t=c_t + tanh * n_t)
    return above._replace(state=state)


FULL = Rule(_add, _half_space)
# Without the antiplane part, for M_zz alone.
PLANE = Rule(_add, lambda reduced, e: in_plane(_half_space(reduced, e)))


def inverse_size(coordinates: tuple[Array, ...]) -> Any:
    """A constant that keeps homogeneous coordinates from overflowing."""
    parts = [part for x in coordinates for part in (x.real, x.imag)[: 1 + jnp.iscomplexobj(x)]]
    return 1 / sum(jnp.abs(jax.lax.stop_gradient(part)) for part in parts)
