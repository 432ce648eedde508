"""Claims of a loose solve, against contacts solved to the last digits."""

import dataclasses
import functools
from typing import Any

import jax
import numpy as np
from conftest import BODIES, SPEED

import graded_contact as gc

GRID = gc.Grid((32, 32), 1.0)
LOAD = 0.05


@functools.cache
def surface():
    q = 2 * np.pi
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=q, q_roll=4 * q, q_high=8 * q)
    return gc.random_surface(spectrum, GRID, jax.random.key(0))


def slide(**how: Any):
    """With all numbers of all tests, in one program."""
    found = gc.slide(BODIES["coated"], surface(), velocity=SPEED, **how)
    found.compute(
        *(f"{name}{end}" for name in ("friction", "contact_area") for end in ("", "_error"))
    )
    return found


def test_errors_of_loose_solves_are_within_their_claims():
    best = slide(pressure=LOAD, rtol=1e-10)
    for rtol in (1e-2, 1e-4):
        found = slide(pressure=LOAD, rtol=rtol)
        assert (
            abs(found.friction - best.friction)
            <= found.error_parts("friction")["solver"] + best.error_parts("friction")["solver"]
        )
        wrong = np.mean((found.pressure > 0) != (best.pressure > 0))
        assert wrong <= found.error_parts("contact_area")["solver"]


def test_errors_of_pressures_and_gaps_are_within_their_claims():
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    best, *all_found = (
        gc.solve_contact(kernel, surface().heights, LOAD, rtol=rtol) for rtol in (1e-10, 1e-2, 1e-4)
    )
    for found, rtol in zip(all_found, (1e-2, 1e-4), strict=True):
        off = np.linalg.norm(found.pressure - best.pressure) / np.linalg.norm(best.pressure)
        assert off <= found.error + best.error <= 1.01 * rtol
        gap_error = found.gap_error * np.std(surface().heights)
        assert abs(found.mean_gap - best.mean_gap) <= gap_error
        np.testing.assert_allclose(np.mean(found.pressure), LOAD, rtol=1e-12)


def test_the_error_of_friction_is_the_change_by_the_correction_with_these_margins():
    found = slide(pressure=LOAD, rtol=1e-2)

    def friction(pressure):
        contact = dataclasses.replace(found.contact, pressure=pressure)
        return dataclasses.replace(found, contact=contact).friction

    change = found.contact.correction
    moved = friction(found.pressure + change) - friction(found.pressure)
    each = jax.grad(friction)(found.pressure + change) * change
    expected = 2.5 * abs(moved) + 5 * np.sqrt(np.sum(each**2))
    np.testing.assert_allclose(found.error_parts("friction")["solver"], expected, rtol=1e-6)


def test_an_exact_contact_claims_rounding():
    """Pressures of few points are eliminated: friction is then known to its last digits."""
    found, best = (slide(pressure=5e-3, rtol=rtol) for rtol in (1e-9, 1e-13))
    assert 1 < np.sum(found.pressure > 0) < 100
    assert abs(found.friction - best.friction) <= found.error_parts("friction")["solver"] <= 1e-12
    assert found.error_parts("friction")["solver"] > 0


def test_claims_hold_at_a_mean_gap_near_full_contact():
    """There the load follows from small differences of the gap: claims were 36 times too small."""
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    best = gc.solve_contact(kernel, surface().heights, 1.2, rtol=1e-10)
    assert 0.9 < np.mean(best.pressure > 0) < 1
    found = gc.solve_contact(kernel, surface().heights, mean_gap=best.mean_gap, rtol=1e-3)
    wrong = np.linalg.norm(found.pressure - best.pressure) / np.linalg.norm(best.pressure)
    assert wrong <= found.error


def test_claims_hold_where_attraction_makes_a_block_of_high_contrast_soft():
    """The law is 0.06 as steep as the shortest wave. The claim was 4.7e-5, the error 1.3e-4."""
    grid, q0, reach = gc.Grid((24, 24), 1e-4), 2 * np.pi / 1e-4, 2e-7
    rubber = gc.Prony(1e6, [1e9], [3e-5], 0.3)
    kernel = gc.stack_kernel(gc.Stack(base=gc.HalfSpace(rubber)), grid, 1.0)
    least = np.min(np.abs(np.asarray(kernel).ravel()[1:]))
    law = gc.contacts.ExponentialAdhesion(reach, 0.06 * reach**2 / least)
    spectrum = gc.SelfAffine(rms_slope=0.03, hurst=0.8, q_low=q0, q_roll=2 * q0, q_high=6 * q0)
    heights = gc.random_surface(spectrum, grid, jax.random.key(1)).heights
    how = dict(law=law, solver=gc.contacts.DouglasRachford(max_steps=6000))
    best = gc.solve_contact(kernel, heights, 3e4, rtol=1e-10, **how)
    found = gc.solve_contact(kernel, heights, 3e4, **how)
    off = np.linalg.norm(found.pressure - best.pressure) / np.linalg.norm(best.pressure)
    assert off <= found.error <= 20 * off
