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


def saved(figure, folder) -> int:
    figure.savefig(folder / "figure.png")
    return (folder / "figure.png").stat().st_size


def test_maps_have_units_with_x_to_the_right_and_y_upwards(tmp_path):
    fields, surface = make_fields((8, 16))
    figure = plot_sliding(fields, surface)
    image = figure.axes[0].images[0]
    heights = np.asarray(surface.heights - np.mean(surface.heights))
    np.testing.assert_allclose(image.get_array(), 1e6 * heights.T)
    assert image.origin == "lower"
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels[:3] == ["$x$ [mm]"] * 3
    assert figure.axes[0].get_ylabel() == "$y$ [mm]"
    assert labels[3:] == ["height into the solid [µm]", "contact pressure [MPa]", "gap [µm]"]
    assert saved(figure, tmp_path) > 10_000


def test_a_profile_is_drawn_as_lines(tmp_path):
    figure = plot_sliding(*make_fields((16,)))
    assert [axes.get_ylabel().split("\n")[1] for axes in figure.axes] == ["[µm]", "[MPa]", "[µm]"]
    assert figure.axes[2].get_xlabel() == "$x$ [mm]"
    assert saved(figure, tmp_path) > 10_000


def test_an_outlier_does_not_set_the_scale_and_the_bar_tells_of_it():
    fields, surface = make_fields((32, 32))
    without = plot_sliding(fields, surface)
    heights = surface.heights.at[3, 4].set(-1e-3)
    fields.pressure[5, 6], fields.gap[5, 6] = 2e9, 0.0
    figure = plot_sliding(fields, gc.Surface(heights, surface.grid))
    for before, after in zip(without.axes[:2], figure.axes[:2], strict=False):
        (low, high), (least, most) = (axes.images[0].get_clim() for axes in (before, after))
        assert most - least < 2 * (high - low)
    assert [axes.get_xlabel().split("\n")[1:] for axes in without.axes[3:]] == [[]] * 3
    labels = [axes.get_xlabel().split("\n")[1:] for axes in figure.axes[3:]]
    assert labels == [["outliers down to -999 µm"], ["outliers up to 2 GPa"], []]
    assert [axes.images[0].colorbar.extend for axes in figure.axes[:3]] == ["min", "max", "neither"]


def test_an_outlier_does_not_set_the_scale_of_a_profile():
    fields, surface = make_fields((1000,))
    fields.pressure[7], fields.gap[7] = 2e9, 0.0
    panel = plot_sliding(fields, surface).axes[1]
    assert panel.get_ylabel().endswith("outliers up to 2 GPa")
    assert panel.get_ylim()[1] < 50  # [MPa]; the others reach 15


def test_full_contact_and_none_are_drawn():
    fields, surface = make_fields((8, 8))
    for pressure in (1e6, 0.0):
        uniform = Fields(0 * fields.gap + pressure, 0 * fields.gap, 0 * fields.gap)
        figure = plot_sliding(uniform, surface)
        figure.draw_without_rendering()
        for panel, coloured in zip(figure.axes[1:3], (pressure > 0, pressure == 0), strict=True):
            found = np.isfinite(panel.images[0].get_array().filled(np.nan))
            assert found.all() == found.any() == coloured  # else white


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


def test_at_rest_there_is_no_arrow():
    assert not any(axes.texts for axes in plot_sliding(*make_fields((8, 8)), (0.0, 0.0)).axes)


@pytest.mark.parametrize("velocity, scale", [([1.0, 0.01, 0.1], "log"), ([0, 0.1, 1], "linear")])
def test_a_sweep_has_one_line_per_pressure_and_marks_what_failed(tmp_path, velocity, scale):
    message = np.array([["", "", ""], ["", "It stopped.", ""]])
    values = {n: np.arange(1.0, 7.0).reshape(2, 3) for n in OBSERVABLES if "standard" not in n}
    # Of one solve a fifth of the contact was not measured.
    doubts = ("slope_in_contact", "unmeasured_area", "unmeasured_friction", "extrapolated_friction")
    values |= dict.fromkeys(doubts, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]))
    axes = {"pressure": np.array([1e5, 2e6]), "velocity": np.array(velocity)}
    figure = plot_sweep(make_results(axes, values, message))
    for axes, label in zip(figure.axes, ["friction coefficient", "contact area"], strict=True):
        assert axes.get_xlabel() == "sliding velocity [m/s]"
        assert axes.get_xscale() == scale
        assert axes.get_ylabel().startswith(label)
        lines = [line for line in axes.lines if line.get_linestyle() == "-"]
        assert len(lines) == 2 and all(np.all(np.diff(line.get_xdata()) > 0) for line in lines)
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names == ["100 kPa", "2 MPa", "not converged", "doubtful: see the caveats"]
    (crosses,) = (line for line in figure.axes[0].lines if line.get_marker() == "x")
    np.testing.assert_array_equal(crosses.get_xydata(), [[velocity[2], 6.0]])
    assert saved(figure, tmp_path) > 10_000


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


