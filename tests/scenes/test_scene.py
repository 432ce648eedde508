"""A scene is the case that Python's constructors make; what is wrong is refused with its table."""

import re
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import BARE, TABLE, TEXT, changed, write

import graded_contact as gc
from graded_contact.blocks import shapes
from graded_contact.blocks.profile import Blend
from graded_contact.contacts import AdhesiveLJ, ExponentialAdhesion, RepulsiveLJ
from graded_contact.materials import Arrhenius, StrainSoftening, Tabulated
from graded_contact.response import Layering
from graded_contact.scenes import parse_scene, read_scene
from graded_contact.sliding import (
    Coulomb,
    Heating,
    PeakedShear,
    dwell,
    ramp,
    recorded,
    sinusoidal,
    start,
    start_stop,
)

EXAMPLES = Path(__file__).parents[2] / "examples"
DATA = Path(__file__).parents[3] / "shared" / "data"


def assert_equal(found, expected):
    """Both are the same tree, with the same numbers to the last bit."""
    left, right = jax.tree.flatten(found), jax.tree.flatten(expected)
    assert left[1] == right[1]
    for ours, theirs in zip(left[0], right[0], strict=True):
        np.testing.assert_array_equal(ours, theirs)
        assert np.asarray(ours).dtype == np.asarray(theirs).dtype


def rough(slope, roll, high, seed, points, edge):
    waves = gc.SelfAffine(
        rms_slope=slope, hurst=0.8, q_low=2 * np.pi / edge, q_roll=roll, q_high=high
    )
    return gc.random_surface(waves, gc.Grid((points, points), edge), jax.random.key(seed))


RUBBER = gc.Prony(2e6, [4e6, 8e6], [1e-2, 1e-4], 0.49)
COAT = gc.Elastic(1e7, 0.4)
COATED = gc.Stack(layers=(gc.Layer(COAT, 2e-5),), base=gc.HalfSpace(RUBBER))


def demo():
    modified = gc.Layer(gc.Elastic(6.51e6, 0.5), 50e-6)
    return gc.Case(
        stack=gc.Stack(layers=(modified,), base=gc.HalfSpace(gc.tyre_tread())),
        surface=rough(0.3, 3141.6, 25132.8, 1, 256, 8e-3),
        pressure=4e5, velocity=10.0,
    )  # fmt: skip


def skin():
    times = [1e-1, 1e-2, 1e-3, 1e-4]
    epidermis = gc.Prony(7e5, [2e5, 2.5e5, 3.2e5, 4e5], times, 0.48)
    dermis = gc.Prony(1e6, [2.9e5, 3.6e5, 4.6e5, 5.7e5], times, 0.48)
    layers = [(gc.Elastic(1.5e7, 0.45), 1.5e-5), (epidermis, 1.2e-4), (dermis, 2e-3)]
    stack = gc.Stack(
        layers=[gc.Layer(*layer) for layer in layers], base=gc.HalfSpace(gc.Elastic(2.5e3, 0.49))
    )
    return gc.Case(
        stack=stack, surface=rough(0.1, 6e3, 1.6e4, 1, 128, 4e-3), pressure=1e4, velocity=1.0
    )


def indenter():
    x = (np.arange(48) - 23.5) * np.asarray(gc.Grid((48, 48), 6e-4).spacing)[0]
    heights = -(np.add.outer(x**2, x**2)) / (2 * 2e-3)
    surface = gc.Surface(heights, gc.Grid((48, 48), 6e-4), periodic=False)
    return gc.Case(stack=COATED, surface=surface, pressure=3e4, velocity=1.0)


def shear_and_heat():
    law = PeakedShear(2e5, 1e-2, 0.1, Arrhenius(9e4, 293.15))
    return gc.Case(
        stack=gc.Stack(base=gc.HalfSpace(gc.tyre_tread(poisson=0.49))).at(293.15),
        surface=rough(0.3, 1.3e4, 5e4, 0, 32, 1e-3),
        pressure=3e5, velocity=10.0, temperature=293.15, shear=law,
        heating=Heating(0.25, 1.3e-7, 1.0),
    )  # fmt: skip


def reciprocating():
    surface = rough(0.1, 1.3e4, 5e4, 1, 32, 1e-3)
    motion = sinusoidal(4e-4, 10.0, grid=surface.grid)
    return gc.Case(
        stack=COATED, surface=surface, pressure=1e5, displacement=motion.displacement,
        period=motion.period * (motion.highest_speed / 1e-1),
    )  # fmt: skip


