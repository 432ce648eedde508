"""A case holds what decides the numbers of a contact, and numerics how they are computed."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.mean_field.mean_field import mean_field_of

GRID = gc.Grid((32,), 1e-3)
X = np.arange(32) / 32
SURFACE = gc.Surface(jnp.asarray(1e-6 * np.cos(2 * np.pi * X) * (1 + np.cos(6 * np.pi * X))), GRID)
BLOCK = gc.Stack(base=gc.HalfSpace(gc.Prony(1e6, [9e6], [1e-3], 0.49)))
CASE = gc.Case(BLOCK, SURFACE, pressure=1e4, velocity=0.1)


def test_a_case_gives_the_numbers_of_slide_and_another_load_those_of_another_call():
    numerics = gc.sliding.Numerics(rtol=1e-8)
    for pressure in (1e4, 3e4):
        case = dataclasses.replace(CASE, pressure=pressure)
        alone = gc.slide(BLOCK, SURFACE, pressure=pressure, velocity=0.1, rtol=1e-8)
        assert case.solve(numerics).friction == alone.friction
    field = gc.mean_field_friction(BLOCK, SURFACE, pressure=1e4, velocity=0.1)
    assert mean_field_of(CASE).friction == field.friction


def test_a_case_with_a_displacement_is_a_cycle():
    motion = gc.sliding.sinusoidal(1e-4, 20.0, 8)
    given = {"displacement": motion.displacement, "period": motion.period, "pressure": 1e4}
    found = gc.Case(BLOCK, SURFACE, **given).solve()
    alone = gc.sliding.slide_cycle(BLOCK, SURFACE, **given)
    assert isinstance(found, gc.sliding.CyclicSliding)
    assert found.mean_friction == alone.mean_friction
    with pytest.raises(ValueError, match="`velocity` or `displacement` with `period` is needed"):
        gc.Case(BLOCK, SURFACE, velocity=0.1, **given)


def test_cases_are_differentiable_under_jit():
    def friction(load):
        return (
            dataclasses.replace(CASE, pressure=load).solve(gc.sliding.Numerics(rtol=1e-10)).friction
        )

    step = 1e-3
    difference = (friction(1e4 + step) - friction(1e4 - step)) / (2 * step)
    np.testing.assert_allclose(jax.jit(jax.grad(friction))(1e4), difference, rtol=1e-4)


def test_numerics_are_refused_by_name(unchecked_types):
    with pytest.raises(TypeError, match="slide has no argument `rtoll`; its numerics are `rtol`"):
        gc.slide(BLOCK, SURFACE, pressure=1e4, velocity=0.1, rtoll=1e-6)
    with pytest.raises(ValueError, match="`solver="):
        gc.sliding.Numerics(solver="newton")
