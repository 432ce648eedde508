"""The recursion to the tractions and displacements at a depth of a stack.

The stack is cut at the depth. The part below the cut has a compliance c. The part above has a force
v, which the surface traction would exert on a clamped face, and the stiffness G of that face when
the surface is free. The traction at the cut is (1 + G c)⁻¹ v and the displacement c (1 + G c)⁻¹ v.
A recursion upwards gives c, as for the surface compliance; the same recursion upside down gives G
and v. Both use only the factors of `slab`, whose transmission decays: no term grows in thick
layers.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ..blocks.stack import GradedLayer, HalfSpace, Stack, concatenated, interface_depths
from .column import AddGraded, Column, Face, Rule, Run, climb_through, column_of, face_in, in_rows
from .slab import Compliance, Slab, factors, in_units, lower_face, reciprocal, release, upwards
from .upwards import FULL, base_face

Side = Literal["above", "below"]


class StateAbove(NamedTuple):
    """Stiffness of the part above a cut, in plane and antiplane, and the force (t, s, T)."""

    plane: Compliance
    antiplane: Array
    traction: tuple[Array, ...]


def depth_climb(
    stack: Stack, q: Array, omega: Array, traction: tuple[Array, ...], depth: Array, side: Side
) -> tuple[Callable[[AddGraded | None], tuple[Array, ...]], tuple[Array, ...], Array]:
    """Returns the recursion to (t, s, σ_T) [Pa] and (U, w, w_T) at a depth, and the material there.

    **Arguments:**

    - `q`, `omega`, `depth`: wavenumbers [rad/m], frequencies [rad/s] and z [m], of equal rank.
    - `traction`: (t, s, T) [Pa] at the surface, in the frame of `slab`.
    - `side`: the layer that an interface is meant to lie in.

    **Returns:** a function of what adds a graded layer, whose displacements are in units of
    2/(unit q); E_r over the unit and e = 1 - 2ν of the material; and the unit [Pa].
    """
    column = column_of(stack, q, omega)
    above, place = _cut(stack, depth, side)
    below = in_rows([layer.thickness for layer in stack.layers], depth) - above[:-1]
    heights = {
        i: 1 - above[i] / jnp.where(layer.thickness > 0, layer.thickness, 1)
        for i, layer in enumerate(stack.layers)
        if isinstance(layer, GradedLayer)
    }
    zero = jnp.zeros(jnp.broadcast_shapes(q.shape, depth.shape), q.dtype)
    one, nothing = jnp.ones_like(zero), Compliance(zero, zero, zero, zero)
    # Nothing lies above the surface: no stiffness, and the traction as it is.
    surface = Face(StateAbove(nothing, zero, traction), one, one)

    def climb(add_graded):
        start = base_face(column.base, zero)
        lower = climb_through(column, start, FULL, add_graded, below, heights)
        whole = _with_base(column)
        upper = climb_through(whole, surface, _ABOVE, add_graded, above, heights)
        return _joined(upper, lower)

    return climb, _material(column, heights, place), column.unit


def _cut(stack, depth, side):
    """The thickness of each layer above a depth [m], and last of the base.

    And the place of the layer that the depth lies in.
    """
    thickness = in_rows([layer.thickness for layer in stack.layers], depth)
    tops = in_rows(jnp.append(0, interface_depths(stack)), depth)
    passed = depth >= tops if side == "below" else depth > tops
    # A rigid base is no place: at its face the depth is in the layer above.
    last = len(stack.layers) - (not isinstance(stack.base, HalfSpace))
    place = jnp.clip(jnp.sum(passed, axis=0) - 1, 0, last)
    # All of a layer that ends above: a difference of depths would be rounded.
    above = jnp.where(depth >= tops[1:], thickness, jnp.clip(depth - tops[:-1], 0, thickness))
    # A layer may be so thin that it begins and ends at this depth.
    above = jnp.where(in_rows(range(len(stack.layers)), depth) > place, 0, above)
    return jnp.concatenate([above, jnp.maximum(depth - tops[-1:], 0)]), place


def _with_base(column: Column) -> Column:
    """The column with its half space as one more layer: at a depth in it, its upper part is one."""
    if not isinstance(column.base, tuple):
        return column
    runs, (reduced, e) = column.runs, (part[None] for part in column.base)
    last = runs[-1] if runs else None
    if not isinstance(last, Run):
        base = Run(slice(-1, None), in_rows([0], column.q), reduced, e)
        return column._replace(runs=(*runs, base))
    # One scan for all.
    reduced, e = jnp.concatenate([last.reduced, reduced]), jnp.concatenate([last.e, e])
    whole = Run(slice(last.members.start, None), last.thickness, reduced, e)
    return column._replace(runs=(*runs[:-1], whole))


def _material(column, heights, place):
    """E_r and e at the depth, of the layer in this place or of the base."""
    parts = [
        run[2:4] if isinstance(run, Run) else [one[None] for one in run.moduli(heights[run.number])]
        for run in column.runs
    ]
    if isinstance(column.base, tuple):
        parts.append([one[None] for one in column.base])
    moduli = [concatenated(rows, place.ndim) for rows in zip(*parts, strict=True)]
    here = place == in_rows(range(len(moduli[0])), place)
    return tuple(jnp.sum(jnp.where(here, rows, 0), axis=0) for rows in moduli)


def _add(face: Face, x: Array, reduced: Array, e: Array) -> Face:
    """The state of a slab's lower face from the state of its upper face."""
    lower, s = face_in(None, reduced, e), factors(x, e)
    g, g_t, (t, n, across) = face.state
    g, g_t = in_units(g, face.reduced / reduced), g_t * face.shear / lower.shear
    # Upside down, compliances and stiffnesses change places.
    turned = Slab(s.g, s.q, s.p11, s.p21, s.p12, s.p22)
    h, m = lower_face(g, turned)
    inverse = reciprocal(m)
    up = upwards(g, [part * inverse for part in h], turned)
    a, b, c = (own + part for own, part in zip(s.g[:3], up[:3], strict=True))
    stiffness = Compliance(a, b, c, (s.g.det + up.det) * inverse)
    t, n = release(s.q, g, (t, n), 1, inverse)
    # 1/cosh x = 2 e^-x/(1 + e^-2x) does not overflow.
    tanh, decay = jnp.tanh(x), jnp.exp(-x)
    inverse_t = 1 / (1 + tanh * g_t)
    traction = (
        s.p11 * t + s.p21 * n,
        s.p12 * t + s.p22 * n,
        2 * decay / (1 + decay * decay) * across * inverse_t,
    )
    return lower._replace(state=StateAbove(stiffness, (tanh + g_t) * inverse_t, traction))


_ABOVE = Rule(_add, None)


def _joined(face: Face, below: Face) -> tuple[Array, ...]:
    """Returns the tractions t, s, σ_T [Pa] and U, w, w_T [Pa, in units of 2/q] at the cut."""
    (g, g_t, (t, n, across)), (one, c, one_t, c_t) = face.state, below.state
    g, g_t = in_units(g, face.reduced / below.reduced), face.shear / below.shear * g_t
    (c11, c12, c22, det) = c
    inverse = 1 / (one + g.c11 * c11 + 2 * g.c12 * c12 + g.c22 * c22 + g.det * det)
    # c (1 + G c)⁻¹ = (c + det c adj G)/n
    h11, h12, h22 = c11 + det * g.c22, c12 - det * g.c12, c22 + det * g.c11
    u, w = h11 * t + h12 * n, h12 * t + h22 * n
    scale, released = inverse / below.reduced, across / (one_t + g_t * c_t)
    t, n = release(c, g, (t, n), one, inverse)
    return t, n, one_t * released, u * scale, w * scale, c_t * released / below.shear