def braking():
    surface = rough(0.1, 1.3e4, 5e4, 1, 64, 1e-3)
    brake = ramp(0.1, 5e-3, surface.grid).then(start(0.0, 1e-2, 0.1, surface.grid))
    motion = brake.then(dwell(1.0))
    ratio = np.interp(motion.times, [0, 5e-3, 1.5e-2], [1, 1, 1.4])
    return gc.Case(
        stack=COATED, surface=surface, pressure=1e5 * ratio, displacement=motion.displacement,
        times=motion.times,
    )  # fmt: skip


def seal():
    times = [1e3, 1e5, 1e7, 1e8]
    motion = dwell(3.156e8, first=100.0)
    return gc.Case(
        stack=gc.Stack(base=gc.HalfSpace(gc.Prony(1.5e6, [1e6] * 4, times, 0.49))),
        surface=rough(0.1, 1.3e4, 5e4, 3, 64, 1e-3),
        pressure=4e4, displacement=motion.displacement, times=motion.times,
    )  # fmt: skip


@pytest.mark.parametrize(
    "make", [demo, skin, indenter, shear_and_heat, reciprocating, braking, seal],
    ids=lambda make: make.__name__,
)  # fmt: skip
def test_a_scene_equals_python(make):
    file = EXAMPLES / f"{make.__name__}.toml"
    file = file if file.exists() else Path(gc.scenes.__file__).with_name("demo.toml")
    scene = read_scene(file)
    point = {name: values[-1] for name, values in scene.axes.items()}
    expected = make()
    given = jax.tree.map(lambda leaf: np.asarray(leaf, float), expected.pressure)
    assert_equal(scene.case(point), eqx.tree_at(lambda case: case.pressure, expected, given))


@pytest.mark.skipif(not DATA.exists(), reason="measured data lie beside the project")
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("measured_*.toml")), ids=lambda p: p.stem)
def test_an_example_is_read_with_its_data(path):
    scene = read_scene(path)
    assert scene.surface.heights.shape == (1024, 1024)
    assert isinstance(scene.bodies.stack.base.material, Tabulated)


LAYER = 'material = "coat"\nthickness = 2e-5'
COAT_LINES = 'kind = "elastic"\nmodulus = 2e7\npoisson = 0.4'
GRADED = 'bottom = "tread"\ntop = "coat"\nshape = "sinusoidal"\nthickness = 2e-5'


@pytest.mark.parametrize(
    "lines, expected",
    [
        ('kind = "prony"\nequilibrium = 1e6\nstrengths = [2e6, 3e6]\ntimes = [1.0, 0.1]\n'
         'shift = {kind = "arrhenius", activation_energy = 1e5, reference = 293.15}',
         gc.Prony(1e6, [2e6, 3e6], [1.0, 0.1], 0.5, Arrhenius(1e5, 293.15))),
        ('kind = "prony_creep"\nglassy = 1e9\ncompliances = [1e-7]\ntimes = [1.0]\npoisson=0.3',
         gc.Prony.from_creep(1e9, [1e-7], [1.0], 0.3)),
        ('kind = "softened"\nmaterial = "tread"\nstrain = [1e-3, 1e-1]\nstorage = [1.0, 0.5]\n'
         "loss = [1.0, 0.7]",
         StrainSoftening(gc.tyre_tread(), [1e-3, 1e-1], [1.0, 0.5], [1.0, 0.7])),
        ('kind = "bulk_shear"\nbulk = "tread"\nshear = "tread"',
         gc.BulkShear(gc.tyre_tread(), gc.tyre_tread())),
    ],
)  # fmt: skip
def test_a_material_is_that_of_the_constructor(lines, expected):
    scene = parse_scene(changed(COAT_LINES, lines))
    assert_equal(scene.bodies.stack.layers[0].material, expected)


def test_a_table_makes_a_material_with_its_path_beside_the_scene(tmp_path):
    omega, modulus = gc.read_moduli(write(tmp_path, TABLE)).table()
    text = changed(COAT_LINES, 'kind = "tabulated"\npath = "table.csv"\npoisson = 0.4')
    layer = parse_scene(text, tmp_path).bodies.stack.layers[0]
    assert_equal(layer.material, Tabulated(omega, modulus, 0.4))
    with pytest.raises(FileNotFoundError, match=r"\[materials.coat\].*elsewhere.table.csv"):
        parse_scene(text, tmp_path / "elsewhere")


