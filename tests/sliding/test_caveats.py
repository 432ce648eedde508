"""Numbers that solvers vouch for but nobody should believe are told apart, in sentences."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.operator import Steady
from graded_contact.contacts.solution import RESULTS, ContactSolution
from graded_contact.core.caveats import caveats_of
from graded_contact.sliding.problem import SteadyProblem


def told(**changed):
    """The caveats of a sound solve, and of changes of it."""
    sound = {"friction": 0.3, "friction_grid_error": 0.01, "slope_in_contact": 0.3}
    sound |= dict.fromkeys(["unmeasured_area", "unmeasured_friction", "extrapolated_friction"], 0.0)
    return caveats_of(lambda name: (sound | changed).get(name, 0.0), kind="steady")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, []),
        ({"friction": np.nan, "friction_grid_error": np.nan}, []),
        ({"friction": np.nan, "shear_friction": np.nan}, ["`shear` returned NaN"]),
        ({"friction": 0.0, "friction_grid_error": 2e-5}, []),  # at rest
        ({"friction": 2.8e-18, "friction_grid_error": 1.9e-4}, []),  # elastic: rounding
        ({"friction": 0.3, "friction_grid_error": 0.04}, ["an error of about 13%"]),
        ({"slope_in_contact": 0.5}, ["rms slope where it carries the load is 0.5"]),
        ({"unmeasured_friction": 0.11}, ["11% of the friction"]),
        ({"extrapolated_friction": 0.02}, ["2% of the friction comes from frequencies"]),
        ({"unmeasured_area": 0.7}, ["70% of the contact area"]),
        (
            {"contact_area": 0.1, "contact_area_kernel_error": 0.026},
            [
                "kernel of the window is not known well, as where the block recovers slowly behind "
                "the body: the contact area has an error of about 26%"
            ],
        ),
        ({"friction_temperature_error": 0.04}, ["temperatures of the contact did not settle"]),
        (
            {"friction_grid_error": 16.0, "slope_in_contact": 2},
            ["error of about 1000%", "slope where it"],
        ),
    ],
)
def test_doubtful_numbers_are_told_and_sound_ones_are_not(changed, words):
    sentences = [caveat.sentence for caveat in told(**changed)]
    assert len(sentences) == len(words)
    for sentence, part in zip(sentences, words, strict=True):
        assert part in sentence


def test_a_caveat_is_true_of_each_solve_that_it_concerns_and_of_no_other():
    area = np.array([[0.05, np.nan, 0.2], [0.6, 0.0, 0.1]])
    sound = np.where(np.isnan(area), np.nan, 0.3)
    numbers = dict.fromkeys(["friction", "slope_in_contact"], sound)
    numbers["friction_grid_error"] = 0.01 * sound
    (caveat,) = told(**numbers, unmeasured_area=area)
    assert caveat.sentence.startswith("20% to 60% of the contact area")
    assert "2 of 6 solves" in caveat.sentence
    np.testing.assert_array_equal(caveat.where, area > 0.1)


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


def test_a_result_keeps_its_numbers_and_a_copy_starts_with_none():
    found = sliding(jnp.ones(8), jnp.zeros(8), gc.Grid((8,), 1.0))
    (area,) = found.compute("unmeasured_area")
    assert found.kept.numbers == {"unmeasured_area": area} and found.kept.formulas is None
    assert jax.tree.map(lambda leaf: leaf, found).kept.numbers == {}


def test_shares_of_points_not_measured_are_sums_over_them():
    """A tooth on each flank of a wave: all of the work on the one that was filled, or half."""
    grid = gc.Grid((32,), 1.0)
    x = np.arange(32) / 32
    w = jnp.asarray(0.01 * np.cos(2 * np.pi * x))
    p = jnp.asarray(np.where((x == 0.25) | (x == 0.75), 1.0, 0.0))
    measured = jnp.asarray(np.where(x == 0.75, 0.0, 1.0))
    names = "unmeasured_area", "unmeasured_friction"
    found = sliding(p, w, grid, measured).compute(*names)
    np.testing.assert_allclose(found, 0.5, rtol=1e-12)
    np.testing.assert_array_equal(sliding(0 * p, w, grid, measured).compute(*names), 0)


@pytest.mark.slow
def test_a_surface_with_marked_points_slides_under_jit_vmap_and_grad():
    grid = gc.Grid((16,), 1e-3)
    x = jnp.arange(16) / 16
    heights = 1e-5 * jnp.cos(2 * jnp.pi * x) + 3e-6 * jnp.cos(6 * jnp.pi * x)
    surface = gc.Surface(heights, grid, measured=jnp.where(x < 0.1, 0.5, 1.0))
    prony = gc.Prony(equilibrium=1e6, strengths=[1e7], times=[1e-3])
    stack = gc.Stack(layers=(), base=gc.HalfSpace(prony))

    plain = gc.contacts.DouglasRachford(newton=False)  # compiles in two thirds of the time

    def solve(surface, velocity):
        found = gc.slide(stack, surface, pressure=1e4, velocity=velocity, solver=plain)
        return found.friction, found

    by_surface = jax.value_and_grad(solve, has_aux=True)
    (_, found), slope = jax.jit(jax.vmap(by_surface, (None, 0)))(surface, jnp.array([0.1, 1.0]))
    assert jnp.all((found.unmeasured_friction > 0) & (found.unmeasured_friction < 1))
    assert jnp.all((found.unmeasured_area > 0) & (found.unmeasured_area < 1))
    assert any("of the contact area" in text for text in found.caveats)
    assert jnp.all(jnp.isfinite(slope.heights)) and jnp.all(slope.measured == 0)
