"""What joins the lower side of a layer to what lies below it: springs, or a film of a material.

At a bond the displacement jumps and the traction does not: traction = stiffness × jump, per area,
along each tangent and along the normal. A stiffness is the ratio of a `firmness` and a `give`, so
that both a perfect bond (give 0) and a smooth interface (firmness 0) are finite numbers.
"""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..core.checks import as_scalar, check_values, is_concrete
from ..core.display import shown
from ..materials.material import AbstractMaterial, material_called


class Give(NamedTuple):
    """Stiffnesses of a bond [Pa/m], each a firmness over a give of any common unit."""

    normal_firmness: Inexact[Array, "*w"]
    normal_give: Inexact[Array, "*w"]
    shear_firmness: Inexact[Array, "*w"]
    shear_give: Inexact[Array, "*w"]


def as_thickness(zero: str) -> Callable[[Any], Float[Array, ""]]:
    """Returns the converter of a thickness [m], where 0 means `zero`."""

    def convert(value: Any) -> Float[Array, ""]:
        value = as_scalar(value, "thickness")
        allowed = f"a thickness [m] is zero ({zero}) or positive"
        check_values("thickness", value, allowed, at_least=0)
        return value

    return convert


def _as_stiffness(name: str, allowed: str, least: float) -> Callable[[Any], Float[Array, ""]]:
    def convert(value: Any) -> Float[Array, ""]:
        value = as_scalar(value, name)
        if not (is_concrete(value) and np.asarray(value) == np.inf):
            check_values(name, value, allowed, at_least=least)
        return value

    return convert


_NORMAL = "a normal stiffness [Pa/m] is positive, or `inf` for a perfect bond"
_SHEAR = "a shear stiffness [Pa/m] is 0 for a smooth interface, positive, or `inf`"
_LEAST = float(np.finfo(np.float32).tiny)  # compiled code takes what is smaller for 0


class AbstractBond(eqx.Module):
    """What joins the lower side of a layer to what lies below it."""

    @abc.abstractmethod
    def gives(self, omega: Inexact[Array, "*w"]) -> Give:
        """Returns the stiffnesses at angular frequencies `omega` [rad/s], complex in transient
        motion."""

    @abc.abstractmethod
    def at(self, temperature: ScalarLike) -> "AbstractBond":
        """Returns the bond at another temperature [K]."""


@shown(units=False)
class Bond(AbstractBond):
    """Springs between two faces; `Bond(shear=0)` is a smooth interface, without friction.

    **Fields:**

    - `normal`: normal stress over the opening, k_n [Pa/m], positive; by default infinite. A
      pressure closes it as a tension opens it, so that it cannot be 0: a gap is not linear.
    - `shear`: shear stress over the slip, k_s [Pa/m], zero or positive; by default infinite.
    """

    normal: Float[Array, ""] = eqx.field(
        converter=_as_stiffness("normal", _NORMAL, _LEAST), default=np.inf
    )
    shear: Float[Array, ""] = eqx.field(converter=_as_stiffness("shear", _SHEAR, 0), default=np.inf)

    def gives(self, omega: Inexact[Array, "*w"]) -> Give:
        return Give(*_pair(self.normal, self.normal > 0), *_pair(self.shear, self.shear >= 0))

    def at(self, temperature: ScalarLike) -> "Bond":
        return self


def _pair(stiffness, allowed):
    """Firmness and give of a stiffness; NaN for a traced one that the constructor would refuse."""
    perfect = jnp.isinf(stiffness)
    firmness = jnp.where(perfect, 1, jnp.where(allowed, stiffness, jnp.nan))
    return firmness, jnp.where(perfect, jnp.zeros_like(stiffness), 1)


def is_smooth(bond: AbstractBond | None) -> bool:
    """Returns whether a bond is known to have no shear stiffness."""
    return isinstance(bond, Bond) and is_concrete(bond.shear) and float(bond.shear) == 0


@shown(units=False)
class Film(AbstractBond):
    """A film of a material, so thin that it yields as springs: a coat of glue, dirt or tack.

    Its stiffnesses are k_n = E (1 - ν)/[(1 + ν)(1 - 2ν) d], under no lateral strain, and
    k_s = E/[2 (1 + ν) d]. It adds nothing to the depth of the layers.

    **Fields:**

    - `material`: the material of the film.
    - `thickness`: d [m]. Zero means a perfect bond.
    """

    material: AbstractMaterial = eqx.field(converter=material_called("material"))
    thickness: Float[Array, ""] = eqx.field(converter=as_thickness("a perfect bond"))

    def gives(self, omega: Inexact[Array, "*w"]) -> Give:
        modulus = jnp.asarray(self.material.modulus(omega))
        poisson = jnp.asarray(self.material.poisson_ratio(omega))
        # As of traced stiffnesses, what the constructor would refuse gives no number.
        give = jnp.where(self.thickness >= 0, self.thickness, jnp.nan) * (1 + poisson)
        return Give(modulus * (1 - poisson), give * (1 - 2 * poisson), modulus, 2 * give)

    def at(self, temperature: ScalarLike) -> "Film":
        return Film(self.material.at(temperature), self.thickness)
