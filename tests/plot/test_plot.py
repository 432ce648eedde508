"""Figures without a display: one style, units in every label, and in them what was computed."""

import functools
import importlib
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray

import graded_contact as gc
from graded_contact.core.quantities import quantity_of


def straight(axes):
    return [line for line in axes.lines if line.get_linestyle() != "None" and len(line.get_xdata())]


def make_fields(shape):
    draw = np.random.default_rng(1)
    pressure = np.maximum(draw.normal(size=shape), 0) * 5e6
    fields = SimpleNamespace(pressure=pressure, gap=(pressure == 0) * 3e-6)
    return fields, gc.Surface(1e-6 * draw.normal(size=shape), gc.Grid(shape, 2e-3))


def made(axes, **numbers):
    """Results over axes; all solves succeeded."""
    shape = tuple(len(at) for at in axes.values())
    data = {
        name: (tuple(axes), np.broadcast_to(values, shape).copy())
        for name, values in numbers.items()
    }
    data["message"] = tuple(axes), np.full(shape, "", object)
    results = xarray.Dataset(data, {name: np.asarray(at) for name, at in axes.items()})
    for name, variable in results.variables.items():
        if quantity := quantity_of(name):
            variable.attrs = {"units": quantity.unit, "long_name": quantity.meaning}
    return results


def labels_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("velocity, scale", [([1.0, 0.01, 0.1], "log"), ([0, 0.1, 1], "linear")])
def test_a_sweep_has_a_line_for_each_pressure_and_marks_what_failed(velocity, scale):
    friction = np.arange(1.0, 7.0).reshape(2, 3)
    results = made(
        {"pressure": [1e5, 2e6], "velocity": velocity},
        friction=friction,
        friction_error=0.1 * friction,
        contact_area=friction / 10,
    )
    results["message"][1, 1], results["message"][0, 2] = "It stopped.", "failed: no kernel"
    results["friction"][0, 2] = np.nan
    figure = gc.plot.plot_sweep(results)
    check_labels(figure)
    panel = figure.axes[0]
    assert [axes.get_xscale() for axes in figure.axes] == [scale, scale]
    assert panel.get_ylabel() == "friction coefficient"
    for line, values in zip(straight(panel)[:2], friction, strict=True):
        known = np.isfinite(line.get_ydata())
        np.testing.assert_allclose(np.diff(line.get_xdata()) > 0, True)
        expected = dict(zip(velocity, values, strict=True))
        assert all(expected[x] == y for x, y in line.get_xydata()[known])
    marks = {line.get_label(): line for line in panel.lines if line.get_linestyle() == "None"}
    np.testing.assert_allclose(marks["not converged"].get_xydata(), [[velocity[1], 5.0]])
    assert marks["not converged"].get_markerfacecolor() == "white"
    np.testing.assert_allclose(marks["failed"].get_xydata(), [[velocity[2], 0.0]])
    assert {"mean pressure 100 kPa", "mean pressure 2 MPa", "failed"} <= {*labels_of(figure)}
    bars = panel.collections[0].get_segments()[0]
    np.testing.assert_allclose(np.ptp(bars[:, 1]), 0.2 * bars[:, 1].mean())


def test_lines_over_seeds_are_means_with_their_standard_errors():
    values = np.array([[1.0, 2.0], [2.0, 4.0], [6.0, 9.0]])
    results = made({"seed": [0, 1, 2], "velocity": [0.1, 1.0]}, friction=values)
    results["message"][2, 1] = "failed"
    figure = gc.plot.plot_sweep(results, ["friction"])
    (panel,) = figure.axes
    np.testing.assert_allclose(panel.lines[0].get_ydata(), [3.0, 3.0])
    band = panel.collections[0].get_paths()[0].vertices[:, 1]
    error = np.std(values[:, 0], ddof=1) / np.sqrt(3)  # larger than that of the second
    np.testing.assert_allclose([band.min(), band.max()], [3 - error, 3 + error])
    assert "band: mean of surfaces ± standard error" in labels_of(figure)


