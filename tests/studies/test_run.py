"""Scenes are run point by point; what is kept is not computed again."""

from pathlib import Path

import jax
import numpy as np
import pytest
from scenes import TABLE, TEXT, changed, tabulated, write

import graded_contact as gc
from graded_contact.contact.observables import wave_frequencies
from graded_contact.files.results import AXES, FIELDS, OBSERVABLES, TEXTS
from graded_contact.files.scene import parse_scene, read_scene
from graded_contact.studies import run as run_module
from graded_contact.studies.extrapolation import check_frequencies_of
from graded_contact.studies.run import build_surface, run_scene
from graded_contact.studies.store import Store

DATA = Path(__file__).parents[3] / "shared" / "data"
MEASURED = sorted((Path(__file__).parents[2] / "examples").glob("measured_*.toml"))
needs_data = pytest.mark.skipif(not DATA.exists(), reason="measured data lie beside the project")


@pytest.fixture(scope="module")
def scene():
    return parse_scene(TEXT)


@pytest.fixture(scope="module")
def results(scene):
    return run_scene(scene)


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
    check_frequencies_of(
        parse_scene(measured_tread(f"[1.0, {0.99 * fastest}]")), build_surface(scene)
    )
    check_frequencies_of(parse_scene(TEXT), build_surface(scene))


def test_extrapolated_friction_that_is_allowed_is_reported_and_marked():
    results = run_scene(parse_scene(measured_tread("[1.0, 1e4]", "extrapolate = true")))
    assert np.all(results.extrapolated_friction[:, 0] == 0)
    assert np.all(results.extrapolated_friction[:, 1] > 0.05)
    (caveat,) = (c for c in results.caveats if "not measured" in c.sentence)
    np.testing.assert_array_equal(caveat.where, [[False, True]] * 2)


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
    calls, slide = [], run_module.slide

    def noting(*arguments, **options):
        calls.append((float(options["pressure"]), float(options["velocity"])))
        return slide(*arguments, **options)

    monkeypatch.setattr(run_module, "slide", noting)
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
    slide, calls = run_module.slide, []

    def sometimes(*arguments, **options):
        calls.append(None)
        if len(calls) == call:
            raise error
        return slide(*arguments, **options)

    monkeypatch.setattr(run_module, "slide", sometimes)


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
