"""Contacts that attract, against energies and contacts of dense matrices and published numbers."""

import jax
import numpy as np
from oracles import AdhesiveLine, dense_contact

import graded_contact as gc

N = 64
X, FINE = np.arange(N) / N, np.arange(128) / 128
LINE, FINE_LINE = (
    0.01 * np.cos(2 * np.pi * x) + 0.002 * np.cos(10 * np.pi * x + 1) for x in (X, FINE)
)
RANGE = 1e-3
STIFFEST = np.pi * N / 2  # of a wave on the line [1/m], for a reduced modulus of 1


def elastic_line(n, modulus=1.0, cell=1.0):
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(0.75 * modulus, 0.5)))
    return gc.stack_kernel(stack, gc.Grid((n,), cell)).real


def attraction(steepness):
    """A Lennard-Jones law whose rise is `steepness` of the stiffness of the shortest wave."""
    one = gc.AdhesiveLJ(RANGE, 1.0)
    return gc.AdhesiveLJ(RANGE, steepness * STIFFEST / float(one.steepest_rise))


KERNEL = elastic_line(N)
GAPS = np.concatenate([np.linspace(0.016, 0.003, 26), np.linspace(0.0035, 0.024, 42)])


@jax.jit
def at_gap(law, gap, start):
    how = dict(mean_gap=gap, start=start, law=law, rtol=1e-8, throw=False)
    return gc.solve_contact(KERNEL, LINE, **how)


def at_load(law, load, kernel, heights):
    how = dict(law=law, rtol=1e-8, throw=False)
    how["solver"] = gc.contacts.DouglasRachford(max_steps=4000)
    return gc.solve_contact(kernel, heights, load, **how)


def touches(law, contact):
    return np.asarray(law.contact_indicator(contact.pressure, contact.gap, 1.0)) > 0


def test_a_path_follows_the_branches_of_a_dense_energy():
    """All but a few states next to a jump, where the two may fall to different sides."""
    law = attraction(0.29)
    line = AdhesiveLine(LINE, RANGE, float(law.work))
    pressure, state, found, states = np.zeros(N), GAPS[0] - line.heights, [], []
    for mean_gap in GAPS:
        found.append(jax.device_get(at_gap(law, mean_gap, pressure)))
        pressure = found[-1].pressure
        state = line.settle(mean_gap, state - state.mean() + mean_gap)
        states.append(state)
    means = np.array([np.mean(contact.pressure) for contact in found])
    expected = np.array([line.pressure(gap).mean() for gap in states])
    same = np.abs(means - expected) <= 1e-6 * np.max(np.abs(expected))
    assert np.mean(same) >= 0.95
    # Drawn apart, the surfaces hold on where they had not yet snapped together.
    assert np.trapezoid(means, GAPS) < 0
    touching = np.array([np.mean(gap < RANGE) for gap in states])
    areas = np.array([np.mean(touches(law, contact)) for contact in found])
    np.testing.assert_allclose(areas[same], touching[same])
    steep = at_gap(attraction(1.0), np.asarray(0.01), pressure)
    assert steep.result == gc.contacts.RESULTS.unresolved and steep.error <= 1e-8


def test_exponential_attraction_over_a_long_range_only_adds_to_the_load():
    """The limit of Derjaguin, Muller & Toporov: a uniform tension w/λ presses like a load."""
    kernel, work, length = elastic_line(128), 1e-3, 10.0
    law = gc.contacts.ExponentialAdhesion(length, work)
    for load, share in ((0.005, 0), (-0.5 * work / length, 5e-3)):
        hard = dense_contact(np.asarray(kernel), FINE_LINE, load + work / length)
        s = at_load(law, load, kernel, FINE_LINE)
        np.testing.assert_array_equal(touches(law, s), hard > 0)
        # The gap varies by a thousandth of the range: 2e-3 of a load of w/2λ.
        expected, atol = hard - work / length, 1e-2 * work / length
        np.testing.assert_allclose(s.pressure, expected, rtol=share, atol=atol)


def test_contact_mechanics_challenge_is_solved_where_its_range_is_resolved():
    """V11: E* = 25 MPa, w = 0.05 J/m², λ = 2.071 nm, on its shortest wave of 0.1 μm, slope 1."""
    cell, modulus = 1e-7, 25e6
    law = gc.contacts.ExponentialAdhesion(2.071e-9, 0.05)
    amplitude = np.sqrt(2) * cell / (2 * np.pi)
    wave = amplitude * np.cos(2 * np.pi * FINE)
    s = at_load(law, 250e3, elastic_line(128, modulus, cell), wave)
    assert s.result == gc.contacts.RESULTS.successful
    np.testing.assert_allclose(np.mean(s.pressure), 250e3, rtol=1e-12)
    touching, gap = touches(law, s), np.asarray(s.gap)
    assert 0 < np.mean(touching) < 1
    assert np.max(np.abs(gap[touching])) <= 1e-6 * amplitude
    pull = -0.05 / 2.071e-9 * np.exp(-gap / 2.071e-9)
    atol = 1e-6 * np.max(np.abs(pull))
    np.testing.assert_allclose(np.asarray(s.pressure)[~touching], pull[~touching], atol=atol)
    # Far coarser, as on any grid of the whole surface, the range is not resolved, and it says so.
    coarse = at_load(law, 250e3, elastic_line(128, modulus, 1e-4), 1e3 * wave)
    assert coarse.result != gc.contacts.RESULTS.successful
