import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, LAWS, SPEED, rough
from oracles import dense_contact, dense_operator

import graded_contact as gc
from graded_contact.contacts.operators.operator import Steady
from graded_contact.sliding.problem import SteadyProblem

# Most contacts are on one plane and one line, with complex kernels: each is one program.
PLANE, LINE = gc.Grid((15, 10), 1.0), gc.Grid((64,), 1.0)

NESTED = gc.contacts.DouglasRachford(coarsest=16)


def half_space(grid):
    return gc.stack_kernel(BODIES["elastic"], grid)


def on_plane(name):
    """Kernel and heights of noise."""
    kernel = gc.stack_kernel(BODIES[name], PLANE, SPEED) + 0j
    return kernel, np.random.default_rng(1).normal(size=PLANE.shape) * 0.05


def on_line():
    return gc.stack_kernel(BODIES["coated"], LINE, SPEED), rough(LINE).heights


@pytest.mark.parametrize("load", [0.02, 0.2])
@pytest.mark.parametrize("name", ["elastic", "coated"])
def test_pressure_matches_a_dense_complementarity_solve(name, load):
    """Symmetric and, sliding, nonsymmetric."""
    kernel, heights = on_plane(name)
    expected = dense_contact(np.asarray(kernel), heights, load)
    found = gc.solve_contact(kernel, heights, load, rtol=1e-10)
    np.testing.assert_array_equal(found.pressure > 0, expected > 0)
    np.testing.assert_allclose(found.pressure, expected, atol=1e-8 * expected.max())
    np.testing.assert_allclose(np.mean(found.pressure), load, rtol=1e-13)
    assert np.min(found.gap) >= -1e-7 * np.std(heights)
    assert np.mean(np.abs(found.pressure * found.gap)) <= 1e-7 * load * np.std(heights)


def sheet(grid, closed):
    """Kernel, heights and load of a free bilayer thin beside the cell, near full contact."""
    layers = gc.Layer(gc.Elastic(1.0, 0.49), 3e-3), gc.Layer(gc.Elastic(30.0, 0.3), 3e-3)
    kernel = gc.stack_kernel(gc.Stack(layers=layers, base=gc.Free()), grid) + 0j
    heights = rough(grid).heights
    spectrum = jnp.fft.rfftn(heights) / kernel.at[(0,) * grid.ndim].set(np.inf)
    return kernel, heights, -closed * jnp.fft.irfftn(spectrum, grid.shape).min()


@pytest.mark.parametrize("closed", [None, 0.3, 0.5, 0.9])
def test_gaps_match_a_dense_complementarity_solve_within_their_stated_error(closed):
    """A sheet's contrast is 1e6: M σ of a pressure good to 1e-3 would be off by many heights."""
    kernel, heights, load = (*on_line(), 0.1) if closed is None else sheet(LINE, closed)
    pressure = dense_contact(np.asarray(kernel), np.asarray(heights), load)
    gap = dense_operator(np.asarray(kernel), LINE.shape) @ pressure - (heights - heights.mean())
    gap = gap - np.sum(gap * pressure) / np.sum(pressure)
    for rtol in (1e-3, 1e-5):
        found = gc.solve_contact(kernel, heights, load, rtol=rtol)
        assert found.result == gc.contacts.RESULTS.successful
        # The mean and what varies are no larger than the whole.
        assert np.sqrt(np.mean((found.gap - gap) ** 2)) <= found.gap_error * np.std(heights)
        assert found.gap_error <= 0.1 and np.min(found.gap) >= -0.1 * np.std(heights)
        np.testing.assert_allclose(found.mean_gap, np.mean(found.gap), rtol=1e-9)


def test_solve_whose_gaps_are_worth_nothing_says_so():
    found = gc.solve_contact(*sheet(LINE, 0.3), rtol=0.3, throw=False)
    assert found.result == gc.contacts.RESULTS.gap_unresolved
    assert found.gap_error > 0.1
    assert found.error <= 0.3


def test_double_sinusoid_meets_its_light_and_heavy_limits():
    """V9, Johnson, Greenwood & Higginson 1985."""
    n, amplitude = 128, 1e-3
    grid = gc.Grid((n, n), 1.0)
    x = np.arange(n) / n
    wave = amplitude * np.cos(2 * np.pi * x)[:, None] * np.cos(2 * np.pi * x)
    full = np.sqrt(2) * np.pi * amplitude
    for ratio, expected, atol in (
        (0.002, np.pi * (3 * 0.002 / (8 * np.pi)) ** (2 / 3), 5e-4),
        (0.98, 1 - 3 / (2 * np.pi) * 0.02, 1e-3),
    ):
        s = gc.solve_contact(half_space(grid), wave, ratio * full)
        problem = SteadyProblem(
            operator=Steady(half_space(grid)), heights=jnp.asarray(wave), grid=grid,
            law=gc.HardWall(), velocity=jnp.zeros(()),
        )  # fmt: skip
        found = gc.Sliding(s, problem)
        area = found.contact_area
        assert abs(float(area) - expected) <= atol


