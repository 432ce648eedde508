"""Master curves: shifts and moduli of known materials are recovered within their own limits."""

import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import maxwell
from scene_texts import BARE
from scipy.optimize import least_squares

from graded_contact import master_curve
from graded_contact.fitting.cards import toml_table
from graded_contact.materials.shift import WLF, Arrhenius, TabulatedShift
from graded_contact.scenes import parse_scene

# Loops of a fit call small functions a hundred thousand times. Other tests of fits check them all.
pytestmark = pytest.mark.usefixtures("unchecked_types")
DATA = Path(__file__).parents[3] / "shared" / "data" / "rheology"
STRENGTHS = np.array([2e6, 9e6, 4e7, 1.5e8])  # [Pa]
TIMES = np.array([30.0, 0.3, 4e-3, 3e-5])  # [s] at the reference
START = 3e6  # E_eq [Pa], and E_inf of the creep form
OMEGA = np.geomspace(0.1, 100, 12)
TEMPERATURES = np.array([268.0, 278, 288, 298, 308, 323])
C1, C2, REFERENCE = 6.0, 110.0, 298.0


def wlf(temperature):
    """log10 a_T."""
    return -C1 * (temperature - REFERENCE) / (C2 + temperature - REFERENCE)


def arrhenius(temperature):
    return 90e3 / 8.314462618 / np.log(10) * (1 / temperature - 1 / REFERENCE)


def modulus(omega, log10_shift=0.0, equilibrium=START, strengths=STRENGTHS, times=TIMES):
    return maxwell(omega * 10**log10_shift, equilibrium, strengths, times)


def isotherms(law=wlf, noise=0.01, seed=0, vertical=0.0):
    """`(T, omega, modulus)` of each temperature; ln b is `vertical` per 10 K."""
    draw, curves = np.random.default_rng(seed), []
    for temperature in TEMPERATURES:
        exact = modulus(OMEGA, law(temperature))
        exact *= np.exp(vertical * (temperature - REFERENCE) / 10)
        lines = np.exp(noise * draw.standard_normal((2, 12)))
        curves.append((temperature, OMEGA, exact.real * lines[0] + 1j * exact.imag * lines[1]))
    return curves


at = jax.jit(lambda material, temperature: material.at(temperature))
modulus_of = jax.jit(lambda material, omega: material.complex_modulus(omega))
creep_of = jax.jit(lambda material: material.creep())


def channels(values):
    return np.concatenate([np.real(values), np.imag(values)])


def spread(material, log10_shift=0.0, omega=OMEGA):
    """Greatest log distance of storage and loss moduli from the exact ones."""
    fitted, exact = np.asarray(modulus_of(material, omega)), modulus(omega, log10_shift)
    return np.max(np.abs(np.log(channels(fitted) / channels(exact))))


@pytest.fixture(scope="module")
def curve():
    return master_curve(isotherms())


# Recovery ---------------------------------------------------------------------------------------


def test_shifts_that_follow_a_law_recover_it():
    found = master_curve(isotherms(), shift_std=0)
    assert isinstance(found.shift, WLF) and found.fit.terms == 4
    np.testing.assert_allclose([found.shift.c1, found.shift.c2], [C1, C2], rtol=0.05)
    along, across = found.shift_deviations()
    error = np.asarray(found.log10_shifts) - wlf(TEMPERATURES)
    assert np.all(np.abs(error) < 0.02) and np.all(np.abs(error) <= 4 * along)
    assert np.all(across == 0) and np.all(np.asarray(found.vertical_shifts) == 1)
    assert abs(found.fit.errors()["total"] - 0.01) < 0.002
    for temperature in (*TEMPERATURES, 293.0):  # also where nothing was measured, by the law
        assert spread(at(found.material, temperature), wlf(temperature)) < 0.05


def bent(temperature):
    """Shifts that follow no law: a step of 0.6 decades above 278 K."""
    return wlf(temperature) + 0.6 * (temperature <= 278)


@pytest.fixture(scope="module")
def bent_curve():
    return master_curve(isotherms(bent, vertical=0.05), vertical_shift_std=0.2, terms=4)


