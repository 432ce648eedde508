import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES

import graded_contact as gc

N = 64
KERNEL = gc.stack_kernel(BODIES["elastic"], gc.Grid((N,), 1.0)).real
WAVE = 0.01 * np.cos(2 * np.pi * np.arange(N) / N)


def test_path_of_pressures_gives_what_single_solves_give():
    loads = np.array([0.002, 0.01, 0.02, 0.01])
    path = gc.contacts.follow_contact(KERNEL, WAVE, loads, law=gc.HardWall(), rtol=1e-8)
    np.testing.assert_allclose(path.mean_pressure, loads, rtol=1e-12)
    np.testing.assert_array_equal(path.unloading, [False, False, False, True])
    assert np.all(path.result == gc.contacts.RESULTS.successful)
    for load, gap, area in zip(loads, path.mean_gap, path.contact_area, strict=True):
        s = gc.solve_contact(KERNEL, WAVE, load, rtol=1e-8)
        np.testing.assert_allclose(gap, s.mean_gap, rtol=1e-6)
        assert area == np.mean(s.pressure > 0)
    np.testing.assert_allclose(path.last.pressure, s.pressure, atol=1e-6 * loads[-1])
    assert path.num_fft_pairs[1] > 0


@pytest.mark.slow
def test_derivative_along_a_path_is_that_of_its_last_contact():
    """The start of a solve carries no derivative; what is prescribed does."""

    def work(gaps):
        path = gc.contacts.follow_contact(KERNEL, WAVE, mean_gap=gaps, law=gc.HardWall(), rtol=1e-9)
        return path.mean_pressure[-1]

    gaps = jnp.array([0.008, 0.004])
    slope = jax.jit(jax.grad(work))(gaps)
    step = 1e-7
    at = lambda gap: gc.solve_contact(KERNEL, WAVE, mean_gap=gap, rtol=1e-11).mean_pressure  # noqa: E731
    assert slope[0] == 0
    np.testing.assert_allclose(
        slope[1], (at(0.004 + step) - at(0.004 - step)) / (2 * step), rtol=1e-5
    )
