"""Displacement and stress inside a stack under a wave of surface traction.

Axes, signs and the traction are as in `compliance`: z and displacement into the solid, fields
exp(i(q·x + ωt)), the traction acting on the solid at its surface. Stress is positive in tension,
so that under a pressure p the surface has σ_zz = -p, and under a traction T it has σ_iz = -T_i.

The stresses in planes
z = constant are continuous across interfaces; the other three follow from Hooke's law, in the
plane of q (L) and across it (T)

    σ_LL = ν/(1-ν) σ_zz + E_r i q u_L,   σ_TT = ν/(1-ν) σ_zz + ν E_r i q u_L,   σ_LT = μ i q u_T,

with E_r = E/(1 - ν²), which hold at ν = 1/2.
"""

import dataclasses
import functools
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from ..blocks.stack import HalfSpace, Stack, interface_depths
from ..core.checks import Numbers, as_float, as_numbers, check_values, is_concrete
from ..core.compilation import compiled
from ..core.derivative import root_or_zero
from ..core.display import shown
from ..fields.frequency import sliding_frequency
from ..fields.grid import Grid, both_signs, even_on_nyquist, to_field, to_spectrum, wavevector
from .compliance import wavevectors
from .downwards import Side, depth_climb
from .grading import graded_tolerance, solve_graded
from .layering import Layering


