"""Designs under chance meet optima of expectations, keep constraints in the mean, tell their noise.

Bowls are quadratic in the logarithms u = ln p, about a centre that is drawn with every key. Their
mean is a bowl about the mean centre, whose optima under bounds and limits are closed forms.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import graded_contact as gc
from graded_contact.studies import minimise_expected
from graded_contact.studies.search import minimise

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
    design = minimise_expected(bowl, LOW, HIGH, num_steps=400, num_checks=200, rtol=0.02)
    # No estimate from 200 draws is nearer than NOISE/√200 each; four times that.
    np.testing.assert_allclose(logs(design.parameters), CENTRE, atol=4 * NOISE / np.sqrt(200))
    assert design.converged and design.num_evaluations == 600
    assert abs(design.value - 1 - NOISE**2) < 4 * design.error < 0.05
    assert f"± {design.error:.2g}; converged" in design.report()
    keys = jax.random.split(jax.random.key(0), 8)
    frozen = minimise(lambda p: jnp.mean(jax.vmap(lambda k: bowl(p, k))(keys)), LOW, HIGH)
    missed, left = (np.linalg.norm(logs(d.parameters) - CENTRE) for d in (frozen, design))
    assert missed > 3 * left


def test_a_bound_that_binds_is_met_exactly_with_any_optimiser_of_optax():
    high, optimiser = {"a": 1.5, "b": [10.0]}, optax.sgd(0.02, momentum=0.9)
    design = minimise_expected(bowl, LOW, high, optimiser=optimiser, num_steps=400)
    assert design.parameters["a"] == 1.5
    np.testing.assert_allclose(logs(design.parameters)[1], CENTRE[1], atol=0.12)


def test_a_random_constraint_that_binds_holds_in_the_mean_with_its_multiplier():
    design = minimise_expected(
        bowl, LOW, HIGH, constraints=limits, num_steps=400, num_checks=64, rtol=0.03
    )
    multiplier = (np.sum(CENTRE) - 1) / 2  # of u = c - multiplier, which adds up to 1
    np.testing.assert_allclose(logs(design.parameters), CENTRE - multiplier, atol=0.06)
    np.testing.assert_allclose(design.multipliers, [multiplier, 0], atol=0.08)
    # The nearest point that held over 64 draws, judged by 64 others.
    assert abs(design.margins[0]) < 4 * 0.1 / np.sqrt(32) and design.margins[1] > 4


def test_a_constraint_without_chance_holds_exactly():
    constraints = lambda p, _: 1 - jnp.sum(logs(p))  # noqa: E731
    design = minimise_expected(bowl, LOW, HIGH, constraints=constraints, num_steps=100)
    assert design.margins >= 0
    assert design.margins < 1e-6


def test_the_same_seed_gives_the_same_design_and_a_cut_off_run_goes_on(tmp_path):
    store, calls, traces = tmp_path / "points", itertools.count(), []

    def traced(p, key):
        traces.append(1)
        return bowl(p, key)

    def stop(_step, _value):
        if next(calls) == 20:
            raise KeyboardInterrupt

    usual = {"lower": LOW, "upper": HIGH, "num_steps": 40, "num_checks": 4}
    whole = minimise_expected(traced, **usual)
    assert len(traces) == 1  # compiled once, whatever the number of steps
    with pytest.raises(KeyboardInterrupt):
        minimise_expected(bowl, **usual, store=store, progress=stop)
    stored = len(list(store.glob("*.point")))
    resumed = minimise_expected(bowl, **usual, store=store)
    assert resumed.runs == whole.runs and resumed.error == whole.error
    assert len(list(store.glob("*.point"))) == 44 > stored  # each draw once
    double = minimise_expected(lambda p, key: 2 * bowl(p, key), **usual, store=store)
    np.testing.assert_allclose(double.value, 2 * whole.value, rtol=0.1)
    other = minimise_expected(bowl, **usual, seed=1, store=store)
    assert other.value != whole.value


def test_a_base_found_on_random_surfaces_gives_more_friction_on_one_never_seen():
    """Friction grows with the compliance of the block: the softest allowed is the best."""
    grid = gc.Grid((16, 16), 1e-2)
    spectrum = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=700.0, q_roll=1.5e3, q_high=4e3)

    def loss(p, key):
        stack = gc.Stack(layers=(), base=gc.HalfSpace(gc.Prony(p["modulus"], [1e7], [1e-3], 0.49)))
        surface = gc.random_surface(spectrum, grid, key)
        return -gc.slide(stack, surface, pressure=1e5, velocity=0.3).friction

    low, high = {"modulus": 3e6}, {"modulus": 1e7}
    design = minimise_expected(loss, low, high, num_steps=8, num_checks=2)
    unseen = jax.random.key(99)
    better, worse = (-loss(p, unseen) for p in (design.parameters, high))
    assert better > worse > 0
    assert design.elasticities["modulus"] < 0  # a softer one would do more
