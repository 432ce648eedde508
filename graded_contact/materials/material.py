"""Linear viscoelastic materials: complex Young's modulus E(ω) and Poisson's ratio.

Fields go as exp(iωt), so E = E' + iE'' with loss modulus E'' >= 0 for ω > 0 and
E(-ω) = conj E(ω). Temperatures are in kelvin. A complex ω = -is stands for fields exp(st), as
histories need them (`kernels/creep.py`): write your own law with iω, without |ω|.

Sources: the generalised Maxwell solid and its creep form, N. W. Tschoegl, The Phenomenological
Theory of Linear Viscoelastic Behavior, Springer (1989), doi:10.1007/978-3-642-73602-5; the creep
form is also the paper's (Scaraggi & Comingio, eq. prony, with its misprinted index corrected).
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Complex, Float, Inexact, ScalarLike

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    as_poisson,
    check_positive,
    check_rows,
    check_type,
    instance,
    is_concrete,
    positive,
    scalar,
)
from ..core.display import shown
from .coverage import MeasuredRange
from .shift import AbstractShift, as_temperature, require_shift, stretched


@shown(units=False)
class AbstractMaterial(eqx.Module):
    """An isotropic linear viscoelastic solid."""

    @abc.abstractmethod
    def complex_modulus(self, omega: Numbers) -> Inexact[Array, "*w"]:
        """Returns Young's modulus E(ω) [Pa] at the angular frequencies `omega` [rad/s].

        `omega` is real, or complex in transient motion: a law has one analytic form for both.
        """

    @abc.abstractmethod
    def poisson_ratio(self, omega: Numbers) -> Inexact[Array, "..."]:
        """Returns Poisson's ratio [1], of shape `()` when it does not depend on frequency."""

    @abc.abstractmethod
    def at(self, temperature: ScalarLike) -> "AbstractMaterial":
        """Returns the material at another temperature [K]."""


def material_called(name: str) -> Callable[[Any], AbstractMaterial]:
    """Returns the converter of a field that holds a material."""
    return instance(name, AbstractMaterial, "a material, such as `Elastic(modulus, poisson)`")


class Elastic(AbstractMaterial):
    """A linear elastic solid.

    **Fields:**

    - `modulus`: Young's modulus E [Pa].
    - `poisson`: Poisson's ratio ν [1], -1 < ν <= 1/2.
    """

    modulus: Float[Array, ""] = eqx.field(converter=positive("modulus", "[Pa]"))
    poisson: Float[Array, ""] = eqx.field(converter=as_poisson, default=0.5)

    def complex_modulus(self, omega: Numbers) -> Float[Array, "*w"]:
        omega = as_numbers(omega, "omega")
        dtype = jnp.result_type(self.modulus, omega.real)
        return jnp.broadcast_to(self.modulus.astype(dtype), omega.shape)

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: ScalarLike) -> "Elastic":
        as_temperature(temperature)
        return self


