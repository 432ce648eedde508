"""Measured heights become a surface, and what looks wrong in them is a warning."""

import re

import numpy as np
import pytest

from graded_contact.surfaces import surface_from_heights
from graded_contact.surfaces.holes import rms_slope

ROUGH = 1e-6 * np.random.default_rng(0).normal(size=(12, 10))


def test_equal_heights_far_from_all_others_are_a_warning():
    marked = np.where(np.arange(120).reshape(12, 10) % 25 == 3, -9999e-6, ROUGH)
    surface = surface_from_heights(marked, (12e-3, 10e-3))
    assert "5 heights of -0.009999 m lie far from all others" in surface.warnings[0]
    warnings = surface_from_heights(np.where(marked == -9999e-6, np.nan, marked), 1e-3).warnings
    assert not any("far from" in warning for warning in warnings)
    plateau = np.maximum(ROUGH, 0.0)  # equal, but near the others
    assert not any(
        "far from" in warning for warning in surface_from_heights(plateau, 1e-3).warnings
    )


def _walk(shape):
    """Heights of a random walk: rough at every length, and tilted."""
    values = np.random.default_rng(1).normal(size=shape)
    for axis in range(len(shape)):
        values = np.cumsum(values, axis)
    return 1e-6 * values


def _levelled(values):
    axes = np.meshgrid(*map(np.arange, values.shape), indexing="ij")
    basis = np.stack([np.ones(values.shape), *axes], axis=-1).reshape(values.size, -1)
    fitted = basis @ np.linalg.lstsq(basis, values.ravel())[0]
    return values - fitted.reshape(values.shape)


@pytest.mark.parametrize("shape", [(60,), (50, 64)])
def test_joined_edges_meet_and_keep_slope_and_interior(shape):
    """The joint solves Laplace's equation off the edges, checked on the five-point stencil."""
    values = _walk(shape)
    size = np.array([1.0, 0.4])[: len(shape)]
    surface = surface_from_heights(values, size)
    level, heights, spacing = _levelled(values), np.asarray(surface.heights), size / shape
    factor = float(re.search(r"by (\S+) to restore", surface.history[-1]).group(1))
    if factor < 1.1:  # the most
        np.testing.assert_allclose(rms_slope(heights, spacing), rms_slope(level, spacing))
    joint = level - heights / factor
    inner = (slice(1, -1),) * len(shape)
    bent = [np.diff(joint, 2, axis) / d**2 for axis, d in enumerate(spacing)]
    bent = bent[0] if len(shape) == 1 else bent[0][:, inner[1]] + bent[1][inner[0]]
    scale = np.max(np.abs(np.diff(level, 2, 0))) / np.min(spacing) ** 2
    np.testing.assert_allclose(bent, 0, atol=1e-3 * scale)  # the factor is printed to 4 digits
    for axis in range(len(shape)):
        seam = np.take(heights, 0, axis) - np.take(heights, -1, axis)
        inside = np.diff(heights, axis=axis)
        assert np.sqrt(np.mean(seam**2)) < 2 * np.sqrt(np.mean(inside**2))


def test_holes_sink_below_the_heights_around_them():
    x, y = np.meshgrid(np.arange(40.0), np.arange(50.0), indexing="ij")
    hole = (x - 20) ** 2 + (y - 25) ** 2 < 100
    around = ((x - 20) ** 2 + (y - 25) ** 2 < 150) & ~hole
    values = 1e-6 * np.random.default_rng(0).normal(size=x.shape)
    surface = surface_from_heights(np.ma.array(values, mask=hole), [4e-3, 5e-3], periodic="mirror")
    heights = np.asarray(surface.heights)[:40, :50]
    assert np.max(heights[hole]) < np.max(heights[around])
    assert heights[20, 25] < np.quantile(heights[~hole], 0.03)
    np.testing.assert_array_equal(np.asarray(surface.measured)[:40, :50], ~hole)


def test_a_spike_is_a_warning():
    spiked = ROUGH.copy()
    spiked[3, 4] = 1.0
    assert "rms heights from the mean plane" in surface_from_heights(spiked, 1e-3).warnings[0]
