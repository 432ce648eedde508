"""Figures without a display: one style, units in every label, and in them what was computed."""

import dataclasses
import functools
import itertools
import math
import re
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
import xarray
from scipy.integrate import trapezoid

import graded_contact as gc
from graded_contact.core.quantities import numbers_of
from graded_contact.scenes.collect import surface_variables
from graded_contact.studies.dataset import attach


def straight(axes):
    return [line for line in axes.lines if line.get_linestyle() != "None" and len(line.get_xdata())]


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
    fields = SimpleNamespace(pressure=pressure, gap=(pressure == 0) * 3e-6)
    return fields, gc.Surface(1e-6 * draw.normal(size=shape), gc.Grid(shape, 2e-3))


@pytest.mark.parametrize("velocity, scale", [([1.0, 0.01, 0.1], "log"), ([0, 0.1, 1], "linear")])
def test_a_sweep_has_one_line_per_pressure_and_marks_what_failed(velocity, scale):
    message = np.array([["", "", ""], ["", "It stopped.", ""]])
    values = {n: np.arange(1.0, 7.0).reshape(2, 3) for n in numbers_of("steady")}
    # Of one solve a fifth of the contact was not measured.
    doubts = ("slope_in_contact", "unmeasured_area", "unmeasured_friction", "extrapolated_friction")
    values |= dict.fromkeys(("compression", "friction_grid_error"), np.zeros((2, 3)))
    values |= dict.fromkeys(doubts, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]))
    axes = {"pressure": np.array([1e5, 2e6]), "velocity": np.array(velocity)}
    figure = gc.plot.plot_sweep(make_results(axes, values, message))
    for axes, label in zip(figure.axes, ["friction coefficient", "contact area"], strict=True):
        assert axes.get_xscale() == scale and axes.get_ylabel().startswith(label)
        lines = straight(axes)
        assert len(lines) == 2 and all(np.all(np.diff(line.get_xdata()) > 0) for line in lines)
    (crosses,) = (line for line in figure.axes[0].lines if line.get_marker() == "x")
    np.testing.assert_array_equal(crosses.get_xydata(), [[velocity[2], 6.0]])
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    reason = "20% of the friction arises on points that were filled or tapered, not measured"
    assert f"doubtful: {reason}" in legend


def made(axes, names=(), failing=()):
    """Results over axes whose friction is the sum of the indices."""
    shape = tuple(len(at) for at in axes.values())
    friction = np.sum(np.indices(shape), axis=0).astype(float)
    values = {n: np.zeros(shape) for n in numbers_of("steady")}
    values |= {"friction": friction, "friction_grid_error": 0.01 * friction}
    message = np.full(shape, "", object)
    for index in failing:
        message[index] = "failed: no kernel"
        friction[index] = values["slope_in_contact"][index] = np.nan
    scene = "[[layers]]\nmaterial = 'coat'"
    results = make_results(axes, values, message, master_curve="At 300 K.", scene=scene)
    for name in names:
        results[name] = 10.0 ** (results.temperature - 300) * results.velocity
    return attach(results)


VARIED = {
    "layers[0].thickness": [1e-5, 5e-5], "temperature": [280.0, 300.0, 320.0], "seed": [0, 1],
    "pressure": [1e5], "velocity": [0.1, 0.01, 1.0, 10.0],
}  # fmt: skip


PAIRED = {**VARIED, "pressure": [1e5, 3e5], "velocity": [0.1, 1.0], "temperature": [280.0, 300.0]}


PAIRS = [*itertools.combinations(PAIRED, 2)]
CIRCLE = [*zip(PAIRED, [*PAIRED][1:] + [*PAIRED][:1], strict=True)]
OFTEN = [*((pair, (2, 2)) for pair in PAIRS), *((pair, (2, 1)) for pair in CIRCLE)]
OFTEN += [(PAIRS[0], (1, 1))]
SELDOM = [(pair, (2, 1)) for pair in itertools.permutations(PAIRED, 2) if pair not in CIRCLE]
SELDOM += [(pair, (1, 1)) for pair in PAIRS[1:]]


def test_the_response_of_a_half_space_is_its_modulus_and_loss_tangent():
    tread = gc.tyre_tread()
    q = np.geomspace(1e2, 1e6, 20)
    figure = gc.plot.plot_response(gc.Stack(base=gc.HalfSpace(tread)), q, [0.1, 1.0])
    stiffness, loss = figure.axes
    modulus = np.asarray(tread.modulus(q * 0.1))
    np.testing.assert_allclose(stiffness.lines[0].get_ydata(), np.abs(modulus) / 0.75, rtol=1e-12)
    np.testing.assert_allclose(loss.lines[0].get_ydata(), modulus.imag / modulus.real, rtol=1e-10)
    with pytest.raises(ValueError, match="`velocity"):
        gc.plot.plot_response(gc.Stack(base=gc.HalfSpace(tread)), q, 0.0)


