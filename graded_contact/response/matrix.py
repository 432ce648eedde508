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

What lies below a face is held as homogeneous coordinates (n, c11, c12, c22, det)/n, so that a
clamped (n > 0 alone) and a free face (det > 0 alone) are ordinary starting points and layers may
have no thickness. Of thin layers on a rigid base, and of a free sheet with ν = 1/2, c11 and c_T
agree to the last digit, and C_xy is their difference: it is carried along as one more coordinate,
(1 - ν) c11 n_t - n c_t, by a recursion whose terms are all as small as it is.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Complex, Float, Inexact

from .._checks import Numbers, as_float, check_together, check_values, door, is_concrete
from .slab import Slab, Split, factors, half_space, split_of
from .stack import Free, HalfSpace, Layer, Rigid, Stack


class Moduli(NamedTuple):
    """Homogeneous layers, surface first, and their base, at given frequencies.

    The last entry of `reduced` and `poisson` is the base; a rigid or free one repeats the lowest
    layer.
    """

    thickness: Float[Array, "layers *#w"]
    reduced: Inexact[Array, "bodies *#w"]  # E/(1 - ν²), relative to `unit` [Pa]
    poisson: Inexact[Array, "bodies *#w"]
    unit: Float[Array, ""]

    @property
    def shear(self) -> Inexact[Array, "bodies *#w"]:
        """2 μ, relative to `unit`."""
        return self.reduced * (1 - self.poisson)


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


@door
def surface_compliance_matrix(
    stack: Stack, qx: Numbers, qy: Numbers, omega: Numbers
) -> Complex[Array, "*w 3 3"]:
    """Returns the compliance C [m/Pa] from surface tractions to surface displacements.

    Both vectors are along (x, y, z) with z into the solid, the tractions being those acting on
    the solid: C[..., 2, 2] is M_zz.

    **Arguments:**

    - `stack`: the block.
    - `qx`, `qy`: wavevector [rad/m], not both zero.
    - `omega`: angular frequencies ω [rad/s], of either sign.

    **Returns:** C, of the shape to which `qx`, `qy` and `omega` broadcast and two axes of 3.
    """
    qx, qy, omega = wavevectors(qx, qy, omega)
    return _surface_compliance_matrix(stack, qx, qy, omega)


def layered_compliance_matrix(qx, qy, thickness, modulus, poisson, base) -> Complex[Array, "..."]:
    """Returns C as `surface_compliance_matrix`, for moduli that are given as arrays.

    The arguments after `qx` and `qy` are those of `layered_compliance`; they are not checked.
    """
    qx, qy = as_float(qx, "qx"), as_float(qy, "qy")
    return _matrix(qx, qy, moduli(jnp.hypot(qx, qy), thickness, modulus, poisson, base), base)


def wavevectors(qx: Numbers, qy: Numbers, omega: Numbers) -> tuple[Array, Array, Array]:
    """Returns the arguments as arrays of equal rank, checked."""
    qx, qy, omega = as_float(qx, "qx"), as_float(qy, "qy"), as_float(omega, "omega")
    check_values("qx", qx, "a wavenumber [rad/m] must be finite")
    check_values("qy", qy, "a wavenumber [rad/m] must be finite")
    check_values("omega", omega, "frequencies [rad/s] must be finite")
    check_together(qx=qx, qy=qy, omega=omega)
    shapes = [x.shape for x in (qx, qy, omega)]
    if is_concrete(qx) and is_concrete(qy) and bool(jnp.any((qx == 0) & (qy == 0))):
        raise ValueError(
            "`qx=0` with `qy=0` is refused: the mean displacement of a block is not determined "
            "by its mean traction (only differences of displacement are meant here)."
        )
    rank = max(map(len, shapes))
    qx, qy, omega = (x.reshape((1,) * (rank - x.ndim) + x.shape) for x in (qx, qy, omega))
    return qx, qy, omega


def moduli_of(stack: Stack, q: Array, omega: Array) -> Moduli:
    """Returns the moduli of a stack of homogeneous layers at the frequencies `omega`."""
    layers = []
    for k, layer in enumerate(stack.layers):
        if not isinstance(layer, Layer):
            raise ValueError(
                f"`layers[{k}]` is a {type(layer).__name__}: the compliance matrix and interior "
                "fields need homogeneous layers: take `sliced(stack, 50)`."
            )
        layers.append(layer)
    base = stack.base
    if isinstance(base, HalfSpace):
        base = (base.material.modulus(omega), base.material.poisson_ratio(omega))
    return moduli(
        q,
        [layer.thickness for layer in layers],
        [layer.material.modulus(omega) for layer in layers],
        [layer.material.poisson_ratio(omega) for layer in layers],
        base,
    )


