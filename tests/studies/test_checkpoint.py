"""A long solve goes on after its process was killed."""

import signal
import subprocess
import sys

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.studies.checkpoint import checkpointed
from graded_contact.studies.store import Store

PROBLEM = """
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
import graded_contact as gc
q0 = 2 * np.pi / 8e-3
spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=q0, q_roll=2 * q0, q_high=12 * q0)
road = gc.random_surface(spectrum, gc.Grid((48, 48), 8e-3), jax.random.key(0))
block = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [2e6, 1e7], [1e-2, 1e-4], 0.49)))
given = {"pressure": 2e5, "velocity": 0.1, "rtol": 1e-8}
"""
KILLED = """
import os, signal, sys
from graded_contact.studies.checkpoint import checkpointed
from graded_contact.studies.store import Store
write, written = Store.write, []
def write_twice(store, name, point):
    write(store, name, point)
    written.append(name)
    if len(written) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
Store.write = write_twice
checkpointed(sys.argv[1], gc.slide, block, road, every=0.0, **given)
"""


@pytest.fixture(scope="module")
def problem():
    names: dict = {}
    exec(PROBLEM, names)
    return names["block"], names["road"], names["given"]


@pytest.fixture(scope="module")
def undisturbed(problem):
    block, road, given = problem
    return gc.slide(block, road, **given)


def is_same(found, expected):
    change = np.sqrt(np.mean((found.pressure - expected.pressure) ** 2))
    return change < 1e-8 * np.sqrt(np.mean(expected.pressure**2))


def test_a_killed_solve_goes_on(tmp_path, problem, undisturbed):
    killed = subprocess.run([sys.executable, "-c", PROBLEM + KILLED, str(tmp_path)])
    assert killed.returncode == -signal.SIGKILL
    block, road, given = problem
    found = checkpointed(tmp_path, gc.slide, block, road, **given)
    assert is_same(found, undisturbed)
    # 20 steps, of a pair each, were done when the pressure was written for the second time.
    assert found.num_fft_pairs + 20 <= undisturbed.num_fft_pairs + 6
    assert found.contact.num_steps < undisturbed.contact.num_steps - 10


def test_what_cannot_be_stored_or_read_costs_no_solve(tmp_path, problem, undisturbed, monkeypatch):
    block, road, given = problem
    full = OSError(28, "No space left on device")

    def refuse(store, name, point):
        raise full

    with monkeypatch.context() as patch, pytest.warns(UserWarning, match="The solve continues"):
        patch.setattr(Store, "write", refuse)
        found = checkpointed(tmp_path, gc.slide, block, road, every=0.0, **given)
    assert is_same(found, undisturbed) and found.num_fft_pairs == undisturbed.num_fft_pairs
    assert not list(tmp_path.glob("*.point"))
    checkpointed(tmp_path, gc.slide, block, road, every=0.0, **given)
    (kept,) = tmp_path.glob("*.point")
    damaged = bytearray(kept.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    kept.write_bytes(damaged)
    with pytest.warns(UserWarning, match="is damaged: the solve starts again"):
        found = checkpointed(tmp_path, gc.slide, block, road, every=0.0, **given)
    assert is_same(found, undisturbed) and found.num_fft_pairs == undisturbed.num_fft_pairs


def test_the_pressure_of_another_problem_is_not_taken(tmp_path, problem):
    block, road, given = problem
    begun = []

    def solve(*inputs, start, solver, **given):
        begun.append(start)
        solver.callback(np.ones(road.grid.shape))

    for load in (2e5, 2e5, 3e5, 3e5):
        checkpointed(tmp_path, solve, block, road, every=0.0, **{**given, "pressure": load})
    assert [start is None for start in begun] == [True, False, True, False]
    assert len(list(tmp_path.glob("*.point"))) == 2
    with pytest.raises(ValueError, match=r"`solver=.*has no checkpoints"):
        checkpointed(
            tmp_path, gc.slide, block, road, solver=gc.contacts.ResidualDynamics(), **given
        )
    with Store(tmp_path), pytest.raises(BlockingIOError, match="another process"):
        checkpointed(tmp_path, solve, block, road, **given)


def test_a_contact_alone_goes_on_from_the_stored_pressure(tmp_path, problem):
    block, road, _ = problem
    kernel = gc.stack_kernel(block, road.grid, 0.1)
    given = {"pressure": 2e5, "rtol": 1e-8}
    whole = gc.solve_contact(kernel, road.heights, **given)
    first = checkpointed(tmp_path, gc.solve_contact, kernel, road.heights, every=0.0, **given)
    assert is_same(first, whole) and first.num_fft_pairs == whole.num_fft_pairs
    again = checkpointed(tmp_path, gc.solve_contact, kernel, road.heights, **given)
    assert is_same(again, whole) and again.num_fft_pairs < whole.num_fft_pairs - 10
