"""One problem over several devices: the four virtual ones of the suite, or processes."""

import dataclasses
import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest
from over_devices import BLOCK, SPECTRUM, draw, mean_square

import graded_contact as gc
from graded_contact.core import anderson

HERE = Path(__file__).parents[1]
SHAPE = 36, 50  # half spectra and coarse grids fall into no equal parts
ROW = 8 * 50  # bytes
SECONDS = 900  # for what hangs, never for what is slow
RTOL = 1e-9  # of the solves
NUMBERS = ("friction", "contact_area", "energy_imbalance", "mean_gap")
STRETCH = 1 + 0.1 * np.random.default_rng(0).normal(size=SHAPE)
KEY = jax.random.key(0)


def friction_over(devices):
    """The friction of a block on a rough surface, stretched by factors, and what else is shown."""

    def friction(factors, key):
        surface = gc.random_surface(SPECTRUM, gc.Grid(SHAPE, 1e-2, devices), key)
        surface = dataclasses.replace(surface, heights=surface.heights * factors)
        solver = gc.contacts.DouglasRachford(coarsest=18, newton=False)
        found = gc.slide(BLOCK, surface, pressure=2e5, velocity=0.5, rtol=RTOL, solver=solver)
        return found.friction, {
            "surface": surface.heights,
            "pressure": found.pressure,
            "cumulative": gc.sliding.cumulative_friction(found).friction,
            "spectrum": gc.surfaces.radial_spectrum(surface)[1],
            "resampled": gc.surfaces.resample(surface, (24, 30)).heights,
            "numbers": found.compute(*NUMBERS),
            "fft pairs": found.num_fft_pairs,
        }

    return friction


@pytest.fixture(scope="module")
def programs():
    """Compiled: with derivatives over four devices, and without on one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(anderson, "SAMPLED_FROM", 0)  # rows are sampled, as on large grids
        over_four = jax.value_and_grad(friction_over(jax.devices()), has_aux=True)
        return [
            jax.jit(function).lower(STRETCH, KEY).compile()
            for function in (over_four, friction_over(None))
        ]


def test_four_devices_find_what_one_finds_and_its_derivatives(programs):
    """Sums are taken in another order, and so are transforms: steps differ by rounding."""
    one = programs[1]
    ((value, found), by_factors), (expected, fields) = (p(STRETCH, KEY) for p in programs)
    for name in ("surface", "pressure"):
        assert [s.data.shape for s in found[name].addressable_shards] == [(9, 50)] * 4
    assert found.pop("fft pairs") == fields.pop("fft pairs")
    np.testing.assert_allclose(value, expected, rtol=RTOL)
    np.testing.assert_allclose(found.pop("numbers"), fields.pop("numbers"), rtol=RTOL, atol=1e-14)
    for name, each in found.items():
        each, of_one = np.asarray(each), np.asarray(fields[name])
        bound = 1e-14 if name == "surface" else RTOL
        assert np.nanmax(np.abs(each - of_one)) < bound * np.nanmax(np.abs(of_one)), name
    step, change = 1e-4, np.random.default_rng(1).normal(size=SHAPE)
    ends = [float(one(STRETCH + small * change, KEY)[0]) for small in (step, -step)]
    slope = np.sum(by_factors * change)
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-5)


def test_each_device_has_a_share_of_the_memory_and_only_transforms_exchange_fields(programs):
    """Nothing gathers or adds up fields; neighbours pass on less than they hold."""
    with_derivatives, without = (p.memory_analysis().temp_size_in_bytes for p in programs)
    assert with_derivatives < 0.5 * without
    size = {"pred": 1, "s32": 4, "f32": 4, "c64": 8, "s64": 8, "u64": 8, "f64": 8, "c128": 16}
    kinds = "all-gather|all-to-all|all-reduce|collective-permute|reduce-scatter"
    largest = dict.fromkeys(kinds.split("|"), 0)
    for result, kind in re.findall(rf"= (.*?) ({kinds})(?:-start)?\(", programs[0].as_text()):
        arrays = re.findall(r"(\w+)\[([\d,]*)\]", result)
        total = sum(size[t] * int(np.prod([int(n) for n in s.split(",") if n])) for t, s in arrays)
        largest[kind] = max(largest[kind], total)
    assert 0 < largest["all-to-all"] < 36 * ROW and 0 < largest["collective-permute"] < 9 * ROW
    assert largest["all-gather"] < 2 * ROW and largest["all-reduce"] < 2 * ROW


def test_what_is_refused_is_named_wherever_it_lies():
    for shape in ((66, 64), (64,)):
        with pytest.raises(ValueError, match=r"refused on 4 `devices`.*must divide the first"):
            gc.Grid(shape, 1.0, jax.devices())
    heights = np.zeros((8, 4))
    heights[5, 1] = np.nan
    with pytest.raises(ValueError, match=r"`heights\[5, 1\]=nan` is refused"):
        gc.Surface(heights, gc.Grid((8, 4), 1.0, jax.devices()))


@pytest.mark.parametrize("devices", ["cpu", [], [0], 3])
def test_what_are_no_devices_is_refused(unchecked_types, devices):
    with pytest.raises(ValueError, match=r"`devices=.*must be a list such as"):
        gc.Grid((8, 8), 1.0, devices)


def test_two_processes_find_the_same():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    flags = os.environ["XLA_FLAGS"].replace("device_count=4", "device_count=1")
    processes = [
        subprocess.Popen(
            [sys.executable, str(HERE / "over_devices.py"), f"127.0.0.1:{port}", "2", str(rank)],
            env={**os.environ, "PYTHONPATH": str(HERE.parent), "XLA_FLAGS": flags},
            stdout=subprocess.PIPE,
            text=True,
        )
        for rank in range(2)
    ]
    told = [p.communicate(timeout=SECONDS)[0].splitlines()[-1] for p in processes]
    assert told[0] == told[1]
    expected = 2, mean_square(draw(None))
    np.testing.assert_allclose(list(map(float, told[0].split())), expected, rtol=RTOL)
