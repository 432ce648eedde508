"""A function at many points: each point is solved once, stored at once, and has the same bits."""

import contextlib
import importlib
import os
import pickle
import signal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.solve import RESULTS
from graded_contact.studies import program as program_module
from graded_contact.studies import workers as workers_module
from graded_contact.studies.dataset import LOST, read_dataset, write
from graded_contact.studies.program import trace
from graded_contact.studies.store import Point, Store
from graded_contact.studies.sweep import sweep

# In the room, `sweep` is the function.
sweep_module = importlib.import_module("graded_contact.studies.sweep")
AXES = {"velocity": [0.1, 1.0, 10.0], "seed": [3, 4]}


def draw(point):
    """Cheap results of every kind: a number, a field, a complex number, a whole number."""
    noise = jax.random.normal(jax.random.key(point["seed"]), (2, 3))
    modulus = 1 + 1j * point["velocity"]
    return {"friction": point["velocity"] * noise[0, 0], "field": noise, "modulus": modulus,
            "seed_again": point["seed"]}  # fmt: skip


def same(one, other):
    """Whether two datasets are equal bit for bit."""
    assert one.identical(other)
    return all(one[name].values.tobytes() == other[name].values.tobytes() for name in one.variables)


def test_every_result_lies_over_the_named_axes_with_units():
    study = sweep(draw, AXES, units={"field": "m"})
    assert list(study.sizes)[:2] == ["velocity", "seed"] and (study.message == "").all()
    assert study.field.dims == ("velocity", "seed", "field_0", "field_1")
    for i, velocity in enumerate(AXES["velocity"]):
        for j, seed in enumerate(AXES["seed"]):
            noise = jax.random.normal(jax.random.key(seed), (2, 3))
            np.testing.assert_allclose(study.field[i, j], noise, rtol=1e-14)
            np.testing.assert_allclose(study.friction[i, j], velocity * noise[0, 0], rtol=1e-15)
    np.testing.assert_array_equal(study["modulus.imag"][:, 0], AXES["velocity"])
    np.testing.assert_array_equal(study.seed_again, [[3, 4]] * 3)
    assert study.velocity.attrs == {"units": "m/s", "long_name": "sliding velocity"}
    assert study.friction.units == "1" and study.field.units == "m"


def test_a_list_of_points_has_one_axis_and_a_file_holds_it(tmp_path):
    points = [{"velocity": 0.1, "seed": 4}, {"velocity": 10.0, "seed": 3}]
    study, grid = sweep(draw, points), sweep(draw, AXES)
    assert study.friction.dims == ("point",)
    assert study.friction.values.tolist() == [grid.friction[0, 1], grid.friction[2, 0]]
    np.testing.assert_array_equal(study.velocity, [0.1, 10.0])
    write(tmp_path / "study.h5", study)
    assert same(read_dataset(tmp_path / "study.h5"), study)


def test_a_rerun_solves_what_is_missing_to_the_same_bits(tmp_path):
    whole, counts = sweep(draw, AXES), []

    def interrupt(done, count):
        counts.append(done)
        if done:
            raise KeyboardInterrupt

    store = tmp_path / "points"
    cut = sweep(draw, AXES, store=store, progress=interrupt)
    assert counts == [0, 1] and np.sum(cut.message == "not started") == 5
    assert np.isnan(cut.friction.values[cut.message != ""]).all()
    again = sweep(draw, AXES, store=store, progress=lambda *at: counts.append(at))
    assert counts[2:] == [(done, 6) for done in range(1, 7)]  # the first when it is compiled
    assert same(again, whole)
    wider = AXES | {"seed": [3, 4, 5]}
    more = sweep(draw, wider, store=store, progress=lambda *at: counts.append(at))
    assert (6, 9) in counts
    assert more.friction[:, :2].values.tobytes() == whole.friction.values.tobytes()
    other = sweep(lambda p: draw(p) | {"friction": p["velocity"]}, AXES, store=store)
    assert other.friction[0, 0] == 0.1


