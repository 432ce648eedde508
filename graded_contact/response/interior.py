"""Displacement and stress inside a stack under a wave of surface traction.

Axes, signs and the traction are those of `matrix`: z and displacement into the solid, fields
exp(i(q·x + ωt)), the traction acting on the solid at its surface. Stress is positive in tension,
so that under a pressure p the surface has σ_zz = -p, and under a traction T it has σ_iz = -T_i.

At a depth z the block is cut in two. What lies below is a compliance c; what lies above is the
force v that the surface traction would exert on a clamped face, and the stiffness G of that face
when the surface is free. Across the cut act the traction (1 + G c)⁻¹ v and the displacement
c (1 + G c)⁻¹ v. Below, c is gathered upwards as for the surface compliance; above, G and v are
gathered downwards by the same recursion turned upside down. Both use the factors of `slab`
alone, whose transmission decays: nothing grows, however thick the layers. The stresses in planes
z = constant are continuous across interfaces; the other three follow from Hooke's law, in the
plane of q (L) and across it (T)

    σ_LL = ν/(1-ν) σ_zz + E_r i q u_L,   σ_TT = ν/(1-ν) σ_zz + ν E_r i q u_L,   σ_LT = μ i q u_T,

with E_r = E/(1 - ν²), which hold at ν = 1/2.
"""

import functools
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Inexact

from .._checks import Numbers, as_float, as_numbers, check_shape, check_values, door, is_concrete
from ..grid import (
    Grid,
    both_signs,
    even_on_nyquist,
    sliding_frequency,
    to_field,
    to_spectrum,
    wavevector,
)
from .matrix import Below, Moduli, kept, moduli_of, start_of, sweep, wavevectors, zeros_for
from .slab import Compliance, Slab, factors, stack_on
from .stack import HalfSpace, Stack

Side = Literal["above", "below"]


class InteriorFields(NamedTuple):
    """`displacement` [m], shape `(*w, 3)`, and `stress` [Pa], shape `(*w, 3, 3)`, along (x, y, z).

    Displacement and z are into the solid; stress is positive in tension.
    """

    displacement: Inexact[Array, "*w 3"]
    stress: Inexact[Array, "*w 3 3"]


@door
def interior_fields(
    stack: Stack,
    qx: Numbers,
    qy: Numbers,
    omega: Numbers,
    traction: Numbers,
    depth: Numbers,
    *,
    side: Side = "below",
) -> InteriorFields:
    """Returns displacement and stress in a stack, for one wave of surface traction per entry.

    **Arguments:**

    - `stack`: the block.
    - `qx`, `qy`: wavevector [rad/m], not both zero.
    - `omega`: angular frequencies ω [rad/s], of either sign.
    - `traction`: complex amplitudes (T_x, T_y, T_z) [Pa] of the traction acting on the solid's
      surface, shape `(*w, 3)`; T_z is the pressure in compression.
    - `depth`: z [m] below the surface, from 0 down to the bottom, or any on a half space.
    - `side`: at an interface σ_xx, σ_yy and σ_xy jump: the layer "above" or "below" it is meant.
      The values of `interface_depths` are recognised as such exactly.

    **Returns:** complex amplitudes, `(*w)` being the shape to which all arguments broadcast.
    Derivatives with respect to depth and thicknesses at an interface are means of both sides.
    """
    qx, qy, omega = wavevectors(qx, qy, omega)
    depth, traction = as_float(depth, "depth"), as_numbers(traction, "traction")
    if not jnp.iscomplexobj(traction):
        traction = as_float(traction, "traction")
    if traction.shape[-1:] != (3,):
        raise ValueError(f"`traction` has shape {traction.shape}; its last axis must be (x, y, z).")
    for part in (traction.real, traction.imag):
        check_values("traction", part, "a traction [Pa] must be finite")
    _check_side(side)
    depth = _inside(stack, depth)
    return _interior_fields(stack, qx, qy, omega, traction, depth, side)


