"""Frictional shear stress in the real contact, τ_f(pressure, speed, temperature).

A law is called as law(pressure, speed, temperature) with the contact pressure σ [Pa], the sliding
speed v [m/s] and the temperature of the contact T [K] or None. It returns τ_f [Pa], one number or
one for each pressure. Any function will do; only a module, such as a subclass of `AbstractShear`,
has parameters that can be differentiated, and each new function is compiled anew.

The shear force is the integral of τ_f over the contact area. It opposes the motion and adds to the
hysteresis. If the law is `coupled`, the traction moves the surface of the block and so changes the
pressure, see `solve/steady.py`. `Coulomb` is coupled unless `coupled=False`; other
laws are coupled on request. Without coupling the traction does not change the pressure: this is
exact for an incompressible half space (ν = 1/2), whose surface does not move along z under a
tangential traction, and an approximation for other blocks.

Source of the peak in the logarithm of the velocity: B. Lorenz, Y. R. Oh, S. K. Nam, S. H. Jeon,
B. N. J. Persson, J. Chem. Phys. 142 (2015) 194701, doi:10.1063/1.4919221 (its abstract was read,
not the formula).
"""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, ScalarLike

from ..contacts import area
from ..core.checks import check_type, positive, scalar, short
from ..core.display import shown
from ..fields.frequency import direction_and_speed
from ..materials.shift import AbstractShift, as_temperature

ShearLaw = Callable[..., Any]
SHEAR_STRESS = "a shear stress [Pa] is zero or positive"


@shown(units=False)
class AbstractShear(eqx.Module):
    """A law of the frictional shear stress in the contact.

    If it has an attribute `coupled` that is true, its traction moves the surface of the block.
    """

    @abc.abstractmethod
    def __call__(
        self,
        pressure: Float[Array, "*shape"],
        speed: Float[Array, ""],
        temperature: Float[Array, ""] | None,
    ) -> Float[Array, "..."]:
        """Returns τ_f [Pa] at a pressure [Pa], a speed [m/s] and a temperature [K]."""


class Coulomb(AbstractShear):
    """A shear stress in proportion to the pressure, τ_f = f σ.

    **Fields:**

    - `coefficient`: f [1], zero or positive.
    - `coupled`: whether the traction moves the surface of the block. Static.
    """

    coefficient: Float[Array, ""] = eqx.field(
        converter=scalar("coefficient", "f [1] is zero or positive", at_least=0)
    )
    coupled: bool = eqx.field(default=True, static=True)

    def __call__(self, pressure, speed, temperature):
        return self.coefficient * pressure


class ConstantShear(AbstractShear):
    """The same shear stress everywhere in the contact, at every speed.

    **Fields:**

    - `stress`: τ_f [Pa], zero or positive.
    - `coupled`: whether the traction moves the surface of the block. Static.
    """

    stress: Float[Array, ""] = eqx.field(converter=scalar("stress", SHEAR_STRESS, at_least=0))
    coupled: bool = eqx.field(default=False, static=True)

    def __call__(self, pressure, speed, temperature):
        return self.stress


class PeakedShear(AbstractShear):
    """A peak in the logarithm of the velocity, τ_f = τ0 exp(-c [log10(a_T v/v*)]²).

    Chains that stick to the surface, stretch and slip relax in a time that the temperature shifts:
    a_T v takes the place of v. At rest τ_f is 0.

    **Fields:**

    - `peak`: τ0 [Pa], the largest shear stress; zero or positive.
    - `velocity`: v* [m/s], the velocity of the peak at the reference temperature of `shift`.
    - `steepness`: c [1]; the peak falls to 1/e over 1/√c decades on either side.
    - `shift`: law of time-temperature superposition (`Arrhenius` or `WLF`), or None if τ_f does
      not depend on temperature.
    - `coupled`: whether the traction moves the surface of the block. Static.
    """

    peak: Float[Array, ""] = eqx.field(converter=scalar("peak", SHEAR_STRESS, at_least=0))
    velocity: Float[Array, ""] = eqx.field(converter=positive("velocity", "[m/s]"))
    steepness: Float[Array, ""] = eqx.field(converter=positive("steepness", "[1]"))
    shift: AbstractShift | None = None
    coupled: bool = eqx.field(default=False, static=True)

    def __check_init__(self):
        check_type("shift", self.shift, AbstractShift, type(None))

    def __call__(self, pressure, speed, temperature):
        log_factor = 0.0
        if self.shift is not None:
            if temperature is None:
                raise ValueError(
                    "`temperature=None` is refused: this shear law varies with temperature. Give "
                    "the temperature of the contact [K]."
                )
            log_factor = self.shift.log_factor(temperature)
        # At rest the logarithm is infinite and would spoil the derivative.
        moves = speed != 0
        logarithm = jnp.log(jnp.where(moves, jnp.abs(speed), 1) / self.velocity) + log_factor
        decades = logarithm / jnp.log(10.0).astype(logarithm.dtype)
        return jnp.where(moves, self.peak * jnp.exp(-self.steepness * decades**2), 0)


