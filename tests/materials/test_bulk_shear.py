"""BulkShear against mpmath, its limits, and why ν(ω) should come from K and G."""

import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from oracles import elasticities

from graded_contact import WLF, Elastic, Prony
from graded_contact.materials.material import BulkShear

OMEGA = np.concatenate([-np.geomspace(1e-6, 1e8, 40), [0.0], np.geomspace(1e-6, 1e8, 40)])


def glassy():
    """K relaxes a little and slowly, G by three decades: ν from 0.4995 to 0.35."""
    bulk = Prony(2e9, [5e8, 1e9], [1.0, 1e-4])
    return BulkShear(bulk, Prony(2e6, [2e7, 3e8, 8e8], [1e2, 1e-1, 1e-5]))


def test_moduli_match_mpmath():
    material = glassy()
    young, poisson = material.complex_modulus(OMEGA), material.poisson_ratio(OMEGA)
    bulk, shear = material.bulk.complex_modulus(OMEGA), material.shear.complex_modulus(OMEGA)
    with mp.workdps(40):
        for e, nu, k, g in zip(young, poisson, bulk, shear, strict=True):
            k, g = mp.mpmathify(complex(k)), mp.mpmathify(complex(g))
            exact = 9 * k * g / (3 * k + g)
            assert abs(mp.mpmathify(complex(e)) - exact) <= 1e-15 * abs(exact)
            exact = (3 * k - 2 * g) / (2 * (3 * k + g))
            assert abs(mp.mpmathify(complex(nu)) - exact) <= 2e-16


def test_young_modulus_is_passive_and_real_fields_stay_real():
    material = glassy()
    young, poisson = material.complex_modulus(OMEGA), material.poisson_ratio(OMEGA)
    assert np.all(young.imag * np.sign(OMEGA) >= 0)
    assert np.all(young.real > 0)
    np.testing.assert_array_equal(young[:40], np.conj(material.complex_modulus(-OMEGA[:40])))
    np.testing.assert_array_equal(poisson[:40], np.conj(material.poisson_ratio(-OMEGA[:40])))


def test_elastic_parts_are_real_and_have_the_shape_of_omega():
    omega = np.ones((3, 2))
    for material, dtype in ((BulkShear(Elastic(2e9), Elastic(7e8)), float), (glassy(), complex)):
        for value in (material.complex_modulus(omega), material.poisson_ratio(omega)):
            assert value.shape == (3, 2) and value.dtype == dtype


def test_infinite_bulk_modulus_is_incompressible_and_a_vanishing_one_auxetic():
    shear = Prony(2e6, [2e7], [1e2])
    stiff = BulkShear(Elastic(1e30), shear)
    np.testing.assert_allclose(stiff.poisson_ratio(OMEGA), np.full(len(OMEGA), 0.5 + 0j), 1e-16)
    np.testing.assert_allclose(
        stiff.complex_modulus(OMEGA), 3 * shear.complex_modulus(OMEGA), 1e-15
    )
    soft = BulkShear(Elastic(1e-6), shear)
    np.testing.assert_allclose(soft.poisson_ratio(OMEGA), np.full(len(OMEGA), -1 + 0j), 1e-11)


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
