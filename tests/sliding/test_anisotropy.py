"""Roughness with a lay, and two rough surfaces, in the mean field and in contact."""

from functools import partial
from itertools import pairwise

import closed_forms
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import gauss_over_angles, maxwell, persson
from scipy.integrate import quad

import graded_contact as gc

CELL = 0.01  # m
Q0 = 2 * np.pi / CELL
BAND = dict(hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=60 * Q0, roll_off="smooth")
RUBBER = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49)
BARE = gc.Stack(base=gc.HalfSpace(RUBBER))
GRID = gc.Grid((64, 64), CELL)

mean_field = jax.jit(
    partial(gc.mean_field_friction, throw=False), static_argnames=("num_angles", "correction")
)


def solve(spectrum, velocity, **given):
    """With as many directions as the longest lay needs, and velocities of two components."""
    velocity = jnp.append(jnp.atleast_1d(velocity), jnp.zeros(1))[:2]
    return mean_field(BARE, spectrum, pressure=3e5, velocity=velocity, num_angles=32, **given)


def lay(anisotropy, angle=0.0, **changes):
    given = BAND | {"rms_slope": 0.2} | changes
    return gc.SelfAffine(anisotropy=anisotropy, angle=angle, **given)


density_along = jax.jit(lambda spectrum, q, angle: spectrum.density(q, 2, angle))
ISOTROPIC = gc.SelfAffine(rms_slope=0.2, **BAND)


# The spectrum


@pytest.mark.parametrize("anisotropy", [2.5, 40.0, 3e3])
def test_moments_and_mean_match_quadrature_of_the_definition(anisotropy):
    """Heights, slopes along and across, and the mean over directions, by SciPy."""
    spectrum = lay(anisotropy, 0.4)
    short = 0.4 + np.pi / 2
    h = float(spectrum.hurst)

    def over_angles(function):
        ends = [0, *(np.pi / 2 * np.geomspace(0.02 / anisotropy, 1, 9))]
        return sum(quad(function, a, b, epsrel=1e-11)[0] for a, b in pairwise(ends))

    def density(q, offset):
        k = q * np.hypot(np.cos(offset), anisotropy * np.sin(offset))
        return (1 + (k / (4 * Q0)) ** 2) ** -(1 + h)

    plateau = float(density_along(spectrum, 2 * Q0, short)) / density(2 * Q0, 0)
    mean = 2 / np.pi * over_angles(lambda a: density(9 * Q0, a)) * plateau
    np.testing.assert_allclose(spectrum.density(jnp.array(9 * Q0)), mean, rtol=1e-8)
    np.testing.assert_allclose(
        density_along(spectrum, 9 * Q0, short + 0.2) / plateau, density(9 * Q0, 0.2)
    )
    y, weights = np.polynomial.legendre.leggauss(40)
    y = np.log(60) / 2 * (1 + y)
    moments = [
        4 * plateau * np.log(60) / 2 * sum(
            w * (Q0 * np.exp(x)) ** (2 + order)
            * over_angles(lambda a, x=x, part=part: density(Q0 * np.exp(x), a) * part(a))
            for x, w in zip(y, weights, strict=True)
        )
        for order, part in (
            (0, np.ones_like), (2, lambda a: np.cos(a) ** 2), (2, lambda a: np.sin(a) ** 2)
        )
    ]  # fmt: skip
    np.testing.assert_allclose(spectrum.rms_height**2, moments[0], rtol=1e-7)
    np.testing.assert_allclose(0.2**2, moments[1] + moments[2], rtol=1e-7)


@pytest.mark.parametrize("angle", [0.0, 0.6, -1.2])
def test_a_drawn_surface_has_the_slopes_and_the_lay_of_its_spectrum(angle):
    spectrum = lay(4.0, angle, q_roll=10 * Q0, q_high=50 * Q0)
    surface = gc.random_surface(spectrum, gc.Grid((128, 128), CELL), jax.random.key(0))
    found = gc.surfaces.statistics(surface)
    np.testing.assert_allclose(found.rms_slope, 0.2, rtol=0.01)
    q, angles = np.meshgrid(np.geomspace(Q0, 50 * Q0, 400), np.pi * np.arange(400) / 400)
    rates = q**4 * np.asarray(density_along(spectrum, q, angles))
    along, across = (np.sum(rates * part(angles - angle) ** 2) for part in (np.cos, np.sin))
    np.testing.assert_allclose(found.slope_ratio, np.sqrt(across / along), rtol=0.01)
    np.testing.assert_allclose(found.lay, angle, atol=0.01)
    np.testing.assert_allclose(found.rms_height, spectrum.rms_height, rtol=0.03)


