"""Scenes of pages: their tables, what can be turned in them, and what is saved."""

import math
import tomllib

import jax
import numpy as np
import pytest
from scenes import TEXT, changed

from graded_contact.core.parameters import paths
from graded_contact.files.toml import toml_text
from graded_contact.page.document import (
    open_document,
    with_layer,
    with_topography,
    without_layer,
)
from graded_contact.page.knobs import changed_document, changed_stack, knobs_of

SHIFT = 'kind = "tyre_tread"\npoisson = 0.45'
WARM = "temperature = [280.0, 300.0]\nvelocity ="
BULK_SHEAR = """kind = "elastic"
modulus = 2e9
[materials.shear]
kind = "prony"
equilibrium = 1e6
strengths = [1e7, 2e6]
times = [1e-3, 1e-1]
shift = {kind = "wlf", c1 = 8.0, c2 = 100.0, reference = 290.0}
[materials.both]
kind = "bulk_shear"
bulk = "tread"
shear = "shear"
"""


@pytest.fixture
def opened(tmp_path):
    def open_text(text: str):
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return open_document(path)

    return open_text


def test_the_text_of_tables_is_read_back_as_they_were():
    content = {
        "title": 'quotes " \\ and \x7f, µ, \n, \t', "empty": [], "number": 1e-300, "whole": 3,
        "grid": {"shape": [4, 4], "size": 1.0, "odd key.": True, "inf": math.inf},
        "materials": {"a b": {"kind": "x", "shift": {"c": [1.5, -2]}}, "c": {"e": []}},
        "layers": [{"material": "a b"}, {"material": "c", "thickness": 0.1}],
    }  # fmt: skip
    assert tomllib.loads(toml_text(content)) == content


@pytest.mark.parametrize(
    "text",
    [
        TEXT,
        changed('kind = "tyre_tread"', SHIFT, "velocity =", WARM),
        changed('kind = "tyre_tread"', BULK_SHEAR, 'material = "tread"', 'material = "both"'),
        changed("material = \"coat\"", 'top = "coat"\nbottom = "tread"'),
    ],
    ids=["plain", "temperature", "bulk and shear", "graded"],
)  # fmt: skip
def test_a_saved_scene_has_the_values_of_the_sliders(opened, text):
    document = opened(text)
    scene = document.scene()
    surface = scene.surface.build()
    knobs = knobs_of(document, scene, surface)
    assert len({knob.label for knob in knobs}) == len(knobs)
    values = [0.9 * knob.value + 0.1 * knob.low for knob in knobs]
    saved = changed_document(document, scene.stack, knobs, values)
    again = saved.scene()
    wanted = changed_stack(scene.stack, [knob.target for knob in knobs], np.array(values))
    found = again.block({name: at[0] for name, at in again.axes.items()})
    for (path, one), other in zip(paths(found).items(), paths(wanted).values(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, err_msg=path)
    afresh = knobs_of(saved, again, again.surface.build())
    assert [knob.key[:2] for knob in afresh] == [knob.key[:2] for knob in knobs]
    np.testing.assert_allclose([knob.value for knob in afresh], values, rtol=1e-12)


def test_a_knob_of_a_shared_material_changes_all_its_layers(opened):
    document = with_layer(opened(TEXT), "coat")
    scene = document.scene()
    knobs = knobs_of(document, scene, scene.surface.build())
    which = [knob.label for knob in knobs].index("coat: modulus")
    values = np.array([knob.value for knob in knobs])
    values[which] = 5e6
    block = changed_stack(scene.stack, [knob.target for knob in knobs], values)
    assert [float(layer.material.young) for layer in block.layers] == [5e6, 5e6]


@pytest.mark.parametrize("value", [1e12, None])
def test_a_value_out_of_range_is_refused_with_the_range(opened, value):
    document = opened(TEXT)
    scene = document.scene()
    pressure = knobs_of(document, scene, scene.surface.build())[0]
    with pytest.raises(ValueError, match=r"`pressure`: .* is refused.* between 8 and 20000 kPa"):
        pressure.check(value)


def test_layers_come_and_go(opened):
    document = opened(TEXT)
    more = with_layer(with_layer(document, None), None)
    names = [layer["material"] for layer in more.content["layers"]]
    assert names == ["coat3", "coat2", "coat"]
    assert without_layer(more, 1).scene().stack.layers[1].thickness == 2e-5
    assert document.content["layers"] == [{"material": "coat", "thickness": 2e-5}]


def test_a_scene_without_motion_is_refused(opened):
    with pytest.raises(ValueError, match=r"scene.toml: \[load\] `velocity` is 0"):
        opened(changed("velocity = [0.01, 1.0]", "velocity = 0.0"))


def test_a_topography_needs_its_unit_and_its_size(opened, tmp_path):
    path = tmp_path / "heights.txt"
    heights = jax.random.normal(jax.random.key(0), (48, 24))
    path.write_text("\n".join(" ".join(f"{h:.4f}" for h in row) for row in heights))
    with pytest.raises(ValueError, match="pass `unit`"):
        with_topography(opened(TEXT), path, {})
    document = with_topography(opened(TEXT), path, {"unit": "um", "size": 1e-4})
    assert sorted(document.scene().surface.build().grid.shape) == [24, 48]
    path.write_text("not a topography\n")
    with pytest.raises(ValueError, match=r"heights\.txt"):
        with_topography(opened(TEXT), path, {})
