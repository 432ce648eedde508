import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.fields.grid import (
    Grid,
    derivative,
    half_shape,
    mode_numbers,
    nyquist_lines,
    resample_spectrum,
    to_field,
    wavenumber,
    wavevector,
)

SHAPES = [(9,), (8, 6), (7, 9)]
resampled_modes = jax.jit(resample_spectrum, static_argnums=(1, 2))


def _size(shape):
    return jnp.asarray([2e-3, 3e-3][: len(shape)])


def _full_wavevector(shape, size):
    """Components of every mode of the full plane, from numpy."""
    axes = [2 * np.pi * np.fft.fftfreq(n, d / n) for n, d in zip(shape, size, strict=True)]
    return np.meshgrid(*axes, indexing="ij")


def _band_limited(shape, highest, seed=0):
    """A sum of cosines below `highest` on each axis, as a function of the points per axis."""
    rng = np.random.default_rng(seed)
    terms = [
        (rng.integers(-highest, highest + 1, len(shape)), rng.normal(), rng.uniform(0, 6.28))
        for _ in range(12)
    ]

    def field(counts):
        x = np.meshgrid(*[np.arange(n) / n for n in counts], indexing="ij")
        return sum(
            a * np.cos(2 * np.pi * sum(int(k) * s for k, s in zip(ks, x, strict=True)) + phase)
            for ks, a, phase in terms
        )

    return field


@pytest.mark.parametrize("shape", SHAPES)
def test_wavevector_and_wavenumber_match_numpy(shape):
    grid = Grid(shape, _size(shape))
    full = _full_wavevector(shape, np.asarray(grid.size))
    half = tuple(slice(n) for n in half_shape(shape))
    for mine, theirs, k, n in zip(wavevector(grid), full, mode_numbers(shape), shape, strict=True):
        theirs = np.where(2 * np.abs(k) == n, np.abs(theirs[half]), theirs[half])  # ours: +n/2
        np.testing.assert_allclose(np.broadcast_to(mine, half_shape(shape)), theirs, rtol=1e-14)
    expected = np.sqrt(sum(q**2 for q in full))[half]
    np.testing.assert_allclose(wavenumber(grid), expected, rtol=1e-14)


def test_wavenumber_has_a_finite_derivative_with_respect_to_the_size():
    both = jax.jit(jax.value_and_grad(lambda size: jnp.sum(wavenumber(Grid((6, 8), size)))))
    size, step = np.array([2.0, 3.0]), 1e-6
    expected = [(both(size + d)[0] - both(size - d)[0]) / (2 * step) for d in step * np.eye(2)]
    np.testing.assert_allclose(both(size)[1], expected, rtol=1e-8)


@pytest.mark.parametrize("shape", [(15,), (12, 10)])
@pytest.mark.parametrize("axis", [0, -1])
def test_the_derivative_of_a_cosine_is_exact(shape, axis):
    grid = Grid(shape, _size(shape))
    axis %= grid.ndim
    k = 2 * np.pi * 3 / float(grid.size[axis])
    x = np.arange(shape[axis]) * float(grid.spacing[axis])
    x = x.reshape([-1 if i == axis else 1 for i in range(grid.ndim)])
    field = np.broadcast_to(np.cos(k * x + 0.3), shape)
    expected = np.broadcast_to(-k * np.sin(k * x + 0.3), shape)
    found = jax.jit(derivative, static_argnums=2)(field, grid, axis)
    np.testing.assert_allclose(found, expected, atol=1e-12 * k)


@pytest.mark.parametrize("shape", SHAPES)
def test_nyquist_lines_are_those_of_even_axes(shape):
    k = np.meshgrid(*[np.rint(np.fft.fftfreq(n, 1 / n)) for n in shape], indexing="ij")
    expected = np.zeros(shape, bool)
    for number, n in zip(k, shape, strict=True):
        expected |= 2 * np.abs(number) == n
    half = tuple(slice(n) for n in half_shape(shape))
    np.testing.assert_array_equal(nyquist_lines(shape), expected[half])


REFINEMENTS = [
    ((9,), (16,)), ((8, 9), (12, 11)), ((7, 9), (8, 10)), ((10, 8), (10, 15)),
]  # fmt: skip


@pytest.mark.parametrize(("coarse", "fine"), REFINEMENTS)
def test_refining_interpolates_a_band_limited_field(coarse, fine):
    field = _band_limited(coarse, 3)
    modes = resampled_modes(np.fft.rfftn(field(coarse)), coarse, fine)
    ratio = np.prod(fine) / np.prod(coarse)
    np.testing.assert_allclose(to_field(modes, fine) * ratio, field(fine), atol=1e-12)


@pytest.mark.parametrize(("coarse", "fine"), REFINEMENTS)
def test_coarsening_drops_the_waves_above_the_new_nyquist_number(coarse, fine):
    values = np.random.default_rng(3).normal(size=fine)
    cut = resampled_modes(np.fft.rfftn(values), fine, coarse)
    full = np.fft.fftn(values)
    index = np.ix_(*[k.ravel().astype(int) for k in mode_numbers(coarse)])
    inner = ~nyquist_lines(coarse) | (coarse == fine)
    np.testing.assert_allclose(np.asarray(cut)[inner], full[index][inner], atol=1e-12)
    for n, m, axis in zip(coarse, fine, range(len(coarse)), strict=True):
        if n == m and n % 2 == 0:
            continue
        line = np.take(np.asarray(cut), n // 2, axis) if n % 2 == 0 else np.zeros(1)
        np.testing.assert_array_equal(np.imag(line), 0)


@pytest.mark.parametrize("shape", [(8, 10), (5, 8)])
def test_a_coarsened_kernel_is_that_of_a_real_operator_alike_along_both_axes(shape):
    """Of a kernel that depends on the direction: both signs of a Nyquist number weigh alike."""
    fine = (16, 18)
    full = np.fft.fft2(np.random.default_rng(5).normal(size=fine))
    cut = resampled_modes(full[:, : fine[1] // 2 + 1], fine, shape)
    turned = resampled_modes(full.T[:, : fine[0] // 2 + 1], fine[::-1], shape[::-1])
    unit = np.eye(int(np.prod(shape))).reshape(-1, *shape)

    def columns(half, field, n):
        return np.fft.irfft2(half * np.fft.rfft2(field), n)

    plain = columns(np.asarray(cut), unit, shape)
    other = columns(np.asarray(turned), unit.swapaxes(1, 2), shape[::-1]).swapaxes(1, 2)
    np.testing.assert_allclose(plain, other, atol=1e-12)
    inverse = columns(1 / (1 + np.asarray(cut)), plain + unit, shape)
    np.testing.assert_allclose(inverse, unit, atol=1e-11)


def test_a_grid_has_one_or_two_dimensions_and_sizes():
    for shape, size, words in (((8, 8, 8), 1.0, "one or two"), ((8, 8), [1.0] * 3, "has shape")):
        with pytest.raises(ValueError, match=words):
            Grid(shape, size)