def test_lay_of_crossed_waves_is_the_principal_direction():
    x, y = (CELL * np.arange(64) / 64)[:, None], (CELL * np.arange(64) / 64)[None]
    heights = 1e-5 * np.cos(Q0 * (3 * x + y)) + 1e-5 * np.cos(Q0 * (x - 3 * y)) / 6
    found = gc.surfaces.statistics(gc.Surface(heights, GRID))
    np.testing.assert_allclose(found.slope_ratio, 6, rtol=1e-12)
    np.testing.assert_allclose(found.lay, np.arctan2(-3, 1), rtol=1e-12)
    profile = gc.surfaces.statistics(gc.Surface(heights[:, 0], gc.Grid((64,), CELL)))
    assert profile.lay is None
    assert profile.slope_ratio is None


# Friction in the mean field


complex_modulus = partial(maxwell, equilibrium=1e6, strengths=[4e6, 2e7], times=[1e-2, 1e-4])


def integrated(sums, pressure):
    """`sums(q)` returns ∫dφ q² C |E/(1-ν²)|² q²/4 and ∫dφ q³ C cos φ Im E/(1-ν²)/2."""
    return persson(lambda q: np.divide(sums(q), [pressure**2, pressure]), (Q0, 60 * Q0))


def test_one_is_the_isotropic_friction_and_turning_all_changes_nothing():
    known = solve(ISOTROPIC, velocity=0.05)
    for velocity in ([0.05, 0.0], [0.03, -0.04]):
        found = solve(lay(1.0, 0.7), velocity=jnp.array(velocity))
        np.testing.assert_allclose(found.friction, known.friction, rtol=1e-7)
        np.testing.assert_allclose(found.contact_area, known.contact_area, rtol=1e-7)
    unit = lambda angle: 0.05 * jnp.array([np.cos(angle), np.sin(angle)])  # noqa: E731
    first = solve(lay(5.0, 0.3), velocity=unit(1.0))
    for turn in (0.9, 3.0, -2.0):
        turned = solve(lay(5.0, 0.3 + turn), velocity=unit(1.0 + turn))
        np.testing.assert_allclose(turned.friction, first.friction, rtol=1e-12)
    mirrored = solve(lay(5.0, -0.3), velocity=unit(-1.0))
    np.testing.assert_allclose(mirrored.friction, first.friction, rtol=1e-12)


def test_oblique_friction_matches_integration_over_all_directions():
    spectrum, direction = lay(4.0, 0.5), 1.3
    # Gauss's rule between angles that approach the special directions geometrically.
    special = np.sort(np.mod([direction + np.pi / 2, 0.5 + np.pi / 2], np.pi))
    special, near = np.append(special, special[0] + np.pi), 0.5 ** np.arange(26)
    ends = np.concatenate([
        np.append(a + (b - a) / 2 * near[::-1], b - (b - a) / 2 * near[1:])
        for a, b in pairwise(special)
    ])  # fmt: skip
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(ends)[:, None] / 2
    angle, weight = (ends[:-1, None] + half * (1 + nodes)).ravel(), (2 * half * weights).ravel()
    cosine = np.cos(angle - direction)
    plateau = float(density_along(spectrum, Q0, 0.5 + np.pi / 2)) * (1 + 1 / 16) ** 1.8
    stretch = np.hypot(np.cos(angle - 0.5 - np.pi / 2), 4 * np.sin(angle - 0.5 - np.pi / 2))

    def sums(q):
        density = plateau * (1 + (q * stretch / (4 * Q0)) ** 2) ** -1.8
        modulus = complex_modulus(q * 0.05 * cosine) / (1 - 0.49**2)
        return (
            np.sum(weight * density * abs(modulus) ** 2) * q**4 / 4,
            np.sum(weight * density * cosine * modulus.imag) * q**3 / 2 * q,
        )

    area, friction = integrated(sums, 3e5)
    found = solve(spectrum, velocity=0.05 * jnp.array([np.cos(direction), np.sin(direction)]))
    np.testing.assert_allclose(found.contact_area, area, rtol=1e-6)
    np.testing.assert_allclose(found.friction, friction, rtol=1e-6)
    assert found.error < 1e-5


