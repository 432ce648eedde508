"""Results of a scene go to a file and come back; what is in them follows from the dataset alone."""

import numpy as np
import pytest
import xarray

import graded_contact as gc
from graded_contact.scenes.collect import surface_variables
from graded_contact.scenes.results import (
    KEPT_FIELDS,
    read_results,
    surface_of,
)
from graded_contact.sliding.result import numbers_of
from graded_contact.studies.dataset import NOT_STARTED, attach, write
from graded_contact.surfaces.reading_steps import ReadingStep


def make_results(shape=(4, 6), dtype=np.float64, keep="every"):
    draw = np.random.default_rng(0)
    axes = {"pressure": np.array([1e5, 3e5]), "velocity": np.geomspace(1e-3, 1.0, 3)}
    surface = gc.Surface(
        heights=draw.normal(size=shape).astype(dtype),
        grid=gc.Grid(shape, np.array([1e-3, 3e-3][: len(shape)], dtype)),
        history=("Read.", "Filled."),
        measured=draw.uniform(size=shape).astype(dtype),
        steps=(
            ReadingStep("read", 1.1, 0.3, 4.0, 0.2),
            ReadingStep("resampled", 1.0, 0.2, 3.9, 0.0),
        ),
    )
    variables, places, attributes = surface_variables(surface)
    variables |= {
        n: ((*axes,), draw.normal(size=(2, 3)).astype(dtype)) for n in numbers_of("steady")
    }
    variables["mean_gap"][1][0, 1] = np.nan
    message = [["", "", "It stopped."], ["", NOT_STARTED, "failed: no kernel"]]
    variables["message"] = (*axes,), np.array(message)
    variables["point"] = (*axes,), np.array([["a", "b", "c"], ["d", "e", "f"]])
    over = (*axes, *places) if keep == "every" else (*places,)
    size = (2, 3, *shape) if keep == "every" else shape
    variables |= {n: (over, draw.normal(size=size).astype(dtype)) for n in KEPT_FIELDS.values()}
    attributes |= {
        "title": "glatt, 50 µm",
        "seed": 3,
        "kept": "1 2",
        "rtol": 1e-6,
        "scene": "a = 1\n" * 20000,
    }
    return attach(xarray.Dataset(variables, axes | places, attributes))


@pytest.mark.parametrize("shape, dtype", [((4, 6), np.float64), ((8,), np.float32)])
def test_results_come_back_bit_for_bit(tmp_path, shape, dtype):
    results = make_results(shape, dtype)
    write(tmp_path / "a.h5", results)
    again = read_results(tmp_path / "a.h5")
    assert again.identical(results) and again.gap.dtype == again.friction.dtype == dtype
    before, after = surface_of(results), surface_of(again)
    assert before.heights.dtype == after.heights.dtype == dtype
    np.testing.assert_array_equal(before.grid.size, after.grid.size)
    assert after.history == ("Read.", "Filled.") and after.steps[1].name == "resampled"
    assert after.steps == before.steps
