"""Derivatives of a contact against central differences of converged solutions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, SPEED, rough

import graded_contact as gc

GRID = gc.Grid((32, 32), 1.0)
HEIGHTS = rough(GRID, cut=4).heights
WEIGHTS = jnp.asarray(np.random.default_rng(0).normal(size=(32, 32)))


def observe(kernel, heights, load):
    """A number that weighs every pressure and gap."""
    s = gc.solve_contact(kernel, heights, load, rtol=1e-11)
    return jnp.mean(WEIGHTS * (s.pressure / 0.05 + jnp.sin(20 * s.gap))) + s.mean_gap


@pytest.mark.parametrize("name", ["elastic", "coated"])
def test_derivatives_match_central_differences(name):
    kernel = gc.stack_kernel(BODIES[name], GRID, SPEED)
    load = jnp.asarray(0.05)
    rng = np.random.default_rng(5)
    real = kernel.real * rng.normal(size=kernel.shape) * 0.3
    d_kernel = real if name == "elastic" else real + 1j * kernel.imag
    d_heights = jnp.asarray(rng.normal(size=HEIGHTS.shape)) * 0.01
    d_load = jnp.asarray(0.03)
    directions = {
        "kernel": (d_kernel, jnp.zeros_like(HEIGHTS), jnp.zeros_like(load)),
        "heights": (jnp.zeros_like(kernel), d_heights, jnp.zeros_like(load)),
        "load": (jnp.zeros_like(kernel), jnp.zeros_like(HEIGHTS), d_load),
    }
    point = (kernel, HEIGHTS, load)
    gradient = jax.jit(jax.grad(observe, (0, 1, 2)))(*point)
    along = jax.jit(lambda point, tangent: jax.jvp(observe, point, tangent)[1])
    at = jax.jit(observe)
    for label, direction in directions.items():
        step = 1e-6
        ends = [
            at(*(x + sign * step * d for x, d in zip(point, direction, strict=True)))
            for sign in (1, -1)
        ]
        difference = float(ends[0] - ends[1]) / (2 * step)
        forward = float(along(point, direction))
        # JAX's cotangent of a complex input is the conjugate gradient.
        reverse = sum(
            float(jnp.sum((g * d).real)) for g, d in zip(gradient, direction, strict=True)
        )
        assert difference != 0
        np.testing.assert_allclose(forward, difference, rtol=1e-5, err_msg=label)
        np.testing.assert_allclose(reverse, forward, rtol=1e-7, err_msg=label)


def test_mean_pressure_follows_the_load_exactly():
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    mean = lambda p: jnp.mean(gc.solve_contact(kernel, HEIGHTS, p).pressure)  # noqa: E731
    np.testing.assert_allclose(jax.grad(mean)(0.05), 1.0, rtol=1e-12)


def test_raising_the_surface_as_a_whole_changes_nothing():
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    shifted = lambda c: jnp.sum(WEIGHTS * gc.solve_contact(kernel, HEIGHTS + c, 0.05).pressure)  # noqa: E731
    assert abs(jax.grad(shifted)(0.0)) <= 1e-9


def test_derivative_that_does_not_converge_raises():
    kernel = gc.stack_kernel(BODIES["bare"], GRID, SPEED)
    best = gc.solve_contact(kernel, HEIGHTS, 0.05, rtol=1e-8).pressure
    solver = gc.DouglasRachford(max_steps=4)

    def total(h):
        s = gc.solve_contact(kernel, h, 0.05, solver=solver, start=best, rtol=1e-6)
        return jnp.sum(WEIGHTS * s.pressure)

    with pytest.raises(RuntimeError, match="linear solve for a derivative"):
        jax.grad(total)(HEIGHTS)
