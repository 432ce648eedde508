"""Contacts on a window against Hertz, a flat punch, larger windows and longer cells."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.reference import hertz_line, hertz_pressure, hertz_sphere
from graded_contact.response import window

ELASTIC = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.3)))
REDUCED = 1 / (1 - 0.3**2)
RUBBER = gc.HalfSpace(gc.Prony(1.0, [9.0], [0.1], 0.49))
COATED = gc.Stack(layers=(gc.Layer(gc.Elastic(3.0, 0.49), 0.05),), base=RUBBER)


def distances(n, size=1.0):
    """From the middle of a window, which is a point."""
    return (np.arange(n) - n / 2) * (size / n)


def sphere(n, size=1.0):
    x = distances(n, size)
    heights = -(x[:, None] ** 2 + x[None] ** 2) / 2
    return gc.Surface(heights, gc.Grid((n, n), size), periodic=False)


def cylinder(n, bumps=0.0):
    x = distances(n)
    heights = -(x**2) / 2 + bumps * np.cos(40 * x + 1)
    return gc.Surface(heights, gc.Grid((n,), 1.0), periodic=False)


@pytest.fixture(scope="module")
def sliding():
    return gc.slide(COATED, sphere(64), pressure=0.02, velocity=1.0)


@pytest.mark.parametrize("radius", [0.1, 0.2, 0.4])
def test_sphere_is_that_of_hertz(radius):
    """Radius, peak and approach a²/R; the stiffness 2E*a is that of the counted radius."""
    load = 4 / 3 * REDUCED * radius**3
    surface = sphere(64)

    def press(load):
        return gc.slide(ELASTIC, surface, pressure=load, velocity=0.0, rtol=1e-7)

    found, stiffness = press(load), 1 / jax.grad(lambda load: press(load).approach)(load)
    contact_radius, peak = hertz_sphere(load, 1.0, REDUCED)[:2]
    np.testing.assert_allclose(contact_radius, radius)
    np.testing.assert_allclose(jnp.max(found.pressure), peak, rtol=6e-4)
    np.testing.assert_allclose(found.approach, radius**2, rtol=6e-4)
    np.testing.assert_allclose(found.contact_area_smooth, np.pi * radius**2, rtol=0.012)
    np.testing.assert_allclose(stiffness, 2 * REDUCED * radius, rtol=0.012)
    assert found.caveats == ()


def test_cylinder_is_that_of_hertz():
    """A line contact, whose constant in Green's function is arbitrary."""
    load = np.pi * REDUCED * 0.2**2 / 4
    half_width, peak = hertz_line(load, 1.0, REDUCED)[:2]
    np.testing.assert_allclose(half_width, 0.2)
    errors = []
    for n in (64, 256):
        surface = cylinder(n)
        found = gc.slide(ELASTIC, surface, pressure=load, velocity=0.0, rtol=1e-8)
        true = hertz_pressure(distances(n), half_width, peak)
        errors.append(np.sqrt(np.mean((found.pressure - true) ** 2) / np.mean(true**2)))
    assert errors[0] < 0.02 and errors[1] < 4e-3


