"""Traction that moves the surface of the block: its kernels, and where its power goes.

In gross sliding the shear stress τ acts on the block along the motion e. It moves the surface by
M_ze τ along z, so that

    w = M_zz σ + M_ze τ(σ).

On the counterface, if there is one, it acts in the opposite direction (`bodies.py`).

Under Coulomb's law in steady sliding, w = (M_zz + f M_ze) σ: a contact without traction, of another
kernel, whose real part may be negative for some waves. Under other laws, and where the direction
changes with time, the traction lags (`isothermal.py`).

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
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Bool

from ...blocks.stack import Stack
from ...core.checks import as_float
from ...fields.frequency import direction_and_speed
from ...fields.grid import Grid, Waves
from ...kernels.tangential import tangential_kernels
from ...kernels.window import without_images
from ..bodies import Coupling
from ..case import COUPLED, Case
from ..energy import powers_of_traction, waves_of
from ..formulas import along_motion, loaded, mean_load, shear_power, tractions_on
from ..number import Found, observable
from ..shear import Coulomb
from .friction import friction, shear_friction


def steady_coupling(
    case: Case,
    stack: Stack,
    velocity: Any,
    cells: Sequence[Grid],
    strain: tuple[Array, Array] | None,
) -> tuple[Coupling, Waves | None, Bool[Array, ""]]:
    """Returns the coupling of a body of a `Case`, errors of M_ze, and whether it is good.

    `velocity` is the surface's over the body; `cells` are the cell of a periodic surface,
    or the two of a window, which has errors.
    """
    if len(cells) == 2 and not isinstance(case.shear, Coulomb):
        raise ValueError(
            "`shear` is refused: on a window only the traction of `Coulomb` can move the surface. "
            "Pass `coupled=False`, or put the body into a periodic cell."
        )
    direction, velocity = direction_and_speed(case.velocity)[0], as_float(velocity)
    found = [tangential_kernels(stack, cell, velocity, direction, strain) for cell in cells]
    ((lift,), ((along,),), good), error = found[0], None
    if len(cells) == 2:
        ((far_lift,), ((far_along,),), far_good), window = found[1], case.surface.grid
        lift, error = without_images(lift, far_lift, window, False)
        along, _ = without_images(along, far_along, window, False)
        good = good & far_good
    return Coupling((lift,), ((along,),), isinstance(case.shear, Coulomb)), error, good


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
