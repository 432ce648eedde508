"""A function at many points: every point once, kept at once, the same bits however it was done."""

import contextlib
import csv
import os
import pickle
import signal

import equinox as eqx
import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache.compilation_cache import reset_cache

import graded_contact as gc
from graded_contact.contact.problem import RESULTS
from graded_contact.files.study import LOST, read_study
from graded_contact.studies import chunk as chunk_module
from graded_contact.studies import cluster, engine
from graded_contact.studies import sweep as sweep_module
from graded_contact.studies.program import identity, trace
from graded_contact.studies.store import Store
from graded_contact.studies.sweep import sweep

AXES = {"velocity": [0.1, 1.0, 10.0], "seed": [3, 4]}


def draw(point):
    """Cheap, and of every kind: a number, a field, a complex number, a whole one."""
    noise = jax.random.normal(jax.random.key(point["seed"]), (2, 3))
    modulus = 1 + 1j * point["velocity"]
    return {"friction": point["velocity"] * noise[0, 0], "field": noise, "modulus": modulus,
            "seed_again": point["seed"]}  # fmt: skip


def same(one, other):
    assert one.values.keys() == other.values.keys()
    for name, values in one.values.items():
        assert values.tobytes() == other.values[name].tobytes(), name
    np.testing.assert_array_equal(one.message, other.message)


def test_every_quantity_lies_over_the_named_axes():
    study = sweep(draw, AXES)
    assert list(study.axes) == ["velocity", "seed"] and study.complete
    for i, velocity in enumerate(AXES["velocity"]):
        for j, seed in enumerate(AXES["seed"]):
            noise = jax.random.normal(jax.random.key(seed), (2, 3))
            np.testing.assert_allclose(study["field"][i, j], noise, rtol=1e-14)
            np.testing.assert_allclose(study["friction"][i, j], velocity * noise[0, 0], rtol=1e-15)
    np.testing.assert_array_equal(study["modulus.imag"][:, 0], AXES["velocity"])
    np.testing.assert_array_equal(study["seed_again"], [[3, 4]] * 3)
    assert study.units == {"velocity": "m/s", "friction": "1"}


def test_a_list_of_points_has_one_axis():
    points = [{"velocity": 0.1, "seed": 4}, {"velocity": 10.0, "seed": 3}]
    study, grid = sweep(draw, points), sweep(draw, AXES)
    assert study["friction"].tolist() == [grid["friction"][0, 1], grid["friction"][2, 0]]
    np.testing.assert_array_equal(study["velocity"], [0.1, 10.0])
    np.testing.assert_array_equal(study["seed"], [4, 3])


def test_a_rerun_computes_what_is_missing_to_the_same_bits(tmp_path, monkeypatch):
    whole = sweep(draw, AXES)
    told = []

    def interrupt(done, count):
        told.append(done)
        raise KeyboardInterrupt

    kept = tmp_path / "kept"
    cut = sweep(draw, AXES, store=kept, progress=interrupt)
    assert told == [1] and np.sum(cut.message == "not started") == 5
    assert np.isnan(cut["friction"][cut.message != ""]).all() and not cut.complete
    again = sweep(draw, AXES, store=kept, progress=lambda *at: told.append(at))
    assert told[1:2] + told[-1:] == [(1, 6), (6, 6)]
    same(again, whole)
    more = sweep(draw, AXES | {"seed": [3, 4, 5]}, store=kept, progress=lambda *at: told.append(at))
    assert (6, 9) in told and more["friction"][:, :2].tobytes() == whole["friction"].tobytes()
    other = sweep(lambda p: draw(p) | {"friction": p["velocity"]}, AXES, store=kept)
    assert other["friction"][0, 0] == 0.1


