"""Memory is told before it is allocated: grids that do not fit are refused, others are not."""

import re
import types

import jax
import jax.numpy as jnp
import pytest
from scene_texts import BARE
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import terminal as session
from graded_contact.core import memory as _memory

BLOCK = gc.Stack(layers=(), base=gc.HalfSpace(gc.Elastic(1e6)))
SPECTRUM = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=1e3, q_roll=2e3, q_high=8e3)
SCENE = BARE.replace("[0.01, 1.0]", "0.1")


@pytest.fixture
def ten_gigabytes(monkeypatch):
    monkeypatch.setattr(_memory, "available_memory", lambda: 1e10)


def test_a_grid_that_does_not_fit_is_refused_at_once_with_one_that_would(ten_gigabytes):
    for shape in (2**31, (32768, 32768)):
        grid = gc.Grid(shape, 1e-2)
        for call in (
            lambda grid=grid: gc.random_surface(SPECTRUM, grid, jax.random.key(0)),
            lambda grid=grid: gc.stack_kernel(BLOCK, grid, 0.1),
        ):
            with pytest.raises(ValueError, match=r"`grid` is refused.*GB of memory, and .* free"):
                call()
    small = gc.Surface(jnp.zeros((8, 8)), gc.Grid((8, 8), 1e-2))
    with pytest.raises(ValueError, match=r"`shape` is refused: a surface of 65536 x 65536"):
        gc.surfaces.resample(small, (65536, 65536))


def test_shapes_are_known_under_jit(ten_gigabytes):
    """Nothing of this size is allocated: only shapes are traced."""
    heights = jax.ShapeDtypeStruct((16384, 16384), jnp.float64)
    kernel = jax.ShapeDtypeStruct((16384, 8193), jnp.float64)
    with pytest.raises(ValueError, match=r"`heights` is refused: a contact .* 4096 x 4096 would"):
        jax.eval_shape(lambda k, h: gc.solve_contact(k, h, 1e5), kernel, heights)

    def friction(h):
        surface = gc.Surface(h, gc.Grid(h.shape, 1e-2))
        return gc.slide(BLOCK, surface, pressure=1e5, velocity=0.1).friction

    with pytest.raises(ValueError, match=r"`surface` is refused: sliding of 16384 x 16384"):
        jax.eval_shape(friction, heights)


def test_a_grid_of_the_named_size_fits(ten_gigabytes):
    with pytest.raises(ValueError, match="One of 4096 x 4096 would fit"):
        _memory.check_memory("grid", "sliding", _memory.SLIDING, (8192, 8192))
    _memory.check_memory("grid", "sliding", _memory.SLIDING, (4096, 4096))


def test_devices_with_memory_of_their_own_hold_a_grid_together(ten_gigabytes, monkeypatch):
    def check(devices):
        _memory.check_memory("grid", "a", 20, (8192, 8192), devices=devices)

    with pytest.raises(ValueError, match="a of 8192 x 8192 points takes about 12 GB"):
        check(4)  # of one CPU
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    check(4)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("[32, 32]", "[32768, 32768]", r"this scene of 32768 x 32768.*One of 4096 x 4096 would"),
        ("velocity = 0.1", "velocity = {from = 0.1, to = 1, points = 10000000}", "80 GB of memory"),
        ("pressure = 2e5", "pressure = {from = 1, to = 2, points = 1000000000000}", "`points` is"),
    ],
)
def test_a_scene_that_does_not_fit_is_refused(
    tmp_path, monkeypatch, ten_gigabytes, old, new, message
):
    monkeypatch.setattr(session, "cache_folder", lambda: None)
    (tmp_path / "s.toml").write_text(SCENE.replace(old, new))
    arguments = ["run", str(tmp_path / "s.toml"), "-o", str(tmp_path / "out")]
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code == 2 and "is refused" in result.stderr
    assert re.search(message, result.stderr)


def test_free_memory_is_the_least_of_machine_and_group(monkeypatch):
    files = {
        "/proc/meminfo": ["MemTotal: 99 kB", "MemAvailable:       1000 kB"],
        "/proc/self/cgroup": ["0::/a/b"],
        "/sys/fs/cgroup/a/b/memory.max": ["max"],
        "/sys/fs/cgroup/a/b/memory.current": ["7"],
        "/sys/fs/cgroup/a/memory.max": ["900000"],
        "/sys/fs/cgroup/a/memory.current": ["500000"],
        "/sys/fs/cgroup/a/memory.stat": ["anon 4", "inactive_file 100000"],
    }
    monkeypatch.setattr(_memory, "_lines", lambda path: files.get(str(path), []))
    assert _memory._of_machine() == [1024000]
    assert _memory._of_groups() == [500000]


def test_a_process_that_keeps_freed_memory_needs_more(ten_gigabytes, monkeypatch):
    """Where the C library is glibc; the calls themselves are recorded, not made."""
    called = {}
    library = types.SimpleNamespace(mallopt=called.__setitem__)
    monkeypatch.setattr(_memory.ctypes, "CDLL", lambda _: library)
    monkeypatch.setattr(_memory, "_process", {"keeps": False})
    monkeypatch.setattr(_memory.platform, "libc_ver", lambda: ("", ""))
    assert not gc.core.keep_freed_memory() and not called
    before = _memory.memory_of(_memory.CONTACT, (4096, 4096))
    monkeypatch.setattr(_memory.platform, "libc_ver", lambda: ("glibc", "2.36"))
    assert gc.core.keep_freed_memory()
    assert called == {-1: 2**30, -3: 2**29 - 1, -8: 1}  # malloc.h: trim, mmap, arenas
    after = _memory.memory_of(_memory.CONTACT, (4096, 4096))
    largest = _memory.memory_of(_memory.CONTACT, (8192, 8192))  # such fields are not kept
    assert largest == _memory.COMPILER + _memory.CONTACT * 8 * 8192**2
    assert after - _memory.COMPILER == pytest.approx(_memory.KEPT * (before - _memory.COMPILER))