def moduli(q, thickness, modulus, poisson, base) -> Moduli:
    """Returns the layers as arrays, in units of the largest modulus."""
    bodies = [(jnp.asarray(m), jnp.asarray(p)) for m, p in zip(modulus, poisson, strict=True)]
    if isinstance(base, Rigid | Free):
        bodies.append(bodies[-1])
    else:
        bodies.append((jnp.asarray(base[0]), jnp.asarray(base[1])))
    # In units of the largest modulus, derivatives in float32 neither overflow nor underflow.
    largest = jnp.max(jnp.stack([jnp.max(jnp.abs(m)) for m, _ in bodies]))
    unit = jax.lax.stop_gradient(largest)
    reduced = [(m / unit) / (1 - p * p) for m, p in bodies]
    return Moduli(
        thickness=_stacked(list(thickness), q),
        reduced=_stacked(reduced, q),
        poisson=_stacked([p for _, p in bodies], q),
        unit=unit,
    )


def start_of(base, body: Moduli, like: Array) -> Below:
    """Returns the state of the base's face, of the shape and dtype of `like`."""
    none, one = jnp.zeros_like(like), jnp.ones_like(like)
    if isinstance(base, Rigid):
        return Below(one, none, none, none, none, one, none, none)
    if isinstance(base, Free):
        return Below(none, none, none, none, one, none, one, none)
    c11, c12, c22, det = (c + none for c in half_space(1 - 2 * body.poisson[-1]))
    return Below(one, c11, c12, c22, det, one, one, none - body.poisson[-1])


def lift(below: Below, x: Array, poisson: Array, ratio: Array, ratio_t: Array) -> Below:
    """Returns the state of a slab's upper face from that of its lower face.

    `x` is q d of the slab, `ratio` its E_r over that in whose units `below` is given; `ratio_t`
    that of the shear moduli.
    """
    s, tanh = factors(x, 1 - 2 * poisson), jnp.tanh(x)
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
    split = _split(below, s, split_of(x, 1 - 2 * poisson), tanh, 1 - poisson, n, antiplane[0])
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
        small.held * (n * n_t - both * tanh * c_t)
        + s.p11**2 * along
        + squared * c_t * (n - both)
        + p * across
        + small.free * det * c_t
    )


def sweep(q: Array, body: Moduli, start: Below, thickness: Array) -> Below:
    """Returns the state on top of the layers, given these thicknesses and the base's state."""

    def add(below, layer):
        d, poisson, ratio, ratio_t = layer
        return kept(lift(below, q * d, poisson, ratio, ratio_t), below), None

    ratio, ratio_t = (m[:-1] / m[1:] for m in (body.reduced, body.shear))
    return jax.lax.scan(add, start, (thickness, body.poisson[:-1], ratio, ratio_t), reverse=True)[0]


@jax.jit
def _surface_compliance_matrix(stack, qx, qy, omega):
    return _matrix(qx, qy, moduli_of(stack, jnp.hypot(qx, qy), omega), stack.base)


@jax.jit
def _matrix(qx, qy, body, base):
    q = jnp.hypot(qx, qy)
    like = zeros_for(body, q)
    below = sweep(q, body, start_of(base, body, like), body.thickness)
    unit = (2 / body.unit) / q
    plane = unit / (body.reduced[0] * below.n)
    c11, c12, c22 = (plane * c for c in below[1:4])
    antiplane = unit / (body.shear[0] * below.n_t)
    c_t = antiplane * below.c_t
    a, b = qx / q, qy / q
    i = jnp.asarray(1j, jnp.result_type(c11, jnp.complex64))
    diagonal = (c11 * a * a + c_t * b * b, c11 * b * b + c_t * a * a, c22)
    xy, xz, yz = antiplane * (below.split / below.n) * a * b, -i * c12 * a, -i * c12 * b
    rows = ((diagonal[0], xy, xz), (xy, diagonal[1], yz), (-xz, -yz, diagonal[2]))
    entries = [jnp.broadcast_to(x, like.shape).astype(i.dtype) for row in rows for x in row]
    return jnp.stack(entries, -1).reshape(*like.shape, 3, 3)


def kept(new, old):
    """Returns `new` with the shapes and dtypes of `old`, as the carry of a scan must have."""
    return jax.tree.map(lambda n, o: jnp.broadcast_to(n, o.shape).astype(o.dtype), new, old)


def zeros_for(body: Moduli, *arrays: Array) -> Array:
    """Returns zeros of the shape and dtype to which moduli and `arrays` broadcast."""
    shapes = [body.reduced.shape[1:], body.poisson.shape[1:], *(x.shape for x in arrays)]
    dtype = jnp.result_type(body.reduced, body.poisson, *arrays)
    return jnp.zeros(jnp.broadcast_shapes(*shapes), dtype)


def _stacked(values: list, like: Array) -> Array:
    """Stacks per-layer values of unlike shapes and dtypes, each filled up to the rank of `like`."""
    if not values:
        return jnp.zeros((0,) + (1,) * like.ndim, like.dtype)
    stacked = jnp.stack(jnp.broadcast_arrays(*map(jnp.asarray, values)))
    missing = (1,) * (like.ndim + 1 - stacked.ndim)
    return stacked.reshape(len(values), *missing, *stacked.shape[1:])


def _inverse_size(coordinates: tuple[Array, ...]) -> Array:
    """A constant that keeps homogeneous coordinates from overflowing."""
    parts = [part for x in coordinates for part in (x.real, x.imag)[: 1 + jnp.iscomplexobj(x)]]
    return 1 / functools.reduce(jnp.add, [jnp.abs(jax.lax.stop_gradient(part)) for part in parts])
