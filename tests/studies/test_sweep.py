"""A function at many points: each point is solved once, stored at once, and has the same bits."""

import os
import signal

import equinox as eqx
import jax
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.solve import RESULTS
from graded_contact.studies import workers as workers_module
from graded_contact.studies.dataset import read_dataset, write
from graded_contact.studies.sweep import sweep

# In the room, `sweep` is the function.
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


@pytest.fixture
def threads(monkeypatch):
    """A client of a scheduler and a worker that are threads of this process."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(workers_module, "PATIENCE", 0.2)
    options = {"processes": False, "dashboard_address": "127.0.0.1:0", "set_as_default": False}
    with distributed.Client(n_workers=1, threads_per_worker=2, **options) as client:
        yield client


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
