"""Figures for papers: one style, units in every label, and in the figures what was computed."""

import base64
import math
import re
from typing import NamedTuple

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from scipy.integrate import trapezoid

import graded_contact as gc


class Fields(NamedTuple):
    """The fields of a contact that figures need."""

    pressure: np.ndarray
    gap: np.ndarray
    displacement: np.ndarray


BARE = ("", "evaluation", "objective", "constraint (0 or more allowed)")  # labels without a unit


def check_labels(figure):
    """Every axis has a label, and that a unit."""
    for axes in figure.axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert label in BARE or re.search(r"\[[^\]]+\]", label), label
        shown = [axes.get_xlabel(), axes.get_ylabel()]
        assert any(shown), "a panel without labels"


def disc(n=40):
    """A round contact of radius 1 m, a quarter of the cell's edge."""
    x = (np.arange(n) + 0.5) * 4 / n
    r = np.hypot(*np.meshgrid(x - 2, x - 2, indexing="ij"))
    pressure, gap = 2e6 * np.maximum(1 - r**2, 0), 1e-6 * np.maximum(r**2 - 1, 0)
    return Fields(pressure, gap, 0 * gap), gc.Surface(-1e-6 * r**2, gc.Grid((n, n), 4.0))


def test_a_figure_is_the_same_whatever_the_user_has_set_and_leaves_that_alone(tmp_path):
    def drawn(name):
        gc.plot.plot_outline(*disc()).savefig(tmp_path / name)
        return (tmp_path / name).read_bytes()

    plain = drawn("plain.svg")
    with matplotlib.rc_context({"font.size": 30, "axes.facecolor": "black", "svg.hashsalt": "a"}):
        before = dict(matplotlib.rcParams)
        other = drawn("other.svg")
        assert dict(matplotlib.rcParams) == before
    dates = re.compile(rb"<dc:date>.*?</dc:date>")
    assert dates.sub(b"", plain) == dates.sub(b"", other)


def test_fonts_in_a_pdf_are_truetype(tmp_path):
    gc.plot.plot_outline(*disc()).savefig(tmp_path / "a.pdf")
    content = (tmp_path / "a.pdf").read_bytes()
    assert b"/FontFile2" in content and b"/Type3" not in content


def test_the_outline_of_a_contact_runs_between_its_points_and_the_others():
    figure = gc.plot.plot_outline(*disc())
    check_labels(figure)
    axes = figure.axes[0]
    (outline,) = axes.collections[0].get_paths()
    radius = np.hypot(*(outline.vertices - 2).T)
    np.testing.assert_allclose(radius, 1, atol=0.05)  # half a spacing
    assert axes.get_xlabel() == "$x$ [m]" and figure.axes[1].get_ylabel().endswith("[µm]")


def theory(mean=4e5, spread=9e5):
    """A mean field whose pressure has spread this far."""
    zero = jnp.zeros(())
    curve = gc.contacts.CutoffCurve(jnp.array([1.0, 2.0]), jnp.zeros(2))
    variance = jnp.array([0.0, spread**2])
    return gc.contacts.MeanField(zero, zero, curve, variance, jnp.array(mean), zero, zero)


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
    assert not gc.plot.plot_distributions(fields).axes[0].lines


def test_dissipation_is_the_slope_of_the_friction_and_encloses_it():
    q = np.geomspace(1e3, 1e6, 64)
    curve = gc.contacts.CutoffCurve(jnp.asarray(q), jnp.asarray(0.1 * np.log(q / 1e3)))
    figure = gc.plot.plot_dissipation({"contact": curve, "mean field": curve})
    check_labels(figure)
    total, each = figure.axes
    np.testing.assert_allclose(total.lines[0].get_ydata(), curve.friction)
    steps = each.patches[0].get_data()
    np.testing.assert_allclose(steps.values, 0.1, rtol=1e-6)
    assert len(steps.edges) == 31 and steps.edges[0] == 1e3


OMEGA, TEMPERATURES = np.geomspace(0.1, 10, 6), (290.0, 300.0, 310.0)
MATERIAL = gc.Prony(1e6, [1e7, 5e7], [1e-1, 1e-3], shift=gc.WLF(6.0, 110.0, 300.0))
MODULI = [t / 300 * np.asarray(MATERIAL.at(t).modulus(OMEGA)) for t in TEMPERATURES]


@pytest.fixture(scope="module")
def curve():
    isotherms = [(t, OMEGA, values) for t, values in zip(TEMPERATURES, MODULI, strict=True)]
    return gc.master_curve(isotherms, vertical_shift_std=0.1, terms=2)


