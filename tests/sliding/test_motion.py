"""Periodic motions: their number of times, the length of their path, what they cannot resolve."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.sliding import recorded, sinusoidal, slide_cycle, start_stop, steady
from graded_contact.sliding.over_period import refined

GRID = gc.Grid((32,), 1.0)
WAVES = gc.Surface(0.02 * np.cos(2 * np.pi * np.arange(32) / 32), GRID)
# What needs the errors by the grid and the times, five programs, is on eight points at 128 times.
FEW = gc.Surface(WAVES.heights[::4], gc.Grid((8,), 1.0))
RUBBER = gc.Stack(base=gc.HalfSpace(gc.Prony(1.0, [3.0], [0.01], 0.3)))


def cycle(displacement, surface=WAVES, **options):
    job = {"pressure": 0.05, "period": 1.0, "rtol": 1e-5} | options
    return slide_cycle(RUBBER, surface, displacement=displacement, **job)


def is_fast(count):
    for prime in (2, 3, 5):
        while count % prime == 0:
            count //= prime
    return count == 1


@pytest.mark.parametrize(
    ("grid", "strokes"), [(GRID, (1e-3, 1.0)), (gc.Grid((50, 40), [1.0, 0.2]), (0.3,))]
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
            assert path / count <= 0.5 * spacing and motion.largest_step(grid) <= 0.5
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


def test_a_recorded_motion_has_the_times_of_its_grid_without_its_noise():
    rng = np.random.default_rng(0)
    times = np.sort(rng.random(5000))
    path = 0.4 * np.sin(2 * np.pi * times)
    read = recorded(times, path + 1e-4 * rng.normal(size=5000), 1.0, grid=GRID)
    # A noise-free table of this speed needs 2π 0.4 / (0.5/32) = 161 times; from row to row, noise
    # moves as far as the motion.
    assert 161 <= read.num_times <= 200 and read.largest_step(GRID) <= 0.5
    t = times[0] + np.arange(read.num_times) / read.num_times
    np.testing.assert_allclose(read.displacement, 0.4 * np.sin(2 * np.pi * t), atol=2e-3)
    assert recorded(times, path, 1.0).num_times == 128
    both = recorded(times, np.stack([path, path], axis=1), 1.0, grid=gc.Grid((32, 32), 1.0))
    assert 322 <= both.num_times <= 400


@pytest.mark.parametrize("make", [
    lambda count: sinusoidal(0.5, 1.0, count, GRID),
    lambda count: start_stop(0.5, 0.2, 0.3, count, GRID),
    lambda count: steady(1.0, GRID, count),
    lambda count: recorded([0.0, 0.5], [0.0, 0.5], 1.0, count, GRID),
])  # fmt: skip
def test_too_few_times_are_refused_with_a_number_that_would_do(make):
    with pytest.raises(ValueError, match=r"`num_times=12` is refused: .* spacings") as refused:
        make(12)
    needed = int(str(refused.value).split()[-2])
    assert make(needed).largest_step(GRID) <= 0.5


def test_a_cycle_refuses_what_its_times_cannot_resolve():
    motion = sinusoidal(0.5, 1.0, 16)
    with pytest.raises(ValueError, match=r"`displacement` at 16 times is refused: .* by up to 3\."):
        cycle(motion.displacement)
    # Inside of a program, too, if the motion is known.
    with pytest.raises(ValueError, match="`displacement` at 16 times"):
        jax.jit(lambda load: cycle(motion.displacement, pressure=load).work)(0.05)
    with pytest.raises(ValueError, match="at 16 times is refused"):
        square = gc.Surface(np.zeros((8, 64)), gc.Grid((8, 64), 1.0))
        cycle(np.stack([0 * motion.displacement, motion.displacement], axis=1), square)
    with pytest.raises(ValueError, match=r"`num_times=None` is refused inside of a program"):
        jax.jit(lambda stroke: sinusoidal(stroke, 1.0, grid=GRID).displacement)(0.1)
    with pytest.raises(ValueError, match=r"`num_times` is refused: a resolved cycle of .* memory"):
        sinusoidal(1e12, 1.0, grid=GRID)
    with pytest.raises(ValueError, match=r"`num_times` is refused: a resolved cycle of .* memory"):
        start_stop(1.0, 1e-9, 1e4)


@pytest.mark.parametrize("count", [16, 17, 33, 64])
def test_the_path_of_a_sine_is_two_strokes(count):
    """∮|v| dt, whose kinks cost (π/nt)²/3 at the times alone."""
    speed = np.pi * np.cos(2 * np.pi * (np.arange(count) / count + 0.003))
    fine = np.mean(np.abs(refined(jnp.asarray(speed)))) / 2 - 1
    assert abs(fine) < 1e-5 * (16 / count) ** 2
    if count % 2 == 0:
        assert abs(np.mean(np.abs(speed)) / 2 - 1) > 300 * abs(fine)


def test_mean_friction_is_the_work_over_load_and_path():
    """A circle, a line at an angle and a sine under a constant load, whose paths are known."""
    for count, grid in ((96, GRID), (33, gc.Grid((8, 9), 1.0))):
        shape = grid.shape
        heights = 0.02 * np.cos(2 * np.pi * np.indices(shape)[0] / shape[0]) * np.ones(shape)
        t = 2 * np.pi * np.arange(count) / count
        if grid.ndim == 1:
            paths = [(0.3 * np.sin(t), 1.2)]
        else:
            circle, line = (np.stack([np.sin(t), f(t)], axis=1) for f in (np.cos, np.sin))
            paths = [(0.2 * circle, 0.4 * np.pi), (0.2 * line, 0.8 * 2**0.5)]
        for displacement, path in paths:
            found = cycle(displacement, gc.Surface(heights, grid))
            found.compute("mean_friction", "work")
            np.testing.assert_allclose(found.mean_friction, found.work / (0.05 * path), rtol=2e-6)


def test_the_path_under_a_load_that_varies():
    """∮ load |v| dt of a load 1 + a cos 2Ωt and a sine: 2 stroke (1 + a/3)."""
    t = 2 * np.pi * np.arange(64) / 64
    found = cycle(0.2 * np.sin(t), pressure=0.05 * (1 + 0.5 * np.cos(2 * t)))
    expected = found.work / (0.05 * 0.8 * (1 + 0.5 / 3))
    np.testing.assert_allclose(found.mean_friction, expected, rtol=2e-6)


def test_values_between_the_times_are_those_of_their_waves():
    """The highest frequency of an even count is a cosine."""
    for count in (12, 13):
        j, fine = np.arange(count), np.arange(64 * count) / 64
        waves = [0, 1, 5] + [6] * (count == 12)
        value = lambda x: sum(np.cos(2 * np.pi * k * x / count) for k in waves)  # noqa: B023, E731
        np.testing.assert_allclose(refined(jnp.asarray(value(j))), value(fine), atol=1e-12)


@pytest.mark.slow
def test_a_stroke_longer_than_the_cell_has_a_caveat():
    words = "copy of each asperity"
    for stroke in (1.0, 1.5):
        found = cycle(sinusoidal(stroke, 1.0, 128).displacement, FEW)
        assert any(words in text for text in found.caveats) == (stroke > 1)
        np.testing.assert_allclose(found.stroke_over_cell, stroke, rtol=1e-3)
    found = cycle(steady(1.0, FEW.grid, 128).displacement, FEW)
    assert not any(words in text for text in found.caveats) and found.stroke_over_cell < 1e-12


@pytest.mark.slow
def test_a_sudden_start_ripples_and_a_smooth_one_does_not():
    moving = start_stop(0.2, 0.25, 0.25, 128)
    t = np.arange(128) / 128
    sudden = 0.2 * np.interp(t, [0, 0.125, 0.375, 0.625, 0.875], [0, 0, 1, 1, 0])
    words = "friction ripples by"
    smooth, jerky = cycle(moving.displacement, FEW), cycle(sudden, FEW)
    assert not any(words in text for text in smooth.caveats) and smooth.ripple_at_rest < 1e-3
    assert any(words in text for text in jerky.caveats) and jerky.ripple_at_rest > 0.01
    never = cycle(0.2 * np.sin(2 * np.pi * t), FEW)
    never.compute(*never.numbers)  # the program of the other two
    assert never.ripple_at_rest == 0
