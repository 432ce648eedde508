"""The surface compliance M_zz(q, ω) of a stack: normal displacement per pressure, in Fourier space.

Displacement into the solid per pressure in compression, for fields exp(i(q·x + ωt)); passive
solids have Im M_zz <= 0 for ω > 0, and M_zz(-ω) = conj M_zz(ω). Frequency enters through the
complex moduli alone (correspondence principle: R. M. Christensen, Theory of Viscoelasticity,
Academic Press 1982), so that a Poisson's ratio which varies with frequency is one more complex
modulus. (The paper's p₀ formulas differ there; `docs/theory.md` shows why they violate
equilibrium.)
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact

from .._checks import (
    Numbers,
    as_float,
    as_numbers,
    check_poisson,
    check_positive,
    check_together,
    check_values,
    door,
    is_concrete,
)
from ..rheology.material import AbstractMaterial
from .grading import Layering, check_profiles, graded_tolerance, solve_graded
from .recursion import UNROLLED_LAYERS, compliance_of_layers
from .stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack


@door
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
            raise ValueError(f"`base={base!r}` must be Rigid(), Free() or (modulus, poisson).")
        base = (as_numbers(base[0], "base[0]"), as_numbers(base[1], "base[1]"))
        _check_moduli("base[0]", base[0], "base[1]", base[1])
    elif len(thickness) == 0:
        raise ValueError(f"`thickness` is empty on {base!r}: there is nothing to deform.")
    _check_moduli("modulus", modulus, "poisson", poisson)
    return compliance_of_layers(q, thickness, modulus, poisson, base)


@door
def surface_compliance(
    stack: Stack, q: Numbers, omega: Numbers, rtol: float | None = None
) -> Inexact[Array, "*w"]:
    """Returns the surface compliance M_zz [m/Pa] of a stack.

    **Arguments:**

    - `stack`: the block.
    - `q`: wavenumbers |q| [rad/m], positive.
    - `omega`: angular frequencies ω [rad/s], of either sign.
    - `rtol`: relative tolerance in graded layers; by default 1e-9, in float32 1e-4. If it is not
      reached, an error is raised; `graded_compliance` returns the estimate. Stacks of
      homogeneous layers are exact, and ignore it.

    **Returns:** M_zz, of the shape to which `q` and `omega` broadcast; complex unless every
    material is elastic.
    """
    q, omega = as_float(q, "q"), as_float(omega, "omega")
    check_positive("q", q, "[rad/m]")
    check_values("omega", omega, "frequencies [rad/s] must be finite")
    check_together(q=q, omega=omega)
    check_profiles(stack, omega)
    rtol = graded_tolerance(rtol, q)
    return surface_compliance_unchecked(stack, *_same_rank(q, omega), rtol)


@door
def effective_modulus(
    stack: Stack, q: Numbers, omega: Numbers, rtol: float | None = None
) -> Inexact[Array, "*w"]:
    """Returns 2/(q M_zz) [Pa]: the E/(1-ν²) of the half space that would respond alike.

    Its imaginary over its real part is the loss tangent of the composite. Arguments as in
    `surface_compliance`.
    """
    return 2 / (as_float(q, "q") * surface_compliance(stack, q, omega, rtol))


@eqx.filter_jit
def surface_compliance_unchecked(stack, q, omega, rtol=None):
    """`q` and `omega` of equal rank: a modulus is computed once per entry of `omega`."""
    return compliance_of(prepared(stack), q, omega, rtol)


def compliance_of(stack, q, omega, rtol=None, *, attempt=False, throw=True):
    """As `surface_compliance_unchecked`, of a `prepared` stack.

    An `attempt` at a graded stack is quick, and returns what it found whatever its error. Without
    `throw` a tolerance that is not reached leaves NaN.
    """
    if isinstance(stack, ManyLayers):
        thickness = stack.thickness
        modulus, poisson = stack.moduli(omega)
    elif is_graded(stack):
        rtol = graded_tolerance(rtol, q)
        solver = Layering(retry=not attempt)
        found = solve_graded(stack, q, omega, solver, rtol, throw=throw and not attempt)
        if attempt or throw:
            return found.value
        return jnp.where(found.error <= rtol, found.value, jnp.nan)
    else:
        thickness = [layer.thickness for layer in stack.layers]
        modulus = [layer.material.modulus(omega) for layer in stack.layers]
        poisson = [layer.material.poisson_ratio(omega) for layer in stack.layers]
    base = stack.base
    if isinstance(base, HalfSpace):
        base = (base.material.modulus(omega), base.material.poisson_ratio(omega))
    compliance = compliance_of_layers(q, thickness, modulus, poisson, base)
    return jnp.broadcast_to(compliance, jnp.broadcast_shapes(q.shape, omega.shape))


class ManyLayers(NamedTuple):
    """A long stack: materials of one kind in one, so that compilation does not grow with them."""

    thickness: Float[Array, " n"]
    kinds: list[AbstractMaterial]  # their leaves have the materials along a first axis
    order: np.ndarray  # takes the layers from kind after kind to their places
    base: HalfSpace | Rigid | Free

    def moduli(self, omega: Float[Array, "..."]) -> tuple[Array, Array]:
        """E and ν at `omega`, with the layers along a first axis."""
        found = [
            jax.vmap(lambda m: (m.modulus(omega), m.poisson_ratio(omega)))(kind)
            for kind in self.kinds
        ]
        modulus = [e for e, _ in found]
        poisson = [nu.reshape(nu.shape + (1,) * (e.ndim - nu.ndim)) for e, nu in found]
        shape = jnp.broadcast_shapes(*[nu.shape[1:] for nu in poisson])
        poisson = [jnp.broadcast_to(nu, (len(nu), *shape)) for nu in poisson]
        return jnp.concatenate(modulus)[self.order], jnp.concatenate(poisson)[self.order]


def prepared(stack: Stack) -> Stack | ManyLayers:
    """Returns a stack in the form in which it is solved often."""
    materials = [layer.material for layer in stack.layers if isinstance(layer, Layer)]
    if len(materials) < len(stack.layers) or len(materials) <= UNROLLED_LAYERS:
        return stack
    kinds = {}
    for i, material in enumerate(materials):
        leaves, structure = jax.tree.flatten(material)
        kinds.setdefault((structure, *[jnp.shape(leaf) for leaf in leaves]), []).append(i)
    return ManyLayers(
        jnp.stack([layer.thickness for layer in stack.layers]),
        [
            jax.tree.map(lambda *leaves: jnp.stack(leaves), *[materials[i] for i in members])
            for members in kinds.values()
        ],
        np.argsort(np.concatenate(list(kinds.values()))),
        stack.base,
    )


def is_graded(stack: Stack) -> bool:
    return any(isinstance(layer, GradedLayer) for layer in stack.layers)


def _same_rank(q: Array, omega: Array) -> tuple[Array, Array]:
    rank = max(q.ndim, omega.ndim)
    q = q.reshape((1,) * (rank - q.ndim) + q.shape)
    return q, omega.reshape((1,) * (rank - omega.ndim) + omega.shape)


def _check_moduli(modulus_name: str, modulus: Array, poisson_name: str, poisson: Array) -> None:
    for part in (modulus.real, modulus.imag):
        check_values(modulus_name, part, "a modulus [Pa] must be finite")
    if is_concrete(modulus) and bool(jnp.any(modulus == 0)):
        raise ValueError(f"`{modulus_name}` holds a zero: a modulus [Pa] must not vanish.")
    if jnp.iscomplexobj(poisson):
        for part in (poisson.real, poisson.imag):
            check_values(poisson_name, part, "Poisson's ratio must be finite")
    else:
        check_poisson(poisson_name, poisson)
