"""The surface compliance M_zz(q, ω) of a stack: normal displacement per pressure, in Fourier space.

Displacement into the solid per pressure in compression, for fields exp(i(q·x + ωt)); passive
solids have Im M_zz <= 0 for ω > 0, and M_zz(-ω) = conj M_zz(ω). Frequency enters through the
complex moduli alone (correspondence principle: R. M. Christensen, Theory of Viscoelasticity,
Academic Press 1982), so that a Poisson's ratio which varies with frequency is one more complex
modulus. (The paper's p₀ formulas differ there; `docs/theory/response.md` shows why they violate
equilibrium.)
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Inexact

from ..blocks.stack import Free, HalfSpace, Rigid, Stack, is_bonded, is_graded, moduli_of
from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    check_poisson,
    check_positive,
    check_values,
    is_concrete,
    short,
)
from ..core.compilation import compiled
from ..core.display import shown
from .column import climb_through, column_of
from .grading import as_waves, graded_tolerance, solve_graded
from .layering import Layering
from .recursion import compliance_of_layers, layers_of
from .upwards import PLANE, base_face, in_plane


def layered_compliance(
    q: Numbers,
    thickness: Numbers,
    modulus: Numbers,
    poisson: Numbers,
    base: Rigid | Free | tuple[Numbers, Numbers],
) -> Inexact[Array, "*w"]:
    """Returns M_zz [m/Pa] of layers given by their moduli at one frequency per entry of `q`.

    **Arguments:**

    - `q`: wavenumbers [rad/m], shape `(*w)`, positive.
    - `thickness`: d [m], shape `(n,)`, surface first; `n = 0` is allowed on a half space.
    - `modulus`: Young's moduli E(ω) [Pa], real or complex, shape `(n,)` or `(n, *w)`.
    - `poisson`: Poisson's ratios [1], real or complex, shape `(n,)` or `(n, *w)`.
    - `base`: `Rigid()`, `Free()`, or the half space's `(modulus, poisson)`.

    **Returns:** M_zz, shape `(*w)`, real if all moduli are.
    """
    q, thickness = as_float(q, "q"), as_float(thickness, "thickness")
    modulus, poisson = as_numbers(modulus, "modulus"), as_numbers(poisson, "poisson")
    check_positive("q", q, "[rad/m]")
    if thickness.ndim != 1:
        raise ValueError(f"`thickness` has shape {thickness.shape}; one axis, layers, is needed.")
    check_values("thickness", thickness, "a thickness [m] is zero or positive", at_least=0)
    for name, value in (("modulus", modulus), ("poisson", poisson)):
        if value.ndim < 1 or value.shape[0] != len(thickness):
            raise ValueError(
                f"`{name}` has shape {value.shape}; its first axis must hold the "
                f"{len(thickness)} layers of `thickness`."
            )
    if not isinstance(base, Rigid | Free):
        if not (isinstance(base, tuple) and len(base) == 2):
            raise ValueError(f"`base={short(base)}` must be Rigid(), Free() or (modulus, poisson).")
        base = as_numbers(base[0], "base[0]"), as_numbers(base[1], "base[1]")
        _check_moduli("base[0]", base[0], "base[1]", base[1])
    elif len(thickness) == 0:
        raise ValueError(f"`thickness` is empty on {short(base)}: there is nothing to deform.")
    _check_moduli("modulus", modulus, "poisson", poisson)
    return compliance_of_layers(q, thickness, modulus, poisson, base)


def surface_compliance(
    stack: Stack,
    q: Numbers,
    omega: Numbers,
    *,
    rtol: float | None = None,
) -> Inexact[Array, "*w"]:
    """Returns the surface compliance M_zz [m/Pa] of a stack.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers |q| [rad/m], positive.
    - `omega`: angular frequencies ω [rad/s], of either sign; a complex ω = -is stands for fields
      exp(st), see `AbstractMaterial`.
    - `rtol`: relative tolerance in graded layers; by default that of the stack. If it is not
      reached, an error is raised; `graded_compliance` returns the estimate. Stacks of
      homogeneous layers are exact, and ignore it.

    **Returns:** M_zz, of the shape to which `q` and `omega` broadcast; complex unless every
    material is elastic.
    """
    q, omega, rtol = _checked(stack, q, omega, rtol)
    return surface_compliance_unchecked(stack, q, omega, rtol)


def effective_modulus(
    stack: Stack,
    q: Numbers,
    omega: Numbers,
    *,
    rtol: float | None = None,
) -> Inexact[Array, "*w"]:
    """Returns 2/(q M_zz) [Pa]: the E/(1-ν²) of the half space with the same response.

    Its imaginary over its real part is the loss tangent of the composite.

    **Arguments:** as in `surface_compliance`.

    **Returns:** the modulus, of the shape to which `q` and `omega` broadcast.
    """
    found = surface_compliance(stack, q, omega, rtol=rtol)
    return 2 / (as_float(q, "q") * found)


@shown()
class GradedCompliance(eqx.Module):
    """A surface compliance with its estimated error.

    **Fields:**

    - `value`: M_zz [m/Pa], shape `(*w)`.
    - `error`: estimated relative error of `value` [1], shape `(*w)`; infinite where that is NaN.
    """

    value: Inexact[Array, "*w"]
    error: Float[Array, "*w"]


def graded_compliance(
    stack: Stack,
    q: Numbers,
    omega: Numbers,
    *,
    rtol: float | None = None,
    throw: bool = True,
) -> GradedCompliance:
    """Returns M_zz of a stack with graded layers, and an estimate of its error.

    **Arguments:**

    - `stack`, `q`, `omega`, `rtol`: as in `surface_compliance`.
    - `throw`: whether a tolerance that is not reached is an error.

    **Returns:** a `GradedCompliance` of the shape to which `q` and `omega` broadcast.
    """
    if not is_graded(stack):
        raise ValueError("`stack` has no `GradedLayer`: use `surface_compliance`.")
    q, omega, rtol = _checked(stack, q, omega, rtol)
    return _graded(stack, q, omega, rtol, throw)


def _checked(stack, q, omega, rtol):
    q = as_float(q, "q")
    check_positive("q", q, "[rad/m]")
    return *as_waves(stack, q=q, omega=omega), graded_tolerance(stack, rtol, q)


def _climb(stack, q, omega):
    """The recursion to M_zz, given what adds a graded layer."""
    column = column_of(stack, q, omega)
    base = in_plane(base_face(column, jnp.zeros_like(q)))

    def climb(add_graded):
        top = climb_through(column, base, PLANE, add_graded)
        return (top.state.c.c22 / top.state.n * (2 / column.unit) / (top.reduced * q),)

    return climb


@compiled
def _graded(stack, q, omega, rtol, throw):
    climb = _climb(stack, q, omega)

    def relative(differences, values):
        return jnp.abs(differences[0]) / jnp.abs(values[0])

    (value,), error = solve_graded(climb, relative, stack, q, omega, rtol, throw)
    return GradedCompliance(value, error)


def compliance_of(stack, q, omega, rtol, *, attempt=False, throw=True) -> Array:
    """Returns M_zz [m/Pa] of a stack at `q` and `omega` of equal rank, unchecked.

    An `attempt` at a graded stack is quick, and returns its result for any error. Without
    `throw` a tolerance that is not reached leaves NaN.
    """
    if is_graded(stack):
        if attempt:
            stack = dataclasses.replace(stack, graded_solver=Layering(retry=False))
        found = _graded(stack, q, omega, rtol, throw and not attempt)
        if attempt or throw:
            # An attempt only counts coefficients: errors show in the table made after it.
            return found.value
        return jnp.where(found.error <= rtol, found.value, jnp.nan)
    if is_bonded(stack):
        (compliance,) = _climb(stack, q, omega)(None)
    else:
        base = stack.base
        if isinstance(base, HalfSpace):
            base = moduli_of(base.material, omega)
        compliance = compliance_of_layers(q, *layers_of(stack, omega), base)
    # Of elastic layers it has the shape of q alone.
    return jnp.broadcast_to(compliance, jnp.broadcast_shapes(q.shape, omega.shape))


surface_compliance_unchecked = compiled(compliance_of)


def log_compliance(stack, q, omega, rtol, attempt) -> Array:
    """Returns log(q M_zz) for a table with the tolerance `rtol`."""
    # The nodes are solved more closely than they are interpolated.
    closer = max(rtol / 4, 400 * float(jnp.finfo(q.dtype).eps))
    found = compliance_of(stack, q, omega, closer, attempt=attempt, throw=False)
    return jnp.log(found * q)


def _check_moduli(modulus_name: str, modulus: Array, poisson_name: str, poisson: Array) -> None:
    check_values(modulus_name, modulus, "a modulus [Pa] must be finite")
    # Moduli may be complex, of any sign of their parts; 0 alone has no compliance.
    if is_concrete(modulus) and bool(jnp.any(modulus == 0)):
        raise ValueError(f"`{modulus_name}` contains 0: a modulus [Pa] must not be 0.")
    if jnp.iscomplexobj(poisson):
        check_values(poisson_name, poisson, "Poisson's ratio must be finite")
    else:
        check_poisson(poisson_name, poisson)
