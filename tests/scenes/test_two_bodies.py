"""Scenes of two bodies: the tables [counterface] and [block_surface]."""

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.scenes.described import described
from graded_contact.scenes.plan import plan
from graded_contact.scenes.scene_file import parse_scene
from graded_contact.scenes.toml import parse_toml

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

[counterface]
base = {kind = "half_space", material = "rubber"}

[[counterface.layers]]
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
    assert case.counterface == expected and not case.stack.layers
    # Another surface than that of the counterface, out of the block.
    np.testing.assert_allclose(gc.statistics(case.block_surface).rms_slope, 0.05, rtol=0.05)
    aligned = np.corrcoef(case.surface.heights, case.block_surface.heights)[0, 1]
    assert abs(aligned) < 0.9
    assert described(parse_toml(MOVING)) == "rubber on a random surface of coat 20 µm, rubber"
    told = " ".join(str(scene).split())
    assert "counterface layer 1 coat, 20 µm base rubber, half space materials" in told
    assert "coat elastic, modulus 10 MPa, poisson 0.4" in told and "HalfSpace" not in told


@pytest.mark.slow
@pytest.mark.parametrize("text", [SCENE, MOVING])
def test_a_run_of_two_bodies_is_that_of_python(text):
    scene, case = case_of(text)
    found = plan(scene).run().squeeze()
    assert found.message == ""
    how = {"rtol": scene.rtol, "pressure": 1e5, "counterface": case.counterface}
    if scene.motion is None:
        expected = gc.slide(case.stack, case.surface, velocity=0.1, **how)
        np.testing.assert_allclose(found.friction, expected.friction, rtol=1e-5)
        return
    expected = gc.sliding.slide_cycle(
        case.stack, case.surface, displacement=case.displacement, period=case.period,
        block_surface=case.block_surface, **how,
    )  # fmt: skip
    np.testing.assert_allclose(found.counterface_power, expected.counterface_power, rtol=1e-3)
    np.testing.assert_allclose(found.mean_friction, expected.mean_friction, rtol=1e-3)


DESIGN = """
[design]
objective = "minimise_friction"
verify = 1

[design.parameters]
"layers[0].thickness" = [1e-5, 1e-4]
"""
LAYERED = SCENE + '[[layers]]\nmaterial = "coat"\nthickness = 3e-5\n'
