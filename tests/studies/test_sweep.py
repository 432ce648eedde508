"""A function at many points: each point is solved once, stored at once, and has the same bits."""

import os
import runpy
import signal
import subprocess
import sys
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.contacts.solution import RESULTS
from graded_contact.studies import sweep

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


def times(folder):
    """When each file of a store was written."""
    return {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}


def test_every_result_lies_over_the_named_axes_with_units(tmp_path):
    study = sweep(draw, AXES)
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
    assert study.friction.units == "1" and study.seed_again.dtype.kind == "i"
    study.to_netcdf(tmp_path / "study.h5", engine="h5netcdf")
    assert sweep(lambda point: jnp.pi, {}).value == np.pi


def test_only_what_is_missing_is_solved(tmp_path):
    whole = sweep(draw, AXES)
    assert same(sweep(draw, AXES, store=tmp_path), whole)
    before = times(tmp_path)
    assert same(sweep(draw, AXES, store=tmp_path), whole) and times(tmp_path) == before
    more = sweep(draw, AXES | {"seed": [3, 4, 5]}, store=tmp_path)
    after = times(tmp_path)
    assert len(after) == 9 and before.items() <= after.items()
    assert more.friction[:, :2].values.tobytes() == whole.friction.values.tobytes()


def test_another_number_array_or_name_is_another_sweep(tmp_path):
    def scaled(table, name="y", inside=jax.jit):
        return lambda point: {name: jnp.sum(inside(lambda x: x * table)(point["x"]))}

    table, other = np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 4.0])
    outside = lambda function: function  # noqa: E731
    for count, (function, name, expected) in enumerate(
        [
            (scaled(table), "y", 6), (scaled(other), "y", 7), (scaled(other, "z"), "z", 7),
            (scaled(2.0), "y", 2), (scaled(jnp.asarray(other), inside=outside), "y", 7),
        ], start=1,
    ):  # fmt: skip
        study = sweep(function, {"x": [1.0]}, store=tmp_path)
        assert study[name] == expected and len(times(tmp_path)) == count


def test_a_damaged_file_is_solved_again(tmp_path):
    axes = {"x": [1.0]}
    whole = sweep(lambda point: {"y": jnp.sin(point["x"])}, axes, store=tmp_path)
    (file,) = tmp_path.iterdir()
    good, rng = file.read_bytes(), np.random.default_rng(0)
    for _ in range(40):
        bad = bytearray(good)
        bad[rng.integers(len(bad))] ^= 1 << rng.integers(8)
        file.write_bytes(bad)
        assert same(sweep(lambda point: {"y": jnp.sin(point["x"])}, axes, store=tmp_path), whole)
    file.write_bytes(good[:100])
    assert same(sweep(lambda point: {"y": jnp.sin(point["x"])}, axes, store=tmp_path), whole)
    assert file.read_bytes()[:100] == good[:100] and len(times(tmp_path)) == 1


def test_a_point_that_fails_has_its_reason_and_the_rest_goes_on(tmp_path, capfd):
    def picky(point):
        value = eqx.error_if(point["x"], point["x"] == 2, "two is refused")
        return {"value": value, "result": RESULTS.where(value > 3, stopped, RESULTS.successful)}

    stopped = RESULTS.max_steps_reached
    for _ in range(2):  # the second time from the store
        study = sweep(picky, {"x": [1.0, 2.0, 3.0, 4.0]}, store=tmp_path)
        assert study.message.values.tolist() == ["", "failed: two is refused", "", RESULTS[stopped]]
        np.testing.assert_array_equal(study.value, [1, np.nan, 3, 4])
    assert len(times(tmp_path)) == 4


def test_what_cannot_be_swept_is_refused():
    for axes in ({"x": []}, {"x": [[1.0]]}, {"x": [np.nan]}, {"x": ["a"]}):
        with pytest.raises(ValueError, match="axes"):
            sweep(draw, axes)
    with pytest.raises(ValueError, match="seed"):
        sweep(lambda point: point, AXES)
    with pytest.raises(ValueError, match="workers"):
        sweep(draw, AXES, workers=0)


SLOW = """
import sys, jax, numpy as np
from graded_contact.studies import sweep
jax.config.update("jax_enable_x64", True)
loop = lambda p: jax.lax.fori_loop(0, 2_000_000, lambda i, x: x * 0.999 + 1, p["x"])
if __name__ == "__main__":
    sweep(loop, {"x": np.arange(8.0)}, store=sys.argv[1])
"""


def test_a_sweep_goes_on_after_its_process_was_killed(tmp_path):
    """Ctrl-C is in the tests of the command."""
    script, store = tmp_path / "slow.py", tmp_path / "points"
    script.write_text(SLOW)
    command = [sys.executable, str(script), str(store)]
    child = subprocess.Popen(command, stderr=subprocess.PIPE)
    while child.poll() is None and not any(store.glob("*.npz")):
        time.sleep(0.01)
    child.kill()
    child.communicate(timeout=60)
    finished, loop = times(store), runpy.run_path(str(script))["loop"]
    found = sweep(loop, {"x": np.arange(8.0)}, store=store)
    assert finished.items() <= times(store).items() and len(times(store)) == 8
    whole = [0.999**2_000_000 * x + 1 / (1 - 0.999) for x in range(8)]
    np.testing.assert_allclose(found.value, whole, rtol=1e-9)


def test_workers_give_the_same_bits_and_one_may_die(tmp_path):
    distributed = pytest.importorskip("distributed")
    home, died = os.getpid(), tmp_path / "died"

    def slow(point):
        if os.getpid() != home and not died.exists():
            died.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return jax.lax.fori_loop(0, 500_000, lambda i, x: x * 0.5 + 1, point["x"])

    axes = {"x": np.arange(3.0)}
    here = sweep(slow, axes)
    assert same(sweep(slow, axes, workers=1), here) and died.exists()
    how = dict(processes=False, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    with distributed.Client(n_workers=1, **how) as client:  # a thread
        assert same(sweep(slow, axes, client=client), here)
