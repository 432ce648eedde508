"""The tables [motion], [shear] and [heating], spheres and windows: what they make, and refusals."""

import equinox as eqx
import jax
import numpy as np
import pytest
from scene_texts import BARE, changed

import graded_contact as gc
from graded_contact.blocks import Bond, Film
from graded_contact.contacts import AdhesiveLJ, ExponentialAdhesion, RepulsiveLJ
from graded_contact.scenes.collect import numbers_of_scene
from graded_contact.scenes.scene_file import parse_scene
from graded_contact.scenes.theory import mean_field_at, roughness_of

STILL = BARE.replace("velocity = [0.01, 1.0]\n", "")
SINE = '[motion]\nkind = "sinusoidal"\nstroke = 2e-4\nfrequency = 20.0\nnum_times = 16\n'
PEAKED = '[shear]\nkind = "peaked"\npeak = 1e6\nvelocity = 0.1\nsteepness = 0.1\n'
SHIFT = 'shift = {kind = "arrhenius", activation_energy = 1e5, reference = 300.0}\n'
SOFT = """[materials.soft]
kind = "softened"
material = "tread"
strain = [1e-3, 1e-1]
storage = [1.0, 0.5]
loss = [1.0, 0.7]
[base]"""
SOFTENED = BARE.replace("[base]", SOFT).replace(
    '\nmaterial = "tread"\n[load', '\nmaterial = "soft"\n[load'
)
HEATING = "[heating]\nconductivity = 0.2\ndiffusivity = 1e-7\n"


def test_a_motion_is_that_of_the_constructor_and_its_speed_the_velocity():
    scene = parse_scene(STILL + SINE)
    motion = gc.sliding.sinusoidal(2e-4, 20.0, 16)
    np.testing.assert_array_equal(scene.motion.displacement, motion.displacement)
    assert scene.num_times == 16 and list(scene.axes) == ["pressure", "velocity"]
    np.testing.assert_allclose(scene.velocity, [motion.highest_speed])
    np.testing.assert_allclose(scene.period_at(scene.velocity), [0.05], rtol=1e-15)
    faster = parse_scene(BARE + SINE)
    speed = 2e-4 * np.sin(np.pi / 8) / 2 * 16 / faster.period_at(faster.velocity)
    np.testing.assert_allclose(speed, [0.01, 1.0], rtol=1e-12)


@pytest.mark.parametrize("head", ["", "t [s], s [m]\n"])
def test_a_recorded_motion_is_read_from_a_table(tmp_path, head):
    times, moved = np.arange(40) / 400, 1e-4 * np.sin(2 * np.pi * np.arange(40) / 40)
    rows = "".join(f"{t:.6g}, {s:.12g}\n" for t, s in zip(times, moved, strict=True))
    (tmp_path / "s.csv").write_text(head + rows)
    text = '[motion]\nkind = "recorded"\npath = "s.csv"\nperiod = 0.1\nnum_times = 16\n'
    scene = parse_scene(STILL + text, tmp_path)
    expected = gc.sliding.recorded(times, moved, 0.1, 16)
    np.testing.assert_allclose(scene.motion.displacement, expected.displacement, atol=1e-15)
    assert scene.inputs == {("[motion]", "path"): tmp_path / "s.csv"}
    # Units that nobody states are warnings.
    told = ["motion: The times are assumed to be in s", "motion: The displacements are assumed to"]
    assert [
        sentence[: len(start)] for sentence, start in zip(scene.assumed, told, strict=False)
    ] == ([] if head else told)


def test_shear_and_heating_are_those_of_the_constructors():
    text = STILL.replace("[load]", "[load]\nvelocity = 1.0\ntemperature = 300.0")
    scene = parse_scene(text + PEAKED + SHIFT + HEATING)
    law = gc.sliding.PeakedShear(1e6, 0.1, 0.1, gc.Arrhenius(1e5, 300.0))
    assert repr(scene.shear) == repr(law) and float(scene.heating.diffusivity) == 1e-7
    one, two = (
        text + PEAKED + SHIFT + HEATING.replace("0.2", parts) for parts in ("[0.2]", "[1, 2]")
    )
    assert parse_scene(one).heating.conductivity.tolist() == [0.2]
    with pytest.raises(ValueError, match=r"^\[heating\] `conductivity` .* needed, or 1: one"):
        parse_scene(two)  # a block without layers
    constant = parse_scene(BARE + '[shear]\nkind = "constant"\nstress = 1e5\n').shear
    assert float(constant.stress) == 1e5


