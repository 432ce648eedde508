"""The kernel of a sliding stack as an operator on fields, in every direction of sliding."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc

SIZE = np.array([1e-2, 1.3e-2])
VELOCITIES = ([0.07, 0.07], [0.1, 0.05], [-0.2, 0.03], [0.0, 0.1], [0.1, 0.0])


def stack_of(times=(1e-2, 1e-4), temperature=293.15):
    rubber = gc.Prony(1e6, [9e6, 2e7], times, 0.49, gc.WLF(8.86, 101.6, 293.15))
    coat = gc.Layer(gc.Elastic(6.51e6, 0.49), 2e-3)
    return gc.Stack(layers=(coat,), base=gc.HalfSpace(rubber.at(temperature)))


def dense(half, shape):
    """The matrix that a half spectrum stands for, column by column from unit vectors."""
    unit = np.eye(int(np.prod(shape))).reshape(-1, *shape)
    fields = np.fft.irfftn(half * np.fft.rfftn(unit, axes=(1, 2)), shape, axes=(1, 2))
    return fields.reshape(len(unit), -1).T


def wave_by_wave(stack, shape, velocity):
    """The same from the compliance of all waves, both signs of a Nyquist number weighing half."""
    waves = [[(k, 1.0) for k in range(-((n - 1) // 2), (n + 1) // 2)] for n in shape]
    for axis, n in enumerate(shape):
        if n % 2 == 0:
            waves[axis] += [(n // 2, 0.5), (-n // 2, 0.5)]
    kx, ky = np.meshgrid(*[[k for k, _ in axis] for axis in waves], indexing="ij")
    weight = np.outer(*[[w for _, w in axis] for axis in waves])
    used = (kx != 0) | (ky != 0)
    kx, ky, weight = kx[used], ky[used], weight[used]
    q = 2 * np.pi * np.stack([kx, ky], -1) / SIZE
    m = np.asarray(gc.surface_compliance(stack, np.hypot(*q.T), -q @ velocity))
    nyquist = (2 * np.abs(kx) == shape[0]) | (2 * np.abs(ky) == shape[1])
    m = weight * np.where(nyquist, m.real, m)
    x, y = (k.ravel() for k in np.indices(shape))
    phase = 2j * np.pi * (np.outer(x, kx) / shape[0] + np.outer(y, ky) / shape[1])
    return np.exp(phase) @ (m[:, None] * np.exp(-phase).T) / len(x)


@pytest.mark.parametrize("shape", [(8, 6), (7, 5)])
def test_operator_is_real_that_of_all_waves_and_inverted_by_its_filter(shape):
    stack, grid = stack_of(), gc.Grid(shape, SIZE)
    for velocity in VELOCITIES:
        half = gc.stack_kernel(stack, grid, velocity)
        matrix, expected = dense(half, shape), wave_by_wave(stack, shape, velocity)
        size = np.max(np.abs(expected))
        assert np.max(np.abs(expected.imag)) <= 1e-14 * size
        np.testing.assert_allclose(matrix / size, expected.real / size, atol=1e-14)
        penalty = 30 / float(jnp.max(jnp.abs(half)))
        inverse = dense(1 / (1 + penalty * half), shape)
        unit = np.eye(len(matrix))
        np.testing.assert_allclose(inverse @ (unit + penalty * matrix), unit, atol=1e-13)
    # The last of them is along x, where a number takes another path.
    np.testing.assert_allclose(gc.stack_kernel(stack, grid, VELOCITIES[-1][0]), half, rtol=1e-15)


def test_derivatives_by_the_velocity_hold_alone_and_jointly():
    """Where q·v = 0 rounding leaves ω = ±1e-17, which recomputation may round another way."""
    grid = gc.Grid((12, 12), SIZE[0])
    weights = np.random.default_rng(0).normal(size=(2, 12, 7))

    @jax.jit
    def total(velocity, times, temperature):
        kernel = gc.stack_kernel(stack_of(times, temperature), grid, velocity) * 1e9
        return jnp.sum(weights[0] * kernel.real + weights[1] * kernel.imag)

    # Products and sums are fused, and so rounded in several ways, by the optimiser alone.
    @partial(jax.jit, compiler_options={"xla_backend_optimization_level": 3})
    def gradients(*arguments):
        return jax.grad(total)(*arguments), jax.grad(total, (0, 1, 2))(*arguments)

    for velocity in VELOCITIES:
        arguments = [jnp.array(velocity), jnp.array([1e-2, 1e-4]), jnp.array(293.15)]
        expected = []
        for i, value in enumerate(arguments):
            step = 1e-5 * float(jnp.max(value))
            moves = np.eye(value.size).reshape(-1, *value.shape) * step
            if i == 1:
                moves = moves * np.array([1, 1e-2])
            ends = [
                [float(total(*arguments[:i], value + s * m, *arguments[i + 1 :])) for s in (1, -1)]
                for m in moves
            ]
            slopes = [(a - b) / (2 * np.max(m)) for (a, b), m in zip(ends, moves, strict=True)]
            expected.append(np.reshape(slopes, value.shape))
        alone, jointly = gradients(*arguments)
        np.testing.assert_allclose(alone, jointly[0], rtol=1e-9)
        for slope, difference in zip(jointly, expected, strict=True):
            largest = np.max(np.abs(difference))
            np.testing.assert_allclose(slope, difference, rtol=1e-6, atol=1e-6 * largest)


def test_a_table_answers_waves_across_the_velocity_as_at_rest():
    """Their frequency, rounded to 1e-17 rad/s, is below every table."""
    table = gc.Tabulated([1.0, 1e4], [1e6 + 1e5j, 2e6 + 3e5j])
    stack = gc.Stack(base=gc.HalfSpace(table))
    kernel = np.asarray(gc.stack_kernel(stack, gc.Grid((32, 32), 1e-2), [0.1, 0.3]))
    k = np.arange(1, 6)  # 3 × 0.1 - 0.3 is 5.6e-17
    q = 2 * np.pi * np.hypot(3 * k, k) / 1e-2
    np.testing.assert_allclose(kernel[-3 * k, k], 2 * 0.75 / (1e6 * q), rtol=1e-14)
