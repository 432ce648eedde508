"""Runs of scenes are what the functions of Python give, over the axes of the scene."""

from importlib.metadata import version

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import BARE, changed

import graded_contact as gc
from graded_contact.scenes import parse_scene, read_results, run_scene
from graded_contact.scenes.run import numbers_at, write_results
from graded_contact.sliding.number import numbers_of

SMALL = BARE.replace("[32, 32]", "[16, 16]").replace("q_high = 8e4", "q_high = 4e4")
STILL = SMALL.replace("velocity = [0.01, 1.0]\n", "")
RUBBER = 'kind = "prony"\nequilibrium = 2e6\nstrengths = [4e6]\ntimes = [1e-3]\npoisson = 0.49'
# Without Newton steps a program compiles in two thirds of the time.
VARIED = changed(
    "[32, 32]", "[16]", "8e4", "4e4", "seed = 3", "seed = 3\nseeds = 2", "[2e5, 4e5]", "2e5",
    "[0.01, 1.0]", "[0.01, 0.1]", "[solver]",
    'temperature = [293.15, 273.15]\n[sweep]\n"layers[0].thickness" = [2e-5, 1e-5]\n'
    "[solver]\nnewton = false",
)  # fmt: skip


def traced(text):
    """Shapes of what a scene computes at a point, by name; nothing is compiled."""
    scene = parse_scene(text)
    return jax.eval_shape(lambda point: numbers_at(scene, point), scene.last)


def only(patch, *names):
    """Few numbers of a contact: all of them take a program of a minute."""
    patch.setattr("graded_contact.scenes.run.numbers_of", lambda *_: names)


@pytest.fixture(scope="module")
def varied():
    scene = parse_scene(VARIED)
    with pytest.MonkeyPatch.context() as patch:
        only(patch, "friction", "mean_gap")
        return scene, run_scene(scene)


def test_all_axes_are_those_of_slide(varied):
    scene, results = varied
    names = ["layers[0].thickness", "seed", "temperature", "pressure", "velocity"]
    assert list(results.message.dims) == names and np.all(results.message == "")
    assert results.friction.shape == (2, 2, 2, 1, 2)
    assert results["seed"].values.tolist() == [3, 4]
    assert results["layers[0].thickness"].units == "m" and results.mean_gap.units == "m"
    block = gc.with_values(scene.bodies.stack, {"layers[0].thickness": 1e-5}).at(273.15)
    surface = scene.surface(4)
    given = {"pressure": 2e5, "velocity": 0.1, "rtol": 1e-6}
    sliding = gc.slide(block, surface, solver=scene.numerics.solver, **given)
    last = results.isel(dict.fromkeys(names, -1))
    np.testing.assert_allclose(last.friction, sliding.friction, rtol=1e-6)
    np.testing.assert_allclose(last.mean_gap, sliding.mean_gap, rtol=1e-6)
    # Only the last solve has fields.
    assert results.contact_pressure.dims == ("x",)
    np.testing.assert_allclose(results.contact_pressure, sliding.pressure, rtol=1e-3, atol=1)
    np.testing.assert_allclose(results.heights, surface.heights, atol=1e-15)
    assert results.attrs["scene"] == VARIED
    assert results.attrs["version"] == version("graded_contact")


def test_a_velocity_has_its_place_on_a_master_curve(varied):
    _, results = varied
    law = gc.tyre_tread().shift
    for kelvin, row in zip((293.15, 273.15), results.reduced_velocity.values, strict=True):
        expected = np.exp(law.log_factor(kelvin)) * np.array([0.01, 0.1])
        np.testing.assert_allclose(row, expected, rtol=1e-12)


def test_results_come_back_bit_for_bit_and_damaged_ones_are_refused(varied, tmp_path):
    _, results = varied
    path = tmp_path / "a.h5"
    write_results(path, results)
    assert read_results(path).identical(results)
    assert [file.name for file in tmp_path.iterdir()] == ["a.h5"]
    with h5py.File(path) as file:
        chunk = file["contact_pressure"].id.get_chunk_info(0)
    content, middle = bytearray(path.read_bytes()), chunk.byte_offset + chunk.size // 2
    content[middle : middle + 8] = bytes(8)
    path.write_bytes(content)
    for damaged in (path, tmp_path / "b.h5"):
        (tmp_path / "b.h5").write_text("not HDF5")
        with pytest.raises(ValueError, match="path"):
            read_results(damaged)