@pytest.mark.parametrize(
    "lines, law",
    [
        ('kind = "hard_wall"\nhardness = 2e6', gc.HardWall(2e6)),
        ('kind = "repulsive_lj"\nrange = 1e-9\npressure = 1e6', RepulsiveLJ(1e-9, 1e6)),
        ('kind = "adhesive_lj"\nrange = 1e-9\nwork = 0.05\ncontact_gap = 1.2',
         AdhesiveLJ(1e-9, 0.05, 1.2)),
        ('kind = "exponential_adhesion"\nrange = 1e-9\nwork = 0.05',
         ExponentialAdhesion(1e-9, 0.05)),
    ],
)  # fmt: skip
def test_a_law_of_contact_is_that_of_the_constructor_and_has_no_mean_field(lines, law):
    scene = parse_scene(f"{BARE}\n[law]\n{lines}\n")
    surface = scene.surface.build()
    case = scene.case({"pressure": 2e5, "velocity": 1.0}, surface)
    assert eqx.tree_equal(scene.law, law) and eqx.tree_equal(case.law, law)
    assert mean_field_at(scene, surface, (0, 0)) is None
    with pytest.raises(ValueError, match=r"The mean field does not take the table \[law\]"):
        roughness_of(scene, surface)


def test_coulomb_friction_is_a_kind_of_shear():
    for key, coupled in (("", True), ("coupled = false\n", False)):
        scene = parse_scene(BARE + f"[shear]\nkind = 'coulomb'\ncoefficient = 0.5\n{key}")
        assert scene.shear.coupled is coupled and float(scene.shear.coefficient) == 0.5
        numbers = numbers_of_scene(scene, scene.surface.build())
        assert ("block_friction" in numbers) is coupled


def test_anisotropy_and_softening_are_keys():
    lay = BARE.replace(
        "hurst = 0.8", "hurst = 0.8\nanisotropy = 3.0\nangle = 0.5\nroll_off = 'smooth'"
    )
    spectrum = parse_scene(lay).surface.spectrum
    assert float(spectrum.anisotropy) == 3.0 and float(spectrum.angle) == 0.5
    text = SOFTENED.replace("loss = [1.0, 0.7]", "loss = [1.0, 0.7]\namplitude = 0.1")
    found = parse_scene(text).stack.base.material.modulus(1e3)
    plain = parse_scene(BARE).stack.base.material.modulus(1e3)
    np.testing.assert_allclose(found, 0.5 * plain.real + 0.7j * plain.imag, rtol=1e-12)
    above = BARE.replace("[materials.tread]", SOFT.replace("[base]", "[materials.tread]"))
    with pytest.raises(ValueError, match=r"`material` = 'tread' must stand below"):
        parse_scene(above)


def test_a_sphere_is_a_window_with_the_heights_of_hertz():
    lines = BARE.split("[grid]")[1]
    surface = parse_scene(
        '[surface]\nkind = "sphere"\nradius = 2e-3\n[grid]' + lines
    ).surface.build()
    assert not surface.periodic and surface.grid.shape == (32, 32)
    heights = np.asarray(surface.heights)
    np.testing.assert_array_equal(heights, heights[::-1, ::-1])
    x, y = (np.array([3, 20]) - 15.5) * 1e-3 / 32
    np.testing.assert_allclose(heights[3, 20], -(x**2 + y**2) / 4e-3, rtol=1e-12)