def test_a_layer_may_be_graded():
    text = changed(LAYER, GRADED, '"sinusoidal"', '{kind = "exponential", rate = 2.0}')
    text = text.replace("[solver]", '[solver]\ngraded_solver = "layering"')
    scene = parse_scene(text)
    profile = Blend(gc.tyre_tread(), gc.Elastic(2e7, 0.4), shapes.Exponential(2.0))
    layers = [gc.GradedLayer(profile, 2e-5)]
    base = gc.HalfSpace(gc.tyre_tread())
    assert_equal(scene.bodies.stack, gc.Stack(layers=layers, base=base, graded_solver=Layering()))
    assert scene.numerics.rtol == 1e-6 and not scene.numerics.throw


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
def test_a_law_of_contact_is_that_of_the_constructor(lines, law):
    scene = parse_scene(f"{BARE}\n[law]\n{lines}\n")
    assert_equal(scene.case(scene.last).law, law)


def test_options_of_a_case_are_tables_and_keys():
    text = BARE.replace("[load]", "[load]\nstrain_per_slope = 0.7")
    text += "[shear]\nkind = 'coulomb'\ncoefficient = 0.5\ncoupled = false\n"
    text += "[heating]\nconductivity = [0.2]\ndiffusivity = 1e-7\n"
    case = parse_scene(text).case({"pressure": 2e5, "velocity": 1.0})
    assert_equal(case.shear, Coulomb(0.5, coupled=False))
    assert_equal(case.heating, Heating([0.2], 1e-7)), case.strain_per_slope == 0.7


STILL = BARE.replace("velocity = [0.01, 1.0]\n", "")


def test_a_cycle_at_another_speed_has_another_period():
    motion = '[motion]\nkind = "start_stop"\nstroke = 4e-5\nmoving = 0.03\ndwell = 0.02\n'
    scene = parse_scene(BARE + motion + "num_times = 16\n")
    expected = start_stop(4e-5, 0.03, 0.02, 16)
    np.testing.assert_array_equal(scene.motion.displacement, expected.displacement)
    case = scene.case({"pressure": 2e5, "velocity": 1.0})
    np.testing.assert_allclose(case.period, 0.1 * expected.highest_speed / 1.0, rtol=1e-15)
    still = parse_scene(STILL + motion)
    assert "velocity" not in still.axes and still.case(still.last).period == 0.1


def test_a_direction_turns_the_motion_and_its_load_repeats():
    load = "[load]\ndirection = [0.0, 0.6]\npressure_ratio = [1.0, 1.5]"
    motion = '[motion]\nkind = "sinusoidal"\nstroke = 4e-5\nfrequency = 20.0\nnum_times = 8\n'
    scene = parse_scene(STILL.replace("[load]", load) + motion)
    case = scene.case({"direction": 0.6, "pressure": 2e5})
    moved = np.asarray(sinusoidal(4e-5, 20.0, 8).displacement)
    along = [np.cos(0.6), np.sin(0.6)]
    np.testing.assert_allclose(case.displacement, np.outer(moved, along), rtol=1e-15)
    ratio = [1, 1.125, 1.25, 1.375, 1.5, 1.375, 1.25, 1.125]
    np.testing.assert_allclose(case.pressure, 2e5 * np.array(ratio))


def test_a_recorded_motion_is_read_from_a_table(tmp_path):
    times, moved = np.arange(40) / 400, 1e-4 * np.sin(2 * np.pi * np.arange(40) / 40)
    rows = "".join(f"{t:.6g}, {s:.12g}\n" for t, s in zip(times, moved, strict=True))
    (tmp_path / "s.csv").write_text("time [s], displacement [m]\n" + rows)
    text = 'kind = "recorded"\npath = "s.csv"\n'
    scene = parse_scene(STILL + "[motion]\n" + text + "period = 0.1\nnum_times = 16\n", tmp_path)
    expected = recorded(times, moved, 0.1, 16).displacement
    np.testing.assert_allclose(scene.motion.displacement, expected, atol=1e-15)
    transient = parse_scene(STILL + "[[motion]]\n" + text, tmp_path).motion
    at = np.interp(transient.times, times - times[0], moved - moved[0])
    np.testing.assert_allclose(transient.displacement, at, atol=1e-12)