def test_several_results_axes_and_numbers_are_drawn_by_one_function():
    """A comparison, a reduced velocity, a leakage with a closed gap, and axes of one's own."""
    axes = {"temperature": [280.0, 300.0], "pressure": [1e5, 1e6], "velocity": [0.1, 1.0]}
    results = made(axes, friction=[1.0, 2.0], leakage_along_x=[[[1e-9], [0.0]]])
    both = xarray.concat([results, 2 * results.drop_vars("message")], "block")
    figure = gc.plot.plot_sweep(both.assign_coords(block=["bare", "coated"]), ["friction"])
    lines = straight(figure.axes[0])
    assert len(lines) == 8 and labels_of(figure)[4].startswith("block coated, temperature 280 K")
    np.testing.assert_array_equal(lines[4].get_ydata(), [2.0, 4.0])
    assert len({line.get_color() for line in lines}) == 2
    assert len({line.get_linestyle() for line in lines}) == 4
    shift = 10.0 ** ((300 - results.temperature) / 10)
    reduced = results.assign(reduced_velocity=shift * results.velocity)
    panel = gc.plot.plot_sweep(reduced, ["friction"], "reduced_velocity").axes[0]
    np.testing.assert_allclose(panel.lines[0].get_xdata(), [10.0, 100.0])
    (panel,) = gc.plot.plot_sweep(results, ["leakage_along_x"], "pressure").axes
    assert panel.get_yscale() == "log" and panel.get_xlabel() == "mean pressure [MPa]"
    closed = [line for line in panel.lines if line.get_marker() == "v"]
    np.testing.assert_allclose(closed[0].get_xydata(), [[1.0, 0.0]])
    own = importlib.import_module("matplotlib.figure").Figure().subplots(1, 2)
    assert gc.plot.plot_sweep(results, ["friction", "leakage_along_x"], axes=own) is own[0].figure
    assert not own[0].figure.legends
    with pytest.raises(ValueError, match="results"):
        gc.plot.plot_sweep(results, ["speed"])
    with pytest.raises(ValueError, match="axes"):
        gc.plot.plot_sweep(results, ["friction"], axes=own)


def test_a_fit_shows_points_series_limits_and_residuals():
    omega, tread = np.geomspace(1e-2, 1e4, 20), gc.tyre_tread()
    values = np.asarray(tread.complex_modulus(omega)) * np.exp(0.05 * np.sin(np.arange(20)))
    values[3] = values[3].real + 1j * np.nan
    fit = gc.fit_prony(omega, values, terms=2)
    figure = gc.plot.plot_fit(fit)
    above, below = figure.axes
    points, line = above.lines[2], above.lines[3]  # of the loss modulus
    assert len(points.get_xdata()) == 19 and line.get_label() == "loss modulus"
    fine = line.get_xdata()
    np.testing.assert_allclose(
        line.get_ydata(), fit.material.complex_modulus(fine).imag, rtol=1e-12
    )
    lower, upper = (np.asarray(limit).imag for limit in fit.confidence(fine))
    band = above.collections[1].get_paths()[0].vertices
    assert np.isclose(band[:, 1].min(), lower.min()) and np.isclose(band[:, 1].max(), upper.max())
    fitted = np.asarray(fit.material.complex_modulus(omega)).imag
    residual = 100 * np.delete(np.log(fitted / values.imag), 3)
    np.testing.assert_allclose(below.lines[1].get_ydata(), residual, rtol=1e-9)


# Labels without a unit: of counts and of dimensionless numbers.
BARE = (
    "", "evaluation", "objective", "constraint (0 or more allowed)", "parameter / result",
    "friction coefficient", "contact area fraction", "time over the period",
    r"$\log_{10} a_T$", "$b_T$", "loss tangent",
)  # fmt: skip


def check_labels(figure):
    """Every axis has a label, and that a unit unless the numbers have no dimension."""
    for axes in figure.axes:
        labels = axes.get_xlabel(), axes.get_ylabel()
        assert not any("[1]" in label for label in labels)
        assert any(labels), "a panel without labels"
        assert all(label in BARE or re.search(r"\[[^\]]+\]", label) for label in labels), labels


def disc(n=40):
    """A round contact of radius 1 m, a quarter of the cell's edge."""
    x = (np.arange(n) + 0.5) * 4 / n
    r = np.hypot(*np.meshgrid(x - 2, x - 2, indexing="ij"))
    pressure, gap = 2e6 * np.maximum(1 - r**2, 0), 1e-6 * np.maximum(r**2 - 1, 0)
    return SimpleNamespace(pressure=pressure, gap=gap), gc.Surface(
        -1e-6 * r**2, gc.Grid((n, n), 4.0)
    )


def test_a_contact_has_an_outline_on_maps_and_is_thick_on_a_profile():
    figure = gc.plot.plot_sliding(*disc())
    check_labels(figure)
    (outline,) = figure.axes[0].collections[0].get_paths()
    radius = np.hypot(*(outline.vertices - 2).T)
    np.testing.assert_allclose(radius, 1, atol=0.05)  # half a spacing
    fields, surface = make_fields((8, 16))
    image = gc.plot.plot_sliding(fields, surface).axes[0].images[0]
    heights = np.asarray(surface.heights - np.mean(surface.heights))
    np.testing.assert_allclose(image.get_array(), 1e6 * heights.T)
    assert image.origin == "lower"  # x to the right, y upwards
    figure = gc.plot.plot_sliding(*make_fields((16,)))
    check_labels(figure)
    heights, contact = (line.get_ydata() for line in figure.axes[0].lines)
    touching = np.isfinite(contact)
    np.testing.assert_array_equal(touching, make_fields((16,))[0].pressure > 0)
    np.testing.assert_array_equal(contact[touching], heights[touching])


