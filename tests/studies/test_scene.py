"""Scenes are read strictly, built through the public constructors, and run point by point."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contact.observables import wave_frequencies
from graded_contact.files.moduli.reading import read_moduli
from graded_contact.files.results import AXES, FIELDS, OBSERVABLES, TEXTS
from graded_contact.studies import scene as scene_module
from graded_contact.studies.scene import build_surface, parse_scene, read_scene, run_scene
from graded_contact.studies.store import Store

DATA = Path(__file__).parents[3] / "shared" / "data"
MEASURED = sorted((Path(__file__).parents[2] / "examples").glob("measured_*.toml"))
needs_data = pytest.mark.skipif(not DATA.exists(), reason="measured data lie beside the project")

TEXT = """
title = "a small one"
[surface]
kind = "self_affine"
rms_slope = 0.2
hurst = 0.8
q_roll = 2e4
q_high = 8e4
seed = 3
[grid]
shape = [32, 32]
size = 1e-3
[materials.tread]
kind = "tyre_tread"
[materials.coat]
kind = "elastic"
modulus = 2e7
poisson = 0.4
[[layers]]
material = "coat"
thickness = 2e-5
[base]
kind = "half_space"
material = "tread"
[load]
pressure = [2e5, 4e5]
velocity = [0.01, 1.0]
[solver]
rtol = 1e-6
"""


def changed(*pairs: str) -> str:
    """The scene with each text replaced by the next."""
    text = TEXT
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture(scope="module")
def scene():
    return parse_scene(TEXT)


@pytest.fixture(scope="module")
def results(scene):
    return run_scene(scene)


@pytest.mark.parametrize(
    "old, new, place, nearest",
    [
        ("title =", "titel =", "the scene", "title"),
        ("[base]", "[bases]", "the scene", "base"),
        ("hurst =", "hust =", "[surface]", "hurst"),
        ("shape =", "shap =", "[grid]", "shape"),
        ("modulus =", "modulos =", "[materials.coat]", "modulus"),
        ("thickness =", "thicknes =", "[layers[0]]", "thickness"),
        ("velocity =", "velosity =", "[load]", "velocity"),
        ("velocity = [0.01, 1.0]", "velocity = {from=1.0, too=2.0, points=2}", "[load]", "to"),
        ("rtol =", "rtoll =", "[solver]", "rtol"),
        ('kind = "elastic"', 'kin = "elastic"', "[materials.coat]", "kind"),
        ('kind = "elastic"', 'kind = "elastik"', "[materials.coat]", "elastic"),
        ('material = "coat"', 'material = "coating"', "[layers[0]]", "coat"),
        ('material = "tread"', 'material = "tred"', "[base]", "tread"),
        ("[solver]", "[output]\nfields = 'evry'\n[solver]", "[output]", "every"),
    ],
)
def test_a_misspelt_word_is_refused_with_its_place_and_the_nearest(old, new, place, nearest):
    with pytest.raises(ValueError) as refusal:
        parse_scene(changed(old, new))
    assert place in str(refusal.value)
    assert f"did you mean `{nearest}`?" in str(refusal.value)


@pytest.mark.parametrize(
    "line, place, key",
    [
        ("hurst = 0.8", "[surface]", "hurst"),
        ("size = 1e-3", "[grid]", "size"),
        ("modulus = 2e7", "[materials.coat]", "modulus"),
        ("thickness = 2e-5", "[layers[0]]", "thickness"),
        ('material = "tread"', "[base]", "material"),
        ("pressure = [2e5, 4e5]", "[load]", "pressure"),
        ('[base]\nkind = "half_space"\nmaterial = "tread"', "the scene", "base"),
        ('kind = "self_affine"', "[surface]", "kind"),
    ],
)
def test_a_missing_key_is_named_with_its_place(line, place, key):
    with pytest.raises(ValueError) as refusal:
        parse_scene(changed(line, ""))
    assert str(refusal.value).startswith(f"{place} lacks the key `{key}`")


@pytest.mark.parametrize(
    "old, new, expected",
    [
        ("hurst = 0.8", 'hurst = "0.8"', r"\[surface\] `hurst` = '0.8' must be a number"),
        ("hurst = 0.8", "hurst = true", r"\[surface\] `hurst` = True must be a number"),
        ("seed = 3", "seed = 3.5", r"\[surface\] `seed` = 3.5 must be a whole number"),
        ("[32, 32]", "[32, 32.0]", r"\[grid\] `shape` .* whole number"),
        ('material = "coat"', "material = 3", r"\[layers\[0\]\] `material` = 3 must be a text"),
        ("[2e5, 4e5]", "[]", r"\[load\] `pressure` = \[\] must be a number or a list"),
        ("[grid]", "[[grid]]", r"\[grid\] must be a table"),
        ("[[layers]]", "[layers]", r"`layers` must be a list of tables"),
        ("hurst = 0.8", "hurst = 1.8", r"\[surface\] `hurst=1.8` is refused"),
        ("rms_slope = 0.2", "", r"\[surface\] Exactly one of `rms_height` and `rms_slope`"),
        ("size = 1e-3", "size = -1.0", r"\[grid\] `size=-1` is refused"),
        ("modulus = 2e7", "modulus = nan", r"\[materials.coat\] `modulus=nan` is refused"),
        ("poisson = 0.4", "poisson = 0.6", r"\[materials.coat\] `poisson=0.6` is refused"),
        ("2e-5", "-2e-5", r"\[layers\[0\]\] `thickness=-2e-05` is refused"),
        ("[2e5, 4e5]", "[2e5, 0]", r"\[load\] `pressure\[1\]=0` is refused"),
        ("[0.01, 1.0]", "inf", r"\[load\] `velocity\[0\]=inf` is refused"),
        ("[0.01, 1.0]", "{from=0.0, to=1.0, points=3}", r"\[load\] `velocity` `from=0` is refused"),
        ("rtol = 1e-6", "rtol = 1e-16", r"\[solver\] `rtol=1e-16` cannot be reached"),
        ("rtol = 1e-6", "max_steps = 0", r"\[solver\] `max_steps=0`"),
        ("[solver]", "temperature = 290\n[solver]", None),
        ("[solver]", "temperature = 100\n[solver]", r"\[load\] `temperature`, of \[materials.tr"),
        ("title", "= title", "Not valid TOML"),
    ],
)
def test_a_wrong_value_is_refused_with_its_place(old, new, expected):
    if expected is None:
        parse_scene(changed(old, new))
        return
    with pytest.raises(ValueError, match=expected):
        parse_scene(changed(old, new))


GRADED = 'bottom = "tread"\ntop = "coat"\nshape = "sinusoidal"\nthickness = 2e-5'
LAYER = 'material = "coat"\nthickness = 2e-5'


def test_a_layer_may_be_graded():
    (layer,) = parse_scene(changed(LAYER, GRADED)).stack.layers
    assert layer.thickness == 2e-5
    profile = gc.Blend(gc.tyre_tread(), gc.Elastic(2e7, 0.4), gc.Sinusoidal())
    at = jnp.asarray(0.3), jnp.asarray(20.0)
    for found, expected in zip(layer.profile(*at), profile(*at), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-15)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('top = "coat"\n', "", r"\[layers\[0\]\] lacks the key `top`"),
        ('top = "coat"', 'top = "coal"', r"`top` = 'coal' is not in \[materials\].*coat"),
        ('"sinusoidal"', '"linaer"', r"`shape` = 'linaer' is not known.*linear"),
        ('shape = "sinusoidal"', 'material = "coat"', r"`material` besides `bottom` or `top`"),
    ],
)
def test_a_bad_graded_layer_is_refused(old, new, message):
    with pytest.raises(ValueError, match=message):
        parse_scene(changed(LAYER, GRADED, old, new))


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


def test_a_scene_is_the_stack_and_surface_that_it_writes(scene):
    stack = gc.Stack(
        layers=(gc.Layer(gc.Elastic(2e7, 0.4), 2e-5),), base=gc.HalfSpace(gc.tyre_tread())
    )
    assert eqx.tree_equal(scene.stack, stack)
    spectrum = gc.SelfAffine(
        rms_slope=0.2, hurst=0.8, q_low=2 * np.pi / 1e-3, q_roll=2e4, q_high=8e4
    )
    surface = gc.random_surface(spectrum, gc.Grid((32, 32), 1e-3), jax.random.key(3))
    np.testing.assert_array_equal(build_surface(scene).heights, surface.heights)


@pytest.mark.parametrize(
    "lines, expected",
    [
        (
            'kind = "prony"\nequilibrium = 1e6\nstrengths = [2e6, 3e6]\ntimes = [1.0, 0.1]\n'
            'shift = {kind = "arrhenius", activation_energy = 1e5, reference = 293.15}',
            gc.Prony(1e6, [2e6, 3e6], [1.0, 0.1], 0.5, gc.Arrhenius(1e5, 293.15)),
        ),
        (
            'kind = "prony_creep"\nglassy = 1e9\ncompliances = [1e-7]\ntimes = [1.0]\npoisson=0.3',
            gc.Prony.from_creep(1e9, [1e-7], [1.0], 0.3),
        ),
        (
            'kind = "prony"\nequilibrium = 1e6\nstrengths = 2e6\ntimes = 1\n'
            'shift = {kind = "wlf", c1 = 4.0, c2 = 100.0, reference = 300}',
            gc.Prony(1e6, [2e6], [1.0], shift=gc.WLF(4.0, 100.0, 300.0)),
        ),
    ],
)
def test_materials_are_those_of_the_constructors(lines, expected):
    scene = parse_scene(changed('kind = "elastic"\nmodulus = 2e7\npoisson = 0.4', lines))
    assert eqx.tree_equal(scene.stack.layers[0].material, expected)


def test_a_temperature_shifts_every_material():
    scene = parse_scene(changed("[solver]", "temperature = 273.15\n[solver]"))
    assert eqx.tree_equal(scene.stack, parse_scene(TEXT).stack.at(273.15))


def test_a_range_is_equally_spaced_in_the_logarithm():
    scene = parse_scene(changed("[0.01, 1.0]", "{from = 1e-3, to = 10, points = 5}"))
    np.testing.assert_allclose(scene.velocity, [1e-3, 1e-2, 0.1, 1, 10], rtol=1e-15)


def test_a_run_gives_what_slide_gives(scene, results):
    assert results.complete
    surface = build_surface(scene)
    for i, j in np.ndindex(2, 2):
        pressure, velocity = scene.pressure[i], scene.velocity[j]
        sliding = gc.slide(scene.stack, surface, pressure=pressure, velocity=velocity)
        for name in ("friction", "contact_area", "contact_area_smooth", "mean_gap", "error"):
            assert getattr(results, name)[i, j] == getattr(sliding, name)
    assert list(results.fields) == [(1, 1)]
    np.testing.assert_array_equal(results.fields[1, 1].gap, sliding.gap)
    assert results.attributes["scene"] == TEXT
    assert results.attributes["seed"] == 3
    assert results.attributes["dtype"] == "float64"


def test_more_velocities_compile_nothing_more(scene, results):
    compiled = []

    def listen(event, *_, **__):
        if event.endswith("backend_compile_duration"):
            compiled.append(event)

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        counts = []
        run = run_scene(
            parse_scene(changed("[0.01, 1.0]", "{from = 0.02, to = 2.0, points = 5}")),
            progress=lambda done, total: counts.append((done, total)),
        )
    finally:
        jax.monitoring.clear_event_listeners()
    assert run.complete and len(compiled) == 0
    assert counts == [(n, 10) for n in range(1, 11)]


def test_a_solve_that_does_not_converge_is_kept_with_its_message():
    scene = parse_scene(
        changed("rtol = 1e-6", 'rtol = 1e-6\nmax_steps = 2\n[output]\nfields = "every"')
    )
    results = run_scene(scene)
    assert not results.converged.any()
    assert "max_steps" in results.message[1, 1]
    assert np.all(results.error > 1e-6)
    assert len(results.fields) == 4
    assert results.attributes["num_converged"] == 0


def test_the_direction_turns_the_velocity_from_the_x_axis():
    text = changed("[2e5, 4e5]", "2e5", "[0.01, 1.0]", "0.1\ndirection = 1.5707963267948966")
    scene = parse_scene(text)
    along_y = gc.slide(scene.stack, build_surface(scene), pressure=2e5, velocity=[0.0, 0.1])
    assert run_scene(scene).friction[0, 0] == along_y.friction


def test_at_rest_there_is_no_friction():
    scene = parse_scene(changed("[0.01, 1.0]", "0", "[2e5, 4e5]", "2e5"))
    assert abs(run_scene(scene).friction[0, 0]) < 1e-15  # rounding of two fields against another


TABLE = "f, E_stor, E_loss\nHz, MPa, MPa\n10, 3, 0.4\n\n# a note\n0.1, 1, 0.2\n1, 2, 0.3\n"


def write(folder, text):
    (folder / "table.csv").write_text(text)
    return folder / "table.csv"


def tabulated(extrapolate: str) -> str:
    return changed(
        'kind = "elastic"\nmodulus = 2e7',
        f'kind = "tabulated"\npath = "table.csv"\nextrapolate = "{extrapolate}"',
    )


def test_a_table_makes_a_material_with_its_path_beside_the_scene(tmp_path):
    omega, modulus = read_moduli(write(tmp_path, TABLE)).table()
    scene = parse_scene(tabulated("plateau"), tmp_path)
    expected = gc.Tabulated(omega, modulus, 0.4, extrapolate="plateau")
    assert eqx.tree_equal(scene.stack.layers[0].material, expected)
    assert "coat: Column 1 (f): frequency in Hz, as the file says" in " ".join(scene.notes)
    with pytest.raises(FileNotFoundError, match=r"\[materials.coat\].*elsewhere/table.csv"):
        parse_scene(tabulated("plateau"), tmp_path / "elsewhere")


def test_columns_and_units_of_a_table_can_be_told(tmp_path):
    write(tmp_path, "T;loss;omega;x\n20;4;10;30\n20;5;11;31\n")
    text = tabulated("plateau") + (
        '[materials.coat.columns]\nstorage = "x"\ntemperature = "T"\n'
        '[materials.coat.units]\nmodulus = "kPa"\ntemperature = "C"\n'
    )
    material = parse_scene(text, tmp_path).stack.layers[0].material
    np.testing.assert_allclose(material.omega, [10, 11])
    np.testing.assert_allclose(material.storage, [30e3, 31e3])
    for old, new, expected in (
        ("storage =", "stor =", r"\[materials.coat.columns\] has no key `stor`.*`storage`"),
        ('"kPa"', '"kpa "', r"`units=\{'modulus': 'kpa '\}` is refused"),
        ('"x"', '"y"', r"table.csv`: line 1: `columns` asks for 'y'"),
    ):
        with pytest.raises(ValueError, match=expected):
            parse_scene(text.replace(old, new), tmp_path)


def test_a_table_of_several_temperatures_is_refused(tmp_path):
    write(tmp_path, "f [Hz],E' [Pa],E'' [Pa],T [K]\n1,2,1,290\n2,3,1,290\n1,1,1,300\n2,2,1,300\n")
    expected = r"\[materials.coat\].*holds 2 isotherm.*`graded-contact fit FILE` does so"
    with pytest.raises(ValueError, match=expected):
        parse_scene(tabulated("plateau"), tmp_path)


def test_a_creep_test_is_no_table_but_can_be_fitted(tmp_path):
    write(tmp_path, "t [s],J(t) [1/Pa]\n1,2e-6\n2,3e-6\n")
    with pytest.raises(
        ValueError, match=r"Needed: frequency.*`graded-contact fit FILE` reads more"
    ):
        parse_scene(tabulated("plateau"), tmp_path)


def test_velocities_that_a_table_does_not_cover_are_refused_before_solving(tmp_path):
    write(tmp_path, TABLE)
    with pytest.raises(ValueError, match=r"\[load\] `velocity`.*covers 0.628 to 62.8 rad/s"):
        run_scene(parse_scene(tabulated("refuse"), tmp_path))


def measured_tread(omega: str, load: str = "") -> str:
    """A series known between frequencies [rad/s]; the scene excites 63 to 5e4 at most 1 m/s."""
    return changed(
        'kind = "tyre_tread"',
        'kind = "prony"\nequilibrium = 6e6\nstrengths = [2e7, 1e7]\ntimes = [1e-4, 1e-2]\n'
        f"measured = {{omega = {omega}, temperature = [250, 320.0]}}",
        "velocity = [0.01, 1.0]",
        f"velocity = [0.01, 1.0]\n{load}",
    )


def test_friction_from_frequencies_that_were_not_measured_is_refused_before_solving():
    scene = parse_scene(measured_tread("[1.0, 1e4]"))
    refusal = (
        r"excite 62\.8 to .* measured from 1 to 1e\+04 rad/s: up to \d+% of the friction at 1 of 2 "
        r"velocities \(1 to 1 m/s\).*`extrapolate = true` in \[load\]"
    )
    with pytest.raises(ValueError, match=refusal):
        run_scene(scene)
    # The last wave alone lies outside: less than a hundredth of the friction, and no refusal.
    fastest = np.max(np.abs(wave_frequencies(build_surface(scene).grid, 1.0)))
    scene_module.check_frequencies_of(
        parse_scene(measured_tread(f"[1.0, {0.99 * fastest}]")), build_surface(scene)
    )
    scene_module.check_frequencies_of(parse_scene(TEXT), build_surface(scene))


def test_extrapolated_friction_that_is_allowed_is_reported_and_marked():
    results = run_scene(parse_scene(measured_tread("[1.0, 1e4]", "extrapolate = true")))
    assert np.all(results.extrapolated_friction[:, 0] == 0)
    assert np.all(results.extrapolated_friction[:, 1] > 0.05)
    (caveat,) = (c for c in results.caveats if "not measured" in c.sentence)
    np.testing.assert_array_equal(caveat.where, [[False, True]] * 2)


def test_a_damaged_surface_file_is_refused(tmp_path):
    lines = '[surface]\nkind = "file"\npath = "heights.txt"\n[materials.tread]'
    text = TEXT[: TEXT.index("[surface]")] + lines + TEXT.split("[materials.tread]")[1]
    with pytest.raises(FileNotFoundError, match=r"\[surface\].*heights.txt"):
        build_surface(parse_scene(text, tmp_path))
    (tmp_path / "heights.txt").write_text("no numbers")
    with pytest.raises(ValueError, match=r"\[surface\].*heights.txt"):
        build_surface(parse_scene(text, tmp_path))
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
    surface = build_surface(parse_scene(text, tmp_path))
    assert surface.grid.shape == (16, 32)
    np.testing.assert_allclose(surface.grid.size, [1.6e-4, 3.2e-4])


@needs_data
@pytest.mark.parametrize("path", MEASURED, ids=lambda path: path.name)
def test_an_example_is_read_with_its_data(path):
    scene = read_scene(path)
    surface = build_surface(scene)
    assert surface.history
    low, high = np.min(scene.velocity), np.max(scene.velocity)
    assert np.log10(high / low) == pytest.approx(6)


@needs_data
def test_a_measured_surface_on_a_measured_polymer_rubs_most_in_the_middle():
    """The loss tangent of this polymer has its maximum near 10 Hz and falls on both sides."""
    example = next(path for path in MEASURED if path.name == "measured_road.toml")
    text = example.read_text().replace("[1024, 1024]", "[64, 64]").replace("= 13", "= 3")
    results = run_scene(parse_scene(text, example.parent))
    assert results.complete
    friction, area = results.friction[0], results.contact_area_smooth[0]
    assert friction[1] > friction[0] > 0 and friction[1] > friction[2] > 0
    assert area[0] > area[1] > area[2]
    assert "matrix-3.txt" in results.attributes["inputs"]


def test_an_interrupted_run_keeps_what_it_has(scene, results):
    def interrupt(done, total):
        if done == 3:
            raise KeyboardInterrupt

    kept = run_scene(scene, progress=interrupt)
    assert not kept.complete
    np.testing.assert_array_equal(kept.state, [["", ""], ["", "not started"]])
    np.testing.assert_array_equal(kept.friction[0], results.friction[0])
    assert np.isnan(kept.friction[1, 1])


def same(one, other):
    """Whether two results are equal bit for bit."""
    for name in (*AXES, *OBSERVABLES):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
    for name in TEXTS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.attributes == other.attributes and one.fields.keys() == other.fields.keys()
    for index, fields in one.fields.items():
        for name in FIELDS:
            a, b = getattr(fields, name), getattr(other.fields[index], name)
            assert a.tobytes() == b.tobytes()
    return True


@pytest.fixture
def solved(monkeypatch):
    """The pressures and velocities that were solved for, in order."""
    calls, slide = [], scene_module.slide

    def noting(*arguments, **options):
        calls.append((float(options["pressure"]), float(options["velocity"])))
        return slide(*arguments, **options)

    monkeypatch.setattr(scene_module, "slide", noting)
    return calls


def test_a_run_goes_on_from_its_store(scene, results, solved, tmp_path):
    def interrupt(done, total):
        if done == 3:
            raise KeyboardInterrupt

    counts = []
    with Store(tmp_path) as store:
        run_scene(scene, store=store, progress=interrupt)
        assert solved == [(2e5, 0.01), (2e5, 1.0), (4e5, 0.01)]
        again = run_scene(scene, store=store, progress=lambda *count: counts.append(count))
        assert solved[3:] == [(4e5, 1.0)] and counts == [(3, 4), (4, 4)]
        assert same(again, results)
        assert same(run_scene(scene, store=store), results)
        assert len(solved) == 4


def test_scenes_share_the_solves_that_they_have_in_common(scene, solved, tmp_path):
    with Store(tmp_path) as store:
        run_scene(scene, store=store)
        more = parse_scene(changed("[0.01, 1.0]", "[1.0, 0.1]", 'title = "a small', 'title = "a'))
        results = run_scene(more, store=store)
        assert solved[4:] == [(2e5, 0.1), (4e5, 0.1)]  # the last one's fields were not kept
        assert same(results, run_scene(more))
        for other in (("2e-5", "3e-5"), ("1e-6", "1e-7"), ("0.4\n", "0.41\n"), ("seed = 3", "")):
            run_scene(parse_scene(changed(*other)), store=store)
    assert len(solved) == 4 + 2 + 4 + 4 * 4


def test_a_damaged_solve_is_computed_again_and_named(scene, results, solved, tmp_path):
    with Store(tmp_path) as store:
        run_scene(scene, store=store)
        path = store.path(results.point[0, 1])
        path.write_bytes(path.read_bytes()[:-1])
        assert same(run_scene(scene, store=store), results)
        assert solved[4:] == [(2e5, 1.0)] and store.damaged == [path]
        assert store.read(results.point[0, 1]) is not None


def failing_at(monkeypatch, call, error):
    """`slide` fails at one of its calls."""
    slide, calls = scene_module.slide, []

    def sometimes(*arguments, **options):
        calls.append(None)
        if len(calls) == call:
            raise error
        return slide(*arguments, **options)

    monkeypatch.setattr(scene_module, "slide", sometimes)


@pytest.mark.parametrize(
    "error",
    [
        ValueError("`kernel` is refused."),
        RuntimeError("jax.errors.JaxRuntimeError: `kernel` is refused.\n\n--------\nmore"),
    ],
)
def test_a_kernel_that_fails_is_kept_with_its_reason_and_the_run_goes_on(
    scene, results, tmp_path, monkeypatch, error
):
    failing_at(monkeypatch, 2, error)
    with Store(tmp_path) as store:
        for _ in range(2):  # the second time from the store
            found = run_scene(scene, store=store)
            np.testing.assert_array_equal(found.state, [["", "failed"], ["", ""]])
            assert found.message[0, 1] == "failed: `kernel` is refused."
            assert np.isnan(found.friction[0, 1]) and np.isnan(found.error[0, 1])
            np.testing.assert_array_equal(found.friction[1], results.friction[1])
            assert found.attributes["num_converged"] == 3


@pytest.mark.parametrize(
    "error, raised",
    [
        (RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 1 byte."), MemoryError),
        (RuntimeError("CpuCallback error: KeyboardInterrupt: "), KeyboardInterrupt),
        (OSError("No space left on device"), OSError),
    ],
)
def test_what_is_not_a_solve_s_fault_is_not_kept_as_such(
    scene, tmp_path, monkeypatch, error, raised
):
    failing_at(monkeypatch, 1, error)
    with Store(tmp_path) as store:
        with pytest.raises(raised):
            run_scene(scene, store=store)
        assert list(tmp_path.glob("*.h5")) == []
        assert run_scene(scene, store=store).complete


@pytest.mark.parametrize(
    "lines, expected",
    [
        ('name = "../../evil"', r"\[output\] `name='../../evil'` is refused.*'/'"),
        ('name = "/tmp/evil"', r"`name='/tmp/evil'` is refused.*'/'"),
        ("name = 'a\\b'", "is refused"),
        ('name = "a\\u0000"', r"`name='a\\x00'` is refused"),
        ('name = ".."', "letters or digits are needed"),
        ('name = ""', "letters or digits are needed"),
        (f'name = "{300 * "x"}"', "it has 300 bytes, and may have 180"),
        (f'name = "{100 * "µ"}"', "it has 200 bytes"),
        ('directory = "a\\u0000"', r"\[output\] .*'a\\x00' is refused"),
        ('directory = "~nobody-of-this-name/a"', r"\[output\] .*is refused"),
    ],
)
def test_an_output_that_no_folder_can_have_is_refused(lines, expected):
    with pytest.raises(ValueError, match=expected):
        parse_scene(changed("[solver]", f"[output]\n{lines}\n[solver]"))


def test_a_directory_is_relative_to_the_scene(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for given, expected in (
        ("out", tmp_path / "scenes" / "out"),
        ("/elsewhere/out", Path("/elsewhere/out")),
        ("~/out", tmp_path / "home" / "out"),
    ):
        text = changed("[solver]", f'[output]\ndirectory = "{given}"\n[solver]')
        assert parse_scene(text, tmp_path / "scenes").directory == expected
