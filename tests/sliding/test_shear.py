"""Shear in the real contact adds to the hysteresis, in the contact and in the mean field."""

import jax
import jax.numpy as jnp
import numpy as np
from oracles import rough

import graded_contact as gc
from graded_contact.sliding import ConstantShear, PeakedShear

CELL = 0.01  # m
Q0 = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=1.2 * Q0, q_roll=2.3 * Q0, q_high=5.3 * Q0)
SURFACE = rough((16, 16), CELL, last=5)
BLOCK = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6, 2e7], [1e-2, 1e-4], 0.5)))
PEAK = PeakedShear(5e6, 6e-3, 0.1, gc.Arrhenius(9e4, 293.0))


def rubbed(shear, velocity=0.1, temperature=None, stack=BLOCK, **how):
    how = {"pressure": 4e5, "rtol": 1e-10} | how
    return gc.slide(stack, SURFACE, velocity=velocity, shear=shear, temperature=temperature, **how)


def test_constant_shear_adds_stress_times_area_over_load():
    alone = gc.slide(BLOCK, SURFACE, pressure=4e5, velocity=0.1, rtol=1e-10)
    s = rubbed(ConstantShear(3e5))
    names = "friction", "pressure_friction", "shear_friction"
    s.compute(*names, "contact_area")
    alone.compute(*names)
    np.testing.assert_array_equal(s.pressure, alone.pressure)
    np.testing.assert_allclose(s.pressure_friction, alone.friction, rtol=1e-14)
    np.testing.assert_allclose(s.shear_friction, 3e5 * s.contact_area / 4e5, rtol=1e-14)
    np.testing.assert_allclose(s.friction, s.pressure_friction + s.shear_friction, rtol=1e-14)
    np.testing.assert_allclose(alone.pressure_friction, alone.friction, rtol=1e-14)
    assert alone.shear_friction == 0


def test_along_an_oblique_velocity_the_speed_counts():
    def law(pressure, speed, temperature):
        return 1e6 * speed

    s = rubbed(law, velocity=[0.06, -0.08])
    np.testing.assert_allclose(s.shear_friction, 1e5 * s.contact_area / 4e5, rtol=1e-14)
    back = rubbed(law, velocity=-0.1)
    assert back.shear_friction > 0


def test_shear_proportional_to_pressure_is_coulomb_friction():
    s = rubbed(lambda pressure, speed, temperature: 0.3 * pressure)
    np.testing.assert_allclose(s.shear_friction, 0.3, rtol=1e-13)


def test_peak_has_its_width_and_moves_with_temperature():
    none = jnp.zeros(())
    law = PeakedShear(5e6, 6e-3, 0.1)
    for decades in (-3.0, -1.0, 0.0, 2.0):
        stress = law(none, jnp.asarray(6e-3 * 10.0**decades), None)
        np.testing.assert_allclose(stress, 5e6 * np.exp(-0.1 * decades**2), rtol=1e-13)
    assert law(none, none, None) == 0
    # Ten degrees warmer the peak is at v*/a_T.
    log_factor = 9e4 / 8.31446261815324 * (1 / 303 - 1 / 293)
    top = PEAK(none, jnp.asarray(6e-3 * np.exp(-log_factor)), jnp.asarray(303.0))
    np.testing.assert_allclose(top, 5e6, rtol=1e-12)
    assert jax.grad(lambda v: law(none, v, None))(0.0) == 0


def field(shear, temperature=None, **how):
    how = {"pressure": 4e5, "velocity": 0.1} | how
    return gc.mean_field_friction(BLOCK, SPECTRUM, shear=shear, temperature=temperature, **how)


def test_mean_field_has_the_shear_of_its_area_and_of_its_pressures():
    alone, constant = field(None), field(ConstantShear(3e5))
    np.testing.assert_allclose(constant.pressure_friction, alone.friction, rtol=1e-13)
    expected = 3e5 * alone.contact_area / 4e5
    np.testing.assert_allclose(constant.shear_friction, expected, rtol=1e-13)
    np.testing.assert_allclose(constant.against_cutoff.friction[-1], constant.friction, rtol=1e-13)
    assert alone.shear_friction == 0
    # A law of the pressure against the density of the pressure by another quadrature.
    root = field(lambda p, v, t: 1e3 * jnp.sqrt(p))
    sigma = np.geomspace(1e-1, 1e8, 4001)
    density = gc.mean_field.pressure_distribution(root, sigma)[-1]
    integral = np.trapezoid(density * 1e3 * sigma**1.5, np.log(sigma))
    np.testing.assert_allclose(root.shear_friction, integral / 4e5, rtol=1e-4)