def test_seeds_are_a_band_paths_are_colours_and_temperatures_dashes(tmp_path):
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
    legend = axes.get_legend()
    assert legend.get_title().get_text() == "layers[0].thickness"
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["10 µm", "not converged", "50 µm", "280 K", "300 K", "320 K"]
    assert saved(figure, tmp_path) > 10_000


def test_without_several_velocities_the_last_axis_with_several_points_is_drawn():
    axes = plot_sweep(made({**VARIED, "velocity": [1.0]})).axes[0]
    assert axes.get_xlabel() == "temperature [K]" and axes.get_xscale() == "linear"
    assert len(straight(axes)) == 2


def test_many_values_take_a_scale_of_colours_and_few_names():
    many = {"temperature": np.linspace(250, 350, 20), "pressure": [1e5], "velocity": [0.1, 1.0]}
    axes = plot_sweep(made(many)).axes[0]
    assert len({tuple(line.get_color()) for line in straight(axes)}) == 20
    assert len(axes.get_legend().get_texts()) == 7


def test_reduced_velocities_shift_each_temperature():
    axes = plot_reduced(made(VARIED, names=["reduced_velocity"])).axes[0]
    assert axes.get_xlabel().endswith("sliding velocity [m/s]") and "a_T" in axes.get_xlabel()
    np.testing.assert_allclose(straight(axes)[0].get_xdata(), [1e-22, 1e-21, 1e-20, 1e-19])
    with pytest.raises(ValueError, match=r"At 300 K"):
        plot_reduced(made(VARIED))


def test_results_are_compared_by_colour_and_only_over_the_same_axes():
    bare = made({"seed": [0, 1], "pressure": [1e5, 2e5], "velocity": [0.1, 1.0]})
    coated = made({"pressure": [1e5, 2e5], "velocity": [0.1, 1.0, 10.0]})
    axes = plot_compare([bare, coated], ["bare", "coated"]).axes[0]
    assert len({line.get_color() for line in straight(axes)}) == 2
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["bare", "coated", "100 kPa", "200 kPa"]
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
    assert bars[0].get_ylim()[1] > 2.3


def test_the_response_of_a_half_space_is_its_modulus_and_loss_tangent(tmp_path):
    tread = gc.tyre_tread()
    q = np.geomspace(1e2, 1e6, 20)
    figure = plot_response(gc.Stack(base=gc.HalfSpace(tread)), q, [0.1, 1.0])
    stiffness, loss = figure.axes
    modulus = np.asarray(tread.modulus(q * 0.1))
    np.testing.assert_allclose(stiffness.lines[0].get_ydata(), np.abs(modulus) / 0.75, rtol=1e-12)
    np.testing.assert_allclose(loss.lines[0].get_ydata(), modulus.imag / modulus.real, rtol=1e-10)
    assert stiffness.get_ylabel().endswith("[Pa]") and loss.get_ylabel() == "loss tangent [1]"
    assert loss.get_xlabel() == "wavenumber $q$ [rad/m]"
    assert saved(figure, tmp_path) > 10_000


def test_the_response_refuses_bad_arguments():
    stack = gc.Stack(base=gc.HalfSpace(gc.tyre_tread()))
    with pytest.raises(ValueError, match="`q` has shape"):
        plot_response(stack, 1e3, 1.0)
    with pytest.raises(ValueError, match="`velocity"):
        plot_response(stack, np.array([1e3]), 0.0)


def test_a_fit_shows_points_series_limits_and_residuals(tmp_path):
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
    assert above.get_ylabel() == "modulus [Pa]" and below.get_xlabel().endswith("[rad/s]")
    assert saved(figure, tmp_path) > 10_000


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
    "largest, unit", [(1e-3, "mm"), (0.99e-3, "µm"), (999.0, "m"), (0.0, "m"), (1e-20, "pm")]
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
        assert axes.get_xlabel().endswith("[rad/s]")
        for line in axes.lines[:2]:
            np.testing.assert_array_equal(line.get_xdata(), omega)
            np.testing.assert_array_equal(line.get_ydata(), values)
    assert "friction" in loss.get_ylabel() and loss.get_ylabel().endswith("[1]")
    assert [text.get_text() for text in loss.get_legend().get_texts()] == ["slow", "fast"]
    assert plot_sensitivity(one).axes[0].get_legend() is None
