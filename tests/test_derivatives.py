"""Derivatives of results against central differences: a row for each function.

All numbers of all arguments move at once. That of a graded layer is in `response/test_grading.py`.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.sliding.solve import heated as heated_contact

LONGEST, POINTS = 2 * np.pi / 1e-3, 16
PLACES = 2 * np.pi * np.arange(POINTS) / POINTS
HEIGHTS = 1e-5 * np.cos(PLACES) + 3e-6 * np.cos(3 * PLACES + 1)
RUBBER = gc.Prony(1e6, [9e6], [1e-3], 0.45, gc.WLF(10.0, 50.0, 300.0))
COAT = gc.Layer(gc.Elastic(8e6, 0.4), 5e-5)
BLOCK = gc.Stack(layers=(COAT,), base=gc.HalfSpace(RUBBER))
BARE = gc.Stack(base=gc.HalfSpace(RUBBER))
SPECTRUM = gc.SelfAffine(
    rms_slope=0.1, hurst=0.8, q_low=LONGEST, q_roll=2 * LONGEST, q_high=32 * LONGEST
)
PLAIN = gc.contacts.DouglasRachford(newton=False)
SHARP = {"rtol": 1e-10, "solver": PLAIN, "derivative_rtol": 1e-9}


def surface_of(heights, periodic=True):
    return gc.Surface(heights, gc.Grid((POINTS,), 1e-3), periodic=periodic)


def slide(block, heights, pressure, velocity, periodic=True, **how):
    """Friction, area and gap in one number, so that one program tests all three."""
    surface = surface_of(heights, periodic)
    s = gc.slide(block, surface, pressure=pressure, velocity=velocity, **SHARP, **how)
    return s.friction + 0.1 * s.contact_area + 1e4 * s.mean_gap


def cycle(block, heights, pressure, stress):
    motion = gc.sliding.sinusoidal(stroke=1e-4, frequency=20.0, num_times=16)
    given = {"displacement": motion.displacement, "period": motion.period, "pressure": pressure}
    law = gc.sliding.PeakedShear(stress, 1e-2, 0.5)
    c = gc.slide_cycle(block, surface_of(heights), shear=law, **given, **SHARP)
    gaps = jnp.cos(jnp.arange(16)) @ c.mean_gap  # each time has its own weight
    return c.mean_friction + 1e4 * gaps


def transient(block, heights, pressure, times, moved):
    given = {"times": times, "displacement": moved, "pressure": pressure}
    found = gc.slide_transient(block, surface_of(heights), **given, rtol=1e-10, solver=PLAIN)
    return found.friction[-1]


def two_bodies(block, heights, pressure, velocity, counterface, coefficient):
    shear = gc.sliding.Coulomb(coefficient)
    return slide(block, heights, pressure, velocity, counterface=counterface, shear=shear)


def heated(block, heights, pressure, temperature, conductivity):
    heating = gc.sliding.Heating(conductivity, 1e-7)
    given = {"pressure": pressure, "velocity": 1.0, "temperature": temperature}
    return gc.slide(block, surface_of(heights), heating=heating, **given, **SHARP).friction


def mean_field(block, spectrum, pressure):
    return gc.mean_field_friction(block, spectrum, pressure=pressure, velocity=0.1).friction


def compliance(block, q, omega):
    return jnp.abs(gc.surface_compliance(block, q, omega))


def modulus(material, temperature, omega):
    return jnp.abs(material.at(temperature).complex_modulus(omega))


STEPS = 1e-3 * np.arange(1, 6)
STEADY = (BLOCK, HEIGHTS, 2e4, 0.1)
# Stiff and with little traction: each number of the block has its share of the derivative.
STIFF = gc.Stack(base=gc.HalfSpace(gc.Prony(2e7, [9e7], [1e-3], 0.3)))
CASES = {
    "modulus": (modulus, (RUBBER, 310.0, 50.0)),
    "compliance of layers": (compliance, (BLOCK, 2e4, 30.0)),
    "without a period": (lambda *given: slide(*given, periodic=False), (BARE, *STEADY[1:])),
    "of two bodies under Coulomb's law": (two_bodies, (*STEADY, STIFF, 0.02)),
    "of a cycle": (cycle, (BARE, HEIGHTS, 2e4, 1e4)),
    "with the heat of friction": (heated, (BARE, HEIGHTS, 2e4, 300.0, 0.2)),
    "friction of a transient": (transient, (BARE, HEIGHTS, 2e4, STEPS, 1e-2 * STEPS)),
    "mean field": (mean_field, (BLOCK, SPECTRUM, 2e4)),
}


# The others have the programs of their values.
IN_ONE_PROGRAM = {"modulus", "friction of a transient", "mean field"}


@pytest.mark.parametrize("name", CASES)
def test_a_derivative_is_the_difference(name, monkeypatch):
    monkeypatch.setattr(heated_contact, "NUM_CELLS", 2)  # of the depth: fewer layers to compile
    function, arguments = CASES[name]
    leaves, structure = jax.tree.flatten(jax.tree.map(np.asarray, arguments))
    draw = np.random.default_rng(0)
    way = [x * draw.uniform(0.5, 1.0, np.shape(x)) for x in leaves]

    def flat(*leaves):
        return function(*structure.unflatten(leaves))

    both = jax.value_and_grad(flat, range(len(leaves)))
    both = jax.jit(both) if name in IN_ONE_PROGRAM else both
    value = (lambda *x: both(*x)[0]) if name in IN_ONE_PROGRAM else flat
    slopes = both(*map(jnp.asarray, leaves))[1]
    up, down = (
        value(*(jnp.asarray(x + step * d) for x, d in zip(leaves, way, strict=True)))
        for step in (1e-6, -1e-6)
    )
    slope = sum(np.sum(d * np.asarray(g)) for d, g in zip(way, slopes, strict=True))
    assert slope == pytest.approx(float(up - down) / 2e-6, rel=1e-3)
