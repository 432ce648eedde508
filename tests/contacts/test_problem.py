import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, SPEED
from oracles import dense_contact, dense_operator

import graded_contact as gc

# Every contact is on one plane or on one line, with complex kernels: each is one program.
PLANE, LINE = gc.Grid((9, 9), 1.0), gc.Grid((64,), 1.0)
NESTED = gc.contacts.DouglasRachford(coarsest=16)


def on_plane(name):
    """Kernel and heights of noise."""
    kernel = np.asarray(gc.stack_kernel(BODIES[name], PLANE, SPEED)) + 0j
    return kernel, np.random.default_rng(1).normal(size=PLANE.shape) * 0.05


def solve(kernel, heights, load=None, *, rtol=1e-10, hardness=None, **how):
    law = gc.HardWall(hardness=hardness)
    return gc.solve_contact(kernel, heights, load, law=law, rtol=rtol, **how)


@pytest.mark.parametrize("load", [0.02, 0.2])
@pytest.mark.parametrize("name", ["elastic", "coated"])
def test_pressure_matches_a_dense_complementarity_solve(name, load):
    """Symmetric and, sliding, nonsymmetric."""
    kernel, heights = on_plane(name)
    expected = dense_contact(kernel, heights, load)
    found = solve(kernel, heights, load, hardness=1e9)
    np.testing.assert_array_equal(found.pressure > 0, expected > 0)
    np.testing.assert_allclose(found.pressure, expected, atol=1e-8 * expected.max())
    np.testing.assert_allclose(np.mean(found.pressure), load, rtol=1e-13)
    assert np.min(found.gap) >= -1e-7 * np.std(heights)
    assert np.mean(np.abs(found.pressure * found.gap)) <= 1e-7 * load * np.std(heights)
    assert 4 <= found.num_fft_pairs - found.num_steps <= 6


@pytest.mark.parametrize("name", ["elastic", "coated"])
def test_hardness_matches_a_dense_solve_with_both_bounds_and_so_does_its_mean_gap(name):
    """The same points flow, touch and stand apart; a third of the load is beyond the hardness."""
    kernel, heights = on_plane(name)
    hardness = 0.4 * dense_contact(kernel, heights, 0.2).max()
    expected = dense_contact(kernel, heights, 0.2, hardness)
    found = solve(kernel, heights, 0.2, hardness=hardness)
    np.testing.assert_allclose(found.pressure, expected, atol=1e-8 * hardness)
    flowing = expected >= hardness * (1 - 1e-10)
    assert np.any(flowing)
    np.testing.assert_array_equal(found.pressure >= hardness * (1 - 1e-10), flowing)
    gap = np.asarray(found.gap)
    assert np.max(gap[flowing]) <= 1e-8  # the depth of the flow
    np.testing.assert_allclose(np.mean(found.pressure), 0.2, rtol=1e-12)
    assert np.min(gap[~flowing]) >= -1e-7 * np.std(heights)
    by_gap = solve(kernel, heights, mean_gap=float(np.mean(gap)), hardness=hardness)
    np.testing.assert_allclose(by_gap.mean_gap, found.mean_gap, rtol=1e-7)
    np.testing.assert_allclose(by_gap.mean_pressure, 0.2, rtol=1e-6)
    np.testing.assert_allclose(by_gap.pressure, expected, atol=1e-6 * hardness)
    np.testing.assert_allclose(by_gap.gap, gap, atol=1e-7 * np.ptp(heights))


def test_surfaces_held_apart_do_not_touch():
    kernel, heights = on_plane("coated")
    apart = 1.01 * float(np.max(heights - np.mean(heights)))
    s = solve(kernel, heights, mean_gap=apart, hardness=1e9)
    np.testing.assert_array_equal(s.pressure, 0)
    np.testing.assert_allclose(s.gap, apart - (heights - np.mean(heights)), rtol=1e-12)


