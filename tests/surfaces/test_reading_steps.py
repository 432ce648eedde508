"""What makes a measured surface doubtful: steps of reading, holes, spikes and units."""

import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.surfaces.reading_steps import ReadingStep, caveats_of_steps, step


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([("read", 0.2), ("resampled", 0.19)], []),
        ([("read", 0.206), ("resampled", 0.14)], ["fell from 0.206 to 0.14 when resampled"]),
        ([("read", 0.2), ("equally spaced", 0.1)], ["fell from 0.2 to 0.1 when equally spaced"]),
        ([("read", 0.2), ("filled", 0.1)], []),  # spikes that were discarded
        ([("read", 0.2), ("filled", 0.3)], ["rose from 0.2 to 0.3 when filled"]),
    ],
)
def test_steps_that_change_the_slope_are_told(steps, words):
    sentences = caveats_of_steps([ReadingStep(name, 1.0, slope, 4.0, 0.0) for name, slope in steps])
    assert len(sentences) == len(words)
    for sentence, part in zip(sentences, words, strict=True):
        assert part in sentence


def test_many_missing_points_and_spikes_are_told():
    raw = ReadingStep("read", 1.0, 0.2, 4.0, 0.31)
    (missing,) = caveats_of_steps((raw, raw._replace(name="filled", missing=0.0)))
    assert "31% of the points were not measured" in missing
    spiky = raw._replace(name="tilt removed", peak=11.0, missing=0.0)
    smooth = raw._replace(name="resampled", missing=0.0)
    (spike,) = caveats_of_steps((spiky, smooth))  # resampling only blurs it
    assert "11 rms heights" in spike
    assert caveats_of_steps((spiky, smooth._replace(name="filled"))) == ()  # discarded


def test_a_step_measures_height_slope_and_peak_of_what_was_measured():
    x = 0.5 * np.arange(7.0)
    heights = np.add.outer(3 * x, 4 * x)
    heights[2, 3] = np.nan
    found = step("read", heights, (0.5, 0.5))
    known = heights[np.isfinite(heights)]
    np.testing.assert_allclose(found.rms_height, np.std(known))
    np.testing.assert_allclose(found.rms_slope, 5.0)
    assert found.missing == 1 / 49
    np.testing.assert_allclose(found.peak, np.max(np.abs(known - known.mean())) / np.std(known))


def test_marks_and_steps_follow_a_surface_that_is_resampled():
    grid = gc.Grid((8, 6), 1.0)
    x, y = jnp.arange(8)[:, None] / 8, jnp.arange(6)[None, :] / 6
    heights = jnp.cos(2 * jnp.pi * x) * jnp.cos(2 * jnp.pi * y)
    measured = jnp.broadcast_to((x < 0.5).astype(float), grid.shape)
    steps = (step("read", heights, grid.spacing),)
    surface = gc.Surface(heights, grid, measured=measured, steps=steps)
    finer = gc.surfaces.resample(surface, (16, 12))
    np.testing.assert_array_equal(finer.measured[:, 0], [1] * 7 + [0] * 8 + [1])
    assert [s.name for s in finer.steps] == ["read", "resampled"]
    np.testing.assert_allclose(finer.steps[1].rms_height, 0.5)
    with pytest.raises(ValueError, match=r"`measured\[0, 0\]=2`"):
        gc.Surface(heights, grid, measured=2 * jnp.ones(grid.shape))


@pytest.mark.parametrize(
    ("size", "height", "words"),
    [
        (1e-2, 1e-4, ""),
        (2.0, 1e-6, "rms slope of"),  # a scan of 2 mm, read in metres
        (4e-96, 1e-97, "size of 4e-84 pm is unusual (usual are 10 nm to 1 km): check units."),
    ],
)
def test_unusual_sizes_heights_and_slopes_are_told(size, height, words):
    values = height * np.random.default_rng(0).normal(size=(32, 32))
    caveats = gc.surfaces.surface_from_heights(values, size).caveats
    assert (words in " ".join(caveats)) if words else caveats == ()
