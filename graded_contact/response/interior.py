"""Displacement and stress inside a stack under a wave of surface traction.

Axes, signs and the traction are those of `matrix`: z and displacement into the solid, fields
exp(i(q·x + ωt)), the traction acting on the solid at its surface. Stress is positive in tension,
so that under a pressure p the surface has σ_zz = -p, and under a traction T it has σ_iz = -T_i.

The stresses in planes
z = constant are continuous across interfaces; the other three follow from Hooke's law, in the
plane of q (L) and across it (T)

    σ_LL = ν/(1-ν) σ_zz + E_r i q u_L,   σ_TT = ν/(1-ν) σ_zz + ν E_r i q u_L,   σ_LT = μ i q u_T,

with E_r = E/(1 - ν²), which hold at ν = 1/2.

The stack is cut at the depth. What lies below the cut is a compliance c; what lies above is the
force v that the surface traction would exert on a clamped face, and the stiffness G of that face
when the surface is free. Across the cut act the traction (1 + G c)⁻¹ v and the displacement
c (1 + G c)⁻¹ v. Below, c is gathered upwards as for the surface compliance; above, G and v are
gathered downwards by the same recursion turned upside down. Both use the factors of `slab` alone,
whose transmission decays: nothing grows, however thick the layers.
"""

import functools
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Inexact

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    as_scalar,
    check_shape,
    check_types,
    check_values,
    is_concrete,
)
from ..core.display import shown
from ..fields.grid import (
    Grid,
    as_velocity,
    both_signs,
    even_on_nyquist,
    sliding_frequency,
    to_field,
    to_spectrum,
    wavevector,
)
from .grading import (
    AbstractGradedSolver,
    AddGraded,
    Carried,
    Cut,
    Rule,
    check_profiles,
    climb_through,
    column_of,
    graded_tolerance,
    solve_graded,
)
from .kernel import kernel_frequencies
from .layering import Layering
from .matrix import RULE as BELOW
from .matrix import Face, base_face, wavevectors, zeros_for
from .profile import moduli_at
from .slab import Compliance, Slab, factors, in_units, plane_strain, stack_on
from .stack import Free, GradedLayer, HalfSpace, Rigid, Stack, interface_depths, is_graded

Side = Literal["above", "below"]


@shown()
class InteriorFields(NamedTuple):
    """Displacement and stress along (x, y, z). Displacement and z are into the solid.

    **Fields:**

    - `displacement`: [m], shape `(*w, 3)`.
    - `stress`: positive in tension [Pa], shape `(*w, 3, 3)`.
    """

    displacement: Inexact[Array, "*w 3"]
    stress: Inexact[Array, "*w 3 3"]


