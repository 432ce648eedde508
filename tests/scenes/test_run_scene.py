"""Scenes are run point by point; what is kept is not computed again."""

import dataclasses
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_texts import BARE, PLAIN, TABLE, TEXT, changed, tabulated, write

import graded_contact as gc
from graded_contact.command.result_tables import print_table
from graded_contact.core.parameters import paths, with_values
from graded_contact.core.quantities import OBSERVABLES, Above, observable
from graded_contact.fields.frequency import wave_frequencies
from graded_contact.scenes.collect import shift_factors
from graded_contact.scenes.plan import build_surface, plan
from graded_contact.scenes.results import kept_contact, kept_solves, warnings_of
from graded_contact.scenes.scene import Scene
from graded_contact.scenes.scene_file import parse_scene, read_scene
from graded_contact.scenes.surface_source import RandomSurface
from graded_contact.scenes.theory import check_frequencies_of
from graded_contact.studies.dataset import package_versions
from graded_contact.studies.store import Store

DATA = Path(__file__).parents[3] / "shared" / "data"
EXAMPLES = Path(__file__).parents[2] / "examples"
# Rooms list functions of the names of these modules.
PLAN = sys.modules["graded_contact.scenes.plan"]
SWEEP, PROGRAM = (sys.modules[f"graded_contact.studies.{name}"] for name in ("sweep", "program"))


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


def test_what_is_assumed_of_a_file_is_a_caveat_of_every_solve(scene, capsys):
    told = dataclasses.replace(scene, assumed=("tread: Read as tension.",))
    found = plan(told).run()
    assert found.attrs["caveats"].startswith("tread: Read as tension.")
    first = warnings_of(found)[0]
    assert first.sentence == "tread: Read as tension." and np.all(first.where)
    print_table(found)
    told = capsys.readouterr().out
    assert "(each solve) tread: Read as tension." in told
    # The state says so, whether the warning has a number (of one solve) or none.
    assert told.count("doubtful") == found.message.size == 4 and "solved" not in told
    print_table(found.isel(pressure=[0], velocity=[0]))
    told = capsys.readouterr().out
    assert "doubtful (1" in told and "(1) tread: Read as tension." in told


def test_an_observable_is_one_function(capsys):
    """Its attribute, print, dataset, unit, column and caveat follow from its entry."""
    doubt = Above(1.0, "The largest pressure is {value:.2g} Pa.")

    @observable("F", "Pa", "largest pressure", column=("largest\npressure", "#.4g"), warns=doubt)
    def largest_pressure(found):
        """The largest pressure [Pa]."""
        return jnp.max(found.pressure)

    try:
        scene = parse_scene(BARE.replace("[32, 32]", "[16]").replace("8e4", "4e4"))
        results = plan(scene).run()
        sliding = gc.slide(scene.stack, build_surface(scene), pressure=2e5, velocity=1.0)
        assert sliding.largest_pressure == np.max(sliding.pressure)
        assert "largest_pressure [Pa]" in repr(sliding)
        np.testing.assert_allclose(results.largest_pressure[-1, -1], np.max(sliding.pressure), 1e-4)
        assert results.largest_pressure.attrs == {"units": "Pa", "long_name": "largest pressure"}
        here, stored = sliding.caveats[-1], results.attrs["caveats"].split("\n")[-1]
        assert here == f"The largest pressure is {sliding.largest_pressure:.2g} Pa."
        assert "largest pressure is" in stored and f" to {here.split()[-2]} Pa." in stored
        print_table(results, full=True)
        assert "largest" in capsys.readouterr().out
    finally:
        del OBSERVABLES["largest_pressure"]
    assert not hasattr(sliding, "largest_gap")


def measured_tread(omega: str, load: str = "") -> str:
    """A series known between frequencies [rad/s]; the scene excites 63 to 5e4 at most 1 m/s."""
    return changed(
        'kind = "tyre_tread"',
        'kind = "prony"\nequilibrium = 6e6\nstrengths = [2e7, 1e7]\ntimes = [1e-4, 1e-2]\n'
        f"measured = {{omega = {omega}, temperature = [250, 320.0]}}",
        "velocity = [0.01, 1.0]",
        f"velocity = [0.01, 1.0]\n{load}",
        "[solver]\n",
        PLAIN,
    )


