"""Where the power of a traction goes that moves the surface of the block (`solve/coupling.py`).

The traction does the work τ e·u̇ on the block, and the rest of τ v heats the interface, where the
surfaces slip by v - e·u̇. So the friction, the sum of shear and slopes, is

    ⟨τ⟩ - ⟨σ ∂w/∂x⟩ = [-⟨σ ∂w/∂x⟩ - ⟨τ ∂u/∂x⟩] + ⟨τ (1 + ∂u/∂x)⟩,

the part lost in the block, Σ -ω Im(tᴴ C t)/v with t = (τ, σ), plus the heat of the interface. Both
sides agree to rounding.

The law takes the stress σ normal to the mean plane: then the force is right to first order in the
slope. If the law takes the pressure normal to the slope ∂w/∂x, the force is to this order

    τ(σ) - σ ∂w/∂x - τ τ' ∂w/∂x.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array

from ..case import COUPLED
from ..energy import powers_of_traction, waves_of
from ..formulas import along_motion, loaded, mean_load, shear_power, tractions_on
from ..number import Found, observable
from .friction import friction, shear_friction


def slip(found: Found) -> Array:
    """Returns the speed of slip over the speed of sliding [1], on the cell of steady sliding."""
    (along,), moved = along_motion(found), waves_of(found)[0][1][1]
    shape = loaded(found)[0].shape
    return 1 + found.operator.to_field(1j * along * moved, shape) * math.prod(shape)


@observable("friction lost in the block", needs=[COUPLED])
def block_friction(found: Found) -> Array:
    """The part of the friction that is dissipated in the block [1], by pressure and traction."""
    return friction(found) - interface_friction(found)


@observable("friction that heats the interface", needs=[COUPLED])
def interface_friction(found: Found) -> Array:
    """The part of the friction that heats the interface [1]; without coupling `shear_friction`."""
    if found.coupling is None:
        return shear_friction(found)
    (stress,) = tractions_on(found)
    return jnp.mean(stress * slip(found)) / mean_load(found)


@observable("mean power that heats the interface", "W/m²", needs=[COUPLED])
def interface_power(found: Found) -> Array:
    """Mean power that heats the interface per area [W/m²].

    The work of friction and of the load is this, `dissipated_power` and `counterface_power`.
    """
    if found.coupling is None:
        return shear_power(found)
    return shear_power(found) - sum(map(jnp.mean, powers_of_traction(found)))
