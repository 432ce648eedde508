"""Scenes of pages: their tables, what can be turned in them, and what is saved."""

import math
import re
import tomllib

import jax
import numpy as np
import pytest
from scene_texts import TEXT, changed

from graded_contact.core.parameters import paths
from graded_contact.core.quantities import AXES, OF_RESULTS, PARAMETERS
from graded_contact.page.document import (
    open_document,
    save_document,
    with_file,
    with_layer,
    with_moduli,
    with_topography,
    without_layer,
)
from graded_contact.page.entries import dimension_of, read_entry, read_units
from graded_contact.page.knobs import knobs_of, turned
from graded_contact.page.scenery import scenery_of, with_numbers
from graded_contact.page.wording import for_page
from graded_contact.readers.columns import _HZ_ASSUMED
from graded_contact.readers.moduli import read_moduli
from graded_contact.scenes.scene_file import read_scene
from graded_contact.scenes.toml import toml_text

SHIFT = 'kind = "tyre_tread"\npoisson = 0.45'
WARM = "temperature = [280.0, 300.0]\nvelocity ="
TIMES = (1e-3, 1e-2, 1e-1)  # s, of isotherms
SPHERE = """kind = "sphere"
radius = 1e-2
[grid]
shape = [32, 32]
size = 1e-3
[materials.tread]"""
SOFT = """[materials.soft]
kind = "softened"
material = "tread"
strain = [0.001, 0.1]
storage = [1.0, 0.5]
loss = [1.0, 0.8]
[[layers]]
material = "soft"
"""
FILE = """kind = "file"
path = "heights.npy"
unit = "m"
size = 1e-3
rms_slope = 0.1
[materials.tread]"""
LAWS = """[shear]
kind = "peaked"
peak = 1e5
velocity = 0.1
steepness = 0.1
[heating]
conductivity = 0.2
diffusivity = 1e-7
counterface_conductivity = 1.0
"""
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


RANDOM = TEXT[TEXT.index('kind = "self_affine"') : TEXT.index("[materials.tread]") + 17]
SCENES = {
    "plain": TEXT,
    "temperature": changed('kind = "tyre_tread"', SHIFT, "velocity =", WARM),
    "bulk and shear": changed(
        'kind = "tyre_tread"', BULK_SHEAR, 'material = "tread"', 'material = "both"'
    ),
    "graded": changed('material = "coat"', 'top = "coat"\nbottom = "tread"'),
    "shared": changed('material = "coat"', 'material = "tread"'),
    "softened": changed('[[layers]]\nmaterial = "coat"\n', SOFT),
    "sphere": changed(RANDOM, SPHERE),
    "file": changed(RANDOM, FILE),
    "springs": changed("= 2e-5", "= 2e-5\nbond = {shear = 0.0}"),
    "film": changed("= 2e-5", '= 2e-5\nbond = {material = "tread", thickness = 1e-6}'),
    "shear and heat": changed("velocity = [0.01, 1.0]", "velocity = 1.0\ntemperature = 300.0")
    + LAWS,
}


@pytest.fixture
def opened(tmp_path):
    def open_text(text: str):
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return open_document(path)

    return open_text


def scenery(document):
    return scenery_of(document.scene, document.scene.surface.build())


def knobs_by_label(document):
    found = knobs_of(scenery(document), document.scene.materials, document.speeds)
    return {knob.label: knob for knob in found}


def turn(document, **values):
    """The scenery with knobs at values, by their labels; else a tenth nearer to the low end."""
    knobs = [*knobs_by_label(document).values()]
    low = [0.9 * knob.value + 0.1 * knob.low for knob in knobs]
    numbers = [values.get(knob.label, at) for knob, at in zip(knobs, low, strict=True)]
    return turned(scenery(document), knobs, numbers)


def test_the_text_of_tables_is_read_back_as_they_were():
    content = {
        "title": 'quotes " \\ and \x7f, µ, \n, \t', "empty": [], "number": 1e-300, "whole": 3,
        "grid": {"shape": [4, 4], "size": 1.0, "odd key.": True, "inf": math.inf},
        "materials": {"a b": {"kind": "x", "shift": {"c": [1.5, -2]}}, "c": {"e": []}},
        "layers": [{"material": "a b"}, {"material": "c", "thickness": 0.1}],
    }  # fmt: skip
    assert tomllib.loads(toml_text(content)) == content