def test_nesting_does_not_change_the_solution_and_counts_the_transforms_of_all_grids():
    nested = gc.solve_contact(*on_line(), 0.05, solver=NESTED, rtol=1e-9)
    flat = gc.solve_contact(*on_line(), 0.05, rtol=1e-11)  # 64 points: one grid
    np.testing.assert_allclose(nested.pressure, flat.pressure, atol=1e-7 * np.max(flat.pressure))
    assert nested.num_fft_pairs > nested.num_steps + 4
    assert flat.num_fft_pairs == flat.num_steps + 4


def test_the_more_precise_field_decides_and_an_error_hidden_by_rounding_is_reported():
    """In two precisions the noise of one would pass for a residual of the other, without end."""
    kernel, heights = on_plane("bare")
    kernel = kernel.astype(jnp.complex64)
    expected = dense_contact(np.asarray(kernel, complex), heights, 0.02)
    for dtype, rtol in ((jnp.float32, 1e-3), (jnp.float64, 1e-4), (jnp.float32, 5e-5)):
        s = gc.solve_contact(kernel, jnp.asarray(heights, dtype), 0.02, rtol=rtol, throw=False)
        assert s.pressure.dtype == s.mean_gap.dtype == s.error.dtype == dtype
        np.testing.assert_allclose(
            s.pressure, expected, atol=max(rtol, float(s.error)) * expected.max()
        )
        assert (s.result == gc.contacts.RESULTS.rounding) == (rtol == 5e-5) == (s.error > rtol)


def test_stopped_solve_reports_it_and_returns_the_partial_result():
    hasty = gc.contacts.DouglasRachford(max_steps=4)
    with pytest.raises(RuntimeError, match=r"^The contact solver reached `max_steps`"):
        gc.solve_contact(*on_line(), 0.05, solver=hasty)
    partial = gc.solve_contact(*on_line(), 0.05, solver=hasty, throw=False)
    assert partial.result == gc.contacts.RESULTS.max_steps_reached
    assert partial.num_steps == 4
    assert partial.error > 1e-6
    np.testing.assert_allclose(np.mean(partial.pressure), 0.05)


@pytest.mark.parametrize("name", ["elastic", "coated"])
def test_hardness_matches_a_dense_solve_with_both_bounds(name):
    """The same points flow, touch and stand apart; a third of the load is beyond the hardness."""
    kernel, heights = on_plane(name)
    free = dense_contact(np.asarray(kernel), heights, 0.2)
    hardness = 0.4 * free.max()
    expected = dense_contact(np.asarray(kernel), heights, 0.2, hardness)
    law = gc.HardWall(hardness=hardness)
    found = gc.solve_contact(kernel, heights, 0.2, law=law, rtol=1e-10)
    np.testing.assert_allclose(found.pressure, expected, atol=1e-8 * hardness)
    flowing = expected >= hardness * (1 - 1e-10)
    assert np.any(flowing)
    np.testing.assert_array_equal(found.pressure >= hardness * (1 - 1e-10), flowing)
    assert np.max(found.gap[flowing]) <= 1e-8  # the depth of the flow
    np.testing.assert_allclose(np.mean(found.pressure), 0.2, rtol=1e-12)
    assert np.min(found.gap[~flowing]) >= -1e-7 * np.std(heights)


def test_repulsive_law_goes_to_the_hard_wall_in_proportion_to_its_range():
    """The mean gap at first order in ε; pressure nearly so."""
    kernel, heights = on_line()
    rms = float(jnp.std(heights))
    hard = gc.solve_contact(kernel, heights, 0.05, rtol=1e-9)
    ranges, rows = np.array([0.1, 0.01, 0.001]), []
    for share in ranges:
        law = gc.RepulsiveLJ(share * rms, 0.05)
        s = gc.solve_contact(kernel, heights, 0.05, law=law, rtol=1e-9)
        off = np.linalg.norm(s.pressure - hard.pressure) / np.linalg.norm(hard.pressure)
        rows.append([(s.mean_gap - hard.mean_gap) / rms, off])
    of_gap, of_pressure = np.array(rows).T
    np.testing.assert_allclose(of_gap / ranges, of_gap[0] / ranges[0], rtol=0.02)
    assert np.all(np.log10(of_pressure[:-1] / of_pressure[1:]) > 0.9)
    assert of_pressure[-1] < 1e-3
    touching = law.contact_indicator(s.pressure, s.gap, 1.0) > 0
    assert abs(np.mean(touching) - np.mean(hard.pressure > 0)) <= 2 / LINE.shape[0]


