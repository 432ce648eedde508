"""Scenes of two bodies: the tables [counter] and [block_surface]."""

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.designs.problem import criteria_of
from graded_contact.designs.table import parse_design
from graded_contact.scenes.described import described
from graded_contact.scenes.plan import plan
from graded_contact.scenes.scene_file import parse_scene
from graded_contact.scenes.theory import errors_of_bodies
from graded_contact.scenes.toml import parse_toml
from graded_contact.studies.parameter_covariance import Errors, write_errors

SCENE = """
[surface]
kind = "self_affine"
rms_slope = 0.1
hurst = 0.8
q_roll = 1.3e4
q_high = 4e4

[grid]
shape = 16
size = 1e-3

[materials.rubber]
kind = "prony"
equilibrium = 2e6
strengths = [4e6]
times = [1e-2]
poisson = 0.49

[materials.coat]
kind = "elastic"
modulus = 1e7
poisson = 0.4

[base]
kind = "half_space"
material = "rubber"

[counter]
base = {kind = "half_space", material = "rubber"}

[[counter.layers]]
material = "coat"
thickness = 2e-5

[load]
pressure = 1e5
velocity = 0.1
"""
MOVING = (
    SCENE
    + """
[block_surface]
kind = "self_affine"
rms_slope = 0.05
hurst = 0.8
q_roll = 1.3e4
q_high = 4e4

[motion]
kind = "sinusoidal"
stroke = 4e-4
frequency = 10.0
num_times = 32
"""
)


def case_of(text):
    scene = parse_scene(text)
    point = {name: at[0] for name, at in scene.axes.items()}
    return scene, scene.case(point, scene.surface.build())


def test_tables_of_two_bodies_are_those_of_python():
    scene, case = case_of(MOVING)
    rubber, coat = gc.Prony(2e6, [4e6], [1e-2], 0.49), gc.Elastic(1e7, 0.4)
    expected = gc.Stack(layers=(gc.Layer(coat, 2e-5),), base=gc.HalfSpace(rubber))
    assert case.counter == expected and not case.stack.layers
    # Another surface than that of the counter, out of the block.
    np.testing.assert_allclose(gc.statistics(case.block_surface).rms_slope, 0.05, rtol=0.05)
    aligned = np.corrcoef(case.surface.heights, case.block_surface.heights)[0, 1]
    assert abs(aligned) < 0.9
    assert described(parse_toml(MOVING)) == "rubber on a random surface of coat 20 µm, rubber"
    told = " ".join(str(scene).split())
    assert "counter layer 1 coat, 20 µm base rubber, half space materials" in told
    assert "coat elastic, modulus 10 MPa, poisson 0.4" in told and "HalfSpace" not in told


def test_solves_of_another_counter_have_other_names():
    softer = SCENE.replace("modulus = 1e7", "modulus = 1e6")
    rigid = SCENE[: SCENE.index("[counter]")] + SCENE[SCENE.index("[load]") :]
    names = {str(plan(parse_scene(text)).points.item()) for text in (SCENE, softer, rigid)}
    assert len(names) == 3


def test_a_counter_has_the_temperature_of_the_load():
    shift = '\nshift = {kind = "wlf", c1 = 10.0, c2 = 80.0, reference = 293.0}\n'
    warm = SCENE.replace("poisson = 0.49", "poisson = 0.49" + shift, 1) + "temperature = 313.0\n"
    _, case = case_of(warm)
    assert case.counter.base.material.times[0] < 0.5 * 1e-2
    assert case.counter.base.material.times[0] == case.stack.base.material.times[0]


@pytest.mark.parametrize(
    "text, match",
    [
        (MOVING.replace("[motion]", "[heating]").split('kind = "sinusoidal"')[0], "heating"),
        (SCENE + MOVING[len(SCENE) : MOVING.index("[motion]")], r"\[block_surface\] needs"),
        (SCENE.replace("[[counter.layers]]\nmaterial", "[[counter.layers]]\nmateral"), "counter"),
        (SCENE.replace("equilibrium = 2e6", "equilibrium = 0.0"), r"\[counter\].*liquid"),
        (SCENE + '[sweep]\n"counter.layers[1].thickness" = [1e-5]\n', "number of the counter.*0"),
        (SCENE + '[sweep]\n"counter.layers[0].thickness" = [-1e-5]\n', "thickness"),
        (
            SCENE + '[sweep]\n"counter.base.material.equilibrium" = [0.0, 2e6]\n',
            r"\[counter\].*liquid",
        ),
        (
            SCENE[: SCENE.index("[counter]")]
            + SCENE[SCENE.index("[load]") :]
            + '[sweep]\n"counter.layers[0].thickness" = [1e-5]\n',
            r"\[sweep\].*need the table \[counter\]",
        ),
        (MOVING.replace("rms_slope = 0.05", "rms_slope = 0.05\nseeds = 3"), "block_surface"),
    ],
)
def test_what_no_scene_of_two_bodies_has_is_refused_by_its_table(text, match):
    with pytest.raises(ValueError, match=match):
        parse_scene(text)


