"""Transient motion between two bodies: exchanged bodies, energy, the periodic state."""

import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts import DouglasRachford
from graded_contact.sliding import Coulomb
from graded_contact.sliding.shear import AbstractShear

NUM, STEPS, LOAD = 16, 16, 0.2  # points and steps of all histories: they share a program
GRID = gc.Grid((NUM,), 1.0)
PLACE = 2 * np.pi * np.arange(NUM) / NUM
ROUGH = gc.Surface(0.02 * np.cos(PLACE) + 4e-3 * np.sin(3 * PLACE), GRID)
OTHER = gc.Surface(0.01 * np.cos(2 * PLACE + 1), GRID)
TIMES = 0.02 * np.arange(1, STEPS + 1)
MOVED = np.array([0, 0, 0, 1, 2, 3, 5, 6, 8, 9, 9, 8, 7, 6, 6, 6]) / NUM  # the points coincide


def elastic(modulus):
    return gc.Stack(base=gc.HalfSpace(gc.Elastic(modulus, 0.3)))


def rubber(strength=3.0, time=0.05, equilibrium=1.0):
    return gc.Stack(base=gc.HalfSpace(gc.Prony(equilibrium, [strength], [time], 0.3)))


def run(stack, counterface, surface=ROUGH, own=OTHER, **changes):
    how = dict(times=TIMES, displacement=MOVED, pressure=LOAD, rtol=1e-8)
    how |= dict(solver=DouglasRachford(newton=False)) | changes
    return gc.slide_transient(stack, surface, counterface=counterface, block_surface=own, **how)


def heights_at(step):
    """Of both bodies together, in the frame of the surface."""
    return ROUGH.heights + np.roll(OTHER.heights, -round(MOVED[step] * NUM))


def test_two_elastic_bodies_are_one_with_the_sum_of_compliances_and_store_the_work():
    """At each time the contact is that of the heights of both on one body at rest."""
    found = run(elastic(2.0), elastic(6.0), fields_at=(5, -1))
    for i, step in enumerate((5, STEPS - 1)):
        both = gc.Surface(heights_at(step), GRID)
        single = gc.slide(elastic(1.5), both, pressure=LOAD, velocity=0.0, rtol=1e-9)
        np.testing.assert_allclose(found.pressure[i], single.pressure, atol=1e-6 * LOAD)
        np.testing.assert_allclose(found.displacement[i], 0.75 * single.displacement, atol=1e-8)
        assert found.contact_area[step] == pytest.approx(float(single.contact_area), abs=1e-5)
    loaded = run(elastic(2.0), elastic(6.0), displacement=0 * MOVED)
    apart = loaded.gap[-1] + heights_at(0)  # the displacements of both, and their mean
    energy = jnp.mean(loaded.pressure[-1] * (apart - jnp.mean(apart))) / 2
    assert loaded.load_work_done[-1] == pytest.approx(float(energy), rel=1e-6)


def test_exchanged_bodies_have_the_same_transient():
    first, second = rubber(), rubber(6.0, 0.3, 2.0)
    found = run(first, second)
    other = run(second, first, OTHER, ROUGH, displacement=-MOVED)
    assert np.max(np.abs(found.friction)) > 0.01
    np.testing.assert_allclose(other.friction, -found.friction, atol=1e-6)
    for name in ("contact_area", "mean_gap", "work_done", "load_work_done"):
        np.testing.assert_allclose(getattr(other, name), getattr(found, name), atol=1e-6)


@pytest.mark.parametrize("counterface", [None, elastic(6.0)])
def test_traction_of_coulomb_moves_elastic_surfaces_as_in_steady_sliding_both_ways(counterface):
    """An elastic body has no memory: each step that moves is steady sliding in its direction."""
    law, block = Coulomb(0.5), elastic(2.0)
    found = run(block, counterface, own=None, shear=law, pressure=0.05)
    for velocity, moving in ((1.0, np.append(0, MOVED[:-1]) < MOVED), (-1.0, np.arange(16) == 11)):
        steady = gc.slide(
            block,
            ROUGH,
            velocity=velocity,
            counterface=counterface,
            shear=law,
            pressure=0.05,
            rtol=1e-9,
        )
        expected = velocity * float(steady.friction)
        np.testing.assert_allclose(found.friction[moving], expected, rtol=1e-5)
        np.testing.assert_allclose(found.contact_area[moving], steady.contact_area, atol=1e-3)
        np.testing.assert_allclose(found.mean_gap[moving], steady.mean_gap, rtol=1e-5)
    still = gc.slide(block, ROUGH, velocity=0.0, counterface=counterface, pressure=0.05, rtol=1e-9)
    assert abs(float(still.mean_gap - steady.mean_gap)) > 1e-3 * still.mean_gap
    np.testing.assert_allclose(found.mean_gap[np.array([0, 2, -1])], still.mean_gap, rtol=1e-5)


class Proportional(AbstractShear):
    """Coulomb's law, but for the program any law of the pressure."""

    coupled: bool = True

    def __call__(self, pressure, speed, temperature):
        return 0.5 * pressure


def test_traction_of_any_law_lags_until_the_contact_is_steady():
    """On an elastic block each step of steady sliding is a step towards the contact of Coulomb."""
    block, given = elastic(2.0), dict(own=None, pressure=0.05)
    lagging = run(block, None, shear=Proportional(), **given)
    exact = run(block, None, shear=Coulomb(0.5), **given)
    away = np.abs(lagging.mean_gap - exact.mean_gap)
    assert away[3] > 1e-3 * exact.mean_gap[3]  # the first that moves
    assert away[9] < 0.01 * away[3]