def test_departures_from_the_law_are_followed_and_interpolated(bent_curve):
    np.testing.assert_allclose(bent_curve.log10_shifts, bent(TEMPERATURES), atol=0.04)
    shift = bent_curve.shift
    factors = [float(jnp.log10(shift.factor(t))) for t in TEMPERATURES]
    np.testing.assert_allclose(factors, bent_curve.log10_shifts, atol=1e-12)
    lifts = [float(jnp.exp(shift.log_vertical(t))) for t in TEMPERATURES]
    np.testing.assert_allclose(lifts, bent_curve.vertical_shifts, rtol=1e-12)
    there_and_back = bent_curve.material.at(278.0).at(REFERENCE)
    np.testing.assert_allclose(there_and_back.times, bent_curve.material.times, rtol=1e-12)


# Starts of the search ---------------------------------------------------------------------------

PSI = 6894.757293168  # [Pa]
SOLID = (2e6, np.array([8e6, 5e6, 3e6, 2e6, 1.2e6, 8e5, 5e5]), 10.0 ** np.arange(-4, 3))
FAHRENHEIT = (np.array([-4.0, 14, 32, 50, 68, 86]) + 459.67) / 1.8


def solid_wlf(temperature):
    return -8.86 * (temperature - 293.15) / (101.6 + temperature - 293.15)


def of_solid(temperatures, decades=3.0, points=10, noise=0.0, digits=8):
    """Isotherms of a Prony series that follows WLF, rounded as in a file."""
    draw, omega = np.random.default_rng(0), 0.2 * np.pi * np.geomspace(1, 10**decades, points)
    curves = []
    for temperature in temperatures:
        equilibrium, strengths, times = SOLID
        exact = modulus(omega, solid_wlf(temperature), equilibrium, strengths, times) / PSI
        lines = channels(exact) * np.exp(noise * draw.standard_normal(2 * points))
        lines = PSI * np.array([float(f"{value:.{digits}g}") for value in lines])
        curves.append((temperature, omega, lines[:points] + 1j * lines[points:]))
    return curves


def far_off(curve, law=solid_wlf):
    """The errors of log10 a_T over their standard deviations."""
    kelvin, others = np.asarray(curve.temperatures), np.asarray(curve.log10_shifts) != 0
    reference = kelvin[curve.isotherms.reference]
    error = np.asarray(curve.log10_shifts) - (law(kelvin) - law(reference))
    return np.abs(error[others]) / np.asarray(curve.shift_deviations()[0])[others]


def test_exact_glassy_isotherms_end_in_no_false_minimum():
    """Where neighbours overlap less, branches of their own explain the coldest curve nearly."""
    found = master_curve(of_solid(FAHRENHEIT))
    np.testing.assert_allclose(found.log10_shifts[0], 4.78599, atol=2e-4)
    assert np.all(far_off(found) < 2)
    assert found.fit.errors()["total"] < 1e-4


def test_shifts_of_many_isotherms_lie_within_their_errors_about_any_reference():
    temperatures = np.delete(np.arange(253.0, 314.0, 6), 4)
    curves = of_solid(temperatures, 2.0, 12, 0.03)
    found = master_curve(curves[::-1], reference=255.0)
    assert np.all(far_off(found) < 3.5)


# Handing on -------------------------------------------------------------------------------------


def misfit(material, curves, kind="frequency"):
    """The rms log distance of a material from isotherms."""
    logs = []
    for temperature, x, values in curves:
        there = at(material, temperature)
        if kind == "creep":
            glassy, compliances, times = map(np.asarray, creep_of(there))
            model = 1 / glassy - np.expm1(-np.divide.outer(x, times)) @ compliances
        else:
            model = np.asarray(modulus_of(there, x))
        both = kind == "frequency"
        logs.append(np.log(channels(model) / channels(values) if both else model / values))
    return np.sqrt(np.mean(np.concatenate(logs) ** 2))


def read_back(found):
    """The material that a scene makes of an exported one."""
    text = toml_table(found.exported(), "found")
    scene = BARE.replace('material = "tread"', 'material = "found"')
    return parse_scene(scene + text).bodies.stack.base.material


