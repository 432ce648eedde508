"""Designs under chance meet optima of expectations, and keep constraints in the mean.

Bowls are quadratic in the logarithms u = ln p, about a centre that is drawn with every key. Their
mean is a bowl about the mean centre, whose optima under bounds and limits are closed forms.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optax

from graded_contact.design import minimise, minimise_expected

LOW, HIGH = {"a": 0.1, "b": [0.1]}, {"a": 10.0, "b": [10.0]}
CENTRE, NOISE = np.log([2.0, 3.0]), 0.3


def logs(p):
    return jnp.log(jnp.stack([jnp.asarray(p["a"]), jnp.asarray(p["b"][0])]))


def bowl(p, key):
    """Mean 1 + |u - c|²/2 + NOISE²."""
    return 1 + jnp.sum((logs(p) - CENTRE + NOISE * jax.random.normal(key, (2,))) ** 2) / 2


def limits(p, key):
    """Means 1 - u_a - u_b, which binds, and 5 - u_a, which does not."""
    u = logs(p)
    return jnp.stack([1 - jnp.sum(u), 5 - u[0]]) + 0.1 * jax.random.normal(key, (2,))


def test_the_mean_of_noisy_bowls_is_least_at_their_centre_and_eight_draws_miss_it():
    design = minimise_expected(bowl, LOW, HIGH, num_steps=400, num_checks=200)
    # No estimate from 200 draws is nearer than NOISE/√200 each; four times that.
    np.testing.assert_allclose(logs(design.parameters), CENTRE, atol=4 * NOISE / np.sqrt(200))
    assert abs(design.value - 1 - NOISE**2) < 4 * design.error < 0.05
    keys = jax.random.split(jax.random.key(0), 8)
    frozen = minimise(lambda p: jnp.mean(jax.vmap(lambda k: bowl(p, k))(keys)), LOW, HIGH)
    missed, left = (np.linalg.norm(logs(d.parameters) - CENTRE) for d in (frozen, design))
    assert missed > 2 * left
    again = minimise_expected(bowl, LOW, HIGH, num_steps=400, num_checks=200)
    assert again.value == design.value and again.error == design.error


def test_a_bound_that_binds_is_met_with_any_optimiser_of_optax():
    high, optimiser = {"a": 1.5, "b": [10.0]}, optax.sgd(0.02, momentum=0.9)
    design = minimise_expected(bowl, LOW, high, optimiser=optimiser, num_steps=400)
    np.testing.assert_allclose(design.parameters["a"], 1.5, rtol=1e-13)
    np.testing.assert_allclose(logs(design.parameters)[1], CENTRE[1], atol=0.12)


def test_a_random_constraint_that_binds_holds_in_the_mean():
    design = minimise_expected(bowl, LOW, HIGH, constraints=limits, num_steps=400, num_checks=64)
    multiplier = (np.sum(CENTRE) - 1) / 2  # of u = c - multiplier, which adds up to 1
    np.testing.assert_allclose(logs(design.parameters), CENTRE - multiplier, atol=0.06)
    assert abs(design.constraints[0]) < 4 * design.constraints_error[0] < 0.06
    assert design.constraints[1] > 4
