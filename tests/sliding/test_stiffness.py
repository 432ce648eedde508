"""Stiffness and conductance against closed forms of periodic punches."""

import jax
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.sliding import Coulomb

BLOCK = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.3)))
REDUCED = 1 / (1 - 0.3**2)
FULL = np.pi * REDUCED * 0.01  # pressure of full contact of the wave
WAVE = gc.Surface(0.01 * np.cos(2 * np.pi * np.arange(64) / 64), gc.Grid((64,), 1.0))


def pressure_for(fraction):
    """Westergaard's contact of a wave."""
    return FULL * np.sin(np.pi * fraction / 2) ** 2


def stiffness_of(fraction):
    """Of strips of a width, one to a wavelength: -dū/dp = (2λ/πE*) log(1/sin(πa/λ))."""
    return np.pi * REDUCED / 2 / np.log(1 / np.sin(np.pi * fraction / 2))


@jax.jit
def stiffness(pressure, modulus=1.0):
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(modulus, 0.3)))
    given = {"pressure": pressure, "velocity": 0.0, "rtol": 1e-10}
    return gc.slide(block, WAVE, **given).contact_stiffness


@pytest.mark.parametrize("fraction", [0.2, 0.21, 0.22, 0.5, 0.8])
def test_stiffness_of_a_wave_is_that_of_its_strips(fraction):
    """Within 0.07 spacings of the edges, wherever these lie between the points."""
    tolerance = stiffness_of(fraction + 2 * 0.07 / 64) / stiffness_of(fraction) - 1
    np.testing.assert_allclose(
        stiffness(pressure_for(fraction)), stiffness_of(fraction), rtol=tolerance
    )


def test_stiffness_of_a_sphere_in_a_cell():
    """1/k = 1/(2E*a) less the images: a square lattice has Σ1/R -> -3.900265, Σ1/R³ = 9.0336."""
    radius = 0.15

    def slide(n):
        x = (np.arange(n) - n / 2) / n
        surface = gc.Surface(-(x[:, None] ** 2 + x[None] ** 2) / 2, gc.Grid((n, n), 1.0))
        load = 4 / 3 * REDUCED * radius**3
        return gc.slide(BLOCK, surface, pressure=load, velocity=0.0, rtol=1e-7)

    found = slide(64)
    images = (3.900265 - 9.0336 / 3 * radius**2) / np.pi
    expected = REDUCED / (1 / (2 * radius) - images)
    off = abs(found.contact_stiffness / expected - 1)
    assert off <= found.contact_stiffness_error / expected <= 0.1
    assert off <= 0.005
    # The same contact conducts as Barber's analogy says.
    barber = 2 * found.contact_stiffness / REDUCED
    np.testing.assert_allclose(found.specific_conductance, barber, rtol=1e-7)


def rubbed(pressure, shear):
    block = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.0)))
    return gc.slide(block, WAVE, pressure=pressure, velocity=1.0, shear=shear, rtol=1e-9)


def test_stiffness_under_a_traction_is_the_slope_of_loads_over_gaps():
    """The traction changes it by a tenth."""
    pressures = np.array([0.95, 1.0, 1.05]) * pressure_for(0.5)
    low, middle, high = (rubbed(pressure, Coulomb(1.0)) for pressure in pressures)
    slope = -(high.mean_pressure - low.mean_pressure) / (high.mean_gap - low.mean_gap)
    np.testing.assert_allclose(middle.contact_stiffness, slope, rtol=0.015)


def test_full_contact_is_infinitely_stiff():
    assert stiffness(1.5 * FULL) > 1e6 * FULL
