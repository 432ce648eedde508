"""The built-in tread against the table it was written from and the properties it states."""

import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.materials.library import tyre_tread


def test_tread_has_the_properties_its_documentation_states():
    tread = tyre_tread()
    frequency = np.concatenate([[0.16, 1.6e3, 16e6], np.logspace(-1, 11, 2401)])
    modulus = np.asarray(tread.complex_modulus(2 * np.pi * jnp.asarray(frequency)))
    np.testing.assert_allclose(modulus.real[:3], [8.5e6, 15.5e6, 94e6], rtol=0.02)
    tangent = modulus.imag / modulus.real
    audible = tangent[frequency <= 1e3]
    np.testing.assert_allclose([audible.min(), audible.max()], [0.08, 0.14], atol=0.005)
    assert tangent.max() == pytest.approx(0.87, abs=0.005)
    assert frequency[tangent.argmax()] == pytest.approx(95e6, rel=0.03)


def test_tread_is_given_at_twenty_degrees_and_slows_in_the_cold():
    tread = tyre_tread()
    np.testing.assert_allclose(tread.at(293.15).times, tread.times, rtol=1e-13)
    warm, zero, cold = (tread.at(t).times[0] for t in (298.15, 273.15, 253.15))
    assert np.log10(zero / warm) == pytest.approx(1.29, abs=0.005)
    assert np.log10(cold / warm) == pytest.approx(3.0, abs=0.01)
