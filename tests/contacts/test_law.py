"""What every law promises the solvers, against its formula written out here."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import graded_contact as gc

# Ranges, pressure and work for a spring of stiffness 1, steep enough for the laws that attract.
LAWS = {
    "repulsive": gc.RepulsiveLJ(0.02, 3.0),
    "adhesive": gc.AdhesiveLJ(0.3, 0.02),
    "exponential": gc.contacts.ExponentialAdhesion(0.3, 0.02),
}


def formula(name, u):
    """σ(u), as its source states it."""
    if name == "repulsive":
        return 3.0 * (0.02 / u) ** 9
    if name == "adhesive":
        return 8 * 0.02 / (3 * 0.3) * ((0.3 / u) ** 9 - (0.3 / u) ** 3)
    return -0.02 / 0.3 * np.exp(-u / 0.3)


def pressures(name):
    """Values of v from far apart to hard pressed, in units of the unit spring."""
    v = np.concatenate([-np.logspace(-6, 3, 40), [0.0], np.logspace(-6, 3, 40)])
    return v[v < -0.02 / 0.3] if name == "exponential" else v


@pytest.mark.parametrize("name", LAWS)
def test_proximal_map_solves_its_equation(name):
    """y = f(u) with y - v = u, by scipy's bracketing."""
    v = pressures(name)
    y = np.asarray(jax.jit(lambda v: LAWS[name].proximal(v))(v))
    # The open end: no law reaches farther than |v| beyond a few ranges.
    bounds = (0.0 if name == "exponential" else 1e-3, 1e3 + 10)
    for one, found in zip(v, y, strict=True):
        gap = brentq(lambda u: formula(name, u) - u - one, *bounds, xtol=1e-300, rtol=8.9e-16)  # noqa: B023
        # v - u cancels where |v| is large: the gap is as good as its last digit.
        np.testing.assert_allclose(found - one, gap, rtol=1e-11, atol=1e-15 * abs(one))
        np.testing.assert_allclose(found, formula(name, gap), rtol=1e-7)


@pytest.mark.parametrize("name", LAWS)
def test_slope_of_the_proximal_map_matches_central_differences(name):
    """By the argument, and by every parameter that decides it."""
    law, v = LAWS[name], jnp.asarray(pressures(name)[::5])
    second = "pressure" if name == "repulsive" else "work"

    @jax.jit
    def along(point, tangent):
        y = lambda v, length, strength: type(law)(length, strength).proximal(v)  # noqa: E731
        return jax.jvp(y, point, tangent)

    point = (v, law.range, getattr(law, second))
    for index in range(3):
        x = point[index]
        step = 1e-6 * np.maximum(np.abs(x), 1e-3)
        tangent = tuple(np.ones(np.shape(p)) * (i == index) for i, p in enumerate(point))
        (_, slope), *ends = (
            along(tuple(p + sign * step if i == index else p for i, p in enumerate(point)), tangent)
            for sign in (0, 1, -1)
        )
        ends = [end for end, _ in ends]
        difference = (ends[0] - ends[1]) / (2 * step)
        scale = jnp.abs(ends[0]) / step * 1e-14  # rounding of the differences
        assert np.all(np.abs(slope - difference) <= 1e-6 * np.abs(difference) + scale)


def test_hard_wall_projects_on_its_bounds():
    v = jnp.array([-2.0, -0.0, 0.3, 5.0])
    np.testing.assert_array_equal(gc.HardWall().proximal(v), [0, 0, 0.3, 5])
    np.testing.assert_array_equal(gc.HardWall(hardness=1.0).proximal(v), [0, 0, 0.3, 1])


@pytest.mark.parametrize("name", ["adhesive", "exponential"])
def test_stated_tension_and_rise_are_the_extremes_of_the_formula(name):
    law = LAWS[name]
    bracket = (0.3, 0.9) if name == "adhesive" else (0.0, 0.9)
    tension = minimize_scalar(
        lambda u: formula(name, u), bounds=bracket, method="bounded", options={"xatol": 1e-12}
    )
    np.testing.assert_allclose(law.bounds[0], tension.fun, rtol=1e-9)
    if name == "adhesive":
        np.testing.assert_allclose(tension.x / 0.3, 1.20, atol=5e-3)  # as documented
        np.testing.assert_allclose(tension.fun, -1.03 * 0.02 / 0.3, rtol=5e-3)
    u = np.linspace(*bracket, 20001)
    slope = np.gradient(formula(name, u), u, edge_order=2)
    np.testing.assert_allclose(law.steepest_rise, np.max(slope), rtol=1e-6)


@pytest.mark.parametrize("name", ["repulsive", "adhesive"])
def test_pressure_at_a_gap_is_the_formula(name):
    gap = jnp.linspace(0.01, 1.0, 50)
    np.testing.assert_allclose(LAWS[name].pressure_at(gap), formula(name, gap), rtol=1e-13)


@pytest.mark.parametrize("name", LAWS)
def test_margin_changes_sign_at_the_edge_of_contact(name):
    law = LAWS[name]
    edge = {"repulsive": 0.02 * 5 / 3, "adhesive": 0.3, "exponential": 0.0}[name]
    if name == "exponential":
        gap = jnp.array([0.0, 1e-9, 0.1])
        pressure = jnp.array([formula(name, 0.0) + 1e-6, *formula(name, gap[1:])])
        expected = [True, False, False]
    else:
        gap = edge * jnp.array([0.5, 1 - 1e-9, 1 + 1e-9, 2.0])
        pressure = formula(name, gap)
        expected = [True, True, False, False]
    for stiffness in (1e-3, 1e3):
        margin = law.contact_indicator(pressure, gap, stiffness)
        np.testing.assert_array_equal(margin > 0, expected)
        assert np.all(np.diff(margin) < 0)
