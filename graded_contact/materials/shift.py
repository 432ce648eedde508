"""Laws of time-temperature superposition: relaxation times as functions of temperature.

Temperatures are in kelvin. Source of the first: M. L. Williams, R. F. Landel, J. D. Ferry,
J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008.
"""

import abc
import dataclasses
import math
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, ScalarLike

from ..core.checks import (
    as_float,
    as_scalar,
    check_ascending,
    check_values,
    is_concrete,
    numbers,
    optional,
    positive,
    scalar,
)
from ..core.display import shown
from ..core.spline import monotone_cubic

NEAR = 1.0  # K beyond measured temperatures: two isotherms are not nearer to each other
COLDEST = 100.0  # K; below it no rubber moves, and degrees Celsius are likelier
HOTTEST = 1000.0  # K; above it no rubber is left
GAS_CONSTANT = 8.31446261815324  # J/(mol K), exact in the SI of 2019
# How far times are shifted, as a share of the dtype's exponents: their squares must not overflow.
_REACH = 0.45


def as_temperature(value: ScalarLike, name: str = "temperature") -> Float[Array, ""]:
    """Returns a temperature [K]; refuses an array, and what is hardly in kelvin."""
    temperature = as_scalar(value, name)
    check_kelvin(name, temperature)
    return temperature


def check_kelvin(name: str, temperature: ArrayLike) -> None:
    """Raises `ValueError` for temperatures that are hardly in kelvin."""
    allowed = f"temperatures are in kelvin, {COLDEST:g} to {HOTTEST:g} K (20 °C are 293.15 K)"
    check_values(name, temperature, allowed, at_least=COLDEST, at_most=HOTTEST)


@shown(units=False)
class AbstractShift(eqx.Module):
    """A law of time-temperature superposition: τ(T) = a_T τ(reference), E(T) = b_T E(reference)."""

    @abc.abstractmethod
    def log_factor(self, temperature: ScalarLike) -> Float[Array, ""]:
        """Returns ln a_T [1] at `temperature` [K]; it is 0 at the reference temperature."""

    @abc.abstractmethod
    def rebased(self, temperature: ScalarLike) -> "AbstractShift":
        """Returns this law written about another reference temperature [K]."""

    def log_vertical(self, temperature: ScalarLike) -> Float[Array, ""]:
        """Returns ln b_T [1], of moduli at `temperature` [K] over those at the reference: 0."""
        return jnp.asarray(0.0)  # of no precision of its own

    def factor(self, temperature: ScalarLike) -> Float[Array, ""]:
        """Returns a_T [1] at `temperature` [K]; infinite where it exceeds the dtype."""
        return jnp.exp(self.log_factor(temperature))


class WLF(AbstractShift):
    """The Williams-Landel-Ferry shift, log10 a_T = -c1 (T - T_ref)/(c2 + T - T_ref).

    **Fields:**

    - `c1`: first constant [1].
    - `c2`: second constant [K].
    - `reference`: temperature T_ref [K] at which the material's times were given.
    """

    c1: Float[Array, ""] = eqx.field(converter=positive("c1", "[1]"))
    c2: Float[Array, ""] = eqx.field(converter=positive("c2", "[K]"))
    reference: Float[Array, ""] = eqx.field(converter=partial(as_temperature, name="reference"))

    def log_factor(self, temperature: ScalarLike) -> Float[Array, ""]:
        return _wlf(self.c1, self.c2, self.reference, self._checked(temperature))

    def rebased(self, temperature: ScalarLike) -> "WLF":
        temperature = self._checked(temperature)
        c2 = self.c2 + temperature - self.reference
        return WLF(c1=self.c1 * self.c2 / c2, c2=c2, reference=temperature)

    def _checked(self, temperature: ScalarLike) -> Float[Array, ""]:
        temperature = as_scalar(temperature, "temperature")
        if is_concrete(self.c2) and is_concrete(self.reference):
            # By NumPy: known temperatures stay known inside `jit`.
            vogel = float(np.asarray(self.reference) - np.asarray(self.c2))
            allowed = f"temperatures are in kelvin, this WLF law holds only above {vogel:.2f} K"
            check_values("temperature", temperature, allowed, above=max(vogel, 0.0))
        return temperature


@jax.jit
def _wlf(c1: Array, c2: Array, reference: Array, temperature: Array) -> Array:
    step = temperature - reference
    above = c2 + step > 0
    # Below the Vogel temperature, which tracing hides, the law has no answer.
    value = -math.log(10) * c1 * step / jnp.where(above, c2 + step, 1)
    return jnp.where(above, value, jnp.nan)


class Arrhenius(AbstractShift):
    """The Arrhenius shift, ln a_T = (Q/R)(1/T - 1/T_ref).

    **Fields:**

    - `activation_energy`: Q [J/mol].
    - `reference`: temperature T_ref [K] at which the material's times were given.
    """

    activation_energy: Float[Array, ""] = eqx.field(
        converter=positive("activation_energy", "[J/mol]")
    )
    reference: Float[Array, ""] = eqx.field(converter=partial(as_temperature, name="reference"))

    def log_factor(self, temperature: ScalarLike) -> Float[Array, ""]:
        temperature = as_temperature(temperature)
        return self.activation_energy / GAS_CONSTANT * (1 / temperature - 1 / self.reference)

    def rebased(self, temperature: ScalarLike) -> "Arrhenius":
        return Arrhenius(self.activation_energy, as_temperature(temperature))


