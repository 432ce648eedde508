import equinox as eqx
import jax
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
from graded_contact.blocks.stack import GradedLayer, Stack

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


def test_nearly_incompressible_materials_mix_logarithmically_whatever_the_shape():
    """Where φ leaves [0, 1] an extrapolated Poisson's ratio would exceed 1/2."""
    s = jnp.linspace(0, 1, 201)
    profile = Blend(gc.Elastic(1e6, 0.5), gc.Elastic(3e6, 0.49), Sinusoidal(), "logarithmic")
    phi = profile.shape(s)
    assert np.min(phi) < -0.2 and np.max(phi) > 1.2
    modulus, poisson = profile(s, jnp.asarray(0.0))
    assert np.all(modulus > 0) and np.min(poisson) >= 0.49 and np.max(poisson) == 0.5
    np.testing.assert_allclose(poisson[::200], [0.5, 0.49], rtol=1e-15)
    # The solver reaches its tolerance: there is no kink.
    stack = Stack(layers=[GradedLayer(profile, 1e-3)], base=gc.Rigid())
    assert np.all(gc.blocks.graded_compliance(stack, [3e2, 3e3], 0.0, rtol=1e-9).error <= 1e-9)


def test_aged_material_is_the_material_at_another_frequency():
    profile = Aged(RUBBER, 1.0, 100.0)
    modulus, _ = profile(jnp.asarray([0.0, 0.5, 1.0]), jnp.asarray(50.0))
    np.testing.assert_allclose(modulus, RUBBER.modulus(np.array([50.0, 500.0, 5000.0])), rtol=1e-13)


def test_temperature_reaches_the_materials_of_every_profile():
    tread = gc.tyre_tread()
    for profile in (Blend(STEEL, tread), Mixture(tread, STEEL, Linear()), Aged(tread, 1.0, 9.0)):
        stack = Stack(layers=(GradedLayer(profile, 1e-3),), base=gc.Rigid())
        cold = stack.at(273.15)
        s, omega = jnp.asarray(0.4), jnp.asarray(10.0)
        factor = tread.shift.factor(np.asarray(273.15))
        np.testing.assert_allclose(
            cold.layers[0].profile(s, omega)[0], profile(s, omega * factor)[0], rtol=1e-12
        )
    bare = Stack(layers=(GradedLayer(lambda s, omega: (1e6 + s, 0.3), 1e-3),), base=gc.Rigid())
    with pytest.raises(ValueError, match="has no method `at"):
        bare.at(273.15)


class Named(gc.blocks.AbstractProfile):
    """A rubber that a function stiffens with height; a text names what it does."""

    stiffer: object
    name: object = "rubber"

    def __call__(self, s, omega):
        factor = jnp.vectorize(self.stiffer, signature="(i)->(o)")(s[..., None])[..., 0]
        return jnp.exp(factor) * RUBBER.modulus(omega), jnp.asarray(0.5)


@pytest.mark.slow
def test_a_network_is_a_profile_whose_weights_have_derivatives():
    """Against central differences, in a program and without one; functions in it stay fixed."""
    network = eqx.nn.MLP(1, 1, 3, 1, activation=jax.nn.tanh, key=jax.random.key(0))
    layers, q = (GradedLayer(Named(network, None), 1e-4),), 2e4
    stack = Stack(layers=layers, base=gc.HalfSpace(RUBBER))
    assert all(eqx.is_array(leaf) for leaf in jax.tree.leaves(stack))

    def weight_of(stack):
        return stack.layers[0].profile.stiffer.layers[0].weight

    def compliance(stack):
        return jnp.abs(gc.surface_compliance(stack, q, 1e3))

    value, slope = jax.jit(jax.value_and_grad(compliance))(stack)
    np.testing.assert_allclose(value, compliance(stack), rtol=1e-12)
    # 32 layers cut by hand, at their middle.
    s = (np.arange(32)[::-1] + 0.5) / 32
    factor = jax.vmap(network)(s[:, None])[:, 0]
    cut = [
        gc.Layer(gc.Prony(1e6 * f, [1e8 * f], [1e-3], 0.5), 1e-4 / len(s)) for f in np.exp(factor)
    ]
    np.testing.assert_allclose(value, compliance(Stack(layers=cut, base=stack.base)), rtol=1e-4)
    for i, expected in enumerate(weight_of(slope)[:, 0]):
        high, low = (
            compliance(eqx.tree_at(weight_of, stack, weight_of(stack).at[i, 0].add(step)))
            for step in (1e-4, -1e-4)
        )
        np.testing.assert_allclose((high - low) / 2e-4, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Table([0, 0.5], [1, 2]), "exactly 0 .* exactly 1"),
        (lambda: Table([0, 0.5, 0.5, 1], [1, 2, 3, 4]), "heights must increase"),
        (lambda: Mixture(STEEL, RUBBER, Sinusoidal()), "a volume fraction lies between 0 and 1"),
        (lambda: GradedLayer(RUBBER, 1e-3), "`profile=.* must be called as profile"),
        (lambda: GradedLayer(Named(jnp.sin, "tread"), 1e-3), "a field with 'tread', which is no"),
    ],
)
def test_bad_profiles_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
