"""Contacts that attract, against an energy of dense matrices and against closed forms."""

import jax
import numpy as np
from oracles import AdhesiveLine

import graded_contact as gc

N = 64
X = np.arange(N) / N
LINE = 0.01 * np.cos(2 * np.pi * X) + 0.002 * np.cos(10 * np.pi * X + 1)
RANGE = 1e-3
STIFFEST = np.pi * N / 2  # of a wave on the line [1/m], for a reduced modulus of 1


def elastic_line(n=N, modulus=1.0, cell=1.0):
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(0.75 * modulus, 0.5)))
    return gc.stack_kernel(stack, gc.Grid((n,), cell)).real


def attraction(steepness):
    """A Lennard-Jones law whose rise is `steepness` of the stiffness of the shortest wave."""
    one = gc.AdhesiveLJ(RANGE, 1.0)
    return gc.AdhesiveLJ(RANGE, steepness * STIFFEST / float(one.steepest_rise))


def follow(kernel, heights, gaps, law, **how):
    """The contacts along a path of mean gaps, each the start of the next."""

    def advance(pressure, gap):
        start = dict(start=pressure, mean_gap=gap)
        contact = gc.solve_contact(kernel, heights, law=law, **start, **how)
        return contact.pressure, contact

    return jax.lax.scan(advance, np.zeros(len(heights)), gaps)[1]


def area_of(law, path):
    touching = law.contact_indicator(path.pressure, path.gap, 1.0) > 0
    return np.mean(touching, axis=-1)


# One program for all exponential attractions: on a line of 128 points with a complex kernel.
FINE = np.arange(128) / 128
EXPONENTIAL = dict(solver=gc.contacts.DouglasRachford(max_steps=4000), throw=False)
GAPS = np.concatenate([np.linspace(0.016, 0.003, 26), np.linspace(0.0035, 0.024, 42)])


def test_path_follows_the_branches_of_a_dense_energy():
    """All but a few states next to a jump, where the two may fall to different sides."""
    law, kernel = attraction(0.29), elastic_line()
    how = dict(rtol=1e-8, throw=False)
    line = AdhesiveLine(LINE, RANGE, float(law.work))
    pressure, state, found, states = np.zeros(N), GAPS[0] - line.heights, [], []
    for mean_gap in GAPS:
        found.append(
            gc.solve_contact(kernel, LINE, mean_gap=mean_gap, law=law, start=pressure, **how)
        )
        pressure = found[-1].pressure
        state = line.settle(mean_gap, state - state.mean() + mean_gap)
        states.append(state)
    means = np.array([contact.mean_pressure for contact in found])
    expected = np.array([line.pressure(gap).mean() for gap in states])
    same = np.abs(means - expected) <= 1e-6 * np.max(np.abs(expected))
    assert np.mean(same) >= 0.95
    # Drawn apart, the surfaces hold on where they had not yet snapped together.
    assert np.trapezoid(means, GAPS) < 0
    touching = np.array([np.mean(gap < RANGE) for gap in states])
    areas = np.array([area_of(law, contact) for contact in found])
    np.testing.assert_allclose(areas[same], touching[same])
    how |= dict(mean_gap=0.01, law=attraction(1.0), start=pressure)
    steep = gc.solve_contact(kernel, LINE, **how)
    assert steep.result == gc.contacts.RESULTS.unresolved and steep.error <= 1e-8


def test_exponential_attraction_over_a_long_range_only_adds_to_the_load():
    """The limit of Derjaguin, Muller & Toporov: a uniform tension w/λ presses like a load."""
    kernel, work, length = elastic_line(128) + 0j, 1e-3, 10.0
    line = 0.01 * np.cos(2 * np.pi * FINE) + 0.002 * np.cos(10 * np.pi * FINE + 1)
    hard = gc.solve_contact(kernel, line, 0.005 + work / length, rtol=1e-9)
    law = gc.contacts.ExponentialAdhesion(length, work)
    s = gc.solve_contact(kernel, line, 0.005, law=law, rtol=1e-9, **EXPONENTIAL)
    touching = law.contact_indicator(s.pressure, s.gap, 1.0) > 0
    np.testing.assert_array_equal(touching, hard.pressure > 0)
    # The gap varies by a thousandth of the range.
    expected = hard.pressure - work / length
    np.testing.assert_allclose(s.pressure, expected, atol=1e-2 * work / length)


