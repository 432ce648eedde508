"""Objectives against the quantities that they are made of; parameters by path."""

import jax.numpy as jnp
import numpy as np
import pytest
from oracles import elasticities

import graded_contact as gc
from graded_contact.core.parameters import paths, with_values
from graded_contact.design import distance, loss_tangent, ripple

RUBBER = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49)
COATED = gc.Stack(
    layers=(gc.Layer(gc.Prony(4e6, [9e6], [1e-3], 0.4), 1e-4),), base=gc.HalfSpace(RUBBER)
)


def test_loss_tangent_of_a_half_space_is_that_of_its_rubber():
    q = np.geomspace(1e2, 1e6, 5)
    found = loss_tangent(gc.Stack(base=gc.HalfSpace(RUBBER)), q, 0.1)
    modulus = RUBBER.complex_modulus(q * 0.1)
    np.testing.assert_allclose(found, modulus.imag / modulus.real, rtol=1e-13)


def test_ripple_and_distance_are_of_logarithms():
    np.testing.assert_allclose(ripple([1.0, np.e]), 0.25, rtol=1e-14)
    assert ripple([3.0, 3.0, 3.0]) < 1e-30
    np.testing.assert_allclose(distance([2.0, 1.0], [1.0, 1.0]), np.log(2) ** 2 / 2, rtol=1e-14)
    np.testing.assert_allclose(distance(np.array([1j]), 1.0), (np.pi / 2) ** 2, rtol=1e-14)
    with pytest.raises(ValueError, match="values"):
        ripple([1.0, -1.0])


def test_gradients_match_central_differences():
    names = ["layers[0].thickness", "layers[0].material.times[0]", "base.material.equilibrium"]
    at = {name: paths(COATED)[name] for name in names}

    def value(values):
        stack = with_values(COATED, values)
        rippled = ripple(loss_tangent(stack, jnp.geomspace(1e3, 1e5, 9), 1.0))
        return rippled + distance(gc.effective_modulus(stack, jnp.array([1e4, 1e5]), 30.0), 1e7)

    slopes = np.transpose(elasticities(value, (at,), 1e-4))
    np.testing.assert_allclose(*slopes, rtol=1e-5, atol=1e-7)
