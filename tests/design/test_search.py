"""Designs meet known optima, keep their constraints, and refuse what cannot be designed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import differential_evolution

from graded_contact.design import minimise

LOW, HIGH = {"a": 0.1, "b": [0.1, 1.0]}, {"a": 10.0, "b": [10.0, 1.0]}


def valley(p):
    """Least, 0.5, at a = 2, b[0] = 3."""
    a, b = p["a"], p["b"][0]
    return 0.5 + jnp.log(a / 2) ** 2 + 10 * jnp.log(a * b / 6) ** 2


def test_a_smooth_minimum_is_found_and_constant_parameters_stay():
    design = minimise(valley, LOW, HIGH, num_starts=3)
    assert design.converged
    np.testing.assert_allclose(design.parameters["a"], 2, rtol=1e-3)
    np.testing.assert_allclose(design.parameters["b"], [3, 1], rtol=1e-3)
    np.testing.assert_allclose(design.value, 0.5, rtol=1e-6)
    assert len(design.runs) == 3 and sum(len(run.values) for run in design.runs) < 100


def test_elasticities_are_relative_derivatives():
    design = minimise(lambda p: p["a"] ** 2 / p["b"][0] ** 3, LOW, HIGH, num_starts=1)
    np.testing.assert_allclose(design.elasticities["a"], 2, rtol=1e-12)
    np.testing.assert_allclose(design.elasticities["b"], [-3, 0], rtol=1e-12)


def test_constraints_hold_where_they_bind():
    design = minimise(
        valley, LOW, HIGH, constraints=lambda p: {"sum": 1 - (p["a"] + p["b"][0]) / 4}, num_starts=4
    )
    a, b = float(design.parameters["a"]), float(design.parameters["b"][0])
    assert 0 < 4 - (a + b) < 1e-6
    assert 0 <= design.constraints["sum"] < 1e-6
    # Where the constraint binds, its gradient and that of the objective are parallel.
    slopes = jax.grad(valley)({"a": a, "b": jnp.array([b, 1.0])})
    np.testing.assert_allclose(slopes["a"], slopes["b"][0], rtol=1e-3)


def test_an_objective_may_give_constraints_of_the_same_solve():
    def both(p):
        return valley(p), {"sum": 1 - (p["a"] + p["b"][0]) / 4}

    design = minimise(both, LOW, HIGH, constraints=lambda p: 5 - p["a"], num_starts=2)
    own, other = design.constraints
    assert own["sum"] < 1e-6 and np.isclose(other, 5 - design.parameters["a"])
    limits = lambda p: jnp.stack([1 - (p["a"] + p["b"][0]) / 4, 5 - p["a"]])  # noqa: E731
    apart = minimise(valley, LOW, HIGH, constraints=limits, num_starts=2)
    np.testing.assert_allclose(design.value, apart.value, rtol=1e-12)


def test_many_starts_find_the_lowest_of_several_minima():
    def bumpy(p):
        u = jnp.log(jnp.stack([p["x"], p["y"]]))
        return jnp.sum(u**2) / 20 - jnp.prod(jnp.cos(3 * u - 1))

    low, high = {"x": 0.05, "y": 0.05}, {"x": 20.0, "y": 20.0}
    best = differential_evolution(
        lambda u: float(bumpy({"x": np.exp(u[0]), "y": np.exp(u[1])})), [(-3, 3)] * 2, seed=0
    )
    design = minimise(bumpy, low, high, num_starts=12)
    np.testing.assert_allclose(design.value, best.fun, rtol=1e-8)


def test_what_cannot_be_designed_is_refused():
    with pytest.raises(ValueError, match="lower"):
        minimise(valley, LOW, {"a": 0.01, "b": [10.0, 1.0]})
    with pytest.raises(ValueError, match="upper"):
        minimise(valley, LOW, {"a": 1.0})
    with pytest.raises(ValueError, match="start"):
        minimise(valley, LOW, HIGH, {"a": 20.0, "b": [1.0, 1.0]})
    with pytest.raises(ValueError, match="NaN"):
        minimise(lambda p: jnp.log(p["a"] - 5), LOW, HIGH)
    with pytest.raises(ValueError, match="constraints"):
        minimise(valley, LOW, HIGH, constraints=lambda p: -1 - p["a"], num_starts=2)
