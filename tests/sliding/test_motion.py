"""Periodic motions: their number of times, the length of their path, what they cannot resolve."""

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.sliding import sinusoidal, start_stop
from graded_contact.sliding.motion.motion import step_length

GRID = gc.Grid((32,), 1.0)


def is_fast(count):
    for prime in (2, 3, 5):
        while count % prime == 0:
            count //= prime
    return count == 1


@pytest.mark.parametrize(
    ("grid", "strokes"), [(GRID, (1e-3,)), (gc.Grid((50, 40), [1.0, 0.2]), (0.3,))]
)
def test_the_grid_gives_the_number_of_times(grid, strokes):
    """The largest step from the highest speed of each formula, not from the times."""
    spacing = float(grid.size[0]) / grid.shape[0]
    for stroke in strokes:
        for motion, path in (
            (sinusoidal(stroke, 5.0, grid=grid), np.pi * stroke),
            (start_stop(stroke, 0.2, 0.3, grid=grid), 15 / 8 * stroke * 5),
            (start_stop(stroke, 0.2, 0.0, grid=grid), 15 / 8 * stroke * 2),
        ):
            count = motion.num_times
            step = step_length(motion.displacement, grid.spacing)
            assert path / count <= 0.5 * spacing and step <= 0.5
            assert count % 4 == 0 and is_fast(count)
            assert count >= 32 and (count < 200 or path / count > 0.35 * spacing)


def test_each_way_has_times_enough_for_its_acceleration():
    """A short way after a long rest, hardly a spacing long; also where no grid is known."""
    for grid in (None, GRID):
        motion = start_stop(0.01, 0.1, 4.0, grid=grid)
        assert motion.num_times * 0.1 / 8.2 >= 32
        speed = np.abs(np.fft.rfft(motion.displacement)) * np.arange(motion.num_times // 2 + 1)
        upper = speed[motion.num_times // 4 + 1 :]
        assert np.sqrt(np.sum(upper**2) / np.sum(speed**2)) < 2e-3
    assert sinusoidal(1.0, 1.0).num_times == start_stop(1.0, 1.0, 1.0).num_times == 128