def test_the_order_of_the_axes_is_no_part_of_a_stored_point(tmp_path):
    function = lambda point: {"y": point["a"] + 10 * point["b"]}  # noqa: E731
    assert sweep(function, {"a": [1.0], "b": [2.0]}, store=tmp_path).y.item() == 21.0
    turned = sweep(function, {"b": [1.0, 2.0], "a": [2.0, 1.0]}, store=tmp_path)
    assert turned.y.values.tolist() == [[12.0, 11.0], [22.0, 21.0]]
    assert len([*tmp_path.glob("*.point")]) == 4  # the first is one of them


def test_a_damaged_point_is_solved_again_and_a_second_writer_refused(tmp_path):
    whole, counts = sweep(draw, AXES, store=tmp_path), []
    for path, content in zip(sorted(tmp_path.glob("*.point")), (b"", b"garbage"), strict=False):
        path.write_bytes(content)
    with pytest.warns(UserWarning, match=r"2 of the points in .* were damaged and are computed"):
        again = sweep(draw, AXES, store=tmp_path, progress=lambda *at: counts.append(at))
    assert counts[0] == (4, 6) and same(again, whole)
    assert same(sweep(draw, AXES, store=tmp_path), whole)  # without a warning
    with Store(tmp_path), pytest.raises(BlockingIOError, match=r"another process.* another store"):
        sweep(draw, AXES, store=tmp_path)


def test_a_point_that_fails_has_its_reason_and_the_rest_goes_on(tmp_path, capfd):
    def picky(point):
        value = eqx.error_if(point["x"], point["x"] == 2, "two is refused")
        return {"value": value, "result": RESULTS.where(value > 3, stopped, RESULTS.successful)}

    stopped = RESULTS.max_steps_reached
    for _ in range(2):  # the second time from the store
        capfd.readouterr()
        study = sweep(picky, {"x": [1.0, 2.0, 3.0, 4.0]}, store=tmp_path / "points")
        assert study.message.values.tolist() == ["", "failed: two is refused", "", RESULTS[stopped]]
        assert capfd.readouterr().err == ""  # JAX prints a traceback
        np.testing.assert_array_equal(study.value, [1, np.nan, 3, 4])


def test_the_key_of_a_program_differs_if_it_computes_anything_else():
    heights = np.zeros(1000)
    other = heights.copy()
    other[500] = 1e-300  # which the text of a program does not show
    closing = lambda h: lambda point: jnp.sum(jnp.asarray(h) * point["x"])  # noqa: E731
    inside = lambda h: lambda point: jax.jit(closing(h))(point)  # noqa: E731
    drawn = lambda seed: lambda point: jax.random.normal(jax.random.key(seed)) * point["x"]  # noqa: E731
    named = lambda name: lambda point: {name: 2 * point["x"]}  # noqa: E731
    keys = [
        trace(f, {"x": np.float64(1)}).key
        for f in (closing(heights), closing(other), inside(heights), inside(other),
                  drawn(0), drawn(1), named("a"), named("b"))
    ]  # fmt: skip
    assert len(set(keys)) == len(keys)
    assert keys[0] == trace(lambda p: closing(heights)(p), {"x": np.float64(7)}).key


def test_functions_that_differ_in_arrays_alone_are_compiled_once_in_a_process():
    def of(factor):
        array = jnp.asarray(factor)
        return lambda point: jnp.cos(array * point["x"])

    axes, ready = {"x": [1.0, 2.0]}, program_module._COMPILED
    first, newest = sweep(of(2.0), axes), list(ready)[-1]
    for wrapped in (of(3.0), jax.jit(of(3.0))):
        np.testing.assert_allclose(sweep(wrapped, axes)["value"], np.cos([3.0, 6.0]))
    assert list(ready)[-1] == newest and first["value"][0] == np.cos(2.0)


