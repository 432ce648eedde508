"""Newton steps where the splitting alone took thousands: the solution obeys every condition."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc

N, CELL, HALF_WIDTH = 512, 16, 0.01
LENGTH = CELL * HALF_WIDTH
LOAD = np.pi / 4 * HALF_WIDTH**2 / LENGTH


def cylinder(contrast, speed):
    """A gliding cylinder, radius and relaxed reduced modulus 1."""
    rubber = gc.Prony.from_creep(contrast, [(contrast - 1) / contrast], [speed * HALF_WIDTH], 0.0)
    stack = gc.Stack(base=gc.HalfSpace(rubber))
    x = (np.arange(N) - N / 2) * LENGTH / N
    return gc.stack_kernel(stack, gc.Grid((N,), LENGTH), 1.0), jnp.asarray(-(x**2) / 2)


def solve(kernel, heights, load=LOAD):
    # One grid, so that little is compiled.
    solver = gc.contacts.DouglasRachford(coarsest=max(heights.shape))
    return gc.solve_contact(kernel, heights, load, rtol=1e-8, solver=solver)


def assert_solves(s, kernel, heights, load):
    """Signorini's conditions, which have one solution, by NumPy's transforms."""
    pressure, heights = np.asarray(s.pressure), np.asarray(heights)
    kernel = np.array(kernel)
    kernel.flat[0] = 0
    axes = range(heights.ndim)
    waves = kernel * np.fft.rfftn(pressure)
    gap = np.fft.irfftn(waves, heights.shape, axes) - heights
    held = pressure > 0
    gap -= np.mean(gap[held])
    assert np.all(pressure >= 0)
    np.testing.assert_allclose(np.mean(pressure), load, rtol=1e-12)
    scale = np.std(heights)
    assert np.max(np.abs(gap[held])) <= 1e-7 * scale
    assert np.min(gap[~held]) >= -1e-7 * scale


@pytest.mark.parametrize("speed", [0.1, 1.0, 10.0])
def test_cylinder_of_contrast_1000_converges(speed):
    kernel, heights = cylinder(1000.0, speed)
    s = solve(kernel, heights)
    assert_solves(s, kernel, heights, LOAD)
    assert s.num_fft_pairs <= 250


def test_derivatives_on_moduli_far_apart_are_found_and_match_differences():
    """Once not converged in 20,000 FFT pairs; on points that stay they are exact."""
    kernel, heights = cylinder(1e4, 1.0)
    weight = jnp.cos(jnp.arange(N))
    total = lambda load: jnp.vdot(weight, solve(kernel, heights, load).pressure)  # noqa: E731
    step = 1e-4 * LOAD
    expected = (total(LOAD + step) - total(LOAD - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(total)(LOAD), expected, rtol=1e-7)
