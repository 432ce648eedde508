"""Exported series are parsed back and summed here, apart from the package."""

import dataclasses
import tomllib

import numpy as np
import pytest
from oracles import maxwell
from scene_texts import BARE

import graded_contact as gc
from graded_contact.exports.prony_cards import export_prony
from graded_contact.scenes import parse_scene

SHIFT = gc.WLF(4.57, 113.6, 298.15)
TABLE = gc.materials.TabulatedShift(
    [280.0, 300.0, 325.0], [2 / 3, 0.0, -1.7], 300.0, [0.97, 1.0, 10 / 9]
)
RANGE = gc.materials.MeasuredRange([1e-2 / 3, 1e7 / 3], [280.0, 325.0])
OMEGA = 10.0 ** np.arange(-6, 16)
MATERIALS = {
    "tread": gc.tyre_tread(poisson=0.49),
    # Thirds have no short decimal form; one branch dwarfs the equilibrium modulus.
    "thirds": gc.Prony(1e6 / 3, [2e9 / 3, 1e7 / 7], [1e-9 / 3, 1 / 3], 1 / 3, SHIFT),
}
each_material = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)


def check(material, equilibrium, strengths, times, rtol=1e-14):
    expected = np.asarray(material.modulus(OMEGA))
    found = maxwell(OMEGA, equilibrium, strengths, times)
    np.testing.assert_allclose(found.real, expected.real, rtol=rtol)
    np.testing.assert_allclose(found.imag, expected.imag, rtol=rtol)


def numbers(line):
    return [float(cell) for cell in line.split(",")]


def same_law(found, law):
    np.testing.assert_allclose(found, [law.reference, law.c1, law.c2], rtol=1e-12)


@each_material
@pytest.mark.parametrize("format, longest", [("abaqus", 256), ("ansys", 640)])
def test_cards_keep_to_the_limits_of_their_programs(material, format, longest):
    table = dataclasses.replace(material, shift=TABLE, measured=RANGE)
    for given in (material, table):
        for line in export_prony(given, format, name="m" * 30).splitlines():
            assert len(line) <= longest
            if not line.startswith(("**", "!", "*MATERIAL")):
                assert all(len(item.strip()) <= 20 for item in line.split(","))


@each_material
def test_an_abaqus_card_gives_the_modulus_back(material):
    lines = export_prony(material, "abaqus", name="tread").splitlines()
    cards = [line for line in lines if not line.startswith("**")]
    assert cards[0] == "*MATERIAL, NAME=tread"
    assert cards[1] == "*ELASTIC, MODULI=INSTANTANEOUS"
    assert cards[3] == "*VISCOELASTIC, TIME=PRONY"
    glassy, poisson = numbers(cards[2])
    end = cards.index("*TRS, DEFINITION=WLF")
    shear, bulk, times = np.array([numbers(line) for line in cards[4:end]]).T
    assert abs(poisson - material.poisson) < 1e-12
    assert np.array_equal(shear, bulk) and np.sum(shear) < 1
    # Items have 13 digits; what is left for the equilibrium modulus loses those of E_inf/E_eq.
    loss = float(material.glassy / material.equilibrium)
    check(material, glassy * (1 - np.sum(shear)), glassy * shear, times, rtol=1e-12 * loss)
    same_law(numbers(cards[end + 1]), material.shift)


@each_material
def test_an_ansys_card_gives_the_modulus_back(material):
    lines = export_prony(material, "ansys").splitlines()
    constants = {line.split(",")[1]: float(line.split(",")[3]) for line in lines if "MP," in line}
    tables, current = {}, None
    for line in lines:
        command, *cells = line.split(",")
        if command == "TB":
            current = tables.setdefault(cells[-1], {"count": int(cells[-2]), "data": {}})
        elif command == "TBDATA":
            first, values = int(cells[0]), map(float, cells[1:])
            current["data"].update({first + i: value for i, value in enumerate(values)})
    shear, bulk = (
        np.array([tables[part]["data"][i + 1] for i in range(2 * tables[part]["count"])])
        for part in ("SHEAR", "BULK")
    )
    assert tables["SHEAR"]["count"] == len(material.times) and np.array_equal(shear, bulk)
    assert abs(constants["PRXY"] - material.poisson) < 1e-12
    glassy, ratios = constants["EX"], shear[::2]
    loss = float(material.glassy / material.equilibrium)
    check(material, glassy * (1 - np.sum(ratios)), glassy * ratios, shear[1::2], 1e-12 * loss)
    same_law(list(tables["WLF"]["data"].values()), material.shift)


@pytest.mark.parametrize("shift", [None, SHIFT, gc.Arrhenius(2e5 / 3, 293.15), TABLE])
def test_a_toml_table_makes_the_same_material_in_a_scene(shift):
    material = gc.Prony(1e6 / 3, [2e9 / 3, 1e7 / 7], [1e-22 / 3, 1 / 3], 1 / 3, shift, RANGE)
    snippet = export_prony(material, "toml", name="my-rubber_2")
    scene = BARE.replace('material = "tread"', 'material = "my-rubber_2"')
    found = parse_scene(scene + snippet).bodies.stack.base.material
    for field in ("equilibrium", "strengths", "times", "poisson"):
        assert np.array_equal(getattr(found, field), getattr(material, field))
    for field in ("omega", "temperature"):
        assert np.array_equal(getattr(found.measured, field), getattr(RANGE, field))
    assert type(found.shift) is type(shift)
    if shift is not None:
        warm, expected = found.at(310.0), material.at(310.0)
        assert np.array_equal(warm.times, expected.times)
        assert np.array_equal(warm.strengths, expected.strengths)
    assert set(tomllib.loads(snippet)["materials"]) == {"my-rubber_2"}
