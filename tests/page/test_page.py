"""The page without a browser: it has the numbers of its scene, and moves, pins and saves.

`gc.page` imports panel, which takes seconds: only where these tests run.
"""

import asyncio
from functools import partial
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import graded_contact as gc
from graded_contact.scenes import parse_scene

SCENE = """# A comment that stays.
title = "Two coats <of one rubber>"
[surface]
kind = "self_affine"
rms_slope = 0.1
hurst = 0.8
q_roll = 1.3e4
q_high = 4e4
[grid]
shape = [16, 16]
size = 1e-3
[materials.coat]   # lossless
kind = "elastic"
modulus = 6e6      # measured
poisson = 0.49
[materials.rubber]
kind = "prony"
equilibrium = 2e6
strengths = [8e6, 3e6]
times = [1e-3, 1e-1]
poisson = 0.49
[[layers]]
material = "coat"
thickness = 20e-6
[[layers]]
material = "coat"
thickness = 30e-6
[base]
kind = "half_space"
material = "rubber"
[load]
pressure = 1e5
velocity = [0.01, 0.1, 1.0]
[solver]
newton = false   # compiles in two thirds of the time
"""
COAT = "layers[0].material.modulus"


@pytest.fixture(scope="module")
def curves():
    return gc.page.curves.Curves(parse_scene(SCENE))


@pytest.fixture(scope="module")
def profile():
    """Those of one row of points: they compile in less time."""
    return gc.page.curves.Curves(parse_scene(SCENE.replace("[16, 16]", "[16]")))


@pytest.fixture(autouse=True)
def no_server(monkeypatch):
    """Without a server a move computes nothing by itself: tests call `update`."""
    monkeypatch.setattr("param.parameterized.async_executor", lambda call: None)


@pytest.fixture
def page(curves, tmp_path):
    return gc.page.Page(curves, tmp_path)


def update(page):
    """Updates without errors of the contact, which take long to compile."""
    page._compute_errors = lambda values: None
    asyncio.run(page.update())


def test_sliders_are_the_loads_and_the_numbers_of_materials_and_layers(curves):
    """A material of two layers has one number, at its place in the file."""
    numbers = curves.numbers
    places = {name: number.place for name, number in numbers.items()}
    assert places[COAT] == ("materials", "coat", "modulus")
    assert "layers[1].material.modulus" not in places and "layers[1].thickness" in places
    assert numbers[COAT].paths == (COAT, "layers[1].material.modulus")
    assert places["base.material.times[1]"] == ("materials", "rubber", "times", 1)
    assert numbers["velocity"].value == 0.1 and places["velocity"] == ("load", "velocity")
    thickness = numbers["layers[0].thickness"]
    assert (thickness.title, thickness.shown(20e-6)) == ("layer 1 thickness [µm]", 20)
    for number in numbers.values():
        assert np.isclose(number.at(number.step_of(number.value)), number.value, rtol=0.05)
        assert number.low < number.value <= number.high


def test_a_page_shows_the_contact_of_its_sliders_and_pins_a_curve(page, curves):
    update(page)
    before, numbers, before_moved = page.curve, page.numbers, page.values
    page.pin.value = True
    page.sliders[COAT].field.value = 12
    page.sliders["velocity"].value = 1.0
    update(page)
    moved = {COAT: 12e6, "velocity": 1.0}
    case = curves.case(moved)
    assert [layer.material.modulus for layer in case.stack.layers] == [12e6, 12e6]
    assert case.velocity == 1.0 and case.pressure == 1e5
    found = curves.contact(before_moved | moved)
    for name in ("friction", "contact_area", "mean_gap"):
        assert page.numbers[name][0] == pytest.approx(float(getattr(found, name)), rel=1e-3)
    spectrum = gc.surfaces.isotropic_spectrum(case.surface)
    how = dict(pressure=1e5, velocity=0.1, throw=False)  # in `jit` of one number of intervals
    theory = jax.jit(partial(gc.mean_field_friction, **how))(case.stack, spectrum)
    lines = page._lines[0]
    assert np.isclose(page.curve.velocity[12], 0.1)  # the curve stays where it was
    assert page.curve.friction[12] == pytest.approx(float(theory.friction), rel=1e-3)
    np.testing.assert_array_equal(lines.curve.data["y"], page.curve.friction)
    np.testing.assert_array_equal(lines.pinned.data["y"], before.friction)
    assert lines.contact.data["x"] == [1.0] and page.pinned == (before, numbers)
    pressure = page._maps.maps["pressure"].image.data["image"][0]
    assert np.isclose(np.nansum(pressure) / pressure.size, 0.1, rtol=1e-3)  # [MPa]
    page.pin.value = False
    assert len(lines.pinned.data["y"]) == 0


def test_errors_and_warnings_are_shown(page):
    page.numbers = dict.fromkeys(gc.page.curves.SHOWN["steady"], (0.1, np.nan))
    compute = lambda *names: [0.02, 0.03, 0.04]  # noqa: E731
    page.contact = SimpleNamespace(compute=compute, warnings=("A & B",))
    page._compute_errors(page.values)
    page._show_numbers()
    assert page.numbers["contact_area"] == (0.1, 0.03)
    assert "0.100 ± 0.020" in page._head.object and "A &amp; B" in page._said.object


def test_what_matters_is_the_derivative(profile):
    curves = profile
    change = curves.what_matters(values := {n: at.value for n, at in curves.numbers.items()})
    for name in ("layers[0].thickness", "velocity"):
        less, middle, more = (
            float(curves.contact({**values, name: factor * values[name]}).friction)
            for factor in (0.99, 1.0, 1.01)
        )
        expected = 100 * (more - less) / 2 / middle
        assert change[curves.numbers[name].label] == pytest.approx(expected, rel=0.02)


def test_a_refused_number_has_a_reason(page):
    slider = page.sliders["base.material.poisson"]
    slider.field.value = 0.7
    asyncio.run(page.update())
    assert "0.7" in page._said.object and page.contact is None
    slider.field.value = 0.4
    assert slider.value == 0.4


def test_a_saved_scene_has_the_numbers_and_the_comments(page, tmp_path):
    page.sliders[COAT].value = 7e6
    page.sliders["base.material.times[1]"].value = 0.2
    page.sliders["base.material.poisson"].value = 0.0
    page.save()
    again = gc.read_scene(tmp_path / "explored.toml")
    assert "modulus = 7000000.0      # measured" in again.text
    assert "# A comment that stays." in again.text and "[0.01, 0.1, 1.0]" in again.text
    saved = {name: number.value for name, number in gc.page.numbers.varied_numbers(again).items()}
    assert saved == {name: value for name, value in page.values.items() if value}
    page.save()  # it exists
    assert "Not saved" in page.saved.object


def test_numbers_that_the_scene_file_leaves_out_have_no_slider():
    text = SCENE[: SCENE.index("[materials.rubber]")] + SCENE[SCENE.index("[[layers]]") :]
    text = text.replace('"rubber"', '"tread"') + '[materials.tread]\nkind = "tyre_tread"\n'
    names = gc.page.numbers.varied_numbers(parse_scene(text))
    assert COAT in names and not any(name.startswith("base.") for name in names)


def test_a_profile_is_drawn(profile, tmp_path):
    page = gc.page.Page(profile, tmp_path)
    page._compute_contact(page.values)
    page._show_contact()
    (picture,) = page._pictures
    assert len(picture.object.axes) == 3