def dry_run(monkeypatch, text):
    """The results of a scene with zeros for all numbers: they are traced, and nothing is solved."""
    like = traced(text)
    zeros = lambda *_: jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), like)  # noqa: E731
    monkeypatch.setattr("graded_contact.scenes.run.numbers_at", zeros)
    return run_scene(parse_scene(text))


CYCLE = """[motion]
kind = "sinusoidal"
stroke = 4e-5
frequency = 20.0
num_times = 8
"""


def test_a_motion_has_numbers_over_time_and_every_solve_may_keep_its_fields(monkeypatch):
    text = STILL.replace("pressure = 2e5", "pressure = [2e5, 3e5]\ndirection = 0.5") + CYCLE
    only(monkeypatch, "friction", "traction")
    results = dry_run(monkeypatch, text + "[output]\nfields = 'every'\n")
    assert results.traction.dims == ("direction", "pressure", "time")
    assert results.gap.dims == ("direction", "pressure", "time", "x", "y")
    np.testing.assert_array_equal(results.time, np.arange(8) / 8)
    moved = parse_scene(text).motion.displacement
    np.testing.assert_array_equal(results.surface_displacement, moved)


BRAKE = """[[motion]]
kind = "ramp"
velocity = 0.1
duration = 1e-3
[[motion]]
kind = "start"
before = 0.1
velocity = 0.0
duration = 1e-3
[[motion]]
kind = "dwell"
duration = 0.1
num_times = 6
[output]
frames = 3
"""
FLUID = "[fluid]\nviscosity = 2e-3\npressure_difference = 1e4\n"


def test_a_transient_is_over_time_with_fields_at_its_frames(monkeypatch):
    only(monkeypatch, "friction", "load", "traction", "work_done")
    text = STILL.replace('kind = "tyre_tread"', RUBBER).replace("[16, 16]", "[16]")
    ratio = "ratio_times = [0.0, 2e-3]\npressure_ratio = [1.0, 1.5]"
    text = text.replace("pressure = 2e5", f"pressure = 2e5\n{ratio}") + BRAKE
    scene = parse_scene(text)
    times = np.asarray(scene.motion.times)
    results = run_scene(scene)
    one = results.isel(pressure=0)
    assert np.all(results.message == "") and one.friction.dims == ("time",)
    np.testing.assert_array_equal(one.time, times)
    np.testing.assert_allclose(one["load"], 2e5 * np.interp(times, [0, 2e-3], [1, 1.5]), rtol=1e-8)
    # The work is that of the traction along the way, by trapezoids.
    traction, way = one.traction.values, one.surface_displacement.values
    steps = np.diff(way, prepend=0) * (traction + np.append(0, traction[:-1])) / 2
    np.testing.assert_allclose(one.work_done, np.cumsum(steps), rtol=1e-8)
    frames = [i for i, time in enumerate(times) if time in one.field_time]
    assert len(frames) == 3 and frames[-1] == len(times) - 1
    pressure = one.contact_pressure
    np.testing.assert_allclose(pressure.mean("x"), one["load"][frames], rtol=1e-6)


def test_optional_outputs_are_there_when_asked_for(monkeypatch):
    """Their values are tested in the rooms that compute them; only they are traced."""
    expected = {
        "contact_stiffness", "specific_conductance", "flow_along_x", "leakage_along_y_error",
        "tension", "tension_depth", "von_mises", "von_mises_depth",
    }  # fmt: skip
    asked = "stiffness = true\nconductance = true\nflow = true\ntension = true\nvon_mises = true\n"
    text = STILL.replace("pressure = 2e5", "pressure = 2e5\nvelocity = 0.1")
    few = lambda *given: [name for name in numbers_of(*given) if name in expected or "flow" in name]  # noqa: E731
    monkeypatch.setattr("graded_contact.scenes.run.numbers_of", few)
    assert traced(text + f"[observe]\n{asked}{FLUID}").keys() >= expected


def test_a_body_may_be_pressed_to_an_approach():
    text = '[surface]\nkind = "sphere"\nradius = 2e-2\n[grid]' + STILL.split("[grid]")[1]
    text = text.replace("pressure = 2e5", "approach = [1e-6, 2e-6]\nvelocity = 0.1")
    scene = parse_scene(text)
    case = scene.case(scene.last)
    assert list(scene.axes) == ["approach", "velocity"]
    assert case.approach == 2e-6 and case.pressure is None and not case.surface.periodic