@door
def stress_field(
    stack: Stack,
    grid: Grid,
    pressure: Numbers,
    depth: Numbers,
    velocity: Numbers = 0.0,
    *,
    side: Side = "below",
) -> InteriorFields:
    """Returns displacement and stress at one depth under a pressure on a periodic cell.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell; in one dimension the strain along y is zero.
    - `pressure`: on the surface [Pa], positive in compression, shape of the grid. No friction
      acts.
    - `depth`: z [m], one number.
    - `velocity`: of the pressure over the block [m/s], as in `stack_kernel`.
    - `side`: as in `interior_fields`.

    **Returns:** real fields, shape `(*grid.shape, 3)` and `(*grid.shape, 3, 3)`. The mean pressure
    compresses the block without lateral strain, σ_xx = σ_yy = ν/(1-ν) σ_zz at ω = 0; the mean
    displacement, which belongs to the mean gap, is left out. Nyquist lines are treated as in
    `stack_kernel`, with which the surface's displacement agrees.
    """
    pressure, depth = as_float(pressure, "pressure"), as_float(depth, "depth")
    velocity = as_float(velocity, "velocity")
    check_shape("pressure", pressure, grid.shape)
    check_values("pressure", pressure, "a pressure [Pa] must be finite")
    check_shape("depth", depth, ())
    if velocity.shape not in ((), (2,)) or (velocity.shape == (2,) and grid.ndim == 1):
        raise ValueError(
            f"`velocity` has shape {velocity.shape}; a number (along x) or, on a grid in two "
            "dimensions, two components are needed."
        )
    check_values("velocity", velocity, "a velocity [m/s] must be finite")
    _check_side(side)
    depth = _inside(stack, depth)
    return _stress_field(stack, grid, pressure, depth, velocity, side)


@door
def interface_depths(stack: Stack) -> Float[Array, " layers"]:
    """Returns the depth of the lower face of every layer [m], the last one being the bottom.

    **Arguments:**

    - `stack`: the block.

    **Returns:** depths [m], shape `(layers,)`.
    """
    depths, total = [], 0.0
    for layer in stack.layers:
        total = total + layer.thickness
        depths.append(total)
    return jnp.stack(depths) if depths else jnp.zeros((0,))


@door
def von_mises(stress: Numbers) -> Float[Array, "*w"]:
    """Returns the von Mises stress sqrt(3/2 s:s) [Pa] of real stresses, s their deviator.

    **Arguments:**

    - `stress`: σ [Pa], real, shape `(..., 3, 3)`.

    **Returns:** von Mises stress [Pa], shape `(...)`.
    """
    stress = as_float(stress, "stress")
    if stress.shape[-2:] != (3, 3):
        raise ValueError(f"`stress` has shape {stress.shape}; the last two axes must be (3, 3).")
    mean = jnp.trace(stress, axis1=-2, axis2=-1) / 3
    deviator = stress - mean[..., None, None] * jnp.eye(3, dtype=stress.dtype)
    size = jax.lax.stop_gradient(jnp.max(jnp.abs(deviator)))
    size = jnp.where(size > 0, size, 1)
    squared = 1.5 * jnp.sum((deviator / size) ** 2, axis=(-2, -1))
    none = squared == 0
    return jnp.where(none, 0, jnp.sqrt(jnp.where(none, 1, squared))) * size


def _check_side(side: str) -> None:
    if side not in ("above", "below"):
        raise ValueError(f"`side={side!r}` must be 'above' or 'below'.")


def _inside(stack: Stack, depth: Array) -> Array:
    """Returns `depth`, refused above the surface and below the bottom."""
    check_values("depth", depth, "a depth [m] is zero (the surface) or positive", at_least=0)
    if isinstance(stack.base, HalfSpace):
        return depth
    bottom = interface_depths(stack)[-1]
    # The sum of the thicknesses may be rounded differently by the caller.
    bottom = bottom * (1 + 16 * jnp.finfo(depth.dtype).eps)
    if is_concrete(bottom):
        allowed = f"the block ends at {float(bottom):g} m, below which there is nothing"
        check_values("depth", depth, allowed, at_most=float(bottom))
        if is_concrete(depth):
            return depth
    return eqx.error_if(depth, depth > bottom, "A `depth` lies below the bottom of the block.")


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


