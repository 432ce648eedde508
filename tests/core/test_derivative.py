"""Derivatives compiled apart from their values."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from graded_contact.core.derivative import derivative_apart, largest, still


def plain(x, unit):
    return jnp.sum(jnp.sin(x) * x) ** 2


# An argument and an output without derivatives go along.
apart = derivative_apart(eqx.filter_jit(lambda x, unit: (plain(x, unit), jnp.arange(3))))
X = np.array([0.3, -1.2, 2.0])


def value(x):
    return apart(x, "m")[0]


def exact(x):
    return plain(x, "m")


@pytest.mark.parametrize(
    "derive",
    [
        jax.grad,
        lambda f: jax.jacrev(jax.jacfwd(f)),
        lambda f: jax.grad(jax.checkpoint(f)),
        lambda f: lambda x: jax.vmap(jax.grad(f))(jnp.stack([x, 2 * x])),
        lambda f: lambda x: jax.grad(lambda s: f(s * x) * f(x))(2.0),
    ],
)
def test_every_derivative_is_that_of_the_plain_function(derive):
    x = jnp.asarray(X)
    np.testing.assert_allclose(derive(value)(x), jax.jit(derive(exact))(x), rtol=1e-12)


def test_value_under_a_derivative_is_found_compiled(caplog):
    @eqx.filter_jit
    def heavy(x):
        return jnp.sum(jnp.cosh(x) ** 2)

    function = derivative_apart(heavy)
    x = jnp.asarray(X)
    with jax.log_compiles():
        function(x)
        assert "compilation of jit(heavy)" in caplog.text
        caplog.clear()
        jax.grad(function)(x)
    assert "Compiling jit(back)" in caplog.text
    assert "jit(heavy)" not in caplog.text


def test_still_numbers_have_no_derivative():
    assert jax.grad(lambda x: x * still((x, "m"))[0])(3.0) == 3
    assert jax.grad(lambda x: jax.grad(lambda y: still(x * y) * y)(1.0))(3.0) == 0


def test_derivative_of_the_largest_is_the_mean_of_those_as_large():
    """And finite where a program computes the numbers twice, with other roundings."""
    numbers = jnp.array([1.0, 3.0, 3.0 - 1e-15, 2.0])
    np.testing.assert_array_equal(largest(numbers), 3.0)
    np.testing.assert_allclose(jax.grad(largest)(numbers), [0, 0.5, 0.5, 0])
    np.testing.assert_allclose(jax.grad(largest)(jnp.zeros(2)), [0.5, 0.5])
