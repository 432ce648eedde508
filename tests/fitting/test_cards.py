"""Exported series are parsed back and summed here, apart from the package."""

import tomllib

import numpy as np
import pytest
from oracles import maxwell

import graded_contact as gc
from graded_contact.fitting.cards import abaqus_card, toml_table

SHIFT = gc.WLF(4.57, 113.6, 298.15)
RANGE = gc.materials.MeasuredRange([1e-2 / 3, 1e7 / 3], [280.0, 325.0])
OMEGA = 10.0 ** np.arange(-6, 16)
MATERIALS = {
    "tread": gc.tyre_tread(poisson=0.49),
    # Thirds have no short decimal form; one branch dwarfs the equilibrium modulus.
    "thirds": gc.Prony(1e6 / 3, [2e9 / 3, 1e7 / 7], [1e-9 / 3, 1 / 3], 1 / 3, SHIFT, RANGE),
}


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_an_abaqus_card_gives_the_modulus_back(material):
    lines = abaqus_card(material, "tread").splitlines()
    cards = [line for line in lines if not line.startswith("**")]
    assert cards[0] == "*MATERIAL, NAME=tread"
    assert cards[1] == "*ELASTIC, MODULI=INSTANTANEOUS"
    assert cards[3] == "*VISCOELASTIC, TIME=PRONY"
    end = cards.index("*TRS, DEFINITION=WLF")
    rows = [cards[2], *cards[4:end], cards[end + 1]]
    assert all(len(item.strip()) <= 20 for row in rows for item in row.split(","))
    (glassy, poisson), *terms, law = [[float(item) for item in row.split(",")] for row in rows]
    shear, bulk, times = np.array(terms).T
    assert abs(poisson - material.poisson) < 1e-12
    assert np.array_equal(shear, bulk) and np.sum(shear) < 1
    # Items have 13 digits; what is left for the equilibrium modulus loses those of E_inf/E_eq.
    rtol = 1e-12 * float(material.glassy / material.equilibrium)
    expected = np.asarray(material.complex_modulus(OMEGA))
    found = maxwell(OMEGA, glassy * (1 - np.sum(shear)), glassy * shear, times)
    np.testing.assert_allclose(found.real, expected.real, rtol=rtol)
    np.testing.assert_allclose(found.imag, expected.imag, rtol=rtol)
    shift = material.shift
    np.testing.assert_allclose(law, [shift.reference, shift.c1, shift.c2], rtol=1e-12)


def test_a_liquid_has_no_abaqus_card():
    with pytest.raises(ValueError, match="equilibrium"):
        abaqus_card(gc.Prony(0.0, [1e6], [1.0]), "oil")


TABLE = gc.materials.TabulatedShift([280.0, 300.0, 325.0], [2 / 3, 0.0, -1.7], 300.0, [0.97, 1, 1])


@pytest.mark.parametrize("shift", [None, SHIFT, gc.Arrhenius(2e5 / 3, 293.15), TABLE])
def test_a_toml_table_has_all_digits(shift):
    material = gc.Prony(1e6 / 3, [2e9 / 3, 1e7 / 7], [1e-22 / 3, 1 / 3], 1 / 3, shift, RANGE)
    tables = tomllib.loads(toml_table(material, "my rubber"))["materials"]["my rubber"]
    assert tables["kind"] == "prony"
    for field in ("equilibrium", "strengths", "times", "poisson"):
        assert np.array_equal(tables[field], getattr(material, field))
    for field in ("omega", "temperature"):
        assert np.array_equal(tables["measured"][field], getattr(RANGE, field))
    for field, value in tables.get("shift", {"kind": None}).items():
        assert field == "kind" or np.array_equal(value, getattr(shift, field))