def test_a_master_curve_shows_isotherms_before_and_after_shifts_and_law(curve):
    figure = gc.plot.plot_master_curve(curve)
    check_labels(figure)
    before, after, along, across = figure.axes
    for line, values in zip(before.lines, MODULI, strict=False):
        np.testing.assert_allclose(line.get_data(), (OMEGA, values.real))
    for panel in (before, after):
        assert len({tuple(line.get_color()) for line in panel.lines[:3]}) == 3
    moved = [line.get_xdata() for line in after.lines[:3]]
    factors = 10 ** np.asarray(curve.log10_shifts)
    np.testing.assert_allclose(moved, factors[:, None] * OMEGA, rtol=1e-9)
    points = [line for axes in (along, across) for line in axes.lines if len(line.get_xdata()) == 1]
    drawn = {(float(p.get_xdata()[0]), float(p.get_ydata()[0])) for p in points}
    for values in (curve.log10_shifts, curve.vertical_shifts):
        assert drawn >= set(zip(TEMPERATURES, map(float, values), strict=True))
    law = next(line for line in along.lines if line.get_label() == "WLF")
    np.testing.assert_allclose(law.get_ydata()[-1], np.log10(curve.law.factor(310.0)), rtol=1e-6)


def test_a_van_gurp_palmen_plot_shows_phase_angles_as_measured(curve, tmp_path):
    rows = [f"{t - 273.15},{w / 2 / np.pi},{e.real / 1e6},{e.imag / 1e6}"
            for t, values in zip(TEMPERATURES, MODULI, strict=True)
            for w, e in zip(OMEGA, values, strict=True)]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(["T [°C],f [Hz],E' [MPa],E'' [MPa]", *rows]))
    for isotherms in (curve, gc.read_moduli(tmp_path / "a.csv")):
        figure = gc.plot.plot_van_gurp_palmen(isotherms)
        check_labels(figure)
        axes, bar = figure.axes
        assert bar.get_ylabel() == "temperature [K]" and axes.get_xlabel() == "$|E^*|$ [MPa]"
        for line, values in zip(axes.lines, MODULI, strict=False):
            size, angle = line.get_data()
            np.testing.assert_allclose(1e6 * size, np.abs(values), rtol=1e-9)
            np.testing.assert_allclose(angle, np.rad2deg(np.angle(values)), rtol=1e-9)
    time = np.geomspace(1e-2, 1e2, 9)
    relaxing = [(t, time, 1e6 + t * 1e3 * np.exp(-time)) for t in TEMPERATURES[:2]]
    relaxation = gc.master_curve(relaxing, kind="relaxation", terms=1, shift_std=0)
    with pytest.raises(ValueError, match=r"`isotherms` is of kind 'relaxation'"):
        gc.plot.plot_van_gurp_palmen(relaxation)


def test_the_history_of_a_design_shows_what_was_tried():
    design = gc.minimise(
        lambda x: (jnp.log(x["a"]) - 1) ** 2 + x["b"],
        {"a": 0.1, "b": 0.5}, {"a": 10.0, "b": 2.0},
        constraints=lambda x: 1 - x["a"] / 2, num_starts=2,
    )  # fmt: skip
    figure = gc.plot.plot_history(design)
    check_labels(figure)
    value, limits, parameters = figure.axes
    assert len(value.lines) == 2
    history = design.best.history
    assert len(history.values) == design.best.num_evaluations
    np.testing.assert_allclose(
        history.values, (np.log(history.parameters[:, 0]) - 1) ** 2 + history.parameters[:, 1]
    )
    np.testing.assert_allclose(history.margins[:, 0], 1 - history.parameters[:, 0] / 2)
    np.testing.assert_array_equal(limits.lines[0].get_ydata(), history.margins[:, 0])
    shown = {line.get_label(): line.get_ydata() for line in parameters.lines}
    np.testing.assert_allclose(shown["a"], history.parameters[:, 0] / design.parameters["a"])


def test_a_slider_holds_every_figure_and_shows_the_middle_one_without_html():
    def draw(radius):
        fields, surface = disc(16)
        return gc.plot.plot_outline(fields, gc.Surface(radius * surface.heights, surface.grid))

    shown = gc.plot.slider(draw, [1.0, 2.0, 4.0], "radius [µm]")
    bundle = shown._repr_mimebundle_()
    assert bundle["text/html"].count("<img") == 3 and bundle["text/html"].count(" hidden>") == 2
    assert "<output>radius [µm]: 2</output>" in bundle["text/html"]
    assert base64.b64decode(bundle["image/png"]) == shown.pictures[1]
    assert all(picture.startswith(b"\x89PNG") for picture in shown.pictures)
    with pytest.raises(ValueError, match="`values` has shape"):
        gc.plot.slider(draw, [], "radius [µm]")