def test_strain_per_slope_is_a_key_of_the_load():
    key = "[load]\nstrain_per_slope = 0.7"
    scene = parse_scene(SOFTENED.replace("[load]", key))
    assert scene.strain_per_slope == 0.7
    surface = scene.surface.build()
    at = dict(pressure=float(scene.pressure[0]), velocity=1.0, strain_per_slope=0.7)
    field = gc.mean_field_friction(scene.stack, scene.surface.spectrum, **at)
    np.testing.assert_allclose(mean_field_at(scene, surface, (0, 1)).friction, field.friction)
    with pytest.raises(ValueError, match=r"\[load\] `strain_per_slope=0.7` is refused: `stack`"):
        parse_scene(BARE.replace("[load]", key))
    with pytest.raises(ValueError, match=r"\[motion\] does not take the key `strain_per_slope`"):
        parse_scene(SOFTENED.replace("[load]", key) + SINE)


def test_an_open_file_is_a_window_with_its_tilt(tmp_path):
    heights = np.add.outer(1e-6 * np.arange(8.0), np.sin(np.arange(8.0)) * 1e-6)
    surface = gc.surfaces.surface_from_heights(heights, 1e-3, periodic="open")
    assert not surface.periodic
    np.testing.assert_allclose(surface.heights, heights - heights.mean(), atol=1e-20)
    np.savez(tmp_path / "h.npz", heights=heights, size=1e-3)
    text = '[surface]\nkind = "file"\npath = "h.npz"\nperiodic = "open"\nunit = "m"\n[materials'
    scene = parse_scene(text + BARE.split("[materials", 1)[1], tmp_path)
    np.testing.assert_array_equal(scene.surface.build().heights, surface.heights)


def test_directions_are_an_axis():
    text = BARE.replace("[load]", "[load]\ndirection = {from = 0.0, to = 1.2, points = 3}")
    scene = parse_scene(text)
    assert list(scene.axes) == ["direction", "pressure", "velocity"]
    surface = scene.surface.build()
    point = {"pressure": 2e5, "velocity": 0.5, "direction": 0.6}
    expected = 0.5 * np.array([np.cos(0.6), np.sin(0.6)])
    np.testing.assert_allclose(scene.case(point, surface).velocity, expected, rtol=1e-15)
    fast = jax.jit(lambda angle: scene.case(point | {"direction": angle}, surface).velocity)
    np.testing.assert_allclose(fast(0.6), expected, rtol=1e-15)
    np.testing.assert_array_equal(fast(np.pi / 2), [0.0, 0.5])
    # One direction along x is one number, for which the kernel needs a column of frequencies.
    assert parse_scene(BARE).case(point, surface).velocity.shape == (2,)
    del point["direction"]
    assert parse_scene(BARE).case(point, surface).velocity.shape == ()


def test_a_bond_is_that_of_the_constructor_and_an_axis():
    """Springs, a film of a material, a graded layer's bond; a design may be robust against it."""
    below = lambda bond: changed("thickness = 2e-5", f"thickness = 2e-5\nbond = {bond}")  # noqa: E731
    text = below("{normal = 1e12, shear = inf}")
    scene = parse_scene(text + '[sweep]\n"layers[0].bond.shear" = [0.0, 1e10]\n')
    assert eqx.tree_equal(scene.stack.layers[0].bond, Bond(1e12))
    assert scene.axes["layers[0].bond.shear"].tolist() == [0.0, 1e10]
    scene = parse_scene(below('{material = "tread", thickness = 1e-6}'))
    assert eqx.tree_equal(scene.stack.layers[0].bond, Film(scene.stack.base.material, 1e-6))
    assert scene.materials["layers[0].bond.material"] == "tread"
    graded = 'top = "coat"\nbottom = "tread"'
    scene = parse_scene(below("{shear = 0.0}").replace('material = "coat"', graded))
    assert eqx.tree_equal(scene.stack.layers[0].bond, Bond(shear=0.0))
    assert parse_scene(below('"none"')).stack.layers[0].bond is None


EXAMPLES = (
    *("reciprocating", "shear_and_heat", "indenter", "failing_bond"),
    *("braking", "seal", "load_steps"),
)
