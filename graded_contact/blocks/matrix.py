"""The full surface compliance of a stack: three displacements per three tractions.

Axes are those of the package: x and y in the surface, z into the solid; fields exp(i(q·x + ωt)).
Tractions and displacements are both counted along these axes. The traction is the force per area
that acts on the solid, so that its z component is the pressure in compression, and u = C t:

    C = c11 e_L e_Lᵀ + c_T e_T e_Tᵀ - i c12 (e_L e_zᵀ - e_z e_Lᵀ) + c22 e_z e_zᵀ,

with e_L = q/|q| and e_T = (-q_y, q_x)/|q|. On a half space, in units of 2(1 - ν²)/(E q):
c11 = c22 = 1, c12 = -(1 - 2ν)/(2 - 2ν), c_T = 1/(1 - ν). A frame with z out of the body, as in
`slab`, has both third components reversed: C' = D C D with D = diag(1, 1, -1), which is also
C(-q). Both are reciprocal, C(q)ᵀ = C(-q); for ω > 0 a passive stack has (C - Cᴴ)/2i <= 0.

The antiplane part (shear waves with displacement along e_T) obeys the scalar form of the
recursion of `slab`, with transmission 1/cosh(q d) and both factors tanh(q d), in units of
1/(μ q), μ the shear modulus.

What lies below a face is stored as homogeneous coordinates (n, c11, c12, c22, det)/n, so that a
clamped (n > 0 alone) and a free face (det > 0 alone) are ordinary starting points and layers may
have no thickness. For thin layers on a rigid base, and for a free sheet with ν = 1/2, c11 and c_T
agree to the last digit, and C_xy is their difference. Therefore it is one more coordinate,
(1 - ν) c11 n_t - n c_t, with a recursion whose terms are all as small as the result. The exception
are several free sheets of one modulus with ν = 1/2: there C_xy is 0.5 (q d)² C_xx, and its error is
the rounding of C_xx.
"""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Complex, Inexact

from ..core.checks import Numbers, as_float, check_types, is_concrete
from .grading import (
    AbstractGradedSolver,
    Carried,
    Column,
    Rule,
    as_waves,
    climb_through,
    column,
    column_of,
    graded_tolerance,
    solve_graded,
)
from .layering import Layering
from .slab import Compliance, Slab, Split, factors, half_space, in_units, split_of
from .stack import Free, Rigid, Stack


class Below(NamedTuple):
    """Compliance of a face, by homogeneous coordinates, in units of 2/(E_r q) and 1/(μ q).

    In plane c = [[c11, c12], [c12, c22]]/n with determinant det/n; antiplane c_t/n_t.
    """

    n: Inexact[Array, "*w"]
    c11: Inexact[Array, "*w"]
    c12: Inexact[Array, "*w"]
    c22: Inexact[Array, "*w"]
    det: Inexact[Array, "*w"]
    n_t: Inexact[Array, "*w"]
    c_t: Inexact[Array, "*w"]
    split: Inexact[Array, "*w"]  # (1 - ν) c11 n_t - n c_t


class Face(NamedTuple):
    """What lies below a face, in units of its E_r and 2 μ, which are relative to a unit [Pa]."""

    below: Below
    reduced: Inexact[Array, "..."]
    shear: Inexact[Array, "..."]


@check_types
def surface_compliance_matrix(
    stack: Stack,
    qx: Numbers,
    qy: Numbers,
    omega: Numbers,
    *,
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008 (immutable)
    rtol: float | None = None,
) -> Complex[Array, "*w 3 3"]:
    """Returns the compliance C [m/Pa] from surface tractions to surface displacements.

    Both vectors are along (x, y, z) with z into the solid, the tractions being those acting on
    the solid: C[..., 2, 2] is M_zz.

    **Arguments:**

    - `stack`: the block.
    - `qx`, `qy`: wavevector [rad/m], not both zero.
    - `omega`: angular frequencies ω [rad/s], of either sign.
    - `graded_solver`: solver of graded layers, `Layering()` or `Riccati()`.
    - `rtol`: relative tolerance in graded layers, of c11, c22 and c_T each and of c12 over their
      geometric mean; by default that of `graded_solver`. If it is not reached, an error is raised.

    **Returns:** C, of the shape to which `qx`, `qy` and `omega` broadcast and two axes of 3.
    """
    qx, qy, omega = wavevectors(stack, qx, qy, omega)
    rtol = graded_tolerance(graded_solver, rtol, qx)
    return _surface_compliance_matrix(stack, qx, qy, omega, graded_solver, rtol)