@pytest.mark.parametrize("axes, reason", [
    ({}, "one at least"),
    ({"velocity": []}, r"`velocity` has shape \(0,\)"),
    ({"velocity": [1.0, np.nan]}, "`velocity"),
    ({"velocity": [1.0, 1.0]}, "contains a point twice"),
    ({"a/b": [1.0]}, "without a slash"),
    ([{"x": 1.0}, {"y": 1.0}], r"`axes\[1\]=.*names of the first point"),
])  # fmt: skip
def test_wrong_axes_are_refused_before_anything_is_computed(axes, reason):
    def never(point):
        raise AssertionError

    with pytest.raises(ValueError, match=reason):
        sweep(never, axes)


def test_wrong_names_and_results_are_refused():
    with pytest.raises(ValueError, match=r"reads 'velocty', which is no axis.*velocity"):
        sweep(lambda point: point["velocty"], AXES)
    with pytest.raises(KeyError, match="velocity"):  # of a dict in the function
        sweep(lambda point: {}["velocity"], AXES)
    axes = {"velocity": [1.0, 2.0], "presure": [1.0, 2.0]}
    with pytest.raises(ValueError, match=r"`axes` has 'presure', on which no result"):
        sweep(lambda point: point["velocity"], axes)
    assert sweep(lambda point: point["velocity"], axes | {"presure": [1.0]})["value"].size == 2
    with pytest.raises(ValueError, match="`function` returns no numbers"):
        sweep(lambda point: None, axes)
    with pytest.raises(ValueError, match="`function` returns 'message'"):
        sweep(lambda point: {"message": point["velocity"]}, {"velocity": [1.0, 2.0]})


def test_more_than_the_memory_is_refused_with_what_would_fit(monkeypatch):
    monkeypatch.setattr(sweep_module, "available_memory", lambda: 5e9)
    axes = {"x": np.arange(100.0)}
    with pytest.raises(ValueError, match=r"100 points take 0\.8 GB each.* 6 points would fit"):
        sweep(lambda point: jnp.zeros(10**8) + point["x"], axes)


def test_a_sweep_of_contacts_equals_slide():
    grid, q0 = gc.Grid((16, 16), 1e-3), 2 * np.pi / 1e-3
    spectrum = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=q0, q_roll=q0, q_high=4 * q0)
    stack = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))

    def rub(point):
        surface = gc.random_surface(spectrum, grid, jax.random.key(point["seed"]))
        rubber = stack.at(point["temperature"])
        plain = gc.contacts.DouglasRachford(newton=False)  # compiles in two thirds of the time
        return gc.slide(rubber, surface, pressure=1e5, velocity=0.1, throw=False, solver=plain)

    study = sweep(rub, {"temperature": [293.0, 313.0], "seed": [0, 1]})
    alone = rub({"temperature": 313.0, "seed": 1})
    np.testing.assert_allclose(study.friction[1, 1], alone.friction, rtol=1e-9)
    assert study["contact.pressure"].shape == (2, 2, 16, 16) and (study.message == "").all()
    assert study["contact.pressure"].units == "Pa"


@pytest.mark.parametrize("given", [
    {"workers": "auto", "client": object()}, {"workers": 0}, {"workers": "all"},
])  # fmt: skip
def test_wrong_workers_are_refused(given, unchecked_types):
    with pytest.raises(ValueError, match="workers"):
        sweep(draw, AXES, **given)


