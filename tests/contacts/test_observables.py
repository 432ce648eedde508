import closed_forms
import jax
import jax.numpy as jnp
import numpy as np
from conftest import BODIES, SPEED
from oracles import rough

import graded_contact as gc
from graded_contact.contacts import area as area_of
from graded_contact.contacts.operators.operator import Steady
from graded_contact.sliding.energy import losses
from graded_contact.sliding.numbers.friction import geometric_friction
from graded_contact.sliding.problem import SteadyProblem

N = 32
GRID = gc.Grid((N, N), 1.0)
# Every contact of waves on the plane is this program.
PLAIN = {"rtol": 1e-11, "solver": gc.contacts.DouglasRachford(coarsest=N, newton=False)}


def sliding(contact, kernel, heights, velocity=SPEED, grid=GRID):
    """The result of a contact of which only the kernel is known."""
    given = {"heights": jnp.asarray(heights), "velocity": jnp.asarray(velocity), "grid": grid}
    return gc.Sliding(contact, SteadyProblem(operator=Steady(kernel), law=gc.HardWall(), **given))


def test_smooth_area_of_a_wave_follows_westergaard_between_pixels():
    """The pixel count of a line stands still where the area follows the load."""
    n, amplitude = 256, 1e-3
    grid = gc.Grid((n,), 1.0)
    kernel = gc.stack_kernel(BODIES["elastic"], grid)
    x = np.arange(n) / n
    wave = amplitude * np.cos(2 * np.pi * x)
    full = np.pi * amplitude
    errors = []
    for fraction in np.linspace(0.4, 0.4 + 4 / n, 9):
        load = full * np.sin(np.pi * fraction / 2) ** 2
        s = gc.solve_contact(kernel, wave, load, rtol=1e-8)
        area = sliding(s, kernel, wave, grid=grid).contact_area
        errors.append(float(area) - fraction)
        exact = closed_forms.westergaard_pressure(x, load, amplitude, 1.0, 1.0)
        # Within 5e-3 on 512 points: the edge of contact is known to a spacing.
        assert np.mean(np.abs(s.pressure - exact)) <= 1e-2 * load
    assert np.max(np.abs(errors)) <= 0.15 / n


def test_smooth_area_is_exact_at_its_ends_and_has_finite_gradients_at_corners_of_contact():
    """One point alone in contact, with zero pressure, touches every guard."""

    @jax.jit
    @jax.value_and_grad
    def area(excess):
        flat = area_of.cuts_of(jnp.zeros((16, 16)), True)
        return area_of.sub_pixel_area(excess, area_of.Edges(jnp.array(0.1), flat))

    everywhere = np.ones((16, 16))
    assert area(everywhere)[0] == 1 and area(-everywhere)[0] == 0
    alone = -everywhere
    alone[4, 4] = 0
    for excess in (alone, 0 * everywhere):
        assert np.all(np.isfinite(area(excess)[1]))


def test_full_contact_friction_is_exact_for_a_rough_surface():
    """V12: p(q) = h(q)/M(q, -q·v), summed over the full plane by plain NumPy."""
    surface, v = rough(GRID.shape, 1.0, rms_slope=0.05), np.array([0.06, -0.08])
    name = "three layers"
    k = np.fft.fftfreq(N, 1 / N)
    qx, qy = np.meshgrid(2 * np.pi * k, 2 * np.pi * k, indexing="ij")
    q = np.hypot(qx, qy)
    spectrum = np.fft.fft2(surface.heights) / N**2
    used = np.abs(spectrum) > 1e-12 * np.max(np.abs(spectrum))
    used[0, 0] = False
    omega = -(qx * v[0] + qy * v[1])
    compliance = np.asarray(gc.surface_compliance(BODIES[name], q[used], omega[used]))
    pressure = spectrum[used] / compliance
    speed = np.linalg.norm(v)
    force = -np.sum(np.conj(pressure) * 1j * (-omega[used] / speed) * spectrum[used]).real
    field = np.zeros((N, N), complex)
    field[used] = pressure
    load = -1.2 * np.min(np.fft.ifft2(field).real) * N**2
    kernel = gc.stack_kernel(BODIES[name], GRID, v)
    contact = gc.solve_contact(kernel, surface.heights, load, **PLAIN)
    s = sliding(contact, kernel, surface.heights, v)
    assert force > 0
    np.testing.assert_allclose(s.friction, force / load, rtol=1e-10)
    np.testing.assert_allclose(jax.jit(geometric_friction)(s), force / load, rtol=1e-9)


def test_friction_of_all_waves_is_the_friction_and_the_dissipation():
    velocity = np.array([0.06, -0.08])
    kernel = gc.stack_kernel(BODIES["three layers"], GRID, velocity)
    heights = rough(GRID.shape, 1.0).heights
    s = sliding(gc.solve_contact(kernel, heights, 0.05, **PLAIN), kernel, heights, velocity)
    total = s.friction

    (by_mode,) = losses(s)
    assert np.min(by_mode) >= 0
    speed = np.linalg.norm(velocity)
    np.testing.assert_allclose(total * 0.05 * speed, np.sum(by_mode), rtol=1e-12, atol=1e-17)
    assert s.energy_imbalance <= 1e-14

    curve = gc.sliding.cumulative_friction(s)
    q, mu = curve.cutoff, curve.friction
    np.testing.assert_allclose(mu[-1], total, rtol=1e-12, atol=1e-17)
    assert np.all(np.diff(mu, prepend=0) >= -1e-15)
    np.testing.assert_allclose(
        np.asarray(q)[[0, -1]], 2 * np.pi * np.array([1, np.hypot(N / 2, N / 2)])
    )


def test_friction_of_two_waves_in_full_contact_rises_in_their_two_steps():
    """V12, wave by wave: μ = q a² Im(1/M)/(2σ0) at q = 2π·3 and at |q| = 2π·5 along x and y."""
    load, waves = 10.0, {(3, 0): 1e-3, (3, 4): 5e-4}
    x = np.arange(N) / N
    heights = sum(a * np.cos(2 * np.pi * (m * x[:, None] + n * x)) for (m, n), a in waves.items())
    velocity = jnp.array([SPEED, 0.0])
    kernel = gc.stack_kernel(BODIES["bare"], GRID, velocity)
    s = gc.solve_contact(kernel, heights, load, **PLAIN)
    curve = gc.sliding.cumulative_friction(sliding(s, kernel, heights, velocity))
    q, mu = np.asarray(curve.cutoff), np.asarray(curve.friction)
    expected = 0.0
    for (m, n), a in waves.items():
        qx, size = 2 * np.pi * m, 2 * np.pi * np.hypot(m, n)
        before = mu[q < size * (1 - 1e-9)][-1]
        np.testing.assert_allclose(before, expected, rtol=1e-9, atol=1e-12)
        compliance = complex(gc.surface_compliance(BODIES["bare"], size, qx * SPEED))
        expected += qx * a**2 * (1 / compliance).imag / (2 * load)
        np.testing.assert_allclose(mu[q > size][0], expected, rtol=1e-9)