def test_an_exported_material_is_as_near_to_every_isotherm_as_the_fit(bent_curve, curve):
    for found, curves, kept in (
        (curve, isotherms(), WLF),
        (bent_curve, isotherms(bent, vertical=0.05), TabulatedShift),
    ):
        material = read_back(found)
        assert isinstance(material.shift, kept)
        error = found.fit.errors()["total"]
        np.testing.assert_allclose(misfit(found.material, curves), error, rtol=1e-9)
        assert misfit(material, curves) <= 1.1 * error
    by_law = dataclasses.replace(bent_curve.material, shift=bent_curve.law)
    assert misfit(by_law, curves) > 3 * error
    np.testing.assert_allclose(bent_curve.law_error(), misfit(by_law, curves), rtol=1e-9)


def test_compliances_in_time_are_shifted_and_handed_on_with_their_vertical_shifts():
    """Each isotherm is its b_T higher, moduli the reciprocal."""
    time, curves, temperatures = np.geomspace(0.01, 10, 8), [], TEMPERATURES[1:5]
    for temperature in temperatures:
        ages = np.divide.outer(time / 10 ** wlf(temperature), TIMES)
        values = 1 / 2e8 - np.expm1(-ages) @ (0.1 / STRENGTHS[::-1])
        curves.append((temperature, time, values * (temperature / REFERENCE)))
    found = master_curve(curves, kind="creep", vertical_shift_std=0.3, terms=4)
    error = found.fit.errors()["total"]
    assert error < 1e-4 and np.max(abs(np.asarray(found.vertical_shifts) - 1)) > 0.03
    misfit_of = misfit(found.material, curves, "creep")
    np.testing.assert_allclose(misfit_of, error, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(found.log10_shifts, wlf(temperatures), atol=1e-3)


def test_an_arrhenius_law_is_recovered():
    curve = master_curve(isotherms(arrhenius), law="arrhenius", shift_std=0, terms=4)
    assert isinstance(curve.shift, Arrhenius)
    np.testing.assert_allclose(curve.shift.activation_energy, 90e3, rtol=0.01)
    np.testing.assert_allclose(curve.log10_shifts, arrhenius(TEMPERATURES), atol=0.02)


def test_vertical_shifts_are_recovered_within_their_limits():
    curve = master_curve(isotherms(vertical=0.05), vertical_shift_std=0.2, terms=4)
    exact = 0.05 * (TEMPERATURES - REFERENCE) / 10
    along, across = curve.shift_deviations()
    error = np.log(np.asarray(curve.vertical_shifts)) - exact
    assert error[3] == across[3] == 0
    assert np.all(np.abs(error) < 0.06) and np.all(np.abs(error) <= 4 * across)
    shift_error = np.asarray(curve.log10_shifts) - wlf(TEMPERATURES)
    assert np.all(np.abs(shift_error) <= 4 * along)


# Optimum and uncertainty ------------------------------------------------------------------------


def test_no_other_least_squares_gets_lower():
    """SciPy on all unknowns at once, shifts included, from the fit and from around the truth."""
    curves = isotherms(noise=0.02)
    found = master_curve(curves, shift_std=0, terms=4)

    def residual(unknowns):
        strengths, times, (start, c1, c2) = np.split(np.exp(unknowns), [4, 8])
        return np.concatenate(
            [
                np.log(channels(modulus(OMEGA, log10_shift, start, strengths, times)))
                - np.log(channels(values))
                for temperature, _, values in curves
                for log10_shift in [-c1 * (temperature - 298) / (c2 + temperature - 298)]
            ]
        )

    material, shift = found.material, found.shift
    start = np.log(
        np.concatenate(
            [material.strengths, material.times, [material.equilibrium, shift.c1, shift.c2]]
        )
    )
    lowest = np.sum(residual(start) ** 2)
    np.testing.assert_allclose(np.sqrt(lowest / 144), found.fit.errors()["total"], rtol=1e-9)
    exact = np.log(np.concatenate([STRENGTHS, TIMES, [START, C1, C2]]))
    for begin in (start, exact, exact + 0.3 * np.random.default_rng(0).standard_normal(11)):
        other = least_squares(residual, begin, xtol=1e-12, ftol=1e-12, gtol=1e-12)
        assert lowest <= 2 * other.cost * (1 + 1e-9)
