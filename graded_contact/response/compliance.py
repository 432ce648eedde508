"""The surface compliance of a stack, in Fourier space: M_zz(q, ω), and the full 3×3 matrix C.

M_zz is the normal displacement into the solid per pressure in compression, for fields
exp(i(q·x + ωt)). Passive solids have Im M_zz <= 0 for ω > 0, and M_zz(-ω) = conj M_zz(ω). Frequency
enters through the complex moduli alone (correspondence principle: R. M. Christensen, Theory of
Viscoelasticity, Academic Press 1982), so that a Poisson's ratio which varies with frequency is one
more complex modulus. (The paper's p₀ formulas differ there; `docs/theory/response.md` shows why
they violate equilibrium.)

C has the axes of the package: x and y in the surface, z into the solid. Tractions and
displacements are both counted along these axes. The traction is the force per area that acts on the
solid, so that its z component is the pressure in compression, and u = C t:

    C = c11 e_L e_Lᵀ + c_T e_T e_Tᵀ - i c12 (e_L e_zᵀ - e_z e_Lᵀ) + c22 e_z e_zᵀ,

with e_L = q/|q| and e_T = (-q_y, q_x)/|q|. On a half space, in units of 2(1 - ν²)/(E q):
c11 = c22 = 1, c12 = -(1 - 2ν)/(2 - 2ν), c_T = 1/(1 - ν). A frame with z out of the body, as in
`slab`, has both third components reversed: C' = D C D with D = diag(1, 1, -1), which is also
C(-q). Both are reciprocal, C(q)ᵀ = C(-q); for ω > 0 a passive stack has (C - Cᴴ)/2i <= 0.
"""

import functools
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Inexact

from ..blocks.stack import Stack
from ..core.checks import Numbers, as_float, check_positive, is_concrete
from ..core.compilation import compiled
from .column import climb_through, column_of
from .grading import as_waves, graded_tolerance, solve_graded
from .layers import of_layers
from .upwards import FULL, PLANE, base_face, in_plane


def surface_compliance(stack: Stack, q: Numbers, omega: Numbers, *, error: bool = False) -> Any:
    """Returns the surface compliance M_zz [m/Pa] of a stack.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers |q| [rad/m], positive.
    - `omega`: angular frequencies ω [rad/s], of either sign; a complex ω = -is stands for fields
      exp(st), see `AbstractMaterial`.
    - `error`: whether to return `(M_zz, error)` with the estimated relative error [1], infinite
      where M_zz is NaN. Then a tolerance that is not reached raises nothing.

    **Returns:** M_zz, of the shape to which `q` and `omega` broadcast; complex unless every
    material is elastic.

    **Raises:** `ValueError` for a refused argument; `RuntimeError` if graded layers do not reach
    the tolerance of the stack's `graded_solver`. Homogeneous layers are exact.
    """
    q = as_float(q, "q")
    check_positive("q", q, "[rad/m]")
    q, omega = as_waves(stack, q=q, omega=omega)
    found = _compliance(stack, q, omega, graded_tolerance(stack, q), not error)
    return found if error else found[0]


def effective_modulus(stack: Stack, q: Numbers, omega: Numbers) -> Inexact[Array, "*w"]:
    """Returns 2/(q M_zz) [Pa]: the E/(1-ν²) of the half space with the same response.

    Its imaginary over its real part is the loss tangent of the composite.

    **Arguments:** as in `surface_compliance`.

    **Returns:** the modulus, of the shape to which `q` and `omega` broadcast.
    """
    return 2 / (as_float(q, "q") * surface_compliance(stack, q, omega))


def surface_compliance_matrix(
    stack: Stack, qx: Numbers, qy: Numbers, omega: Numbers
) -> Inexact[Array, "*w 3 3"]:
    """Returns the compliance C [m/Pa] from surface tractions to surface displacements.

    Both vectors are along (x, y, z) with z into the solid, the tractions being those acting on
    the solid: C[..., 2, 2] is M_zz.

    **Arguments:**

    - `stack`: the block.
    - `qx`, `qy`: wavevector [rad/m], not both zero.
    - `omega`: angular frequencies ω [rad/s], of either sign.

    **Returns:** C, of the shape to which `qx`, `qy` and `omega` broadcast and two axes of 3.
    """
    qx, qy, omega = wavevectors(stack, qx, qy, omega)
    return _matrix(stack, qx, qy, omega, graded_tolerance(stack, qx))


