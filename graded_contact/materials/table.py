"""A measured modulus as a material, without fitting."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, ScalarLike

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    as_poisson,
    check_ascending,
    check_positive,
    check_type,
    positive,
)
from ..core.spline import monotone_cubic
from .material import AbstractMaterial
from .shift import AbstractShift, as_temperature, require_shift, stretched


class Tabulated(AbstractMaterial):
    """A measured modulus without a fit, by monotone interpolation of its logarithms.

    E' and E'' are interpolated by Fritsch-Carlson cubics in log ω. At rest (ω = 0 exactly) the
    modulus is the first E'. Outside of the table E' stays at its end value, and E'' falls off as ω
    below it and as 1/ω above it, as for a single relaxation far from its peak.

    **Fields:**

    - `omega`: angular frequencies [rad/s], shape `(points,)`, positive and increasing.
    - `storage`: E' [Pa], shape `(points,)`, positive.
    - `loss`: E'' [Pa], shape `(points,)`, positive.
    - `poisson`: Poisson's ratio ν [1].
    - `shift`: law of time-temperature superposition, or None.
    """

    omega: Float[Array, " points"]
    storage: Float[Array, " points"]
    loss: Float[Array, " points"]
    poisson: Float[Array, ""]
    shift: AbstractShift | None

    def __init__(
        self,
        omega: Numbers,
        modulus: Numbers,
        poisson: ScalarLike = 0.5,
        *,
        shift: AbstractShift | None = None,
    ):
        self.omega = positive("omega", "[rad/s]", as_float)(omega)
        modulus = as_numbers(modulus, "modulus")
        # Two real rows, so that derivatives and paths need no complex numbers.
        self.storage, self.loss = modulus.real, modulus.imag
        self.poisson = as_poisson(poisson)
        self.shift = shift
        check_ascending(2, omega=self.omega, modulus=modulus)
        check_positive("modulus.real", self.storage, "[Pa]")
        check_positive("modulus.imag", self.loss, "[Pa] (the loss modulus)")
        check_type("shift", shift, AbstractShift, type(None))

    def complex_modulus(self, omega: Numbers) -> Complex[Array, "*w"]:
        omega = as_numbers(omega, "omega")
        if jnp.iscomplexobj(omega):
            raise ValueError("`Tabulated` has no complex frequencies: fit it by `fit_prony`.")
        first, last, size = self.omega[0], self.omega[-1], jnp.abs(omega)
        below, above = size < first, size > last
        # Clipped before the logarithm: at rest it would be -inf, with a NaN derivative.
        inside = jnp.log(jnp.where(below, first, jnp.where(above, last, size)))
        nodes = jnp.log(self.omega)
        storage, loss = (
            jnp.exp(monotone_cubic(nodes, jnp.log(part), inside))
            for part in (self.storage, self.loss)
        )
        # Odd in ω; at rest it has the slope at the first point.
        beyond = jnp.sign(omega) * last / jnp.where(above, size, last)
        decay = jnp.where(below, omega / first, beyond)
        return jax.lax.complex(storage, loss * decay)

    def coverage(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Returns the ends of the table [rad/s]."""
        return jax.lax.stop_gradient((self.omega[0], self.omega[-1]))

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: ScalarLike) -> "Tabulated":
        shift, temperature = require_shift(self.shift), as_temperature(temperature)
        # As far as the first frequency can go: no two of them may become one.
        first = stretched(self.omega[:1], -shift.log_factor(temperature))
        lift = jnp.exp(shift.log_vertical(temperature))
        omega = self.omega / self.omega[0] * first
        # Not by the constructor: squares of frequencies far away may overflow.
        return eqx.tree_at(
            lambda m: (m.omega, m.storage, m.loss, m.shift),
            self,
            (omega, self.storage * lift, self.loss * lift, shift.rebased(temperature)),
        )
