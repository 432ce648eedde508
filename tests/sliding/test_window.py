"""Contacts on a window against closed forms, larger windows and longer cells."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms import hertz_line, hertz_pressure, hertz_sphere

import graded_contact as gc
from graded_contact.core.display import with_error
from graded_contact.kernels import window

ELASTIC = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, 0.3)))
REDUCED = 1 / (1 - 0.3**2)
RUBBER = gc.HalfSpace(gc.Prony(1.0, [9.0], [0.1], 0.49))
COATED = gc.Stack(layers=(gc.Layer(gc.Elastic(3.0, 0.49), 0.05),), base=RUBBER)
SLAB = gc.Stack(layers=(gc.Layer(RUBBER.material, 0.05),), base=gc.Rigid())
PLAIN = gc.contacts.DouglasRachford(newton=False)  # compiles in half the time


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
    """Radius, peak and approach a²/R; the stiffness 2E*a is that of the counted radius.

    At that approach the contact is the same one, and the load rises by this stiffness.
    """
    load = 4 / 3 * REDUCED * radius**3
    surface = sphere(64)

    def press(**given):
        return gc.slide(ELASTIC, surface, velocity=0.0, rtol=1e-7, **given)

    found = press(pressure=load)
    assert found.warnings == ()  # first: this program computes all numbers
    back, stiffness = jax.value_and_grad(lambda d: press(approach=d).contact.mean_pressure)(
        found.approach
    )
    np.testing.assert_allclose(back, load, rtol=1e-6)
    assert found.approach_error < 1e-2 * found.approach
    contact_radius, peak = hertz_sphere(load, 1.0, REDUCED)[:2]
    np.testing.assert_allclose(contact_radius, radius)
    np.testing.assert_allclose(jnp.max(found.pressure), peak, rtol=6e-4)
    np.testing.assert_allclose(found.approach, radius**2, rtol=6e-4)
    np.testing.assert_allclose(found.contact_area, np.pi * radius**2, rtol=0.012)
    np.testing.assert_allclose(stiffness, 2 * REDUCED * radius, rtol=0.012)


def test_cylinder_is_that_of_hertz():
    """A line contact, whose constant in Green's function is arbitrary."""
    load = np.pi * REDUCED * 0.2**2 / 4
    half_width, peak = hertz_line(load, 1.0, REDUCED)[:2]
    np.testing.assert_allclose(half_width, 0.2)
    found = gc.slide(ELASTIC, cylinder(256), pressure=load, velocity=0.0, rtol=1e-8)
    true = hertz_pressure(distances(256), half_width, peak)
    assert np.sqrt(np.mean((found.pressure - true) ** 2) / np.mean(true**2)) < 4e-3