def _lower(above: _Above, slab: Slab, x: Array, ratio: Array, ratio_t: Array) -> _Above:
    """Returns the state at a slab's lower face from that at its upper face.

    `ratio` is the E_r in whose units `above` is given over the slab's; `ratio_t` that of μ.
    """
    s = slab
    g = _in_units(above.stiffness, ratio)
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


def _in_units(g: Compliance, ratio: Array) -> Compliance:
    return Compliance(ratio * g.c11, ratio * g.c12, ratio * g.c22, ratio * ratio * g.det)


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


def _descend(q, body: Moduli, start: _Above, parts, reached):
    """Returns the state at the depth, in units of the base, and E_r and ν there.

    `parts` are the thicknesses of the layers and of the base above the depth; `reached` tells
    whether the depth lies in them or below.
    """

    def add(carry, layer):
        above, *local = carry
        d, here, reduced, poisson, ratio, ratio_t = layer
        x = q * d
        above = _lower(above, factors(x, 1 - 2 * poisson), x, ratio, ratio_t)
        local = [jnp.where(here, n, o) for n, o in zip((reduced, poisson), local, strict=True)]
        return kept((above, *local), carry), None

    pairs = [jnp.concatenate([m[:1], m]) for m in (body.reduced, body.shear)]
    ratio, ratio_t = (m[:-1] / m[1:] for m in pairs)
    zero = start.stiffness.c11
    carry = (start, body.reduced[0] + zero, body.poisson[0] + zero)
    layers = (parts, reached, body.reduced, body.poisson, ratio, ratio_t)
    return jax.lax.scan(add, carry, layers)[0]


def _cut(stack, body: Moduli, depth, side):
    """Returns the thicknesses above the depth (base last), those below, and where it lies.

    The last is a mask over layers and base: whether the depth lies in each or below it.
    """
    bottoms = interface_depths(stack).astype(depth.dtype).reshape(body.thickness.shape)
    tops = jnp.concatenate([jnp.zeros_like(bottoms, shape=(1, *bottoms.shape[1:])), bottoms])
    over = jnp.clip(depth - tops[:-1], 0, body.thickness)
    over = jnp.where(depth >= bottoms, body.thickness, over)
    base_over = jnp.maximum(depth - tops[-1:], 0)
    reached = depth >= tops if side == "below" else depth > tops
    if not isinstance(stack.base, HalfSpace):
        base_over, reached = jnp.zeros_like(base_over), reached.at[-1].set(False)
    return jnp.concatenate([over, base_over]), body.thickness - over, reached


def _response(stack, qx, qy, omega, traction, depth, side):
    """Returns (u_x, u_y, u_z), (σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy) and ν/(1 - ν) at the depth."""
    q = jnp.hypot(qx, qy)
    a, b = qx / q, qy / q
    body = moduli_of(stack, q, omega)
    parts, remaining, reached = _cut(stack, body, depth, side)
    like = zeros_for(body, q, depth)
    below = sweep(q, body, start_of(stack.base, body, like), remaining)
    loads = (
        -1j * (a * traction[0] + b * traction[1]),
        -traction[2],
        a * traction[1] - b * traction[0],
    )
    full = sum(loads) + like + 0j
    loads = (jnp.broadcast_to(x, full.shape).astype(full.dtype) for x in loads)
    start = _Above(Compliance(like, like, like, like), like, *loads)
    above, reduced, poisson = _descend(q, body, start, parts, reached)

    t, s, shear, u, w, v = _joined(above, below, body)
    # Hooke's law with E_r q u_L/2 and μ q u_T of the material at the depth.
    along, across = reduced * u, reduced * (1 - poisson) * v
    lateral = poisson / (1 - poisson)
    unit = (2 / body.unit) / q
    displacement = (a * (1j * unit * u) - b * (unit * v), b * (1j * unit * u) + a * (unit * v))
    stress = _rotated(
        a,
        b,
        ll=lateral * s - 2 * along,
        tt=lateral * s - 2 * poisson * along,
        zz=s,
        tz=-shear,
        lz=-1j * t,
        lt=1j * across,
    )
    return (*displacement, -unit * w), stress, jnp.broadcast_to(lateral, like.shape)


