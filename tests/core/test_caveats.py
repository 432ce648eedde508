"""Numbers that solvers vouch for but nobody should believe are told apart, in sentences."""

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.contacts.operator import Steady
from graded_contact.contacts.solution import RESULTS, ContactSolution
from graded_contact.core.warnings import caveats_of, caveats_of_steps
from graded_contact.sliding.problem import SteadyProblem
from graded_contact.surfaces.surface import Step, step


def solves(**changed):
    """What a sound solve gives, and changes of it."""
    sound = {"friction": 0.3, "friction_grid_error": 0.01, "slope_in_contact": 0.3}
    sound |= dict.fromkeys(["unmeasured_area", "unmeasured_friction", "extrapolated_friction"], 0.0)
    return SimpleNamespace(**{name: np.asarray(value) for name, value in (sound | changed).items()})


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
            {"friction_grid_error": 16.0, "slope_in_contact": 2},
            ["error of about 1000%", "slope where it"],
        ),
    ],
)
def test_doubtful_numbers_are_told_and_sound_ones_are_not(changed, words):
    sentences = [caveat.sentence for caveat in caveats_of(solves(**changed))]
    assert len(sentences) == len(words)
    for sentence, part in zip(sentences, words, strict=True):
        assert part in sentence


def test_a_caveat_is_true_of_each_solve_that_it_concerns_and_of_no_other():
    area = np.array([[0.05, np.nan, 0.2], [0.6, 0.0, 0.1]])
    sound = np.where(np.isnan(area), np.nan, 0.3)
    numbers = dict.fromkeys(["friction", "slope_in_contact"], sound)
    numbers["friction_grid_error"] = 0.01 * sound
    (caveat,) = caveats_of(solves(**numbers, unmeasured_area=area))
    assert caveat.sentence.startswith("20% to 60% of the contact area")
    assert "2 of 6 solves" in caveat.sentence
    np.testing.assert_array_equal(caveat.where, area > 0.1)


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([("read", 0.2), ("resampled", 0.19)], []),
        ([("read", 0.206), ("resampled", 0.14)], ["fell from 0.206 to 0.14 when resampled"]),
        ([("read", 0.2), ("equally spaced", 0.1)], ["fell from 0.2 to 0.1 when equally spaced"]),
        ([("read", 0.2), ("filled", 0.1)], []),  # spikes that were discarded
        ([("read", 0.2), ("filled", 0.3)], ["rose from 0.2 to 0.3 when filled"]),
    ],
)
def test_steps_that_change_the_slope_are_told(steps, words):
    sentences = caveats_of_steps([Step(name, 1.0, slope, 4.0, 0.0) for name, slope in steps])
    assert len(sentences) == len(words)
    for sentence, part in zip(sentences, words, strict=True):
        assert part in sentence


def test_many_missing_points_and_spikes_are_told():
    raw = Step("read", 1.0, 0.2, 4.0, 0.31)
    (missing,) = caveats_of_steps((raw, raw._replace(name="filled", missing=0.0)))
    assert "31% of the points were not measured" in missing
    spiky = raw._replace(name="tilt removed", peak=11.0, missing=0.0)
    smooth = raw._replace(name="resampled", missing=0.0)
    (spike,) = caveats_of_steps((spiky, smooth))  # resampling only blurs it
    assert "11 rms heights" in spike
    assert caveats_of_steps((spiky, smooth._replace(name="filled"))) == ()  # discarded


def test_a_step_measures_height_slope_and_peak_of_what_was_measured():
    x = 0.5 * np.arange(7.0)
    heights = np.add.outer(3 * x, 4 * x)
    heights[2, 3] = np.nan
    found = step("read", heights, (0.5, 0.5))
    known = heights[np.isfinite(heights)]
    np.testing.assert_allclose(found.rms_height, np.std(known))
    np.testing.assert_allclose(found.rms_slope, 5.0)
    assert found.missing == 1 / 49
    np.testing.assert_allclose(found.peak, np.max(np.abs(known - known.mean())) / np.std(known))


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
    names = "unmeasured_area", "unmeasured_friction"
    found = sliding(p, w, grid, measured).compute(*names)
    np.testing.assert_allclose(found, 0.5, rtol=1e-12)
    np.testing.assert_array_equal(sliding(0 * p, w, grid, measured).compute(*names), 0)


def test_a_surface_with_marked_points_slides_under_jit_vmap_and_grad():
    grid = gc.Grid((16,), 1e-3)
    x = jnp.arange(16) / 16
    heights = 1e-5 * jnp.cos(2 * jnp.pi * x) + 3e-6 * jnp.cos(6 * jnp.pi * x)
    surface = gc.Surface(heights, grid, measured=jnp.where(x < 0.1, 0.5, 1.0))
    prony = gc.Prony(equilibrium=1e6, strengths=[1e7], times=[1e-3])
    stack = gc.Stack(layers=(), base=gc.HalfSpace(prony))

    def solve(surface, velocity):
        found = gc.slide(stack, surface, pressure=1e4, velocity=velocity)
        return found.friction, found

    by_surface = jax.value_and_grad(solve, has_aux=True)
    (_, found), slope = jax.jit(jax.vmap(by_surface, (None, 0)))(surface, jnp.array([0.1, 1.0]))
    assert jnp.all((found.unmeasured_friction > 0) & (found.unmeasured_friction < 1))
    assert jnp.all((found.unmeasured_area > 0) & (found.unmeasured_area < 1))
    assert any("of the contact area" in text for text in found.caveats)
    assert jnp.all(jnp.isfinite(slope.heights)) and jnp.all(slope.measured == 0)


def test_marks_and_steps_follow_a_surface_that_is_resampled():
    grid = gc.Grid((8, 6), 1.0)
    x, y = jnp.arange(8)[:, None] / 8, jnp.arange(6)[None, :] / 6
    heights = jnp.cos(2 * jnp.pi * x) * jnp.cos(2 * jnp.pi * y)
    measured = jnp.broadcast_to((x < 0.5).astype(float), grid.shape)
    steps = (step("read", heights, grid.spacing),)
    surface = gc.Surface(heights, grid, measured=measured, steps=steps)
    finer = gc.surfaces.resample(surface, (16, 12))
    np.testing.assert_array_equal(finer.measured[:, 0], [1] * 7 + [0] * 8 + [1])
    assert [s.name for s in finer.steps] == ["read", "resampled"]
    np.testing.assert_allclose(finer.steps[1].rms_height, 0.5)
    with pytest.raises(ValueError, match=r"`measured\[0, 0\]=2`"):
        gc.Surface(heights, grid, measured=2 * jnp.ones(grid.shape))


@pytest.mark.parametrize(
    ("size", "height", "words"),
    [
        (1e-2, 1e-4, ""),
        (2.0, 1e-6, "rms slope of"),  # a scan of 2 mm, read in metres
        (4e-96, 1e-97, "size of 4e-84 pm is unusual (usual are 10 nm to 1 km): check units."),
    ],
)
def test_unusual_sizes_heights_and_slopes_are_told(size, height, words):
    values = height * np.random.default_rng(0).normal(size=(32, 32))
    caveats = gc.surfaces.surface_from_heights(values, size).caveats
    assert (words in " ".join(caveats)) if words else caveats == ()
