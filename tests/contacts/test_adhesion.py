"""Contacts that attract, against energies of dense matrices; others are in `test_published.py`."""

import jax
import numpy as np
from oracles import AdhesiveLine

import graded_contact as gc

N = 64
X = np.arange(N) / N
LINE = 0.01 * np.cos(2 * np.pi * X) + 0.002 * np.cos(10 * np.pi * X + 1)
RANGE = 1e-3
STIFFEST = np.pi * N / 2  # of a wave on the line [1/m], for a reduced modulus of 1


def attraction(steepness):
    """A Lennard-Jones law whose rise is `steepness` of the stiffness of the shortest wave."""
    one = gc.AdhesiveLJ(RANGE, 1.0)
    return gc.AdhesiveLJ(RANGE, steepness * STIFFEST / float(one.steepest_rise))


BLOCK = gc.Stack(base=gc.HalfSpace(gc.Elastic(0.75, 0.5)))
GAPS = np.concatenate([np.linspace(0.016, 0.003, 26), np.linspace(0.0035, 0.024, 42)])


@jax.jit
def at_gap(law, gap, start):
    kernel = gc.stack_kernel(BLOCK, gc.Grid((N,), 1.0)).real
    how = dict(mean_gap=gap, start=start, law=law, rtol=1e-8, throw=False)
    return gc.solve_contact(kernel, LINE, **how)


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
