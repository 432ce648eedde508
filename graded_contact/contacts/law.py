"""Laws of interaction between the surfaces: pressure σ as a function of the gap u.

A solver uses only the proximal map of a law, the pressure y that the law shares with a spring,

    y = f(u)   and   y - v = u,

in units in which the spring's stiffness, the solver's penalty, is 1. The map is single-valued if
the penalty exceeds the steepest rise of σ with u, which only attraction has.

Laws that attract are in `adhesion.py`.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import check_positive, check_values, is_concrete, optional, positive
from ..core.display import shown
from .operators.operator import Field, Scalar
from .operators.window import inside

Bound = Scalar | float
# The true error over a solver's estimate under an attraction, whose equilibria are soft: below 4 in
# 187 random scenes.
_SOFT = 4.0


class AbstractLaw(eqx.Module):
    """The law of contact, as the solvers use it.

    `attracts` is whether σ rises with u anywhere: then solutions depend on history.
    """

    attracts: ClassVar[bool] = False

    @property
    def bounds(self) -> tuple[Bound, Bound]:
        """The lowest and the highest pressure [Pa]."""
        return 0.0, jnp.inf

    @property
    def steepest_rise(self) -> Bound:
        """The largest dσ/du [Pa/m]; 0 without attraction."""
        return 0.0

    @property
    def softness(self) -> float:
        """By how much a solver's estimate of its error may be too small."""
        return _SOFT if self.attracts else 1.0

    @abstractmethod
    def in_units(self, pressure: Bound, length: Bound) -> "AbstractLaw":
        """Returns the law for pressures and gaps in units of `pressure` [Pa] and `length` [m]."""

    @abstractmethod
    def proximal(self, v: Field) -> Field:
        """Returns the pressure y that the law has at the gap y - v."""

    @abstractmethod
    def contact_indicator(self, pressure: Field, gap: Field, stiffness: Bound) -> Field:
        """Returns how far points are inside contact (> 0) or outside (< 0) [Pa], 0 at the edge.

        Outside, `stiffness` [Pa/m] turns gaps beyond the edge's to pressures.
        """


def check_pressure(pressure: Float[Array, "..."], law: AbstractLaw, hint: str = "") -> None:
    """Raises `ValueError` if the law cannot have these mean pressures [Pa]; traced ones pass.

    With a `hint` what to prescribe in place of 0.
    """
    low, high = law.bounds
    if not (is_concrete(low) and is_concrete(high)):
        return
    low, high = float(low), float(high)
    if low == 0:
        check_positive("pressure", pressure, f"[Pa]{hint}")
    allowed = f"the law allows mean pressures between {low:g} and {high:g} Pa"
    below = float(np.nextafter(high, 0, dtype=pressure.dtype)) if high < np.inf else None
    check_values("pressure", pressure, allowed, above=low, at_most=below)


def depth_of_flow(law: AbstractLaw, pressure: Array, gap: Array) -> Array:
    """Returns the gap, below 0, where the body flows, and 0 elsewhere."""
    limit = law.bounds[1] * (1 - 8 * jnp.finfo(pressure.dtype).eps)  # known to rounding
    return jnp.where(pressure < limit, 0, gap)


@shown(units=False)
class HardWall(AbstractLaw):
    """No interpenetration and no attraction: σ >= 0, u >= 0, σ u = 0.

    A point is in contact where its pressure is positive. With a `hardness` the softer body flows
    where the pressure reaches it: σ <= hardness, and saturated points (σ = hardness) are in
    contact with u < 0, the depth of the flow.

    **Fields:**

    - `hardness`: the highest pressure [Pa], or None for no limit.
    """

    hardness: Scalar | None = eqx.field(
        default=None, converter=optional(positive("hardness", "[Pa]"))
    )

    @property
    def bounds(self):
        return 0.0, jnp.inf if self.hardness is None else self.hardness

    def in_units(self, pressure, length):
        return HardWall(None if self.hardness is None else self.hardness / pressure)

    def proximal(self, v):
        # The slope of `jnp.maximum` would be 1/2 at the edge.
        y = jnp.where(v > 0, v, 0)
        return y if self.hardness is None else jnp.where(y < self.hardness, y, self.hardness)

    def contact_indicator(self, pressure, gap, stiffness):
        return jnp.where(pressure > 0, pressure, -stiffness * jnp.maximum(gap, 0))


def never_overlaps(law: AbstractLaw) -> bool:
    """Returns whether no gap is negative: at a hard wall without hardness."""
    return isinstance(law, HardWall) and law.hardness is None


