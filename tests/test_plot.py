"""Figures are made without a display, with axes named and in units that suit their size."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
import xarray

import graded_contact as gc
from graded_contact.core.display import unit_of
from graded_contact.core.quantities import OBSERVABLES
from graded_contact.files.dataset import attach
from graded_contact.files.results import surface_variables
from graded_contact.plot import (
    plot_compare,
    plot_fit,
    plot_reduced,
    plot_response,
    plot_sensitivity,
    plot_sliding,
    plot_sweep,
)
from graded_contact.studies.uncertainty import Sensitivity


class Fields(NamedTuple):
    """The fields of a contact that figures need."""

    pressure: np.ndarray
    gap: np.ndarray
    displacement: np.ndarray


def make_results(axes, values, message, **attributes):
    _, surface = make_fields((8, 8))
    variables, places, about = surface_variables(surface)
    variables |= {name: (tuple(axes), value) for name, value in values.items()}
    variables["message"] = tuple(axes), message.astype(str)
    coordinates = {name: (name, np.asarray(at)) for name, at in axes.items()} | places
    return attach(xarray.Dataset(variables, coordinates, about | attributes))


def make_fields(shape):
    draw = np.random.default_rng(1)
    pressure = np.maximum(draw.normal(size=shape), 0) * 5e6
    fields = Fields(pressure=pressure, gap=(pressure == 0) * 3e-6, displacement=0 * pressure)
    return fields, gc.Surface(1e-6 * draw.normal(size=shape), gc.Grid(shape, 2e-3))


def test_maps_have_units_with_x_to_the_right_and_y_upwards():
    fields, surface = make_fields((8, 16))
    figure = plot_sliding(fields, surface)
    image = figure.axes[0].images[0]
    heights = np.asarray(surface.heights - np.mean(surface.heights))
    np.testing.assert_allclose(image.get_array(), 1e6 * heights.T)
    assert image.origin == "lower"
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels[2:4] == ["$x$ [mm]", "height into the solid [µm]"]


def test_a_profile_is_drawn_as_lines():
    figure = plot_sliding(*make_fields((16,)))
    assert [axes.get_ylabel().split("\n")[1] for axes in figure.axes] == ["[µm]", "[MPa]", "[µm]"]
    figure.draw_without_rendering()


def test_an_outlier_does_not_set_the_scale_and_the_bar_shows_it():
    fields, surface = make_fields((32, 32))
    without = plot_sliding(fields, surface)
    heights = surface.heights.at[3, 4].set(-1e-3)
    fields.pressure[5, 6], fields.gap[5, 6] = 2e9, 0.0
    figure = plot_sliding(fields, gc.Surface(heights, surface.grid))
    for before, after in zip(without.axes[:2], figure.axes[:2], strict=False):
        (low, high), (least, most) = (axes.images[0].get_clim() for axes in (before, after))
        assert most - least < 2 * (high - low)
    assert [axes.images[0].colorbar.extend for axes in figure.axes[:3]] == ["min", "max", "neither"]


@pytest.mark.parametrize("velocity", [-0.3, (-3.0, 4.0)])
def test_an_arrow_points_along_the_velocity(velocity):
    shape = (8, 32)  # whose panels have unlike scales
    figure = plot_sliding(*make_fields(shape), velocity)
    (arrow,) = figure.axes[1].texts
    assert arrow.get_text() == "sliding"
    assert arrow.xycoords is arrow.anncoords  # in points, unlike the units of the axes
    along = np.subtract(arrow.xy, arrow.xyann)
    expected = np.array(velocity if isinstance(velocity, tuple) else (velocity, 0.0))
    along, expected = (vector / np.linalg.norm(vector) for vector in (along, expected))
    np.testing.assert_allclose(along, expected, atol=1e-12)


@pytest.mark.parametrize("velocity, scale", [([1.0, 0.01, 0.1], "log"), ([0, 0.1, 1], "linear")])
def test_a_sweep_has_one_line_per_pressure_and_marks_what_failed(velocity, scale):
    message = np.array([["", "", ""], ["", "It stopped.", ""]])
    values = {n: np.arange(1.0, 7.0).reshape(2, 3) for n in OBSERVABLES if "standard" not in n}
    # Of one solve a fifth of the contact was not measured.
    doubts = ("slope_in_contact", "unmeasured_area", "unmeasured_friction", "extrapolated_friction")
    values |= dict.fromkeys(doubts, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]))
    axes = {"pressure": np.array([1e5, 2e6]), "velocity": np.array(velocity)}
    figure = plot_sweep(make_results(axes, values, message))
    for axes, label in zip(figure.axes, ["friction coefficient", "contact area"], strict=True):
        assert axes.get_xscale() == scale and axes.get_ylabel().startswith(label)
        lines = [line for line in axes.lines if line.get_linestyle() == "-"]
        assert len(lines) == 2 and all(np.all(np.diff(line.get_xdata()) > 0) for line in lines)
    (crosses,) = (line for line in figure.axes[0].lines if line.get_marker() == "x")
    np.testing.assert_array_equal(crosses.get_xydata(), [[velocity[2], 6.0]])


def made(axes, names=(), failing=()):
    """Results over axes whose friction is the sum of the indices."""
    shape = tuple(len(at) for at in axes.values())
    friction = np.sum(np.indices(shape), axis=0).astype(float)
    values = {n: np.zeros(shape) for n in OBSERVABLES if not n.startswith("reduced")}
    del values["friction_standard_error"]
    values["friction"] = friction
    values["geometric_friction"] = friction
    message = np.full(shape, "", object)
    for index in failing:
        message[index] = "failed: no kernel"
        friction[index] = np.nan
    results = make_results(axes, values, message, master_curve="At 300 K.")
    for name in names:
        results[name] = 10.0 ** (results.temperature - 300) * results.velocity
    return attach(results)


VARIED = {
    "layers[0].thickness": [1e-5, 5e-5], "temperature": [280.0, 300.0, 320.0], "seed": [0, 1],
    "pressure": [1e5], "velocity": [0.1, 0.01, 1.0, 10.0],
}  # fmt: skip


def straight(axes):
    return [line for line in axes.lines if line.get_linestyle() != "None" and len(line.get_xdata())]


def test_seeds_are_a_band_paths_are_colours_and_temperatures_dashes():
    results = made(VARIED, failing=[(0, 0, 1, 0, 0)])
    figure = plot_sweep(results)
    axes = figure.axes[0]
    lines = straight(axes)
    assert len(lines) == 6 and len(axes.collections) == 6
    assert len({line.get_color() for line in lines}) == 2
    assert len({line.get_linestyle() for line in lines}) == 3
    # Velocity 0.01 comes first; the mean over the seeds is half a step above that of the first.
    np.testing.assert_allclose(lines[0].get_ydata(), [1.5, 0, 2.5, 3.5])
    band = axes.collections[0].get_paths()[0].vertices
    assert np.isclose(band[:, 1].max(), 3.95) and np.isclose(band[:, 1].min(), 0)
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["10 µm", "not converged", "50 µm", "280 K", "300 K", "320 K"]


def test_reduced_velocities_shift_each_temperature():
    axes = plot_reduced(made(VARIED, names=["reduced_velocity"])).axes[0]
    np.testing.assert_allclose(straight(axes)[0].get_xdata(), [1e-22, 1e-21, 1e-20, 1e-19])
    with pytest.raises(ValueError, match=r"At 300 K"):
        plot_reduced(made(VARIED))


def test_results_are_compared_by_colour_and_only_over_the_same_axes():
    bare = made({"seed": [0, 1], "pressure": [1e5, 2e5], "velocity": [0.1, 1.0]})
    coated = made({"pressure": [1e5, 2e5], "velocity": [0.1, 1.0, 10.0]})
    axes = plot_compare([bare, coated], ["bare", "coated"]).axes[0]
    assert len({line.get_color() for line in straight(axes)}) == 2
    with pytest.raises(ValueError, match=r"'warm' varies `temperature`.*'bare' `pressure`"):
        plot_compare([bare, made({**VARIED, "layers[0].thickness": [1e-5]})], ["bare", "warm"])
    slow = bare.assign_coords(velocity=bare.velocity.assign_attrs(units="mm/s"))
    with pytest.raises(ValueError, match=r"'slow' has `velocity` in mm/s, and 'bare' in m/s"):
        plot_compare([bare, slow], ["bare", "slow"])


def test_standard_errors_are_bars():
    axes = {"pressure": [1e5], "velocity": [0.1, 1.0, 10.0]}
    results = made(axes)
    error = np.array([[0.1, 0.2, 0.3]])
    known = results.assign(friction_standard_error=(("pressure", "velocity"), error))
    bars, plain = (plot_sweep(one).axes for one in (known, results))
    (container,) = bars[0].containers
    ends = np.array([path.vertices[:, 1] for path in container[2][0].get_paths()])
    np.testing.assert_allclose(ends, results.friction.values.T + error.T * [-1, 1])
    assert not bars[1].containers and not plain[0].containers


def test_the_response_of_a_half_space_is_its_modulus_and_loss_tangent():
    tread = gc.tyre_tread()
    q = np.geomspace(1e2, 1e6, 20)
    figure = plot_response(gc.Stack(base=gc.HalfSpace(tread)), q, [0.1, 1.0])
    stiffness, loss = figure.axes
    modulus = np.asarray(tread.modulus(q * 0.1))
    np.testing.assert_allclose(stiffness.lines[0].get_ydata(), np.abs(modulus) / 0.75, rtol=1e-12)
    np.testing.assert_allclose(loss.lines[0].get_ydata(), modulus.imag / modulus.real, rtol=1e-10)


def test_the_response_refuses_bad_arguments():
    stack = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))
    with pytest.raises(ValueError, match="`q` has shape"):
        plot_response(stack, 1e3, 1.0)
    with pytest.raises(ValueError, match="`velocity"):
        plot_response(stack, np.array([1e3]), 0.0)


def test_a_fit_shows_points_series_limits_and_residuals():
    omega, tread = np.geomspace(1e-2, 1e4, 20), gc.tyre_tread()
    values = np.asarray(tread.modulus(omega)) * np.exp(0.05 * np.sin(np.arange(20)))
    values[3] = values[3].real + 1j * np.nan
    fit = gc.fit_prony(omega, values, terms=4)
    figure = plot_fit(fit)
    above, below = figure.axes
    points, line = above.lines[2], above.lines[3]  # of the loss modulus
    assert len(points.get_xdata()) == 19 and line.get_label() == "loss modulus"
    fine = line.get_xdata()
    np.testing.assert_allclose(
        line.get_ydata(), np.asarray(fit.material.modulus(fine)).imag, rtol=1e-12
    )
    lower, upper = (np.asarray(limit).imag for limit in fit.confidence(fine))
    band = above.collections[1].get_paths()[0].vertices
    assert np.isclose(band[:, 1].min(), lower.min()) and np.isclose(band[:, 1].max(), upper.max())
    fitted = np.asarray(fit.material.modulus(omega)).imag
    residual = 100 * np.delete(np.log(fitted / values.imag), 3)
    np.testing.assert_allclose(below.lines[1].get_ydata(), residual, rtol=1e-9)


def test_a_fit_in_time_shows_what_was_measured():
    time = np.append(0.0, np.geomspace(1e-2, 1e2, 20))
    modulus = 1e6 + 4e6 * np.exp(-time)
    relaxation = plot_fit(gc.fit_relaxation(time, modulus, terms=1)).axes[0]
    np.testing.assert_allclose(
        relaxation.lines[1].get_ydata(), 1e6 + 4e6 * np.exp(-relaxation.lines[1].get_xdata())
    )
    for known in ({}, {"equilibrium": 0}):
        compliance = 1e-6 - 8e-7 * np.exp(-time / 5) + (2e-8 * time if known else 0)
        creep = plot_fit(gc.fit_creep(time, compliance, terms=1, **known)).axes[0]
        assert creep.get_ylabel() == "compliance [1/Pa]"
        x = creep.lines[1].get_xdata()
        exact = 1e-6 - 8e-7 * np.exp(-x / 5) + (2e-8 * x if known else 0)
        np.testing.assert_allclose(creep.lines[1].get_ydata(), exact, rtol=1e-4)


@pytest.mark.parametrize(
    "largest, unit", [(1e-3, "mm"), (0.99e-3, "µm"), (0.0, "m"), (1e-20, "pm")]
)
def test_units_suit_the_size(largest, unit):
    name, factor = unit_of("m", largest)
    assert name == unit
    assert largest in (0, 1e-20) or 1 <= factor * largest * (1 + 1e-12) < 1000


def test_a_sensitivity_is_drawn_by_channel_with_units():
    omega = np.geomspace(1.0, 1e4, 5)
    one = Sensitivity(*map(jnp.asarray, (omega, -np.linspace(0, 1, 5), np.linspace(0, 2, 5))))
    figure = plot_sensitivity({"slow": one, "fast": one})
    loss, storage = figure.axes
    for axes, values in ((loss, one.loss), (storage, one.storage)):
        for line in axes.lines[:2]:
            np.testing.assert_array_equal(line.get_xdata(), omega)
            np.testing.assert_array_equal(line.get_ydata(), values)
