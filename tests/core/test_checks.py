"""Conversion and refusal at the public boundary."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.core.checks import as_float, check_positive, check_tolerance, check_values


@pytest.mark.parametrize("value", [2, [1, 2], np.arange(3), jnp.ones(3, jnp.float32)])
def test_as_float_gives_strong_floats_and_keeps_their_precision(value):
    array = as_float(value)
    assert array.dtype == (jnp.float32 if isinstance(value, jax.Array) else jnp.float64)
    assert not array.weak_type
    np.testing.assert_array_equal(array, np.asarray(value, float))
    assert as_float(jnp.ones(3, jnp.float16)).dtype == jnp.float16


@pytest.mark.parametrize(
    "value",
    [2**64, [1, 2**63], [1.5, 2**64], np.uint64(2**63), np.int64(2**40), np.array([1, -(2**40)])],
    ids=str,
)
def test_whole_numbers_keep_their_value_without_double_precision(value):
    """JAX itself keeps the last 32 bits of NumPy's: 2^40 would be 0."""
    with jax.enable_x64(False):
        array = as_float(value)
        assert array.dtype == jnp.float32
        np.testing.assert_allclose(array, np.asarray(value, float), rtol=1e-7)
        with pytest.raises(
            ValueError, match=r"^`x=1e\+39` is refused: it is too large for float32"
        ):
            as_float(1e39, "x")


def test_numbers_whose_squares_leave_their_dtype_are_refused():
    check_positive("x", np.array([1e-150, 1e150]), "m")
    for value, size in ((1e-160, "small"), (1e160, "large"), (1e300, "large")):
        with pytest.raises(ValueError, match=f"^`x` up to .* m is refused: .* too {size} for floa"):
            check_positive("x", value, "m")


def test_as_float_strengthens_weak_types_under_tracing():
    weak = jax.eval_shape(lambda: as_float(jnp.asarray(1.0) * 2.0))
    assert not weak.weak_type
    assert jax.grad(lambda x: as_float(x) ** 2)(3.0) == 6


@pytest.mark.parametrize(
    ("value", "limits", "message"),
    [
        ([[1.0, 2.0], [-3.0, -4.0]], dict(above=0), r"^`x\[1, 0\]=-3` is refused: as said\.$"),
        (2.0, dict(at_most=1), "^`x=2` is refused"),
        (0.0, dict(above=0), "^`x=0` is refused"),
        ([1.0, np.nan], {}, r"^`x\[1\]=nan` is refused"),
        (-np.inf, {}, "^`x=-inf` is refused"),
    ],
)
def test_check_values_names_argument_entry_and_limit(value, limits, message):
    check_values("x", np.array([0.0, 1.0]), "", at_least=0, at_most=1)
    check_values("x", np.array([]), "", above=0)
    with pytest.raises(ValueError, match=message):
        check_values("x", np.asarray(value), "as said", **limits)


def test_checks_of_values_pass_under_tracing():
    @jax.jit
    def function(x):
        check_positive("x", x, "[m]")
        return x

    assert function(-5.0) == -5


def test_check_tolerance_refuses_what_precision_cannot_reach_with_the_remedy():
    single, double = jnp.ones(1, jnp.float32), jnp.ones(1)
    check_tolerance("rtol", 1e-4, single)
    check_tolerance("rtol", 1e-6, single, floor_factor=1.0)
    check_tolerance("rtol", 1e-13, double)
    with pytest.raises(ValueError, match=r"`rtol=1e-06` cannot be .* float32.*jax_enable_x64"):
        check_tolerance("rtol", 1e-6, single)
    with pytest.raises(ValueError, match=r"float64 \(the floor is 2.2e-14\): pass a larger `rtol`"):
        check_tolerance("rtol", 1e-15, double)
    for value in (0.0, 1.0, np.nan):
        with pytest.raises(ValueError, match="`rtol"):
            check_tolerance("rtol", value, double)


def test_an_object_is_named_by_its_class_and_a_call_by_the_arguments_it_lacks(unchecked_types):
    grid = gc.Grid((8, 8), 1e-3)
    surface, stack = (
        gc.Surface(np.zeros((8, 8)), grid),
        gc.Stack(base=gc.HalfSpace(gc.Elastic(1e6))),
    )
    with pytest.raises(ValueError, match=r"^`stack=Surface\(\.\.\.\)` must be Stack\.$"):
        gc.slide(surface, stack, pressure=1e5, velocity=0.1)
    for given, named in (((1e5, 0.1), {}), ((), {"presure": 1e5}), ((), {"pressure": 1e5})):
        with pytest.raises(TypeError, match=r"^slide: .*it takes `stack`, .*, `pressure`, `me"):
            gc.slide(stack, surface, *given, **named)
    with pytest.raises(TypeError, match=r"`friction_rtol`; since 1.0.0 it is removed: `rtol` is"):
        gc.slide(stack, surface, pressure=1e5, velocity=0.1, friction_rtol=1e-3)
    with pytest.raises(TypeError, match=r"since 1.0.0 it is `weights`, a pair.*; it takes `x`"):
        gc.fit_prony(np.ones(3), np.ones(3), storage_weight=2.0)
    with pytest.raises(AttributeError, match=r"`contact_area_smooth`; since 1.0.0 it is `contact_"):
        object.__new__(gc.Sliding).contact_area_smooth  # noqa: B018
