"""Runs of scenes with motion, shear, heating and windows are what Python's functions give."""

import numpy as np
import pytest
from scene_texts import BARE

import graded_contact as gc
from graded_contact.scenes.collect import numbers_of_scene
from graded_contact.scenes.plan import build_surface, plan
from graded_contact.scenes.results import kept_contact
from graded_contact.scenes.scene_file import parse_scene

SMALL = BARE.replace("[32, 32]", "[16, 16]").replace("q_high = 8e4", "q_high = 4e4")
CYCLE = SMALL.replace(
    "[0.01, 1.0]", "[0.1, 1.0]\npressure_ratio = [1.0, 1.5]\ndirection = [0.5, 0.0]"
) + (
    '[motion]\nkind = "sinusoidal"\nstroke = 1e-4\nfrequency = 20.0\nnum_times = 8\n'
    '[shear]\nkind = "peaked"\npeak = 1e5\nvelocity = 0.1\nsteepness = 0.1\n'
)


@pytest.fixture(scope="module")
def cycles():
    scene = parse_scene(CYCLE)
    return scene, plan(scene).run()


@pytest.mark.slow
def test_a_run_of_a_motion_is_slide_cycle(cycles):
    scene, results = cycles
    motion = gc.sliding.sinusoidal(1e-4, 20.0, 8)
    along = np.array([np.cos(0.5), np.sin(0.5)])
    cycle = gc.sliding.slide_cycle(
        scene.stack,
        build_surface(scene),
        displacement=np.asarray(motion.displacement)[:, None] * along,
        period=motion.period * motion.highest_speed / 1.0,
        pressure=2e5 * np.array([1.0, 1.125, 1.25, 1.375, 1.5, 1.375, 1.25, 1.125]),
        shear=gc.sliding.PeakedShear(1e5, 0.1, 0.1),
        rtol=scene.rtol,
    )
    assert np.all(results.message == "")
    at = results.isel(direction=0, pressure=0, velocity=1)
    assert cycle.numbers == numbers_of_scene(scene, build_surface(scene))
    names = "mean_friction", "mean_shear_friction", "peak_friction", "work"
    names += "dissipated_power", "phase", "load", "friction"
    numbers = dict(zip(names, cycle.compute(*names), strict=True))  # by one program
    for name in names[:-1]:
        np.testing.assert_allclose(at[name], numbers[name], rtol=1e-5, err_msg=name)
    np.testing.assert_allclose(at.friction, cycle.friction @ along, rtol=1e-4, atol=1e-7)
    np.testing.assert_allclose(at.period, cycle.period, rtol=1e-12)
    assert results.friction.dims == ("direction", "pressure", "velocity", "time")
    # The surface has no lay, but the other direction is another one.
    assert (
        1e-3 < abs(results.isel(direction=1, velocity=1).mean_friction / at.mean_friction - 1) < 0.5
    )
    assert results.time.values.tolist() == [i / 8 for i in range(8)]
    assert results.work.attrs["units"] == "J/m²" and results.largest_step.attrs["units"] == "1"
    np.testing.assert_allclose(at.friction * at["load"], at["traction"], rtol=1e-12)


@pytest.mark.slow
def test_a_run_with_heating_is_slide_with_heating():
    text = SMALL.replace("= [0.01, 1.0]", "= 10.0\ntemperature = 300.0") + (
        "[heating]\nconductivity = 0.2\ndiffusivity = 1e-7\n"
    )
    scene = parse_scene(text.replace('"tyre_tread"', '"tyre_tread"\npoisson = 0.49'))
    results = plan(scene).run()
    load = {"pressure": 2e5, "velocity": 10.0, "temperature": 300.0, "rtol": scene.rtol}
    heating = gc.sliding.Heating(0.2, 1e-7)
    sliding = gc.slide(scene.stack, build_surface(scene), heating=heating, **load)
    np.testing.assert_allclose(results.friction.item(), sliding.friction, rtol=1e-4)
    np.testing.assert_allclose(results.surface_rise.item(), sliding.heated.surface_rise, rtol=1e-3)


@pytest.mark.slow
def test_a_sphere_in_a_scene_has_the_pressure_of_hertz():
    load = f"pressure = {1e-2 / 36e-8}"
    text = '[surface]\nkind = "sphere"\nradius = 2e-3\n[grid]' + BARE.split("[grid]")[1]
    for old, new in (
        ("size = 1e-3", "size = 6e-4"), ('"tyre_tread"', '"elastic"\nmodulus = 3e6\npoisson = 0.5'),
        ("pressure = 2e5", load), ("[0.01, 1.0]", "0.0"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    results = plan(parse_scene(text)).run()
    contact_modulus, force, radius = 4e6, 1e-2, 2e-3
    half_width = (0.75 * force * radius / contact_modulus) ** (1 / 3)
    peak = 1.5 * force / (np.pi * half_width**2)
    np.testing.assert_allclose(results.contact_pressure.max(), peak, rtol=0.02)
    np.testing.assert_allclose(results.approach.item(), half_width**2 / radius, rtol=0.02)
    assert results.rim_load == 0
    moved = plan(parse_scene(text.replace(load, f"approach = {results.approach.item()}"))).run()
    assert moved["message"].dims == ("approach", "velocity")
    np.testing.assert_allclose(moved.mean_pressure.item(), 1e-2 / 36e-8, rtol=1e-4)
    assert not kept_contact(results, (0, 0))[1].periodic
