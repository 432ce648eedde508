"""Conversion and refusal at the public boundary."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.core.checks import (
    as_float,
    check_poisson,
    check_positive,
    check_tolerance,
    check_values,
    is_concrete,
)


@pytest.mark.parametrize("value", [2, 2.5, [1, 2], np.arange(3), np.float64(1.5)])
def test_as_float_gives_strong_default_floats(value):
    array = as_float(value)
    assert array.dtype == jnp.float64
    assert not array.weak_type
    np.testing.assert_array_equal(array, np.asarray(value, float))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float16, jnp.float64])
def test_as_float_keeps_floating_dtypes(dtype):
    array = as_float(jnp.ones(3, dtype))
    assert array.dtype == dtype
    assert not array.weak_type


def test_as_float_strengthens_weak_types_under_tracing():
    weak = jax.eval_shape(lambda: as_float(jnp.asarray(1.0) * 2.0))
    assert not weak.weak_type
    assert jax.grad(lambda x: as_float(x) ** 2)(3.0) == 6


@pytest.mark.parametrize("value", ["1.0", None, True, {}, [[1], [1, 2]]])
def test_as_float_refuses_what_is_not_a_number(value):
    with pytest.raises(ValueError, match=r"`value=.* is refused: a number or a"):
        as_float(value)


def test_is_concrete_tells_values_from_tracers():
    seen = []

    def record(x):
        seen.append(is_concrete(x))
        return x

    record(jnp.ones(2))
    jax.jit(record)(jnp.ones(2))
    jax.grad(record)(1.0)
    assert seen == [True, False, False]


def test_check_values_names_argument_entry_and_limit():
    with pytest.raises(ValueError, match=r"^`heat\[1, 0\]=-3` is refused: it must be warm\.$"):
        check_values("heat", np.array([[1.0, 2.0], [-3.0, -4.0]]), "it must be warm", above=0)
    with pytest.raises(ValueError, match=r"^`heat=2` is refused"):
        check_values("heat", 2.0, "at most one", at_most=1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, np.array([1.0, np.nan])])
def test_check_values_refuses_what_is_not_finite(value):
    with pytest.raises(ValueError, match="is refused"):
        check_values("x", value, "it must be finite")


def test_check_values_limits_are_open_or_closed_as_named():
    check_values("x", np.array([0.0, 1.0]), "", at_least=0, at_most=1)
    check_values("x", np.array([]), "", above=0)
    with pytest.raises(ValueError):
        check_values("x", 0.0, "", above=0)


def test_checks_of_values_pass_under_tracing():
    @jax.jit
    def function(x):
        check_positive("x", x, "[m]")
        check_poisson("x", x)
        return x

    assert function(-5.0) == -5


@pytest.mark.parametrize("value", [-1.0, 0.5 + 1e-15, np.nan])
def test_check_poisson_refuses_unstable_solids(value):
    with pytest.raises(ValueError, match=r"greater than -1 and at most 0\.5"):
        check_poisson("poisson", value)


def test_check_tolerance_refuses_what_single_precision_cannot_reach():
    like = jnp.ones(1, jnp.float32)
    check_tolerance("rtol", 1e-4, like)
    with pytest.raises(
        ValueError, match=r"`rtol=1e-06` cannot be reached in float32.*jax_enable_x64"
    ):
        check_tolerance("rtol", 1e-6, like)
    check_tolerance("rtol", 1e-6, like, floor_factor=1.0)


def test_check_tolerance_gives_double_precision_its_own_remedy():
    like = jnp.ones(1)
    check_tolerance("rtol", 1e-13, like)
    with pytest.raises(
        ValueError, match=r"in float64 \(the floor is 2e-14\)\. Pass a larger `rtol`"
    ):
        check_tolerance("rtol", 1e-15, like)


@pytest.mark.parametrize("value", [0.0, -1e-3, 1.0, np.nan])
def test_check_tolerance_refuses_what_is_no_tolerance(value):
    with pytest.raises(ValueError, match="`rtol"):
        check_tolerance("rtol", value, jnp.ones(1))


def test_an_object_is_named_by_its_class_and_a_call_by_the_arguments_it_lacks(unchecked_types):
    grid = gc.Grid((8, 8), 1e-3)
    surface, stack = (
        gc.Surface(np.zeros((8, 8)), grid),
        gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6))),
    )
    with pytest.raises(ValueError, match=r"^`stack=Surface\(\.\.\.\)` must be Stack\.$"):
        gc.slide(surface, stack, pressure=1e5, velocity=0.1)
    for given, named in (((1e5, 0.1), {}), ((), {"presure": 1e5}), ((), {"pressure": 1e5})):
        with pytest.raises(
            TypeError, match=r"^slide: .*in order `stack`.*by keyword `pressure`, `me"
        ):
            gc.slide(stack, surface, *given, **named)
