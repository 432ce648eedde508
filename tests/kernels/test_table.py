"""Kernels interpolated from a table, against functions and stacks evaluated one by one."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.kernels import table as interpolation
from graded_contact.kernels.table import tabulate

HIGHEST = (300, 200)


def narrow(kx, ky, scale):
    """A function with a step in q."""
    q = jnp.sqrt(kx**2 + ky**2 + 1e-4)
    return jnp.log(1 / q + 1j * kx * scale / (1 + (q * scale) ** 4))


@partial(jax.jit, static_argnames="highest")
def compared(scale, highest=HIGHEST):
    """The error of a table, that it claims, and sums of squares: of the table, of the function."""
    table = tabulate(lambda kx, ky: narrow(kx, ky, scale), highest, np.dtype(float))
    kx, ky = (np.arange(n + 1) for n in highest)
    found, exact = table.along_x(kx, table.along_y(ky)), narrow(kx[:, None], ky, scale)
    sums = [jnp.sum(jnp.abs(values) ** 2) for values in (found, exact)]
    return jnp.max(jnp.abs(found - exact)), table.error, jnp.stack(sums)


def test_table_knows_its_error_and_is_differentiable():
    error, claim, _ = compared(0.05)
    assert error <= 1e-6
    assert error <= claim <= 30 * error
    by_table, by_function = jax.jacfwd(lambda scale: compared(scale)[2])(0.05)
    np.testing.assert_allclose(by_table, by_function, rtol=1e-7)


def test_a_table_of_many_wavenumbers_has_nodes_enough():
    error, claim, _ = compared(0.05, highest=(4096, 8))
    assert error <= claim <= 1e-6


def test_table_of_what_it_cannot_resolve_says_so():
    @jax.jit
    def error(scale):
        rough = lambda kx, ky: scale * jnp.sin(5 * kx) + ky  # noqa: E731
        return tabulate(rough, HIGHEST, np.dtype(float)).error

    assert error(1.0) > 0.1
    assert not error(jnp.nan) <= 1e-6


SOFT, TREAD = gc.Prony(1e6, [9e6], [1e-4], 0.48), gc.tyre_tread()
MANY = [SOFT if i % 2 else gc.Elastic(2e6 * (1 + i), 0.3) for i in range(8)]
LONG = gc.Stack(
    layers=[gc.Layer(material, 2e-4 * (1 + i)) for i, material in enumerate(MANY)],
    base=gc.HalfSpace(TREAD),
)
GRID = gc.Grid((256, 202), (0.1, 0.08))
SPEED = 0.7


def one_by_one(stack, index_x, index_y):
    qx = 2 * np.pi * index_x / 0.1
    q = np.hypot(qx, 2 * np.pi * index_y / 0.08)
    return np.asarray(gc.surface_compliance(stack, q, -qx * SPEED))


def test_kernel_of_a_dear_stack_is_that_of_single_wavevectors():
    stack, rtol = LONG, 1e-9
    kernel = np.asarray(gc.stack_kernel(stack, GRID, SPEED))
    index_x, index_y = (
        np.array(k) for k in [(0, 1, 5, 0, 77, 127, 31, 2), (1, 0, 3, 90, 0, 99, 60, 1)]
    )
    expected = one_by_one(stack, index_x, index_y)
    np.testing.assert_allclose(kernel[index_x, index_y], expected, rtol=rtol)
    np.testing.assert_allclose(kernel[-index_x, index_y], np.conj(expected), rtol=rtol)
    assert kernel[0, 0] == 0
    assert not kernel[128].imag.any()
    assert not kernel[:, 101].imag.any()


@pytest.mark.parametrize("compiled", [lambda function: function, jax.jit])
def test_a_table_that_falls_short_gives_way_to_direct_evaluation(compiled, monkeypatch):
    sharp = dataclasses.replace(LONG, graded_solver=gc.response.Layering(rtol=1e-13))
    monkeypatch.setattr(interpolation, "NODES", 32)
    kernel = np.asarray(compiled(lambda stack: gc.stack_kernel(stack, GRID, SPEED))(sharp))
    k = np.arange(1, 100)
    np.testing.assert_allclose(kernel[k, k], one_by_one(LONG, k, k), rtol=3e-14)
