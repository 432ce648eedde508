"""[motion] with `once = true`: what scenes make of it, run, print, write and refuse."""

from pathlib import Path

import numpy as np
import pytest
from scene_texts import BARE

import graded_contact as gc
from graded_contact.scenes.plan import build_surface, plan
from graded_contact.scenes.results import kept_contact, read_results
from graded_contact.scenes.scene_file import parse_scene, read_scene
from graded_contact.sliding.motion.transient import dwell, ramp, start

EXAMPLES = Path(__file__).parents[2] / "examples"
RUBBER = 'kind = "prony"\nequilibrium = 2e6\nstrengths = [4e6]\ntimes = [1e-3]\npoisson = 0.49'
LINE = (
    BARE.replace("[32, 32]", "[16]").replace("q_high = 8e4", "q_high = 4e4")
    .replace('kind = "tyre_tread"', RUBBER).replace("velocity = [0.01, 1.0]\n", "")
)  # fmt: skip
BRAKE = """[motion]
once = true
kind = "ramp"
velocity = 0.1
duration = 2e-3
[[motion.then]]
kind = "start"
before = 0.1
velocity = 0.0
duration = 2e-3
[[motion.then]]
kind = "dwell"
duration = 0.1
num_times = 6
"""
LOADED = LINE.replace(
    "pressure = 2e5", "pressure = 2e5\nratio_times = [0.0, 3e-3]\npressure_ratio = [1.0, 1.5]"
)
ASKED = "[observe]\nflow = true\n[output]\nframes = 3\n"


def scene_of(text=LOADED + BRAKE + ASKED):
    return parse_scene(text)


@pytest.fixture(scope="module")
def braking():
    scene, said = scene_of(), []
    planned = plan(scene)
    return planned, planned.run(progress=lambda *done: said.append(done)), said


def test_motions_follow_one_another_and_steps_end_where_the_load_turns():
    scene, line = scene_of(), build_surface(scene_of()).grid
    brake = ramp(0.1, 2e-3, line).then(start(0.0, 2e-3, 0.1, line))
    whole = brake.then(dwell(0.1, num_times=6))
    times = np.asarray(scene.motion.times)
    assert np.isin(whole.times, times).all() and 3e-3 in times
    assert scene.num_times == whole.num_times + (3e-3 not in np.asarray(whole.times))
    moved = np.interp(times, whole.times, whole.displacement)
    np.testing.assert_allclose(scene.motion.displacement, moved, atol=1e-15)
    assert scene.step <= 0.5 + 1e-9 and scene.velocity.tolist() == [0.1]
    case = scene.case({"pressure": 2e5, "velocity": 0.1}, build_surface(scene))
    np.testing.assert_allclose(case.pressure, 2e5 * np.interp(times, [0, 3e-3], [1, 1.5]))


@pytest.mark.slow
def test_a_run_is_slide_history(braking):
    planned, results, _ = braking
    scene = planned.scene
    found = gc.sliding.slide_transient(
        scene.stack, build_surface(scene), times=scene.motion.times,
        displacement=scene.motion.displacement, fields_at=scene.kept_steps, rtol=scene.rtol,
        pressure=2e5 * np.interp(scene.motion.times, [0, 3e-3], [1, 1.5]),
    )  # fmt: skip
    one = results.isel(pressure=0, velocity=0)
    for name in ("friction", "load", "contact_area", "mean_gap", "work_done", "mean_friction"):
        np.testing.assert_allclose(one[name], found.recorded[name], rtol=1e-9, atol=1e-12)
    fields, _ = kept_contact(results, (0, 0))
    np.testing.assert_allclose(fields["gap"], found.gap, atol=1e-15)
    np.testing.assert_array_equal(fields["field_time"], found.field_times)
    drawn = gc.plot.plot_transient(found).axes[1].lines[0].get_ydata()
    np.testing.assert_allclose(drawn, found.recorded["contact_area"])
    film = gc.plot.plot_film(found, build_surface(scene), times=[0, 2])
    assert [axes.get_title().split(",")[0] for axes in film.axes] == ["2 ms", "104 ms"]


def test_results_are_over_time_and_keep_the_fields_of_their_frames(braking, tmp_path):
    planned, results, _ = braking
    scene = planned.scene
    times = np.asarray(scene.motion.times)
    assert np.all(results.message == "")
    one = results.isel(pressure=0, velocity=0)
    assert one.friction.dims == ("time",) and one.time.attrs["units"] == "s"
    np.testing.assert_array_equal(one.time, times)
    np.testing.assert_allclose(one["load"], 2e5 * np.interp(times, [0, 3e-3], [1, 1.5]), rtol=1e-9)
    # The work is that of the traction along the way, by trapezoids.
    traction, way = (one[name].values for name in ("traction", "surface_displacement"))
    steps = np.diff(way, prepend=0) * (traction + np.append(0, traction[:-1])) / 2
    np.testing.assert_allclose(one.work_done, np.cumsum(steps), rtol=1e-9)
    kept = list(scene.kept_steps)
    assert kept[-1] == scene.num_times - 1 and len(kept) == 3
    fields, _ = kept_contact(results, (0, 0))
    np.testing.assert_array_equal(fields["field_time"], times[kept])
    pressure = fields["pressure"].mean("x")
    np.testing.assert_allclose(pressure, one["load"].values[kept], rtol=1e-6)
    # Of a profile K along its grooves is the mean of u³ over the open gap.
    flow = one.flow_along_y.values
    assert np.flatnonzero(np.isfinite(flow)).tolist() == kept
    cubes = np.where(fields["pressure"] > 0, 0, fields["gap"]) ** 3
    np.testing.assert_allclose(flow[kept], cubes.mean(axis=1), rtol=1e-9)
    gc.studies.dataset.write(tmp_path / "r.h5", results)
    assert read_results(tmp_path / "r.h5").identical(results)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["braking", "seal", "load_steps"])
def test_an_example_of_what_happens_once_runs(name, monkeypatch):
    scene = read_scene(EXAMPLES / f"{name}.toml")
    text = scene.text.replace("[64, 64]", "[16]").replace("q_high = 5e4", "q_high = 4e4")
    results = plan(parse_scene(text, EXAMPLES)).run()
    assert np.all(results.message == "") and np.isfinite(results.contact_area).all()
    one = results.isel(pressure=0, velocity=0)
    if name == "braking":  # the slip ends and never reverses
        assert np.all(np.diff(one.surface_displacement) >= -1e-15)
        assert abs(one.friction[-1]) < 1e-3 < one.peak_friction
    if name == "seal":
        flow = one.flow_along_y.values[np.isfinite(one.flow_along_y)]
        assert np.all(np.diff(flow) < 0) and one.time[-1] == 3.156e8


ELASTIC = 'kind = "tyre_tread"'
MEASURED = RUBBER + "\nmeasured = {omega = [10.0, 1e3]}"