def test_steps_of_a_transient_also_end_where_its_load_turns():
    load = "pressure = 2e5\nratio_times = [0.0, 3e-3]\npressure_ratio = [1.0, 1.5]"
    text = STILL.replace("pressure = 2e5", load)
    scene = parse_scene(text + '[[motion]]\nkind = "ramp"\nvelocity = 0.1\nduration = 4e-3\n')
    times = np.asarray(scene.motion.times)
    own = ramp(0.1, 4e-3, gc.Grid((32,), 1e-3))
    assert np.isin(own.times, times).all() and 3e-3 in times
    case = scene.case(scene.last)
    np.testing.assert_allclose(case.displacement, 0.1 * times, rtol=1e-12)
    np.testing.assert_allclose(case.pressure, 2e5 * np.interp(times, [0, 3e-3], [1, 1.5]))


def test_both_bodies_may_be_rough_and_deform():
    body = '[counterface]\nbase = {kind = "half_space", material = "tread"}\n'
    body += '[[counterface.layers]]\nmaterial = "tread"\nthickness = 2e-5\n'
    own = '[block_surface]\nkind = "self_affine"\nrms_slope = 0.05\nhurst = 0.8\nq_roll = 1.3e4\n'
    motion = '[motion]\nkind = "sinusoidal"\nstroke = 4e-4\nfrequency = 10.0\n'
    scene = parse_scene(STILL + body + own + "q_high = 4e4\n" + motion)
    case = scene.case({**scene.last, "counterface.layers[0].thickness": 3e-5})
    rubber = gc.tyre_tread()
    counterface = gc.Stack(layers=[gc.Layer(rubber, 3e-5)], base=gc.HalfSpace(rubber))
    assert_equal(case.counterface, counterface)
    assert not case.stack.layers
    assert_equal(case.block_surface, rough(0.05, 1.3e4, 4e4, 1, 32, 1e-3))


