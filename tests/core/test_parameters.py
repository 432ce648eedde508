"""Numbers are named by the arguments of constructors, and set through their checks."""

import collections

import jax
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.core.parameters import paths, with_values

RUBBER = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49)
COATED = gc.Stack(
    layers=(gc.Layer(gc.Prony(4e6, [9e6], [1e-3], 0.4), 1e-4),), base=gc.HalfSpace(RUBBER)
)


def test_paths_name_every_number():
    known = paths(COATED)
    assert known["layers[0].thickness"] == 1e-4
    assert known["base.material.times[1]"] == 1e-4
    assert known["base.material.strengths"].shape == (2,)


def test_fields_of_named_tuples_have_paths():
    pair = collections.namedtuple("Pair", "block number")
    tree = with_values(pair(COATED, jax.numpy.ones(3)), {"block.layers[0].thickness": 2e-4})
    assert tree.block.layers[0].thickness == 2e-4
    entries = ["number", "number[0]", "number[1]", "number[2]"]
    assert [path for path in paths(tree) if "block" not in path] == entries


def test_values_are_set_by_path():
    stack = with_values(COATED, {"layers[0].thickness": 2e-4, "base.material.times[1]": 3e-4})
    assert stack.layers[0].thickness == 2e-4
    np.testing.assert_array_equal(stack.base.material.times, [1e-2, 3e-4])
    np.testing.assert_array_equal(stack.base.material.strengths, RUBBER.strengths)
    assert with_values(COATED, {"base.material.times": [1.0, 2.0]}).base.material.times[1] == 2


def test_values_that_constructors_refuse_are_refused():
    bad = {"layers[0].thickness": -1e-4, "base.material.poisson": 0.9, "base.material.times[0]": 0}
    for path, value in bad.items():
        with pytest.raises(ValueError, match=r"is refused|positive"):
            with_values(COATED, {path: value})


def test_an_unknown_path_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match=r"did you mean `layers\[0\].thickness`"):
        with_values(COATED, {"layers[0].thicknes": 1e-4})
    with pytest.raises(ValueError, match=r"`base.material.times` has shape \(1,\)"):
        with_values(COATED, {"base.material.times": [1.0]})


def test_a_modulus_is_called_as_in_the_constructor():
    layer = gc.Layer(gc.Elastic(2e7), 1e-4)
    stack = gc.Stack(layers=(layer,), base=gc.HalfSpace(RUBBER))
    assert paths(stack)["layers[0].material.modulus"] == 2e7
    changed = with_values(stack, {"layers[0].material.modulus": 3e7})
    assert changed.layers[0].material.modulus == 3e7
    slope = jax.grad(lambda e: with_values(gc.Elastic(1e6), {"modulus": e}).complex_modulus(0.0))(
        2e6
    )
    assert slope == 1
    with pytest.raises(ValueError, match=r"did you mean `layers\[0\].material.modulus`"):
        with_values(stack, {"layers[0].material.moduli": 1e6})
