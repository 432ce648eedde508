"""Heat that softens the block under its own contact: the fixed point and its derivative."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.blocks.heated_stack import heated
from graded_contact.core.fixed_point import attach_fixed_point, find_fixed_point
from graded_contact.sliding import (
    ConstantShear,
    Coulomb,
    Heating,
    PeakedShear,
    heat_depths,
    heat_source,
)
from graded_contact.sliding.solve import heated as module

CELL = 4e-3  # m
Q0 = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=Q0, q_roll=2 * Q0, q_high=4 * Q0)
SURFACE = gc.random_surface(SPECTRUM, gc.Grid((32, 32), CELL), jax.random.key(0))
RUBBER = gc.Prony(1e6, [9e6, 2e7], [1e-2, 1e-4], 0.49, shift=gc.WLF(8.0, 100.0, 293.0))
BLOCK = gc.Stack(base=gc.HalfSpace(RUBBER))
TISSUE = Heating(0.25, 1.1e-7, 1.0)


def warm(stack=BLOCK, heating=TISSUE, velocity=1.0, **how):
    how = {"pressure": 3e4, "temperature": 293.0, "rtol": 1e-8} | how
    return gc.slide(stack, SURFACE, velocity=velocity, heating=heating, **how)


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


@pytest.mark.slow
def test_slow_sliding_does_not_heat():
    how = {"pressure": 3e4, "velocity": 1e-6, "rtol": 1e-8}
    cold, s = gc.slide(BLOCK.at(283.0), SURFACE, **how), warm(velocity=1e-6, temperature=283.0)
    assert 0 < s.heated.surface_rise < 1e-4
    np.testing.assert_allclose(s.friction, cold.friction, rtol=1e-5)


@pytest.mark.slow
def test_the_contact_is_at_the_temperatures_that_it_causes(monkeypatch):
    """By the public functions on finer depths, without the code of the loop."""
    monkeypatch.setattr(module, "NUM_CELLS", 4)
    s = warm()
    assert s.heated.surface_rise > 1
    depths, weights = heat_depths(BLOCK, SURFACE.grid)
    block = s.heated.stack
    source = heat_source(s, block, depths)
    made = jnp.sum(jnp.mean(source, (1, 2)) * weights)
    np.testing.assert_allclose(made, s.friction * 3e4, rtol=5e-3)
    rise = gc.sliding.flash_temperature(s, block, TISSUE, [0.0])[0]
    found = jnp.mean(rise * s.pressure) / 3e4
    np.testing.assert_allclose(found, s.heated.surface_rise, rtol=0.03)
    again = gc.slide(block, SURFACE, pressure=3e4, velocity=1.0, rtol=1e-8)
    np.testing.assert_allclose(again.friction, s.friction, rtol=1e-6)
    assert s.num_fft_pairs > 2 * again.num_fft_pairs  # of all steps
    assert 0 < s.heated.area_error <= s.contact_area_error < 0.05
    assert again.error_parts("friction")["solver"] < s.heated.friction_error
    assert s.heated.friction_error <= s.friction_error < 0.15 * s.friction


@pytest.mark.slow
def test_a_cycle_has_the_temperatures_of_its_mean_heat():
    """Of steady sliding they are those of `slide`; back and forth they follow the mean power."""
    line = gc.random_surface(SPECTRUM, gc.Grid((32,), CELL), jax.random.key(0))
    law = PeakedShear(3e5, 1.0, 0.3, gc.Arrhenius(9e4, 293.0))
    how = {"pressure": 3e4, "temperature": 293.0, "heating": TISSUE, "shear": law, "rtol": 1e-8}
    expected = gc.slide(BLOCK, line, velocity=1.0, **how)
    given = {"displacement": CELL * jnp.arange(32) / 32, "period": CELL}
    found = gc.sliding.slide_cycle(BLOCK, line, **given, **how)
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-8)
    np.testing.assert_allclose(found.heated.rises, expected.heated.rises, rtol=1e-8)
    np.testing.assert_allclose(found.surface_rise, expected.surface_rise, rtol=1e-8)
    # The work of a coupled traction on the block counts once, with a law that lags too.
    for shear in (Coulomb(0.8), ConstantShear(3e4, coupled=True)):
        coupled = how | {"shear": shear, "rtol": 1e-6}
        stiff = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], 0.2, RUBBER.shift)))
        expected_rise = gc.slide(stiff, line, velocity=1.0, **coupled).surface_rise
        rise = gc.sliding.slide_cycle(stiff, line, **given, **coupled).surface_rise
        np.testing.assert_allclose(rise, expected_rise, rtol=1e-4)
    # At a mean speed of 1 m/s the mean power is near that of steady sliding.
    motion = gc.sliding.sinusoidal(2e-3, 250.0, grid=line.grid)
    given = {"displacement": motion.displacement, "period": motion.period}
    found = gc.sliding.slide_cycle(BLOCK, line, **given, **how)
    power = found.work / found.period / (expected.friction * 3e4)
    np.testing.assert_allclose(found.surface_rise, power * expected.surface_rise, rtol=0.1)
    assert found.surface_rise > 1
    assert 0 < found.error_parts("mean_friction")["temperature"] < 0.01 * found.mean_friction
    with pytest.raises(ValueError, match="`heating` is refused: `displacement` does not move"):
        given = {"displacement": np.zeros(8), "period": 1.0}
        gc.sliding.slide_cycle(BLOCK, line, **given, **how)


def random_cases(number):
    rng = np.random.default_rng(1)
    spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=Q0, q_roll=2 * Q0, q_high=8 * Q0)
    for i in range(number):
        times, strengths = 10 ** rng.uniform(-6, -2, 2), 10 ** rng.uniform(6, 7.5, 2)
        rubber = gc.Prony(1e6, strengths, times, 0.49, shift=RUBBER.shift)
        law = PeakedShear(3e5, 1.0, 0.3, gc.Arrhenius(9e4, 293.0)) if i % 2 else None
        surface = gc.random_surface(spectrum, gc.Grid(64, CELL), jax.random.key(i))
        pressure, velocity = 10 ** rng.uniform(3.5, 5.5), 10 ** rng.uniform(-1.5, 1)
        how = dict(
            pressure=pressure, velocity=velocity, temperature=rng.uniform(273, 313), shear=law,
            heating=Heating(0.25, 1.1e-7, float(i % 3 > 0)),
        )  # fmt: skip
        yield partial(gc.slide, gc.Stack(base=gc.HalfSpace(rubber)), surface, **how)


@pytest.mark.slow
def test_the_claimed_error_covers_that_of_the_temperatures(monkeypatch):
    """Against four times the cells and a tight tolerance."""
    for solve in random_cases(10):
        found = solve(rtol=1e-4)
        with monkeypatch.context() as patch:
            patch.setattr(module, "NUM_CELLS", 32)
            truth = solve(rtol=1e-9)
        assert (
            abs(found.friction - truth.friction)
            <= found.error_parts("friction")["temperature"]
            + found.error_parts("friction")["solver"]
        )
        assert found.error_parts("friction")["temperature"] <= 1e-2 * found.friction
        for area in ("contact_area", "contact_area"):
            assert abs(getattr(found, area) - getattr(truth, area)) <= found.contact_area_error


@pytest.mark.slow
def test_more_conduction_means_less_heating_and_shear_heats_too():
    rises = [
        float(warm(heating=Heating(k, k / 2.3e6, other)).heated.surface_rise)
        for k, other in ((0.25, 0.0), (0.25, 2.0), (25.0, 0.0))
    ]
    assert rises[0] > rises[1] > rises[2] > 0
    law = PeakedShear(3e5, 1.0, 0.3, gc.Arrhenius(9e4, 293.0))
    s = warm(shear=law)
    assert s.heated.surface_rise > rises[1]
    stress = law(jnp.zeros(()), jnp.asarray(1.0), 293.0 + s.heated.surface_rise)
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
