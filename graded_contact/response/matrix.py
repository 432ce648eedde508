"""The full surface compliance of a stack: three displacements per three tractions.

Axes are those of the package: x and y in the surface, z into the solid; fields exp(i(q·x + ωt)).
Tractions and displacements are both counted along these axes. The traction is the force per area
that acts on the solid, so that its z component is the pressure in compression, and u = C t:

    C = c11 e_L e_Lᵀ + c_T e_T e_Tᵀ - i c12 (e_L e_zᵀ - e_z e_Lᵀ) + c22 e_z e_zᵀ,

with e_L = q/|q| and e_T = (-q_y, q_x)/|q|. On a half space, in units of 2(1 - ν²)/(E q):
c11 = c22 = 1, c12 = -(1 - 2ν)/(2 - 2ν), c_T = 1/(1 - ν). A frame with z out of the body, as in
`slab`, has both third components reversed: C' = D C D with D = diag(1, 1, -1), which is also
C(-q). Both are reciprocal, C(q)ᵀ = C(-q); for ω > 0 a passive stack has (C - Cᴴ)/2i <= 0.
"""

import functools

import jax.numpy as jnp
from jax import Array
from jaxtyping import Complex

from ..blocks.stack import Stack
from ..core.checks import Numbers, is_concrete
from ..core.compilation import compiled
from .column import climb_through, column_of
from .grading import as_waves, graded_tolerance, solve_graded
from .upwards import FULL, base_face


def surface_compliance_matrix(
    stack: Stack,
    qx: Numbers,
    qy: Numbers,
    omega: Numbers,
    *,
    rtol: float | None = None,
) -> Complex[Array, "*w 3 3"]:
    """Returns the compliance C [m/Pa] from surface tractions to surface displacements.

    Both vectors are along (x, y, z) with z into the solid, the tractions being those acting on
    the solid: C[..., 2, 2] is M_zz.

    **Arguments:**

    - `stack`: the block.
    - `qx`, `qy`: wavevector [rad/m], not both zero.
    - `omega`: angular frequencies ω [rad/s], of either sign.
    - `rtol`: relative tolerance in graded layers, of c11, c22 and c_T each and of c12 over their
      geometric mean; by default that of the stack. If it is not reached, an error is raised.

    **Returns:** C, of the shape to which `qx`, `qy` and `omega` broadcast and two axes of 3.
    """
    qx, qy, omega = wavevectors(stack, qx, qy, omega)
    rtol = graded_tolerance(stack, rtol, qx)
    return _surface_compliance_matrix(stack, qx, qy, omega, rtol)


def wavevectors(stack: Stack, qx: Numbers, qy: Numbers, omega: Numbers) -> tuple[Array, ...]:
    """Returns the arguments as arrays of equal rank, checked."""
    qx, qy, omega = as_waves(stack, qx=qx, qy=qy, omega=omega)
    if is_concrete(qx) and is_concrete(qy) and bool(jnp.any((qx == 0) & (qy == 0))):
        raise ValueError("`qx=0` with `qy=0` is refused: at q = 0 there is no compliance.")
    return qx, qy, omega


@compiled
def _surface_compliance_matrix(stack, qx, qy, omega, rtol):
    q = jnp.hypot(qx, qy)
    (c11, c12, c22, c_t, split), _ = compliance_parts(stack, q, omega, rtol)
    a, b = qx / q, qy / q
    # In the precision of the values: a Python number could raise it.
    i = jnp.asarray(1j, jnp.result_type(c11, jnp.complex64))
    xy, xz, yz = split * a * b, -i * c12 * a, -i * c12 * b
    xx, yy = c11 * a * a + c_t * b * b, c11 * b * b + c_t * a * a
    entries = jnp.broadcast_arrays(xx, xy, xz, xy, yy, yz, -xz, -yz, c22)
    return jnp.stack(entries, -1).astype(i.dtype).reshape(*c11.shape, 3, 3)


def compliance_parts(
    stack: Stack, q: Array, omega: Array, rtol, throw=True
) -> tuple[tuple[Array, ...], Array]:
    """Returns c11, c12, c22, c_T and c11 - c_T [m/Pa], and their relative error.

    `q` and `omega` are of equal rank, unchecked. With `throw` a tolerance that is missed raises.
    """
    column = column_of(stack, q, omega)
    base = base_face(column, jnp.zeros_like(q))

    def climb(add_graded):
        top = climb_through(column, base, FULL, add_graded)
        n, c, n_t, c_t, split = top.state
        unit = (2 / column.unit) / q
        plane, antiplane = unit / (top.reduced * n), unit / (top.shear * n_t)
        return (*(plane * part for part in c[:3]), antiplane * c_t, antiplane * (split / n))

    def measure(differences, values):
        # c12 may vanish where c11 and c22 do not: its error is over their mean.
        along, normal, across = (jnp.sqrt(jnp.abs(values[i])) for i in (0, 2, 3))
        sizes = (along * along, along * normal, normal * normal, across * across, along * across)
        errors = [jnp.abs(d) / size for d, size in zip(differences, sizes, strict=True)]
        return functools.reduce(jnp.maximum, errors)

    return solve_graded(climb, measure, stack, q, omega, rtol, throw)
