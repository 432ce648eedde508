"""Transient motion between two bodies: exchanged bodies, energy, traction on both."""

import jax.numpy as jnp
import numpy as np

import graded_contact as gc
from graded_contact.contacts import DouglasRachford
from graded_contact.sliding import Coulomb
from graded_contact.sliding.shear import AbstractShear

NUM, STEPS = 32, 16
GRID = gc.Grid((NUM,), 1.0)
PLACE = 2 * np.pi * np.arange(NUM) / NUM
ROUGH = gc.Surface(0.02 * np.cos(PLACE) + 4e-3 * np.sin(3 * PLACE), GRID)
OTHER, FLAT = gc.Surface(0.01 * np.cos(2 * PLACE + 1), GRID), gc.Surface(0 * PLACE, GRID)
TIMES = 0.02 * np.arange(1, STEPS + 1)
MOVED = np.array([0, 0, 0, 1, 2, 3, 5, 6, 8, 9, 9, 8, 7, 6, 6, 6]) / NUM  # the points coincide


def rubber(strength=3.0, time=0.05, equilibrium=1.0):
    return gc.Stack(base=gc.HalfSpace(gc.Prony(equilibrium, [strength], [time], 0.3)))


def elastic(modulus):
    return rubber(1e-12 * modulus, 1.0, modulus)


RIGID = elastic(1e12)


def run(stack, counterface, surface=ROUGH, own=FLAT, law=None, **changes):
    """All of one law share a program."""
    how = dict(times=TIMES, displacement=MOVED, pressure=0.05, rtol=1e-8, fields_at=(5, -1))
    how |= dict(solver=DouglasRachford(newton=False), shear=law or Coulomb(0.0)) | changes
    return gc.slide_transient(stack, surface, counterface=counterface, block_surface=own, **how)


def heights_at(step):
    """Of both bodies together, in the frame of the surface."""
    return ROUGH.heights + np.roll(OTHER.heights, -round(MOVED[step] * NUM))


def test_two_elastic_bodies_are_one_with_the_sum_of_compliances_and_store_the_work():
    """At each time the contact is that of the heights of both on one body at rest."""
    found = run(elastic(2.0), elastic(6.0), own=OTHER, pressure=0.2)
    for i, step in enumerate((5, STEPS - 1)):
        both = gc.Surface(heights_at(step), GRID)
        single = gc.slide(elastic(1.5), both, pressure=0.2, velocity=1.0, rtol=1e-9)
        np.testing.assert_allclose(found.pressure[i], single.pressure, atol=2e-7)
        np.testing.assert_allclose(found.displacement[i], 0.75 * single.displacement, atol=1e-8)
        np.testing.assert_allclose(found.contact_area[step], single.contact_area, atol=1e-5)
    loaded = run(elastic(2.0), elastic(6.0), own=OTHER, displacement=0 * MOVED)
    apart = loaded.gap[-1] + heights_at(0)  # the displacements of both, and their mean
    energy = jnp.mean(loaded.pressure[-1] * (apart - jnp.mean(apart))) / 2
    np.testing.assert_allclose(loaded.load_work_done[-1], energy, rtol=1e-6)


def test_exchanged_bodies_have_the_same_transient():
    first, second, law = rubber(), rubber(6.0, 0.3, 2.0), Coulomb(0.3)
    found = run(first, second, ROUGH, OTHER, law)
    other = run(second, first, OTHER, ROUGH, law, displacement=-MOVED)
    assert np.max(np.abs(found.friction)) > 0.31
    np.testing.assert_allclose(other.friction, -found.friction, atol=1e-6)
    for name in ("contact_area", "mean_gap", "work_done", "load_work_done"):
        np.testing.assert_allclose(getattr(other, name), getattr(found, name), atol=1e-6)


def test_traction_of_coulomb_moves_elastic_surfaces_as_in_steady_sliding_both_ways():
    """An elastic body has no memory: each step that moves is steady sliding in its direction."""
    law, block = Coulomb(0.5), elastic(2.0)
    away = np.diff(MOVED, prepend=0)
    for counterface in (RIGID, elastic(6.0)):
        found = run(block, counterface, law=law)
        path = np.cumsum(np.abs(away))
        np.testing.assert_allclose(found.shear_work_done, 0.5 * 0.05 * path, rtol=1e-9)
        given = dict(counterface=counterface, pressure=0.05, rtol=1e-9)
        for velocity, moving in ((1.0, away > 0), (-1.0, away < 0)):
            steady = gc.slide(block, ROUGH, velocity=velocity, shear=law, **given)
            friction, area = steady.compute("friction", "contact_area")
            np.testing.assert_allclose(found.friction[moving], velocity * friction, rtol=1e-5)
            np.testing.assert_allclose(found.contact_area[moving], area, atol=1e-3)
            np.testing.assert_allclose(found.mean_gap[moving], steady.mean_gap, rtol=1e-5)
        still = gc.slide(block, ROUGH, velocity=1.0, shear=Coulomb(0.0), **given)
        assert abs(float(still.mean_gap - steady.mean_gap)) > 1e-3 * still.mean_gap
        np.testing.assert_allclose(found.mean_gap[np.array([0, 2, -1])], still.mean_gap, rtol=1e-5)


class Proportional(AbstractShear):
    """Coulomb's law, but for the program any law of the pressure."""

    coupled: bool = True

    def __call__(self, pressure, speed, temperature):
        return 0.5 * pressure


def test_traction_of_any_law_lags_until_the_contact_is_steady():
    """On an elastic block each step of steady sliding is a step towards the contact of Coulomb."""
    lagging = run(elastic(2.0), RIGID, law=Proportional())
    exact = run(elastic(2.0), RIGID, law=Coulomb(0.5))
    away = np.abs(lagging.mean_gap - exact.mean_gap)
    assert away[3] > 1e-3 * exact.mean_gap[3]  # the first that moves
    assert away[9] < 0.01 * away[3]
