import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.special import erf

import graded_contact as gc
from graded_contact.blocks.profile import Aged, Blend, Mixture
from graded_contact.blocks.shapes import (
    ErrorFunction,
    Exponential,
    Linear,
    PowerLaw,
    Sinusoidal,
    Table,
)

S = np.linspace(0, 1, 21)
STEEL, RUBBER = gc.Elastic(2e11, 0.3), gc.Prony(1e6, [1e8], [1e-3], 0.5)


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (Linear(), S),
        (Sinusoidal(), S + np.sin(2 * np.pi * S)),
        (Exponential(3.0), np.expm1(3 * S) / np.expm1(3)),
        (Exponential(0.0), S),
        (Exponential(5e-4), np.expm1(5e-4 * S) / np.expm1(5e-4)),
        (PowerLaw(2.5), S**2.5),
        (ErrorFunction(0.3, 0.2), (1 + erf((S - 0.3) / 0.2)) / 2),
        (Table([0, 0.2, 0.7, 1], [1, 0.4, 0.5, 0]), None),
    ],
)
def test_shapes_are_their_formulas(shape, expected):
    if expected is None:
        expected = PchipInterpolator([0, 0.2, 0.7, 1], [1, 0.4, 0.5, 0])(S)
    np.testing.assert_allclose(shape(jnp.asarray(S)), expected, rtol=1e-10, atol=1e-15)


def test_blends_are_linear_or_exponential():
    s, omega = jnp.asarray(S), jnp.zeros(())
    wavy = Blend(gc.Elastic(1e6), gc.Elastic(2e6), Sinusoidal())
    np.testing.assert_allclose(wavy(s, omega)[0], 1e6 * (1 + S + np.sin(2 * np.pi * S)), rtol=1e-14)
    profile = Blend(gc.Elastic(1e3, 0.2), gc.Elastic(1e9, 0.4), mixing="logarithmic")
    modulus, poisson = profile(s, omega)
    np.testing.assert_allclose(modulus, 1e3 * 10 ** (6 * S), rtol=1e-13)
    np.testing.assert_allclose(poisson, 0.2 + 0.2 * S, rtol=1e-14)


def test_mixture_matches_bulk_and_shear_formulas_and_its_ends():
    matrix, filler = gc.Elastic(3e6, 0.4), gc.Elastic(7e10, 0.22)
    bulk = [m.young / (3 * (1 - 2 * m.poisson)) for m in (matrix, filler)]
    shear = [m.young / (2 * (1 + m.poisson)) for m in (matrix, filler)]
    phi = S
    # The usual form, Hashin and Shtrikman (1963) as in any textbook.
    k = bulk[0] + phi / (1 / (bulk[1] - bulk[0]) + 3 * (1 - phi) / (3 * bulk[0] + 4 * shear[0]))
    beta = 6 * (bulk[0] + 2 * shear[0]) / (5 * shear[0] * (3 * bulk[0] + 4 * shear[0]))
    g = shear[0] + phi / (1 / (shear[1] - shear[0]) + (1 - phi) * beta)
    modulus, poisson = Mixture(matrix, filler, Linear())(jnp.asarray(S), jnp.zeros(()))
    np.testing.assert_allclose(modulus, 9 * k * g / (3 * k + g), rtol=1e-10)
    np.testing.assert_allclose(poisson, (3 * k - 2 * g) / (2 * (3 * k + g)), rtol=1e-10)


def test_dilute_rigid_spheres_in_incompressible_rubber_follow_einstein():
    """E = E_m (1 + 5φ/2), A. Einstein, Ann. Phys. 19 (1906) 289, for solids by J. E. Smallwood."""
    profile = Mixture(RUBBER, gc.Elastic(1e16, 0.2), Linear())
    phi, omega = jnp.asarray(1e-5), jnp.asarray(300.0)
    modulus, poisson = profile(phi, omega)
    np.testing.assert_allclose(modulus / RUBBER.modulus(omega) - 1, 2.5e-5, rtol=1e-4)
    np.testing.assert_allclose(poisson, 0.5, atol=1e-7)


def test_aged_material_is_the_material_at_another_frequency():
    profile = Aged(RUBBER, 1.0, 100.0)
    modulus, _ = profile(jnp.asarray([0.0, 0.5, 1.0]), jnp.asarray(50.0))
    np.testing.assert_allclose(modulus, RUBBER.modulus(np.array([50.0, 500.0, 5000.0])), rtol=1e-13)
