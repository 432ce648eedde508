"""Strain softening: filled rubber is softer at larger strain amplitude (Payne's effect).

A strain sweep gives the factors f(ε) of E' and g(ε) of E''. The modulus at one amplitude is used as
the modulus of a linear solid. (Factors that are equal at every frequency obey the relation of
Kramers and Kronig only if f = g.)

Source of the effect: A. R. Payne, J. Appl. Polym. Sci. 6 (1962) 57,
doi:10.1002/app.1962.070061906.
"""

from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Inexact, ScalarLike

from ..core.checks import Numbers, as_float, check_ascending, is_concrete, positive, scalar
from ..core.spline import monotone_cubic
from .material import AbstractMaterial, material_called

T = TypeVar("T")
STRAIN = "a strain [1] is 0 or positive"


class StrainSoftening(AbstractMaterial):
    """A material whose modulus depends on the strain amplitude, E = f(ε) E' + i g(ε) E''.

    The logarithms of f and g are interpolated by monotone cubics in log ε; outside the table f and
    g keep the values at its ends. Poisson's ratio and the shift with temperature are the
    material's.

    **Fields:**

    - `material`: at small strain, or where f = g = 1.
    - `strain`: amplitudes ε [1], shape `(points,)`, positive and increasing.
    - `storage`, `loss`: f and g [1], shape `(points,)`, positive.
    - `amplitude`: ε of the modulus [1], 0 for that at the first entry; see `at_strain`.
    """

    material: AbstractMaterial = eqx.field(converter=material_called("material"))
    strain: Float[Array, " points"] = eqx.field(converter=positive("strain", "[1]", as_float))
    storage: Float[Array, " points"] = eqx.field(converter=positive("storage", "[1]", as_float))
    loss: Float[Array, " points"] = eqx.field(converter=positive("loss", "[1]", as_float))
    amplitude: Float[Array, ""] = eqx.field(
        converter=scalar("amplitude", STRAIN, at_least=0), default=0.0
    )

    def __check_init__(self):
        check_ascending(2, strain=self.strain, storage=self.storage, loss=self.loss)

    def factors(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Returns f and g [1] at the amplitude."""
        # Clipped before its logarithm, which at 0 has no derivative.
        amplitude = self.amplitude.astype(self.strain.dtype)
        at = jnp.log(jnp.clip(amplitude, self.strain[0], self.strain[-1]))
        nodes, rows = jnp.log(self.strain), (self.storage, self.loss)
        storage, loss = (jnp.exp(monotone_cubic(nodes, jnp.log(row), at)) for row in rows)
        return storage, loss

    def complex_modulus(self, omega: Numbers) -> Inexact[Array, "*w"]:
        modulus, (storage, loss) = self.material.complex_modulus(omega), self.factors()
        if jnp.iscomplexobj(omega):
            return _if_equal(storage, loss) * modulus
        # An elastic material has no loss, and stays real.
        if not jnp.issubdtype(modulus.dtype, jnp.complexfloating):
            return storage * modulus
        return jax.lax.complex(storage * modulus.real, loss * modulus.imag)

    def poisson_ratio(self, omega: Numbers) -> Inexact[Array, "..."]:
        return self.material.poisson_ratio(omega)

    def at(self, temperature: ScalarLike) -> "StrainSoftening":
        return eqx.tree_at(lambda m: m.material, self, self.material.at(temperature))


def _if_equal(storage: Array, loss: Array) -> Array:
    """The factor of the modulus at complex frequencies, where only f = g has one; else NaN."""
    equal = jnp.abs(storage - loss) <= 1e-9 * storage
    if is_concrete(equal) and not np.all(equal):
        raise ValueError(
            f"`StrainSoftening` with the factors {storage:.4g} of E' and {loss:.4g} of E'' is "
            "refused: a transient motion needs one factor, since with two the modulus at complex "
            "frequencies belongs to no causal solid. Give `loss=storage`."
        )
    return jnp.where(equal, storage, jnp.nan)


def at_strain(block: T, strain: ScalarLike) -> T:
    """Returns a material, layer or stack with its `StrainSoftening` at one strain amplitude.

    **Arguments:**

    - `block`: a material, a layer, a `Stack`, or any tree of them.
    - `strain`: ε [1], not negative.

    **Returns:** the block with its moduli at this amplitude.

    **Raises:** `ValueError` if no material of the block softens.
    """
    amplitude = scalar("strain", STRAIN, at_least=0)(strain)
    if not softens(block):
        raise ValueError("`block` holds no `StrainSoftening`: no modulus depends on the strain.")

    def changed(node):
        return eqx.tree_at(lambda m: m.amplitude, node, amplitude) if _is_soft(node) else node

    return jax.tree.map(changed, block, is_leaf=_is_soft)


def _is_soft(node: Any) -> bool:
    return isinstance(node, StrainSoftening)


def softens(block: Any) -> bool:
    """Returns whether a material of the block softens with the strain."""
    return any(map(_is_soft, jax.tree.leaves(block, is_leaf=_is_soft)))


def as_strain_per_slope(value: ScalarLike, stack: Any) -> Float[Array, ""]:
    """Returns ε over an rms slope [1]; raises `ValueError` unless positive, and `stack` softens."""
    ratio = positive("strain_per_slope", "[1]")(value)
    if not softens(stack):
        raise ValueError(
            f"`strain_per_slope={value}` is refused: `stack` holds no `StrainSoftening`."
        )
    return ratio
