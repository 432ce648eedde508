"""Numbers that solvers vouch for but nobody should believe are told apart, in sentences."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.operators.operator import Steady
from graded_contact.contacts.solution import RESULTS, ContactSolution
from graded_contact.sliding.number import warnings_of
from graded_contact.sliding.problem import SteadyProblem


def told(**changed):
    """The warnings of a sound solve, and of changes of it."""
    sound = {"friction": 0.3, "friction_error": 0.01, "slope_in_contact": 0.3}
    sound |= dict.fromkeys(["unmeasured_friction", "extrapolated_friction"], 0.0)
    return warnings_of(gc.Sliding, lambda name: (sound | changed).get(name, 0.0))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, []),
        ({"friction": np.nan, "friction_error": np.nan}, []),
        ({"friction": 0.0, "friction_error": 2e-5}, []),  # at rest
        ({"friction": 2.8e-18, "friction_error": 1.9e-4}, []),  # elastic: rounding
        ({"friction": 0.3, "friction_error": 0.04}, ["an error of about 13%"]),
        ({"slope_in_contact": 0.5}, ["where it carries the load is 0.5"]),
        ({"unmeasured_friction": 0.11}, ["11% of the friction"]),
        ({"extrapolated_friction": 0.02}, ["2% of the friction comes from frequencies"]),
        ({"contact_area": 0.1, "contact_area_error": 0.026}, ["has an error of about 26%"]),
        (
            {"friction_error": 16.0, "slope_in_contact": 2},
            ["error of about 1000%", "where it carries"],
        ),
    ],
)
def test_doubtful_numbers_are_told_and_sound_ones_are_not(changed, words):
    sentences = told(**changed)
    assert len(sentences) == len(words)
    for sentence, part in zip(sentences, words, strict=True):
        assert part in sentence


def sliding(pressure, displacement, grid, measured=None):
    """A contact with these fields, and nothing else."""
    fields = {f.name: jnp.zeros(()) for f in dataclasses.fields(ContactSolution)}
    fields |= {"pressure": pressure, "displacement": displacement, "gap": 0 * pressure}
    fields |= {"correction": 0 * pressure, "result": RESULTS.successful}
    kernel = jnp.ones((*grid.shape[:-1], grid.shape[-1] // 2 + 1))
    problem = SteadyProblem(
        operator=Steady(kernel), heights=displacement, grid=grid, velocity=jnp.array(1.0),
        law=gc.HardWall(), measured=measured,
    )  # fmt: skip
    return gc.Sliding(ContactSolution(**fields), problem)


def test_the_slope_in_contact_is_that_of_the_touching_part():
    """Waves of slope 2π a/L cos: the pressure stands on the rising flanks, where cos² is known."""
    grid = gc.Grid((64, 16), [1.0, 2.0])
    x = jnp.arange(64)[:, None] / 64
    w = jnp.broadcast_to(0.01 * jnp.sin(2 * jnp.pi * x), grid.shape)
    p = jnp.where(jnp.abs(x - 0.5) < 0.1, 3.0, 0.0) + jnp.zeros(grid.shape)
    at = np.abs(np.arange(64) / 64 - 0.5) < 0.1
    expected = 0.02 * np.pi * np.sqrt(np.mean(np.cos(2 * np.pi * np.arange(64)[at] / 64) ** 2))
    np.testing.assert_allclose(sliding(p, w, grid).slope_in_contact, expected, rtol=1e-12)
    assert sliding(0 * p, w, grid).slope_in_contact == 0


def test_shares_of_points_not_measured_are_sums_over_them():
    """A tooth on each flank of a wave: all of the work on the one that was filled, or half."""
    grid = gc.Grid((32,), 1.0)
    x = np.arange(32) / 32
    w = jnp.asarray(0.01 * np.cos(2 * np.pi * x))
    p = jnp.asarray(np.where((x == 0.25) | (x == 0.75), 1.0, 0.0))
    measured = jnp.asarray(np.where(x == 0.75, 0.0, 1.0))
    found = sliding(p, w, grid, measured).unmeasured_friction
    np.testing.assert_allclose(found, 0.5, rtol=1e-12)
    assert sliding(0 * p, w, grid, measured).unmeasured_friction == 0
