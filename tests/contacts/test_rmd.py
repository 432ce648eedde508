"""Residuals molecular dynamics against the splitting, which shares only the law with it."""

import jax.numpy as jnp
import numpy as np
import pytest
from conftest import BODIES, SPEED, rough

import graded_contact as gc

GRID = gc.Grid((32, 32), 1.0)
SURFACE = rough(GRID, cut=4)
HEIGHTS = SURFACE.heights
RMS = float(jnp.std(HEIGHTS))
LOAD = 0.05
LAWS = {"repulsive": gc.RepulsiveLJ(0.05 * RMS, LOAD), "adhesive": gc.AdhesiveLJ(2e-3, 4e-5)}


def solve(law, control="pressure", solver=gc.contacts.ResidualDynamics(), rtol=1e-6, **more):  # noqa: B008
    """Sliding on a viscoelastic body: a kernel that is not symmetric."""
    kernel = gc.stack_kernel(BODIES["coated"], GRID, SPEED)
    target = LOAD if control == "pressure" else 0.6 * RMS
    return gc.solve_contact(
        kernel, HEIGHTS, **{control: target}, law=LAWS[law], solver=solver, rtol=rtol, **more
    )


@pytest.mark.parametrize("law, control", [("repulsive", "pressure"), ("adhesive", "mean_gap")])
def test_both_criteria_hold_at_the_end(law, control):
    """The residual of the equations over the gap, by NumPy; `error` is the larger of the two.

    Of a law that attracts four times that, because equilibria are soft.
    """
    s = solve(law, control)
    kernel = np.array(gc.stack_kernel(BODIES["coated"], GRID, SPEED))
    kernel[0, 0] = 0
    displacement = np.fft.irfft2(kernel * np.fft.rfft2(s.pressure), GRID.shape)
    gap = displacement - HEIGHTS + jnp.mean(HEIGHTS) + s.mean_gap
    ratio = np.asarray(LAWS[law].range / gap)
    if law == "repulsive":
        of_law = LOAD * ratio**9
        gap_of_law = np.asarray(LAWS[law].range * (LOAD / s.pressure) ** (1 / 9))
        # The mean gap is taken anew from the pressure, in its own weight.
        assert np.sqrt(np.mean((gap / gap_of_law - 1) ** 2)) <= 3e-6
    else:
        of_law = 8 * 4e-5 / (3 * 2e-3) * (ratio**9 - ratio**3)
    # A gap that is right to ε gives a pressure that is right to nine times ε.
    assert np.linalg.norm(of_law - s.pressure) <= 30e-6 * np.linalg.norm(s.pressure)
    assert s.error <= (4e-6 if law == "adhesive" else 1e-6)


def test_unfinished_motion_is_reported():
    hasty = gc.contacts.ResidualDynamics(max_steps=5)
    with pytest.raises(RuntimeError, match="reached `max_steps` before `rtol`"):
        solve("repulsive", solver=hasty)
    s = solve("repulsive", solver=hasty, throw=False)
    assert s.result == gc.contacts.RESULTS.max_steps_reached
    assert s.num_steps == 5
    assert s.error > 1e-6
    np.testing.assert_allclose(s.mean_pressure, LOAD)
