import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.special import erf

import graded_contact as gc
from graded_contact.blocks.profile import Blend
from graded_contact.blocks.shapes import (
    ErrorFunction,
    Exponential,
    Linear,
    PowerLaw,
    Sinusoidal,
    Table,
)

S = np.linspace(0, 1, 21)
at = jax.jit(lambda shape, s: shape(s))


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
    np.testing.assert_allclose(at(shape, S), expected, rtol=1e-10, atol=1e-15)


def test_blends_are_linear_or_exponential():
    s, omega = jnp.asarray(S), jnp.zeros(())
    wavy = Blend(gc.Elastic(1e6), gc.Elastic(2e6), Sinusoidal())
    np.testing.assert_allclose(wavy(s, omega)[0], 1e6 * (1 + S + np.sin(2 * np.pi * S)), rtol=1e-14)
    profile = Blend(gc.Elastic(1e3, 0.2), gc.Elastic(1e9, 0.4), mixing="logarithmic")
    modulus, poisson = profile(s, omega)
    np.testing.assert_allclose(modulus, 1e3 * 10 ** (6 * S), rtol=1e-13)
    np.testing.assert_allclose(poisson, 0.2 + 0.2 * S, rtol=1e-14)