def test_an_endless_lay_has_no_friction_along_it_and_that_of_a_profile_across():
    profile = jax.jit(lambda q: ISOTROPIC.density(q, 1))

    def sums(q):
        density = float(profile(q))
        modulus = complex_modulus(q * 0.05) / (1 - 0.49**2)
        return 2 * density * q**3 * abs(modulus) ** 2 / 4, density * q**3 * modulus.imag

    area, friction = integrated(sums, 3e5)
    long = lay(1e3, np.pi / 2)
    across = solve(long, velocity=0.05)
    along = solve(long, velocity=jnp.array([0.0, 0.05]))
    np.testing.assert_allclose(across.friction, friction, rtol=5e-4)
    np.testing.assert_allclose(across.contact_area, area, rtol=5e-4)
    assert 0 < along.friction < 2e-4 * friction
    rest = solve(long, velocity=0.0)
    np.testing.assert_allclose(along.contact_area, rest.contact_area, rtol=5e-4)


# Roughness of the block itself


OWN = gc.SelfAffine(rms_slope=0.1, hurst=0.6, q_low=5 * Q0, q_roll=9 * Q0, q_high=300 * Q0)


def test_area_of_an_elastic_block_is_that_of_the_sum_of_the_spectra():
    """Of bands that are apart, one of them a table."""
    q = jnp.geomspace(300 * Q0, 900 * Q0, 9)
    own = gc.surfaces.SpectrumTable(q, OWN.density(q / 30))
    elastic = gc.Stack(base=gc.HalfSpace(gc.Elastic(1e7, 0.5)))
    found = mean_field(
        elastic, ISOTROPIC, pressure=3e5, velocity=0.1, own_roughness=own, correction="none"
    )
    y = np.linspace(np.log(own.q[0]), np.log(own.q[-1]), 4001)
    density = np.exp(np.interp(y, np.log(own.q), np.log(own.values)))
    square = np.trapezoid(2 * np.pi * np.exp(4 * y) * density, y)
    expected = closed_forms.persson_contact_area(3e5, 1e7 / 0.75, np.sqrt(0.2**2 + square))
    np.testing.assert_allclose(found.contact_area, expected, rtol=2e-5)
    assert found.friction == 0
    assert found.error < 1e-4


def test_own_roughness_stays_at_rest_in_the_rubber():
    """Against the differential equations: its waves see the relaxed modulus and lose nothing."""
    own = gc.SelfAffine(rms_slope=0.3, hurst=0.5, q_low=Q0, q_roll=Q0, q_high=60 * Q0)
    densities = jax.jit(lambda q: (ISOTROPIC.density(q), own.density(q)))
    cosine, weight = gauss_over_angles()

    def sums(q):
        track, block = map(float, densities(q))
        modulus = complex_modulus(q * 0.05 * cosine) / (1 - 0.49**2)
        return (
            (track * np.sum(weight * abs(modulus) ** 2)
             + block * 2 * np.pi * (1e6 / (1 - 0.49**2)) ** 2) * q**4 / 4,
            track * np.sum(weight * cosine * modulus.imag) * q**4 / 2,
        )  # fmt: skip

    area, friction = integrated(sums, 3e5)
    found = solve(ISOTROPIC, velocity=0.05, own_roughness=own)
    np.testing.assert_allclose(found.contact_area, area, rtol=1e-6)
    np.testing.assert_allclose(found.friction, friction, rtol=1e-6)
    assert found.friction < 0.97 * solve(ISOTROPIC, velocity=0.05).friction
