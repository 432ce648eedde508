"""Transforms bound from ducc0 against XLA's: values, derivatives, batches, loops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from graded_contact.fields import transforms as _fft

needs_ducc = pytest.mark.skipif(not _fft._is_installed(), reason="the extra fast-cpu is absent")
SHAPES = [(16, 12), (15, 9), (8, 7), (20,), (9,)]


@pytest.fixture
def bound(monkeypatch):
    """Fields of any size go through ducc0."""
    monkeypatch.setattr(_fft, "BOUND_FROM", 0)


def field(shape, dtype=float):
    return jnp.asarray(np.random.default_rng(0).normal(size=shape), dtype)


@needs_ducc
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_transforms_are_those_of_xla(bound, shape, dtype):
    x = field(shape, dtype)
    spectrum = _fft.rfftn(x)
    tolerance = 1e2 * jnp.finfo(dtype).eps
    assert spectrum.dtype == jnp.fft.rfftn(x).dtype
    np.testing.assert_allclose(spectrum, jnp.fft.rfftn(x), atol=tolerance)
    back = _fft.irfftn(spectrum, shape)
    assert back.dtype == dtype
    np.testing.assert_allclose(back, x, atol=tolerance)


@needs_ducc
@pytest.mark.parametrize("shape", SHAPES)
def test_derivatives_are_those_of_xla(bound, shape):
    x, w = field(shape), field(shape)[::-1]
    kernel = jnp.fft.rfftn(field(shape) + 1)

    def total(forward, inverse):
        def run(x, kernel):
            spectrum = forward(x)
            return jnp.sum(w * inverse(kernel * spectrum, shape)) + jnp.sum(jnp.abs(spectrum) ** 2)

        return jax.grad(run, (0, 1))

    ours = total(_fft.rfftn, _fft.irfftn)(x, kernel)
    theirs = total(jnp.fft.rfftn, jnp.fft.irfftn)(x, kernel)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-11)
    check_grads(lambda x: _fft.irfftn(kernel * _fft.rfftn(jnp.asarray(x)), shape), (x,), 2)
