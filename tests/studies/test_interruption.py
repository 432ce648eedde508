"""Signals are noted and raised where it is safe; a second one ends the process at once."""

import os
import signal
import subprocess
import sys
import time

import jax
import numpy as np
import pytest
from waiting import SECONDS, until

import graded_contact as gc
from graded_contact.studies.interruption import ctrl_c_later, interruptible

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")


def send(interruption, number):
    os.kill(os.getpid(), number)
    until(lambda: interruption.signal is not None)


@pytest.mark.parametrize("number, code", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_raised_where_the_command_asks_and_not_before(number, code, capfd):
    before = signal.getsignal(number), signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(before[1])
    with interruptible() as interruption:
        interruption.check()
        send(interruption, number)
        assert interruption.signal == number and interruption.exit_code == code
        with pytest.raises(KeyboardInterrupt):
            interruption.check()
    assert "Ctrl-C again stops at once" in capfd.readouterr().err
    after = signal.getsignal(number), signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(after[1])
    assert after == before


def test_a_signal_that_the_process_ignores_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruptible() as interruption:
            os.kill(os.getpid(), signal.SIGINT)
            send(interruption, signal.SIGTERM)
            assert interruption.signal == signal.SIGTERM
            assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_second_signal_ends_a_process_whose_main_thread_hears_nothing():
    """Matrix products over hours, in one call, stand for a long solve."""
    program = """
import sys, jax, jax.numpy as jnp
from graded_contact.studies.interruption import interruptible
def say(x):
    print("solving", flush=True)
    return x
@jax.jit
def solve(x):
    y = jax.pure_callback(say, x, x)
    return jax.lax.fori_loop(0, 10**8, lambda i, y: (x @ y) / 300, y)
with interruptible():
    solve(jnp.ones((300, 300))).block_until_ready()
"""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "solving\n"
        process.send_signal(signal.SIGINT)
        assert any("Stopping after this step" in line for line in process.stderr)
        assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.wait(SECONDS) == 130
        assert "Stopped at once" in process.stderr.read()


def test_ctrl_c_is_noted_for_later_and_the_second_one_is_raised_at_once(capfd):
    done = []
    with ctrl_c_later() as later:
        later.check()
        os.kill(os.getpid(), signal.SIGINT)
        done.append("first")
        with pytest.raises(KeyboardInterrupt):
            later.check()
    with pytest.raises(KeyboardInterrupt), ctrl_c_later():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        done.append("second")
    assert done == ["first"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert capfd.readouterr().err.count("Stopping after this step") == 2


def test_ctrl_c_inside_compiled_code_of_a_sweep_keeps_its_point():
    """The compiled code calls Python, where a `KeyboardInterrupt` would be raised inside XLA."""

    def interrupted(x):
        if x == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return x

    def function(point):
        like = jax.ShapeDtypeStruct((), point["x"].dtype)
        return jax.pure_callback(interrupted, like, point["x"])

    found = gc.sweep(function, {"x": [1.0, 2.0, 3.0]})
    np.testing.assert_array_equal(found["value"], [1.0, 2.0, np.nan])
    assert list(found["message"].values) == ["", "", "not started"]


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.5, 1.0, 1.5, 2.0, 2.5])
def test_ctrl_c_while_a_sweep_compiles_ends_without_a_crash(seconds):
    program = """
import jax, jax.numpy as jnp, numpy as np, graded_contact as gc
spectrum = gc.SelfAffine(rms_slope=0.3, hurst=0.8, q_low=1.1e3, q_roll=4e3, q_high=1.5e4)
road = gc.random_surface(spectrum, gc.Grid((32, 32), 6e-3), jax.random.key(0))
block = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [1e7], [1e-3])))
print("ready", flush=True)
friction = lambda p: gc.slide(block, road, pressure=1e5, velocity=p["velocity"]).friction
found = gc.sweep(friction, {"velocity": np.geomspace(1e-3, 1, 2000)})
print((found["message"] == "not started").sum().item(), flush=True)
"""
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.readline()
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=SECONDS)
    # While the program is traced, Ctrl-C ends the script.
    assert process.returncode == (0 if out else -signal.SIGINT), error
    if out:
        assert 0 <= int(out) <= 2000
