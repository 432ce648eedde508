"""Designs meet known optima, keep their constraints, resume, and refuse what cannot be designed."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import differential_evolution

from graded_contact.studies.alternatives import pareto_front, scatter, snap_to_values
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


def test_active_bounds_and_constraints_are_said():
    """The first holds at a = 1.5, the second at b = 6/1.5 at most 3.5; the third has room."""
    low, high = {"a": 0.1, "b": [0.1, 1.0]}, {"a": 1.5, "b": [10.0, 1.0]}
    design = minimise(
        valley, low, high, num_starts=2,
        constraints=lambda p: {
            "b of at most 3.5": 1 - p["b"][0] / 3.5, "other": jnp.stack(p["b"]) + 1,
        },
    )  # fmt: skip
    assert design.active == ("a is at its upper bound", "b of at most 3.5 is active")
    assert design.constraints == ("b of at most 3.5", "other[0]", "other[1]")
    assert "b of at most 3.5 is active" in design.report() and "at its upper" in str(design)
    free = minimise(valley, LOW, HIGH, num_starts=1)
    assert free.active == () and "no bound and no constraint is active" in free.report()


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


def test_a_search_shows_its_progress_in_a_terminal(capsys, monkeypatch):
    minimise(valley, LOW, HIGH, num_starts=2)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    design = minimise(valley, LOW, HIGH, num_starts=2)
    last = capsys.readouterr().err.rpartition("\x1b[2K")[2]
    assert last.startswith(f"start 2 of 2, {design.num_evaluations} evaluations, ")
    assert last.endswith(f"lowest {design.value:.6g}\n")


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


def test_units_of_parameters_and_objective_do_not_matter():
    def scaled(p):
        return 1e9 * valley({"a": p["a"] * 1e6, "b": p["b"]})

    low, high = {**LOW, "a": 1e-7}, {**HIGH, "a": 1e-5}
    one = minimise(valley, LOW, HIGH, num_starts=1)
    other = minimise(scaled, low, high, num_starts=1)
    np.testing.assert_allclose(other.parameters["a"] * 1e6, one.parameters["a"], rtol=1e-6)
    np.testing.assert_allclose(other.value, 1e9 * one.value, rtol=1e-9)


def test_a_design_stopped_at_any_step_resumes_to_the_same_result(tmp_path):
    store, counts = tmp_path / "points", []

    def counted(p):
        jax.debug.callback(lambda: counts.append(1))
        return valley(p)

    def limited(p):
        return 1 - 0.2 * p["a"]

    usual = {"lower": LOW, "upper": HIGH, "constraints": limited, "num_starts": 4}
    whole = minimise(counted, **usual)
    for last in (3, 10, 17):
        calls = itertools.count()

        def stop(_start, _value, calls=calls, last=last):
            if next(calls) == last:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            minimise(counted, **usual, store=store, progress=stop)
    damaged = next(store.glob("*.point"))
    damaged.write_bytes(damaged.read_bytes()[:-1])
    jax.effects_barrier()
    counts.clear()
    with pytest.warns(UserWarning, match="1 of the points in .* were damaged"):
        resumed = minimise(counted, **usual, store=store)
    jax.effects_barrier()
    assert resumed.value == whole.value and resumed.runs == whole.runs
    assert len(counts) < whole.num_evaluations - 4
    counts.clear()
    again = minimise(counted, **usual, store=store)
    jax.effects_barrier()
    assert again.runs == whole.runs and not counts


@pytest.mark.parametrize("changed", [
    {"objective": lambda p: valley(p) + 1e-4 * p["a"]},
    # The same wherever the search starts: only the optimum differs.
    {"objective": lambda p: jnp.maximum(valley(p), 3)},
    {"constraints": lambda p: jnp.array([0.9 - (p["a"] + p["b"][0]) / 4])},
])  # fmt: skip
def test_a_search_never_takes_the_stored_values_of_another(tmp_path, changed):
    usual = {
        "objective": valley, "lower": LOW, "upper": HIGH, "num_starts": 2,
        "constraints": lambda p: jnp.array([1 - (p["a"] + p["b"][0]) / 4]),
    }  # fmt: skip
    minimise(**usual, store=tmp_path)
    found = minimise(**{**usual, **changed}, store=tmp_path)
    assert found.runs == minimise(**{**usual, **changed}).runs


def test_snapping_takes_the_nearest_choice_and_finds_the_rest_again():
    design = minimise(valley, LOW, HIGH, num_starts=2)
    made = snap_to_values(valley, design, {"a": [1.0, 1.8, 2.5]}, lower=LOW, upper=HIGH)
    assert made.parameters["a"] == 1.8
    # With a held, the valley is lowest where its wide term vanishes.
    np.testing.assert_allclose(made.parameters["b"][0], 6 / 1.8, rtol=1e-4)
    with pytest.raises(ValueError, match="unknown key 'c'"):
        snap_to_values(valley, design, {"c": [1.0]}, lower=LOW, upper=HIGH)
    with pytest.raises(ValueError, match="no value between the bounds"):
        snap_to_values(valley, design, {"a": [100.0]}, lower=LOW, upper=HIGH)


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


def test_scatter_of_a_power_law_is_lognormal():
    values = scatter(lambda p: p["x"] ** 2, {"x": 3.0}, 0.05, num_samples=2000)
    np.testing.assert_allclose(np.std(np.log(values)), 0.1, rtol=0.05)
    np.testing.assert_allclose(np.mean(np.log(values)), np.log(9), atol=0.01)
    alone = scatter(valley, {"a": 2.0, "b": jnp.array([3.0, 1.0])}, 0.0, num_samples=3)
    np.testing.assert_allclose(alone, 0.5, rtol=1e-12)
    with pytest.raises(ValueError, match=r"`spread\[0\]=.* is refused"):
        scatter(lambda p: p["x"], {"x": 1.0}, -0.1)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"lower": {"a": 0.0}, "upper": {"a": 1.0}}, "`lower` and `upper` of a are 0 and 1; they"),
        ({"lower": {"a": 1.0}, "upper": {"b": 1.0}}, "same nesting"),
        ({"start": {"a": 30.0}}, "`start` has a = 30; it must be between"),
        ({"num_starts": 0}, "`num_starts=0` must be a whole number, at least 1"),
        ({"constraints": lambda p: p["a"] - 20}, "No start of 2 satisfies `constraints`.*10"),
        ({"objective": lambda p: jnp.log(p["a"] - 5)}, "`objective` is nan at a = 1"),
        ({"objective": lambda p: jnp.sqrt(jnp.abs(p["a"] - 1))}, "is not finite at a"),
    ],
)
def test_what_cannot_be_designed_is_refused(arguments, message):
    usual = {
        "objective": lambda p: p["a"], "lower": {"a": 0.1}, "upper": {"a": 10.0}, "num_starts": 2,
    }  # fmt: skip
    with pytest.raises(ValueError, match=message):
        minimise(**{**usual, **arguments})