def test_a_figure_takes_the_contact_of_the_law():
    """A soft wall has pressure everywhere, and contact where the gap is below its edge."""
    law, gap = gc.RepulsiveLJ(1e-6, 1e5), 1e-6 * np.linspace(1.0, 4.0, 16)
    fields = SimpleNamespace(pressure=1e5 * (1e-6 / gap) ** 9, gap=gap, law=law)
    surface = gc.Surface(gap, gc.Grid((16,), 1.0))
    contact = gc.plot.plot_sliding(fields, surface).axes[0].lines[1].get_ydata()
    touches = gap < float(law.contact_gap) * 1e-6
    np.testing.assert_array_equal(np.isfinite(contact), touches)
    shown = gc.plot.plot_sliding(fields, surface).axes[2].lines[0].get_ydata()
    np.testing.assert_allclose(shown, np.where(touches, 0, 1e6 * gap))


OMEGA, TEMPERATURES = np.geomspace(0.1, 10, 6), (290.0, 300.0, 310.0)
MATERIAL = gc.Prony(1e6, [1e7, 5e7], [1e-1, 1e-3], shift=gc.WLF(6.0, 110.0, 300.0))


@functools.cache
def moduli():
    return [t / 300 * np.asarray(MATERIAL.at(t).complex_modulus(OMEGA)) for t in TEMPERATURES]


@pytest.fixture(scope="module")
def curve():
    isotherms = [(t, OMEGA, values) for t, values in zip(TEMPERATURES, moduli(), strict=True)]
    return gc.master_curve(isotherms, vertical_shift_std=0.1, terms=2)


def test_a_master_curve_shows_isotherms_before_and_after_shifts_and_law(curve):
    figure = gc.plot.plot_master_curve(curve)
    check_labels(figure)
    before, after, along, across = figure.axes
    for line, values in zip(before.lines, moduli(), strict=False):
        np.testing.assert_allclose(line.get_data(), (OMEGA, values.real))
    for panel in (before, after):
        assert len({tuple(line.get_color()) for line in panel.lines[:3]}) == 3
    moved = [line.get_xdata() for line in after.lines[:3]]
    factors = 10 ** np.asarray(curve.log10_shifts)
    np.testing.assert_allclose(moved, factors[:, None] * OMEGA, rtol=1e-9)
    points = [line for axes in (along, across) for line in axes.lines if len(line.get_xdata()) == 1]
    drawn = {(float(p.get_xdata()[0]), float(p.get_ydata()[0])) for p in points}
    for values in (curve.log10_shifts, curve.vertical_shifts):
        celsius = (kelvin - 273.15 for kelvin in TEMPERATURES)
        assert drawn >= set(zip(celsius, map(float, values), strict=True))
    law = next(line for line in along.lines if line.get_label() == "WLF law")
    np.testing.assert_allclose(law.get_ydata()[-1], np.log10(curve.law.factor(310.0)), rtol=1e-6)


# Motions in time ------------------------------------------------------------------------------

TIMES = np.arange(8) / 8
MOVED = 1e-4 * np.sin(2 * np.pi * TIMES)


def made_cycle(displacement=MOVED, **fields):
    problem = SimpleNamespace(displacement=displacement, times=2.0 * TIMES, period=2.0)
    numbers = {"friction": np.cos(2 * np.pi * TIMES), "contact_area": 0.1 + 0.01 * TIMES}
    return SimpleNamespace(problem=problem, **numbers, **fields)


def test_the_loop_along_x_is_closed_and_has_units():
    figure = gc.plot.plot_cycle(made_cycle())
    check_labels(figure)
    loop, over_time, area = figure.axes
    x, y = loop.lines[0].get_data()
    np.testing.assert_allclose(x, np.append(1e6 * MOVED, 0), atol=1e-12)
    assert loop.get_xlabel() == "displacement [µm]" and y[0] == y[-1] == 1.0
    assert over_time.lines[0].get_xdata()[-1] == 1.0 and area.get_ylim()[0] == 0
    drift = gc.plot.plot_cycle(made_cycle(1e-3 * TIMES)).axes[0].lines[0]
    assert len(drift.get_xdata()) == 8  # not closed
    results = made({"velocity": [0.1]}).assign(
        surface_displacement=("time", MOVED, {"units": "m"}),
        friction=(("velocity", "time"), np.cos(2 * np.pi * TIMES)[None]),
        contact_area=(("velocity", "time"), TIMES[None]),
        peak_friction_error=("velocity", [0.1]),
        time=TIMES,
    )
    for panel in gc.plot.plot_cycle(results).axes[:2]:
        ends = panel.collections[0].get_paths()[0].vertices[:, 1]
        np.testing.assert_allclose([ends.min(), ends.max()], [-1.1, 1.1])
    with pytest.raises(ValueError, match="displacement"):
        gc.plot.plot_cycle(made_cycle(np.zeros((8, 2))))