def test_flat_punch_ends_at_the_window():
    """p = F/(π √(a² - x²)) between the edges; its warning tells of the rim."""
    n = 256
    surface = gc.Surface(np.zeros(n), gc.Grid((n,), 1.0), periodic=False)
    found = gc.slide(ELASTIC, surface, pressure=1.0, velocity=0.0, rtol=1e-8)
    assert "rim of the window" in found.warnings[-1]
    x = (np.arange(n) + 0.5) / n * 2 - 1
    middle = slice(n // 8, -n // 8)
    true = 2 / np.pi / np.sqrt(1 - x**2)
    np.testing.assert_allclose(found.pressure[middle], true[middle], rtol=4.2e-3)
    assert found.contact_area == 1 and found.rim_load > 0.01


def test_energy_is_balanced_on_a_window(sliding):
    sliding.compute("energy_imbalance", "geometric_friction", "friction")
    assert sliding.energy_imbalance < 1e-12
    np.testing.assert_allclose(sliding.geometric_friction, sliding.friction, rtol=4e-3)
    assert sliding.pressure.shape == sliding.gap.shape == (64, 64)
    np.testing.assert_allclose(jnp.mean(sliding.pressure), 0.02)
    np.testing.assert_allclose(jnp.mean(sliding.gap), sliding.mean_gap)


@pytest.mark.parametrize("heights", [cylinder(64).heights, np.zeros(64)])
def test_before_the_first_touch_there_is_no_load(heights):
    """Nor at it, where rounding would decide; the derivative is that from before it."""
    surface = gc.Surface(heights, gc.Grid((64,), 1.0), periodic=False)

    def load(approach):
        return gc.slide(SLAB, surface, approach=approach, velocity=1.0).contact.mean_pressure

    assert jax.value_and_grad(load)(0.0) == (0, 0)
    found = gc.slide(SLAB, surface, approach=-0.01, velocity=1.0)
    assert found.warnings == (
        "The surfaces do not touch: there is no load, so friction is not defined.",
    )
    assert found.contact.mean_pressure == load(0.0) == 0
    np.testing.assert_allclose(found.approach, -0.01)

    def friction(approach, **how):
        return gc.slide(SLAB, surface, approach=approach, velocity=1.0, **how).friction

    for approach in (-0.01, 0.0):
        with pytest.raises(RuntimeError, match="Friction without a load has no derivative"):
            jax.grad(friction)(approach)
        assert np.all(np.isnan(jax.value_and_grad(partial(friction, throw=False))(approach)))


@pytest.mark.slow
def test_load_at_an_approach_has_the_error_of_the_kernel():
    found = gc.slide(COATED, sphere(64), approach=0.026, velocity=1.0, rtol=1e-8)
    printed = repr(found)
    larger = eqx.tree_at(lambda s: s.problem.kernel_error, found, 20 * found.problem.kernel_error)
    moved = found.kernel + jnp.sum(larger.problem.kernel_error, 0)
    load = gc.solve_contact(moved, found.heights, approach=0.026, rtol=1e-8).mean_pressure
    change = abs(load - found.mean_pressure)
    assert 1e-4 * load < change < larger.error_parts("mean_pressure")["kernel"] < 0.2 * load
    assert with_error(float(found.mean_pressure), float(found.mean_pressure_error)) in printed
    assert "  approach [m]             0.026\n" in printed
    pressed = gc.slide(COATED, sphere(64), pressure=found.mean_pressure, velocity=1.0)
    assert not hasattr(pressed, "mean_pressure_error")
    with pytest.raises(AttributeError, match="at a given `pressure`"):
        _ = pressed.mean_pressure_error


@pytest.mark.slow
def test_claims_at_an_approach_hold_against_larger_cells(monkeypatch):
    rng = np.random.default_rng(33)
    cases = []
    for _ in range(8):
        rubber = gc.Prony(1.0, [10 ** rng.uniform(0, 1.3)], [10 ** rng.uniform(-2, 0)], 0.45)
        coat, base = gc.Layer(gc.Elastic(3.0, 0.4), rng.uniform(0.03, 0.2)), gc.HalfSpace(rubber)
        cases.append((gc.Stack(layers=(coat,), base=base), 10 ** rng.uniform(-2.3, -1.5)))
    body = rough_patch(32, 2, 1)[0]

    def solved():
        return [gc.slide(b, body, approach=d, velocity=1.0, rtol=1e-8) for b, d in cases]

    def numbers(found):
        return np.array([(s.friction, s.contact_area, s.mean_pressure) for s in found])

    found = solved()
    names = "friction", "contact_area", "mean_pressure"
    parts = [[s.error_parts(name) for name in names] for s in found]
    claims = np.array([[one["kernel"] + one["solver"] for one in row] for row in parts])
    values = numbers(found)
    monkeypatch.setitem(window._WINDOWS, 2, 64)
    monkeypatch.setattr(window, "_POINTS", 64)
    jax.clear_caches()
    errors = np.abs(numbers(solved()) - values)
    jax.clear_caches()
    assert np.all(errors <= claims)
    assert np.all(np.median(claims / values, axis=0) < [0.02, 0.05, 0.02])


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
    found = gc.slide(slab, surface, approach=depth, velocity=0.0, rtol=1e-7)
    np.testing.assert_allclose(jnp.mean(found.pressure), np.sum(pressure) * strip, rtol=2e-3)
    back = gc.slide(slab, surface, pressure=jnp.mean(found.pressure), velocity=0.0, rtol=1e-7)
    np.testing.assert_allclose(back.approach, depth, rtol=1e-6)
    np.testing.assert_allclose(back.friction, 0, atol=1e-12)


def test_moment_is_that_of_a_shifted_sphere_and_vanishes_where_it_is_free_to_tilt():
    """Tilted by t a sphere of radius 1 has its highest point at x = t."""
    n, tilt = 64, 0.1
    x = (np.arange(n) - (n - 1) / 2) / n

    def pressed(angle, velocity=0.0, block=ELASTIC):
        heights = -(x[:, None] ** 2 + x**2) / 2 + angle * x[:, None]
        surface = gc.Surface(heights, gc.Grid((n, n), 1.0), periodic=False)
        return gc.slide(block, surface, pressure=0.02, velocity=velocity, rtol=1e-8)

    def moments(angle):
        pressure = pressed(angle).contact.pressure
        return jnp.mean(x[:, None] * pressure), jnp.mean(x * pressure)

    moment, slope = jax.value_and_grad(lambda t: moments(t)[0])(tilt)
    np.testing.assert_allclose(moment, 0.02 * tilt, rtol=2e-3)
    np.testing.assert_allclose(slope, 0.02, rtol=0.05)
    np.testing.assert_allclose(moments(tilt)[1], 0, atol=1e-12)


def attraction(tabor):
    """A law for a sphere of radius 1 on a half space, whose work is 1e-8 of R E*."""
    return gc.AdhesiveLJ((1e-16) ** (1 / 3) / tabor, 1e-8)


def test_stiff_sphere_is_pulled_off_by_two_pi_w_r():
    """The limit of Derjaguin, with the tail of the attraction beyond the window."""
    law, size = attraction(0.01), 0.4
    found = gc.slide(
        ELASTIC, sphere(32, size), approach=-law.range, velocity=0.0, law=law, rtol=1e-7
    )
    rigid = -2 * np.pi * 1e-8 / size**2
    np.testing.assert_allclose(found.contact.mean_pressure, rigid, rtol=0.01)
    np.testing.assert_allclose(found.approach, -law.range, rtol=1e-6)


@pytest.mark.slow
def test_soft_sphere_is_pulled_off_as_by_johnson_kendall_and_roberts():
    """-3/2 πwR, at Tabor's number 1.9; opening and closing are one curve up to the largest pull."""
    size, work = 0.6, 5.6e-4
    stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(0.75, 0.5)))  # E* = 1
    surface, law = sphere(64, size), gc.AdhesiveLJ(3.5e-3, work)
    kernel = gc.kernels.window_kernel(stack, surface.grid)
    depths = np.array([0.0, 0.004, 0.0, -0.004, -0.005, -0.006, -0.007, -0.008]) - law.range
    how, pressure, loads = dict(law=law, rtol=1e-5), None, []
    for depth in depths:
        found = gc.solve_contact(kernel, surface.heights, approach=depth, start=pressure, **how)
        pressure = found.pressure
        loads.append(found.mean_pressure)
    force = np.asarray(loads) * size**2 / (np.pi * work)
    np.testing.assert_allclose(force.min(), -1.5, rtol=0.06)
    np.testing.assert_allclose(force[0], force[2], rtol=1e-4)
    assert 3 < force.argmin() < 7


