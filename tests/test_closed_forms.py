"""The closed forms against mpmath by other routes, published numbers and limits."""

import math
import runpy
from pathlib import Path

import closed_forms
import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import quad

PAPER = Path(__file__).parents[1] / "examples" / "paper" / "coated_half_space.py"
paper_coated_half_space = runpy.run_path(str(PAPER))["paper_coated_half_space_compliance"]

# (modulus, ν): compressible, auxetic, incompressible, lossy, lossy with complex ν
MATERIALS = [(2.0, 0.3), (0.7, -0.6), (3.0, 0.5), (2 - 1j, 0.49), (5 - 3j, 0.4 + 0.02j)]


def propagator(x, poisson):
    """exp(A x) of the in-plane equations of a slab, order (t, s | U, w), stresses in q E_r/2."""
    nu = mp.mpmathify(poisson)
    p, e = 1 - nu, 1 - 2 * nu
    rows = [0, -nu / p, 2, 0], [1, 0, 0, 0], [1 / p, 0, 0, -1], [0, e / (2 * p**2), nu / p, 0]
    return mp.expm(mp.matrix(rows) * x)


def state_space_compliance(q, thickness, modulus, poisson, base):
    """M_zz of a slab on "rigid", "free" or the half space (E, ν), by the matrix exponential."""
    with mp.workdps(60):
        q, modulus, nu = mp.mpf(q), mp.mpmathify(modulus), mp.mpmathify(poisson)
        t = propagator(q * mp.mpf(thickness), poisson)
        unit = modulus / (1 - nu**2)
        t11, t12, t21, t22 = t[:2, :2], t[:2, 2:], t[2:, :2], t[2:, 2:]
        if base == "rigid":
            c = t21 * t11**-1
        elif base == "free":
            c = t22 * t12**-1
        else:
            modulus0, nu0 = map(mp.mpmathify, base)
            g = (1 - 2 * nu0) / (2 - 2 * nu0)
            below = mp.matrix([[1, -g], [-g, 1]]) * (unit / (modulus0 / (1 - nu0**2)))
            c = (t21 + t22 * below) * (t11 + t12 * below) ** -1
        return complex(c[1, 1] * 2 / (unit * q))


@pytest.mark.parametrize("modulus, poisson", MATERIALS)
@pytest.mark.parametrize("depth", [1e-6, 1e-4, 0.01, 0.05, 0.7, 3.0, 25.0])
def test_slabs_match_matrix_exponential(depth, modulus, poisson):
    """To the documented loss of digits, times ten."""
    q, thickness = 40.0, depth / 40.0
    rigid = closed_forms.slab_on_rigid_compliance(q, thickness, modulus, poisson)
    free = closed_forms.free_slab_compliance(q, thickness, modulus, poisson)
    lost = 1 / abs(1 - 2 * poisson + depth**2)
    for value, base, digits in ((rigid, "rigid", lost), (free, "free", 1 / depth**2)):
        expected = state_space_compliance(q, thickness, modulus, poisson, base)
        assert abs(value - expected) <= 10 * 2.2e-16 * (1 + digits) * abs(expected)


@pytest.mark.parametrize("base", [(1.0, 0.45), (1e-3, 0.2), (1e3, 0.5), (5 - 3j, 0.4 + 0.02j)])
@pytest.mark.parametrize("modulus, poisson", MATERIALS)
def test_coated_half_space_matches_matrix_exponential(modulus, poisson, base):
    for depth in (0.01, 0.5, 3.0, 20.0):
        value = closed_forms.coated_half_space_compliance(4.0, depth / 4, modulus, poisson, *base)
        expected = state_space_compliance(4.0, depth / 4, modulus, poisson, base)
        ratio = abs(modulus / base[0])
        tolerance = 20 * 2.2e-16 * max(ratio, 1 / ratio)
        assert abs(value - expected) <= tolerance * abs(expected)


def test_paper_coated_half_space_is_right_only_where_poisson_ratios_are_constant():
    q = np.array([0.1, 1.0, 4.0])
    args = (q, 1.0, 2 - 1j, 0.3)
    same = paper_coated_half_space(*args, 0.3, 5 + 1j, 0.45, 0.45)
    exact = closed_forms.coated_half_space_compliance(*args, 5 + 1j, 0.45)
    np.testing.assert_allclose(same, exact, rtol=1e-12)
    # A glassy half space, ν 0.49 -> 0.3, comes out 14.6 times too soft (same solid as coating).
    soft = paper_coated_half_space(q, 1e-3, 1.0, 0.3, 0.49, 1.0, 0.3, 0.49)
    np.testing.assert_allclose(soft / closed_forms.half_space_compliance(q, 1.0, 0.3), 14.571, 1e-4)
    with pytest.raises(ValueError, match=r"`poisson_at_rest=0\.5` is refused"):
        paper_coated_half_space(q, 1.0, 1.0, 0.3, 0.5, 1.0, 0.3, 0.49)