class Prony(AbstractMaterial):
    """A generalised Maxwell solid, E(t) = E_eq + Σ_k E_k exp(-t/τ_k).

    **Fields:**

    - `equilibrium`: long-time modulus E_eq [Pa]; 0 for a liquid, which carries no load at rest.
    - `strengths`: branch moduli E_k [Pa], shape `(branches,)`, all positive.
    - `times`: relaxation times τ_k [s], shape `(branches,)`, all positive.
    - `poisson`: Poisson's ratio ν [1], independent of frequency.
    - `shift`: law of time-temperature superposition, or None.
    - `measured`: where the series follows data, or None for everywhere: a fit knows its own.
    """

    equilibrium: Float[Array, ""] = eqx.field(
        converter=scalar("equilibrium", "it must be zero or a positive number [Pa]", at_least=0)
    )
    strengths: Float[Array, " branches"] = eqx.field(
        converter=positive("strengths", "[Pa]", as_float)
    )
    times: Float[Array, " branches"] = eqx.field(converter=positive("times", "[s]", as_float))
    poisson: Float[Array, ""] = eqx.field(converter=as_poisson, default=0.5)
    shift: AbstractShift | None = None
    measured: MeasuredRange | None = None

    def __check_init__(self):
        check_rows(0, strengths=self.strengths, times=self.times)
        check_type("measured", self.measured, MeasuredRange, type(None))
        check_type("shift", self.shift, AbstractShift, type(None))

    @classmethod
    def from_creep(
        cls,
        glassy: ScalarLike,
        compliances: Numbers,
        times: Numbers,
        poisson: ScalarLike = 0.5,
        shift: AbstractShift | None = None,
        measured: MeasuredRange | None = None,
    ) -> "Prony":
        """Returns the material of 1/E(ω) = 1/E_inf + Σ_j H_j/(1 + iω t_j), converted exactly.

        **Arguments:**

        - `glassy`: instantaneous modulus E_inf [Pa].
        - `compliances`: H_j [1/Pa], shape `(branches,)`, all positive.
        - `times`: retardation times t_j [s], shape `(branches,)`, positive, no two equal.
        - `poisson`, `shift`, `measured`: as the fields of the class.
        """
        glassy = positive("glassy", "[Pa]")(glassy)
        compliances = positive("compliances", "[1/Pa]", as_float)(compliances)
        times = positive("times", "[s]", as_float)(times)
        check_rows(0, compliances=compliances, times=times)
        _check_distinct(times)
        equilibrium, strengths, times = _relaxation_from_creep(glassy, compliances, times)
        return cls(equilibrium, strengths, times, poisson, shift, measured)

    def creep(
        self,
    ) -> tuple[Float[Array, ""], Float[Array, " branches"], Float[Array, " branches"]]:
        """Returns the creep form `(glassy [Pa], compliances [1/Pa], times [s])` of the material.

        The inverse of `from_creep`. A liquid (`equilibrium` 0) flows and has no such form.
        """
        allowed = "[Pa] to have a creep form (a liquid flows)"
        check_positive("equilibrium", self.equilibrium, allowed)
        _check_distinct(self.times)
        return _creep_from_relaxation(self.equilibrium, self.strengths, self.times)

    @property
    def glassy(self) -> Float[Array, ""]:
        """Instantaneous modulus E_inf = E_eq + Σ E_k [Pa]."""
        return self.equilibrium + jnp.sum(self.strengths)

    def complex_modulus(self, omega: Numbers) -> Complex[Array, "*w"]:
        series = self.equilibrium, self.strengths, self.times
        return _series_modulus(*series, as_numbers(omega, "omega"))

    def poisson_ratio(self, omega: Numbers) -> Float[Array, ""]:
        return self.poisson

    def at(self, temperature: ScalarLike) -> "Prony":
        # Moduli change by b_T, times by a_T; the law then counts from the new temperature.
        shift, temperature = require_shift(self.shift), as_temperature(temperature)
        log_factor, lift = shift.log_factor(temperature), jnp.exp(shift.log_vertical(temperature))
        return dataclasses.replace(
            self,
            equilibrium=self.equilibrium * lift,
            strengths=self.strengths * lift,
            times=stretched(self.times, log_factor),
            shift=shift.rebased(temperature),
            measured=self.measured and self.measured.shifted(log_factor),
        )

    def coverage(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Returns the lowest and highest ω [rad/s] that were measured."""
        if self.measured is None:
            return jnp.zeros_like(self.equilibrium), jnp.full_like(self.equilibrium, jnp.inf)
        return self.measured.coverage(getattr(self.shift, "reference", None))


class BulkShear(AbstractMaterial):
    """A solid given by its bulk modulus K(ω) and shear modulus G(ω), both passive.

    E = 9KG/(3K + G) and ν = (3K - 2G)/(2(3K + G)), complex and frequency dependent; they are
    passive and causal because K and G are (1/E = 1/(3G) + 1/(9K)). This is the way to let ν vary
    with frequency. A real ν(ω) written down by hand is not causal: with the paper's ν from 0.49
    at rest to 0.3, while E rises tenfold, K' falls from 16.7 to 8.3 times E(0) although its loss
    modulus is positive, against Kramers and Kronig. The paper's ν₀ formulas moreover violate
    equilibrium: a glassy half space comes out 14.6 times too soft for those ν (143 times at
    ν₀ = 0.499), and two layers of passive K and G on a half space gained energy, Im M_zz of the
    wrong sign, in 24291 of 60000 random stacks; the correspondence principle, used here
    everywhere, gave 0.

    ν close to 1/2 is rounded to a step of ε/4, so that 1 - 2ν = 3G/(3K + G) keeps a relative
    error of about ε K/G. Only a thin layer on a rigid base feels it, with relative error up to
    ε/(1 - 2ν + (qd)²) in M_zz (in float32 from K/G of about 1e4 on).

    **Fields:**

    - `bulk`: material whose complex modulus is read as K(ω) [Pa], not as Young's modulus; its own
      Poisson's ratio is ignored.
    - `shear`: material whose complex modulus is read as G(ω) [Pa].
    """

    bulk: AbstractMaterial = eqx.field(converter=material_called("bulk"))
    shear: AbstractMaterial = eqx.field(converter=material_called("shear"))

    def complex_modulus(self, omega: Numbers) -> Inexact[Array, "*w"]:
        shear, ratio = self._shear_and_ratio(omega)
        return 3 * shear / (1 + ratio)

    def poisson_ratio(self, omega: Numbers) -> Inexact[Array, "*w"]:
        """Returns ν(ω) [1], complex unless K and G are elastic, of the shape of `omega`."""
        _, ratio = self._shear_and_ratio(omega)
        return (1 - 2 * ratio) / (2 * (1 + ratio))

    def at(self, temperature: ScalarLike) -> "BulkShear":
        return BulkShear(self.bulk.at(temperature), self.shear.at(temperature))

    def _shear_and_ratio(self, omega):
        """G [Pa] and G/(3K) [1], in units in which the backward pass suits float32."""
        bulk, shear = self.bulk.complex_modulus(omega), self.shear.complex_modulus(omega)
        # Powers of moduli in Pa, of the backward pass of a division, would overflow float32.
        unit = jax.lax.stop_gradient(jnp.max(jnp.abs(bulk)))
        return shear, (shear / unit) / (3 * (bulk / unit))


@jax.jit
def _relaxation_from_creep(glassy: Array, compliances: Array, times: Array):
    """`(equilibrium [Pa], strengths [Pa], relaxation times [s])`, longest time first.

    E(s) and J(s) = 1/E(s) are rational functions, whose poles and zeros on the negative axis
    interlace: the rates of one form are the zeros of the other, each between its neighbours, and
    the strengths are residues.
    """
    order = jnp.argsort(-times)
    rates = 1 / times[order]
    weights = glassy * compliances[order] * rates
    # J(s) = 0 at s = -λ: one root above each rate, the last below r_n + Σ a.
    upper = jnp.append(rates[1:], rates[-1] + 2 * jnp.sum(weights))
    roots, gaps = _increasing_roots(
        lambda root, gaps: 1 + jnp.sum(weights / gaps, axis=-1), rates, rates, upper
    )
    slope = jnp.sum(weights / gaps / gaps, axis=-1)
    equilibrium = glassy / (1 + glassy * jnp.sum(compliances))
    return equilibrium, glassy / (roots * slope), 1 / roots


@jax.jit
def _series_modulus(equilibrium: Array, strengths: Array, times: Array, omega: Array) -> Array:
    # One more axis, over the branches.
    x = omega[..., None] * times
    if jnp.iscomplexobj(x):
        return equilibrium + jnp.sum(strengths * (1j * x / (1 + 1j * x)), axis=-1)
    # x²/(1 + x²) and x/(1 + x²), in forms that neither overflow nor cancel and are even and
    # odd: split into size and sign, they would have no derivative at rest.
    small = jnp.abs(x) <= 1
    y = jnp.where(small, x, 1 / jnp.where(small, 1, x))
    loss = y / (1 + y * y)
    storage = jnp.where(small, y * loss, 1 / (1 + y * y))
    real = equilibrium + jnp.sum(strengths * storage, axis=-1)
    return jax.lax.complex(real, jnp.sum(strengths * loss, axis=-1))


@jax.jit
def _creep_from_relaxation(equilibrium: Array, strengths: Array, times: Array):
    """`(glassy [Pa], compliances [1/Pa], retardation times [s])`, longest time first."""
    order = jnp.argsort(-times)
    rates, strengths = 1 / times[order], strengths[order]
    ratios = strengths / equilibrium
    # E(s) = 0 at s = -r: one root below each rate, the first above r_1/(1 + Σ E_k/E_eq).
    lower = jnp.append(rates[:1] / (1 + 2 * jnp.sum(ratios)), rates[:-1])
    roots, gaps = _increasing_roots(
        lambda root, gaps: jnp.sum(ratios * root[:, None] / gaps, axis=-1) - 1, rates, lower, rates
    )
    slope = jnp.sum(strengths * rates / gaps / gaps, axis=-1)
    return equilibrium + jnp.sum(strengths), 1 / (roots * slope), 1 / roots


def _increasing_roots(value: Callable, poles: Array, lower: Array, upper: Array):
    """Roots λ_i between `lower` and `upper` > 0, shape `(n,)`, and gaps poles_j - λ_i, `(n, n)`.

    `value(λ, gaps)`, shape `(n,)`, increases along each bracket, from pole to pole. The root of a
    weak branch nearly touches its pole, so what is sought is log |λ - nearer end|: by bisection to
    the last digit, then by one Newton step that carries the derivatives.
    """
    middle = (lower + upper) / 2
    from_lower = value(middle, poles - middle[:, None]) > 0
    end, sign = jnp.where(from_lower, lower, upper), jnp.where(from_lower, 1, -1)

    def place(step):
        # Gaps as differences of poles, less the step: root and pole agree in most digits.
        return end + sign * step, (poles - end[:, None]) - (sign * step)[:, None]

    def halve(_, bracket):
        near, far = bracket
        step = (near + far) / 2
        too_far = sign * value(*place(jnp.exp(step))) > 0
        return jnp.where(too_far, near, step), jnp.where(too_far, step, far)

    far = jnp.log((upper - lower) / 2)
    # The weakest branch that can be found has almost the smallest number of the dtype.
    reach = 0.9 * float(np.log(jnp.finfo(poles.dtype).tiny))
    # 80 halvings take a bracket of 700 e-foldings below rounding.
    near, far = jax.lax.stop_gradient(jax.lax.fori_loop(0, 80, halve, (far + reach, far)))
    step = jnp.exp((near + far) / 2)
    # Bisection has no derivative; one step of Newton has the implicit one.
    _, slope = jax.jvp(lambda step: value(*place(step)), (step,), (jnp.ones_like(step),))
    return place(step - value(*place(step)) / jax.lax.stop_gradient(slope))


def _check_distinct(times: Array) -> None:
    if is_concrete(times) and len(np.unique(np.asarray(times))) < len(times):
        raise ValueError("`times` holds a value twice: merge equal times into one branch first.")