@check_types
def interior_fields(
    stack: Stack,
    qx: Numbers,
    qy: Numbers,
    omega: Numbers,
    traction: Numbers,
    depth: Numbers,
    *,
    side: Side = "below",
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008 (immutable)
    rtol: float | None = None,
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
    - `graded_solver`: solver of graded layers, `Layering()` or `Riccati()`.
    - `rtol`: tolerance in graded layers, of stresses over the traction at the surface and of
      displacements as the stresses that they make; by default that of `graded_solver`. If it is not
      reached, an error is raised. Where the fields have decayed to less than that, `Layering` has
      no digits of them; `Riccati` keeps them, its tolerance being that of what is left.

    **Returns:** complex amplitudes, `(*w)` being the shape to which all arguments broadcast.
    Derivatives with respect to depth and thicknesses at an interface are means of both sides.
    """
    qx, qy, omega = wavevectors(stack, qx, qy, omega)
    depth, traction = as_float(depth, "depth"), as_numbers(traction, "traction")
    if not jnp.iscomplexobj(traction):
        traction = as_float(traction, "traction")
    if traction.shape[-1:] != (3,):
        raise ValueError(f"`traction` has shape {traction.shape}; its last axis must be (x, y, z).")
    for part in (traction.real, traction.imag):
        check_values("traction", part, "a traction [Pa] must be finite")
    depth = _inside(stack, depth)
    rtol = graded_tolerance(graded_solver, rtol, qx)
    return _interior_fields(stack, qx, qy, omega, traction, depth, side, graded_solver, rtol)


@check_types
def stress_field(
    stack: Stack,
    grid: Grid,
    pressure: Numbers,
    depth: Numbers,
    velocity: Numbers = 0.0,
    *,
    side: Side = "below",
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008 (immutable)
    rtol: float | None = None,
) -> InteriorFields:
    """Returns displacement and stress at one depth under a pressure on a periodic cell.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell; in one dimension the strain along y is zero.
    - `pressure`: on the surface [Pa], positive in compression, shape of the grid. No friction
      acts.
    - `depth`: z [m], one number.
    - `velocity`: of the pressure over the block [m/s], as in `stack_kernel`.
    - `side`, `graded_solver`, `rtol`: as in `interior_fields`.

    **Returns:** real fields, shape `(*grid.shape, 3)` and `(*grid.shape, 3, 3)`. The mean pressure
    compresses the block without lateral strain, σ_xx = σ_yy = ν/(1-ν) σ_zz at ω = 0; the mean
    displacement, which belongs to the mean gap, is left out. Nyquist lines are treated as in
    `stack_kernel`, with which the surface's displacement agrees.
    """
    pressure, depth = as_float(pressure, "pressure"), as_scalar(depth, "depth")
    velocity = as_velocity(velocity, grid)
    check_shape("pressure", pressure, grid.shape)
    check_values("pressure", pressure, "a pressure [Pa] must be finite")
    check_profiles(stack, kernel_frequencies(grid, velocity))
    depth = _inside(stack, depth)
    rtol = graded_tolerance(graded_solver, rtol, pressure)
    return _stress_field(stack, grid, pressure, depth, velocity, side, graded_solver, rtol)


@check_types
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


def _fields(stack, qx, qy, omega, traction, depth, side, graded_solver, rtol):
    """Returns (u_x, u_y, u_z), (σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy) and ν/(1 - ν) at the depth."""
    q = jnp.hypot(qx, qy)
    a, b = qx / q, qy / q
    loads = (
        -1j * (a * traction[0] + b * traction[1]),
        -traction[2],
        a * traction[1] - b * traction[0],
    )
    climb, local = depth_climb(stack, q, omega, loads, depth, side)
    poisson = (1 - local.e) / 2
    stiffness = jnp.abs(local.reduced)

    def measure(differences, values):
        """Of stresses and of displacements, each over what is largest of its kind at the depth, or
        over the traction at the surface."""

        def largest(*parts):
            return functools.reduce(jnp.maximum, map(jnp.abs, parts))

        def error(stress, displacement, stresses, displacements):
            size = largest(*loads, *stresses)
            of_stress = largest(*stress) / jnp.where(size > 0, size, 1)
            size = jnp.maximum(largest(*loads) / stiffness, largest(*displacements))
            return jnp.maximum(of_stress, largest(*displacement) / jnp.where(size > 0, size, 1))

        def kinds(t, s, across, u, w, v):
            return (t, s, across, stiffness * u, stiffness * v), (u, w, v)

        return error(*kinds(*differences), *kinds(*values))

    if is_graded(stack):
        found, _ = solve_graded(graded_solver, climb, measure, stack, q, omega, rtol, throw=True)
    else:
        found = climb(None)
    t, s, shear, u, w, v = found
    # Hooke's law with E_r q u_L/2 and μ q u_T of the material at the depth.
    along, across = local.reduced * u, local.reduced * (1 - poisson) * v
    lateral = poisson / (1 - poisson)
    unit = (2 / local.unit) / q
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
    return (*displacement, -unit * w), stress, lateral


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


@eqx.filter_jit
def _interior_fields(stack, qx, qy, omega, traction, depth, side, graded_solver, rtol):
    rank = max(qx.ndim, traction.ndim - 1, depth.ndim)
    lift = lambda x: x.reshape((1,) * (rank - x.ndim) + x.shape)  # noqa: E731
    traction = [lift(traction[..., i]) for i in range(3)]
    displacement, stress, _ = _fields(
        stack, lift(qx), lift(qy), lift(omega), traction, lift(depth), side, graded_solver, rtol
    )
    return InteriorFields(jnp.stack(displacement, -1), _tensor(stress))


@eqx.filter_jit
def _stress_field(stack, grid, pressure, depth, velocity, side, graded_solver, rtol):
    spectrum = to_spectrum(pressure)
    qx, *qy = wavevector(grid, both_signs(grid.shape))
    qy = qy[0] if qy else jnp.zeros_like(qx)
    zero = (qx == 0) & (qy == 0)
    omega = sliding_frequency(qx, qy, velocity)
    unit = [jnp.asarray(x, pressure.dtype) for x in (0, 0, 1)]
    depth = depth.reshape((1,) * qx.ndim)
    displacement, stress, lateral = _fields(
        stack, jnp.where(zero, qx.ravel()[1], qx), qy, omega, unit, depth, side, graded_solver, rtol
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
    pieces = _pieces(stack, depth, side)
    like = zeros_for(column, depth)
    full = sum(traction) + like + 0j
    loads = (jnp.broadcast_to(part, full.shape).astype(full.dtype) for part in traction)
    one = jnp.ones_like(like)
    surface = _Face(_Above(Compliance(like, like, like, like), like, *loads), one, one)

    def climb(add_graded):
        below = climb_through(
            column,
            base_face(column, like),
            BELOW,
            add_graded,
            parts=pieces.below,
            cuts={i: Cut(s, upper=False) for i, s in pieces.heights.items()},
        )
        above = climb_through(
            column,
            surface,
            _ABOVE,
            add_graded,
            parts=pieces.above,
            cuts={i: Cut(s, upper=True) for i, s in pieces.heights.items()},
        )
        if not isinstance(column.base, Rigid | Free):
            above = _ABOVE.add(above, q * pieces.in_base, *column.base)
        return _joined(above, below)

    local = _material(stack, column, omega, pieces)
    reduced, e = (jnp.broadcast_to(part, like.shape) for part in local)
    return climb, Local(reduced, e, column.unit)


class _Pieces(NamedTuple):
    """Where a depth cuts the layers.

    Thicknesses above and below it [m], of every layer; heights s at which graded ones are cut; how
    deep it is in the base [m]; and whether it lies in each layer, or the base, or further down.
    """

    above: list[Array]
    below: list[Array]
    heights: dict[int, Array]
    in_base: Array
    reached: list[Bool[Array, "..."]]


def _pieces(stack, depth, side):
    top = jnp.zeros((), depth.dtype)
    above, below, heights, reached = [], [], {}, []
    for i, layer in enumerate(stack.layers):
        thickness, bottom = layer.thickness, top + layer.thickness
        reached.append(depth >= top if side == "below" else depth > top)
        over = jnp.where(depth >= bottom, thickness, jnp.clip(depth - top, 0, thickness))
        above.append(over)
        below.append(thickness - over)
        if isinstance(layer, GradedLayer):
            heights[i] = 1 - over / jnp.where(thickness > 0, thickness, 1)
        top = bottom
    reached.append(depth >= top if side == "below" else depth > top)
    return _Pieces(above, below, heights, jnp.maximum(depth - top, 0), reached)


def _material(stack, column, omega, pieces):
    """E_r and e at the depth."""
    first, found = 0, ()

    def choose(reached, here, found):
        if not found:
            return here
        return tuple(jnp.where(reached, a, b) for a, b in zip(here, found, strict=True))

    for run in column.runs:
        if isinstance(run, int):
            modulus, poisson = moduli_at(stack.layers[run].profile, pieces.heights[run], omega)
            here = plane_strain(modulus / column.unit, poisson)
            found = choose(pieces.reached[first], here, found)
            first += 1
            continue
        for here in zip(run.reduced, run.e, strict=True):
            found = choose(pieces.reached[first], here, found)
            first += 1
    if not isinstance(column.base, Rigid | Free):
        found = choose(pieces.reached[-1], column.base, found)
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