def test_deep_layers_are_half_spaces_and_do_not_overflow():
    for depth in (50.0, 1e3, 1e8):
        half = closed_forms.half_space_compliance(2.0, 3 - 1j, 0.4)
        args = (2.0, depth / 2, 3 - 1j, 0.4)
        for value in (
            closed_forms.slab_on_rigid_compliance(*args),
            closed_forms.free_slab_compliance(*args),
            closed_forms.coated_half_space_compliance(*args, 1e-3, 0.1),
        ):
            np.testing.assert_allclose(value, half, rtol=1e-15)


def test_hertz_sphere_closes_its_gap_and_carries_its_load():
    load, radius, modulus = 3.0, 0.02, 4e6
    a, peak, approach = closed_forms.hertz_sphere(load, radius, modulus)
    total, _ = quad(lambda r: 2 * np.pi * r * closed_forms.hertz_pressure(r, a, peak), 0, a)
    np.testing.assert_allclose(total, load, rtol=1e-9)
    # Boussinesq: a ring of pressure p at distance s lowers the middle by 2 p ds/E*.
    centre, _ = quad(
        lambda s: 2 * closed_forms.hertz_pressure(s, a, peak) / modulus,
        0,
        a,
        epsabs=0,
        epsrel=1e-10,
    )
    np.testing.assert_allclose(centre, approach, rtol=1e-9)
    edge, _ = quad(  # at the edge, along chords of length 2a cos φ
        lambda phi: quad(
            lambda s: 2 / (np.pi * modulus)
            * closed_forms.hertz_pressure(np.sqrt(a**2 + s**2 - 2 * a * s * np.cos(phi)), a, peak),
            0, 2 * a * np.cos(phi), epsabs=0, epsrel=1e-7,
        )[0], 0, np.pi / 2, epsabs=0, epsrel=1e-7,
    )  # fmt: skip
    np.testing.assert_allclose(edge, approach - a**2 / (2 * radius), rtol=1e-6)


def test_hertz_line_has_the_slope_of_its_cylinder():
    load, radius, modulus = 600.0, 0.05, 3e6
    a, peak = closed_forms.hertz_line(load, radius, modulus)

    def pressure(s):
        return closed_forms.hertz_pressure(s, a, peak)

    np.testing.assert_allclose(quad(pressure, -a, a)[0], load, rtol=1e-9)
    for x in (-0.6 * a, 0.3 * a):
        # u'(x) = -(2/(π E*)) PV ∫ p(s)/(x - s) ds
        slope = 2 / (np.pi * modulus) * quad(pressure, -a, a, weight="cauchy", wvar=x)[0]
        np.testing.assert_allclose(slope, -x / radius, rtol=1e-6)


@pytest.mark.parametrize("ratio", [0.05, 0.6, 0.999, 1.5])
def test_westergaard_pressure_carries_the_load_and_follows_the_wave(ratio):
    amplitude, wavelength, modulus = 1e-6, 1e-3, 2e6
    mean = ratio * np.pi * modulus * amplitude / wavelength
    args = (mean, amplitude, wavelength, modulus)
    a = wavelength / 2 * closed_forms.westergaard_area(*args)
    n = 4096
    x = a * np.cos((np.arange(n) + 0.5) * np.pi / n)  # Chebyshev points resolve the edges
    weight = np.sqrt(a**2 - x**2) * np.pi / n
    pressure = closed_forms.westergaard_pressure(x, *args)
    np.testing.assert_allclose(np.sum(weight * pressure) / wavelength, mean, rtol=1e-5)
    # u'(x0) = -(2/(E* λ)) PV ∫ p cot(π (x0 - s)/λ) ds, made regular: ∫ cot over a period is 0
    period = (np.arange(n) + 0.5) * wavelength / n
    for x0 in (0.2 * a, -0.5 * a):
        here = closed_forms.westergaard_pressure(x0, *args)
        s = x0 + period
        values = closed_forms.westergaard_pressure(s, *args) - here
        slope = 2 / modulus * np.mean(values / np.tan(np.pi * (s - x0) / wavelength))
        expected = -2 * np.pi * amplitude / wavelength * np.sin(2 * np.pi * x0 / wavelength)
        np.testing.assert_allclose(slope, expected, rtol=2e-3)
    if ratio < 1:
        assert closed_forms.westergaard_pressure(wavelength / 2, *args) == 0