def test_friction_from_frequencies_that_were_not_measured_is_refused_before_solving():
    scene = parse_scene(measured_tread("[1.0, 1e4]"))
    refusal = (
        r"excite 62\.8 to .* measured from 1 to 1e\+04 rad/s: up to \d+% of the friction at 1 of 2 "
        r"velocities \(1 to 1 m/s\).*`extrapolate = true` in \[load\]"
    )
    with pytest.raises(ValueError, match=refusal):
        plan(scene)
    # The last wave alone lies outside: less than a hundredth of the friction, and no refusal.
    surface = build_surface(scene)
    fastest = np.max(np.abs(wave_frequencies(surface.grid, 1.0)))
    check_frequencies_of(parse_scene(measured_tread(f"[1.0, {0.99 * fastest}]")), surface)


def test_extrapolated_friction_that_is_allowed_is_reported_and_marked():
    results = plan(parse_scene(measured_tread("[1.0, 1e4]", "extrapolate = true"))).run()
    assert np.all(results.extrapolated_friction[:, 0] == 0)
    assert np.all(results.extrapolated_friction[:, 1] > 0.05)
    (caveat,) = (c for c in warnings_of(results) if "not measured" in c.sentence)
    np.testing.assert_array_equal(caveat.where, [[False, True]] * 2)


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


def other_numbers() -> dict[str, Scene]:
    """A scene with one other number, by what is other: each number of a scene that has any."""
    scene = parse_scene(LINE)
    found = {}
    for name in ("stack", "shear"):
        for path, value in paths(getattr(scene, name)).items():
            if not path.endswith("]"):
                tree = with_values(getattr(scene, name), {path: value * (1 - 1e-15)})
                found[f"{name}.{path}"] = dataclasses.replace(scene, **{name: tree})
    return found


# A text that stands for the other one in `LINE`; the first is a number by its last bit.
OTHER_SOLVES = [
    ("temperature = 300.00000000000006", "temperature = 300.0"), ("1.0001e-6", "1e-6"),
    ("1.1e-3", "1e-3"), ("seed = 4", "seed = 3"), ("seeds = 1", "seed = 3"),
    ("newton = true", "newton = false"), ("[observe]\nflow = true\n[solver]", "[solver]"),
]  # fmt: skip


def distinct(names) -> bool:
    """Whether all names of solves differ, of pairs of solves."""
    return len({point for points in names.values() for point in points.flat}) == 2 * len(names)


@pytest.mark.slow
def test_every_number_of_block_and_shear_decides_the_name_of_a_solve():
    """By its last bits."""
    others = other_numbers() | {"as it is": parse_scene(LINE)}
    assert distinct({what: plan(other).points for what, other in others.items()})


@pytest.mark.parametrize(
    "changes",
    [
        (("[24]", "[16]"), ("[solver]\nmax_steps = 7", "[solver]")),
        pytest.param(OTHER_SOLVES, marks=pytest.mark.slow),
    ],
    ids=["few", "all"],
)
def test_whatever_decides_the_numbers_of_a_solve_decides_its_name(changes):
    """A number of the block and of the load, heights and measured points by their last bits."""
    planned = plan(parse_scene(LINE))
    names = {
        "as it is": planned.points,
        "a number": plan(next(iter(other_numbers().values()))).points,
    }
    heights, scene = planned.surface.heights, planned.scene
    higher = dataclasses.replace(planned.surface, heights=heights.at[3].multiply(1 - 1e-15))
    filled = dataclasses.replace(planned.surface, measured=jnp.arange(16) != 3)
    names |= {"heights": plan(scene, surface=higher).points}
    names |= {"measured": plan(scene, surface=filled).points}
    for new, old in changes:
        names[new] = plan(parse_scene(LINE.replace(old, new))).points
    with jax.enable_x64(False):
        names |= {"precision": plan(parse_scene(LINE.replace("1e-6", "1e-3"))).points}
    assert distinct(names), {what: n.flat[0][:6] for what, n in names.items()}


def test_another_version_decides_the_names_of_solves_and_what_decides_no_number_does_not(
    scene, results, monkeypatch
):
    """Neither the order nor the number of other points counts."""
    for other in (
        ("a small one", "another"), ("[2e5, 4e5]", "[3e5, 4e5, 2e5]"), ("[0.01, 1.0]", "1.0"),
        ("[solver]", '[output]\nfields = "none"\nname = "n"\n[solver]'),
        ("[solver]", "extrapolate = true\n[solver]"),
    ):  # fmt: skip
        planned = plan(parse_scene(changed(*other)))
        axes = planned.scene.axes
        for i, j in np.ndindex(planned.points.shape):
            known = results.point.where(
                (results.pressure == axes["pressure"][i])
                & (results.velocity == axes["velocity"][j]),
                drop=True,
            )
            assert known.values.size == (axes["pressure"][i] != 3e5), other
            assert not known.size or known.item() == planned.points[i, j], other
    versions = package_versions() | {"version_graded_contact": "0"}
    monkeypatch.setattr(PROGRAM, "package_versions", lambda: versions)
    assert not np.any(np.isin(plan(scene).points, results.point))


