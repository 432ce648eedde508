"""The recursion to the tractions and displacements at a depth of a stack.

The stack is cut at the depth. The part below the cut has a compliance c. The part above has a force
v, which the surface traction would exert on a clamped face, and the stiffness G of that face when
the surface is free. The traction at the cut is (1 + G c)⁻¹ v and the displacement c (1 + G c)⁻¹ v.
A recursion upwards gives c, as for the surface compliance; the same recursion upside down gives G
and v. Both use only the factors of `slab`, whose transmission decays: no term grows in thick
layers.
"""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from .grading import AddGraded, Carried, Rule, climb_through, column_of
from .matrix import RULE as BELOW
from .matrix import Face, base_face, zeros_for
from .profile import moduli_at
from .slab import Compliance, Slab, factors, in_units, plane_strain, stack_on
from .stack import Free, GradedLayer, Rigid, Stack

Side = Literal["above", "below"]


class Local(NamedTuple):
    """At a depth: E_r over a unit [Pa] and e = 1 - 2ν of the material, of full shape."""

    reduced: Inexact[Array, "*w"]
    e: Inexact[Array, "*w"]
    unit: Float[Array, ""]


def depth_climb(
    stack: Stack,
    q: Float[Array, "..."],
    omega: Float[Array, "..."],
    traction: tuple[Array, Array, Array],
    depth: Float[Array, "..."],
    side: Side,
) -> tuple[Callable[[AddGraded | None], tuple[Array, ...]], Local]:
    """Returns the recursion to (t, s, σ_T) [Pa] and (U, w, w_T) at a depth, and the material there.

    **Arguments:**

    - `q`, `omega`, `depth`: wavenumbers [rad/m], frequencies [rad/s] and z [m], of equal rank.
    - `traction`: (t, s, T) [Pa] at the surface, in the frame of `slab`.
    - `side`: the layer that an interface is meant to lie in.

    **Returns:** a function of what adds a graded layer, whose displacements are in units of
    2/(unit q); and the material.
    """
    column = column_of(stack, q, omega)
    above, reached = _cut(stack, depth, side)
    below = [layer.thickness - over for layer, over in zip(stack.layers, above, strict=False)]
    heights = {
        i: 1 - above[i] / jnp.where(layer.thickness > 0, layer.thickness, 1)
        for i, layer in enumerate(stack.layers)
        if isinstance(layer, GradedLayer)
    }
    like = zeros_for(column, depth)
    full = sum(traction) + like + 0j
    loads = (jnp.broadcast_to(part, full.shape).astype(full.dtype) for part in traction)
    one = jnp.ones_like(like)
    surface = _Face(_Above(Compliance(like, like, like, like), like, *loads), one, one)

    def climb(add_graded):
        start = base_face(column, like)
        lower = climb_through(column, start, BELOW, add_graded, parts=below, heights=heights)
        upper = climb_through(column, surface, _ABOVE, add_graded, parts=above, heights=heights)
        if not isinstance(column.base, Rigid | Free):
            upper = _ABOVE.add(upper, q * above[-1], *column.base)
        return _joined(upper, lower)

    local = _material(stack, column, omega, heights, reached)
    reduced, e = (jnp.broadcast_to(part, like.shape) for part in local)
    return climb, Local(reduced, e, column.unit)


def _cut(stack, depth, side):
    """What lies above a depth of each layer [m], and at the end of the base.

    And whether the depth lies in each layer, or the base, or further down.
    """
    top, above, reached = jnp.zeros((), depth.dtype), [], []
    for layer in stack.layers:
        reached.append(depth >= top if side == "below" else depth > top)
        thickness, bottom = layer.thickness, top + layer.thickness
        inside = jnp.clip(depth - top, 0, thickness)
        above.append(jnp.where(depth >= bottom, thickness, inside))
        top = bottom
    reached.append(depth >= top if side == "below" else depth > top)
    return [*above, jnp.maximum(depth - top, 0)], reached


def _material(stack, column, omega, heights, reached):
    """E_r and e at the depth."""
    materials = []
    for run in column.runs:
        if isinstance(run, int):
            modulus, poisson = moduli_at(stack.layers[run].profile, heights[run], omega)
            materials.append(plane_strain(modulus / column.unit, poisson))
        else:
            materials += zip(run.reduced, run.e, strict=True)
    if not isinstance(column.base, Rigid | Free):
        materials.append(column.base)
    found, *lower = materials
    for there, here in zip(reached[1:], lower, strict=False):
        found = tuple(jnp.where(there, a, b) for a, b in zip(here, found, strict=True))
    return found


