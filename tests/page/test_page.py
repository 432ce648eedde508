"""The page without a browser: its numbers are those of the scene, moved, pinned and saved."""

import asyncio

import numpy as np
import param
import pytest

import graded_contact as gc
from graded_contact.page.curves import Curves
from graded_contact.page.numbers import numbers_of
from graded_contact.page.page import Page, opened
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
pressure = 1e5     # two bar less one
velocity = [0.01, 0.1, 1.0]
"""


@pytest.fixture(scope="module")
def curves():
    return Curves(parse_scene(SCENE))


@pytest.fixture(autouse=True)
def no_server(monkeypatch):
    """Without a server a move computes nothing by itself: tests call `update`."""
    monkeypatch.setattr(param.parameterized, "async_executor", lambda call: None)


@pytest.fixture
def page(curves, tmp_path):
    return Page(curves, tmp_path)


def update(page):
    asyncio.run(page.update())
    return page


def shown(page, name="friction"):
    return page._known[name]


def solid(young=6e6, thickness=20e-6, poisson=0.49):
    """The block and the surface of the scene, made without scene and page."""
    coat, rubber = gc.Elastic(young, poisson), gc.Prony(2e6, [8e6, 3e6], [1e-3, 1e-1], poisson)
    layers = (gc.Layer(coat, thickness), gc.Layer(coat, 30e-6))
    return gc.Stack(layers=layers, base=gc.HalfSpace(rubber)), parse_scene(SCENE).surface


def direct(velocity=0.1, **changes):
    return gc.slide(*solid(**changes), pressure=1e5, velocity=velocity, rtol=1e-8)


def test_sliders_are_the_loads_and_the_numbers_of_materials_and_layers(curves):
    """A material of two layers has one number, at its place in the file."""
    numbers = curves.numbers
    places = {name: number.place for name, number in numbers.items()}
    assert places["layers[0].material.modulus"] == ("materials", "coat", "modulus")
    assert "layers[1].material.modulus" not in places and "layers[1].thickness" in places
    assert numbers["layers[0].material.modulus"].paths[1] == "layers[1].material.modulus"
    assert places["base.material.times[1]"] == ("materials", "rubber", "times", 1)
    assert curves.values["velocity"] == 0.1 and numbers["velocity"].place == ("load", "velocity")
    thickness = numbers["layers[0].thickness"]
    assert (thickness.unit, thickness.text(20e-6)) == ("µm", "20")
    assert thickness.hint(20e-6) == "2e-05 m" and np.isclose(thickness.read("2,5"), 2.5e-6)
    for number in numbers.values():
        assert np.isclose(number.at(number.step_of(number.value)), number.value, rtol=0.05)
        assert number.low < number.value <= number.high


def test_a_page_shows_the_contact_of_its_sliders(page):
    assert shown(update(page))[0] == pytest.approx(float(direct().friction), rel=1e-3)
    page.sliders["layers[0].material.modulus"].enter("12")
    page.sliders["velocity"].value = 1.0
    found = direct(young=12e6, velocity=1.0)
    for name in ("friction", "contact_area", "mean_gap"):
        number, error = shown(update(page), name)
        assert number == pytest.approx(float(getattr(found, name)), rel=1e-3)
        assert 0 < error < 0.5 * number
    lines = page._lines[0]
    block, road = solid(young=12e6)
    spectrum = gc.surfaces.isotropic_spectrum(road)
    theory = gc.mean_field_friction(block, spectrum, pressure=1e5, velocity=0.1)
    assert np.isclose(page.curve.velocity[12], 0.1)  # the curve stays where it was
    assert page.curve.friction[12] == pytest.approx(float(theory.friction), rel=1e-3)
    np.testing.assert_array_equal(lines.curve.data["y"], page.curve.friction)
    assert lines.contact.data["x"] == [1.0]
    pressure = page._maps.maps["pressure"].image.data["image"][0]
    assert np.isclose(np.nansum(pressure) / pressure.size, 0.1, rtol=1e-3)  # [MPa]


def test_a_pinned_curve_stays(page):
    update(page)
    before, numbers = page.curve, dict(page._known)
    page.pin.value = True
    page.sliders["pressure"].value = 2e5
    update(page)
    np.testing.assert_array_equal(page._lines[0].pinned.data["y"], before.friction)
    assert page.pinned[1] == numbers and "% of the pinned" in page._head.object
    page.pin.value = False
    assert len(page._lines[0].pinned.data["y"]) == 0


def test_bars_are_derivatives(curves, page):
    page.ask.value = True
    change = update(page).change
    value = float(direct().friction)
    for name, given in (("layers[0].thickness", 20e-6), ("velocity", 0.1)):
        step = {name.rpartition(".")[2]: 1.01 * given}, {name.rpartition(".")[2]: 0.99 * given}
        more, less = (float(direct(**one).friction) for one in step)
        expected = 100 * (more - less) / 2 / value
        assert change[curves.numbers[name].label] == pytest.approx(expected, rel=0.02)


def test_a_refused_text_stays_beside_the_reason(page):
    slider = page.sliders["base.material.poisson"]
    for text in ("0.7", "half"):
        slider.field.value = text
        assert slider.value == slider.number.value and slider.field.value == text
        assert slider.refusal.visible and text in slider.refusal.object
    slider.field.value = "0.4"
    assert slider.value == 0.4 and not slider.refusal.visible


def test_a_saved_scene_has_the_numbers_and_the_comments(page, tmp_path):
    page.sliders["layers[0].material.modulus"].value = 7e6
    page.sliders["base.material.times[1]"].value = 0.2
    page.save()
    path = tmp_path / "explored.toml"
    again = opened(path)
    assert "modulus = 7000000.0      # measured" in again.text
    assert "# A comment that stays." in again.text and "[0.01, 0.1, 1.0]" in again.text
    assert {name: n.value for name, n in numbers_of(again).items()} == page.values
    page.save()  # it exists
    assert "exists" in page.saved.object
    page.file_name.value = "../elsewhere"
    page.save()
    assert "Not saved" in page.saved.object and [*tmp_path.iterdir()] == [path]


def test_numbers_that_a_scene_file_cannot_state_are_not_saved(tmp_path):
    text = SCENE[: SCENE.index("[materials.rubber]")] + SCENE[SCENE.index("[[layers]]") :]
    text = text.replace('"rubber"', '"tread"') + '[materials.tread]\nkind = "tyre_tread"\n'
    page = Page(Curves(parse_scene(text)), tmp_path)
    page.sliders["base.material.equilibrium"].value *= 2
    page.save()
    assert "Not saved" in page.saved.object and not [*tmp_path.iterdir()]


def test_a_profile_is_drawn(tmp_path):
    text = SCENE.replace("[16, 16]", "[64]").replace("4e4", "1e5")
    page = update(Page(Curves(parse_scene(text)), tmp_path))
    assert [one.object[:4] for one in page._pictures] == [b"\x89PNG"]
