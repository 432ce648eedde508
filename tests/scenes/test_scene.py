"""Scenes are read strictly and built through the public constructors."""

import itertools
import re
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import TABLE, TEXT, changed, tabulated, write

import graded_contact as gc
from graded_contact.designs.table import read_design
from graded_contact.page.document import open_document
from graded_contact.readers.moduli import read_moduli
from graded_contact.scenes import block
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


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        ((), []),
        (("[2e5, 4e5]", "[0.3, 4e5]"), ["[load]: The pressure of 300 mPa is unusual"]),
        (("[2e5, 4e5]", "4e11"), ["[load]: The pressure of 400 GPa is unusual"]),
        (("thickness = 2e-5", "thickness = 50"), ["layers[0]: The thickness of 50 m is unusual"]),
        (("thickness = 2e-5", "thickness = 5e-9"), ["layers[0]: The thickness of 5 nm is unusual"]),
        (in_table("sweep", '"layers[0].thickness" = [1e-5, 2e-9]'),
         ["layers[0]: The thickness of 2 nm is unusual"]),
        # Of a soft solid a small load is usual, as is a large one of a stiff coat.
        (("[2e5, 4e5]", "[3.0, 4e5]", "modulus = 2e7", "modulus = 2e3"), []),
        (("[2e5, 4e5]", "[1e8, 4e5]", "modulus = 2e7", "modulus = 2e11"), []),
    ],
)  # fmt: skip
def test_loads_and_lengths_in_a_wrong_unit_are_told(texts, told):
    assumed = parse_scene(changed(*texts)).assumed
    assert len(assumed) == len(told)
    assert all(one.startswith(text) for one, text in zip(assumed, told, strict=True))


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


def test_a_rigid_base_takes_no_material_and_no_layers_are_refused():
    rigid = ('kind = "half_space"\nmaterial = "tread"', 'kind = "rigid"')
    assert isinstance(parse_scene(changed(*rigid)).stack.base, gc.Rigid)
    with pytest.raises(ValueError, match=r"\[base\] has no key `material`"):
        parse_scene(changed("half_space", "free"))
    layer = '[[layers]]\nmaterial = "coat"\nthickness = 2e-5'
    with pytest.raises(ValueError, match=r"\[base\] `layers` is empty"):
        parse_scene(changed(*rigid, layer, ""))


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


def test_a_result_in_place_of_a_scene_is_named_as_one_of_any_size(tmp_path):
    """A scene has at most a megabyte."""
    path = tmp_path / "small.h5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(2_000_000))
    for read in (read_scene, read_design, open_document):
        with pytest.raises(ValueError, match=r"is a result .* `graded-contact info .*small\.h5`"):
            read(path)


def test_a_scene_prints_what_is_set_and_no_more():
    lines = str(
        parse_scene(changed("[solver]", "[observe]\nflow = true\nstiffness = true\n[solver]"))
    )
    assert re.search("^  observed +stiffness, flow$", lines, re.MULTILINE)
    for unset in ("sweep", "temperature", "motion", "law", "shear", "heating", "observe "):
        assert not re.search(f"^  {unset}", lines, re.MULTILINE), unset
    assert "observed" not in str(parse_scene(TEXT))