@pytest.mark.parametrize("law", ["hardness", "repulsive"])
def test_mean_gap_gives_the_same_contact_as_the_load_that_has_it(law):
    kernel, heights = on_line()
    law = LAWS[law]
    by_load = gc.solve_contact(kernel, heights, 0.05, law=law, rtol=1e-9)
    by_gap = gc.solve_contact(kernel, heights, mean_gap=jnp.mean(by_load.gap), law=law, rtol=1e-9)
    np.testing.assert_allclose(by_gap.mean_gap, by_load.mean_gap, rtol=1e-7)
    np.testing.assert_allclose(by_gap.mean_pressure, 0.05, rtol=1e-6)
    scale = np.max(by_load.pressure)
    np.testing.assert_allclose(by_gap.pressure, by_load.pressure, atol=1e-6 * scale)
    np.testing.assert_allclose(by_gap.gap, by_load.gap, atol=1e-7 * np.ptp(heights))


def test_surfaces_held_apart_do_not_touch():
    kernel, heights = on_line()
    apart = 1.01 * jnp.max(heights - jnp.mean(heights))
    s = gc.solve_contact(kernel, heights, mean_gap=apart, law=LAWS["hardness"])
    np.testing.assert_array_equal(s.pressure, 0)
    np.testing.assert_allclose(s.gap, apart - (heights - jnp.mean(heights)), rtol=1e-12)


def test_full_contact_is_found_at_once():
    """Where everything touches, the pressure flattens the heights: a division mode by mode."""
    kernel, heights = on_line()
    spectrum = np.fft.rfft(heights) / kernel.at[0].set(np.inf)
    exact = np.fft.irfft(spectrum, 64)
    exact = exact - 1.1 * exact.min()
    found = gc.solve_contact(kernel, heights, np.mean(exact), solver=NESTED)
    np.testing.assert_allclose(found.pressure, exact, atol=1e-12 * exact.max())
    assert found.num_fft_pairs <= 12


@pytest.mark.parametrize("seed", [0, 1])
def test_nearly_full_contact_of_ridges_does_not_stall(seed):
    """With a penalty for the shorter period, steps wandered without end."""
    n = 15
    q = np.hypot(20 * np.fft.fftfreq(n, 1 / n)[:, None], np.arange(n // 2 + 1))
    q[0, 0] = np.inf
    heights = np.random.default_rng(seed).normal(size=(n, n))
    heights = np.fft.irfft2(np.fft.rfft2(heights) * q**-1.8, s=(n, n))
    stiffness = q * (1 + q / 10) ** 2
    stiffness[0, 0] = 0
    load = -0.99 * np.fft.irfft2(np.fft.rfft2(heights) * stiffness, s=(n, n)).min()
    kernel = 1 / q / (1 + q / 10) ** 2
    found = gc.solve_contact(kernel, heights, load, rtol=1e-9)
    exact = dense_contact(kernel, heights, load)
    assert 0.99 < np.mean(exact > 0) < 1 and found.num_fft_pairs <= 150
    np.testing.assert_allclose(found.pressure, exact, atol=1e-8 * exact.max())
    again = gc.solve_contact(kernel, heights, mean_gap=found.mean_gap)
    np.testing.assert_allclose(again.pressure, exact, atol=1e-6 * exact.max())
    assert again.num_fft_pairs <= 12


def test_a_gap_near_full_contact_leads_back_to_its_load():
    """Long memories of the acceleration ran away with the load: 8.9 MPa in place of 1.2."""
    q0, grid = 2 * np.pi / 1e-3, gc.Grid((64, 64), 1e-3)
    spectrum = gc.SelfAffine(rms_slope=0.04, hurst=0.9, q_low=q0, q_roll=q0, q_high=8 * q0)
    heights = gc.random_surface(spectrum, grid, jax.random.key(1)).heights
    kernel = gc.stack_kernel(gc.Stack(base=gc.HalfSpace(gc.tyre_tread())), grid, 2.0)
    by_load = gc.solve_contact(kernel, heights, 1.2e6, rtol=1e-9)
    assert 0.99 < np.mean(by_load.pressure > 0) < 1
    by_gap = gc.solve_contact(kernel, heights, mean_gap=by_load.mean_gap)
    np.testing.assert_allclose(by_gap.mean_pressure, 1.2e6, rtol=1e-4)
    assert abs(by_gap.mean_pressure / 1.2e6 - 1) <= by_gap.error
