"""Contacts on a window against closed forms, larger windows and longer cells."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms import hertz_line, hertz_pressure, hertz_sphere

import graded_contact as gc
from graded_contact.sliding.numbers.friction import geometric_friction

ELASTIC = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.3)))
REDUCED = 1 / (1 - 0.3**2)
RUBBER = gc.HalfSpace(gc.Prony(1.0, [9.0], [0.1], 0.49))
COATED = gc.Stack(layers=(gc.Layer(gc.Elastic(3.0, 0.49), 0.05),), base=RUBBER)
SLAB = gc.Stack(layers=(gc.Layer(RUBBER.material, 0.05),), base=gc.Rigid())
ONE_GRID = gc.contacts.DouglasRachford(coarsest=4096)  # of which all is compiled once


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


def press(surface, block=ELASTIC, velocity=0.0, rtol=1e-7, **given):
    return gc.slide(block, surface, velocity=velocity, rtol=rtol, solver=ONE_GRID, **given)


@pytest.mark.parametrize("radius", [0.2, 0.4])
def test_sphere_is_that_of_hertz(radius):
    """Radius, peak and approach a²/R; the stiffness 2E*a is that of the counted radius.

    At that approach the contact is the same one, and the load rises by this stiffness.
    """
    load, surface = 4 / 3 * REDUCED * radius**3, sphere(60)
    found = press(surface, pressure=load)
    low, back, high = (
        float(press(surface, approach=share * found.approach).contact.mean_pressure)
        for share in (0.99, 1.0, 1.01)
    )
    np.testing.assert_allclose(back, load, rtol=1e-6)
    contact_radius, peak = hertz_sphere(load, 1.0, REDUCED)[:2]
    np.testing.assert_allclose(contact_radius, radius)
    np.testing.assert_allclose(jnp.max(found.pressure), peak, rtol=6e-4)
    np.testing.assert_allclose(found.approach, radius**2, rtol=6e-4)
    np.testing.assert_allclose(found.contact_area, np.pi * radius**2, rtol=0.012)
    stiffness = (high - low) / (0.02 * float(found.approach))
    np.testing.assert_allclose(stiffness, 2 * REDUCED * radius, rtol=0.012)


def test_cylinder_is_that_of_hertz():
    """A line contact, whose constant in Green's function is arbitrary."""
    load = np.pi * REDUCED * 0.2**2 / 4
    half_width, peak = hertz_line(load, 1.0, REDUCED)[:2]
    np.testing.assert_allclose(half_width, 0.2)
    found = press(cylinder(256), pressure=load)
    true = hertz_pressure(distances(256), half_width, peak)
    assert np.sqrt(np.mean((found.pressure - true) ** 2) / np.mean(true**2)) < 4e-3