@pytest.mark.parametrize("text", SCENES.values(), ids=SCENES)
def test_a_saved_scene_has_the_numbers_that_the_page_uses(opened, tmp_path, text):
    """All of them, and each knob is where it was left."""
    np.save(tmp_path / "heights.npy", 1e-5 * jax.random.normal(jax.random.key(0), (16, 16)))
    document = opened(text)
    after = turn(document)
    saved = with_numbers(document, scenery(document), after)
    wanted, found = paths(after), paths(scenery(saved))
    assert found.keys() == wanted.keys()
    for path, number in wanted.items():
        if path.startswith(("spectrum", "surface.surface")):
            continue  # of the heights, which follow
        np.testing.assert_allclose(found[path], number, rtol=1e-9, err_msg=path)
    heights = after.case().rough.heights
    np.testing.assert_allclose(saved.scene.surface.build().heights, heights, rtol=1e-9)
    old, new = knobs_by_label(document), knobs_by_label(saved)
    assert [*old] == [*new]
    for label, knob in old.items():
        assert new[label].value == pytest.approx(0.9 * knob.value + 0.1 * knob.low, rel=1e-9)


def test_a_softened_block_keeps_its_strain_on_the_page(opened):
    text = SCENES["softened"].replace("velocity =", "strain_per_slope = 0.5\nvelocity =")
    assert turn(opened(text)).case().strain_per_slope == 0.5


def test_a_turned_modulus_of_a_series_scales_all_its_moduli(opened):
    document = opened(TEXT)
    old = document.scene.stack.base.material
    values = {"tread: relaxed modulus": 2 * float(old.equilibrium), "temperature": 293.15}
    new, omega = turn(document, **values).case().stack.base.material, np.geomspace(1e-3, 1e12, 40)
    np.testing.assert_allclose(new.modulus(omega), 2 * old.modulus(omega), rtol=1e-12)


def test_what_is_known_of_the_data_of_a_series_is_saved_with_its_branches(opened, tmp_path):
    (tmp_path / "e.csv").write_text("equilibrium\n1e5\n")
    stated = 'kind = "tyre_tread"\nassumed = ["dry"]\nerrors = "e.csv"'
    document = opened(changed('kind = "tyre_tread"', stated))
    saved = with_numbers(document, scenery(document), turn(document))
    assert saved.content["materials"]["tread"]["kind"] == "prony"
    assert saved.scene.assumed == document.scene.assumed == ("tread: dry",)
    assert [name for name, *_ in saved.scene.errors] == ["tread"]


def test_a_knob_of_a_shared_material_changes_all_its_layers(opened):
    block = turn(with_layer(opened(TEXT), "coat"), **{"coat: modulus": 5e6}).stack
    assert [float(layer.material.young) for layer in block.layers] == [5e6, 5e6]


@pytest.mark.parametrize("text", ["1e12", "", "abc", "nan", "1e999", "30 MPa"])
def test_a_text_that_is_no_value_is_refused_with_the_range(opened, text):
    pressure = knobs_by_label(opened(TEXT))["pressure"]
    with pytest.raises(ValueError, match=r"`pressure`: .* is refused.* between 8 and 20000 kPa"):
        pressure.read(text)


def test_a_field_reads_units_commas_and_degrees(opened):
    knobs = knobs_by_label(opened(changed("velocity =", WARM, 'kind = "tyre_tread"', SHIFT)))
    assert knobs["pressure"].read(" 312,5 kPa ") == 312500.0
    for text in ("0.5 MPa", "500 kPa", "500000 Pa", "5 bar", "0,5N/mm²"):
        assert knobs["pressure"].read(text) == 5e5, text
    for text in ("60", "60 um", "60 µm", "60 μm", "0.06 mm", "6e4 nm"):  # two signs for micro
        assert knobs["layer 1 thickness"].read(text) == 6e-5, text
    for text in ("0.5", "0.5 m/s", "500 mm/s", "1.8 km/h"):
        assert knobs["velocity"].read(text) == 0.5, text
    assert knobs["rms slope"].read("0.31") == knobs["rms slope"].read("31 %") == 0.31
    assert knobs["temperature"].read("20 °C") == knobs["temperature"].read("293.15") == 293.15


