import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, SPEED, rough

import graded_contact as gc
from graded_contact import reference
from graded_contact.contact import observables

GRID = gc.Grid((64, 64), 1.0)


def solved(name, velocity=SPEED, load=0.05, grid=GRID):
    surface = rough(grid)
    kernel = gc.stack_kernel(BODIES[name], grid, velocity)
    return surface, kernel, gc.solve_contact(kernel, surface.heights, load, rtol=1e-9)


@pytest.mark.parametrize("velocity", [SPEED, np.array([0.06, -0.08])])
def test_work_of_friction_is_the_dissipation_in_the_block(body, velocity):
    velocity = jnp.asarray(velocity)
    surface = rough(GRID)
    kernel = gc.stack_kernel(body, GRID, velocity)
    s = gc.solve_contact(kernel, surface.heights, 0.05)
    mu = observables.friction(s.pressure, s.displacement, GRID, velocity)
    lost = jnp.sum(observables.dissipation(s.pressure, kernel, GRID, velocity))
    speed = float(jnp.linalg.norm(jnp.atleast_1d(velocity)))
    np.testing.assert_allclose(mu * 0.05 * speed, lost, rtol=1e-12, atol=1e-17)
    balance = observables.energy_imbalance(s.pressure, s.displacement, kernel, GRID, velocity)
    assert balance <= 1e-14


def test_dissipation_is_never_negative_in_any_mode(body):
    surface = rough(GRID)
    kernel = gc.stack_kernel(body, GRID, SPEED)
    s = gc.solve_contact(kernel, surface.heights, 0.05)
    assert jnp.min(observables.dissipation(s.pressure, kernel, GRID, SPEED)) >= 0


def test_slopes_of_surface_and_block_give_the_same_friction_on_fine_grids():
    differences = []
    for n in (64, 128):
        grid = gc.Grid((n, n), 1.0)
        surface = gc.surface.resample(rough(GRID), (n, n))
        kernel = gc.stack_kernel(BODIES["bare"], grid, SPEED)
        s = gc.solve_contact(kernel, surface.heights, 0.05)
        mu = observables.friction(s.pressure, s.displacement, grid, SPEED)
        differences.append(
            abs(observables.friction(s.pressure, surface.heights, grid, SPEED) / mu - 1)
        )
    assert differences[1] < 0.5 * differences[0]
    assert differences[1] < 0.01


def test_friction_at_rest_is_zero():
    _, _, s = solved("bare", velocity=0.0)
    assert abs(observables.friction(s.pressure, s.displacement, GRID, 0.0)) <= 1e-14


