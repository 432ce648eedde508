"""Residuals molecular dynamics against the splitting, which shares only the law with it."""

import jax.numpy as jnp
import numpy as np
from conftest import BODIES, SPEED
from oracles import rough

import graded_contact as gc

GRID = gc.Grid((32, 32), 1.0)
SURFACE = rough(GRID.shape, 1.0, last=8)
HEIGHTS = SURFACE.heights
RMS = float(jnp.std(HEIGHTS))
LOAD = 0.05
LAW = gc.RepulsiveLJ(0.05 * RMS, LOAD)


def solve(solver=gc.contacts.ResidualDynamics()):  # noqa: B008
    """Sliding on a viscoelastic body: a kernel that is not symmetric."""
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    how = dict(law=LAW, solver=solver, rtol=1e-6, throw=False)
    return gc.solve_contact(kernel, HEIGHTS, LOAD, **how)


def test_both_criteria_hold_at_the_end():
    """The residual of the equations over the gap, by NumPy; `error` is the larger of the two."""
    s = solve()
    kernel = np.array(gc.stack_kernel(BODIES["coated"], GRID, SPEED))
    kernel[0, 0] = 0
    displacement = np.fft.irfft2(kernel * np.fft.rfft2(s.pressure), GRID.shape)
    gap = displacement - HEIGHTS + np.mean(HEIGHTS) + s.mean_gap
    gap_of_law = np.asarray(LAW.range * (LOAD / s.pressure) ** (1 / 9))
    # The mean gap is taken anew from the pressure, in its own weight.
    assert np.sqrt(np.mean((gap / gap_of_law - 1) ** 2)) <= 3e-6
    # A gap that is right to ε gives a pressure that is right to nine times ε.
    of_law = LOAD * np.asarray(LAW.range / gap) ** 9
    assert np.linalg.norm(of_law - s.pressure) <= 30e-6 * np.linalg.norm(s.pressure)
    assert s.error <= 1e-6


def test_unfinished_motion_is_reported():
    hasty = gc.contacts.ResidualDynamics(max_steps=5)
    s = solve(hasty)
    assert s.result == gc.contacts.RESULTS.max_steps_reached
    assert s.num_steps == 5
    assert s.error > 1e-6
    np.testing.assert_allclose(s.mean_pressure, LOAD)
