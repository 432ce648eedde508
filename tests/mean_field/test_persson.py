from functools import partial

import closed_forms
import hypothesis.strategies as st
import jax
import numpy as np
import pytest
from hypothesis import given, settings
from oracles import gauss_over_angles, maxwell, persson
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import erf

import graded_contact as gc
from graded_contact.mean_field.mean_field import (
    mean_field_friction,
    pressure_distribution,
    reached,
)

CELL = 0.01  # m
Q0 = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=3.3 * Q0, q_high=100 * Q0)
RUBBER = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49)
BARE = gc.Stack(base=gc.HalfSpace(RUBBER))
COATED = gc.Stack(layers=(gc.Layer(gc.Elastic(4e6, 0.4), 1e-4),), base=gc.HalfSpace(RUBBER))
distribution = jax.jit(pressure_distribution)
CORRECTIONS = ("none", "yang_persson")

mean_field = jax.jit(partial(mean_field_friction, throw=False), static_argnames=("correction",))


def elastic(modulus=1e7, poisson=0.5):
    return gc.Stack(base=gc.HalfSpace(gc.Elastic(modulus, poisson)))


def slowing(correction, area):
    return 1 if correction == "none" else 0.45 + 0.55 * area**2


# Contact area of elastic solids


def corrected_area(correction, relative_pressure):
    """The area at p/(E* h') from the correction's own equation, by SciPy."""

    def elapsed(x):
        ends = np.append(0, float(x) * 2.0 ** np.arange(-12, 1))
        rate = lambda t: 1 / slowing(correction, erf(1 / np.sqrt(2 * t)))  # noqa: E731
        return sum(quad(rate, *ends[i : i + 2], epsabs=0, epsrel=1e-12)[0] for i in range(13))

    v = 1 / (4 * relative_pressure**2)
    x = brentq(lambda x: elapsed(x) / v - 1, 0.4 * v, 1.1 * v, xtol=1e-14 * v)
    return erf(1 / np.sqrt(2 * x))


@pytest.mark.parametrize("correction", CORRECTIONS)
@pytest.mark.parametrize("relative_pressure", [1e-3, 0.1, 0.5, 2.5])
def test_elastic_area_follows_the_closed_form_of_each_correction(correction, relative_pressure):
    pressure = relative_pressure * 1e7 / 0.75 * 0.2
    solution = mean_field(
        elastic(), SPECTRUM, pressure=pressure, velocity=1.0, correction=correction
    )
    expected = closed_forms.persson_contact_area(pressure, 1e7 / 0.75, 0.2)
    if correction != "none":
        expected = float(corrected_area(correction, relative_pressure))
    np.testing.assert_allclose(solution.contact_area, expected, rtol=1e-10)
    assert solution.friction == 0


@pytest.mark.parametrize(
    ("relative_pressure", "expected"),
    [
        (0.02, (0.0319, 0.0472)),
        (0.1, (0.1585, 0.2169)),
        (0.3, (0.4515, 0.5185)),
        (1.0, (0.9545, 0.9558)),
    ],
)
def test_elastic_area_matches_the_published_programs(relative_pressure, expected):
    """Values of Y. Xu's Matlab programs, printed to four digits, with 0.45 in Yang-Persson's."""
    for correction, area in zip(CORRECTIONS, expected, strict=True):
        pressure = relative_pressure * 1e7 / 0.75 * 0.2
        solution = mean_field(
            elastic(), SPECTRUM, pressure=pressure, velocity=0.0, correction=correction
        )
        np.testing.assert_allclose(solution.contact_area, area, atol=1.5e-4)


# Friction


