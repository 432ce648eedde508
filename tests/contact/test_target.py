"""Contacts solved until chosen numbers are known, against ones solved to the last digits."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, LAWS, SPEED, rough

import graded_contact as gc
from graded_contact.contact.estimates import error_of

GRID = gc.Grid((32, 32), 1.0)
SURFACE = rough(GRID, cut=4)
KERNEL = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
LOAD = 0.05


def gap_and_sharpness(contact):
    """Two numbers that weigh all gaps and all pressures."""
    return jnp.stack([contact.mean_gap, jnp.mean(contact.pressure**2) / LOAD**2])


@pytest.mark.parametrize(
    "name", ["hard", *(pytest.param(n, marks=pytest.mark.slow) for n in LAWS if n != "hard")]
)
def test_what_is_wanted_is_known_within_its_claimed_error(name):
    def solve(**tolerance: Any):
        return gc.solve_contact(KERNEL, SURFACE.heights, LOAD, law=LAWS[name], **tolerance)

    best = solve(rtol=1e-10)
    exact = gap_and_sharpness(best)
    for rtol in (1e-2, 1e-4):
        found = solve(rtol=rtol, target=gap_and_sharpness)
        error = np.abs(gap_and_sharpness(found) - exact)
        claimed = np.asarray(found.target_error)
        assert np.all(claimed <= 1.01 * rtol * exact)
        assert np.all(error <= claimed + 10 * best.error * exact)
        assert abs(found.mean_gap - best.mean_gap) <= found.gap_error * jnp.std(SURFACE.heights)
        np.testing.assert_allclose(np.mean(found.pressure), LOAD, rtol=1e-12)
        off = np.linalg.norm(found.pressure - best.pressure) / np.linalg.norm(best.pressure)
        assert off <= found.error + best.error


def test_friction_is_known_within_its_claimed_error_and_sooner_than_the_pressure():
    def solve(pressure, **tolerance: Any):
        return gc.slide(BODIES["coated"], SURFACE, pressure=pressure, velocity=SPEED, **tolerance)

    pairs = np.zeros(2)
    for pressure in (0.005, 0.02, 0.1):
        best = solve(pressure, rtol=1e-9)
        found = solve(pressure, friction_rtol=1e-4)
        assert abs(found.friction - best.friction) <= found.friction_error + best.friction_error
        allowed = max(
            1e-4 * float(best.friction),
            0.1 * abs(float(found.geometric_friction - found.friction)),
        )
        assert found.friction_error <= 1.001 * allowed
        wrong = abs(found.contact_area_smooth - best.contact_area_smooth)
        assert wrong <= found.contact_area_error + 1e-9  # the best is solved to as much
        pairs += float(found.num_fft_pairs), float(best.num_fft_pairs)
    assert pairs[0] <= 0.75 * pairs[1]


def test_the_claim_of_a_number_has_the_margins_that_the_benchmark_found():
    """2.5 times its change, and 5 times the root sum of squares of the parts, which may cancel."""
    numbers = lambda change: jnp.stack([jnp.sum(change), 2 * change[2]])  # noqa: E731
    claims = error_of(numbers, jnp.zeros(2), jnp.array([3.0, -3.0, 1.0]), jnp.ones(2))
    np.testing.assert_allclose(claims, [2.5 + 5 * np.sqrt(19), 2.5 * 2 + 5 * 2], rtol=1e-9)


def test_tolerances_of_pressure_and_of_friction_exclude_each_other():
    with pytest.raises(
        ValueError, match=r"`rtol=0\.001` and `friction_rtol=0\.01`: give at most one"
    ):
        gc.slide(
            BODIES["coated"], SURFACE, pressure=LOAD, velocity=SPEED, rtol=1e-3, friction_rtol=1e-2
        )


@pytest.mark.slow
def test_single_precision_takes_a_tolerance_of_friction():
    """With double precision enabled: no number of the search may become one."""
    single = lambda tree: jax.tree.map(lambda a: a.astype(jnp.float32), tree)  # noqa: E731
    stack, surface = single(BODIES["coated"]), single(SURFACE)
    load, speed = np.float32(LOAD), np.float32(SPEED)
    s = gc.slide(stack, surface, pressure=load, velocity=speed, friction_rtol=1e-2)
    best = gc.slide(BODIES["coated"], SURFACE, pressure=LOAD, velocity=SPEED, rtol=1e-9)
    assert s.friction.dtype == s.friction_error.dtype == jnp.float32
    assert abs(float(s.friction) - float(best.friction)) <= s.friction_error


def test_an_exact_contact_claims_rounding():
    """Pressures of few points are eliminated: friction is then known to its last digits."""
    found, best = (
        gc.slide(BODIES["coated"], SURFACE, pressure=5e-3, velocity=SPEED, **tolerance)
        for tolerance in (dict(friction_rtol=1e-2), dict(rtol=1e-9))
    )
    assert 1 < np.sum(found.pressure > 0) < 100
    assert abs(found.friction - best.friction) <= found.friction_error <= 1e-12
    assert found.friction_error > 0


@pytest.mark.parametrize(
    "tolerance",
    [dict(rtol=1e-3), pytest.param(dict(friction_rtol=1e-3), marks=pytest.mark.slow)],
)
def test_claims_hold_at_a_mean_gap_near_full_contact(tolerance):
    """There the load follows from small differences of the gap: claims were 36 times too small."""
    slide = lambda **how: gc.slide(BODIES["coated"], SURFACE, velocity=SPEED, **how)  # noqa: E731
    best = slide(pressure=1.2, rtol=1e-10)
    assert 0.9 < best.contact_area < 1
    found = slide(mean_gap=best.mean_gap, **tolerance)
    wrong = np.linalg.norm(found.pressure - best.pressure) / np.linalg.norm(best.pressure)
    assert wrong <= found.error
    assert abs(found.friction - best.friction) <= found.friction_error
