"""Scenes are read strictly and built through the public constructors."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import TABLE, changed, tabulated, write

import graded_contact as gc
from graded_contact.readers.moduli import read_moduli
from graded_contact.scenes.scene_file import parse_scene, read_scene

LAYER = 'material = "coat"\nthickness = 2e-5'
GRADED = 'bottom = "tread"\ntop = "coat"\nshape = "sinusoidal"\nthickness = 2e-5'


def nearest(place, word):
    return f"{re.escape(place)}.*did you mean `{re.escape(word)}`"


def in_table(table, line):
    """The texts that `changed` takes to add a table of one line."""
    return "[solver]", f"[{table}]\n{line}\n[solver]"


# What is changed, each text for the next, and what the refusal says.
REFUSED = [
    # Misspelt words.
    (("hurst =", "hust ="), nearest("[surface]", "hurst")),
    (('kind = "elastic"', 'kind = "elastik"'), nearest("[materials.coat]", "elastic")),
    (in_table("sweep", '"layers[0].thicknes" = [1e-5]'),
     nearest("[sweep] `layers[0].thicknes`", "layers[0].thickness")),
    # Missing keys.
    (("hurst = 0.8", ""), r"^\[surface\] lacks the key `hurst`"),
    (('[base]\nkind = "half_space"\nmaterial = "tread"', ""), "^the scene lacks the key `base`"),
    # Wrong values.
    (("hurst = 0.8", 'hurst = "0.8"'), r"\[surface\] `hurst='0.8'` must be a plain number"),
    (("seed = 3", "seeds = 0"), r"\[surface\] `seeds=0` must be a whole number"),
    (("[2e5, 4e5]", "[]"), r"\[load\] `pressure` is an empty list"),
    (("[2e5, 4e5]", "[2e5, 2e5]"), r"\[load\] `pressure` has 200000 more than once"),
    (("[grid]", "[[grid]]"), r"\[grid\] must be a table"),
    (("[[layers]]", "[layers]"), r"`layers=.*` must be a list of tables"),
    (("rms_slope = 0.2", ""), r"\[surface\] Exactly one of `rms_height` and `rms_slope`"),
    (("[0.01, 1.0]", "{from=0.0, to=1.0, points=3}"), r"\[load\] `velocity` `from=0` is refused"),
    (("rtol = 1e-6", "rtol = 1e-16"), r"\[solver\] `rtol=1e-16` cannot be reached"),
    (("[solver]", "temperature = 100\n[solver]"), r"\[load\] `temperature`, of \[materials.tr"),
    (("title", "= title"), "Not valid TOML"),
    # Graded layers, and outputs that no folder can have.
    ((LAYER, GRADED, '"sinusoidal"', '"exponential"'), r"layers\[0\].shape\] lacks the key `rate`"),
    ((LAYER, GRADED, '"coat"', '"coal"'), r"`top` = 'coal' is not in \[materials\].*coat"),
    ((LAYER, GRADED, 'shape = "sinusoidal"', 'material = "coat"'),
     r"`material` and also `bottom` or `top`"),
    (in_table("output", 'name = "../../evil"'), r"\[output\] `name='../../evil'` is refused.*'/'"),
    (in_table("output", 'directory = "a\\u0000"'), r"\[output\] .*'a\\x00' is refused"),
    # Axes that make no block.
    (in_table("sweep", '"tread.E" = [1e6]'), r"`tread.E` is not a number of the block; it takes `"),
    (in_table("sweep", '"layers[0].material.poisson" = [0.6]'),
     r"\[sweep\].*`poisson=0.6` is refused"),
    (in_table("sweep", '"base.material.times" = [1.0, 2.0]'), r"\[sweep\].*shape.*\(18,\)"),
]  # fmt: skip


@pytest.mark.parametrize("texts, expected", REFUSED)
def test_what_is_wrong_is_refused_with_its_place(texts, expected):
    with pytest.raises(ValueError, match=expected):
        parse_scene(changed(*texts))


def test_a_layer_may_be_graded():
    (layer,) = parse_scene(changed(LAYER, GRADED)).stack.layers
    assert layer.thickness == 2e-5
    profile = gc.Blend(gc.tyre_tread(), gc.Elastic(2e7, 0.4), gc.shapes.Sinusoidal())
    at = jnp.asarray(0.3), jnp.asarray(20.0)
    for found, expected in zip(layer.profile(*at), profile(*at), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-15)
    shape = '{kind = "exponential", rate = 2.0}'
    (layer,) = parse_scene(changed(LAYER, GRADED, '"sinusoidal"', shape)).stack.layers
    assert eqx.tree_equal(layer.profile.shape, gc.shapes.Exponential(2.0))


def test_a_material_may_be_made_of_those_above_it():
    solid = '[materials.solid]\nkind = "bulk_shear"\nbulk = "coat"\nshear = "tread"\n'
    scene = parse_scene(
        changed("[[layers]]", solid + "[[layers]]", 'material = "tread"', 'material = "solid"')
    )
    expected = gc.BulkShear(gc.Elastic(2e7, 0.4), gc.tyre_tread())
    assert eqx.tree_equal(scene.stack.base.material, expected)


def test_a_scene_file_is_named_in_its_errors(tmp_path):
    path = tmp_path / "small.toml"
    with pytest.raises(FileNotFoundError, match=r"small\.toml"):
        read_scene(path)
    path.write_text(changed("hurst", "hust"))
    with pytest.raises(ValueError, match=r"small\.toml: \[surface\] has no key `hust`"):
        read_scene(path)
    path.write_bytes(b"title = '\xff'")
    with pytest.raises(ValueError, match=r"small\.toml"):
        read_scene(path)


def test_a_scene_is_the_stack_and_surface_that_it_writes():
    scene = parse_scene(changed("[solver]", '[solver]\ngraded_solver = {kind = "layering"}'))
    assert eqx.tree_equal(scene.stack.graded_solver, gc.response.Layering())
    stack = gc.Stack(
        layers=(gc.Layer(gc.Elastic(2e7, 0.4), 2e-5),),
        base=gc.HalfSpace(gc.tyre_tread()),
        graded_solver=gc.response.Layering(),
    )
    assert eqx.tree_equal(scene.stack, stack)
    spectrum = gc.SelfAffine(
        rms_slope=0.2, hurst=0.8, q_low=2 * np.pi / 1e-3, q_roll=2e4, q_high=8e4
    )
    surface = gc.random_surface(spectrum, gc.Grid((32, 32), 1e-3), jax.random.key(3))
    np.testing.assert_array_equal(scene.surface.build().heights, surface.heights)


@pytest.mark.parametrize(
    "lines, expected",
    [
        ('kind = "prony"\nequilibrium = 1e6\nstrengths = [2e6, 3e6]\ntimes = [1.0, 0.1]\n'
         'shift = {kind = "arrhenius", activation_energy = 1e5, reference = 293.15}', gc.Prony(1e6,
         [2e6, 3e6], [1.0, 0.1], 0.5, gc.Arrhenius(1e5, 293.15))),
        ('kind = "prony_creep"\nglassy = 1e9\ncompliances = [1e-7]\ntimes = [1.0]\npoisson=0.3',
         gc.Prony.from_creep(1e9, [1e-7], [1.0], 0.3)),
    ],
)  # fmt: skip
def test_materials_are_those_of_the_constructors(lines, expected):
    scene = parse_scene(changed('kind = "elastic"\nmodulus = 2e7\npoisson = 0.4', lines))
    assert eqx.tree_equal(scene.stack.layers[0].material, expected)


def test_a_table_makes_a_material_with_its_path_beside_the_scene(tmp_path):
    omega, modulus = read_moduli(write(tmp_path, TABLE)).table()
    scene = parse_scene(tabulated(), tmp_path)
    expected = gc.Tabulated(omega, modulus, 0.4)
    assert eqx.tree_equal(scene.stack.layers[0].material, expected)
    with pytest.raises(FileNotFoundError, match=r"\[materials.coat\].*elsewhere/table.csv"):
        parse_scene(tabulated(), tmp_path / "elsewhere")


SERIES = 'kind = "prony"\nequilibrium = 2e7\nstrengths = [1e7, 2e7]\ntimes = [1.0, 0.1]'


RAW = r"Posix|object at|float64|\w\(|[{}]"  # of Python, not of scenes
