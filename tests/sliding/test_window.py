"""Lines on a window against closed forms and longer cells; spheres are in `test_published.py`."""

import jax
import jax.numpy as jnp
import numpy as np

import graded_contact as gc

RUBBER = gc.Prony(1.0, [9.0], [0.1], 0.49)
ONE_GRID = gc.contacts.DouglasRachford(coarsest=4096, newton=False)  # of which all is compiled once
N = 128  # points of all lines: blocks of a coat on a half space share programs


def elastic(modulus, poisson):
    return gc.Prony(modulus, [1e-12 * modulus], [1.0], poisson)


def coated(coat, base):
    return gc.Stack(layers=(gc.Layer(coat, 0.05),), base=gc.HalfSpace(base))


ELASTIC, COATED = coated(elastic(1.0, 0.3), elastic(1.0, 0.3)), coated(elastic(3.0, 0.49), RUBBER)


def slab(material):
    return gc.Stack(layers=(gc.Layer(material, 0.05),), base=gc.Rigid())


def distances(n, size=1.0):
    """From the middle of a window, which is a point."""
    return (np.arange(n) - n / 2) * (size / n)


def line(heights):
    return gc.Surface(heights, gc.Grid((N,), 1.0), periodic=False)


CYLINDER = line(-(distances(N) ** 2) / 2)


def press(surface, block=ELASTIC, rtol=1e-7, **given):
    return gc.slide(block, surface, velocity=1.0, rtol=rtol, solver=ONE_GRID, **given)


def test_flat_punch_ends_at_the_window():
    """p = F/(π √(a² - x²)) between the edges; its load on the rim is known."""
    found = press(line(np.zeros(N)), pressure=1.0)
    x = (np.arange(N) + 0.5) / N * 2 - 1
    middle = slice(N // 8, -N // 8)
    true = 2 / np.pi / np.sqrt(1 - x**2)
    np.testing.assert_allclose(found.pressure[middle], true[middle], rtol=1e-2)  # 4e-3 with 256
    assert found.contact_area == 1 and found.rim_load > 0.01


def test_before_the_first_touch_there_is_no_load():
    """Nor at it, where rounding would decide; the derivative is that from before it."""

    @jax.jit
    def numbers(heights, approach):
        def at(approach):
            found = press(line(heights), slab(RUBBER), approach=approach, throw=False)
            return found.contact.mean_pressure, found.friction, found.approach

        return jax.jvp(at, (approach,), (1.0,))

    for heights in (CYLINDER.heights, np.zeros(N)):
        for approach in (-0.01, 0.0):
            (load, friction, back), slopes = numbers(heights, approach)
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


def test_line_load_at_an_approach_is_that_of_integrals_in_closed_form():
    """A slab on a rigid base: Green's function by quadrature, uniform pressure on 400 strips."""
    depth, half, num = 0.01, 0.2, 400
    strip = 2 * half / num
    x = (np.arange(num) + 0.5) * strip - half
    step = 0.5
    q = np.arange(step / 2, 2e4, step)
    for poisson in (0.3, 0.5):
        waves = (
            slab_compliance(q, 1.0, poisson, 0.05) * np.sin(q * strip / 2) / q * step * 2 / np.pi
        )
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
        block = slab(elastic(1.0, poisson))
        found = press(CYLINDER, block, approach=depth)
        load = jnp.mean(found.pressure)
        np.testing.assert_allclose(load, np.sum(pressure) * strip, rtol=2e-3)
        back = press(CYLINDER, block, pressure=load)
        np.testing.assert_allclose(back.approach, depth, rtol=1e-6)
        np.testing.assert_allclose(back.friction, 0, atol=1e-9)


def test_rough_body_is_that_in_a_large_periodic_cell_and_energy_is_balanced():
    """By both the kernel of a window is checked: for a long cell the images of a line vanish."""
    cell, load = 16, 0.02
    x, rng = distances(N), np.random.default_rng(3)
    heights = -(x**2) / 2
    for _ in range(12):
        heights = heights + 4e-4 * np.cos(rng.uniform(-40, 40) * x + rng.uniform(0, 6))
    around = np.full(cell * N, -1.0)
    around[:N] = heights
    found = press(line(heights), COATED, pressure=load)
    alone = gc.Surface(around, gc.Grid((cell * N,), float(cell)))
    periodic = press(alone, COATED, pressure=load / cell)
    for one in (found, periodic):
        one.compute("energy_imbalance", "friction", "contact_area")
    assert 0.01 < found.contact_area < 0.7
    np.testing.assert_allclose(periodic.friction, found.friction, rtol=5e-3)
    np.testing.assert_allclose(periodic.contact_area * cell, found.contact_area, rtol=2e-3)
    assert found.energy_imbalance < 1e-12
    np.testing.assert_allclose(jnp.mean(found.pressure), load)
    np.testing.assert_allclose(jnp.mean(found.gap), found.mean_gap)
