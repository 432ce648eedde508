"""Conversion and refusal at the public boundary."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.core.checks import as_float, check_tolerance


@pytest.mark.parametrize("value", [2, [1, 2], np.arange(3), jnp.ones(3, jnp.float32)])
def test_as_float_gives_strong_floats_and_keeps_their_precision(value):
    array = as_float(value)
    assert array.dtype == (jnp.float32 if isinstance(value, jax.Array) else jnp.float64)
    assert not array.weak_type
    np.testing.assert_array_equal(array, np.asarray(value, float))
    assert as_float(jnp.ones(3, jnp.float16)).dtype == jnp.float16
    with jax.enable_x64(False):  # without a warning
        single = as_float(np.asarray(value, float))
    assert single.dtype == jnp.float32


@pytest.mark.parametrize("value", [["a"], [[1, 2], [3]], np.ones(2, np.longdouble), None])
def test_what_jax_has_no_number_for_is_refused(value):
    with pytest.raises(ValueError, match=r"`length=.* is refused: a number or"):
        as_float(value, "length")


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
