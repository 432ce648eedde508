"""Moduli through a graded layer: profile(s, omega) -> (E, ν), s from 0 (bottom) to 1 (top).

A profile is a module called with heights s [1] (0 at the layer's bottom, 1 at its top) and
angular frequencies ω [rad/s] that broadcast against each other; it returns Young's modulus
E [Pa] and Poisson's ratio [1], entry by entry, each of a shape that broadcasts to theirs. Where
a derivative of it jumps, it (or a shape in it) may have an attribute `breaks` (heights strictly
between 0 and 1): the layer is then cut there, and convergence is as fast as without. E and ν
themselves should be continuous; a jump is a boundary between two layers. Fields may be networks
(`equinox.nn`): functions inside a profile are fixed, arrays have derivatives.

The ready profiles vary with height through a shape φ(s). The paper's two (Scaraggi & Comingio,
App. B) are `Blend` with `Linear()` and with `Sinusoidal()`.
"""

import abc
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..core.checks import check_type, instance, is_concrete
from ..core.display import shown
from ..materials.material import AbstractMaterial, material_called
from .shapes import FROM_0_TO_1, AbstractShape, Linear
from .stack import moduli_of

SAMPLES = 64  # intervals of height in which a profile is looked at
_as_shape = instance("shape", AbstractShape, "a shape, such as `Linear()` or `PowerLaw(2.0)`")


@shown(units=False)
class AbstractProfile(eqx.Module):
    """Young's modulus and Poisson's ratio as functions of height and frequency."""

    @abc.abstractmethod
    def __call__(
        self, s: Float[Array, "..."], omega: Inexact[Array, "..."]
    ) -> tuple[Inexact[Array, "..."], Inexact[Array, "..."]]:
        """Returns E [Pa] and ν [1] at heights `s` [1] and frequencies `omega` [rad/s]."""

    def at(self, temperature: ScalarLike) -> "AbstractProfile":
        """Returns the profile with its materials at another temperature [K]."""

        is_material = lambda node: isinstance(node, AbstractMaterial)  # noqa: E731
        moved = lambda node: node.at(temperature) if is_material(node) else node  # noqa: E731
        return jax.tree.map(moved, self, is_leaf=is_material)


class Blend(AbstractProfile):
    """One material passing into another: E from E_bottom(ω) and E_top(ω), by φ(s).

    If `mixing` is "linear", E = (1 - φ) E_bottom + φ E_top and ν = (1 - φ) ν_bottom + φ ν_top, also
    beyond φ = 1: the paper's E = E₀ (1 + s + sin 2πs) is `Blend(Elastic(E0), Elastic(2*E0),
    Sinusoidal())`. If it is "logarithmic", E = E_bottom^(1-φ) E_top^φ, which is positive for any φ
    is, and ν is as above for a shape that never leaves [0, 1] (`Linear`, `Exponential`, `PowerLaw`,
    `ErrorFunction`); for any other it is the average with weights (1 - φ)² and φ², which stays
    between the two.

    **Fields:**

    - `bottom`: the material at φ = 0.
    - `top`: the material at φ = 1.
    - `shape`: φ(s).
    - `mixing`: "linear" or "logarithmic". Static.
    """

    bottom: AbstractMaterial = eqx.field(converter=material_called("bottom"))
    top: AbstractMaterial = eqx.field(converter=material_called("top"))
    shape: AbstractShape = eqx.field(converter=_as_shape, default=Linear())
    mixing: Literal["linear", "logarithmic"] = eqx.field(static=True, default="linear")

    def __check_init__(self):
        check_type("mixing", self.mixing, "linear", "logarithmic")

    def __call__(self, s, omega):
        phi = self.shape(s)
        (bottom, low), (top, high) = moduli_of(self.bottom, omega), moduli_of(self.top, omega)
        if self.mixing == "linear":
            return bottom + phi * (top - bottom), low + phi * (high - low)
        # The complex logarithm stays on its branch: both moduli have positive real parts.
        modulus = bottom * jnp.exp(phi * jnp.log(top / bottom))
        if not isinstance(self.shape, FROM_0_TO_1):
            # Extrapolated, ν might exceed 1/2; cut off, it would have a kink.
            phi = phi**2 / (phi**2 + (1 - phi) ** 2)
        return modulus, low + phi * (high - low)


def moduli_at(profile: Any, s: Array, omega: Array) -> tuple[Array, Array]:
    """Returns E and ν of a profile as arrays: a function may return Python numbers."""
    modulus, poisson = profile(s, omega)
    return jnp.asarray(modulus), jnp.asarray(poisson)


def check_profile(name: str, profile: Any, omega: Inexact[Array, "..."]) -> None:
    """Raises `ValueError` if no solid has the moduli of a profile, if they are known.

    At 65 heights, at the lowest and the highest of the frequencies.
    """
    if not all(map(is_concrete, jax.tree.leaves((profile, omega)))) or not omega.size:
        return
    size = jnp.abs(jnp.ravel(omega))
    omega = jnp.stack([jnp.min(size), jnp.max(size)])
    s = jnp.linspace(0, 1, SAMPLES + 1, dtype=omega.dtype)[:, None]
    try:
        moduli = [np.broadcast_to(part, (s.size, 2)) for part in moduli_at(profile, s, omega)]
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"`{name}` must return a pair (E, ν) that broadcasts to {(s.size, 2)} for s of shape "
            f"{s.shape} and omega of shape {omega.shape}: {error}"
        ) from None
    modulus, poisson = moduli
    good = (np.real(modulus) > 0) & (np.real(poisson) > -1) & (np.real(poisson) <= 0.5 + 1e-6)
    for i, j in np.argwhere(~(good & np.isfinite(modulus) & np.isfinite(poisson)))[:1]:
        raise ValueError(
            f"`{name}` at s={float(s[i, 0]):g}, omega={float(omega[j]):g}: E={modulus[i, j]:g} Pa, "
            f"ν={poisson[i, j]:g}; Re E must be positive and ν between -1 and 1/2."
        )