def test_area_of_a_disc_is_exact_below_the_pixel():
    """A signed field that falls linearly from a circle's edge, of many sizes and centres."""
    n, rng = 64, np.random.default_rng(0)
    kernel = jnp.ones((n, n // 2 + 1))
    x = np.arange(n)
    for radius in rng.uniform(5, 20, 8):
        centre = n / 2 + rng.uniform(0, 1, 2)
        field = radius - np.hypot(x[:, None] - centre[0], x - centre[1])
        smooth = observables.contact_area_smooth(
            jnp.maximum(field, 0), jnp.maximum(-field, 0), jnp.asarray(field > 0), kernel
        )
        offset = observables._CONTOUR_OFFSET * 2 * np.pi * radius
        expected = (np.pi * radius**2 - offset) / n**2
        perimeter = 2 * np.pi * radius
        assert abs(float(smooth) - expected) * n**2 <= 0.03 * perimeter


def test_smooth_area_of_a_wave_follows_westergaard_between_pixels():
    """The pixel count of a line stands still where the smooth area follows the load."""
    n, amplitude = 256, 1e-3
    grid = gc.Grid((n, 4), (1.0, 4 / n))
    kernel = gc.stack_kernel(BODIES["elastic"], grid)
    wave = np.broadcast_to(amplitude * np.cos(2 * np.pi * np.arange(n) / n)[:, None], (n, 4))
    full = np.pi * amplitude
    errors = []
    for fraction in np.linspace(0.4, 0.4 + 4 / n, 9):
        load = full * np.sin(np.pi * fraction / 2) ** 2
        s = gc.solve_contact(kernel, wave, load, rtol=1e-8)
        area = observables.contact_area_smooth(s.pressure, s.gap, s.pressure > 0, kernel)
        errors.append(float(area) - fraction)
    assert np.max(np.abs(errors)) <= 0.1 / n


def test_smooth_area_converges_faster_than_the_pixel_count():
    areas = {}
    for n in (64, 256):
        grid = gc.Grid((n, n), 1.0)
        surface = gc.surface.resample(rough(GRID), (n, n))
        kernel = gc.stack_kernel(BODIES["bare"], grid, SPEED)
        s = gc.solve_contact(kernel, surface.heights, 0.2)
        contact = s.pressure > 0
        areas[n] = (
            observables.contact_area(contact),
            observables.contact_area_corrected(contact),
            observables.contact_area_smooth(s.pressure, s.gap, contact, kernel),
        )
    best = areas[256][2]
    count, corrected, smooth = (abs(float(a - best)) for a in areas[64])
    assert smooth < 0.2 * count
    assert corrected < 0.2 * count


def test_full_contact_has_area_one_and_none_has_area_zero():
    kernel, gap = jnp.ones((16, 9)), jnp.zeros((16, 16))
    everywhere = jnp.ones((16, 16), bool)
    assert observables.contact_area_smooth(gap + 1, gap, everywhere, kernel) == 1
    assert observables.contact_area_smooth(gap, gap + 1, ~everywhere, kernel) == 0
    assert observables.contact_area_corrected(everywhere) == 1


def test_smooth_area_has_finite_gradients_at_corners_of_contact():
    """One point alone in contact, with zero pressure, touches every guard of the contour."""
    kernel, gap = jnp.ones((8, 5)), jnp.ones((8, 8)).at[4, 4].set(0)
    contact = jnp.zeros((8, 8), bool).at[4, 4].set(True)
    slope = jax.grad(
        lambda p, u: observables.contact_area_smooth(p, u, contact, kernel), argnums=(0, 1)
    )(jnp.zeros((8, 8)), gap)
    assert all(np.all(np.isfinite(s)) for s in slope)


@pytest.mark.parametrize("name", ["bare", "coated", "three layers"])
def test_full_contact_friction_is_exact_for_one_cosine(name):
    """V12, with the compliance at the wave's own frequency."""
    stack, q, amplitude, load = BODIES[name], 2 * np.pi * 3, 1e-3, 10.0
    x = np.arange(32) / 32
    heights = np.broadcast_to(amplitude * np.cos(q * x)[:, None], (32, 32))
    kernel = gc.stack_kernel(stack, gc.Grid((32, 32), 1.0), SPEED)
    s = gc.solve_contact(kernel, heights, load, rtol=1e-11)
    mu = observables.friction(s.pressure, s.displacement, gc.Grid((32, 32), 1.0), SPEED)
    compliance = complex(gc.surface_compliance(stack, q, q * SPEED))
    expected = q * amplitude**2 * (1 / compliance).imag / (2 * load)
    assert expected > 0
    np.testing.assert_allclose(mu, expected, rtol=1e-10)
    if name == "bare":
        # The closed form knows E, and none of our response.
        e = 0.75 + 0.75 * 9 * 1j * q * SPEED / (1 + 1j * q * SPEED)
        closed = reference.full_contact_friction(amplitude, q, 2 / (q * e / 0.75), load)
        np.testing.assert_allclose(mu, closed, rtol=1e-10)


@pytest.mark.parametrize("name", ["bare", "coated", "three layers"])
@pytest.mark.parametrize("velocity", [SPEED, (0.06, -0.08)])
def test_full_contact_friction_is_exact_for_a_rough_surface(name, velocity):
    """V12: p(q) = h(q)/M(q, -q·v), summed over the full plane by plain NumPy."""
    surface = rough(GRID, rms_slope=0.05)
    v = np.array([SPEED, 0.0]) if np.ndim(velocity) == 0 else np.array(velocity)
    k = np.fft.fftfreq(64, 1 / 64)
    qx, qy = np.meshgrid(2 * np.pi * k, 2 * np.pi * k, indexing="ij")
    q = np.hypot(qx, qy)
    spectrum = np.fft.fft2(surface.heights) / 64**2
    used = np.abs(spectrum) > 1e-12 * np.max(np.abs(spectrum))
    used[0, 0] = False
    omega = -(qx * v[0] + qy * v[1])
    compliance = np.asarray(gc.surface_compliance(BODIES[name], q[used], omega[used]))
    pressure = spectrum[used] / compliance
    speed = np.linalg.norm(v)
    force = -np.sum(np.conj(pressure) * 1j * (-omega[used] / speed) * spectrum[used]).real
    field = np.zeros((64, 64), complex)
    field[used] = pressure
    load = -1.2 * np.min(np.fft.ifft2(field).real) * 64**2
    kernel = gc.stack_kernel(BODIES[name], GRID, velocity)
    s = gc.solve_contact(kernel, surface.heights, load, rtol=1e-11)
    mu = observables.friction(s.pressure, s.displacement, GRID, jnp.asarray(velocity))
    geometric = observables.friction(s.pressure, surface.heights, GRID, jnp.asarray(velocity))
    assert force > 0
    np.testing.assert_allclose(mu, force / load, rtol=1e-10)
    np.testing.assert_allclose(geometric, force / load, rtol=1e-9)


def test_area_corrected_takes_a_known_share_of_each_edge_pixel():
    """V10: 0.118114 of a pixel for each of the 4·8 edges of a square of 8."""
    contact = jnp.zeros((32, 32), bool).at[4:12, 4:12].set(True)
    excess = 64 / 32**2 - observables.contact_area_corrected(contact)
    np.testing.assert_allclose(excess, 32 * 0.118114 / 32**2, rtol=1e-5)