def test_axes_may_be_traced_and_seeds_draw_other_surfaces():
    text = changed("seed = 3", "seed = 3\nseeds = 2", "[solver]",
                   'temperature = {from = 273.0, to = 293.0, points = 3}\n'
                   '[sweep]\n"layers[0].thickness" = {from = 1e-5, to = 1e-3, points = 3}\n'
                   "[solver]")  # fmt: skip
    scene = parse_scene(text)
    names = ["layers[0].thickness", "seed", "temperature", "pressure", "velocity"]
    assert list(scene.axes) == names
    np.testing.assert_allclose(scene.axes[names[0]], [1e-5, 1e-4, 1e-3])
    np.testing.assert_allclose(scene.axes["temperature"], [273, 283, 293])
    point = {name: values[1] for name, values in scene.axes.items()}
    case = jax.jit(scene.case)({name: jnp.asarray(number) for name, number in point.items()})
    np.testing.assert_allclose(
        case.surface.heights, rough(0.2, 2e4, 8e4, 4, 32, 1e-3).heights, atol=1e-15
    )
    block = gc.with_values(parse_scene(TEXT).bodies.stack, {names[0]: 1e-4}).at(283.0)
    for found, expected in zip(*map(jax.tree.leaves, (case.stack, block)), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_scene_file_is_named_in_its_errors(tmp_path):
    path = tmp_path / "small.toml"
    with pytest.raises(FileNotFoundError, match=r"small\.toml"):
        read_scene(path)
    path.write_text(changed("hurst", "hust"))
    with pytest.raises(ValueError, match=r"small\.toml: \[surface\]"):
        read_scene(path)


def in_table(table, line):
    """The texts that `changed` takes to add a table of one line."""
    return "[solver]", f"[{table}]\n{line}\n[solver]"


CYCLE = '[motion]\nkind = "sinusoidal"\nstroke = 4e-5\nfrequency = 20.0\nnum_times = 8'
HALF_SPACE = '[base]\nkind = "half_space"\nmaterial = "tread"'
# What is changed, each text for the next, and the table and key that the refusal names.
REFUSED = [
    (("thickness = 2e-5", "thicknes = 2e-5"), "[layers[0]]", "thicknes"),
    (("thickness = 2e-5", "thickness = -2e-5"), "[layers[0]]", "thickness"),
    (("thickness = 2e-5", "thickness = [2e-5, 3e-5]"), "[layers[0]]", "thickness"),
    (("thickness = 2e-5\n", ""), "[layers[0]]", "thickness"),
    (('material = "coat"', 'material = "coatt"'), "[layers[0].material]", "coat"),
    ((LAYER, GRADED, '"sinusoidal"', '"exponential"'), "[layers[0].shape]", "rate"),
    ((LAYER, GRADED, '"coat"', '"coal"'), "[layers[0].top]", "coat"),
    ((LAYER, GRADED + '\nmaterial = "coat"'), "[layers[0]]", "material"),
    (in_table("observe", "stiffness = true\n" + CYCLE), "[observe]", "stiffness"),
    (in_table("fluid", "viscosity = 1.0\npressure_difference = 1.0\n" + CYCLE), "[fluid]", "cycle"),
    (("[[layers]]", "[layers]"), "[layers]", "layers"),
    (('kind = "elastic"', 'kind = "elastik"'), "[materials.coat]", "elastic"),
    (("modulus = 2e7", 'modulus = "2e7"'), "[materials.coat]", "modulus"),
    (("modulus = 2e7", "modulus = true"), "[materials.coat]", "modulus"),
    (("poisson = 0.4", "poisson = 0.7"), "[materials.coat]", "poisson"),
    (("hurst =", "hust ="), "[surface]", "hust"),
    (("hurst = 0.8", ""), "[surface]", "hurst"),
    (("hurst = 0.8", 'hurst = "0.8"'), "[surface]", "hurst"),
    (("rms_slope = 0.2", ""), "[surface]", "rms_slope"),
    (("q_high = 8e4", "q_high = 8e9"), "[surface]", "q_high"),
    (("seed = 3", "seeds = 0"), "[surface]", "seeds"),
    (("[grid]", "[[grid]]"), "[grid]", "table"),
    (('"self_affine"', '"file"\npath = "no"'), "[grid]", "file"),
    ((HALF_SPACE, ""), "[the scene]", "base"),
    (("[base]", "[bas]"), "[the scene]", "bas"),
    (("[2e5, 4e5]", "[]"), "[load]", "pressure"),
    (("[2e5, 4e5]", "[-2e5, 4e5]"), "[load]", "pressure"),
    (("pressure =", "presure ="), "[load]", "presure"),
    (("[0.01, 1.0]", "{from=0.0, to=1.0, points=3}"), "[load]", "zero"),
    (("[0.01, 1.0]", "{from=0.1, to=1.0}"), "[load]", "velocity"),
    (("[0.01, 1.0]", "{from=0.1, to=1.0, points=2.5}"), "[load]", "float"),
    (("velocity = [0.01, 1.0]", ""), "[load]", "velocity"),
    (("velocity = [0.01", "pressure_ratio = [1, 2]\nvelocity = [0.01"), "[load]", "motion"),
    (("pressure = [2e5, 4e5]", "approach = 1e-6\npressure_ratio = [1, 2]"), "[load]", "pressure."),
    (("[solver]", "temperature = 100\n[solver]"), "[load]", "temperature"),
    (("rtol = 1e-6", "rtol = 1e-16"), "[solver]", "rtol"),
    (("rtol = 1e-6", "rtoll = 1e-6"), "[solver]", "rtoll"),
    (in_table("output", 'fields = "all"'), "[output]", "fields"),
    (in_table("observe", "stiffness = 1"), "[observe]", "stiffness"),
    (in_table("sweep", '"tread.E" = [1e6]'), "[sweep]", "tread.E"),
    (in_table("sweep", '"layers[0].thicknes" = [1e-5]'), "[sweep]", "thickness"),
    (in_table("sweep", '"layers[0].material.poisson" = [0.6]'), "[sweep]", "poisson"),
    (in_table("motion", 'kind = "ramp"'), "[motion]", "kind"),
    (in_table("[motion]", 'kind = "dwell"\nduration = 1.0'), "[load]", "velocity"),
    (("title", "= title"), "line 2", "Invalid"),
]  # fmt: skip


@pytest.mark.parametrize("texts, place, word", REFUSED, ids=lambda part: str(part)[:40])
def test_what_is_wrong_is_refused_with_table_and_key(texts, place, word):
    with pytest.raises(ValueError, match=re.escape(place)) as refused:
        parse_scene(changed(*texts))
    assert word in str(refused.value)
