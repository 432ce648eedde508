"""One problem over several devices: four virtual ones in a process of their own, or processes."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from graded_contact import Grid

HERE = Path(__file__).parents[1]
ROW = 8 * 50  # bytes
SECONDS = 900  # for what hangs, never for what is slow
RTOL = 1e-9  # of the solves


def start(devices, *arguments):
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count={devices}"
    return subprocess.Popen(
        [sys.executable, str(HERE / "over_devices.py"), *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(HERE.parent), "XLA_FLAGS": flags},
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope="module")
def found():
    """What four devices and one found."""
    process = start(4)
    out, _ = process.communicate(timeout=SECONDS)
    assert process.returncode == 0
    return json.loads(out)


def test_four_devices_find_what_one_finds(found):
    """Sums are taken in another order, and so are transforms: steps differ by rounding."""
    distances = found["distances"]
    assert distances.pop("surface") < 1e-14 and distances.pop("by heights") < 10 * RTOL
    assert max(distances.values()) < RTOL
    assert found["fft pairs"][0] == found["fft pairs"][1]
    np.testing.assert_allclose(*found["numbers"], rtol=RTOL, atol=1e-14)


def test_each_device_holds_its_rows_and_a_share_of_the_memory(found):
    assert found["shards"] == [[[9, 50]] * 4] * 2
    many, one = found["temporaries"]
    assert many < 0.3 * one


def test_only_transforms_exchange_fields(found):
    """Nothing gathers or adds up fields; neighbours pass on less than they hold."""
    largest = found["exchanged"]
    assert largest["all-to-all"] < 36 * ROW and largest["collective-permute"] < 9 * ROW
    assert largest["all-gather"] < 2 * ROW and largest["all-reduce"] < 2 * ROW


def test_what_is_refused_is_named_wherever_it_lies(found):
    *grids, heights = found["refused"]
    assert "`heights[20, 3]=nan` is refused" in heights
    for message in grids:
        assert "refused on 4 `devices`" in message and "must divide the first" in message


@pytest.mark.parametrize("devices", ["cpu", [], [0], 3])
def test_what_are_no_devices_is_refused(unchecked_types, devices):
    with pytest.raises(ValueError, match=r"`devices=.*must be a list such as"):
        Grid((8, 8), 1.0, devices)


def test_two_processes_find_the_same(found):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    processes = [start(1, f"127.0.0.1:{port}", 2, rank) for rank in range(2)]
    told = [json.loads(p.communicate(timeout=SECONDS)[0].splitlines()[-1]) for p in processes]
    assert told[0] == told[1]
    np.testing.assert_allclose(told[0], (2, found["numbers"][1][0]), rtol=RTOL)
