"""Observables of a contact whose traction moves the surface of the block: where its power goes.

The traction τ along the motion e does the work τ e·u̇ on the block, and the rest of τ v heats the
interface, where the surfaces slip by v - e·u̇. So the friction, the sum of shear and slopes, is

    ⟨τ⟩ - ⟨σ ∂w/∂x⟩ = [-⟨σ ∂w/∂x⟩ - ⟨τ ∂u/∂x⟩] + ⟨τ (1 + ∂u/∂x)⟩,

the part lost in the block, Σ -ω Im(tᴴ C t)/v with t = (τ, σ), plus the heat of the interface. Both
sides agree to rounding.

The law takes the stress σ normal to the mean plane: then the force is right to first order in the
slope. If the law takes the pressure normal to the slope ∂w/∂x, the force is

    τ(σ) - σ ∂w/∂x - τ τ' ∂w/∂x

to this order; the last term is `slope_friction`.
"""

import math

import jax
import jax.numpy as jnp
from jax import Array

from .observables import (
    FOUR,
    Found,
    along_motion,
    friction,
    load,
    loaded,
    of_cycle,
    of_steady,
    rates_of,
    shear_friction,
    shear_power,
    tractions_of,
    tractions_on,
    waves_of,
)


def slip(found: Found) -> Array:
    """Returns the speed of slip over that of the surface [1], on the cell of steady sliding."""
    (along,), moved = along_motion(found), waves_of(found)[1][1]
    shape = loaded(found)[0].shape
    return 1 + found.operator.to_field(1j * along * moved, shape) * math.prod(shape)


@of_steady(
    r"\mu_\mathrm{block}", "1", "friction lost in the block", needs=["coupled"],
    column=("lost in\nthe block", FOUR),
)  # fmt: skip
def block_friction(found: Found) -> Array:
    """The part of the friction that is dissipated in the block [1], by pressure and traction."""
    return friction(found) - interface_friction(found)


@of_steady(
    r"\mu_\mathrm{int}", "1", "friction that heats the interface", needs=["coupled"],
    column=("heat of the\ninterface", FOUR),
)  # fmt: skip
def interface_friction(found: Found) -> Array:
    """The part of the friction that heats the interface [1]; without coupling that of shear."""
    if found.coupling is None:
        return shear_friction(found)
    (stress,) = tractions_on(found)
    return jnp.mean(stress * slip(found)) / load(found)


@of_steady(
    "", "1", "what the slope adds to the friction of shear, to first order", needs=["coupled"],
    stored=False,
)  # fmt: skip
def slope_friction(found: Found) -> Array:
    """What `friction` lacks if the law takes the pressure normal to the slopes [1].

    -⟨τ τ' ∂w/∂x⟩ over the load, see `sliding/traction.py`; f² times the hysteresis for `Coulomb`.
    """
    if found.shear is None:
        return jnp.zeros((), found.pressure.dtype)
    pressure, moved = loaded(found)
    rise = jax.jvp(found.shear, (pressure,), (jnp.ones_like(pressure),))[1]
    (stress,) = tractions_on(found)
    return tractions_of(found, stress * rise, moved)[0] / load(found)


@of_cycle(r"P_\mathrm{int}", "W/m²", "mean power that heats the interface", needs=["coupled"])
def interface_power(found: Found) -> Array:
    """Mean power that heats the interface per area [W/m²].

    The work of friction and of the load is this and `dissipated_power`.
    """
    if found.coupling is None:
        return shear_power(found)
    on_block = zip(tractions_on(found), rates_of(found)[1:], strict=True)
    return shear_power(found) - sum(jnp.mean(stress * rate) for stress, rate in on_block)