@shown()
class InteriorFields(NamedTuple):
    """Displacement and stress along (x, y, z). Displacement and z are into the solid.

    **Fields:**

    - `displacement`: [m], shape `(*w, 3)`.
    - `stress`: positive in tension [Pa], shape `(*w, 3, 3)`.
    """

    displacement: Inexact[Array, "*w 3"]
    stress: Inexact[Array, "*w 3 3"]


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
    - `side`: the layer "above" or "below" an interface, where σ_xx, σ_yy and σ_xy jump. Pass the
      exact values of `interface_depths`.

    In graded layers the tolerance of the stack's solver holds for stresses relative to the traction
    at the surface, and for displacements as the stresses that they cause. If it is not reached, an
    error is raised. Fields that have decayed below it have no correct digits. Fields in graded
    layers are by `Layering`, whatever the solver of the stack is.

    **Returns:** complex amplitudes, `(*w)` being the shape to which all arguments broadcast.
    Derivatives with respect to depth and thicknesses at an interface are means of both sides.
    """
    qx, qy, omega = wavevectors(stack, qx, qy, omega)
    depth, traction = as_float(depth, "depth"), as_numbers(traction, "traction")
    if traction.shape[-1:] != (3,):
        raise ValueError(f"`traction` has shape {traction.shape}; its last axis must be (x, y, z).")
    check_values("traction", traction, "a traction [Pa] must be finite")
    depth = checked_depth("depth", stack, depth)
    return _interior_fields(stack, qx, qy, omega, traction, depth, side)


@compiled
def stress_field(
    stack: Stack, grid: Grid, pressure: Array, depth: Array, velocity: Array,
    traction: Array | None = None, side: Side = "below",
) -> InteriorFields:  # fmt: skip
    """Returns displacement and stress at one depth under pressure and traction on a periodic cell.

    Arguments are not checked.

    **Arguments:**

    - `stack`: the block.
    - `grid`: the periodic cell; in one dimension the strain along y is zero.
    - `pressure`: on the surface [Pa], positive in compression, shape of the grid.
    - `depth`: z [m], one number.
    - `velocity`: of the pressure over the block [m/s], as in `stack_kernel`.
    - `traction`: tangential force per area that acts on the block's surface [Pa], such as
      friction along the velocity: of the shape of the grid (along x), or with a last axis `(x, y)`.
      None for no traction.
    - `side`: as in `interior_fields`.

    **Returns:** real fields, shape `(*grid.shape, 3)` and `(*grid.shape, 3, 3)`. The mean pressure
    compresses the block without lateral strain, σ_xx = σ_yy = ν/(1-ν) σ_zz at ω = 0; the mean
    displacement, under the mean pressure or traction, belongs to the mean gap and is left out.
    Nyquist lines are treated as in `stack_kernel`, with which the surface's displacement agrees.
    """
    waves = stress_waves(stack, grid, pressure, traction, depth, velocity, side)
    return _as_fields([to_field(jnp.asarray(one), grid.shape) for one in waves])


def von_mises(stress: Float[Array, "*w 3 3"]) -> Float[Array, "*w"]:
    """Returns the von Mises stress sqrt(3/2 s:s) [Pa] of real stresses [Pa], s their deviator."""
    mean = jnp.trace(stress, axis1=-2, axis2=-1) / 3
    deviator = stress - mean[..., None, None] * jnp.eye(3, dtype=stress.dtype)
    return root_or_zero(1.5 * jnp.sum(deviator**2, axis=(-2, -1)))


def checked_depth(name: str, stack: Stack, depth: Array) -> Array:
    """Returns `depth`, refused above the surface and below the bottom."""
    check_values(name, depth, "a depth [m] is zero (the surface) or positive", at_least=0)
    if isinstance(stack.base, HalfSpace):
        return depth
    bottom = interface_depths(stack)[-1]
    # The sum of the thicknesses may be rounded differently by the caller.
    bottom = bottom * (1 + 16 * jnp.finfo(depth.dtype).eps)
    if is_concrete(bottom):
        allowed = f"the block ends at {float(bottom):g} m, below which there is nothing"
        check_values(name, depth, allowed, at_most=float(bottom))
        if is_concrete(depth):
            return depth
    return eqx.error_if(depth, depth > bottom, f"`{name}` lies below the bottom of the block.")


def _fields(stack, qx, qy, omega, traction, depth, side):
    """Returns (u_x, u_y, u_z, σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy) and ν/(1 - ν) at the depth."""
    q = jnp.hypot(qx, qy)
    a, b = qx / q, qy / q
    loads = (
        -1j * (a * traction[0] + b * traction[1]),
        -traction[2],
        a * traction[1] - b * traction[0],
    )
    climb, (reduced, e), unit = depth_climb(stack, q, omega, loads, depth, side)
    poisson, stiffness = (1 - e) / 2, jnp.abs(reduced)

    def largest(*parts):
        return functools.reduce(jnp.maximum, map(jnp.abs, parts))

    def sizes(t, s, across, u, w, v):
        """The largest stress and the largest displacement."""
        return largest(t, s, across, stiffness * u, stiffness * v), largest(u, w, v)

    def measure(differences, values):
        load = largest(*loads)
        least = load, load / stiffness  # what the traction at the surface causes
        known = [jnp.where(a > 0, a, 1) for a in map(jnp.maximum, least, sizes(*values))]
        return jnp.maximum(*map(jnp.divide, sizes(*differences), known))

    rtol = graded_tolerance(stack, qx)
    if not isinstance(stack.graded_solver, Layering):
        stack = dataclasses.replace(stack, graded_solver=Layering())
    (t, s, shear, u, w, v), _ = solve_graded(climb, measure, stack, q, omega, rtol, throw=True)
    # Hooke's law with E_r q u_L/2 and μ q u_T of the material at the depth.
    along, across = reduced * u, reduced * (1 - poisson) * v
    lateral = poisson / (1 - poisson)
    ll, tt = lateral * s - 2 * along, lateral * s - 2 * poisson * along
    tz, lz, lt = -shear, -1j * t, 1j * across
    # From axes along e_L = (a, b) and e_T = (-b, a) to those along x and y.
    stress = [
        a * a * ll + b * b * tt - 2 * a * b * lt,
        b * b * ll + a * a * tt + 2 * a * b * lt,
        s,
        b * lz + a * tz,
        a * lz - b * tz,
        a * b * (ll - tt) + (a * a - b * b) * lt,
    ]
    unit = (2 / unit) / q
    u, v = 1j * unit * u, unit * v
    return [a * u - b * v, b * u + a * v, -unit * w, *stress], lateral


@compiled
def _interior_fields(stack, qx, qy, omega, traction, depth, side):
    rank = max(qx.ndim, traction.ndim - 1, depth.ndim)
    lift = lambda x: x.reshape((1,) * (rank - x.ndim) + x.shape)  # noqa: E731
    traction = [lift(traction[..., i]) for i in range(3)]
    qx, qy, omega, depth = (lift(x) for x in (qx, qy, omega, depth))
    found, _ = _fields(stack, qx, qy, omega, traction, depth, side)
    return _as_fields(found)


def stress_waves(stack, grid, pressure, traction, depth, velocity, side="below") -> list:
    """Returns the spectra of (u_x, u_y, u_z, σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy) at a depth.

    Arguments as of `stress_field`.
    """
    loads = {2: pressure}  # by axis
    if traction is not None:
        with_axes = traction.ndim > grid.ndim
        loads |= dict(enumerate(jnp.moveaxis(traction, -1, 0) if with_axes else [traction]))
    qx, *qy = wavevector(grid, both_signs(grid.shape))
    qy = qy[0] if qy else jnp.zeros_like(qx)
    zero = (qx == 0) & (qy == 0)
    omega = sliding_frequency(qx, qy, velocity)
    # Any wave in place of the mean, whose response is put in below.
    qx = jnp.where(zero, qx.ravel()[1], qx)
    # A unit load along each axis, on an axis in front: what does not depend on it is found once.
    one = jnp.ones((), qx.dtype)
    units = [one * np.reshape([i == j for j in loads], (-1,) + (1,) * qx.ndim) for i in range(3)]
    qx, qy, omega = (x[None] for x in (qx, qy, omega))
    depth = depth.reshape((1,) * qx.ndim)
    found, lateral = _fields(stack, qx, qy, omega, units, depth, side)
    means = zip(*(_means(axis, lateral.ravel()[0]) for axis in loads), strict=True)
    spectra = [to_spectrum(load) for load in loads.values()]

    def field(response, means):
        response = jnp.broadcast_to(response, (len(loads), *response.shape[1:]))
        parts = zip(response, means, spectra, strict=True)
        return sum(
            even_on_nyquist(jnp.where(zero, mean, part), grid.shape) * spectrum
            for part, mean, spectrum in parts
        )

    return [field(*pair) for pair in zip(found, means, strict=True)]


def _means(axis: int, lateral: Array) -> list:
    """The fields by a mean load of 1 along an axis: (u_x, u_y, u_z, σ_xx, ..., σ_xy) at q = 0."""
    if axis == 2:
        return [0, 0, 0, -lateral, -lateral, -1, 0, 0, 0]
    return [0] * 6 + [-(axis == 1), -(axis == 0), 0]


def _as_fields(found) -> InteriorFields:
    """A vector and a tensor of the parts that `_fields` returns."""
    x, y, z, xx, yy, zz, yz, xz, xy = jnp.broadcast_arrays(*found)
    rows = jnp.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], -1)
    return InteriorFields(jnp.stack([x, y, z], -1), rows.reshape(*xx.shape, 3, 3))
