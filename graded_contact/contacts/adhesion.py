"""Laws of interaction that attract.

If the attraction rises more steeply with the gap than the stiffness of the solid, points snap into
contact and out of it, and the solution depends on history: follow a path of gaps, each contact the
`start` of the next.

Let r be the slope of the attraction over the stiffness of the solid to the shortest wave, 1/|M|. A
grid resolves the attraction if r is well below 1; otherwise points snap one by one.
`DouglasRachford` finds equilibria, stable or not: of 100 solves along a closing and opening path on
a wavy line none was unstable at r = 0.3, 1 at 0.5, 4 at 0.7, 11 at 3; above 0.3 it reports this.
The equilibria of `ResidualDynamics` were all stable.
"""

import equinox as eqx
import jax.numpy as jnp

from ..core.checks import positive, scalar
from ..core.display import shown
from .law import AbstractLaw, Bound, SmoothLaw, power, proximal_root, repulsive_bracket
from .operators.operator import Scalar

EDGE = "it must be positive and at most 1.2, the gap of the greatest tension"


@shown(units=False)
class AdhesiveLJ(SmoothLaw):
    """The Lennard-Jones potential integrated over two half spaces: σ = (8w/3ε) [(ε/u)⁹ - (ε/u)³].

    The work against it from u = ε to infinity is w; its greatest tension, 1.03 w/ε, is at
    u = 1.20 ε. A point is in contact where u < `contact_gap` ε; with 1, where it is compressed;
    with 1.2 as Johnson, Kendall & Roberts have it, with tension inside its edge.

    **Fields:**

    - `range`: ε [m].
    - `work`: of adhesion w [J/m²].
    - `contact_gap`: edge of contact [1], at most 1.2.
    """

    attracts = True
    range: Scalar = eqx.field(converter=positive("range", "[m]"))
    work: Scalar = eqx.field(converter=positive("work", "[J/m²]"))
    contact_gap: Scalar = eqx.field(
        converter=scalar("contact_gap", EDGE, above=0, at_most=1.2), default=1.0
    )

    @property
    def _scale(self):
        return 8 * self.work / (3 * self.range)

    @property
    def bounds(self):
        return -self._scale * (3**-0.5 - 3**-1.5), jnp.inf  # at u⁶ = 3 ε⁶

    @property
    def steepest_rise(self):
        return self._scale / self.range * 1.8 * 7.5 ** (-2 / 3)  # at u⁶ = 7.5 ε⁶

    def in_units(self, pressure: Bound, length: Bound) -> "AdhesiveLJ":
        return AdhesiveLJ(self.range / length, self.work / (pressure * length), self.contact_gap)

    def _pressure_and_slope(self, t):
        (near, d_near), (far, d_far) = power(t, 9), power(t, 3)
        return self._scale * (near - far), self._scale * (d_near - d_far)

    def proximal(self, v):
        # t⁻³ <= t⁻⁹/2 + (2/3)^(3/2), so the root lies right of the root for half the repulsion.
        shifted = v + (2 / 3) ** 1.5 * self._scale
        low, _ = repulsive_bracket(shifted, self._scale / 2, self.range)
        _, high = repulsive_bracket(v, self._scale, self.range)
        return proximal_root(self._pressure_and_slope, self.range, v, low, high, 16)


@shown(units=False)
class ExponentialAdhesion(AbstractLaw):
    """A hard wall that attracts: σ = -(w/λ) exp(-u/λ) for u > 0, σ >= -w/λ at u = 0.

    The law of the contact-mechanics challenge (M. H. Müser et al., Tribol. Lett. 65 (2017) 118,
    doi:10.1007/s11249-017-0900-2). A point is in contact where the gap is closed.

    **Fields:**

    - `range`: λ [m].
    - `work`: of adhesion w [J/m²].
    """

    attracts = True
    range: Scalar = eqx.field(converter=positive("range", "[m]"))
    work: Scalar = eqx.field(converter=positive("work", "[J/m²]"))

    @property
    def bounds(self):
        return -self.work / self.range, jnp.inf

    @property
    def steepest_rise(self):
        return self.work / self.range**2

    def in_units(self, pressure, length):
        return ExponentialAdhesion(self.range / length, self.work / (pressure * length))

    def proximal(self, v):
        tension = self.work / self.range
        closed = v >= -tension

        def pressure_and_slope(t):
            pull = tension * jnp.exp(-t)
            return -pull, pull

        # Where the gap is closed the root is not needed; the root of another v serves.
        pulled = jnp.where(closed, -tension - self.range, v)
        low, high = -(pulled + tension) / self.range, -pulled / self.range
        y = proximal_root(pressure_and_slope, self.range, pulled, low, high, 12)
        return jnp.where(closed, v, y)

    def contact_indicator(self, pressure, gap, stiffness):
        # Stiffer than the law everywhere, so that only a closed gap passes.
        steep = jnp.maximum(stiffness, 2 * self.steepest_rise)
        beyond = pressure + self.work / self.range
        return jnp.where(beyond > steep * gap, beyond, -stiffness * jnp.maximum(gap, 0))