def integrated(compliance, pressure, velocity, correction):
    """Area and friction of `SPECTRUM`."""
    low, roll, high = Q0, 3.3 * Q0, 100 * Q0
    plateau = (
        0.2**2 / (2 * np.pi) / ((roll**4 - low**4) / 4 + roll**3.6 * (high**0.4 - roll**0.4) / 0.4)
    )
    cosine, weight = gauss_over_angles()

    def sums(q):
        stiffness = 1 / (compliance(q, q * velocity * cosine) * pressure)
        density = plateau * min(1, (q / roll) ** -3.6)
        spreading = density * q**2 * np.sum(weight * np.abs(stiffness) ** 2)
        return spreading, density * q**3 * np.sum(weight * cosine * stiffness.imag)

    return persson(sums, (low, roll, high), partial(slowing, correction))


rubber_modulus = partial(maxwell, equilibrium=1e6, strengths=[4e6, 2e7], times=[1e-2, 1e-4])


def test_friction_matches_integration_of_the_differential_equations():
    def compliance(q, omega):
        below = (rubber_modulus(omega), 0.49)
        return closed_forms.coated_half_space_compliance(q, 1e-4, 4e6, 0.4, *below)

    area, friction = integrated(compliance, 3e5, 0.05, "yang_persson")
    solution = mean_field(COATED, SPECTRUM, pressure=3e5, velocity=0.05)
    np.testing.assert_allclose(solution.contact_area, area, rtol=1e-7)
    np.testing.assert_allclose(solution.friction, friction, rtol=1e-7)


# Limits and invariances


@settings(max_examples=20)
@given(
    exponent=st.floats(-8, 6),
    pressure=st.floats(2, 9),
    thickness=st.floats(-7, -2),
    modulus=st.floats(4, 10),
)
def test_passive_stacks_lose_energy_and_contact_with_magnification(
    exponent, pressure, thickness, modulus
):
    coat = gc.Layer(gc.Elastic(10.0**modulus, 0.4), 10.0**thickness)
    stack = gc.Stack(layers=(coat,), base=gc.HalfSpace(RUBBER))
    how = {"pressure": 10.0**pressure, "velocity": 10.0**exponent}
    solution = mean_field(stack, SPECTRUM, **how)
    assert solution.friction >= 0
    # Between the ends the running integral is as good as the polynomial through the nodes.
    assert np.all(np.diff(solution.against_cutoff.friction) >= -1e-3 * solution.friction)
    assert np.all(np.diff(solution.against_cutoff.contact_area) <= 1e-12)
    assert solution.contact_area > 0 and solution.against_cutoff.contact_area[0] <= 1


# Distribution of the pressure


def test_pressure_distribution_integrates_to_area_load_and_spread():
    solution = mean_field(COATED, SPECTRUM, pressure=3e5, velocity=0.05)
    for i in (30, -1):
        spread = float(np.sqrt(solution.stress_variance[i]))

        def moment(power, i=i, spread=spread):
            density = lambda s: np.asarray(distribution(solution, np.array([s])))[i, 0]  # noqa: E731
            ends = (0, 3e5 + 10 * spread)
            return quad(lambda s: s**power * density(s), *ends, limit=200, points=[3e5])[0]

        np.testing.assert_allclose(moment(0), solution.against_cutoff.contact_area[i], rtol=1e-8)
        np.testing.assert_allclose(moment(1), 3e5, rtol=1e-8)
    assert np.all(distribution(solution, np.array([1e5, 3e5]))[0] == 0)
    assert np.all(distribution(solution, np.zeros(1)) == 0)


# Spectra


# The quadrature


def test_unreached_tolerance_is_not_passed_as_converged():
    call = dict(pressure=4e5, velocity=1.0)
    rough = coarse(COATED, SPECTRUM, **call)
    fine = mean_field(COATED, SPECTRUM, **call)
    assert rough.error > 1e-4 and len(rough.stress_variance) == 9
    with pytest.raises(RuntimeError, match="num_angles"):
        reached(rough, 1e-4)
    assert abs(rough.friction / fine.friction - 1) <= rough.error


coarse = jax.jit(partial(mean_field_friction, num_wavenumbers=4, num_angles=4, throw=False))
