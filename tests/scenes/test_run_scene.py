"""Scenes are run point by point; what is kept is not computed again."""

import sys
from pathlib import Path

import jax
import numpy as np
import pytest
from scene_texts import TEXT, changed

import graded_contact as gc
from graded_contact.scenes.plan import build_surface, plan
from graded_contact.scenes.results import kept_contact, kept_solves
from graded_contact.scenes.scene_file import parse_scene, read_scene
from graded_contact.studies.store import Store

DATA = Path(__file__).parents[3] / "shared" / "data"
EXAMPLES = Path(__file__).parents[2] / "examples"
# Rooms list functions of the names of these modules.
PLAN = sys.modules["graded_contact.scenes.plan"]
SWEEP, PROGRAM = (
    sys.modules[f"graded_contact.studies.{name}"] for name in ("old_sweep", "program")
)


@pytest.fixture(scope="module")
def scene():
    return parse_scene(TEXT)


@pytest.fixture(scope="module")
def results(scene):
    return plan(scene).run()


def test_a_run_gives_what_slide_gives(scene, results):
    assert np.all(results.message == "")
    surface = build_surface(scene)
    for i, j in np.ndindex(2, 2):
        pressure, velocity = scene.pressure[i], scene.velocity[j]
        load = {"pressure": pressure, "velocity": velocity, "rtol": scene.rtol}
        sliding = gc.slide(scene.stack, surface, **load)
        for name in ("friction", "contact_area", "mean_gap", "error"):
            np.testing.assert_allclose(results[name][i, j], getattr(sliding, name), rtol=1e-6)
    assert kept_solves(results) == [(1, 1)]
    np.testing.assert_allclose(results.gap, sliding.gap, rtol=1e-6, atol=1e-15)
    assert results.attrs["scene"] == TEXT
    assert results.attrs["seed"] == 3
    assert results.attrs["dtype"] == "float64"


@pytest.mark.skipif(not DATA.exists(), reason="measured data lie beside the project")
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("measured_*.toml")), ids=lambda p: p.name)
def test_an_example_is_read_with_its_data(path):
    assert build_surface(read_scene(path)).history


@pytest.fixture
def solved(monkeypatch):
    """The names of the points that were solved, in order."""
    calls, write = [], Store.write

    def noting(store, name, point):
        calls.append(name)
        write(store, name, point)

    monkeypatch.setattr(Store, "write", noting)
    return calls


def test_scenes_share_the_solves_that_they_have_in_common(scene, results, solved, tmp_path):
    with Store(tmp_path) as store:
        plan(scene).run(store=store)
        more = parse_scene(changed("[0.01, 1.0]", "[1.0, 0.1]", 'title = "a small', 'title = "a'))
        found = plan(more).run(store=store)
        assert solved[4:] == found.point.values[:, 1].tolist()
        assert found.identical(plan(more).run())
        assert plan(scene).run(store=store).identical(results) and len(solved) == 6


LINE = changed(
    "[32, 32]", "[16]", "8e4", "4e4", "[2e5, 4e5]", "2e5", '"tyre_tread"',
    '"prony"\nequilibrium = 6e6\nstrengths = [2e7]\ntimes = [1e-3]\nshift = {kind = "wlf", '
    "c1 = 4.0, c2 = 100.0, reference = 290.0}", "[solver]", "temperature = 300.0\n[shear]\n"
    'kind = "peaked"\npeak = 2e5\nvelocity = 0.1\nsteepness = 2.0\n[solver]\nnewton = false',
)  # fmt: skip


# A text that stands for the other one in `LINE`; the first is a number by its last bit.


VARIED = changed(
    "[32, 32]", "[16, 16]", "8e4", "4e4",
    "seed = 3", "seed = 3\nseeds = 2", "[2e5, 4e5]", "2e5", "[0.01, 1.0]",
    "[0.01, 0.1]\ndirection = 1.5707963267948966", "[solver]",
    'temperature = [293.15, 273.15]\n[sweep]\n"layers[0].thickness" = [2e-5, 1e-5]\n'
    "[solver]\nnewton = false",
)  # fmt: skip


@pytest.fixture(scope="module")
def varied():
    scene = parse_scene(VARIED)
    return scene, plan(scene).run()


@pytest.mark.slow
def test_temperatures_seeds_and_paths_are_axes_of_what_slide_gives(varied):
    """The direction turns the velocity from the x axis to the y axis."""
    scene, results = varied
    names = ["layers[0].thickness", "temperature", "seed", "pressure", "velocity"]
    assert list(results.message.dims) == names and results.friction.shape == (2, 2, 2, 1, 2)
    assert np.all(results.message == "") and results["seed"].values.tolist() == [3, 4]
    assert results["layers[0].thickness"].units == "m"
    random, index = scene.surface, (1, 1, 1, 0, 1)
    surface = gc.random_surface(random.spectrum, random.grid, jax.random.key(4))
    block = gc.with_values(scene.stack, {"layers[0].thickness": 1e-5}).at(273.15)
    given = {"pressure": 2e5, "velocity": [0.0, 0.1], "rtol": scene.rtol, "solver": scene.solver}
    sliding = gc.slide(block, surface, **given)
    for name in ("friction", "contact_area", "mean_gap"):
        np.testing.assert_allclose(results[name][index], getattr(sliding, name), rtol=1e-6)
    assert kept_solves(results) == [index]
    fields, own = kept_contact(results, index)
    np.testing.assert_allclose(fields.pressure, sliding.pressure, rtol=1e-3, atol=1)
    np.testing.assert_allclose(own.heights, surface.heights, atol=1e-15)
    np.testing.assert_array_equal(results.heights, build_surface(scene).heights)


MELT = 'kind = "prony"\nequilibrium = 0.0\nstrengths = [1e6]\ntimes = [1e-2]'
SOLID = MELT.replace("0.0", "1e5")
