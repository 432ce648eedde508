"""Heat that softens the block under its own contact: the fixed point and its derivative."""

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

CELL, N = 4e-3, 32  # m; points
PLACE = 2 * np.pi * np.arange(N) / N
GRID = gc.Grid((N,), CELL)
TISSUE = Heating(0.25, 1.1e-7, 1.0)


@pytest.fixture(autouse=True)
def few_cells(monkeypatch):
    """Half as many cells of the depth, each a layer: they compile in less time."""
    monkeypatch.setattr(module, "NUM_CELLS", 4)


def surface(seed=0):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 3)
    return gc.Surface(sum(8e-5 / k * np.cos(k * PLACE + phases[k - 2]) for k in (2, 3, 4)), GRID)


def rubber(strengths=(9e6, 2e7), times=(1e-2, 1e-4)):
    wlf = gc.WLF(8.0, 100.0, 293.0)
    return gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, strengths, times, 0.49, shift=wlf)))


def shear(peak=3e5):
    return PeakedShear(peak, 1.0, 0.3, gc.Arrhenius(9e4, 293.0))


def warm(block=None, rough=None, **how):
    """All of them share a program."""
    how = {"pressure": 3e4, "temperature": 293.0, "rtol": 1e-8, "velocity": 1.0} | how
    how = {"heating": TISSUE, "shear": shear()} | how
    return gc.slide(block or rubber(), rough or surface(), **how)


def test_slow_sliding_does_not_heat_and_one_temperature_is_that_of_the_block():
    s = warm(velocity=1e-6, temperature=283.0, shear=shear(1.0))
    cold = gc.slide(rubber().at(283.0), surface(), pressure=3e4, velocity=1e-6, rtol=1e-8)
    assert 0 < s.heated.surface_rise < 1e-4
    np.testing.assert_allclose(s.friction, cold.friction, rtol=1e-5)
    coat = gc.Layer(rubber().base.material, 2e-4)
    stack = gc.Stack(layers=(coat, gc.Layer(gc.Elastic(5e6, 0.4), 1e-4), coat), base=gc.Rigid())
    edges = np.array([0.0, 1e-4, 3e-4, 1e-2])
    many = jax.jit(heated)(stack, 293.0, np.full(3, 7.0), edges)
    assert sum(layer.thickness for layer in many.layers) == pytest.approx(5e-4, rel=1e-12)
    warmer = [one.material for one in many.layers if one.thickness > 0]
    warmer = [one for one in warmer if isinstance(one, gc.Prony)]
    for one in warmer:
        np.testing.assert_allclose(one.times, coat.material.at(300.0).times, rtol=1e-12)
    assert len(warmer) >= 3


def test_the_contact_is_at_the_temperatures_that_it_causes():
    """By the public functions, without the code of the loop."""
    s = warm()
    assert s.heated.surface_rise > 1
    (block,) = s.bodies
    edges = intervals(jnp.array(CELL / 640), jnp.array(CELL), 2 * module.NUM_CELLS)
    depths, weights = gauss_within(rubber(), edges)  # as many as in the loop: one program
    heat = Heat(heat_source(s, depths, weights > 0), weights, shear_heat(s))
    ((rise,),) = temperatures(s, (rubber(),), TISSUE, heat, [jnp.zeros(1)])
    found = jnp.mean(to_field(rise, GRID.shape) * s.pressure) / 3e4
    np.testing.assert_allclose(found, s.heated.surface_rise, rtol=0.03)
    again = gc.slide(block, surface(), pressure=3e4, velocity=1.0, rtol=1e-8)
    np.testing.assert_allclose(again.friction, s.friction - s.shear_friction, rtol=1e-6)
    assert s.num_fft_pairs > again.num_fft_pairs  # of all steps


def test_a_cycle_of_steady_sliding_has_its_temperatures():
    how = {"pressure": 3e4, "temperature": 293.0, "heating": TISSUE, "shear": shear()}
    expected = warm()
    given = {"displacement": CELL * np.arange(N) / N, "period": CELL}
    found = gc.slide_cycle(rubber(), surface(), **given, **how, rtol=1e-8)
    np.testing.assert_allclose(found.mean_friction, expected.friction, rtol=1e-8)
    np.testing.assert_allclose(found.heated.rises, expected.heated.rises, rtol=1e-8)


def test_the_claimed_error_covers_that_of_the_temperatures(monkeypatch):
    """Against four times the slices and a tight tolerance."""
    rng, cases = np.random.default_rng(1), []
    for i in range(3):
        block = rubber(10 ** rng.uniform(6, 7.5, 2), 10 ** rng.uniform(-6, -2, 2))
        how = dict(
            pressure=10 ** rng.uniform(3.5, 5.5), velocity=10 ** rng.uniform(-1.5, 1),
            temperature=rng.uniform(273, 313), shear=shear(3e5 if i % 2 else 1.0),
            heating=Heating(0.25, 1.1e-7, float(i > 0)),
        )  # fmt: skip
        cases.append((block, surface(i), how))
    names = "friction", "contact_area"
    found = [warm(block, rough, **how) for block, rough, how in cases]
    monkeypatch.setattr(module, "NUM_CELLS", 4 * module.NUM_CELLS)
    for (block, rough, how), one in zip(cases, found, strict=True):
        finer = warm(block, rough, **how).compute(*names)
        friction, area = (abs(a - b) for a, b in zip(finer, one.compute(*names), strict=True))
        claimed = one.heated
        assert friction <= claimed.friction_error + 1e-8  # of the solver
        assert claimed.friction_error <= 1e-2 * one.friction
        assert area <= claimed.area_error + 1e-6


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


def test_a_fixed_point_is_found_where_the_map_falls_or_rises():
    """cos has its own; tanh has three, and from 0 the one above is found."""

    def image(slope, factor, x):
        return factor * (1 + slope * jnp.tanh(x * jnp.array([1.0, 0.5])))

    def attached(slope, x):
        return lambda factor: attach_fixed_point(lambda f, x: image(slope, f, x), factor, x)[0]

    @jax.jit
    def solve(slope):
        once = lambda x, state: (image(slope, 1.0, x), x)  # noqa: E731
        point = find_fixed_point(once, jnp.zeros(2), None, jnp.asarray(1e-12), jnp.asarray(1e3))
        root = attached(slope, point.x)
        forward = jax.jvp(root, (1.0,), (1.0,))[1]
        return point.x, once(point.x, None)[0], jax.grad(root)(1.0), forward

    for slope in (-0.9, 0.5, 0.99):
        x, again, backward, forward = solve(slope)
        np.testing.assert_allclose(again, x, rtol=1e-10)
        exact = x[0] / (1 - slope / np.cosh(x[0]) ** 2)
        np.testing.assert_allclose((backward, forward), exact, rtol=1e-9)
        # Outside of `jit` by GMRES; the transpose alone may be inside.
        back = jax.vjp(attached(slope, x), 1.0)[1]
        np.testing.assert_allclose((back(1.0)[0], jax.jit(back)(1.0)[0]), exact, rtol=1e-5)
        forward = jax.jvp(attached(slope, x), (1.0,), (1.0,))[1]
        np.testing.assert_allclose(forward, exact, rtol=1e-9)
