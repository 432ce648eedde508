"""Traction that moves the surface: closed form, dense matrices, energy, other laws, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rough

import graded_contact as gc
from graded_contact.fields.frequency import direction_and_speed
from graded_contact.fields.grid import multiplicity, nyquist_lines, wavevector, zero_mode
from graded_contact.kernels.tangential import tangential_kernels
from graded_contact.sliding import AbstractShear, Coulomb

CELL = 4e-3  # m
Q0 = 2 * np.pi / CELL
ROAD, LINE = rough((16, 16), CELL), rough((32,), CELL)
COAT = gc.Layer(gc.Elastic(8e6, 0.4), 1e-4)
BLOCK = gc.Stack(layers=(COAT,), base=gc.HalfSpace(gc.Prony(1e6, [4e6], [1e-3], 0.2)))
LOAD = 5e4


class Proportional(AbstractShear):
    """Coulomb's law, without telling that it is."""

    coefficient: jax.Array
    coupled: bool = True

    def __call__(self, pressure, speed, temperature):
        return self.coefficient * pressure


def rub(shear, velocity=0.3, stack=BLOCK, surface=ROAD, **how):
    how = {"pressure": LOAD, "rtol": 1e-9} | how
    return gc.slide(stack, surface, velocity=velocity, shear=shear, **how)


def compliances(grid, velocity):
    """C at the waves of a grid, where they are waves, and ω."""
    components = [*wavevector(grid), 0.0][:2]
    qx, qy = (np.broadcast_to(q, zero_mode(grid.shape).shape) for q in components)
    v = np.append(np.atleast_1d(velocity), 0.0)[:2]
    omega, zero = -(qx * v[0] + qy * v[1]), np.asarray(zero_mode(grid.shape))
    matrix = gc.surface_compliance_matrix(BLOCK, np.where(zero, 1.0, qx), qy, omega)
    kept = ~(zero | np.asarray(nyquist_lines(grid.shape)))
    return np.asarray(matrix), kept, omega


def test_sliding_parabola_has_its_closed_form():
    """p ∝ (a - x)^(1/2+γ) (a + x)^(1/2-γ) about -2γa, tan πγ = f (1-2ν)/(2-2ν), R = 1."""
    num, size, load = 128, 0.08, 2e-4
    x = (np.arange(num) + 0.5) * size / num - size / 2
    surface = gc.Surface(-(x**2) / 2, gc.Grid((num,), size), periodic=False)
    # Without coarser grids and Newton steps.
    solver = gc.contacts.DouglasRachford(coarsest=4096, newton=False)
    for poisson, friction in ((0.0, 1.0), (0.3, 0.7)):
        stack = gc.Stack(base=gc.HalfSpace(gc.Elastic(1.0, poisson)))
        s = rub(Coulomb(friction), 1.0, stack, surface, pressure=load / size, solver=solver)
        s.compute("contact_area", "friction", "block_friction")
        gamma = np.arctan(friction * (1 - 2 * poisson) / (2 - 2 * poisson)) / np.pi
        half_width = np.sqrt(4 * load * (1 - poisson**2) / np.pi / (1 - 4 * gamma**2))
        np.testing.assert_allclose(s.contact_area * size / 2, half_width, rtol=6e-3)
        centroid = np.sum(x * s.pressure) / np.sum(s.pressure)
        np.testing.assert_allclose(centroid, -8 / 3 * gamma * half_width, rtol=6e-3)
        # The pressure's moment equals the slopes', and an elastic block loses nothing.
        np.testing.assert_allclose(s.friction, friction - 8 / 3 * gamma * half_width, atol=1e-4)
        np.testing.assert_allclose(s.block_friction, 0, atol=1e-12)


def test_kernels_are_entries_of_the_matrix():
    velocity = [0.3, -0.2]
    grid, v = gc.Grid((8, 7), CELL), jnp.asarray(velocity)
    direction = direction_and_speed(v)[0]
    kernels = jax.jit(lambda v: tangential_kernels(BLOCK, grid, v, direction))
    (lift,), ((along,),), good = kernels(v)
    matrix, kept, _ = compliances(grid, velocity)
    e = np.zeros(3)
    e[: len(direction)] = direction
    scale = 1e-12 * np.max(np.abs(matrix[kept]))
    np.testing.assert_allclose(lift[kept], (matrix @ e)[kept][:, 2], atol=scale)
    np.testing.assert_allclose(along[kept], (e @ (matrix @ e)[..., None])[kept][:, 0], atol=scale)
    # Reciprocal: a pressure moves the surface along e by the opposite.
    np.testing.assert_allclose(lift[kept], -(e @ matrix[..., 2, None])[kept][:, 0], atol=scale)
    assert np.all(lift[~kept] == 0) and good


