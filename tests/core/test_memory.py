"""Memory is told before it is allocated: grids that do not fit are refused, others are not."""

import jax
import jax.numpy as jnp
import pytest
from scene_texts import BARE

import graded_contact as gc
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


def test_a_grid_of_the_named_size_fits(ten_gigabytes):
    with pytest.raises(ValueError, match="One of 4096 x 4096 would fit"):
        _memory.check_memory("grid", "sliding", _memory.SLIDING, (8192, 8192))
    _memory.check_memory("grid", "sliding", _memory.SLIDING, (4096, 4096))