def test_a_transient_is_drawn_over_time_and_at_rest_without_friction():
    times = np.array([1.0, 10.0, 3600.0])
    moving = made_cycle(np.zeros(3))
    moving.problem = SimpleNamespace(displacement=np.array([0.0, 1e-4, 2e-4]), times=times)
    moving.friction, moving.contact_area = np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.1, 0.2])
    moving.load, moving.mean_gap = np.full(3, 2e5), np.array([3e-6, 2e-6, 1e-6])
    moving.time_since_change = times
    figure = gc.plot.plot_transient(moving)
    check_labels(figure)
    np.testing.assert_allclose(figure.axes[0].lines[0].get_xydata()[-1], [1.0, 0.3])
    np.testing.assert_allclose(figure.axes[3].lines[0].get_ydata(), [3, 2, 1])
    assert figure.axes[0].get_xlabel() == "time [h]" and figure.axes[0].get_xscale() == "log"
    moving.problem.displacement = np.zeros(3)
    assert len(gc.plot.plot_transient(moving).axes) == 3


def test_a_leakage_over_time_has_bars_where_it_is_known():
    leakage = np.array([np.nan, 2e-9, np.nan, 1e-9, 0.0])
    numbers = {"leakage_along_x": leakage, "leakage_along_x_error": 0.1 * leakage}
    results = xarray.Dataset({name: ("time", at) for name, at in numbers.items()})
    results = results.assign(message=((), "")).assign_coords(time=np.arange(1.0, 6.0))
    (panel,) = gc.plot.plot_sweep(results, ["leakage_along_x"]).axes
    (bars,) = panel.collections
    ends = np.array([bar[:, 1] for bar in bars.get_segments() if len(bar)])
    np.testing.assert_allclose(ends, [[1.8e-9, 2.2e-9], [0.9e-9, 1.1e-9]])


@pytest.mark.parametrize("shape", [(16,), (8, 8)])
def test_a_film_has_one_scale(shape):
    pressure = np.random.default_rng(0).uniform(-1, 1, (8, *shape)).clip(0) * 4e6
    surface = gc.Surface(np.zeros(shape), gc.Grid(shape, 1e-3))
    figure = gc.plot.plot_film(made_cycle(pressure=pressure), surface)
    titles = [axes.get_title() for axes in figure.axes[:4]]
    # Each frame has its own load, where the load changes.
    for title, i in zip(titles, (0, 2, 4, 6), strict=True):
        time, load, unit = re.fullmatch(r"\$t/T\$ = (\S+), (\S+) (k|M)Pa", title).groups()
        assert float(time) == i / 8
        mean = pressure[i].mean() / {"k": 1e3, "M": 1e6}[unit]
        np.testing.assert_allclose(float(load), mean, rtol=5e-3)
    same = made_cycle(pressure=pressure / pressure.mean(axis=tuple(range(1, pressure.ndim)),
                                                        keepdims=True))  # fmt: skip
    assert gc.plot.plot_film(same, surface).axes[0].get_title() == "$t/T$ = 0"
    one = gc.plot.plot_film(made_cycle(pressure=pressure), surface, [3])
    for axes in (one.axes[0], *figure.axes[:4]):
        high = axes.images[0].norm.vmax if len(shape) == 2 else axes.get_ylim()[1] / 1.05
        np.testing.assert_allclose(high, pressure.max() / 1e6)


def test_a_search_shows_its_starts_constraints_and_parameters():
    runs = []
    for best in (1.0, 0.5):
        run = gc.design.Descent(
            values=np.array([2.0, best]),
            parameters=np.array([[2e-5, 4.0], [1e-5, 2.0]]),
            margins=np.array([[-0.1], [0.2]]),
            converged=True,
            message="",
        )
        runs.append(run)
    parameters = {"skin": {"thickness": 1e-5}, "speeds": np.array([2.0])}
    design = SimpleNamespace(
        runs=runs, best=runs[1], parameters=parameters, constraints={"cost": 0.2}
    )
    figure = gc.plot.plot_search(design)
    check_labels(figure)
    value, limit, ratio = figure.axes
    np.testing.assert_array_equal(value.lines[1].get_ydata(), [2.0, 0.5])
    assert value.lines[1].get_color() != value.lines[0].get_color()
    np.testing.assert_array_equal(limit.lines[0].get_ydata(), [-0.1, 0.2])
    np.testing.assert_array_equal(ratio.lines[0].get_ydata(), [2.0, 1.0])
    assert labels_of(figure) == ["(b) cost", "(c) skin.thickness", "(c) speeds[0]"]