def stretched(values: Float[Array, " n"], log_factor: Float[Array, ""]) -> Float[Array, " n"]:
    """Returns `values` > 0 times exp(`log_factor`), at most as far as their dtype holds.

    Near the Vogel temperature a_T leaves the range of numbers. A time of 1e138 s (float32: 2e17 s)
    is as good as infinite, the branch glassy at every frequency. What was stretched so far has
    lost its distance from the reference, and cannot be brought back.

    **Raises:** `ValueError` for values at that limit; they become NaN where tracing hides them.
    """
    found, lost = _stretched(values, log_factor)
    if is_concrete(lost) and lost:
        raise ValueError(
            "`temperature` cannot be changed again: at the temperature of this material its times "
            "are beyond the range of numbers. Start from the material at its reference temperature."
        )
    return found


@jax.jit
def _stretched(values: Array, log_factor: Array) -> tuple[Array, Array]:
    """The stretched values, and whether some are at the limit."""
    reach = _REACH * math.log(float(jnp.finfo(values.dtype).max))
    logs = jax.lax.stop_gradient(jnp.log(values))
    # Rounding may leave them an ulp within the limit.
    lost = jnp.max(jnp.abs(logs)) >= reach * (1 - 1e-6)
    # In two steps, neither of which overflows.
    root = jnp.exp(jnp.clip(log_factor, -reach - logs, reach - logs) / 2)
    return jnp.where(lost, jnp.nan, values * root * root), lost


def shifts_in(tree: Any) -> list[Any]:
    """Returns the laws of temperature of all materials in a tree, such as a stack."""
    parts = jax.tree.leaves(tree, is_leaf=lambda part: isinstance(part, AbstractShift))
    return [part for part in parts if isinstance(part, AbstractShift)]


def require_shift(shift: AbstractShift | None) -> AbstractShift:
    """Returns `shift`, or raises `ValueError` if a material has none."""
    if shift is None:
        raise ValueError(
            "This material has no law of time-temperature superposition. Give it one: "
            "`shift=WLF(c1, c2, reference)` or `shift=Arrhenius(activation_energy, reference)`."
        )
    return shift


class TabulatedShift(AbstractShift):
    """Shifts at some temperatures, interpolated between them.

    ln a_T and ln b_T are monotone cubics in 1/T, in which Arrhenius' law is a straight line. More
    than 1 K outside the table a temperature is refused: shifts that follow no law are unknown
    there.

    **Fields:**

    - `temperatures`: [K], shape `(isotherms,)`, increasing, at least two.
    - `log10_factors`: log10 a_T [1], shape `(isotherms,)`; they may count from any temperature.
    - `reference`: temperature [K] at which the material's times were given; within the table.
    - `vertical_factors`: b_T [1], shape `(isotherms,)`, in ratios: moduli at T are
      b_T(T)/b_T(T_ref) times those at the reference. By default 1.
    """

    temperatures: Float[Array, " isotherms"] = eqx.field(
        converter=positive("temperatures", "[K]", as_float)
    )
    log10_factors: Float[Array, " isotherms"] = eqx.field(converter=numbers("log10_factors"))
    reference: Float[Array, ""] = eqx.field(converter=scalar("reference"))
    vertical_factors: Float[Array, " isotherms"] | None = eqx.field(
        converter=optional(positive("vertical_factors", "[1]", as_float)), default=None
    )

    def __check_init__(self):
        rows = {"temperatures": self.temperatures, "log10_factors": self.log10_factors}
        if self.vertical_factors is not None:
            rows["vertical_factors"] = self.vertical_factors
        check_ascending(2, **rows)
        check_values("log10_factors", self.log10_factors, "finite numbers")
        self._check_covered("reference", self.reference)

    def log_factor(self, temperature: ScalarLike) -> Float[Array, ""]:
        return math.log(10) * self._change(self.log10_factors, temperature)

    def log_vertical(self, temperature: ScalarLike) -> Float[Array, ""]:
        if self.vertical_factors is None:
            return super().log_vertical(temperature)
        return self._change(jnp.log(self.vertical_factors), temperature)

    def rebased(self, temperature: ScalarLike) -> "TabulatedShift":
        temperature = as_scalar(temperature, "temperature")
        self._check_covered("temperature", temperature)
        return dataclasses.replace(self, reference=temperature)

    def _change(self, values, temperature):
        """The change of `values` from the reference to `temperature`; NaN outside, if traced."""
        temperature = as_scalar(temperature, "temperature")
        self._check_covered("temperature", temperature)
        coldest, hottest = self.temperatures[0] - NEAR, self.temperatures[-1] + NEAR
        inside = (temperature >= coldest) & (temperature <= hottest)
        # The sign makes the nodes increase with temperature.
        places = -1 / jnp.stack([temperature, self.reference])
        there, here = monotone_cubic(-1 / self.temperatures, values, places)
        return jnp.where(inside, there - here, jnp.nan)

    def _check_covered(self, name, temperature):
        if is_concrete(self.temperatures):
            # By NumPy: known temperatures stay known inside `jit`.
            coldest, hottest = map(float, np.asarray(self.temperatures)[[0, -1]])
            covered = f"the table of shifts covers {coldest:.2f} to {hottest:.2f} K"
            allowed = f'{covered}. Beyond, use a law: `WLF`, or `law="wlf"` of `master_curve`'
            low, high = coldest - NEAR, hottest + NEAR
            check_values(name, temperature, allowed, at_least=low, at_most=high)


# By their names in tables of scenes.
LAWS: dict[str, type[AbstractShift]] = {
    "wlf": WLF, "arrhenius": Arrhenius, "tabulated": TabulatedShift,
}  # fmt: skip