# The laws by the `kind` of a scene.
SHEARS = {"constant": ConstantShear, "coulomb": Coulomb, "peaked": PeakedShear}


def is_coupled(law: object) -> bool:
    """Returns whether the traction of a law moves the surface of the block."""
    return bool(getattr(law, "coupled", False))


class ShearStress(eqx.Module):
    """The shear stress as a function of the pressure alone.

    **Fields:**

    - `law`: the law, see above.
    - `speed`: of sliding [m/s].
    - `temperature`: of the contact [K], or None.
    """

    law: ShearLaw
    speed: Float[Array, ""]
    temperature: Float[Array, ""] | None

    def __call__(self, pressure: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        stress = jnp.asarray(self.law(pressure, self.speed, self.temperature), pressure.dtype)
        if stress.shape not in ((), pressure.shape):
            raise TypeError(f"shape {stress.shape} for pressures of shape {pressure.shape}")
        return jnp.broadcast_to(stress, pressure.shape)


def shear_stress(
    law: object, velocity: Float[Array, "..."], temperature: ScalarLike | None
) -> ShearStress | None:
    """Returns the shear stress of a law at |v| and a temperature; None without a law.

    **Raises:** `ValueError` for what is no law, or a temperature that is no temperature.
    """
    temperature = None if temperature is None else as_temperature(temperature)
    if law is None:
        return None
    if not callable(law) or isinstance(law, type):
        raise ValueError(
            f"`shear={short(law)}` must be called as shear(pressure, speed, temperature) and "
            "return a shear stress [Pa], such as `ConstantShear(1e6)`."
        )
    speed = direction_and_speed(velocity)[1]
    # A bare function is no pytree; wrapped, it is one without leaves.
    called: Any = law if isinstance(law, eqx.Module) else jax.tree_util.Partial(law)
    bound = ShearStress(called, speed, temperature)
    # Called without numbers: a wrong law is refused before the solve.
    try:
        jax.eval_shape(bound, jax.ShapeDtypeStruct((2,), speed.dtype))
    except (TypeError, AttributeError, IndexError) as error:
        raise ValueError(
            "`shear` must return a shear stress [Pa] for a pressure [Pa] of any shape, a speed "
            f"[m/s] and a temperature [K] or None; it gave {type(error).__name__}: {error}."
        ) from None
    return bound


def shear_parts(pressure: Array, stress: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Returns the shear stress without pressure, and the part that the pressure adds [Pa]."""
    least = stress(jnp.zeros((), pressure.dtype))
    pressed = pressure != 0  # elsewhere a power of the pressure may have no derivative
    return least, jnp.where(pressed, stress(jnp.where(pressed, pressure, 1)) - least, 0)


def shear_field(
    pressure: Array, indicator: Array, edges: area.Edges, stress: Callable[[Array], Array]
) -> Array:
    """Returns the shear stress at each point [Pa]; its value without pressure acts in contact.

    `indicator` shows which points touch, see `AbstractLaw.contact_indicator`.
    """
    least, added = shear_parts(pressure, stress)
    return least * area.contact_shares(indicator, edges) + added


def shear_over_load(pressure: Array, indicator: Array, edges: area.Edges, stress: Any) -> Array:
    """Returns the shear force in the contact over the load [1], ∫τ_f dA/∫σ dA; 0 without `stress`.

    `stress` gives τ_f [Pa] at a pressure [Pa]. Its value without pressure acts on the
    `contact_area`. What pressure adds vanishes at the edge of contact and is
    summed over the points: friction in proportion to the pressure is exact.
    """
    if stress is None:
        return jnp.zeros((), pressure.dtype)
    least, added = shear_parts(pressure, stress)
    return (least * area.sub_pixel_area(indicator, edges) + jnp.mean(added)) / jnp.mean(pressure)
