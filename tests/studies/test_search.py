"""Designs meet known optima, keep their constraints, resume, and refuse what cannot be designed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import differential_evolution

from graded_contact.studies.alternatives import pareto_front
from graded_contact.studies.search import minimise

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
    assert len(design.runs) == 3 and design.num_evaluations < 100
    assert "b.1" in design.report()


def test_elasticities_are_relative_derivatives():
    design = minimise(lambda p: p["a"] ** 2 / p["b"][0] ** 3, LOW, HIGH, num_starts=1)
    np.testing.assert_allclose(design.elasticities["a"], 2, rtol=1e-12)
    np.testing.assert_allclose(design.elasticities["b"], [-3, 0], rtol=1e-12)


def test_constraints_hold_where_they_bind():
    design = minimise(
        valley, LOW, HIGH, constraints=lambda p: jnp.array([1 - (p["a"] + p["b"][0]) / 4]),
        num_starts=4,
    )  # fmt: skip
    a, b = float(design.parameters["a"]), float(design.parameters["b"][0])
    assert 0 < 4 - (a + b) < 1e-6
    assert np.all(design.margins >= 0)
    # Where the constraint binds, its gradient and that of the objective are parallel.
    slopes = jax.grad(valley)({"a": a, "b": jnp.array([b, 1.0])})
    np.testing.assert_allclose(slopes["a"], slopes["b"][0], rtol=1e-3)


def test_an_objective_with_its_constraints_is_computed_once_a_step():
    """The same design as of two functions."""
    calls = []

    def both(p):
        jax.debug.callback(lambda: calls.append(1))
        return valley(p), {"sum": 1 - (p["a"] + p["b"][0]) / 4}

    design = minimise(both, LOW, HIGH, constraints=lambda p: 5 - p["a"], num_starts=2)
    jax.effects_barrier()
    assert len(calls) == len({tuple(x) for r in design.runs for x in r.history.parameters})
    assert design.constraints == ("sum", "constraint") and design.active == ("sum is active",)
    limits = lambda p: jnp.stack([1 - (p["a"] + p["b"][0]) / 4, 5 - p["a"]])  # noqa: E731
    apart = minimise(valley, LOW, HIGH, constraints=limits, num_starts=2)
    np.testing.assert_allclose(design.value, apart.value, rtol=1e-9)
    np.testing.assert_allclose(design.margins, apart.margins, atol=1e-9)


def test_many_starts_find_what_a_gradient_free_search_finds():
    def bumpy(p):
        x = jnp.log(p["x"])
        return jnp.sum(0.05 * x**2 + jnp.sin(2 * x + 1))

    low, high = {"x": np.full(2, 1e-2)}, {"x": np.full(2, 1e2)}
    design = minimise(bumpy, low, high, num_starts=16)
    free = differential_evolution(
        lambda u: float(bumpy({"x": np.exp(u)})), [(np.log(1e-2), np.log(1e2))] * 2, seed=1
    )
    assert design.value <= free.fun + 1e-7
    assert design.num_evaluations < free.nfev


def test_pareto_front_of_two_distances_lies_between_their_optima(tmp_path):
    """|x - 1|², |x - 4|² in logarithms: the front is the segment between, and √f0 + √f1 = ln 4."""

    def distances(p):
        return jnp.array([jnp.log(p["x"]) ** 2, jnp.log(p["x"] / 4) ** 2])

    arguments = {"num_points": 5, "num_starts": 2, "store": tmp_path}
    front = pareto_front(distances, {"x": 0.1}, {"x": 10.0}, **arguments)
    values = np.array([v for _, v in front])
    assert len(front) == 5
    assert np.all(np.diff(values[:, 0]) > 0) and np.all(np.diff(values[:, 1]) < 0)
    np.testing.assert_allclose(np.sqrt(values).sum(axis=1), np.log(4), rtol=1e-4)
    stored = sorted(tmp_path.glob("*.point"))
    again = pareto_front(distances, {"x": 0.1}, {"x": 10.0}, **arguments)
    np.testing.assert_array_equal([v for _, v in again], values)
    assert sorted(tmp_path.glob("*.point")) == stored
    with pytest.raises(ValueError, match="`num_points=1` must be at least 2"):
        pareto_front(distances, {"x": 0.1}, {"x": 1.0}, num_points=1)