def test_contact_mechanics_challenge_is_solved_where_its_range_is_resolved():
    """V11: E* = 25 MPa, w = 0.05 J/m², λ = 2.071 nm, on its shortest wave of 0.1 μm, slope 1."""
    cell, modulus, n = 1e-7, 25e6, 128
    law = gc.contacts.ExponentialAdhesion(2.071e-9, 0.05)
    kernel = elastic_line(n, modulus, cell) + 0j
    amplitude = np.sqrt(2) * cell / (2 * np.pi)
    wave = amplitude * np.cos(2 * np.pi * FINE)
    how = dict(law=law, **EXPONENTIAL)
    s = gc.solve_contact(kernel, wave, 250e3, **how)
    assert s.result == gc.contacts.RESULTS.successful
    np.testing.assert_allclose(np.mean(s.pressure), 250e3, rtol=1e-12)
    touching = np.asarray(law.contact_indicator(s.pressure, s.gap, 1.0) > 0)
    assert 0 < np.mean(touching) < 1
    assert np.max(np.abs(s.gap[touching])) <= 1e-6 * amplitude
    pull = -0.05 / 2.071e-9 * np.exp(-s.gap / 2.071e-9)
    scale = np.max(np.abs(pull))
    np.testing.assert_allclose(s.pressure[~touching], pull[~touching], atol=1e-6 * scale)
    # Far coarser, as on any grid of the whole surface, the range is not resolved, and it says so.
    coarse = gc.solve_contact(elastic_line(n, modulus, 1e-4) + 0j, 1e3 * wave, 250e3, **how)
    assert coarse.result != gc.contacts.RESULTS.successful


def test_wave_of_short_range_follows_johnson_kendall_roberts():
    """K. L. Johnson, Int. J. Solids Struct. 32 (1995) 423: p = p* sin² - (2 E* w tan(πa)/λ)^½.

    Its contact reaches to the greatest tension: `contact_gap` 1.2.
    """
    n, amplitude = 128, 0.01
    full = np.pi * amplitude
    wave = amplitude * np.cos(2 * np.pi * np.arange(n) / n)
    kernel = elastic_line(n)

    @jax.jit
    def close(law, gaps):
        how = dict(solver=gc.contacts.ResidualDynamics(), rtol=1e-7)
        return follow(kernel, wave, gaps, law, **how)

    for strength in (0.1, 0.3):
        work = (strength * full) ** 2 / 2
        rise = float(gc.AdhesiveLJ(1.0, 1.0).steepest_rise)
        length = np.sqrt(rise * work / (0.3 * np.pi * n / 2))
        gaps = np.linspace(0.6, 0.1, 10) * amplitude + length
        law = gc.AdhesiveLJ(length, work, 1.2)
        path = close(law, gaps)
        half = np.pi * area_of(law, path) / 2
        expected = full * np.sin(half) ** 2 - np.sqrt(2 * work * np.tan(half))
        # An edge is known to a pixel: 1/64 of area is 0.02 of the pressure.
        np.testing.assert_allclose(path.mean_pressure, expected, atol=0.025 * full)
        hertz = full * np.sin(half) ** 2
        assert np.all(hertz - path.mean_pressure > 0.05 * full)


def test_load_above_the_pull_off_is_held():
    """The pull-off is the lowest pressure along a path of gaps that open."""
    rubber = gc.Prony(0.75, [3 * 0.75], [0.05], 0.5)
    kernel = gc.stack_kernel(gc.Stack(base=gc.HalfSpace(rubber)), gc.Grid((128,), 1.0), 1.0)
    wave = 0.01 * np.cos(2 * np.pi * FINE)
    length = 1e-3
    law = gc.contacts.ExponentialAdhesion(length, 0.15 * STIFFEST * length**2)
    how, pull_off, pressure = dict(law=law, **EXPONENTIAL), 0.0, np.zeros(128)
    for gap in np.linspace(0.006, 0.014, 33):
        opened = gc.solve_contact(kernel, wave, mean_gap=gap, start=pressure, **how)
        if opened.result == gc.contacts.RESULTS.successful:
            pull_off = min(pull_off, float(opened.mean_pressure))
        pressure = opened.pressure
    assert pull_off < 0
    for share in (0.5, 0.97):
        held = gc.solve_contact(kernel, wave, share * pull_off, **how)
        assert held.result == gc.contacts.RESULTS.successful
        assert np.any(law.contact_indicator(held.pressure, held.gap, 1.0) > 0)
    lost = gc.solve_contact(kernel, wave, 1.05 * pull_off, **how)
    assert lost.result == gc.contacts.RESULTS.max_steps_reached
