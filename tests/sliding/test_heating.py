"""Heat that softens the block under its own contact: the fixed point and its derivative."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.blocks.heated_stack import heated
from graded_contact.core.fixed_point import attach_fixed_point, find_fixed_point
from graded_contact.fields.grid import to_field
from graded_contact.sliding import Heating, PeakedShear
from graded_contact.sliding.interior.conduction import Heat, temperatures
from graded_contact.sliding.interior.heat_source import (
    gauss_within,
    heat_source,
    intervals,
    shear_heat,
)
from graded_contact.sliding.solve import heated as module

CELL = 4e-3  # m
Q0 = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=Q0, q_roll=2 * Q0, q_high=4 * Q0)
SURFACE = gc.random_surface(SPECTRUM, gc.Grid((32,), CELL), jax.random.key(0))
RUBBER = gc.Prony(1e6, [9e6, 2e7], [1e-2, 1e-4], 0.49, shift=gc.WLF(8.0, 100.0, 293.0))
BLOCK = gc.Stack(base=gc.HalfSpace(RUBBER))
TISSUE = Heating(0.25, 1.1e-7, 1.0)


def shear(peak=3e5):
    return PeakedShear(peak, 1.0, 0.3, gc.Arrhenius(9e4, 293.0))


def warm(block=BLOCK, surface=SURFACE, **how):
    """All of them share a program."""
    how = {"pressure": 3e4, "temperature": 293.0, "rtol": 1e-8, "velocity": 1.0} | how
    how = {"heating": TISSUE, "shear": shear()} | how
    return gc.slide(block, surface, **how)


def test_one_temperature_everywhere_is_that_of_the_block():
    coat = gc.Layer(RUBBER, 2e-4)
    stack = gc.Stack(layers=(coat, gc.Layer(gc.Elastic(5e6, 0.4), 1e-4), coat), base=gc.Rigid())
    edges = jnp.array([0.0, 1e-4, 3e-4, 1e-2])
    grid = gc.Grid((16, 16), CELL)
    block = heated(stack, jnp.asarray(293.0), jnp.full(3, 7.0), edges)
    np.testing.assert_allclose(
        gc.stack_kernel(block, grid, 0.3), gc.stack_kernel(stack.at(300.0), grid, 0.3), rtol=1e-10
    )
    cold = heated(BLOCK, jnp.asarray(300.0), jnp.zeros(3), edges)
    np.testing.assert_allclose(
        gc.stack_kernel(cold, grid, 0.3), gc.stack_kernel(BLOCK.at(300.0), grid, 0.3), rtol=1e-10
    )


def test_slow_sliding_does_not_heat():
    how = {"pressure": 3e4, "velocity": 1e-6, "rtol": 1e-8}
    cold, s = (
        gc.slide(BLOCK.at(283.0), SURFACE, **how),
        warm(velocity=1e-6, temperature=283.0, shear=shear(1.0)),
    )
    assert 0 < s.heated.surface_rise < 1e-4
    np.testing.assert_allclose(s.friction, cold.friction, rtol=1e-5)


def test_the_contact_is_at_the_temperatures_that_it_causes():
    """By the public functions, without the code of the loop."""
    s = warm()
    assert s.heated.surface_rise > 1
    (block,) = s.bodies
    depths, weights = gauss_within(block, intervals(jnp.array(CELL / 640), jnp.array(CELL), 18))
    heat = Heat(heat_source(s, depths, weights > 0), weights, shear_heat(s))
    ((rise,),) = temperatures(s, (BLOCK,), TISSUE, heat, [jnp.zeros(1)])
    found = jnp.mean(to_field(rise, s.grid.shape) * s.pressure) / 3e4
    np.testing.assert_allclose(found, s.heated.surface_rise, rtol=0.03)
    again = gc.slide(block, SURFACE, pressure=3e4, velocity=1.0, rtol=1e-8)
    np.testing.assert_allclose(again.friction, s.friction - s.shear_friction, rtol=1e-6)
    assert s.num_fft_pairs > again.num_fft_pairs  # of all steps


def test_a_cycle_of_steady_sliding_has_its_temperatures():
    how = {"pressure": 3e4, "temperature": 293.0, "heating": TISSUE, "shear": shear()}
    expected = warm()
    given = {"displacement": CELL * jnp.arange(32) / 32, "period": CELL}
    found = gc.slide_cycle(BLOCK, SURFACE, **given, **how, rtol=1e-8)
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-8)
    np.testing.assert_allclose(found.heated.rises, expected.heated.rises, rtol=1e-8)
    np.testing.assert_allclose(found.surface_rise, expected.surface_rise, rtol=1e-8)


def test_the_claimed_error_covers_that_of_the_temperatures(monkeypatch):
    """Against four times the slices and a tight tolerance."""
    rng, cases = np.random.default_rng(1), []
    for i in range(6):
        times, strengths = 10 ** rng.uniform(-6, -2, 2), 10 ** rng.uniform(6, 7.5, 2)
        rubber = gc.Prony(1e6, strengths, times, 0.49, shift=RUBBER.shift)
        how = dict(
            pressure=10 ** rng.uniform(3.5, 5.5), velocity=10 ** rng.uniform(-1.5, 1),
            temperature=rng.uniform(273, 313), shear=shear(3e5 if i % 2 else 1.0),
            heating=Heating(0.25, 1.1e-7, float(i % 3 > 0)),
        )  # fmt: skip
        surface = gc.random_surface(SPECTRUM, SURFACE.grid, jax.random.key(i))
        cases.append(partial(warm, gc.Stack(base=gc.HalfSpace(rubber)), surface, **how))
    found = [solve(rtol=1e-8) for solve in cases]
    parts = [one.error_parts("friction") for one in found]
    monkeypatch.setattr(module, "NUM_CELLS", 4 * module.NUM_CELLS)
    for solve, one, claimed in zip(cases, found, parts, strict=True):
        off = abs(one.friction - solve(rtol=1e-8).friction)
        assert off <= claimed["temperature"] + claimed["solver"]
        assert claimed["temperature"] <= 1e-2 * one.friction


def test_more_conduction_means_less_heating_and_shear_heats_too():
    rises = [
        float(warm(heating=Heating(k, k / 2.3e6, other)).heated.surface_rise)
        for k, other in ((0.25, 0.0), (0.25, 2.0), (25.0, 0.0))
    ]
    assert rises[0] > rises[1] > rises[2] > 0
    s = warm(shear=shear(6e5))
    assert s.heated.surface_rise > 1.5 * rises[1]
    stress = shear(6e5)(jnp.zeros(()), jnp.asarray(1.0), 293.0 + s.heated.surface_rise)
    np.testing.assert_allclose(s.shear_friction, stress * s.contact_area / 3e4, rtol=1e-12)


@pytest.mark.parametrize("slope", [-0.9, 0.5, 0.99])
def test_a_fixed_point_is_found_where_the_map_falls_or_rises(slope):
    """cos has its own; tanh has three, and from 0 the one above is found."""

    def function(x, state):
        return 1 + slope * jnp.tanh(x * jnp.array([1.0, 0.5])), x

    point = find_fixed_point(function, jnp.zeros(2), None, jnp.asarray(1e-12), jnp.asarray(1e3))
    np.testing.assert_allclose(function(point.x, None)[0], point.x, rtol=1e-10)

    def root(factor):
        return attach_fixed_point(lambda f, x: f * function(x, None)[0], factor, point.x)[0]

    exact = point.x[0] / (1 - slope / jnp.cosh(point.x[0]) ** 2)
    np.testing.assert_allclose(jax.grad(root)(1.0), exact, rtol=1e-9)
    np.testing.assert_allclose(jax.jvp(root, (1.0,), (1.0,))[1], exact, rtol=1e-9)