def test_double_sinusoid_limits_match_hertz_and_the_unpressurised_crack():
    amplitude, wavelength, modulus = 1e-6, 1e-3, 2e6
    full = np.sqrt(2) * np.pi * modulus * amplitude / wavelength
    k = 2 * np.pi / wavelength
    pressure = 1e-3 * full
    light, _ = closed_forms.double_sinusoid_area(pressure, amplitude, wavelength, modulus)
    radius, _, _ = closed_forms.hertz_sphere(
        pressure * wavelength**2 / 2, 1 / (amplitude * k**2), modulus
    )
    np.testing.assert_allclose(light, 2 * np.pi * radius**2 / wavelength**2, rtol=1e-12)
    # A penny crack of radius b under the tension T(r) = (p* - p) - p* k² r²/2 has no stress
    # intensity, ∫ T r/sqrt(b² - r²) dr = 0, where b² = 3 (1 - p/p*)/k²; two cracks a cell.
    pressure = 0.98 * full
    _, nearly = closed_forms.double_sinusoid_area(pressure, amplitude, wavelength, modulus)
    b = wavelength * np.sqrt((1 - nearly) / (2 * np.pi))
    intensity, _ = quad(
        lambda t: ((full - pressure) - full * (k * b * np.sin(t)) ** 2 / 2) * b * np.sin(t),
        0, np.pi / 2,
    )  # fmt: skip
    assert abs(intensity) < 1e-12 * full * b


def test_full_contact_friction_matches_time_stepping():
    """A Maxwell-branch half space under the moving wave, integrated in time and space.

    E_r(t) = E0 + E1 exp(-t/τ), so the pressure of the wave is (q/2) ∫ E_r(t - s) du(s) with
    u = D cos(q (x - v s)); the history is summed by quadrature, without complex numbers.
    """
    amplitude, q, velocity, tau, e0, e1, mean = 2e-6, 5e3, 0.3, 4e-4, 1e6, 7e6, 2e5
    omega = q * velocity

    def pressure(x):  # at time 0, with the history in units of τ
        history, _ = quad(
            lambda s: np.exp(-s) * q * velocity * np.sin(q * x + omega * tau * s) * tau, 0, 40,
            limit=400,
        )  # fmt: skip
        # ∂u/∂t = D q v sin(q (x - v t)), t = -τ s
        return mean + q * amplitude / 2 * (e0 * np.cos(q * x) + e1 * history)

    x = np.arange(16) * 2 * np.pi / (16 * q)
    pressures = np.array([pressure(value) for value in x])
    slope = -amplitude * q * np.sin(q * x)
    expected = -np.mean(pressures * slope) / mean
    modulus = e0 + e1 * 1j * omega * tau / (1 + 1j * omega * tau)
    compliance = closed_forms.half_space_compliance(q, modulus, 0.0)
    friction = closed_forms.full_contact_friction(amplitude, q, compliance, mean)
    assert friction > 0
    np.testing.assert_allclose(friction, expected, rtol=1e-9)
    closed = amplitude**2 * q**2 * modulus.imag / (4 * mean)
    np.testing.assert_allclose(friction, closed, rtol=1e-14)
    assert np.min(pressures) > 0


def test_persson_area_has_its_limits_and_tabulated_values():
    load = np.array([0.02, 0.1, 0.3, 1.0])
    area = closed_forms.persson_contact_area(load * 2e6 * 0.1, 2e6, 0.1)
    np.testing.assert_allclose(area, [0.0319, 0.1585, 0.4515, 0.9545], atol=5e-5)
    light = closed_forms.persson_contact_area(1e-6, 1.0, 1.0)
    np.testing.assert_allclose(light, np.sqrt(8 / np.pi) * 1e-6, rtol=1e-9)
    assert area[1] == pytest.approx(float(mp.erf(mp.sqrt(2) / 10)), rel=1e-14)


def gliding(ratio, speed):
    """The cylinder with F = R = E_r = 1 at τ v/a_r = speed; lengths come back over a_r."""
    a, peak = closed_forms.hertz_line(1.0, 1.0, 1.0)
    contact = closed_forms.viscoelastic_cylinder(1.0, 1.0, ratio, ratio - 1, 2.0, speed * a / 2)
    return contact, float(a), float(peak)