def wavevectors(stack: Stack, qx: Numbers, qy: Numbers, omega: Numbers) -> tuple[Array, ...]:
    """Returns the arguments as arrays of equal rank, checked."""
    qx, qy, omega = as_waves(stack, qx=qx, qy=qy, omega=omega)
    if is_concrete(qx) and is_concrete(qy) and bool(jnp.any((qx == 0) & (qy == 0))):
        raise ValueError("`qx=0` with `qy=0` is refused: at q = 0 there is no compliance.")
    return qx, qy, omega


def compliance_of(
    stack: Stack, q: Array, omega: Array, rtol: float, throw: bool
) -> tuple[Array, Array]:
    """Returns M_zz [m/Pa] and its relative error, at `q` and `omega` of equal rank, unchecked.

    With `throw` a tolerance that is missed raises.
    """
    column = column_of(stack, q, omega)
    base = in_plane(base_face(column.base, jnp.zeros_like(q)))

    def climb(add_graded):
        if add_graded is None and column.runs:
            found = of_layers(q, column.runs[0][1:], column.base)
        else:
            top = climb_through(column, base, PLANE, add_graded)
            found = top.state.c.c22 / top.state.n / top.reduced
        return (found * (2 / column.unit) / q,)

    def relative(differences, values):
        return jnp.abs(differences[0]) / jnp.abs(values[0])

    (value,), error = solve_graded(climb, relative, stack, q, omega, rtol, throw)
    # Of elastic layers it has the shape of q alone.
    return jnp.broadcast_to(value, jnp.broadcast_shapes(q.shape, omega.shape)), error


_compliance = compiled(compliance_of)


def surface_compliance_unchecked(stack: Stack, q: Array, omega: Array, rtol: float) -> Array:
    """Returns `surface_compliance` at `q` and `omega` of equal rank, unchecked."""
    return _compliance(stack, q, omega, rtol, True)[0]


def compliance_or_nan(stack: Stack, q: Array, omega: Array, rtol: float) -> Array:
    """Returns M_zz [m/Pa] at `q` and `omega` of equal rank, NaN where the tolerance is missed."""
    value, error = compliance_of(stack, q, omega, rtol, throw=False)
    return jnp.where(error <= rtol, value, jnp.nan)


def compliance_parts(
    stack: Stack, q: Array, omega: Array, rtol: float, throw: bool
) -> tuple[tuple[Array, ...], Array]:
    """Returns c11, c12, c22 and c_T [m/Pa] and their relative error, as `compliance_of`."""
    column = column_of(stack, q, omega)
    base = base_face(column.base, jnp.zeros_like(q))

    def climb(add_graded):
        top = climb_through(column, base, FULL, add_graded)
        n, c, n_t, c_t = top.state
        unit = (2 / column.unit) / q
        plane, antiplane = unit / (top.reduced * n), unit / (top.shear * n_t)
        return (*(plane * part for part in c[:3]), antiplane * c_t)

    def measure(differences, values):
        # c12 may vanish where c11 and c22 do not: its error is over their mean.
        along, normal, across = (jnp.sqrt(jnp.abs(values[i])) for i in (0, 2, 3))
        sizes = (along * along, along * normal, normal * normal, across * across)
        errors = [jnp.abs(d) / size for d, size in zip(differences, sizes, strict=True)]
        return functools.reduce(jnp.maximum, errors)

    return solve_graded(climb, measure, stack, q, omega, rtol, throw)


@compiled
def _matrix(stack, qx, qy, omega, rtol):
    q = jnp.hypot(qx, qy)
    c11, c12, c22, c_t = compliance_parts(stack, q, omega, rtol, throw=True)[0]
    a, b = qx / q, qy / q
    # In the precision of the values: a Python number could raise it.
    i = jnp.asarray(1j, jnp.result_type(c11, jnp.complex64))
    xy, xz, yz = (c11 - c_t) * a * b, -i * c12 * a, -i * c12 * b
    xx, yy = c11 * a * a + c_t * b * b, c11 * b * b + c_t * a * a
    entries = jnp.broadcast_arrays(xx, xy, xz, xy, yy, yz, -xz, -yz, c22)
    return jnp.stack(entries, -1).astype(i.dtype).reshape(*c11.shape, 3, 3)
