"""The paper's formula of a coated half space with ν₀, which is no physics, to redraw its figure."""

import numpy as np
from numpy.typing import ArrayLike

from graded_contact.core.checks import check_values


def paper_coated_half_space_compliance(
    q: ArrayLike,
    thickness: ArrayLike,
    modulus: ArrayLike,
    poisson: ArrayLike,
    poisson_at_rest: ArrayLike,
    base_modulus: ArrayLike,
    base_poisson: ArrayLike,
    base_poisson_at_rest: ArrayLike,
) -> np.ndarray:
    """Returns M_zz [m/Pa] of a coated half space by the paper's ν₀ formulas. THIS IS NOT PHYSICS.

    Scaraggi & Comingio (coating.on.bulk.ni) mix ν(ω) with ν₀ = ν(ω -> 0): displacements of a ν₀
    solid under tractions of a ν(ω) solid, which are not in equilibrium. The result may create
    energy, and a half space of ν and ν₀ comes out (1 - 2ν)(1 - ν₀)/((1 - 2ν₀)(1 - ν)) times as
    soft as it is. It is here only to redraw the paper's figure beside the exact one
    of `tests/closed_forms.py`, with which it agrees where ν = ν₀ in both solids.

    The printed formula is corrected in six places: ε_e is the ratio of E/(1 - ν²), not of E; `q`
    is q d; its prefactor n is -n/(2p); n₀ loses the n before its bracket and d₀ gains one; and
    in n₂ the bracket begins with ε_p and has no factors ε inside. So corrected it equals K T K⁻¹,
    T the exact matrix of a slab of ν₀ and K the map from its tractions to those of Hooke's law
    at ν.

    Loses digits in thick coatings (about ε (q d)²) and in thin ones of high contrast.

    **Arguments:** as the exact formula's, and ν₀ of both solids, below 1/2.
    """
    x = np.asarray(q) * np.asarray(thickness)
    nu, nub = np.asarray(poisson), np.asarray(base_poisson)
    nu0, nub0 = np.asarray(poisson_at_rest), np.asarray(base_poisson_at_rest)
    for name, value in (("poisson_at_rest", nu0), ("base_poisson_at_rest", nub0)):
        check_values(name, value, "this formula needs -1 < ν₀ < 0.5", above=-1, at_most=0.4999999)
    p, p0, pb, pb0 = 1 - nu, 1 - nu0, 1 - nub, 1 - nub0
    t = np.tanh(x)
    m, n = p / p0, (1 - 2 * nu) / (1 - 2 * nu0)
    g, b = n / m, (1 - 4 * nu * p0) / ((1 - 2 * nu) * (1 - 2 * nu0))
    stiff = np.asarray(modulus) / (1 - nu**2) / (np.asarray(base_modulus) / (1 - nub**2))
    ep = p / pb
    mm = m / (pb / pb0)
    w = 2 * mm * p - m * ep
    c1 = (
        4 * mm * p**2 * stiff * (t * (1 + m * x) + n * x)
        + w * (2 * p + m * x * t)
        + stiff * ep * ((m * ep - 4 * mm * p) * m * x * t - 2 * m * p * (n * x + t))
    )
    c2 = (
        -4 * mm * p**2 * stiff * (t * (1 + m * x) + n * x)
        + w * g * (2 * p * t - m * (x + t))
        + stiff * ep * (2 * mm * p * m * x * t + (w + 2 * m * p) * (n * x + t))
    )
    n0 = -2 * mm * p * stiff * (2 * p - ep) * (m * x * t - 2 * p) + w * (
        stiff * (2 * p - ep) * g * ((2 * p - m) * b * t - m * x) + 4 * n / m * p * t - n * (x + t)
    )
    n1 = 8 * stiff * (b * g * p * t + p - ep)
    n2 = (
        -2 * mm * p * stiff * (x * (g + t) + b * g * t)
        + stiff * ep * (ep - 2 * t * (b * g * p - mm * x))
        - mm * x * t
    )
    n3 = 2 * g * p * stiff * (x + b * t) + x * t * (1 - stiff * ep)
    d0 = 2 * mm * p * stiff * (2 * p - ep) * m * (n * x - t) + w * n * (
        stiff * (2 * p - ep) * n * x * t + g * m * x * t - 2 * p
    )
    d1 = 4 * n * t * (b + n * x * stiff)
    d2 = (
        2 * mm * stiff * (n * x - t) * (p - ep)
        - n * t * ep * (b + n * x * stiff)
        + n * mm * (x - b * t)
    )
    d3 = n * (b * t - x) - stiff * ep * (t - n * x)
    top = c1 * n0 + c2 * (n1 * mm * p**2 + 2 * n2 * m * p + n3 * ep * m**2)
    bottom = c1 * d0 + c2 * (d1 * mm * p**2 + 2 * d2 * m * p + d3 * ep * m**2)
    half_space = 2 * (1 - nu**2) / (np.asarray(q) * np.asarray(modulus))
    return half_space * (-n / (2 * p)) * top / bottom