def layered_compliance_matrix(qx, qy, thickness, modulus, poisson, base) -> Complex[Array, "..."]:
    """Returns C as `surface_compliance_matrix`, for moduli that are given as arrays.

    The arguments after `qx` and `qy` are those of `layered_compliance`; they are not checked.
    """
    qx, qy = as_float(qx, "qx"), as_float(qy, "qy")
    q = jnp.hypot(qx, qy)
    moduli = list(zip(modulus, poisson, strict=True))
    return _matrix(qx / q, qy / q, _climb(column(thickness, moduli, base, q))(None))


def wavevectors(
    stack: Stack, qx: Numbers, qy: Numbers, omega: Numbers
) -> tuple[Array, Array, Array]:
    """Returns the arguments as arrays of equal rank, checked."""
    qx, qy, omega = as_waves(stack, qx=qx, qy=qy, omega=omega)
    if is_concrete(qx) and is_concrete(qy) and bool(jnp.any((qx == 0) & (qy == 0))):
        raise ValueError(
            "`qx=0` with `qy=0` is refused: the mean displacement does not follow from the mean "
            "traction."
        )
    return qx, qy, omega


def base_face(column: Column, like: Array) -> Face:
    """Returns the state of the base's face, of the shape and dtype of `like`."""
    none, one = jnp.zeros_like(like), jnp.ones_like(like)
    if isinstance(column.base, Rigid):
        return Face(Below(one, none, none, none, none, one, none, none), one, one)
    if isinstance(column.base, Free):
        return Face(Below(none, none, none, none, one, none, one, none), one, one)
    face = _half_space(*column.base)
    return jax.tree.map(lambda part: part + none, face)


def zeros_for(column: Column, *arrays: Array) -> Array:
    """Returns zeros of the shape and dtype to which a column's moduli and `arrays` broadcast."""
    moduli = [] if isinstance(column.base, Rigid | Free) else [*column.base]
    for run in column.runs:
        if not isinstance(run, int):
            moduli += [run.reduced[0], run.e[0]]
    arrays = (column.q, *moduli, *arrays)
    shape = jnp.broadcast_shapes(*(array.shape for array in arrays))
    return jnp.zeros(shape, jnp.result_type(*arrays))


def _add(face: Face, x: Array, reduced: Array, e: Array, _: None = None) -> Face:
    shear = reduced * (1 + e) / 2
    below = _lifted(face.below, x, e, reduced / face.reduced, shear / face.shear)
    return Face(below, reduced, shear)


def _half_space(reduced: Array, e: Array) -> Face:
    c11, c12, c22, det = half_space(e)
    one, shear = jnp.ones_like(c11), reduced * (1 + e) / 2
    return Face(Below(one, c11, c12, c22, det, one, one, -(1 - e) / 2), reduced, shear)


def _numbers(face: Face, reference: Array, inverse: bool) -> Carried:
    n, c11, c12, c22, det, n_t, c_t, _ = face.below
    if inverse:
        plane = Compliance(c22 / det, -c12 / det, c11 / det, n / det)
        plane = in_units(plane, face.reduced / reference)
        return Carried(plane, n_t / c_t * face.shear / reference)
    plane = in_units(Compliance(c11 / n, c12 / n, c22 / n, det / n), reference / face.reduced)
    return Carried(plane, c_t / n_t * reference / face.shear)


def _face(numbers: Carried, reference: Array, inverse: bool, e: Array) -> Face:
    (c11, c12, c22, det), antiplane, _ = numbers
    shear, one = reference * (1 + e) / 2, jnp.ones_like(det)
    if inverse:
        below = (det, c22, -c12, c11, one, antiplane * reference / shear, one)
    else:
        below = (one, c11, c12, c22, det, one, antiplane * shear / reference)
    split = (1 + e) / 2 * below[1] * below[5] - below[0] * below[6]
    return Face(Below(*below, split), reference, shear)


RULE = Rule(_add, _half_space, _numbers, _face)