@pytest.fixture
def threads(monkeypatch):
    """A client of a scheduler and a worker that are threads of this process."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(workers_module, "PATIENCE", 0.2)
    options = {"processes": False, "dashboard_address": "127.0.0.1:0", "set_as_default": False}
    with distributed.Client(n_workers=1, threads_per_worker=2, **options) as client:
        yield client


def test_tasks_hold_the_numbers_of_a_few_points(threads, monkeypatch):
    heights = jnp.ones(10**5)
    sizes, submit = [], threads.submit

    def noted(task, *arguments, **options):
        sizes.append(len(pickle.dumps([a for a in arguments if not hasattr(a, "key")])))
        return submit(task, *arguments, **options)

    monkeypatch.setattr(threads, "submit", noted)
    function = lambda point: jnp.sum(heights * point["x"])  # noqa: E731
    axes = {"x": np.arange(20.0)}
    whole = sweep(function, axes)
    assert same(sweep(function, axes, client=threads), whole)
    assert same(sweep(function, axes, client=threads.scheduler.address), whole)
    assert sizes[0] > heights.nbytes and max(sizes[1:]) < 2000


def test_no_scheduler_or_worker_is_reported(threads):
    with pytest.raises(OSError, match=r"127\.0\.0\.1:9"):
        sweep(draw, AXES, client="tcp://127.0.0.1:9")
    threads.retire_workers(list(threads.scheduler_info()["workers"]))
    with pytest.raises(TimeoutError, match=r"0/1 workers"):
        sweep(draw, AXES, client=threads)


def test_a_scheduler_that_ends_is_named_and_finished_points_are_stored(
    threads, monkeypatch, tmp_path
):
    answers = [threads.nthreads()]

    def nthreads():
        if not answers:
            raise pytest.importorskip("distributed.comm").CommClosedError("closed")
        return answers.pop()

    monkeypatch.setattr(threads, "nthreads", nthreads)
    with pytest.raises(
        ConnectionError, match=r"^The scheduler inproc.* does not answer: closed\. "
    ):
        sweep(draw, AXES, client=threads, store=tmp_path)
    assert len(list(tmp_path.glob("*.point"))) >= 1


def test_workers_start_where_they_save_time(threads, monkeypatch):
    started = []
    monkeypatch.setattr(workers_module, "num_cores", lambda: 4)

    def connected(workers, client):
        started.append(workers)
        return contextlib.nullcontext(threads)

    monkeypatch.setattr(sweep_module, "connected", connected)
    whole = sweep(draw, AXES, workers="auto")  # no time to save
    assert not started
    assert workers_module.pays(3600.0, 20.0) and not workers_module.pays(20.0, 20.0)
    monkeypatch.setattr(sweep_module, "pays", lambda *_: True)
    assert same(sweep(draw, AXES, workers="auto"), whole) and len(started) == 1


def test_a_rerun_solves_points_whose_worker_died_but_none_that_failed(monkeypatch, tmp_path):
    ends = ["", LOST, "failed: it is no number"]

    def solved(*_):
        for i, end in enumerate(ends):
            yield i, Point({} if end else {"value": np.array(7.0)}, end)

    monkeypatch.setattr(sweep_module, "_solved", solved)
    function, axes = lambda point: 1.0 * point["x"], {"x": np.arange(3.0)}
    assert sweep(function, axes, store=tmp_path).message.values.tolist() == ends
    monkeypatch.undo()
    again = sweep(function, axes, store=tmp_path)
    assert again.message.values.tolist() == ["", "", ends[2]]
    assert again["value"][:2].values.tolist() == [7.0, 1.0]


@pytest.mark.slow
def test_a_point_whose_worker_dies_every_time_is_lost_and_no_other(monkeypatch, tmp_path):
    pytest.importorskip("distributed")

    def deadly(packed, tasks):
        if any(point["x"] == 2 for point, _ in tasks):
            os.kill(os.getpid(), signal.SIGKILL)
        return [Point({"value": np.array(point["x"])}) for point, _ in tasks], 0.1

    function, axes = lambda point: 1.0 * point["x"], {"x": np.arange(10.0)}
    with monkeypatch.context() as patch:
        patch.setattr(workers_module, "_solve_there", deadly)
        study = sweep(function, axes, workers=2, store=tmp_path)
    assert study.message[2] == "failed: its worker died, each time that it was tried"
    assert np.sum(study.message == "") == 9 and study["value"][9] == 9
    again = sweep(function, axes, store=tmp_path)
    assert (again.message == "").all() and again["value"][2] == 2


@pytest.mark.slow
def test_workers_give_the_same_bits_and_one_may_die():
    pytest.importorskip("distributed")

    def slow(point):
        return jax.lax.fori_loop(0, 20_000_000, lambda i, x: x * 0.5 + 1, point["x"])

    axes, killed = {"x": np.arange(6.0)}, []
    with workers_module.connected(2, None) as client:

        def kill(done, count):
            if not killed:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        study = sweep(slow, axes, client=client, progress=kill)
    assert killed and same(study, sweep(slow, axes))