def test_flat_punch_ends_at_the_window():
    """p = F/(π √(a² - x²)) between the edges; its caveat tells of the rim."""
    n = 512
    surface = gc.Surface(np.zeros(n), gc.Grid((n,), 1.0), periodic=False)
    found = gc.slide(ELASTIC, surface, pressure=1.0, velocity=0.0, rtol=1e-8)
    x = (np.arange(n) + 0.5) / n * 2 - 1
    middle = slice(n // 8, -n // 8)
    true = 2 / np.pi / np.sqrt(1 - x**2)
    np.testing.assert_allclose(found.pressure[middle], true[middle], rtol=2.1e-3)
    assert found.contact_area == 1 and found.rim_load > 0.01
    assert "rim of the window" in found.caveats[-1]


@pytest.mark.slow
def test_friction_of_a_sphere_does_not_depend_on_window_and_cell(sliding, monkeypatch):
    """Within the error that it reports: a window and a long cell twice as large."""
    twice = gc.slide(COATED, sphere(128, 2.0), pressure=0.02 / 4, velocity=1.0)
    assert 1e-7 < sliding.friction_error < 1e-5
    assert abs(sliding.friction - twice.friction) < sliding.friction_error
    np.testing.assert_allclose(sliding.friction, 0.04354, atol=1e-5)
    np.testing.assert_allclose(sliding.approach, twice.approach, rtol=1e-3)
    monkeypatch.setitem(window._WINDOWS, 2, 16)
    jax.clear_caches()
    shorter = gc.slide(COATED, sphere(64), pressure=0.02, velocity=1.0)
    jax.clear_caches()
    assert abs(shorter.friction - sliding.friction) < shorter.friction_error < 1e-4


def test_energy_is_balanced_on_a_window(sliding):
    assert sliding.energy_imbalance < 1e-12
    np.testing.assert_allclose(sliding.geometric_friction, sliding.friction, rtol=4e-3)
    assert sliding.pressure.shape == sliding.gap.shape == (64, 64)
    np.testing.assert_allclose(jnp.mean(sliding.pressure), 0.02)
    np.testing.assert_allclose(jnp.mean(sliding.gap), sliding.mean_gap)


def test_a_wave_far_from_all_edges_is_that_of_the_periodic_surface():
    """What a wave adds to the pressure of a cylinder, in the middle of its wide contact.

    The layer is thin, so that the ends of the contact are 4 thicknesses away or more.
    """
    n, waves = 256, 16
    x = np.arange(n) / n
    wave, cylinder = 1e-3 * np.cos(2 * np.pi * waves * x), -0.5 * (x - 0.5) ** 2
    block = gc.Stack(layers=(gc.Layer(gc.Prony(1.0, [9.0], [0.01], 0.4), 0.05),), base=gc.Rigid())

    def pressure(heights, periodic):
        surface = gc.Surface(heights, gc.Grid((n,), 1.0), periodic=periodic)
        return gc.slide(block, surface, pressure=2.0, velocity=1.0, rtol=1e-9).pressure

    middle = slice(3 * n // 8, -3 * n // 8)
    true = (pressure(wave, True) - 2)[middle]
    added = (pressure(cylinder + wave, False) - pressure(cylinder, False))[middle]
    np.testing.assert_allclose(added - jnp.mean(added), true, atol=1e-3 * float(jnp.max(true)))


def test_derivatives_on_a_window_match_differences():
    surface = cylinder(64, bumps=0.004)

    @jax.jit
    def friction(thickness, velocity, load, heights):
        block = eqx.tree_at(lambda b: b.layers[0].thickness, COATED, thickness)
        rough = gc.Surface(heights, surface.grid, periodic=False)
        return gc.slide(block, rough, pressure=load, velocity=velocity, rtol=1e-11).friction

    at = [jnp.asarray(a) for a in (0.05, 1.0, 0.02)] + [surface.heights]
    ahead = [jnp.asarray(a) for a in (0.01, 0.3, -0.004)]
    ahead.append(1e-3 * jnp.sin(9 * surface.heights * 40))
    slope = sum(
        jnp.sum(a * g) for a, g in zip(ahead, jax.grad(friction, (0, 1, 2, 3))(*at), strict=True)
    )
    step = 1e-4
    up, down = (
        friction(*(a + sign * step * d for a, d in zip(at, ahead, strict=True))) for sign in (1, -1)
    )
    np.testing.assert_allclose(slope, (up - down) / (2 * step), rtol=1e-5)


def test_a_solution_and_a_start_on_a_window_are_accepted(sliding):
    again = gc.slide(
        COATED, sphere(64), pressure=0.02, velocity=1.0, solution=sliding.contact, rtol=1e-4
    )
    for name in ("pressure", "gap", "displacement", "mean_gap"):
        np.testing.assert_allclose(getattr(again, name), getattr(sliding, name), atol=1e-12)
    near = gc.slide(COATED, sphere(64), pressure=0.02, velocity=1.0, start=sliding.pressure)
    np.testing.assert_allclose(near.friction, sliding.friction, rtol=1e-5)


@pytest.mark.slow
def test_a_target_sees_the_window():
    surface = cylinder(64)
    found = gc.slide(COATED, surface, pressure=0.02, velocity=1.0, friction_rtol=1e-3)
    exact = gc.slide(COATED, surface, pressure=0.02, velocity=1.0, rtol=1e-8)
    assert abs(found.friction - exact.friction) <= 1e-3 * exact.friction
    kernel = gc.blocks.window_kernel(COATED, surface.grid, 1.0)
    alone = gc.solve_contact(kernel, surface.heights, 0.02, rtol=1e-8)
    np.testing.assert_allclose(alone.pressure, exact.pressure, atol=1e-12)


def test_what_a_window_cannot_have_is_refused():
    surface = cylinder(64)
    with pytest.raises(ValueError, match="mean_gap"):
        gc.slide(COATED, surface, mean_gap=0.1, velocity=1.0)
    with pytest.raises(ValueError, match="attracts"):
        law = gc.AdhesiveLJ(0.01, 0.001)
        gc.slide(COATED, surface, pressure=0.02, velocity=1.0, law=law)
    with pytest.raises(ValueError, match="periodic"):
        gc.surface.resample(surface, (32,))
    with pytest.raises(ValueError, match="mean_gap"):
        _ = gc.slide(ELASTIC, surface, pressure=0.02, velocity=0.0).approach
