"""Nonsense is refused at the door by the name of the argument, whatever kind of nonsense it is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc

SCALARS = {
    "modulus": lambda value: gc.Elastic(value),
    "poisson": lambda value: gc.Elastic(1e6, value),
    "equilibrium": lambda value: gc.Prony(value, [1e6], [1e-3]),
    "c1": lambda value: gc.WLF(value, 50.0, 300.0),
    "activation_energy": lambda value: gc.Arrhenius(value, 300.0),
    "temperature": lambda value: gc.Prony(1e6, [1e6], [1e-3], shift=gc.WLF(10.0, 50.0, 300.0)).at(
        value
    ),
    "thickness": lambda value: gc.Layer(gc.Elastic(1e6), value),
    "rate": lambda value: gc.Exponential(value),
    "hardness": lambda value: gc.HardWall(value),
    "work": lambda value: gc.AdhesiveLJ(1e-9, value),
}


@pytest.mark.parametrize("name", SCALARS)
def test_an_array_in_the_place_of_one_number_is_refused(name, unchecked_types):
    with pytest.raises(ValueError, match=rf"`{name}` has shape \(3,\).*jax.vmap"):
        SCALARS[name](np.array([0.3, 0.4, 0.45]))


def test_many_materials_are_built_under_vmap():
    materials = jax.vmap(lambda e: gc.Prony(e, [1e6], [1e-3], 0.3))(jnp.array([1e6, 2e6, 5e6]))
    moduli = jax.vmap(lambda material: material.modulus(0.0))(materials)
    np.testing.assert_allclose(moduli.real, [1e6, 2e6, 5e6])
