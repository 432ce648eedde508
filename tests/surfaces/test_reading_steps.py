"""What makes a measured surface doubtful: steps of reading, holes, spikes and units."""

import numpy as np
import pytest

from graded_contact.surfaces.reading_steps import ReadingStep, step, warnings_of_steps


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
    sentences = warnings_of_steps(
        [ReadingStep(name, 1.0, slope, 4.0, 0.0) for name, slope in steps]
    )
    assert len(sentences) == len(words)
    for sentence, part in zip(sentences, words, strict=True):
        assert part in sentence


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
