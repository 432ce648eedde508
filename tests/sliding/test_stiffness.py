"""Stiffness and conductance against closed forms of periodic punches."""

import numpy as np

import graded_contact as gc
from graded_contact.sliding import Coulomb

REDUCED = 1 / (1 - 0.3**2)
FULL = np.pi * REDUCED * 0.01  # pressure of full contact of the wave
N = 64
WAVE = gc.Surface(0.01 * np.cos(2 * np.pi * np.arange(N) / N), gc.Grid((N,), 1.0))


def elastic(poisson):
    """With a branch without strength: it shares programs with viscoelastic blocks."""
    return gc.Stack(base=gc.HalfSpace(gc.Prony(1.0, [1e-12], [1.0], poisson)))


def pressure_for(fraction):
    """Westergaard's contact of a wave."""
    return FULL * np.sin(np.pi * fraction / 2) ** 2


def stiffness_of(fraction):
    """Of strips of a width, one to a wavelength: -dū/dp = (2λ/πE*) log(1/sin(πa/λ))."""
    return np.pi * REDUCED / 2 / np.log(1 / np.sin(np.pi * fraction / 2))


def on_wave(pressure, coefficient=0.0, poisson=0.3):
    """With both numbers of all: they share a program."""
    how = dict(velocity=1.0, shear=Coulomb(coefficient), rtol=1e-9)
    found = gc.slide(elastic(poisson), WAVE, pressure=pressure, **how)
    found.compute("contact_stiffness", "specific_conductance")
    return found


def test_stiffness_of_a_wave_is_that_of_its_strips_and_infinite_in_full_contact():
    """Within 0.07 spacings of the edges, wherever these lie between the points."""
    for fraction in (0.2, 0.21, 0.22, 0.5, 0.8):
        tolerance = stiffness_of(fraction + 2 * 0.07 / N) / stiffness_of(fraction) - 1
        found = on_wave(pressure_for(fraction))
        stiffness = found.contact_stiffness
        np.testing.assert_allclose(stiffness, stiffness_of(fraction), rtol=tolerance)
        # The same contact conducts as Barber's analogy says.
        np.testing.assert_allclose(found.specific_conductance, 2 * stiffness / REDUCED, rtol=1e-7)
    assert on_wave(1.5 * FULL).contact_stiffness > 1e6 * FULL


def test_stiffness_under_a_traction_is_the_slope_of_loads_over_gaps():
    """The traction changes it by a tenth."""
    pressures = np.array([0.95, 1.0, 1.05]) * pressure_for(0.5)
    low, middle, high = (on_wave(pressure, 1.0, 0.0) for pressure in pressures)
    slope = -(high.mean_pressure - low.mean_pressure) / (high.mean_gap - low.mean_gap)
    np.testing.assert_allclose(middle.contact_stiffness, slope, rtol=0.015)


def test_stiffness_of_a_sphere_in_a_cell():
    """1/k = 1/(2E*a) less the images: a square lattice has Σ1/R -> -3.900265, Σ1/R³ = 9.0336."""
    radius, n = 0.15, 64
    x = (np.arange(n) - n / 2) / n
    surface = gc.Surface(-(x[:, None] ** 2 + x[None] ** 2) / 2, gc.Grid((n, n), 1.0))
    load = 4 / 3 * REDUCED * radius**3
    found = gc.slide(elastic(0.3), surface, pressure=load, velocity=1.0, rtol=1e-7)
    stiffness, error = found.compute("contact_stiffness", "contact_stiffness_error")
    images = (3.900265 - 9.0336 / 3 * radius**2) / np.pi
    expected = REDUCED / (1 / (2 * radius) - images)
    off = abs(stiffness / expected - 1)
    assert off <= error / expected <= 0.1
    assert off <= 0.005