def _lifted(below: Below, x: Array, e: Array, ratio: Array, ratio_t: Array) -> Below:
    """Returns the state of a slab's upper face from that of its lower face.

    `x` is q d of the slab, `ratio` its E_r over that in whose units `below` is given; `ratio_t`
    that of the shear moduli.
    """
    s, tanh = factors(x, e), jnp.tanh(x)
    c11, c12, c22 = (ratio * c for c in below[1:4])
    det = ratio * ratio * below.det
    h11, h12, h22 = c11 + det * s.g22, c12 - det * s.g12, c22 + det * s.g11
    a11, a12 = s.p11 * h11 + s.p12 * h12, s.p11 * h12 + s.p12 * h22
    a21, a22 = s.p21 * h11 + s.p22 * h12, s.p21 * h12 + s.p22 * h22
    n = below.n + s.g11 * c11 + 2 * s.g12 * c12 + s.g22 * c22 + s.det_g * det
    plane = (
        n,
        s.q11 * n + a11 * s.p11 + a12 * s.p12,
        s.q12 * n + a11 * s.p21 + a12 * s.p22,
        s.q22 * n + a21 * s.p21 + a22 * s.p22,
        s.det_q * below.n + s.q22 * c11 + 2 * s.q12 * c12 + s.q11 * c22 + det,
    )
    n_t, c_t = below.n_t, ratio_t * below.c_t
    antiplane = (n_t + tanh * c_t, c_t + tanh * n_t)
    below = Below(below.n, c11, c12, c22, det, n_t, c_t, ratio_t * below.split)
    split = _split(below, s, split_of(x, e), tanh, (1 + e) / 2, n, antiplane[0])
    unit, unit_t = _inverse_size(plane), _inverse_size(antiplane)
    n, c11, c12, c22, det = (c * unit for c in plane)
    n_t, c_t = (c * unit_t for c in antiplane)
    return Below(n, c11, c12, c22, det, n_t, c_t, split * unit * unit_t)


def _split(below: Below, s: Slab, small: Split, tanh, p, n, n_t) -> Array:
    """(1 - ν) c11 n_t - n c_t of the upper face, whose n and n_t are given; p = 1 - ν.

    p c11' = p q11 n + p (P H Pᵀ)_11 times n_t, less n times c_t' = tanh n_t + c_t/cosh², sorted so
    that what is alike is subtracted beforehand, in `small`.
    """
    _, c11, c12, c22, det, one_t, c_t, split = below
    both = s.det_g * det
    along = split + p * (one_t * det * s.g22 + tanh * c_t * c11)
    along = along - c_t * (s.g11 * c11 + 2 * s.g12 * c12 + s.g22 * c22)
    squared = small.p11_less_1 * (s.p11 + 1) + tanh * tanh  # p11² - 1/cosh²
    across = 2 * s.p11 * s.p12 * (n_t * c12 - one_t * det * s.g12)
    across = across + s.p12**2 * (n_t * c22 + one_t * det * s.g11)
    return (
        small.clamped * (n * n_t - both * tanh * c_t)
        + s.p11**2 * along
        + squared * c_t * (n - both)
        + p * across
        + small.free * det * c_t
    )


def _climb(column):
    """The recursion that finds c11, c12, c22, c_T and c11 - c_T [m/Pa]."""
    face = base_face(column, zeros_for(column))

    def climb(add_graded):
        (n, c11, c12, c22, _, n_t, c_t, split), reduced, shear = climb_through(
            column, face, RULE, add_graded
        )
        unit = (2 / column.unit) / column.q
        plane, antiplane = unit / (reduced * n), unit / (shear * n_t)
        return (plane * c11, plane * c12, plane * c22, antiplane * c_t, antiplane * (split / n))

    return climb


def _relative(differences, values):
    along, normal, across = (jnp.sqrt(jnp.abs(values[i])) for i in (0, 2, 3))
    sizes = (along * along, along * normal, normal * normal, across * across, along * across)
    errors = [jnp.abs(d) / size for d, size in zip(differences, sizes, strict=True)]
    return functools.reduce(jnp.maximum, errors)


@eqx.filter_jit
def _surface_compliance_matrix(stack, qx, qy, omega, graded_solver, rtol):
    q = jnp.hypot(qx, qy)
    climb = _climb(column_of(stack, q, omega))
    values, _ = solve_graded(graded_solver, climb, _relative, stack, q, omega, rtol)
    return _matrix(qx / q, qy / q, values)


@jax.jit
def _matrix(a, b, values):
    c11, c12, c22, c_t, split = values
    i = jnp.asarray(1j, jnp.result_type(c11, jnp.complex64))
    diagonal = (c11 * a * a + c_t * b * b, c11 * b * b + c_t * a * a, c22)
    xy, xz, yz = split * a * b, -i * c12 * a, -i * c12 * b
    rows = ((diagonal[0], xy, xz), (xy, diagonal[1], yz), (-xz, -yz, diagonal[2]))
    entries = [jnp.broadcast_to(x, c11.shape).astype(i.dtype) for row in rows for x in row]
    return jnp.stack(entries, -1).reshape(*c11.shape, 3, 3)


def _inverse_size(coordinates: tuple[Array, ...]) -> Array:
    """A constant that keeps homogeneous coordinates from overflowing."""
    parts = [part for x in coordinates for part in (x.real, x.imag)[: 1 + jnp.iscomplexobj(x)]]
    return 1 / functools.reduce(jnp.add, [jnp.abs(jax.lax.stop_gradient(part)) for part in parts])