def test_a_point_that_fails_is_kept_with_its_reason_and_the_rest_goes_on(tmp_path, capfd):
    def picky(point):
        value = eqx.error_if(point["x"], point["x"] == 2, "two is refused")
        return {"value": value, "result": RESULTS.where(value > 3, stopped, RESULTS.successful)}

    stopped = RESULTS.max_steps_reached
    for _ in range(2):  # the second time from what was kept
        capfd.readouterr()
        study = sweep(picky, {"x": [1.0, 2.0, 3.0, 4.0]}, store=tmp_path / "kept")
        assert study.message[0] == study.message[2] == ""
        assert study.message[1] == "failed: two is refused"
        assert capfd.readouterr().err == ""  # JAX prints a traceback
        assert study.ends["successful"] == 2 and "failed: two is refused 1" in " ".join(
            repr(study).split()
        )
        assert study.message[3] == RESULTS[stopped]
        np.testing.assert_array_equal(study["value"], [1, np.nan, 3, 4])


def test_a_program_is_told_by_what_it_computes():
    heights = np.zeros(1000)
    other = heights.copy()
    other[500] = 1e-300  # which the text of a program does not show
    closing = lambda h: lambda point: jnp.sum(jnp.asarray(h) * point["x"])  # noqa: E731
    inside = lambda h: lambda point: jax.jit(closing(h))(point)  # noqa: E731
    drawn = lambda seed: lambda point: jax.random.normal(jax.random.key(seed)) * point["x"]  # noqa: E731
    names = [
        identity(trace(f, {"x": np.float64(1)}))
        for f in (closing(heights), closing(other), inside(heights), inside(other),
                  drawn(0), drawn(1))
    ]  # fmt: skip
    assert len(set(names)) == len(names)
    assert names[0] == identity(trace(lambda p: closing(heights)(p), {"x": np.float64(7)}))


@pytest.fixture
def compilation_cache(tmp_path):
    """A cache of its own on the disk, and what JAX tells of it."""
    options = {
        "jax_compilation_cache_dir": str(tmp_path / "cache"),
        "jax_persistent_cache_min_compile_time_secs": 0,
        "jax_persistent_cache_min_entry_size_bytes": -1,
    }
    before = {name: getattr(jax.config, name) for name in options}
    events = []
    jax.monitoring.register_event_listener(listener := lambda event, **_: events.append(event))
    for settings in (options, before):
        for name, value in settings.items():
            jax.config.update(name, value)
        reset_cache()
        if settings is options:
            yield events
    jax.monitoring.unregister_event_listener(listener)


def test_another_surface_or_thickness_takes_the_same_compiled_program(compilation_cache):
    def study(heights, thickness, wrapped):
        def closing(point):
            return jnp.sum(heights) * thickness / point["x"]

        return sweep(wrapped(closing), {"x": [1.0, 2.0]})["value"]

    study(np.ones(100), 3.0, lambda f: f)
    assert "/jax/compilation_cache/cache_misses" in compilation_cache
    compilation_cache.clear()
    np.testing.assert_array_equal(study(np.full(100, 2.0), 5.0, lambda f: f), [1000, 500])
    np.testing.assert_array_equal(study(np.full(100, 3.0), 4.0, jax.jit), [1200, 600])
    assert "/jax/compilation_cache/cache_misses" not in compilation_cache


def test_a_name_that_no_axis_has_is_told_with_the_nearest():
    with pytest.raises(ValueError, match=r"asks for 'velocty', which no axis has.*velocity"):
        sweep(lambda point: point["velocty"], AXES)
    with pytest.raises(KeyError, match="velocity"):  # of the function's own
        sweep(lambda point: {}["velocity"], AXES)


def test_mean_standard_error_and_quantiles_over_an_axis():
    values = np.random.default_rng(0).normal(size=(2, 9))
    seeds = np.arange(9)

    def pick(point):
        return eqx.error_if(
            jnp.asarray(values)[point["row"], point["seed"]],
            (point["row"] == 1) & (point["seed"] == 5), "missing",
        )  # fmt: skip

    spread = sweep(pick, {"row": [0, 1], "seed": seeds}).over("seed", quantiles=(0.1, 0.5))
    for row, kept in enumerate([values[0], np.delete(values[1], 5)]):
        error = kept.std(ddof=1) / np.sqrt(len(kept))
        np.testing.assert_allclose(spread.mean["value"][row], kept.mean(), rtol=1e-13)
        np.testing.assert_allclose(spread.standard_error["value"][row], error, rtol=1e-13)
        found = spread.quantiles["value"][:, row]
        np.testing.assert_allclose(found, np.quantile(kept, [0.1, 0.5]), rtol=1e-13)
    assert list(spread.quantiles.axes) == ["quantile", "row"]
    with pytest.raises(ValueError, match=r"`quantiles\[1\]=5` is refused: they are from 0 to 1"):
        spread.mean.over("row", quantiles=[0.5, 5])