@pytest.mark.parametrize("seed", [0, 1])
def test_nearly_full_contact_of_ridges_does_not_stall(seed):
    """With a penalty for the shorter period, steps wandered without end."""
    n = 9
    q = np.hypot(20 * np.fft.fftfreq(n, 1 / n)[:, None], np.arange(n // 2 + 1))
    q[0, 0] = np.inf
    heights = np.random.default_rng(seed).normal(size=(n, n))
    heights = np.fft.irfft2(np.fft.rfft2(heights) * q**-1.8, s=(n, n))
    stiffness = q * (1 + q / 10) ** 2
    stiffness[0, 0] = 0
    load = -0.99 * np.fft.irfft2(np.fft.rfft2(heights) * stiffness, s=(n, n)).min()
    kernel = 1 / q / (1 + q / 10) ** 2 + 0j
    found = solve(kernel, heights, load, rtol=1e-9, hardness=1e9)
    exact = dense_contact(kernel, heights, load)
    assert 0.98 < np.mean(exact > 0) < 1 and found.num_fft_pairs <= 150
    np.testing.assert_allclose(found.pressure, exact, atol=1e-8 * exact.max())
    gap = float(found.mean_gap)
    again = solve(kernel, heights, mean_gap=gap, rtol=5e-5, hardness=1e9)
    np.testing.assert_allclose(again.pressure, exact, atol=1e-6 * exact.max())
    assert again.num_fft_pairs <= 12


def sheet(closed):
    """Kernel, heights and load of a free bilayer thin beside the cell, near full contact."""
    layers = gc.Layer(gc.Elastic(1.0, 0.49), 3e-3), gc.Layer(gc.Elastic(30.0, 0.3), 3e-3)
    kernel = np.array(gc.stack_kernel(gc.Stack(layers=layers, base=gc.Free()), LINE)) + 0j
    return kernel, coated()[1], -closed * full_pressure(kernel).min()


def full_pressure(kernel):
    """What flattens the heights where everything touches: a division mode by mode."""
    stiffness = np.append(0, 1 / kernel[1:])
    return np.fft.irfft(np.fft.rfft(coated()[1]) * stiffness, 64)


@functools.cache
def coated():
    """Kernel and heights on the line."""
    q = 2 * np.pi
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=q, q_roll=4 * q, q_high=8 * q)
    heights = gc.random_surface(spectrum, LINE, jax.random.key(0)).heights
    return np.array(gc.stack_kernel(BODIES["coated"], LINE, SPEED)), np.asarray(heights)


@pytest.mark.parametrize("closed", [None, 0.3, 0.5, 0.9])
def test_gaps_match_a_dense_complementarity_solve_within_their_stated_error(closed):
    """A sheet's contrast is 1e6: M σ of a pressure good to 1e-3 would be off by many heights."""
    kernel, heights, load = (*coated(), 0.1) if closed is None else sheet(closed)
    pressure = dense_contact(kernel, heights, load)
    gap = dense_operator(kernel, LINE.shape) @ pressure - (heights - heights.mean())
    gap = gap - np.sum(gap * pressure) / np.sum(pressure)
    for rtol in (1e-3, 1e-5):
        found = solve(kernel, heights, load, rtol=rtol, solver=NESTED)
        assert found.result == gc.contacts.RESULTS.successful
        # The mean and what varies are no larger than the whole.
        assert np.sqrt(np.mean((found.gap - gap) ** 2)) <= found.gap_error * np.std(heights)
        assert found.gap_error <= 0.1 and np.min(found.gap) >= -0.1 * np.std(heights)
        np.testing.assert_allclose(found.mean_gap, np.mean(found.gap), rtol=1e-9)


def test_solve_whose_gaps_are_worth_nothing_says_so():
    found = solve(*sheet(0.3), rtol=0.3, throw=False, solver=NESTED)
    assert found.result == gc.contacts.RESULTS.gap_unresolved
    assert found.gap_error > 0.1
    assert found.error <= 0.3


def test_nesting_does_not_change_the_solution_and_counts_the_transforms_of_all_grids():
    nested = solve(*coated(), 0.05, rtol=1e-9, solver=NESTED)
    expected = dense_contact(*coated(), 0.05)
    np.testing.assert_allclose(nested.pressure, expected, atol=1e-7 * np.max(expected))
    assert nested.num_fft_pairs > nested.num_steps + 4


def test_full_contact_is_found_at_once():
    exact = full_pressure(coated()[0])
    exact = exact - 1.1 * exact.min()
    found = solve(*coated(), float(np.mean(exact)), rtol=5e-5, solver=NESTED)
    np.testing.assert_allclose(found.pressure, exact, atol=1e-12 * exact.max())
    assert found.num_fft_pairs <= 12


def test_the_more_precise_field_decides_and_an_error_hidden_by_rounding_is_reported():
    """In two precisions the noise of one would pass for a residual of the other, without end."""
    kernel, heights = on_plane("bare")
    kernel = kernel.astype(np.complex64)
    expected = dense_contact(kernel.astype(complex), heights, 0.02)
    for dtype, rtol in ((jnp.float32, 1e-3), (jnp.float64, 1e-4), (jnp.float32, 2e-5)):
        s = solve(kernel, heights.astype(dtype), 0.02, rtol=rtol, throw=False)
        assert s.pressure.dtype == s.mean_gap.dtype == s.error.dtype == dtype
        atol = max(rtol, float(s.error)) * expected.max()
        np.testing.assert_allclose(s.pressure, expected, atol=atol)
        assert (s.result == gc.contacts.RESULTS.rounding) == (rtol == 2e-5) == (s.error > rtol)


def test_repulsive_law_goes_to_the_hard_wall_in_proportion_to_its_range():
    """The mean gap at first order in ε; pressure nearly so."""
    rms, ranges, rows = float(np.std(coated()[1])), np.array([0.1, 0.01, 0.001]), []
    hard = solve(*coated(), 0.05, rtol=1e-9, solver=NESTED)
    for share in ranges:
        law = gc.RepulsiveLJ(share * rms, 0.05)
        s = gc.solve_contact(*coated(), 0.05, law=law, rtol=1e-9)
        off = np.linalg.norm(s.pressure - hard.pressure) / np.linalg.norm(hard.pressure)
        rows.append([(s.mean_gap - hard.mean_gap) / rms, off])
    of_gap, of_pressure = np.array(rows).T
    np.testing.assert_allclose(of_gap / ranges, of_gap[0] / ranges[0], rtol=0.02)
    assert np.all(np.log10(of_pressure[:-1] / of_pressure[1:]) > 0.9)
    assert of_pressure[-1] < 1e-3
    touching = law.contact_indicator(s.pressure, s.gap, 1.0) > 0
    assert abs(np.mean(touching) - np.mean(hard.pressure > 0)) <= 2 / LINE.shape[0]
