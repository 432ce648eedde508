"""The oracle is the spectrum from which pieces of surfaces and lines are drawn, by NumPy alone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erf, gamma

import graded_contact as gc
from graded_contact.mean_field.mean_field import mean_field_friction
from graded_contact.mean_field.roughness import as_roughness
from graded_contact.surfaces import (
    SpectrumTable,
    joined_spectrum,
    radial_spectrum,
    random_surface,
    scan_spectrum,
    statistics,
    surface_from_heights,
)
from graded_contact.surfaces.joined_spectrum import isotropic

SCENE = """
[surface]
kind = "scans"
q_high = 1e5
[[surface.scans]]
path = 'line.npz'
name = "track"
shortest = 1e-4
[[surface.scans]]
path = 'area.npz'
[grid]
shape = [64, 64]
size = 1e-3
[base]
kind = "half_space"
material = "rubber"
[materials.rubber]
kind = "elastic"
modulus = 1e7
[load]
pressure = 1e5
velocity = 0.0
"""
HURST, ROLL, PLATEAU = 0.8, 2 * np.pi / 3e-3, 1e-18


def _density(q):
    return PLATEAU * (1 + (q / ROLL) ** 2) ** -(1 + HURST)


def _area(length, n, seed, noise=0.0, factor=1.0):
    """A quarter of a periodic surface of twice the length."""
    rng, num = np.random.default_rng(seed), 2 * n
    k = 2 * np.pi * np.fft.fftfreq(num, 2 * length / num)
    q = np.hypot(*np.meshgrid(k, k, indexing="ij"))
    unit = np.fft.fft2(rng.normal(size=(num, num))) * np.pi / length * num
    heights = np.real(np.fft.ifft2(unit * np.sqrt(_density(q) * (q > 0))))[:n, :n]
    return surface_from_heights(factor * (heights + noise * rng.normal(size=(n, n))), length)


def _line_density(q):
    """∫ dk_y C(√(q² + k_y²)) in closed form."""
    full = np.sqrt(np.pi) * gamma(HURST + 0.5) / gamma(HURST + 1)
    return PLATEAU * ROLL * full * (1 + (q / ROLL) ** 2) ** -(0.5 + HURST)


def _line(length, n, seed):
    """A quarter of a periodic line of four times the length."""
    rng, num = np.random.default_rng(seed), 4 * n
    q = 2 * np.pi * np.fft.rfftfreq(num, 4 * length / num)
    wave = (rng.normal(size=len(q)) + 1j * rng.normal(size=len(q))) / np.sqrt(2)
    variance = _line_density(q) * (q > 0) * 2 * np.pi / (4 * length)
    return surface_from_heights(num * np.fft.irfft(wave * np.sqrt(variance), num)[:n], [length])


def _scans(**optical):
    return [
        scan_spectrum(_line(20e-3, 4000, 1), "stylus", shortest=40e-6),
        scan_spectrum(_area(2e-3, 256, 2, **optical), "optical", shortest=80e-6),
        scan_spectrum(_area(2e-4, 256, 3), "AFM", longest=1e-4),
    ]


@pytest.fixture(scope="module")
def joined():
    # The optical scan has noise of half its own finest waves, from which `shortest` keeps away.
    return joined_spectrum(_scans(noise=2e-8))


def test_scans_of_three_magnifications_return_the_spectrum_they_were_drawn_from(joined):
    q, found = np.asarray(joined.spectrum.q), np.asarray(joined.spectrum.values)
    assert q[-1] / q[0] > 2e3
    ratio = found / _density(q)
    well = q > 3 * ROLL  # a line tells little about waves longer than the roll-off
    assert np.all(np.abs(np.log(ratio[well])) < np.log(1.6))
    assert abs(np.mean(np.log(ratio[well]))) < 0.1
    assert np.all(np.abs(np.log(ratio)) < np.log(5))
    np.testing.assert_allclose(joined.mismatch, 1, atol=0.2)
    assert joined.spectrum.warnings == ()
    assert "Spectrum of stylus: wavelengths of 10 mm to" in str(joined)


def test_rms_slope_of_joined_scans_is_the_integral_over_their_range(joined):
    q = np.geomspace(float(joined.spectrum.q_low), float(joined.spectrum.q_high), 4001)
    slope = np.sqrt(np.trapezoid(2 * np.pi * q**4 * _density(q), np.log(q)))
    np.testing.assert_allclose(float(joined.spectrum.rms_slope), slope, rtol=0.05)


def test_a_single_area_has_its_own_spectrum():
    surface = _area(2e-4, 256, 3)
    spectrum = joined_spectrum([scan_spectrum(surface, "AFM")]).spectrum
    q, own = map(np.asarray, radial_spectrum(surface, 21))
    inside = (q >= float(spectrum.q_low)) & (q <= float(spectrum.q_high))
    np.testing.assert_allclose(spectrum.density(jnp.asarray(q[inside])), own[inside], rtol=1e-9)


def test_a_line_of_a_power_law_has_the_spectrum_of_the_surface():
    # The inversion alone, without the scatter of a line.
    q = np.geomspace(0.3 * ROLL, 300 * ROLL, 31)
    found = isotropic(q, _line_density(q)) / _density(q)
    np.testing.assert_allclose(found[q > ROLL], 1, rtol=0.1)
    np.testing.assert_allclose(found[q > 3 * ROLL], 1, rtol=0.02)
    np.testing.assert_allclose(found, 1, rtol=0.6)


def test_surface_of_a_table_has_its_roughness_and_its_spectrum():
    q = np.geomspace(2 * np.pi / 1e-3, np.pi * 127 / 1e-3, 30)
    table = SpectrumTable(q, _density(q), ("Of a test.",), ("It is doubtful.",))
    rough = random_surface(table, gc.Grid((128, 128), 1e-3), jax.random.key(1))
    assert (rough.history, rough.warnings) == (table.history, table.warnings)
    np.testing.assert_allclose(statistics(rough).rms_slope, table.rms_slope, rtol=0.02)
    found, values = map(np.asarray, radial_spectrum(rough, 24))
    known = (values > 0) & (found < q[-1] / 1.2)
    np.testing.assert_allclose(values[known], _density(found[known]), rtol=0.06)


def test_moments_of_a_table_are_integrals_of_its_powers():
    table = SpectrumTable([1.0, 10.0, 100.0], [1.0, 1e-2, 1e-5])  # q^-2, then q^-3 / 10
    q2 = 2 * np.pi * (np.log(10) + 0.1 * 100 * (1 / 10 - 1 / 100))
    np.testing.assert_allclose(float(table.moment(0)), q2, rtol=1e-12)
    q4 = 2 * np.pi * ((100 - 1) / 2 + 0.1 * 100 * (100 - 10))
    np.testing.assert_allclose(float(table.moment(2)), q4, rtol=1e-12)
    part = table.between(2.0, 50.0)
    np.testing.assert_allclose(part.density(jnp.array([1.9, 5.0, 51.0])), [0, 0.04, 0])
    # 6 digits of an end, as messages print it.
    assert float(SpectrumTable([1.000004, 10.0], [1.0, 1e-2]).between(1.0, 10.0).q_low) == 1.000004


def test_mean_field_sees_c_of_a_table_and_nothing_outside(joined):
    q = jnp.asarray([0.9, 1.0]) * joined.spectrum.q_low
    rough = as_roughness(joined.spectrum)
    expected = [0, np.sqrt(float(joined.spectrum.values[0]))]
    np.testing.assert_allclose(rough.root_density(q), expected, rtol=1e-12)
    np.testing.assert_array_equal(rough.edges, joined.spectrum.q)


@pytest.mark.slow
def test_mean_field_takes_a_table_like_its_pair_and_has_its_slope(joined):
    stack, table = gc.Stack(layers=(), base=gc.HalfSpace(gc.Elastic(1e7, 0.5))), joined.spectrum
    load = {"pressure": 1e5, "velocity": 0.0, "correction": "none"}
    found, pair = (
        mean_field_friction(stack, rough, **load) for rough in (table, (table.q, table.values))
    )
    assert float(found.contact_area) == float(pair.contact_area)
    # Persson 2001: √2 p over E* and the rms slope, E* of an incompressible solid.
    share = erf(np.sqrt(2) * 1e5 / (1e7 / 0.75 * float(table.rms_slope)))
    np.testing.assert_allclose(float(found.contact_area), share, rtol=1e-9)
