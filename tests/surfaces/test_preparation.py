"""Measured heights become a surface, and what looks wrong in them is a warning."""

import numpy as np

from graded_contact import surface_from_heights

ROUGH = 1e-6 * np.random.default_rng(0).normal(size=(12, 10))


def test_equal_heights_far_from_all_others_are_a_warning():
    marked = np.where(np.arange(120).reshape(12, 10) % 25 == 3, -9999e-6, ROUGH)
    surface = surface_from_heights(marked, (12e-3, 10e-3))
    assert "5 heights of -0.009999 m lie far from all others" in surface.warnings[0]
    missing = np.where(marked == -9999e-6, np.nan, marked)
    assert not any(
        "far from" in warning for warning in surface_from_heights(missing, 1e-3).warnings
    )
    plateau = np.maximum(ROUGH, 0.0)  # equal, but near the others
    assert not any(
        "far from" in warning for warning in surface_from_heights(plateau, 1e-3).warnings
    )