def test_a_file_and_a_table_hold_the_study(tmp_path):
    study = sweep(draw, AXES)
    study.write(tmp_path / "study.h5")
    found = read_study(tmp_path / "study.h5")
    same(found, study)
    assert found.units == study.units and list(found.axes) == list(study.axes)
    study.to_csv(tmp_path / "study.csv")
    with open(tmp_path / "study.csv", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0][:2] == ["velocity [m/s]", "seed"] and len(rows) == 7
    column = rows[0].index("friction [1]")
    assert [float(row[column]) for row in rows[1:]] == study["friction"].ravel().tolist()
    with h5py.File(tmp_path / "study.h5", "r+") as file:
        del file["message"]
    with pytest.raises(ValueError, match="cannot be read as"):
        read_study(tmp_path / "study.h5")


def test_xarray_opens_the_file_and_takes_the_study(tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    study = sweep(draw, AXES)
    study.write(tmp_path / "study.h5")
    with xarray.open_dataset(tmp_path / "study.h5", engine="h5netcdf") as opened:
        taken = study.to_xarray()
        for name in study.values:
            assert opened[name].dims[:2] == taken[name].dims[:2] == ("velocity", "seed")
            np.testing.assert_array_equal(opened[name], taken[name])
        assert opened.velocity.attrs == taken.velocity.attrs == {"units": "m/s"}


@pytest.mark.parametrize("axes, reason", [
    ({}, "no points"),
    ([], "must be a dict of axes or a list of points"),
    ({"velocity": []}, r"`velocity` has shape \(0,\)"),
    ({"velocity": 1.0}, r"`velocity` has shape \(\)"),
    ({"velocity": [1.0, np.nan]}, "`velocity"),
    ({"velocity": [1.0, 1.0]}, "holds a value twice"),
    ({"velocity": ["fast"]}, "`velocity"),
    ({"a/b": [1.0]}, "without a slash"),
    ([{"x": 1.0}, {"y": 1.0}], r"`axes\[1\]=.*names of the first point"),
    ([{"x": 1.0}, {"x": 1.0}], "lists a point twice"),
])  # fmt: skip
def test_axes_that_are_none_are_refused_before_anything_is_computed(axes, reason):
    def never(point):
        raise AssertionError

    with pytest.raises(ValueError, match=reason):
        sweep(never, axes)


def test_an_axis_on_which_nothing_depends_and_a_function_of_nothing_are_refused():
    axes = {"velocity": [1.0, 2.0], "presure": [1.0, 2.0]}
    with pytest.raises(ValueError, match=r"`axes` has 'presure', on which nothing .* depends"):
        sweep(lambda point: point["velocity"], axes)
    assert sweep(lambda point: point["velocity"], axes | {"presure": [1.0]}).complete
    with pytest.raises(ValueError, match="`function` returns no numbers"):
        sweep(lambda point: None, axes)


@pytest.mark.parametrize("name", ["velocity", "message", "point"])
def test_a_result_with_the_name_of_an_axis_is_refused(name):
    with pytest.raises(ValueError, match=f"`function` returns '{name}'"):
        sweep(lambda point: {name: point["velocity"]}, {"velocity": [1.0, 2.0]})


def test_more_than_memory_holds_is_refused_with_what_would_fit(monkeypatch):
    monkeypatch.setattr(sweep_module, "available_memory", lambda: 5e9)
    axes = {"x": np.arange(100.0)}
    with pytest.raises(ValueError, match=r"100 points with 0\.8 GB each.* 6 would fit"):
        sweep(lambda point: jnp.zeros(10**8) + point["x"], axes)


def test_a_damaged_point_is_solved_again(tmp_path):
    whole = sweep(draw, AXES, store=tmp_path)
    for path, content in zip(sorted(tmp_path.glob("*.h5")), (b"", b"garbage"), strict=False):
        path.write_bytes(content)
    told = []
    again = sweep(draw, AXES, store=tmp_path, progress=lambda *at: told.append(at))
    assert told[0] == (4, 6)
    same(again, whole)


def test_a_second_writer_is_refused(tmp_path):
    with Store(tmp_path), pytest.raises(BlockingIOError, match="another process"):
        sweep(draw, AXES, store=tmp_path)


def test_a_sweep_of_contacts_gives_what_slide_gives():
    grid, q0 = gc.Grid((16, 16), 1e-3), 2 * np.pi / 1e-3
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=q0, q_roll=q0, q_high=4 * q0)
    stack = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))

    def rub(point):
        surface = gc.random_surface(spectrum, grid, jax.random.key(point["seed"]))
        rubber = stack.at(point["temperature"])
        return gc.slide(rubber, surface, pressure=1e5, velocity=0.1, throw=False)

    axes = {"temperature": [293.0, 313.0], "seed": [0, 1]}
    study = sweep(rub, axes)
    alone = rub({"temperature": 313.0, "seed": 1})
    np.testing.assert_allclose(study["friction"][1, 1], alone.friction, rtol=1e-9)
    assert study["contact.pressure"].shape == (2, 2, 16, 16) and study.complete
    assert study.units["contact.pressure"] == "Pa"


