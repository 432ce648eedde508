"""Pressures on a known set of points, found in whichever way, are those of NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.contacts.active_set import Coated, pressure_on
from graded_contact.contacts.operator import Steady

SHAPE = (24, 20)
LOAD = 0.3
RNG = np.random.default_rng(3)


def kernel():
    """That of a lossy half space: not symmetric, 1 + 2i times softer where waves are long."""
    q = np.hypot.outer(np.fft.fftfreq(24) * 24, np.arange(11))
    q[0, 0] = 1
    k = (1 + 2j * np.sign(np.fft.fftfreq(24) + 1e-9)[:, None] * (q < 5)) / q
    k[0, 0] = 0
    # A real field's spectrum is real where a wave is its own mirror image.
    return np.fft.rfft2(np.fft.irfft2(k, SHAPE))


def by_numpy(green, coat, heights, held):
    """The pressures, from one dense system of them and of the constant c."""
    where = np.argwhere(held)
    apart = (where[:, None] - where) % np.array(SHAPE)
    n = len(where)
    system = np.ones((n + 1, n + 1))
    system[:n, :n] = green[apart[..., 0], apart[..., 1]] + coat * np.eye(n)
    system[n, n] = 0
    found = np.linalg.solve(system, [*heights[held], LOAD * held.size])
    pressure = np.zeros(SHAPE)
    pressure[held] = found[:n]
    return pressure


find = jax.jit(pressure_on)


@pytest.mark.parametrize(("count", "tolerance"), [(1, 1e-12), (100, 1e-10), (300, 1e-6)])
@pytest.mark.parametrize("coat", [0.0, 0.2])
def test_pressure_on_few_or_many_points_is_that_of_numpy(count, tolerance, coat):
    held = np.zeros(SHAPE, bool)
    held.flat[RNG.permutation(held.size)[:count]] = True
    heights = RNG.standard_normal(SHAPE)
    heights -= heights.mean()
    k = kernel()
    green = np.fft.irfft2(k, SHAPE)
    expected = by_numpy(green, coat, heights, held)
    solid = Coated(Steady(jnp.asarray(k)), *map(jnp.asarray, (green, coat, heights, LOAD)))
    begin = jnp.full(SHAPE, LOAD)
    pressure, gap, _, pairs = find(
        jnp.asarray(held), solid, begin, jnp.asarray(1e-9), jnp.asarray(True), jnp.asarray(1000)
    )
    scale = np.linalg.norm(expected)
    assert np.linalg.norm(pressure - expected) <= tolerance * scale
    coated = k + np.where(np.arange(k.size).reshape(k.shape) == 0, 0, coat)
    opened = np.fft.irfft2(coated * np.fft.rfft2(expected), SHAPE) - heights
    opened -= opened[held].mean()
    assert np.linalg.norm(gap - opened) <= 10 * tolerance * np.linalg.norm(opened)
    assert (pairs == 1) == (count <= 128)
