"""Laws of interaction between the surfaces: pressure σ as a function of the gap u."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


class HardWall(eqx.Module):
    """No interpenetration and no attraction: σ >= 0, u >= 0, σ u = 0.

    A point is in contact where its pressure is positive.
    """

    def proximal(self, v: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Returns the pressure y with y - v = ρ u for the gap u of this law at pressure y."""
        return jnp.maximum(v, 0)

    def in_contact(self, pressure: Float[Array, "*shape"]) -> Bool[Array, "*shape"]:
        """Returns where the surfaces are in contact."""
        return pressure > 0
