"""BulkShear against mpmath, its limits, and why ν(ω) should come from K and G."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from oracles import elasticities

from graded_contact import WLF, Elastic, Prony
from graded_contact.materials.material import BulkShear

OMEGA = np.concatenate([-np.geomspace(1e-6, 1e8, 40), [0.0], np.geomspace(1e-6, 1e8, 40)])


@jax.jit
def modulus(material, omega):
    return material.complex_modulus(omega)


@jax.jit
def moduli(material, omega):
    """Young's modulus and Poisson's ratio."""
    return material.complex_modulus(omega), material.poisson_ratio(omega)


def glassy():
    """K relaxes a little and slowly, G by three decades: ν from 0.4995 to 0.35."""
    bulk = Prony(2e9, [5e8, 1e9], [1.0, 1e-4])
    return BulkShear(bulk, Prony(2e6, [2e7, 3e8, 8e8], [1e2, 1e-1, 1e-5]))


def test_moduli_match_mpmath():
    material = glassy()
    young, poisson = moduli(material, OMEGA)
    bulk, shear = modulus(material.bulk, OMEGA), modulus(material.shear, OMEGA)
    with mp.workdps(40):
        for e, nu, k, g in zip(young, poisson, bulk, shear, strict=True):
            k, g = mp.mpmathify(complex(k)), mp.mpmathify(complex(g))
            exact = 9 * k * g / (3 * k + g)
            assert abs(mp.mpmathify(complex(e)) - exact) <= 1e-15 * abs(exact)
            exact = (3 * k - 2 * g) / (2 * (3 * k + g))
            assert abs(mp.mpmathify(complex(nu)) - exact) <= 2e-16


def test_young_modulus_is_passive_and_real_fields_stay_real():
    material = glassy()
    young, poisson = jax.device_get(moduli(material, OMEGA))
    assert np.all(young.imag * np.sign(OMEGA) >= 0)
    assert np.all(young.real > 0)
    for found, turned in zip((young, poisson), moduli(material, -OMEGA), strict=True):
        np.testing.assert_array_equal(found, np.conj(turned))


def test_elastic_parts_are_real_and_have_the_shape_of_omega():
    omega = np.ones((3, 2))
    for material, dtype in ((BulkShear(Elastic(2e9), Elastic(7e8)), float), (glassy(), complex)):
        for value in moduli(material, omega):
            assert value.shape == (3, 2) and value.dtype == dtype


def test_infinite_bulk_modulus_is_incompressible_and_a_vanishing_one_auxetic():
    shear = Prony(2e6, [2e7], [1e2])
    stiff = BulkShear(Elastic(1e30), shear)
    young, poisson = moduli(stiff, OMEGA)
    np.testing.assert_allclose(poisson, np.full(len(OMEGA), 0.5 + 0j), 1e-16)
    np.testing.assert_allclose(young, 3 * np.asarray(modulus(shear, OMEGA)), 1e-15)
    soft = BulkShear(Elastic(1e-6), shear)
    np.testing.assert_allclose(moduli(soft, OMEGA)[1], np.full(len(OMEGA), -1 + 0j), 1e-11)


def test_gradient_matches_central_differences():
    omega = jnp.array([1e-3, 0.4, 3e3])

    def value(material):
        young, poisson = material.complex_modulus(omega), material.poisson_ratio(omega)
        return jnp.sum(young.real / 1e6 + young.imag / 1e7 + poisson.real - 2 * poisson.imag)

    slopes, differences = np.transpose(elasticities(value, (glassy(),)))
    np.testing.assert_allclose(slopes, differences, rtol=1e-7, atol=1e-7)


def test_temperature_reaches_both_parts():
    shift = WLF(17.4, 51.6, 373.0)
    material = BulkShear(Elastic(2e9), Prony(2e6, [2e7], [1e2], shift=shift))
    warm = material.at(393.0)
    np.testing.assert_allclose(
        warm.shear.times, material.shear.times * shift.factor(jnp.array(393.0)), rtol=1e-15
    )
    assert warm.bulk.modulus == 2e9
    with pytest.raises(ValueError, match="shift"):
        BulkShear(Elastic(2e9), Prony(2e6, [2e7], [1e2])).at(393.0)
