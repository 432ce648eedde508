"""Shifts of time and temperature as they were found, for isotherms that follow no law."""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, ScalarLike

from ..core.checks import (
    as_float,
    as_scalar,
    check_positive,
    check_values,
    is_concrete,
    numbers,
    scalar,
)
from .measured import NEAR
from .shift import AbstractShift
from .tabulated import monotone_cubic


class TabulatedShift(AbstractShift):
    """Shifts at some temperatures, interpolated between them.

    ln a_T and ln b_T are monotone cubics in 1/T, in which Arrhenius' law is a straight line. More
    than 1 K outside the table a temperature is refused: shifts that follow no law say nothing
    there.

    **Fields:**

    - `temperatures`: [K], shape `(isotherms,)`, increasing, at least two.
    - `log10_factors`: log10 a_T [1], shape `(isotherms,)`; they may count from any temperature.
    - `reference`: temperature [K] at which the material's times were given; within the table.
    - `vertical_factors`: b_T [1], shape `(isotherms,)`, in ratios: moduli at T are
      b_T(T)/b_T(T_ref) times those at the reference. By default 1.
    """

    temperatures: Float[Array, " isotherms"] = eqx.field(converter=numbers("temperatures"))
    log10_factors: Float[Array, " isotherms"] = eqx.field(converter=numbers("log10_factors"))
    reference: Float[Array, ""] = eqx.field(converter=scalar("reference"))
    vertical_factors: Float[Array, " isotherms"] | None = eqx.field(
        converter=lambda value: None if value is None else as_float(value, "vertical_factors"),
        default=None,
    )

    def __check_init__(self):
        for name in ("log10_factors", "vertical_factors"):
            value = getattr(self, name)
            if value is not None and (
                self.temperatures.ndim != 1
                or value.shape != self.temperatures.shape
                or len(self.temperatures) < 2
            ):
                raise ValueError(
                    f"`temperatures` has shape {self.temperatures.shape} and `{name}` "
                    f"{value.shape}; two one-dimensional arrays of equal length, at least 2, are "
                    "needed."
                )
        check_positive("temperatures", self.temperatures, "[K]")
        check_values("log10_factors", self.log10_factors, "finite numbers")
        if self.vertical_factors is not None:
            check_positive("vertical_factors", self.vertical_factors, "[1]")
        if is_concrete(self.temperatures):
            steps = np.diff(np.asarray(self.temperatures))
            if np.any(steps <= 0):
                i = int(np.argmax(steps <= 0)) + 1
                raise ValueError(
                    f"`temperatures[{i}]={float(self.temperatures[i]):g}` does not exceed the "
                    "entry before it: sort the table first."
                )
        self._check_covered("reference", self.reference)

    def log_factor(self, temperature: ScalarLike) -> Float[Array, ""]:
        return math.log(10) * self._change(self.log10_factors, temperature)

    def log_vertical(self, temperature: ScalarLike) -> Float[Array, ""]:
        if self.vertical_factors is None:
            return jnp.zeros_like(self.reference)
        return self._change(jnp.log(self.vertical_factors), temperature)

    def rebased(self, temperature: ScalarLike) -> "TabulatedShift":
        temperature = as_scalar(temperature, "temperature")
        self._check_covered("temperature", temperature)
        return eqx.tree_at(lambda shift: shift.reference, self, temperature)

    def _change(self, values, temperature):
        """What `values` gain from the reference to `temperature`; NaN outside, if traced."""
        temperature = as_scalar(temperature, "temperature")
        self._check_covered("temperature", temperature)
        coldest, hottest = self.temperatures[0] - NEAR, self.temperatures[-1] + NEAR
        inside = (temperature >= coldest) & (temperature <= hottest)
        places = -1 / jnp.stack([temperature, self.reference])
        there, here = monotone_cubic(-1 / self.temperatures, values, places)
        return jnp.where(inside, there - here, jnp.nan)

    def _check_covered(self, name, temperature):
        if is_concrete(self.temperatures):
            # By NumPy: known temperatures stay known inside `jit`.
            coldest, hottest = map(float, np.asarray(self.temperatures)[[0, -1]])
            check_values(
                name,
                temperature,
                f"the table of shifts covers {coldest:.2f} to {hottest:.2f} K. Use a law, such as "
                "`WLF`, to go beyond what was measured",
                at_least=coldest - NEAR,
                at_most=hottest + NEAR,
            )