@pytest.mark.parametrize(
    ("label", "text", "reason"),
    [
        ("pressure", "60 um", "um is a unit of length"),
        ("pressure", "20 °C", "°C is a unit of temperature"),
        ("layer 1 thickness", "3 MPa", "MPa is a unit of pressure"),
        ("velocity", "10 Hz", "Hz is a unit of frequency"),
        ("velocity", "1 mm²/s", "mm²/s is a unit of diffusivity"),
        ("pressure", "3 mPa", "the unit mPa is not known"),  # a megapascal, or a thousandth of one
        ("rms slope", "3 furlongs", "the unit furlongs is not known"),
        ("pressure", "much", "no number"),
    ],
)
def test_a_unit_of_another_dimension_is_refused_by_its_name(opened, label, text, reason):
    knob = knobs_by_label(opened(TEXT))[label]
    with pytest.raises(ValueError, match=f"`{label}`: {text} is refused: {re.escape(reason)}"):
        knob.read(text)


def test_every_usual_unit_is_read_as_itself_and_has_the_dimension_of_its_quantity():
    quantities = [*AXES.values(), *PARAMETERS.values(), *OF_RESULTS.values()]
    known = [quantity for quantity in quantities if quantity.usual]
    assert len(known) == 19
    for quantity in known:
        unit = quantity.usual.unit
        assert read_entry(f"3 {unit}", unit) == read_entry("3", unit)
        assert dimension_of(unit)[0] == dimension_of(quantity.unit)[0]
        low, high = quantity.usual.ends(0.4)
        assert low < 0.4 < high


def test_a_poissons_ratio_of_one_half_steps_down(opened):
    document = opened(changed("poisson = 0.4", "poisson = 0.5"))
    knob = knobs_by_label(document)["coat: Poisson's ratio"]
    assert (knob.step_size(0.5), knob.step_size(0.4)) == (-0.01, 0.01)
    assert knob.stepped(0.5).endswith("−0.01") and knob.stepped(0.4).endswith("+0.01")


def test_a_saved_scene_finds_its_files_from_another_folder(opened, tmp_path):
    """Whatever the key of a path is called."""
    (tmp_path / "e.csv").write_text("modulus\n1e5\n")
    document = opened(changed("modulus = 2e7", 'modulus = 2e7\nerrors = "e.csv"'))
    path = save_document(document, tmp_path / "explored", "mine", replace=False)
    assert read_scene(path).inputs == {("[materials.coat]", "errors"): tmp_path / "e.csv"}


def test_a_drop_follows_no_link_out_of_its_folder(opened, tmp_path):
    secret, folder = tmp_path / "secret.csv", tmp_path / "explored"
    secret.write_text("secret")
    folder.mkdir()
    (folder / "data.csv").symlink_to(secret)
    taken = []
    with_file(opened(TEXT), folder, "data.csv", b"secret", lambda document, path: (
        taken.append(path) or document
    ))  # fmt: skip
    assert taken == [folder / "data2.csv"] and not taken[0].is_symlink()


def test_isotherms_become_a_series_with_its_shifts(opened, tmp_path):
    """Three isotherms of one relaxation, shifted by a known law."""
    path, omega = tmp_path / "sweep.csv", np.geomspace(0.1, 100, 13)
    rows = ["temperature (K),frequency (rad/s),E' (Pa),E'' (Pa)"]
    for kelvin, shift in ((280, 2.0), (290, 1.0), (300, 0.0)):
        modulus = 1e6 + sum(2e6 / (1 - 1j / (omega * 10**shift * tau)) for tau in TIMES)
        rows += [f"{kelvin},{w},{m.real},{m.imag}" for w, m in zip(omega, modulus, strict=True)]
    path.write_text("\n".join(rows), encoding="utf-8")
    document = with_moduli(opened(TEXT), path, {}, "tread")
    table = document.content["materials"]["tread"]
    assert table["kind"] == "prony" and "shift" in table
    material = document.scene.stack.base.material
    for kelvin, shift in ((280, 2.0), (290, 1.0), (300, 0.0)):
        at = material.at(float(kelvin))
        wanted = 1e6 + sum(2e6 / (1 - 1j / (omega * 10**shift * tau)) for tau in TIMES)
        np.testing.assert_allclose(at.modulus(omega), wanted, rtol=0.03)