@pytest.mark.parametrize("given", [
    {"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, {"workers": "auto", "client": object()},
    {"workers": 0}, {"workers": 1.5}, {"workers": "all"},
])  # fmt: skip
def test_one_place_to_solve_is_named(given, unchecked_types):
    with pytest.raises(ValueError, match="workers"):
        sweep(draw, AXES, **given)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "PATIENCE", 0.2)
    with pytest.raises(TimeoutError, match=r"127\.0\.0\.1:9.* does not answer within 0\.2 s"):
        sweep(draw, AXES, scheduler="tcp://127.0.0.1:9")


@pytest.fixture
def threads(monkeypatch):
    """A client of a scheduler and a worker that are threads of this process."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "PATIENCE", 0.2)
    options = {"processes": False, "dashboard_address": "127.0.0.1:0", "set_as_default": False}
    with distributed.Client(n_workers=1, threads_per_worker=2, **options) as client:
        yield client


def test_tasks_carry_the_numbers_of_a_few_points(threads, monkeypatch):
    heights = jnp.ones(10**5)
    sizes, submit = [], threads.submit

    def noted(task, *arguments, **options):
        sizes.append(len(pickle.dumps([a for a in arguments if not hasattr(a, "key")])))
        return submit(task, *arguments, **options)

    monkeypatch.setattr(threads, "submit", noted)
    function = lambda point: jnp.sum(heights * point["x"])  # noqa: E731
    axes = {"x": np.arange(20.0)}
    same(sweep(function, axes, client=threads), sweep(function, axes))
    assert sizes[0] > heights.nbytes and max(sizes[1:]) < 1000


def test_a_scheduler_without_workers_is_told(threads):
    threads.retire_workers(list(threads.scheduler_info()["workers"]))
    with pytest.raises(TimeoutError, match=r"has had no worker for 0\.2 s"):
        sweep(draw, AXES, client=threads)


def test_a_scheduler_that_ends_is_named_and_what_was_finished_is_kept(
    threads, monkeypatch, tmp_path
):
    answers = [threads.nthreads()]

    def nthreads():
        if not answers:
            raise pytest.importorskip("distributed.comm").CommClosedError("closed")
        return answers.pop()

    monkeypatch.setattr(threads, "nthreads", nthreads)
    with pytest.raises(
        ConnectionError, match=r"^The scheduler inproc.* is gone: closed\. Finished"
    ):
        sweep(draw, AXES, client=threads, store=tmp_path)
    assert len(list(tmp_path.glob("*.h5"))) >= 1


def test_workers_relieve_this_process_where_they_pay(threads, monkeypatch):
    started = []
    monkeypatch.setattr(engine, "num_cores", lambda: 4)
    monkeypatch.setattr(
        engine, "local_workers", lambda n: started.append(n) or contextlib.nullcontext(threads)
    )
    whole = sweep(draw, AXES, workers="auto")  # no time to be saved
    assert not started
    monkeypatch.setattr(engine, "pays", lambda *_: True)
    same(sweep(draw, AXES, workers="auto"), whole)
    assert started == [4]


def test_workers_pay_where_they_save_more_than_they_take_to_start():
    """An hour of short solves does, by 4 workers but not by one; seconds do not."""
    assert engine.pays(180_000, 0.02, 20.0, 4)
    assert not engine.pays(180_000, 0.02, 20.0, 1)
    assert not engine.pays(1_000, 0.02, 20.0, 4)


@pytest.mark.slow
def test_a_point_whose_worker_dies_again_and_again_is_tried_anew_in_a_rerun(monkeypatch, tmp_path):
    pytest.importorskip("distributed")

    def deadly(packed, columns, keep):
        if 2 in columns["x"]:
            os.kill(os.getpid(), signal.SIGKILL)
        return [{"value": np.array(x)} for x in columns["x"]], [""] * len(columns["x"]), 0.1

    function, axes = lambda point: 1.0 * point["x"], {"x": np.arange(10.0)}
    with monkeypatch.context() as patch:
        patch.setattr(cluster, "_on_worker", deadly)
        study = sweep(function, axes, workers=2, store=tmp_path)
    assert study.message[2] == "failed: its worker died, each time that it was tried"
    assert np.sum(study.message == "") == 9 and study["value"][9] == 9
    again = sweep(function, axes, store=tmp_path)
    assert again.complete and again["value"][2] == 2


def test_what_a_machine_failed_at_is_solved_in_a_rerun_and_a_failure_of_the_point_is_kept(
    monkeypatch, tmp_path
):
    ends = {0: "", 1: LOST, 2: "failed: it is no number"}

    def ended(program, work, *_):
        for i in work.take(3):
            yield chunk_module.Finished([i], [{"value": np.array(7.0)} if not i else {}], [ends[i]])

    monkeypatch.setattr(sweep_module, "solved", ended)
    function, axes = lambda point: 1.0 * point["x"], {"x": np.arange(3.0)}
    assert sweep(function, axes, store=tmp_path).message.tolist() == list(ends.values())
    monkeypatch.undo()
    again = sweep(function, axes, store=tmp_path)
    assert again.message.tolist() == ["", "", ends[2]]
    assert again["value"][:2].tolist() == [7.0, 1.0]


@pytest.mark.slow
def test_workers_give_the_same_bits_and_survive_the_death_of_one():
    pytest.importorskip("distributed")
    from graded_contact.studies.cluster import local_workers

    def slow(point):
        return jax.lax.fori_loop(0, 20_000_000, lambda i, x: x * 0.5 + 1, point["x"])

    axes = {"x": np.arange(6.0)}
    killed = []
    with local_workers(2) as client:

        def kill(done, count):
            if not killed:
                pid = next(iter(client.run(lambda: __import__("os").getpid()).values()))
                killed.append(pid)
                __import__("os").kill(pid, signal.SIGKILL)

        study = sweep(slow, axes, client=client, progress=kill)
    assert killed and study.complete
    same(study, sweep(slow, axes))


def test_functions_that_differ_in_numbers_alone_are_compiled_once_in_a_process():
    def of(factor, name="value"):
        return lambda point: {name: jnp.cos(factor * point["x"])}

    axes, chunks = {"x": [1.0, 2.0]}, chunk_module._COMPILED
    first = sweep(of(2.0), axes)
    count = len(chunks)
    np.testing.assert_allclose(sweep(of(3.0), axes)["value"], np.cos([3.0, 6.0]))
    assert len(chunks) == count and first["value"][0] == np.cos(2.0)
    # Another name is another result.
    assert sweep(of(2.0, "other"), axes)["other"].tolist() == first["value"].tolist()
