import dataclasses

import hypothesis.strategies as st
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from oracles import rough

import graded_contact as gc
from graded_contact.contacts.solve import RTOL

CELL = 0.01  # m
GRID = gc.Grid((16, 16), CELL)
Q0 = 2 * np.pi / CELL
# Its edges lie between the modes of the cell, where the surface depends on them smoothly.
SURFACE = rough(GRID.shape, CELL, last=5)
TREAD = gc.tyre_tread()


def tread(stress=1.0, time=1.0, strength=1.0):
    """The tread with moduli, strengths and times changed by factors."""
    equilibrium, strengths = stress * TREAD.equilibrium, stress * strength * TREAD.strengths
    changed = dict(equilibrium=equilibrium, strengths=strengths, times=time * TREAD.times)
    return dataclasses.replace(TREAD, **changed)


def coated(thickness=100e-6, modulus=6.51e6, base=TREAD):
    layers = (gc.Layer(gc.Elastic(modulus, 0.49), thickness),)
    return gc.Stack(layers=layers, base=gc.HalfSpace(base))


def slide(stack, surface=SURFACE, pressure=4e5, velocity=0.1, **how):
    """With all numbers that tests ask for, in one program."""
    s = gc.slide(stack, surface, pressure=pressure, velocity=velocity, **how)
    s.compute("friction", "energy_imbalance", "contact_area", "contact_area_pixels")
    return s


def test_main_job_gives_friction_and_area_of_a_coated_tread():
    s = slide(coated())
    assert s.result == gc.contacts.RESULTS.successful
    assert 0 < s.friction < 1
    assert 0 < s.contact_area < 1
    np.testing.assert_allclose(np.mean(s.pressure), 4e5, rtol=1e-13)
    np.testing.assert_allclose(s.contact_area_pixels, np.mean(s.pressure > 0))
    # Points count at the rim as a whole: 0.02 with 64² points.
    assert s.contact_area < s.contact_area_pixels < s.contact_area + 0.1
    assert s.energy_imbalance <= 1e-13
    assert s.error <= RTOL and s.num_fft_pairs > 0


def test_block_at_rest_has_the_relaxed_modulus_and_no_friction():
    rest = slide(coated(), velocity=0.0)
    elastic = slide(coated(base=tread(strength=1e-14)), velocity=5.0)
    np.testing.assert_allclose(rest.pressure, elastic.pressure, atol=1e-5 * rest.pressure.max())
    assert abs(rest.friction) <= 1e-13
    assert abs(elastic.friction) <= 1e-13


def test_along_an_oblique_velocity_a_solve_keeps_its_promise():
    """An operator that is not that of its half spectrum left penetrations of 4e-5 at 1e-10."""
    s = slide(coated(), velocity=np.array([0.1, 0.05]), rtol=1e-11)
    rms = np.std(SURFACE.heights)
    assert np.min(s.gap) >= -1e-11 * rms
    assert np.mean(np.abs(s.pressure * s.gap)) <= 1e-11 * 4e5 * rms
    assert s.energy_imbalance <= 1e-13
    shares = gc.sliding.cumulative_friction(s).friction
    np.testing.assert_allclose(shares[-1], s.friction, rtol=1e-12)
    assert np.all(np.diff(shares) >= -1e-12)


@settings(max_examples=6)
@given(
    exponent=st.floats(-4, 4),
    pressure=st.floats(1e4, 3e6),
    thickness=st.floats(0, 1e-3),
    modulus=st.floats(1e6, 1e9),
)
def test_friction_of_passive_stacks_is_never_negative(exponent, pressure, thickness, modulus):
    stack = coated(thickness, modulus)
    s = slide(stack, pressure=pressure, velocity=10.0**exponent, rtol=1e-4)
    assert s.friction >= 0
    assert 0 <= s.contact_area <= 1
    assert s.energy_imbalance <= 1e-12


@settings(max_examples=6)
@given(length=st.floats(-3, 3), stress=st.floats(-3, 3), time=st.floats(-3, 3))
def test_units_scale_out(length, stress, time):
    length, stress, time = 10.0**length, 10.0**stress, 10.0**time

    def run(length, stress, time):
        stack = coated(1e-4 * length, 1e6 * stress, tread(stress, time))
        surface = gc.Surface(SURFACE.heights * length, gc.Grid((16, 16), CELL * length))
        return slide(stack, surface, 1e5 * stress, 0.05 * length / time)

    one, other = run(1.0, 1.0, 1.0), run(length, stress, time)
    np.testing.assert_allclose(other.friction, one.friction, rtol=1e-5)
    np.testing.assert_allclose(other.contact_area, one.contact_area, rtol=1e-4)
    np.testing.assert_allclose(other.mean_gap, one.mean_gap * length, rtol=1e-5)


def test_one_dimensional_surface_slides_as_a_ridged_plane_does():
    line = jnp.broadcast_to(SURFACE.heights[:, :1], (16, 16))
    profile, ridges = gc.Surface(line[:, 0], gc.Grid((16,), CELL)), gc.Surface(line, GRID)
    one, two = (
        gc.slide(coated(), s, pressure=4e5, velocity=0.1, rtol=1e-8) for s in (profile, ridges)
    )
    np.testing.assert_allclose(two.friction, one.friction, rtol=1e-6)
    np.testing.assert_allclose(two.pressure[:, 0], one.pressure, atol=1e-5 * one.pressure.max())


def test_the_mean_gap_of_full_contact_is_accepted():
    """It is 0 at every pressure that closes the contact; the least of them is found."""
    n, cell = 32, 1e-3
    heights = 1e-5 * (
        np.cos(2 * np.pi * np.arange(n) / n) + 0.3 * np.sin(6 * np.pi * np.arange(n) / n)
    )
    surface = gc.Surface(heights, gc.Grid((n,), cell))

    def block(modulus=1e6):
        return gc.Stack(base=gc.HalfSpace(gc.Prony(modulus, [9e6], [1e-3], 0.4)))

    full = gc.slide(block(), surface, pressure=2e6, velocity=1.0)
    assert 0 <= full.mean_gap < 1e-9 * np.std(heights) and full.contact_area == 1
    kernel = np.asarray(gc.stack_kernel(block(), surface.grid, 1.0)).copy()
    kernel[0] = np.inf
    least = -np.min(np.fft.irfft(np.fft.rfft(heights) / kernel, n))

    def pressure(modulus, gap=0.0):
        return gc.slide(block(modulus), surface, mean_gap=gap, velocity=1.0).contact.mean_pressure

    for gap in (full.mean_gap, -7e-24, 1e-19):
        np.testing.assert_allclose(pressure(1e6, gap), least, rtol=1e-6)
