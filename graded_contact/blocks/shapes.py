"""How a quantity varies with height in a graded layer: shapes φ(s), s from 0 (bottom) to 1 (top).

Where a derivative of a shape jumps, it may have an attribute `breaks`: heights strictly
between 0 and 1. The layer is then cut there, and convergence is as fast as without.
"""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import as_float, check_rows, check_values, is_concrete, numbers, positive, scalar
from ..core.display import shown
from ..core.spline import monotone_cubic


@shown(units=False)
class AbstractShape(eqx.Module):
    """A function φ(s) of the height s [1] in a layer."""

    @abc.abstractmethod
    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        """Returns φ(s)."""


class Linear(AbstractShape):
    """φ = s."""

    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        return s


class Sinusoidal(AbstractShape):
    """φ = s + a sin(2π n s).

    **Fields:**

    - `amplitude`: a [1].
    - `periods`: n [1], the number of waves through the layer.
    """

    amplitude: Float[Array, ""] = eqx.field(converter=scalar("amplitude"), default=1.0)
    periods: Float[Array, ""] = eqx.field(converter=scalar("periods"), default=1.0)

    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        return s + self.amplitude * jnp.sin(2 * jnp.pi * self.periods * s)


class Exponential(AbstractShape):
    """φ = (e^(k s) - 1)/(e^k - 1), from 0 to 1; s for k = 0.

    For a modulus that is itself exponential, E = E_bottom (E_top/E_bottom)^s, use
    `Blend(bottom, top, mixing="logarithmic")` with the linear shape.

    **Fields:**

    - `rate`: k [1]; positive: the change is near the top; negative: near the bottom.
    """

    rate: Float[Array, ""] = eqx.field(converter=scalar("rate"))

    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        k = jnp.abs(self.rate)
        small = k < 1e-3
        safe = jnp.where(small, 1, k)
        # Written with decaying exponentials, and as a series where it is 0/0.
        height = jnp.where(self.rate < 0, 1 - s, s)
        curved = jnp.exp(safe * (height - 1)) * jnp.expm1(-safe * height) / jnp.expm1(-safe)
        curved = jnp.where(self.rate < 0, 1 - curved, curved)
        # In the signed rate: its size has no derivative at 0.
        series = s * (1 + self.rate * (s - 1) / 2 * (1 + self.rate * (2 * s - 1) / 6))
        return jnp.where(small, series, curved)


class PowerLaw(AbstractShape):
    """φ = s^n.

    **Fields:**

    - `exponent`: n [1], positive. Below 2, unless it is 1, a derivative at the bottom is infinite
      and tight tolerances are out of reach.
    """

    exponent: Float[Array, ""] = eqx.field(converter=positive("exponent", "[1]"))

    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        # The derivative of 0^n is not finite, also in a branch that is not taken.
        inside = s > 0
        return jnp.where(inside, jnp.where(inside, s, 1) ** self.exponent, 0)


class ErrorFunction(AbstractShape):
    """φ = (1 + erf((s - c)/w))/2, an interdiffused boundary.

    **Fields:**

    - `centre`: c [1].
    - `width`: w [1], positive.
    """

    centre: Float[Array, ""] = eqx.field(converter=scalar("centre"), default=0.5)
    width: Float[Array, ""] = eqx.field(converter=positive("width", "[1]"), default=0.1)

    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        return (1 + jax.scipy.special.erf((s - self.centre) / self.width)) / 2


# Shapes that never leave [0, 1].
FROM_0_TO_1 = (Linear, Exponential, PowerLaw, ErrorFunction)


class Table(AbstractShape):
    """φ given at some heights, joined by a monotone cubic (Fritsch-Carlson).

    **Fields:**

    - `heights`: s [1], shape `(points,)`, increasing from 0 to 1.
    - `values`: φ [1], shape `(points,)`.
    """

    heights: Float[Array, " points"] = eqx.field(converter=numbers("heights"))
    values: Float[Array, " points"] = eqx.field(converter=numbers("values"))

    def __check_init__(self):
        check_rows(2, heights=self.heights, values=self.values)
        check_values("values", self.values, "the values of a profile must be finite")
        if is_concrete(self.heights):
            h = np.asarray(self.heights)
            if not (h[0] == 0 and h[-1] == 1 and np.all(np.diff(h) > 0)):
                raise ValueError(
                    f"`heights={h}` is refused: heights must increase from exactly 0 (the bottom "
                    "of the layer) to exactly 1 (its top)."
                )

    @property
    def breaks(self) -> Float[Array, " inner"]:
        """The inner heights, where the second derivative jumps."""
        return self.heights[1:-1]

    def __call__(self, s: Float[Array, "..."]) -> Float[Array, "..."]:
        return monotone_cubic(self.heights, self.values, s)


def breaks_of(profile: Any) -> Float[Array, " inner"]:
    """Returns the heights at which a profile is not smooth, by attributes `breaks` of it or in it.

    A profile has such an attribute itself, or the shapes have that it is made of.
    """

    def has_breaks(node):
        return hasattr(node, "breaks")

    parts = filter(has_breaks, jax.tree.leaves(profile, is_leaf=has_breaks))
    found = [as_float(part.breaks) for part in parts]
    return jnp.sort(jnp.concatenate(found)) if found else jnp.zeros(0)
