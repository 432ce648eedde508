"""Figures of cycles draw what was computed, without a solve."""

from types import SimpleNamespace

import numpy as np
import pytest

import graded_contact as gc

TIMES = np.arange(8) / 8
MOVED = 1e-4 * np.sin(2 * np.pi * TIMES)


def made(displacement=MOVED, **fields):
    numbers = {"friction": np.cos(2 * np.pi * TIMES), "contact_area_smooth": 0.1 + 0.01 * TIMES}
    return SimpleNamespace(displacement=displacement, **numbers, **fields)


def test_the_loop_is_closed_and_has_units():
    loop, over_time, area = gc.plot.plot_cycle(made()).axes
    x, y = loop.lines[0].get_data()
    np.testing.assert_allclose(x, 1e6 * np.append(MOVED, 0), atol=1e-12)
    assert loop.get_xlabel() == "displacement [µm]" and y[0] == y[-1] == 1.0
    assert over_time.lines[0].get_xdata()[-1] == 1.0 and area.get_ylim()[0] == 0
    drift = gc.plot.plot_cycle(made(1e-3 * TIMES)).axes[0].lines[0]
    assert len(drift.get_xdata()) == 8  # not closed


def test_a_motion_in_two_directions_has_no_loop():
    with pytest.raises(ValueError, match="a motion along x is needed"):
        gc.plot.plot_cycle(made(np.zeros((8, 2))))


@pytest.mark.parametrize("shape", [(16,), (8, 8)])
def test_a_film_has_one_scale(shape):
    pressure = np.random.default_rng(0).uniform(-1, 1, (8, *shape)).clip(0) * 4e6
    surface = gc.Surface(np.zeros(shape), gc.Grid(shape, 1e-3))
    figure = gc.plot.plot_film(made(pressure=pressure), surface)
    titles = [axes.get_title() for axes in figure.axes[:4]]
    assert titles == [f"$t/T$ = {t}" for t in ("0", "0.25", "0.5", "0.75")]
    one = gc.plot.plot_film(made(pressure=pressure), surface, [3])
    for axes in (one.axes[0], *figure.axes[:4]):
        high = axes.images[0].norm.vmax if len(shape) == 2 else axes.get_ylim()[1] / 1.05
        np.testing.assert_allclose(high, pressure.max() / 1e6)