@pytest.mark.parametrize(
    "time, peak, left, right, friction",
    [
        (0, 60.318, -6.333, 6.333, 0),
        (0.009, 78.734, -3.907, 5.838, 0.024444),
        (0.045, 84.718, -3.970, 5.051, 0.011916),
        (2.0, 85.302, -4.447, 4.509, 0.000648),
    ],
)
def test_cylinder_matches_wang_and_knothe(time, peak, left, right, friction):
    """Two cylinders of 100 mm radius, G = 1143 MPa, ν = 0.4, as CONTACT's reference output."""
    modulus = 1143e6 / (1 - 0.4)
    contact = closed_forms.viscoelastic_cylinder(600e3, 0.05, modulus, 1.0, time, 1.0)
    assert contact.peak_pressure / 1e6 == pytest.approx(peak, abs=6e-4)
    interval = np.array([-1, 1]) * contact.half_width + contact.offset
    np.testing.assert_allclose(interval * 1e3, [left, right], atol=6e-4)
    assert contact.friction == pytest.approx(friction, abs=6e-7)
    published = {0: (60.32, 80), 0.009: (78.74, 62), 0.045: (84.72, 57), 2.0: (85.31, 56)}[time]
    assert contact.peak_pressure / 1e6 == pytest.approx(published[0], rel=2e-4)
    # The program counts elements of 0.16 mm that touch at all.
    assert 0 <= published[1] - 2e3 * contact.half_width / 0.16 < 2


@pytest.mark.parametrize("speed", [0.05, 0.7, 5.0])
def test_cylinder_pressure_deforms_the_solid_into_its_shape(speed):
    """Load, friction as a moment, and u' = -x/R recomputed from the pressure's creep history."""
    ratio = 4
    contact, a, _ = gliding(ratio, speed)
    lag, middle, half = speed * a, contact.offset, contact.half_width
    left, right = middle - half, middle + half
    # Chebyshev sums: the pressure goes to zero as a square root at both edges.
    n = 2000
    theta = (np.arange(n) + 0.5) * np.pi / n
    x = middle + half * np.cos(theta)
    pressure = contact.pressure(x)
    weight = half * np.sin(theta) * np.pi / n
    np.testing.assert_allclose(np.sum(weight * pressure), 1, rtol=1e-6)
    np.testing.assert_allclose(np.sum(weight * pressure * x), contact.friction, rtol=1e-5)
    # J p = (1/E_g)(p + f Q), Q(x) = ∫_x^∞ p(s) exp((x - s)/lag) ds/lag. Its Hilbert transform by
    # a Gaussian-free route: quad's Cauchy weight, with Q tabulated inside and decaying behind.
    grid = np.linspace(left, right, 4001)
    p = contact.pressure(grid)
    step = grid[1] - grid[0]
    factor = np.exp(-step / lag)
    q = np.zeros_like(grid)
    for i in range(len(grid) - 2, -1, -1):
        q[i] = q[i + 1] * factor + step * (p[i] + factor * p[i + 1]) / (2 * lag)
    total = (p + (ratio - 1) * q) / ratio

    def strained(s):
        return np.interp(s, grid, total) if s > left else total[0] * np.exp((s - left) / lag)

    for x0 in (middle - 0.4 * half, middle + 0.5 * half):
        near, _ = quad(strained, left, right, weight="cauchy", wvar=x0, limit=200, epsabs=1e-7)
        far, _ = quad(lambda s, x0=x0: strained(s) / (s - x0), left - 40 * lag, left, limit=200)
        np.testing.assert_allclose(2 / np.pi * (near + far), -x0, atol=2e-4 * a)


def test_cylinder_limits_are_the_two_hertz_contacts():
    relaxed, a, peak = gliding(10, 1e-6)
    assert relaxed.half_width == pytest.approx(a, rel=1e-6)
    assert relaxed.friction / (1e-6 * a) == pytest.approx(0.9, rel=1e-5)  # f/(1 + f)
    assert relaxed.peak_pressure == pytest.approx(peak, rel=1e-6)
    glassy, a, peak = gliding(10, 1e5)
    assert glassy.half_width == pytest.approx(a / math.sqrt(10), rel=1e-4)
    assert glassy.peak_pressure == pytest.approx(peak * math.sqrt(10), rel=1e-4)
    at_rest, a, peak = gliding(10, 0.0)
    assert (at_rest.half_width, at_rest.friction, at_rest.offset) == (a, 0, 0)
    assert at_rest.pressure(0.0) == peak