def test_layers_come_and_go(opened):
    document = opened(TEXT)
    more = with_layer(with_layer(document, None), None)
    names = [layer["material"] for layer in more.content["layers"]]
    assert names == ["coat3", "coat2", "coat"]
    named = with_layer(with_layer(document, None, " soft "), None, "soft")
    assert [layer["material"] for layer in named.content["layers"]] == ["soft2", "soft", "coat"]
    assert named.scene.stack.layers[0].material.young == 1e7
    with pytest.raises(ValueError, match="Layer 2 is removed already"):
        without_layer(document, 1)
    assert without_layer(more, 1).scene.stack.layers[1].thickness == 2e-5
    assert document.content["layers"] == [{"material": "coat", "thickness": 2e-5}]


def test_the_page_opens_the_scene_of_the_demo():
    assert open_document(None).scene.title


def test_a_scene_that_the_page_does_not_take_is_refused(opened):
    with pytest.raises(ValueError, match=r"scene.toml: \[load\] `velocity` is 0"):
        opened(changed("velocity = [0.01, 1.0]", "velocity = 0.0"))
    with pytest.raises(
        ValueError, match=r"scene.toml: The page does not take the table \[motion\]"
    ):
        opened(TEXT + '\n[motion]\nkind = "sinusoidal"\nstroke = 1e-4\nfrequency = 1.0\n')


def test_a_topography_needs_its_unit_and_its_size(opened, tmp_path):
    path = tmp_path / "heights.txt"
    heights = jax.random.normal(jax.random.key(0), (48, 24))
    path.write_text("\n".join(" ".join(f"{h:.4f}" for h in row) for row in heights))
    with pytest.raises(ValueError, match=r"fill in “unit of its heights”, for .* “edge length”"):
        with_topography(opened(TEXT), path, {})
    document = with_topography(opened(TEXT), path, {"unit": "um", "size": 1e-4})
    assert sorted(document.scene.surface.build().grid.shape) == [24, 48]
    path.write_text("not a topography\n")
    with pytest.raises(ValueError, match=r"heights\.txt"):
        with_topography(opened(TEXT), path, {})


def test_errors_speak_of_what_the_page_has(opened, tmp_path):
    table, heights = tmp_path / "dma.csv", tmp_path / "heights.txt"
    table.write_text("frequency,E',E''\n" + "".join(f"{f},{2e6 * f},3e5\n" for f in (1, 3, 9, 27)))
    with pytest.raises(ValueError, match=r"dma.csv: .*") as refused:
        with_moduli(opened(TEXT), table, {}, "tread")
    assert "fill in for instance “its units” modulus=Pa" in str(refused.value)
    given = {"units": {"modulus": "Pa"}}
    changed = with_moduli(opened(TEXT), table, given, "tread")
    assert changed.scene and changed.content["materials"]["tread"]["units"] == given["units"]
    heights.write_text("\n".join("3 1 4 1 5 9 2 6" for _ in range(8)))
    with pytest.raises(ValueError, match="“unit of its heights” 'ell' is not a length"):
        with_topography(opened(TEXT), heights, {"unit": "ell", "size": 1e-3})
    with pytest.raises(
        ValueError, match=r"“name” '../out' is refused: names cannot contain '/'\.$"
    ):
        save_document(opened(TEXT), tmp_path, "../out", replace=False)


def test_a_unit_without_a_name_is_that_of_its_dimension():
    assert read_units("MPa") == {"modulus": "MPa"}
    assert read_units("kPa; rad/s, temperature=K") == {
        "modulus": "kPa", "frequency": "rad/s", "temperature": "K"
    }  # fmt: skip
    assert read_units("storage=MPa") == {"storage": "MPa"}
    with pytest.raises(ValueError, match="furlong has no name and value"):
        read_units("furlong")


def test_an_assumption_names_the_fields_of_the_page():
    said = for_page(_HZ_ASSUMED, read_moduli)
    assert said.endswith("if it is not, fill in “its units” frequency=rad/s")