def test_flat_punch_ends_at_the_window():
    """p = F/(π √(a² - x²)) between the edges; its load on the rim is known."""
    n = 256
    surface = gc.Surface(np.zeros(n), gc.Grid((n,), 1.0), periodic=False)
    found = press(surface, pressure=1.0)
    x = (np.arange(n) + 0.5) / n * 2 - 1
    middle = slice(n // 8, -n // 8)
    true = 2 / np.pi / np.sqrt(1 - x**2)
    np.testing.assert_allclose(found.pressure[middle], true[middle], rtol=4.2e-3)
    assert found.contact_area == 1 and found.rim_load > 0.01


def test_energy_is_balanced_on_a_window():
    found = press(cylinder(128), COATED, 1.0, pressure=0.02)
    found.compute("energy_imbalance", "friction", "contact_area")
    assert found.energy_imbalance < 1e-12
    np.testing.assert_allclose(geometric_friction(found), found.friction, rtol=4e-3)
    np.testing.assert_allclose(jnp.mean(found.pressure), 0.02)
    np.testing.assert_allclose(jnp.mean(found.gap), found.mean_gap)


@pytest.mark.parametrize("heights", [cylinder(128).heights, jnp.zeros(128)])
def test_before_the_first_touch_there_is_no_load(heights):
    """Nor at it, where rounding would decide; the derivative is that from before it."""
    surface = gc.Surface(heights, gc.Grid((128,), 1.0), periodic=False)

    def numbers(approach):
        found = press(surface, SLAB, 1.0, approach=approach, throw=False)
        return found.contact.mean_pressure, found.friction, found.approach

    for approach in (-0.01, 0.0):
        (load, friction, back), slopes = jax.jvp(numbers, (approach,), (1.0,))
        assert load == 0 and np.isnan(friction)
        assert slopes[0] == 0 and np.isnan(slopes[1])
        np.testing.assert_allclose(back, approach, atol=1e-12)


def slab_compliance(q, modulus, poisson, thickness):
    """The surface compliance of a slab bonded to a rigid base, in closed form."""
    x, k = 2 * q * thickness, 3 - 4 * poisson
    # Over cosh x, which is large.
    cosh = np.cosh(np.minimum(x, 700))
    rest = (x**2 / 2 + 5 - 12 * poisson + 8 * poisson**2) / cosh
    return 2 * (1 - poisson**2) / modulus / q * (k * np.tanh(x) - x / cosh) / (k + rest)


@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_line_load_at_an_approach_is_that_of_integrals_in_closed_form(poisson):
    """A slab on a rigid base: Green's function by quadrature, uniform pressure on 400 strips."""
    depth, half, num = 0.01, 0.2, 400
    strip = 2 * half / num
    x = (np.arange(num) + 0.5) * strip - half
    step = 0.5
    q = np.arange(step / 2, 2e4, step)
    waves = slab_compliance(q, 1.0, poisson, 0.05) * np.sin(q * strip / 2) / q * step * 2 / np.pi
    row = np.array([np.sum(waves * np.cos(q * i * strip)) for i in range(num)])
    matrix = row[np.abs(np.subtract.outer(np.arange(num), np.arange(num)))]
    touching = np.ones(num, bool)
    for _ in range(100):
        pressure = np.zeros(num)
        sunk = (depth - x**2 / 2)[touching]
        pressure[touching] = np.linalg.solve(matrix[np.ix_(touching, touching)], sunk)
        before, touching = touching, touching & (pressure > 0)
        if np.array_equal(before, touching):
            break
    assert np.all(matrix @ pressure - depth + x**2 / 2 > -1e-9)
    slab = gc.Stack(layers=(gc.Layer(gc.Elastic(1.0, poisson), 0.05),), base=gc.Rigid())
    surface = cylinder(256)
    found = press(surface, slab, approach=depth)
    np.testing.assert_allclose(jnp.mean(found.pressure), np.sum(pressure) * strip, rtol=2e-3)
    back = press(surface, slab, pressure=jnp.mean(found.pressure))
    np.testing.assert_allclose(back.approach, depth, rtol=1e-6)
    np.testing.assert_allclose(back.friction, 0, atol=1e-12)


def test_moment_is_that_of_a_shifted_sphere():
    """Tilted by t a sphere of radius 1 has its highest point at x = t."""
    n, tilt = 60, 0.1
    x = (np.arange(n) - (n - 1) / 2) / n
    heights = -(x[:, None] ** 2 + x**2) / 2 + tilt * x[:, None]
    surface = gc.Surface(heights, gc.Grid((n, n), 1.0), periodic=False)
    pressure = press(surface, pressure=0.02).pressure
    np.testing.assert_allclose(jnp.mean(x[:, None] * pressure), 0.02 * tilt, rtol=2e-3)
    np.testing.assert_allclose(jnp.mean(x * pressure), 0, atol=1e-9)


def test_rough_body_is_that_in_a_large_periodic_cell():
    """By both the kernel of a window is checked: for a long cell the images of a line vanish."""
    n, cell, load = 128, 16, 0.02
    x, rng = distances(n), np.random.default_rng(3)
    heights = -(x**2) / 2
    for _ in range(12):
        heights = heights + 4e-4 * np.cos(rng.uniform(-40, 40) * x + rng.uniform(0, 6))
    around = np.full(cell * n, -1.0)
    around[:n] = heights
    window = gc.Surface(heights, gc.Grid((n,), 1.0), periodic=False)
    alone = gc.Surface(around, gc.Grid((cell * n,), float(cell)))
    found = press(window, COATED, 1.0, pressure=load)
    periodic = press(alone, COATED, 1.0, pressure=load / cell)
    for one in (found, periodic):
        one.compute("energy_imbalance", "friction", "contact_area")
    assert 0.01 < found.contact_area < 0.7
    np.testing.assert_allclose(periodic.friction, found.friction, rtol=5e-3)
    np.testing.assert_allclose(periodic.contact_area * cell, found.contact_area, rtol=2e-3)