def test_a_page_refuses_a_counter_by_name(tmp_path):
    from graded_contact.page.document import open_document

    (tmp_path / "two.toml").write_text(SCENE)
    with pytest.raises(ValueError, match=r"page does not take the table \[counter\]"):
        open_document(tmp_path / "two.toml")


@pytest.mark.slow
@pytest.mark.parametrize("text", [SCENE, MOVING])
def test_a_run_of_two_bodies_is_that_of_python(text):
    scene, case = case_of(text)
    found = plan(scene).run().squeeze()
    assert found.message == ""
    how = {"rtol": scene.rtol, "pressure": 1e5, "counter": case.counter}
    if scene.motion is None:
        expected = gc.slide(case.stack, case.surface, velocity=0.1, **how)
        np.testing.assert_allclose(found.friction, expected.friction, rtol=1e-5)
        return
    expected = gc.sliding.slide_cycle(
        case.stack, case.surface, displacement=case.displacement, period=case.period,
        block_surface=case.block_surface, **how,
    )  # fmt: skip
    np.testing.assert_allclose(found.counter_power, expected.counter_power, rtol=1e-3)
    np.testing.assert_allclose(found.mean_friction, expected.mean_friction, rtol=1e-3)


DESIGN = """
[design]
objective = "minimise_friction"
verify = 1

[design.parameters]
"layers[0].thickness" = [1e-5, 1e-4]
"""
LAYERED = SCENE + '[[layers]]\nmaterial = "coat"\nthickness = 3e-5\n'


def test_a_design_of_the_block_runs_against_a_counter_at_its_temperature():
    shift = '\nshift = {kind = "wlf", c1 = 10.0, c2 = 80.0, reference = 293.0}\n'
    warm = LAYERED.replace("poisson = 0.49", "poisson = 0.49" + shift, 1)
    study = parse_design(warm.replace("[[layers]]", "temperature = 313.0\n[[layers]]") + DESIGN)
    _, case = case_of(warm.replace("[[layers]]", "temperature = 313.0\n[[layers]]"))
    assert study.case_of(study.scene.stack).counter == case.counter == study.scene.counter
    assert case.counter.base.material.times[0] < 0.5 * 1e-2
    with pytest.raises(ValueError, match="number of the block"):
        parse_design(LAYERED + DESIGN.replace('"layers[0]', '"counter.layers[0]'))


@pytest.mark.slow
def test_criteria_of_a_design_are_those_of_both_bodies():
    study = parse_design(LAYERED + DESIGN)
    _, case = case_of(LAYERED)
    how = {"pressure": 1e5, "velocity": 0.1, "counter": case.counter}
    field = gc.mean_field_friction(case.stack, study.scene.surface.spectrum, **how)
    found = criteria_of(study, case.stack)
    np.testing.assert_allclose(found["friction"], field.friction, rtol=1e-3)
    by_contact = criteria_of(study, case.stack, [case.surface])
    expected = gc.slide(case.stack, case.surface, **how)
    np.testing.assert_allclose(by_contact["friction"], expected.friction, rtol=1e-4)


@pytest.mark.slow
def test_a_sweep_and_errors_of_the_counter_are_those_of_python(tmp_path):
    """A material of both bodies has the same errors in both."""
    write_errors(tmp_path / "e.csv", Errors(("equilibrium",), [[1e5]]))
    text = SCENE.replace("poisson = 0.49", 'poisson = 0.49\nerrors = "e.csv"')
    text = text.replace("pressure = 1e5", "pressure = 2e4")
    text += '[solver]\nrtol = 1e-8\n[sweep]\n"counter.layers[0].thickness" = [1e-5, 4e-5]\n'
    scene = parse_scene(text, tmp_path)
    known = errors_of_bodies(scene)
    assert known.paths == ("base.material.equilibrium", "counter.base.material.equilibrium")
    found = plan(scene).run().squeeze()
    surface = scene.surface.build()
    for i, thickness in enumerate((1e-5, 4e-5)):

        def friction(equilibrium, thickness=thickness):
            base = gc.HalfSpace(gc.Prony(equilibrium, [4e6], [1e-2], 0.49))
            counter = gc.Stack(layers=(gc.Layer(gc.Elastic(1e7, 0.4), thickness),), base=base)
            how = {"pressure": 2e4, "velocity": 0.1, "rtol": 1e-10}
            return float(gc.slide(gc.Stack(base=base), surface, counter=counter, **how).friction)

        np.testing.assert_allclose(found.friction[i], friction(2e6), rtol=1e-6)
        slope = (friction(2.02e6) - friction(1.98e6)) / 4e4
        np.testing.assert_allclose(found.friction_standard_error[i], abs(slope) * 1e5, rtol=1e-2)