def test_contact_obeys_its_conditions_with_a_dense_matrix():
    s = rub(Coulomb(0.8), surface=LINE)
    matrix, kept, _ = compliances(LINE.grid, 0.3)
    kernel = np.where(kept, matrix[:, 2, 2] + 0.8 * matrix[:, 2, 0], matrix[:, 2, 2].real)
    kernel[0] = 0
    one = np.fft.irfft(kernel, 32)
    dense = np.stack([np.roll(one, i) for i in range(32)], axis=1)
    gap = dense @ np.asarray(s.pressure) - LINE.heights
    touching = np.asarray(s.pressure) > 0
    gap = gap - np.mean(gap[touching])
    np.testing.assert_allclose(gap[touching], 0, atol=1e-6 * np.std(LINE.heights))
    assert 2 < np.sum(touching) < 20 and np.all(gap[~touching] > 0)


def test_force_is_what_the_block_and_the_interface_lose():
    velocity, f = [0.2, -0.2], 0.8
    s = rub(Coulomb(f), velocity)
    parts = "friction", "block_friction", "interface_friction"
    s.compute(*parts, "pressure_friction", "energy_imbalance")
    matrix, kept, omega = compliances(ROAD.grid, velocity)
    load = np.append(f * np.append(np.atleast_1d(velocity), 0.0)[:2] / s.speed, 1.0)
    lost = -omega * np.imag(np.einsum("i,...ij,j->...", load, matrix, load))
    waves = np.abs(np.fft.rfftn(s.pressure) / s.pressure.size) ** 2 * multiplicity((16, 16))
    lost = np.sum(np.where(kept, lost * waves, 0)) / (LOAD * s.speed)
    np.testing.assert_allclose(s.block_friction, lost, rtol=1e-3)  # the rest is on Nyquist lines
    np.testing.assert_allclose(s.block_friction + s.interface_friction, s.friction, rtol=1e-12)
    assert s.energy_imbalance < 1e-12


def test_without_friction_nothing_changes():
    alone, none = rub(None, surface=LINE), rub(Coulomb(0.0), surface=LINE)
    np.testing.assert_array_equal(none.pressure, alone.pressure)
    np.testing.assert_allclose(none.block_friction, alone.friction, rtol=1e-12)


def test_lagged_traction_of_a_proportional_law_is_that_of_the_kernel():
    law = Proportional(jnp.asarray(0.8))
    s, expected = rub(law, surface=LINE), rub(Coulomb(0.8), surface=LINE)
    scale = 1e-6 * np.max(expected.pressure)
    np.testing.assert_allclose(s.pressure, expected.pressure, atol=scale)
    np.testing.assert_allclose(s.block_friction, expected.block_friction, rtol=1e-5)
    np.testing.assert_allclose(s.displacement, expected.displacement, atol=1e-6 * np.ptp(s.gap))
    assert s.energy_imbalance < 1e-12
    assert s.num_fft_pairs > expected.num_fft_pairs  # of all contacts


def active_set(kernel, heights, load):
    """The pressures of a periodic cell or a window, by dense matrices; from full contact and less.

    All solutions that are found from five sets of contact.
    """
    n, cell = heights.shape, np.array(heights.shape) * (1 if len(kernel) == len(heights) else 2)
    kernel = np.asarray(kernel).copy()
    kernel[0, 0] = 0
    green = np.fft.irfftn(kernel, cell, axes=(0, 1))
    i, j = np.indices(n).reshape(2, -1)
    matrix = green[(i[:, None] - i) % cell[0], (j[:, None] - j) % cell[1]]
    h, num, found = heights.ravel(), heights.size, []
    for share in (0.0, 0.2, 0.5, 0.8, 0.95):
        inside, before = h >= np.quantile(h, share), None
        while not np.array_equal(inside, before):
            before, (at,) = inside, np.nonzero(inside)
            bordered = np.ones((len(at) + 1, len(at) + 1))
            bordered[:-1, :-1], bordered[-1, -1] = matrix[np.ix_(at, at)], 0
            *pressed, offset = np.linalg.solve(bordered, np.append(h[at], load * num))
            pressure = np.zeros(num)
            pressure[at] = pressed
            gap = matrix @ pressure - h + offset
            inside = np.where(inside, pressure > 0, gap < -1e-12 * np.ptp(h))
        found.append(pressure.reshape(n))
    return found


THIN = gc.Stack(layers=(gc.Layer(gc.Prony(1e6, [9e6], [1e-3], 0.5), 2e-4),), base=gc.Rigid())


@pytest.mark.parametrize("periodic", [True, False])
def test_contact_is_that_of_active_sets_where_traction_outweighs_waves(periodic):
    """A bonded layer, and a window that cuts Green's function of a half space of high contrast."""
    if periodic:
        found = rub(Coulomb(0.5), 0.1, THIN)
    else:
        x = (np.arange(16) + 0.5) * CELL / 16 - CELL / 2
        body = gc.Surface(-(x[:, None] ** 2 + x**2) / 0.02, ROAD.grid, periodic=False)
        half_space = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [3e7], [1.2e-3], 0.2)))
        found = rub(Coulomb(0.9), (0.4, -0.2), half_space, body)
    kernel = np.asarray(found.operator.kernel)
    assert np.sum(kernel.real.ravel()[1:] < 0) > 0
    for expected in active_set(kernel, np.asarray(found.heights), LOAD):
        np.testing.assert_allclose(found.pressure, expected, atol=1e-7 * np.max(expected))
    assert np.sum(expected > 0) >= 4 and found.energy_imbalance < 1e-9