class _Above(NamedTuple):
    """What lies above a face: stiffness with the surface free, and force on a clamped face.

    The stiffness in units of E_r q/2 and, antiplane, μ q; the force is a traction [Pa], of its
    in-plane components (t, s) = (-iσ_L, σ_3) in the frame of `slab`.
    """

    stiffness: Compliance
    stiffness_antiplane: Inexact[Array, "*w"]
    force_t: Inexact[Array, "*w"]
    force_s: Inexact[Array, "*w"]
    force_antiplane: Inexact[Array, "*w"]


class _Face(NamedTuple):
    """What lies above a face, in units of its E_r and 2 μ."""

    above: _Above
    reduced: Inexact[Array, "..."]
    shear: Inexact[Array, "..."]


def _add(face: _Face, x: Array, reduced: Array, e: Array, _: Any = None) -> _Face:
    shear = reduced * (1 + e) / 2
    ratio, ratio_t = face.reduced / reduced, face.shear / shear
    return _Face(_lower(face.above, factors(x, e), x, ratio, ratio_t), reduced, shear)


def _carried(face: _Face, reference: Array, _: bool) -> Carried:
    stiffness = in_units(face.above.stiffness, face.reduced / reference)
    antiplane = face.above.stiffness_antiplane * face.shear / reference
    return Carried(stiffness, antiplane, tuple(face.above[2:]))


def _face(carried: Carried, reference: Array, _: bool, e: Array) -> _Face:
    shear = reference * (1 + e) / 2
    antiplane = carried.antiplane * reference / shear
    return _Face(_Above(carried.plane, antiplane, *carried.traction), reference, shear)


_ABOVE = Rule(_add, None, _carried, _face)


def _lower(above: _Above, slab: Slab, x: Array, ratio: Array, ratio_t: Array) -> _Above:
    """Returns the state at a slab's lower face from that at its upper face.

    `ratio` is the E_r in whose units `above` is given over the slab's; `ratio_t` that of μ.
    """
    s = slab
    g = in_units(above.stiffness, ratio)
    inverse = 1 / (1 + s.q11 * g.c11 + 2 * s.q12 * g.c12 + s.q22 * g.c22 + s.det_q * g.det)
    t, force_s = _release((s.q11, s.q12, s.q22), g, above.force_t, above.force_s, 1.0, inverse)
    # Upside down, compliances and stiffnesses change places.
    turned = Slab(
        s.g11, s.g12, s.g22, s.det_g, s.q11, s.q12, s.q22, s.det_q, s.p11, s.p21, s.p12, s.p22
    )
    tanh, decay = jnp.tanh(x), jnp.exp(-x)
    g_t = ratio_t * above.stiffness_antiplane
    inverse_t = 1 / (1 + tanh * g_t)
    return _Above(
        stack_on(g, turned, jnp.ones_like(x)),
        (tanh + g_t) * inverse_t,
        s.p11 * t + s.p21 * force_s,
        s.p12 * t + s.p22 * force_s,
        2 * decay / (1 + decay * decay) * above.force_antiplane * inverse_t,
    )


def _release(c, g: Compliance, t: Array, s: Array, one: Array | float, inverse: Array):
    """Returns (1 + G c/one)⁻¹ (t, s) = [one + adj c adj G] (t, s)/n, n/one its determinant.

    `inverse` is 1/n.
    """
    c11, c12, c22 = c
    y_t, y_s = g.c22 * t - g.c12 * s, g.c11 * s - g.c12 * t
    return (
        (one * t + c22 * y_t - c12 * y_s) * inverse,
        (one * s + c11 * y_s - c12 * y_t) * inverse,
    )


def _joined(face: _Face, below: Face) -> tuple[Array, ...]:
    """Returns the tractions t, s, σ_T [Pa] and U, w, w_T [Pa, in units of 2/q] at the cut."""
    above, (one, c11, c12, c22, det, one_t, c_t, _) = face.above, below.below
    g = in_units(above.stiffness, face.reduced / below.reduced)
    g_t = face.shear / below.shear * above.stiffness_antiplane
    inverse = 1 / (one + g.c11 * c11 + 2 * g.c12 * c12 + g.c22 * c22 + g.det * det)
    t, s = _release((c11, c12, c22), g, above.force_t, above.force_s, one, inverse)
    # c (1 + G c)⁻¹ = (c + det c adj G)/n
    h11, h12, h22 = c11 + det * g.c22, c12 - det * g.c12, c22 + det * g.c11
    inverse = inverse / below.reduced
    u = (h11 * above.force_t + h12 * above.force_s) * inverse
    w = (h12 * above.force_t + h22 * above.force_s) * inverse
    released = above.force_antiplane / (one_t + g_t * c_t)
    return t, s, one_t * released, u, w, c_t * released / below.shear