def test_a_scene_is_the_stack_and_surface_that_it_writes():
    scene = parse_scene(changed("[solver]", '[solver]\ngraded_solver = {kind = "layering"}'))
    assert eqx.tree_equal(scene.stack.graded_solver, gc.blocks.Layering())
    stack = gc.Stack(
        layers=(gc.Layer(gc.Elastic(2e7, 0.4), 2e-5),),
        base=gc.HalfSpace(gc.tyre_tread()),
        graded_solver=gc.blocks.Layering(),
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
    scene = parse_scene(tabulated("plateau"), tmp_path)
    expected = gc.Tabulated(omega, modulus, 0.4, extrapolate="plateau")
    assert eqx.tree_equal(scene.stack.layers[0].material, expected)
    assert "coat: Column 1 (f): frequency in Hz, as in the file" in " ".join(scene.notes)
    with pytest.raises(FileNotFoundError, match=r"\[materials.coat\].*elsewhere/table.csv"):
        parse_scene(tabulated("plateau"), tmp_path / "elsewhere")


def test_columns_and_units_of_a_table_can_be_stated(tmp_path):
    write(tmp_path, "T;loss;omega;x\n20;4;10;30\n20;5;11;31\n")
    text = tabulated("plateau") + (
        '[materials.coat.columns]\nstorage = "x"\ntemperature = "T"\n'
        '[materials.coat.units]\nmodulus = "kPa"\ntemperature = "C"\n'
    )
    material = parse_scene(text, tmp_path).stack.layers[0].material
    np.testing.assert_allclose(material.omega, [10, 11])
    np.testing.assert_allclose(material.storage, [30e3, 31e3])
    with pytest.raises(ValueError, match=r"\[materials.coat.columns\] has no key `stor`"):
        parse_scene(text.replace("storage =", "stor ="), tmp_path)


def test_a_table_of_several_temperatures_is_refused(tmp_path):
    write(tmp_path, "f [Hz],E' [Pa],E'' [Pa],T [K]\n1,2,1,290\n2,3,1,290\n1,1,1,300\n2,2,1,300\n")
    expected = r"\[materials.coat\].*holds 2 isotherm.*`graded-contact fit FILE`"
    with pytest.raises(ValueError, match=expected):
        parse_scene(tabulated("plateau"), tmp_path)


def test_a_damaged_surface_file_is_refused(tmp_path):
    lines = '[surface]\nkind = "file"\npath = "heights.txt"\n[materials.tread]'
    text = TEXT[: TEXT.index("[surface]")] + lines + TEXT.split("[materials.tread]")[1]
    with pytest.raises(FileNotFoundError, match=r"\[surface\].*heights.txt"):
        parse_scene(text, tmp_path).surface.build()
    (tmp_path / "heights.txt").write_text("no numbers")
    with pytest.raises(ValueError, match=r"\[surface\].*heights.txt"):
        parse_scene(text, tmp_path).surface.build()
    with pytest.raises(ValueError, match="did you mean `periodic`"):
        parse_scene(text.replace("path =", "periodik = 'mirror'\npath ="), tmp_path)


def test_a_file_takes_one_length_for_a_square_and_a_region(tmp_path):
    rows = np.random.default_rng(0).normal(size=(16, 16))
    np.savetxt(tmp_path / "heights.csv", rows, delimiter=",")
    lines = """[surface]
        kind = "file"
        path = "heights.csv"
        unit = "um"
        size = 1.6e-4
        region = [0, 8e-5, 0, 1.6e-4]
        periodic = "mirror"
        [materials.tread]"""
    text = TEXT[: TEXT.index("[surface]")] + lines + TEXT.split("[materials.tread]")[1]
    surface = parse_scene(text, tmp_path).surface.build()
    assert surface.grid.shape == (16, 32)
    np.testing.assert_allclose(surface.grid.size, [1.6e-4, 3.2e-4])


def test_a_scene_chooses_columns_and_levels_lines(tmp_path):
    x, z = np.arange(16.0), np.random.default_rng(0).normal(size=(16, 2))
    table = "".join(f"{i},{2 * i},{a},{b}\n" for i, (a, b) in zip(x, z, strict=True))
    (tmp_path / "heights.csv").write_text("n,way,one,two\n" + table)
    np.savetxt(tmp_path / "map.csv", z @ z.T + x[:, None] % 2, delimiter=",")
    of_file = """[surface]
        kind = "file"
        path = "heights.csv"
        unit = "um"
        columns = {x = "way", z = 4}
        [materials.tread]"""
    before, after = TEXT[: TEXT.index("[surface]")], TEXT.split("[materials.tread]")[1]
    surface = parse_scene(before + of_file + after, tmp_path).surface.build()
    np.testing.assert_allclose(surface.grid.size, [32e-6])
    np.testing.assert_allclose(surface.steps[0].rms_height, 1e-6 * np.std(z[:, 1]))
    wrong = of_file.replace("z = 4", "w = 4")
    with pytest.raises(ValueError, match=r"\[surface.columns\] has no key `w`"):
        parse_scene(before + wrong + after, tmp_path)
    of_map = of_file.replace("heights", "map").replace(
        'columns = {x = "way", z = 4}', "size = 1e-4"
    )
    of_map = of_map.replace("size =", 'level_lines = "x"\nsize =')
    surface = parse_scene(before + of_map + after, tmp_path).surface.build()
    assert surface.steps[1].name == "lines levelled"


def test_a_directory_is_relative_to_the_scene(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for given, expected in (
        ("out", tmp_path / "scenes" / "out"),
        ("/elsewhere/out", Path("/elsewhere/out")),
        ("~/out", tmp_path / "home" / "out"),
    ):
        text = changed("[solver]", f'[output]\ndirectory = "{given}"\n[solver]')
        assert parse_scene(text, tmp_path / "scenes").directory == expected


SERIES = 'kind = "prony"\nequilibrium = 2e7\nstrengths = [1e7, 2e7]\ntimes = [1.0, 0.1]'
KNOWN = "equilibrium,strengths[0],strengths[1],poisson"


@pytest.mark.parametrize(
    "table, expected",
    [
        ("equilibrium,strengths[0]\n1,1\n", r"'strengths\[1\]' is missing"),
        (f"{KNOWN}\n1,1,1,1\n1,1\n", "line 3 has 2 numbers under 4 paths"),
        ("\udcff\udcfe", "codec can't decode"),
        (None, "does not exist"),
    ],
)
def test_errors_of_another_material_or_damaged_ones_are_refused(tmp_path, table, expected):
    if table is not None:
        (tmp_path / "e.csv").write_bytes(table.encode("utf-8", "surrogateescape"))
    text = changed('kind = "elastic"\nmodulus = 2e7', SERIES)
    text = text.replace("poisson = 0.4\n", 'poisson = 0.4\nerrors = "e.csv"\n')
    with pytest.raises((ValueError, FileNotFoundError), match=expected) as raised:
        parse_scene(text, tmp_path)
    assert "[materials.coat] `errors`:" in str(raised.value) and "e.csv" in str(raised.value)


def test_what_a_scene_varies_is_in_the_order_of_its_axes():
    text = changed(
        *in_table("sweep", '"layers[0].thickness" = {from = 1e-5, to = 1e-3, points = 3}')
    )
    text = text.replace("[sweep]", "temperature = {from = 280, to = 300, points = 3}\n[sweep]")
    scene = parse_scene(text.replace("seed = 3", "seed = 3\nseeds = 2"))
    names = ["layers[0].thickness", "temperature", "seed", "pressure", "velocity"]
    assert list(scene.axes) == names and scene.num_solves == 3 * 3 * 2 * 2 * 2
    np.testing.assert_allclose(scene.axes["temperature"], [280, 290, 300])
    np.testing.assert_allclose(scene.axes["layers[0].thickness"], [1e-5, 1e-4, 1e-3])
    assert scene.axes["seed"].tolist() == [3, 4]
    block = scene.bodies({"layers[0].thickness": 1e-4, "temperature": 290.0}).stack
    expected = gc.with_values(scene.stack, {"layers[0].thickness": 1e-4}).at(290.0)
    assert eqx.tree_equal(block, expected)
    assert len(list(scene.all_bodies())) == 9


def test_a_scene_of_many_megabytes_is_refused_before_it_is_parsed(tmp_path):
    path = tmp_path / "long.toml"
    path.write_text("[[layers]]\nmaterial = 'a'\nthickness = 1e-5\n" * 50_000)
    with pytest.raises(ValueError, match=r"it has 2.15 MB; at most 1 MB are read"):
        read_scene(path)
    with pytest.raises(ValueError, match=r"The text has 2 MB; at most 1 MB are read"):
        parse_scene("#" * 2_000_000)


def test_a_text_that_no_file_can_hold_is_refused_before_anything_is_solved():
    named = (
        "[materials.coat]",
        '[materials."a\\u0000"]',
        'material = "coat"',
        'material = "a\\u0000"',
    )
    for pairs in (("a small one", "a\\u0000b"), named):
        with pytest.raises(ValueError, match=r"the character \\u0000"):
            parse_scene(changed(*pairs))


RAW = r"Posix|object at|float64|\w\(|[{}]"  # of Python, not of scenes


def test_a_scene_prints_its_load_and_nothing_raw():
    loads = (
        ("pressure = [2e5, 4e5]", "pressure = {from = 1e4, to = 1e6, points = 12}"),
        ("velocity =", "direction = 0.3\ntemperature = [290, 300]\nvelocity ="),
        ("[solver]", '[solver]\ngraded_solver = {kind = "riccati"}'),
        ("[solver]", "[fluid]\nviscosity = 1e-3\npressure_difference = 1e4\n[solver]"),
    )
    lines = str(parse_scene(changed(*itertools.chain(*loads))))
    assert not re.search(RAW, lines), lines
    for line in (r"pressure \[Pa\] +12 numbers, 10000 to 1e\+06", r"direction \[rad\] +0.3",
                 r"graded solver +riccati", r"  viscosity +0.001"):  # fmt: skip
        assert re.search(f"^ +{line}$", lines, re.MULTILINE), line


def test_a_scene_prints_the_path_of_its_surface_and_no_pressure_beside_an_approach(tmp_path):
    file = tmp_path / "a-surface-with-a-long-name.txt"
    np.savetxt(file, np.zeros((8, 8)))
    tail = TEXT.partition("[materials")[2]
    surface = f'[surface]\nkind = "file"\npath = "{file.as_posix()}"\nsize = 1e-3\nunit = "um"\n'
    text = f'{surface}periodic = "open"\n[materials{tail}'
    lines = str(parse_scene(text.replace("pressure = [2e5, 4e5]", "approach = 1e-6")))
    assert re.search(f"path {re.escape(str(file))}", lines)
    assert not re.search(RAW, lines) and "approach [m]" in lines and "pressure" not in lines


def test_all_that_a_kind_makes_has_a_print_of_its_own():
    kinds = (block.MATERIALS, block.BASES, *block.KIND_MAKERS.values())
    classes = [make for one in kinds for make in one.values() if isinstance(make, type)]
    assert len(classes) > 15 and all(hasattr(made, "_shown") for made in classes)