def test_a_plan_draws_and_traces_once_and_solves_nothing(scene, monkeypatch):
    """For any number of points; a run then compiles what the plan has traced."""
    calls = []

    def counted(room, name):
        own = getattr(room, name)
        monkeypatch.setattr(room, name, lambda *a: calls.append(name) or own(*a))

    counted(PLAN, "trace")
    counted(RandomSurface, "build")
    for room, name in ((SWEEP, "runner"), (PLAN, "collect")):
        monkeypatch.setattr(room, name, None)
    many = changed("[0.01, 1.0]", "{from = 0.01, to = 1.0, points = 50}")
    planned = plan(parse_scene(many))
    assert calls == ["build", "trace"] and planned.points.shape == (2, 50)
    text = str(planned)
    assert "32 x 32 points" in text and "contact solves         100" in text
    assert len(set(planned.points.flat)) == 100
    monkeypatch.undo()
    counted(PLAN, "trace")
    counted(SWEEP, "trace")
    counted(RandomSurface, "build")
    plan(scene).run()
    assert calls[2:] == ["build", "trace"]


def test_a_plan_names_what_makes_every_number_doubtful(scene):
    told = dataclasses.replace(scene, assumed=("tread: Read as tension.",))
    assert str(plan(told)).splitlines()[-1] == "Warning: tread: Read as tension."


def test_a_scene_that_needs_more_memory_than_there_is_is_refused(scene, monkeypatch, tmp_path):
    """Before it is drawn; a file when its points are known."""
    monkeypatch.setattr("graded_contact.core.memory.available_memory", lambda: 2.0**30)
    np.savetxt(tmp_path / "h.txt", np.random.default_rng(0).normal(size=(8, 8)) * 1e-6)
    of_file = changed(
        'kind = "self_affine"\nrms_slope = 0.2\nhurst = 0.8\nq_roll = 2e4\nq_high = 8e4\nseed = 3',
        'kind = "file"\npath = "h.txt"\nsize = 1e-3\nunit = "m"\nshape = [2048, 2048]',
        "[grid]\nshape = [32, 32]\nsize = 1e-3\n", "",
    )  # fmt: skip
    with pytest.raises(ValueError, match=r"^\[surface\] `shape` is refused: this scene of 2048"):
        plan(parse_scene(of_file, tmp_path))
    monkeypatch.setattr(RandomSurface, "build", None)
    with pytest.raises(ValueError, match=r"^\[grid\] `shape` is refused: this scene of 2048"):
        plan(parse_scene(changed("[32, 32]", "[2048, 2048]")))


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


def test_the_shift_of_the_one_law_makes_reduced_velocities_and_unlike_laws_none(varied):
    scene, results = varied
    shift = scene.stack.base.material.shift
    for i, temperature in enumerate((293.15, 273.15)):
        expected = float(shift.factor(temperature)) * scene.velocity
        np.testing.assert_allclose(results.reduced_velocity[i], expected, rtol=1e-12)
    assert f"{float(shift.reference):.2f} K" in results.attrs["master_curve"]
    other = (
        'kind = "prony"\nequilibrium = 2e7\nstrengths = 1e7\ntimes = 1.0\n'
        'shift = {kind = "arrhenius", activation_energy = 1e5, reference = 293.15}'
    )
    scene = parse_scene(VARIED.replace('kind = "elastic"\nmodulus = 2e7', other))
    factor, reason = shift_factors(scene)
    assert factor is None and reason.startswith("No master curve")