def _joined(above: _Above, below: Below, body: Moduli):
    """Returns the tractions t, s, σ_T [Pa] and U, w, w_T [Pa, in units of 2/q] at the cut."""
    g = _in_units(above.stiffness, body.reduced[-1] / body.reduced[0])
    g_t = body.shear[-1] / body.shear[0] * above.stiffness_antiplane
    one, c11, c12, c22, det, one_t, c_t, _ = below
    inverse = 1 / (one + g.c11 * c11 + 2 * g.c12 * c12 + g.c22 * c22 + g.det * det)
    t, s = _release((c11, c12, c22), g, above.force_t, above.force_s, one, inverse)
    # c (1 + G c)⁻¹ = (c + det c adj G)/n
    h11, h12, h22 = c11 + det * g.c22, c12 - det * g.c12, c22 + det * g.c11
    inverse = inverse / body.reduced[0]
    u = (h11 * above.force_t + h12 * above.force_s) * inverse
    w = (h12 * above.force_t + h22 * above.force_s) * inverse
    released = above.force_antiplane / (one_t + g_t * c_t)
    return t, s, one_t * released, u, w, c_t * released / body.shear[0]


def _rotated(a, b, *, ll, tt, zz, tz, lz, lt):
    """Returns (σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy); e_L = (a, b) and e_T = (-b, a)."""
    return (
        a * a * ll + b * b * tt - 2 * a * b * lt,
        b * b * ll + a * a * tt + 2 * a * b * lt,
        zz,
        b * lz + a * tz,
        a * lz - b * tz,
        a * b * (ll - tt) + (a * a - b * b) * lt,
    )


@functools.partial(jax.jit, static_argnames="side")
def _interior_fields(stack, qx, qy, omega, traction, depth, side):
    rank = max(qx.ndim, traction.ndim - 1, depth.ndim)
    lift = lambda x: x.reshape((1,) * (rank - x.ndim) + x.shape)  # noqa: E731
    traction = [lift(traction[..., i]) for i in range(3)]
    displacement, stress, _ = _response(
        stack, lift(qx), lift(qy), lift(omega), traction, lift(depth), side
    )
    return InteriorFields(jnp.stack(displacement, -1), _tensor(stress))


@functools.partial(jax.jit, static_argnames="side")
def _stress_field(stack, grid, pressure, depth, velocity, side):
    spectrum = to_spectrum(pressure)
    qx, *qy = wavevector(grid, both_signs(grid.shape))
    qy = qy[0] if qy else jnp.zeros_like(qx)
    zero = (qx == 0) & (qy == 0)
    omega = sliding_frequency(qx, qy, velocity)
    unit = [jnp.asarray(x, pressure.dtype) for x in (0, 0, 1)]
    displacement, stress, lateral = _response(
        stack, jnp.where(zero, qx.ravel()[1], qx), qy, omega, unit, depth, side
    )
    means = [0, 0, 0, *(-lateral.ravel()[0],) * 2, -1, 0, 0, 0]
    fields = []
    for response, mean in zip((*displacement, *stress), means, strict=True):
        response = even_on_nyquist(jnp.where(zero, mean, response), grid.shape)
        fields.append(to_field(response * spectrum, grid.shape))
    return InteriorFields(jnp.stack(fields[:3], -1), _tensor(fields[3:]))


def _tensor(stress) -> Array:
    """Returns the tensor of (σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy)."""
    xx, yy, zz, yz, xz, xy = stress
    rows = jnp.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], -1)
    return rows.reshape(*xx.shape, 3, 3)
