"""Signals are noted and raised where it is safe; a second one ends the process at once."""

import os
import signal
import subprocess
import sys
import time

import pytest

from graded_contact.studies.interruption import Interrupted, interruptible

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")


def send(interruption, number):
    os.kill(os.getpid(), number)
    deadline = time.monotonic() + 20
    while interruption.signal is None and time.monotonic() < deadline:
        time.sleep(0.01)


@pytest.mark.parametrize("number, code", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_raised_where_the_command_asks_and_not_before(number, code, capfd):
    before = signal.getsignal(number), signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(before[1])
    with interruptible() as interruption:
        interruption.check()
        send(interruption, number)
        assert interruption.signal == number and interruption.exit_code == code
        with pytest.raises(Interrupted):
            interruption.check()
    assert "Once more stops at once" in capfd.readouterr().err
    after = signal.getsignal(number), signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(after[1])
    assert after == before


def test_a_signal_that_the_process_ignores_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruptible() as interruption:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.1)
            assert interruption.signal is None
            assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_second_signal_ends_a_process_whose_main_thread_hears_nothing():
    """One call of a matrix product over minutes stands for a long solve."""
    program = """
import sys, jax, jax.numpy as jnp
from graded_contact.studies.interruption import interruptible
with interruptible():
    print("ready", flush=True)
    x = jnp.ones((300, 300))
    jax.lax.fori_loop(0, 10**7, lambda i, y: (x @ y) / 300, x).block_until_ready()
"""
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=30) == 130
        assert "Stopped at once" in process.stderr.read()