@pytest.mark.slow
def test_errors_act_wherever_their_material_lies_and_not_on_what_is_swept(tmp_path):
    """Against differences of `slide`, over temperature and a path of the block."""
    (tmp_path / "e.csv").write_text("equilibrium,strengths[0],poisson\n1e5,2e5,0\n0,-3e5,1e-3\n")
    (tmp_path / "m.csv").write_text("modulus,poisson\n1e6,0.01\n")
    tread = (
        'kind = "prony"\nequilibrium = 6e6\nstrengths = [2e7]\ntimes = [1e-3]\npoisson = 0.45\n'
        'measured = {omega = [1.0, 1e7]}\nerrors = "e.csv"\n'
        'shift = {kind = "wlf", c1 = 4.0, c2 = 100.0, reference = 290.0}'
    )
    text = changed(
        'kind = "tyre_tread"', tread, '[[layers]]',
        'errors = "m.csv"\n[[layers]]\nmaterial = "tread"\nthickness = 1e-5\n[[layers]]',
        "[2e5, 4e5]", "2e5", "[0.01, 1.0]", "0.1", "[solver]",
        'temperature = [290, 300]\n[sweep]\n"layers[1].material.modulus" = [2e7, 4e7]\n[solver]',
    )  # fmt: skip
    scene = parse_scene(text, tmp_path)
    results = plan(scene).run()
    assert np.all(results.message == "") and results.friction_standard_error.shape == (2, 2, 1, 1)
    surface, index = build_surface(scene), (1, 1, 0, 0)

    @jax.jit
    def friction(equilibrium, strength, poisson, stiffness):
        rubber = gc.Prony(equilibrium, [strength], [1e-3], poisson, gc.WLF(4.0, 100.0, 290.0))
        layers = [gc.Layer(rubber, 1e-5), gc.Layer(gc.Elastic(4e7, stiffness), 2e-5)]
        block = gc.Stack(layers=layers, base=gc.HalfSpace(rubber)).at(300.0)
        return gc.slide(block, surface, pressure=2e5, velocity=0.1, rtol=1e-11).friction

    at = np.array([6e6, 2e7, 0.45, 0.4])
    errors = np.array([[1e5, 2e5, 0, 0], [0, -3e5, 1e-3, 0], [0, 0, 0, 0.01]])
    slopes = [(friction(*(at + e * 1e-3)) - friction(*(at - e * 1e-3))) / 2e-3 for e in errors]
    np.testing.assert_allclose(results.friction[index], friction(*at), rtol=1e-5)
    found = results.friction_standard_error[index]
    np.testing.assert_allclose(found, np.linalg.norm(slopes), rtol=1e-3)
    # Errors decide the name of a solve.
    bare = parse_scene(text.replace('errors = "e.csv"\n', ""), tmp_path)
    assert not np.any(np.isin(plan(bare).points, results.point))


def test_frequencies_that_no_table_covers_are_refused_at_any_temperature(tmp_path):
    write(tmp_path, TABLE)
    shift = 'shift = {kind = "arrhenius", activation_energy = 1e5, reference = 293.15}\n'
    text = (
        tabulated("refuse")
        .replace('extrapolate = "refuse"', f'extrapolate = "refuse"\n{shift}')
        .replace("[0.01, 1.0]", "1e-4")
        .replace("[solver]", "temperature = [293.15, 350]\n[solver]")
    )
    with pytest.raises(ValueError, match=r"At temperature = .*covers"):
        plan(parse_scene(text, tmp_path))


MELT = 'kind = "prony"\nequilibrium = 0.0\nstrengths = [1e6]\ntimes = [1e-2]'
SOLID = MELT.replace("0.0", "1e5")
BLEND = 'bottom = "coat"\ntop = "melt"\nshape = {kind = "linear"}'


@pytest.mark.parametrize(
    "name, pairs",
    [
        ("tread", ('kind = "tyre_tread"', MELT)),
        ("coat", ('kind = "elastic"\nmodulus = 2e7\npoisson = 0.4', MELT)),
        ("melt", ("[[layers]]", f"[materials.melt]\n{MELT}\n[[layers]]",
                  'material = "coat"', BLEND)),
        ("melt", ("[materials.tread]", f"[materials.melt]\n{MELT}\n[materials.tread]",
                  'kind = "tyre_tread"', 'kind = "softened"\nmaterial = "melt"\n'
                  "strain = [1e-3, 1e-1]\nstorage = [1.0, 0.5]\nloss = [1.0, 0.5]")),
        ("tread", ('kind = "tyre_tread"', SOLID, "[solver]",
                   '[sweep]\n"base.material.equilibrium" = [1e5, 0.0]\n[solver]')),
    ],
)  # fmt: skip
def test_a_liquid_is_refused_by_the_name_of_its_material(name, pairs):
    scene = parse_scene(changed(*pairs))
    with pytest.raises(ValueError, match=rf"^\[materials.{name}\] is a liquid .*--equilibrium"):
        plan(scene)
