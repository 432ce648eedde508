"""Closed forms that tests compare the package with; they share no code with it.

Plain NumPy formulas, SI units, the conventions of the package: z and displacement into the solid,
pressure positive in compression, fields exp(i(q x + ω t)) so that loss moduli are positive, a
surface moving with velocity v along x excites ω = -q v. "Reduced modulus" means E/(1 - ν²) of the
one deformable solid, or 1/Σ (1 - ν²)/E of two.

They follow the notation of their sources. Where a formula loses digits to cancellation its
docstring says so; the package's own functions do not.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

Values = np.ndarray | np.inexact  # NumPy returns scalars for arrays without axes


class GlidingCylinder(NamedTuple):
    """The contact of a cylinder that glides.

    **Fields:**

    - `half_width`: of the contact [m].
    - `offset`: of its middle ahead of the cylinder's axis [m].
    - `peak_pressure`: [Pa].
    - `friction`: [1].
    - `pressure`: at x [m] ahead of the axis, `pressure(x)` [Pa].
    """

    half_width: float
    offset: float
    peak_pressure: float
    friction: float
    pressure: Callable[[ArrayLike], Values]


def half_space_compliance(q: ArrayLike, modulus: ArrayLike, poisson: ArrayLike) -> Values:
    """Returns M_zz = 2(1 - ν²)/(q E) [m/Pa] of a half space.

    Exact for complex, frequency-dependent E and ν (correspondence principle). K. L. Johnson,
    Contact Mechanics, Cambridge University Press (1985), doi:10.1017/CBO9781139171731.

    **Arguments:**

    - `q`: wavenumber |q| [rad/m], positive; all arguments broadcast.
    - `modulus`: Young's modulus E [Pa], real or complex.
    - `poisson`: Poisson's ratio ν [1], real or complex.
    """
    return 2 * (1 - np.square(poisson)) / (np.asarray(q) * np.asarray(modulus))


def slab_on_rigid_compliance(
    q: ArrayLike, thickness: ArrayLike, modulus: ArrayLike, poisson: ArrayLike
) -> Values:
    """Returns M_zz [m/Pa] of a slab bonded to a rigid base.

    With x = q d and k = 3 - 4ν, relative to a half space of the same material,
    m = [k sinh 2x - 2x] / [k cosh 2x + 2x² + 4ν(2ν - 3) + 5].
    G. Carbone, L. Mangialardi, J. Mech. Phys. Solids 56 (2008) 684; G. Carbone et al., Eur.
    Phys. J. E 29 (2009) 275.

    Loses digits in thin slabs: the relative error is about ε/(1 - 2ν + x²), so nothing is left
    at ν = 1/2 below x = 1e-8.

    **Arguments:** as `half_space_compliance`, and `thickness` d [m], positive.
    """
    x, poisson = _depth(q, thickness), np.asarray(poisson)
    k, decay = 3 - 4 * poisson, np.exp(-2 * x)
    top = -k * np.expm1(-4 * x) - 4 * x * decay
    bottom = k * (1 + decay**2) + 2 * decay * (2 * x**2 + 4 * poisson * (2 * poisson - 3) + 5)
    return half_space_compliance(q, modulus, poisson) * top / bottom


def coated_half_space_compliance(
    q: ArrayLike,
    thickness: ArrayLike,
    modulus: ArrayLike,
    poisson: ArrayLike,
    base_modulus: ArrayLike,
    base_poisson: ArrayLike,
) -> Values:
    """Returns M_zz [m/Pa] of a half space with one bonded coating.

    Relative to a half space of the coating (1), with x = q d, r = μ1/μ0 (shear moduli, base 0),
    a = (r - 1)/(r + 3 - 4ν1), b = 1 - 4(1 - ν1)/(1 + r(3 - 4ν0)),
    m = [1 + 4 a x e^-2x - a b e^-4x] / [1 - (a + b + 4 a x²) e^-2x + a b e^-4x].
    B. N. J. Persson, J. Phys.: Condens. Matter 24 (2012) 095008.

    Loses digits in thin coatings of high contrast: the relative error is about ε max(r, 1/r)
    for x << 1 and fades as e^-2x.

    **Arguments:** as `slab_on_rigid_compliance` for the coating, then `base_modulus` [Pa] and
    `base_poisson` [1] of the half space; all moduli and ratios may be complex.
    """
    x, poisson, base_poisson = _depth(q, thickness), np.asarray(poisson), np.asarray(base_poisson)
    r = np.asarray(modulus) * (1 + base_poisson) / (np.asarray(base_modulus) * (1 + poisson))
    a = (r - 1) / (r + 3 - 4 * poisson)
    b = 1 - 4 * (1 - poisson) / (1 + r * (3 - 4 * base_poisson))
    decay = np.exp(-2 * x)
    top = 1 + 4 * a * x * decay - a * b * decay**2
    bottom = 1 - (a + b + 4 * a * x**2) * decay + a * b * decay**2
    return half_space_compliance(q, modulus, poisson) * top / bottom


def hertz_sphere(
    load: ArrayLike, radius: ArrayLike, reduced_modulus: ArrayLike
) -> tuple[Values, Values, Values]:
    """Returns contact radius [m], peak pressure [Pa] and approach [m] of a sphere on a plane.

    a = (3 F R/(4 E*))^(1/3), p_max = 3F/(2π a²), δ = a²/R, with `load` F [N], `radius` R [m],
    `reduced_modulus` E* [Pa]. K. L. Johnson, Contact Mechanics, Cambridge University Press (1985).
    """
    load, radius = np.asarray(load), np.asarray(radius)
    a = np.cbrt(3 * load * radius / (4 * np.asarray(reduced_modulus)))
    return a, 3 * load / (2 * np.pi * a**2), a**2 / radius


def hertz_line(
    load: ArrayLike, radius: ArrayLike, reduced_modulus: ArrayLike
) -> tuple[Values, Values]:
    """Returns contact half-width [m] and peak pressure [Pa] of a cylinder on a plane.

    a = sqrt(4 F R/(π E*)), p_max = 2F/(π a), with `load` F per length [N/m]; otherwise as
    `hertz_sphere`.
    """
    a = np.sqrt(4 * np.asarray(load) * radius / (np.pi * np.asarray(reduced_modulus)))
    return a, 2 * np.asarray(load) / (np.pi * a)


def hertz_pressure(distance: ArrayLike, half_width: ArrayLike, peak_pressure: ArrayLike) -> Values:
    """Returns p_max sqrt(1 - (s/a)²) [Pa] at `distance` s [m] from the middle of either contact."""
    inside = np.maximum(0, 1 - (np.asarray(distance) / np.asarray(half_width)) ** 2)
    return np.asarray(peak_pressure) * np.sqrt(inside)


def westergaard_area(
    pressure: ArrayLike, amplitude: ArrayLike, wavelength: ArrayLike, reduced_modulus: ArrayLike
) -> Values:
    """Returns the contact area fraction [1] of the wave D cos(2π x/λ) on an elastic half space.

    A/A0 = (2/π) asin sqrt(p/p*), full (1) from p* = π E* D/λ on, with mean `pressure` p [Pa],
    `amplitude` D [m], `wavelength` λ [m], `reduced_modulus` E* [Pa]. H. M. Westergaard, J. Appl.
    Mech. 6 (1939) A49.
    """
    ratio = _wave_ratio(pressure, amplitude, wavelength, reduced_modulus)
    return 2 / np.pi * np.arcsin(np.sqrt(np.minimum(ratio, 1)))


def westergaard_pressure(
    position: ArrayLike,
    pressure: ArrayLike,
    amplitude: ArrayLike,
    wavelength: ArrayLike,
    reduced_modulus: ArrayLike,
) -> Values:
    """Returns the pressure [Pa] under the wave of `westergaard_area`.

    With ψ = π x/λ and sin² ψ_a = p/p*, p(x) = 2 p cos ψ sqrt(sin² ψ_a - sin² ψ)/sin² ψ_a in
    contact, `position` x [m] counted from a crest that touches; from p* on, p + p* cos 2ψ.
    """
    pressure = np.asarray(pressure)
    ratio = _wave_ratio(pressure, amplitude, wavelength, reduced_modulus)
    psi = np.pi * np.asarray(position) / np.asarray(wavelength)
    inside = np.maximum(0, ratio - np.sin(psi) ** 2)
    touching = 2 * pressure * np.abs(np.cos(psi)) * np.sqrt(inside) / ratio
    return np.where(ratio < 1, touching, pressure * (1 + np.cos(2 * psi) / ratio))


def persson_contact_area(
    pressure: ArrayLike, reduced_modulus: ArrayLike, rms_slope: ArrayLike
) -> Values:
    """Returns erf(√2 p/(E* h'_rms)) [1], Persson's contact area fraction of a rough surface.

    `pressure` p [Pa], `reduced_modulus` E* [Pa], `rms_slope` h'_rms [1] of the whole gradient. An
    approximation: a third too low at light load, exact at full contact. B. N. J. Persson, J. Chem.
    Phys. 115 (2001) 3840, doi:10.1063/1.1388626.
    """
    argument = math.sqrt(2) * np.asarray(pressure) / (np.asarray(reduced_modulus) * rms_slope)
    return np.vectorize(math.erf, otypes=[float])(argument)


def viscoelastic_cylinder(
    load: float, radius: float, glassy_modulus: float, creep: float, time: float, velocity: float
) -> GlidingCylinder:
    """Returns the steady contact of a cylinder gliding on a standard linear solid, exactly.

    The solid creeps as 1/E*(ω) = (1/E_g)[1 + f/(1 + iωτ)]; E_r = E_g/(1 + f), κ = τv/(1 + f).
    With half-width l, y = l/κ, z = l/(τv), D = l²/2 + 2RF/(π E_r) and the unknowns l, e,

        D I0(y) - e l I1(y) - l² [I0(y) - I1(y)/y] = 0
        D K0(z) + e l K1(z) - l² [K0(z) + K1(z)/z] = 0.

    The middle of the contact is at τv - e and μ R = τv - e - κ + π E_r e l²/(4 R F). S. C. Hunter,
    J. Appl. Mech. 28 (1961) 611; I. G. Goryacheva, J. Appl. Math. Mech. 37 (1973) 877. Eliminating
    e leaves a² = l² + 2 l (τv - κ)/S(l), S = I0(y)/I1(y) + K0(z)/K1(z), with a the Hertz half-width
    at E_r: its right side is 0 at l = 0 and at least a² at l = a, so bisection cannot fail.

    Friction loses digits at high speed: the relative error is about ε (τv/a)².

    **Arguments:** `load` F per length [N/m]; `radius` R [m]; `glassy_modulus`, the reduced E_g [Pa]
    (of two equal solids, half of one's); `creep`, delayed over instantaneous compliance f [1];
    retardation `time` τ [s] and `velocity` v [m/s], either zero for the Hertz contact at E_r.
    """
    a, peak = map(float, hertz_line(load, radius, glassy_modulus / (1 + creep)))
    lag = time * velocity
    if lag == 0:
        at_rest = partial(hertz_pressure, half_width=a, peak_pressure=peak)
        return GlidingCylinder(a, 0.0, peak, 0.0, at_rest)
    kappa = lag / (1 + creep)
    delayed = lag - kappa

    low, high = 0.0, a
    while low < (middle := (low + high) / 2) < high:
        too_wide = middle**2 + 2 * middle * delayed / sum(_ratios(middle, kappa, lag)) > a**2
        low, high = (low, middle) if too_wide else (middle, high)
    first, second = _ratios(high, kappa, lag)
    offset = delayed * second / (first + second)
    e, d = lag - offset, (high**2 + a**2) / 2
    pressure = partial(
        _gliding_pressure,
        shape=(high, offset, e, d, kappa),
        scale=glassy_modulus / (2 * radius * lag),
    )
    friction = (delayed - 2 * delayed * e * high / (a**2 * (first + second))) / radius
    return GlidingCylinder(
        high, offset, _highest(pressure, offset - high, offset + high), friction, pressure
    )


def _gliding_pressure(x: ArrayLike, shape: tuple[float, ...], scale: float) -> Values:
    """Returns p(x) = ∫_x^l (D + e s - s²) exp((x - s)/κ)/sqrt(l² - s²) ds · E_g/(2Rτv) [Pa]."""
    l, offset, e, d, kappa = shape
    x = np.clip(np.asarray(x, float) - offset, -l, l)[..., None]
    # s = l cos θ, cut where the exponential is below e^-45.
    begin = np.arccos(np.minimum(x + 45 * kappa, l) / l)
    span = (np.arccos(x / l) - begin) / 2
    s = l * np.cos(begin + span * (1 + _NODES))
    terms = _WEIGHTS * span * (d + e * s - s**2) * np.exp((x - s) / kappa)
    return scale * np.sum(terms, axis=-1)


def _highest(profile: Callable[[np.ndarray], Values], left: float, right: float) -> float:
    """Returns the maximum of a profile with one peak, on ever finer grids."""
    for _ in range(7):
        grid = np.linspace(left, right, 33)
        best = int(np.argmax(profile(grid)))
        left, right = grid[max(best - 1, 0)], grid[min(best + 1, 32)]
    return float(profile(np.array((left + right) / 2)))


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


def _ratios(half_width: float, kappa: float, lag: float) -> tuple[float, float]:
    """Returns I0(y)/I1(y) at y = l/κ and K0(z)/K1(z) at z = l/(τv)."""
    y, z = half_width / kappa, half_width / lag
    ive, kve = scipy.special.ive, scipy.special.kve
    return float(ive(0, y) / ive(1, y)), float(kve(0, z) / kve(1, z))


def _depth(q: ArrayLike, thickness: ArrayLike) -> Values:
    return np.asarray(q) * np.asarray(thickness)


def _wave_ratio(pressure, amplitude, wavelength, reduced_modulus) -> Values:
    full = np.pi * np.asarray(reduced_modulus) * amplitude / wavelength
    return np.asarray(pressure) / full