class SmoothLaw(AbstractLaw):
    """A law whose pressure is a function of the gap; in contact where u < `contact_gap` ε."""

    range: eqx.AbstractVar[Scalar]
    contact_gap: eqx.AbstractVar[Scalar]

    @abstractmethod
    def _pressure_and_slope(self, t: Array) -> tuple[Array, Array]:
        """The pressure [Pa] at the gap εt, and its derivative by t."""

    def pressure_at(self, gap: Field) -> Field:
        """Returns σ(u) [Pa]."""
        return self._pressure_and_slope(gap / self.range)[0]

    def contact_indicator(self, pressure, gap, stiffness):
        edge = self.contact_gap * self.range
        gap, pressure = gap - edge, pressure - self.pressure_at(edge)
        return jnp.where(gap < 0, jnp.maximum(pressure, 0), -stiffness * gap)


@shown(units=False)
class RepulsiveLJ(SmoothLaw):
    """The repulsive term of the integrated Lennard-Jones potential: σ = p (ε/u)⁹.

    The first term of `AdhesiveLJ`, p being 8w/3ε, as used for contact without adhesion by B. N. J.
    Persson & M. Scaraggi, J. Chem. Phys. 141 (2014) 124701, doi:10.1063/1.4895789, and in their
    later work. As ε -> 0 it approaches the hard wall. Only the product p ε⁹ matters.
    A point is in contact where u < `contact_gap` ε.

    **Fields:**

    - `range`: ε [m], the gap at which the pressure is p.
    - `pressure`: p [Pa]. For a wall that is hard against roughness take the mean pressure or the
      modulus of the solid, and ε well below the rms height.
    - `contact_gap`: edge of contact [1]; at 5/3 the pressure is p/100.
    """

    range: Scalar = eqx.field(converter=positive("range", "[m]"))
    pressure: Scalar = eqx.field(converter=positive("pressure", "[Pa]"))
    contact_gap: Scalar = eqx.field(converter=positive("contact_gap", "[1]"), default=5 / 3)

    def in_units(self, pressure: Bound, length: Bound) -> "RepulsiveLJ":
        return RepulsiveLJ(self.range / length, self.pressure / pressure, self.contact_gap)

    def _pressure_and_slope(self, t):
        force, slope = power(t, 9)
        return self.pressure * force, self.pressure * slope

    def proximal(self, v):
        low, high = repulsive_bracket(v, self.pressure, self.range)
        return proximal_root(self._pressure_and_slope, self.range, v, low, high, 7)


def power(t, n: int):
    """t⁻ⁿ, n = 3 or 9, and its derivative."""
    inverse = 1 / t
    cube = inverse * inverse * inverse
    value = cube if n == 3 else cube * cube * cube
    return value, -n * value * inverse


def repulsive_bracket(v, pressure, range):
    """Bounds of t in p t⁻⁹ - εt = v, within a factor of 2, from v = 0, v << 0, v >> 0."""
    rest = (pressure / range) ** 0.1  # t at v = 0
    pressed = v > 0
    force = jnp.where(pressed, v, 0)  # each branch must be finite where the other one holds
    low = (pressure / (force + range * rest)) ** (1 / 9)
    open_ = jnp.where(pressed, 0, -v / range)
    low = jnp.where(pressed, low, jnp.maximum(rest, open_))
    return low, jnp.where(pressed, rest, rest + open_)


def proximal_root(pressure_and_slope: Callable, unit, v, low, high, steps: int):
    """The pressure y = f at the gap u = `unit` t with y - v = u, t in [low, high].

    Newton's method from `low`, bisecting where it would leave the bracket, except in the last two
    steps. Derivatives of every order belong to the root.
    """

    def newton(t):
        pressure, slope = pressure_and_slope(t)
        excess = pressure - unit * t - v
        return excess, t - excess / (slope - unit)

    def solve(_, t):
        # Unrolled, so that XLA keeps all steps in one pass over memory.
        least, most = low, high
        for _ in range(steps - 1):
            value, moved = newton(t)
            least, most = jnp.where(value > 0, t, least), jnp.where(value > 0, most, t)
            t = jnp.where((moved >= least) & (moved <= most), moved, (least + most) / 2)
        # By now close to the root; rounding could stop a bisection short of the last digit.
        for _ in range(2):
            _, t = newton(t)
        return t

    def tangent_solve(linear, y):
        return y / linear(jnp.ones_like(y))

    root = jax.lax.custom_root(lambda t: newton(t)[0], low, solve, tangent_solve)
    return pressure_and_slope(root)[0]


class Windowed(AbstractLaw):
    """A law on a window, and no pressure elsewhere: see `inside`."""

    law: AbstractLaw

    @property
    def attracts(self):  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.law.attracts

    @property
    def bounds(self):
        return self.law.bounds

    @property
    def steepest_rise(self):
        return self.law.steepest_rise

    def in_units(self, pressure, length):
        return Windowed(self.law.in_units(pressure, length))

    def proximal(self, v):
        return jnp.where(inside(v.shape), self.law.proximal(v), 0)

    def contact_indicator(self, pressure, gap, stiffness):
        found = self.law.contact_indicator(pressure, gap, stiffness)
        return jnp.where(inside(gap.shape), found, -stiffness * jnp.abs(gap))