def test_a_fit_shows_points_series_limits_and_residuals():
    omega, tread = np.geomspace(1e-2, 1e4, 20), gc.tyre_tread()
    values = np.asarray(tread.modulus(omega)) * np.exp(0.05 * np.sin(np.arange(20)))
    values[3] = values[3].real + 1j * np.nan
    fit = gc.fit_prony(omega, values, terms=4)
    figure = gc.plot.plot_fit(fit)
    above, below = figure.axes
    points, line = above.lines[2], above.lines[3]  # of the loss modulus
    assert len(points.get_xdata()) == 19 and line.get_label() == "loss modulus"
    fine = line.get_xdata()
    np.testing.assert_allclose(line.get_ydata(), fit.material.modulus(fine).imag, rtol=1e-12)
    lower, upper = (np.asarray(limit).imag for limit in fit.confidence(fine))
    band = above.collections[1].get_paths()[0].vertices
    assert np.isclose(band[:, 1].min(), lower.min()) and np.isclose(band[:, 1].max(), upper.max())
    fitted = np.asarray(fit.material.modulus(omega)).imag
    residual = 100 * np.delete(np.log(fitted / values.imag), 3)
    np.testing.assert_allclose(below.lines[1].get_ydata(), residual, rtol=1e-9)


def test_a_fit_in_time_shows_what_was_measured():
    time = np.append(0.0, np.geomspace(1e-2, 1e2, 20))
    modulus = 1e6 + 4e6 * np.exp(-time)
    relaxation = gc.plot.plot_fit(gc.fit_prony(time, modulus, kind="relaxation", terms=1)).axes[0]
    x, y = relaxation.lines[1].get_data()
    np.testing.assert_allclose(y, 1e6 + 4e6 * np.exp(-x))
    for known in ({}, {"equilibrium": 0}):
        compliance = 1e-6 - 8e-7 * np.exp(-time / 5) + (2e-8 * time if known else 0)
        creep = gc.plot.plot_fit(
            gc.fit_prony(time, compliance, kind="creep", terms=1, **known)
        ).axes[0]
        assert creep.get_ylabel() == "compliance [1/Pa]"
        x, y = creep.lines[1].get_data()
        exact = 1e-6 - 8e-7 * np.exp(-x / 5) + (2e-8 * x if known else 0)
        np.testing.assert_allclose(y, exact, rtol=1e-4)