def rough_patch(n, ndim, cell):
    """A rough body on a window, and the same alone in a larger periodic cell."""
    x = distances(n)
    rng = np.random.default_rng(3)
    places = (x,) if ndim == 1 else (x[:, None], x)
    heights = -sum(place**2 for place in places) / 2
    for _ in range(12):
        waves, phase = rng.uniform(-40, 40, ndim), rng.uniform(0, 6)
        heights = heights + 4e-4 * np.cos(
            sum(q * x for q, x in zip(waves, places, strict=True)) + phase
        )
    around = np.full((cell * n,) * ndim, -1.0)
    around[(slice(0, n),) * ndim] = heights
    shapes = (n,) * ndim, (cell * n,) * ndim
    window, whole = gc.Grid(shapes[0], 1.0), gc.Grid(shapes[1], float(cell))
    return gc.Surface(heights, window, periodic=False), gc.Surface(around, whole)


@pytest.mark.slow
@pytest.mark.parametrize("n, ndim, cell", [(64, 1, 64), (48, 2, 8)])
def test_rough_body_is_that_in_a_large_periodic_cell(n, ndim, cell, monkeypatch):
    """Within the error that is reported for a Green's function from such a cell."""
    body, alone = rough_patch(n, ndim, cell)
    load = 0.02 if ndim == 1 else 0.005
    found = gc.slide(COATED, body, pressure=load, velocity=1.0, rtol=1e-6)
    periodic = gc.slide(COATED, alone, pressure=load / cell**ndim, velocity=1.0, rtol=1e-6)
    monkeypatch.setitem(window._WINDOWS, ndim, cell)
    jax.clear_caches()
    other = gc.slide(COATED, body, pressure=load, velocity=1.0, rtol=1e-6)
    error = other.error_parts("friction")["kernel"]
    jax.clear_caches()
    assert 0.01 < found.contact_area < 0.7
    assert found.error_parts("friction")["kernel"] < error
    assert abs(periodic.friction - found.friction) < error < 0.02 * found.friction
    area = periodic.contact_area * cell**ndim
    np.testing.assert_allclose(area, found.contact_area, rtol=2e-3)
