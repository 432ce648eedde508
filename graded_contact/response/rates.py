"""The differential equation of a face's compliance through a graded layer.

With κ = ν/(1 - ν), c in units of 2/(E_ref q), ζ = q z upwards, R = 2 E_r/E_ref and

    B1 = E_ref (1 + ν)/E,   B2 = E_ref (1 + ν)(1 - 2ν)/(2 E (1 - ν)),

    c11' = B1 - 2 c12 - R c11²         c12' = κ c11 - c22 - R c11 c12
    c22' = B2 + 2 κ c12 - R c12²       (det c)' = B1 c22 + B2 c11 - R c11 det c
    c_T' = B1 - c_T²/B1

(no derivative of a modulus appears; ν may vary). On a free base c is infinite, and its inverse
is integrated. Upwards the equation forgets its start as e^-2ζ; downwards it would blow up. Started
where the wave ends (`mesh.WINDOW`), it is not stiff. Downwards goes the stiffness G of what lies
above, which with the other sign of g12 obeys the equation of the inverse, and the traction
v = (t, s) on a clamped face, along y = -ζ

    t' = κ s - B1 g11 t - B2 g12 s     s' = -t - B1 g12 t - B2 g22 s     T' = -B1 g_T T,

of which the decay e^-y is taken out.
"""

from typing import NamedTuple

from jaxtyping import Array

from .column import Carried
from .slab import Compliance


class Equation(NamedTuple):
    """Of the compliance or its inverse, or downwards of a stiffness; the tolerance of a step."""

    inverse: bool
    down: bool
    step: float

    def rates(self, numbers, kappa, b1, b2, r):
        """Returns what the numbers change by per unit of ζ, or downwards of y."""
        plane, antiplane, traction = numbers
        if self.down:
            t, s, across = traction
            traction = (
                t + kappa * s - b1 * plane.c11 * t - b2 * plane.c12 * s,
                s - t - b1 * plane.c12 * t - b2 * plane.c22 * s,
                across - b1 * antiplane * across,
            )
            plane = plane._replace(c12=-plane.c12)
        rates = _inverse_rates if self.inverse or self.down else _rates
        plane = Compliance(*rates(plane, kappa, b1, b2, r))
        if self.down:
            plane = plane._replace(c12=-plane.c12)
        if antiplane is not None:
            soft = 1 / b1 if self.inverse or self.down else b1
            antiplane = soft - antiplane * antiplane / soft
        return Carried(plane, antiplane, traction)


def coefficients(modulus, poisson, reference) -> tuple[Array, Array, Array, Array]:
    """Returns κ, B1, B2 and R."""
    soft = reference * (1 + poisson) / modulus
    kappa = poisson / (1 - poisson)
    stiff = 2 * modulus / (reference * (1 - poisson**2))
    return kappa, soft, soft * (1 - 2 * poisson) / (2 * (1 - poisson)), stiff


def _rates(c, kappa, b1, b2, r):
    c11, c12, c22, det = c
    return (
        b1 - 2 * c12 - r * c11 * c11,
        kappa * c11 - c22 - r * c11 * c12,
        b2 + 2 * kappa * c12 - r * c12 * c12,
        b1 * c22 + b2 * c11 - r * c11 * det,
    )


def _inverse_rates(z, kappa, b1, b2, r):
    z11, z12, z22, det = z
    return (
        r - 2 * kappa * z12 - b1 * z11 * z11 - b2 * z12 * z12,
        z11 - kappa * z22 - b1 * z11 * z12 - b2 * z12 * z22,
        2 * z12 - b1 * z12 * z12 - b2 * z22 * z22,
        r * z22 - (b1 * z11 + b2 * z22) * det,
    )