# Labels without a unit: of counts and of dimensionless numbers.
BARE = (
    "", "evaluation", "objective", "constraint (0 or more allowed)", "parameter / result",
    "friction coefficient", "contact area fraction", "friction of waves up to $q$",
    r"$\mathrm{d}\mu/\mathrm{d}\ln q$", r"$\log_{10} a_T$", "$b_T$", "loss tangent",
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


def theory(mean=4e5, spread=9e5):
    """A mean field whose pressure has spread this far."""
    zeros = {field.name: jnp.zeros(()) for field in dataclasses.fields(gc.mean_field.MeanField)}
    curve = gc.surfaces.CutoffCurve(jnp.array([1.0, 2.0]), jnp.zeros(2))
    variance = jnp.array([0.0, spread**2])
    known = {"against_cutoff": curve, "stress_variance": variance, "pressure": jnp.array(mean)}
    return gc.mean_field.MeanField(**zeros | known | {"heated": None})


def test_distributions_enclose_the_area_and_perssons_the_mean_pressure():
    """∫P dσ = erf(σ0/√(2V)) and ∫σ P dσ = σ0, in closed form."""
    fields, _ = disc()
    figure = gc.plot.plot_distributions(fields, theory())
    check_labels(figure)
    pressure, gap = figure.axes
    touching = np.mean(fields.pressure > 0)
    for axes, share in ((pressure, touching), (gap, 1 - touching)):
        steps = axes.patches[1].get_data()
        np.testing.assert_allclose(np.sum(steps.values * np.diff(steps.edges)), share, rtol=5e-3)
    stress, density = pressure.lines[0].get_data()
    assert pressure.get_xlabel().endswith("[MPa]")
    area, load = trapezoid(density, stress), trapezoid(stress * density, stress)
    np.testing.assert_allclose(area, math.erf(4e5 / 9e5 / math.sqrt(2)), rtol=1e-3)
    np.testing.assert_allclose(load, 0.4, rtol=1e-3)
    for without in (None, theory(spread=np.nan)):  # a mean field that failed is not drawn
        assert not gc.plot.plot_distributions(fields, without).axes[0].lines


def test_dissipation_is_the_slope_of_the_friction_and_encloses_it():
    q = np.geomspace(1e3, 1e6, 64)
    curve = gc.surfaces.CutoffCurve(jnp.asarray(q), jnp.asarray(0.1 * np.log(q / 1e3)))
    figure = gc.plot.plot_dissipation({"contact": curve, "mean field": curve})
    check_labels(figure)
    total, each = figure.axes
    np.testing.assert_allclose(total.lines[0].get_ydata(), curve.friction)
    steps = each.patches[0].get_data()
    np.testing.assert_allclose(steps.values, 0.1, rtol=1e-6)
    assert len(steps.edges) == 31 and steps.edges[0] == 1e3


OMEGA, TEMPERATURES = np.geomspace(0.1, 10, 6), (290.0, 300.0, 310.0)
MATERIAL = gc.Prony(1e6, [1e7, 5e7], [1e-1, 1e-3], shift=gc.WLF(6.0, 110.0, 300.0))


@functools.cache
def moduli():
    return [t / 300 * np.asarray(MATERIAL.at(t).modulus(OMEGA)) for t in TEMPERATURES]


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


def test_a_van_gurp_palmen_plot_shows_phase_angles_as_measured(curve, tmp_path):
    rows = [f"{t - 273.15},{w / 2 / np.pi},{e.real / 1e6},{e.imag / 1e6}"
            for t, values in zip(TEMPERATURES, moduli(), strict=True)
            for w, e in zip(OMEGA, values, strict=True)]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(["T [°C],f [Hz],E' [MPa],E'' [MPa]", *rows]))
    for isotherms in (curve, gc.read_moduli(tmp_path / "a.csv")):
        figure = gc.plot.plot_van_gurp_palmen(isotherms)
        check_labels(figure)
        axes, bar = figure.axes
        assert bar.get_ylabel() == "temperature [°C]" and axes.get_xlabel() == "$|E^*|$ [MPa]"
        for line, values in zip(axes.lines, moduli(), strict=False):
            size, angle = line.get_data()
            np.testing.assert_allclose(1e6 * size, np.abs(values), rtol=1e-9)
            np.testing.assert_allclose(angle, np.rad2deg(np.angle(values)), rtol=1e-9)
    time = np.geomspace(1e-2, 1e2, 9)
    relaxing = [(t, time, 1e6 + t * 1e3 * np.exp(-time)) for t in TEMPERATURES[:2]]
    relaxation = gc.master_curve(relaxing, kind="relaxation", terms=1, shift_std=0)
    with pytest.raises(ValueError, match=r"`isotherms` is of kind 'relaxation'"):
        gc.plot.plot_van_gurp_palmen(relaxation)


# Motions in time ------------------------------------------------------------------------------

TIMES = np.arange(8) / 8
MOVED = 1e-4 * np.sin(2 * np.pi * TIMES)


def made_cycle(displacement=MOVED, errors=(), **fields):
    fields["kept"] = SimpleNamespace(numbers=dict(errors))
    numbers = {"friction": np.cos(2 * np.pi * TIMES), "contact_area": 0.1 + 0.01 * TIMES}
    return SimpleNamespace(kind="cycle", displacement=displacement, **numbers, **fields)


def test_the_loop_along_x_is_closed_and_has_units():
    loop, over_time, area = gc.plot.plot_cycle(made_cycle()).axes
    x, y = loop.lines[0].get_data()
    place = 1e6 * MOVED
    np.testing.assert_allclose(x, np.append(place, 0), atol=1e-12)
    assert loop.get_xlabel() == "displacement [µm]" and y[0] == y[-1] == 1.0
    assert over_time.lines[0].get_xdata()[-1] == 1.0 and area.get_ylim()[0] == 0
    drift = gc.plot.plot_cycle(made_cycle(1e-3 * TIMES)).axes[0].lines[0]
    assert len(drift.get_xdata()) == 8  # not closed
    assert not (loop.collections or over_time.collections)  # no error is known
    known = made_cycle(errors={"peak_friction_error": 0.1})
    for axes, x in zip(gc.plot.plot_cycle(known).axes[:2], (place, TIMES), strict=True):
        (band,) = axes.collections
        ends = band.get_paths()[0].vertices
        for end in (-0.1, 0.1):
            expected = np.stack([x, np.cos(2 * np.pi * TIMES) + end], axis=1)
            gaps = np.linalg.norm(ends[:, None] - expected, axis=-1)
            assert np.max(np.min(gaps, axis=0)) < 1e-12
    with pytest.raises(ValueError, match="a motion along x is needed"):
        gc.plot.plot_cycle(made_cycle(np.zeros((8, 2))))


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
