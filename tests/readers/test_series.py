"""Prony series in the layouts of programs: one solid, E(ω) summed here by complex arithmetic."""

import numpy as np
import pytest
from test_instrument_exports import write

import graded_contact as gc
from graded_contact.exports.prony_cards import PRONY_CARDS, export_prony
from graded_contact.readers import read_moduli, read_prony

# E(t) = 3 MPa + 4, 2 and 1 MPa that decay in 1 ms, 0.1 s and 10 s.
OMEGA = 10.0 ** np.arange(-4, 6)
RATES = 1j * OMEGA[:, None] * np.array([1e-3, 1e-1, 10.0])
MODULUS = 3e6 + np.sum(np.array([4e6, 2e6, 1e6]) * RATES / (1 + RATES), axis=1)

PRONY = "tau [s],E_i [MPa]\n1e-3,4\n1e-1,2\n10,1\ninf,3\n"
RATIOS = "0.4,0.4,0.001\n0.2,0.2,0.1\n0.1,0.1,10.\n"
ELASTIC = "*MATERIAL, NAME=RUBBER\n*ELASTIC, MODULI=INSTANTANEOUS\n1.0E7, 0.49\n"
ABAQUS = f"{ELASTIC}*VISCOELASTIC, TIME=PRONY\n{RATIOS}"
NEOHOOKE = ABAQUS.replace("*ELASTIC", "*HYPERELASTIC, NEO HOOKE")
ANSYS = """/PREP7
E0 = 10e6
MP,EX,7,E0
MP,NUXY,7,0.49
TB,PRONY,7,1,3,SHEAR
TBDATA,1,0.4,0.001,0.2,0.1,0.1,10
TB,PRONY,7,1,3,BULK
TBDATA,1,0.4,0.001,0.2
TBDATA,4,0.1,0.1,10
"""
MODES = """# Maxwell modes
# Generated with RepTate 1.3.1

#number of modes
3

#   i\t          tau_i\t            G_i
    1\t          0.001\t        {}
    2\t            0.1\t         {}
    3\t             10\t         {}

#end
"""
IN_SHEAR = MODES.format(*(number / 3 for number in (4e6, 2e6, 1e6)))
LAYOUTS = {
    "moduli": (PRONY, {}),
    "an infinite time in a sign": (PRONY.replace("inf", "∞"), {}),
    "relaxation times and moduli": (
        PRONY.replace("tau", "Relaxation time").replace("E_i", "Young's modulus"), {}),
    "units below, modes counted": (
        "mode;λ_i;E_i\n-;ms;kPa\n1;1;4000\n2;100;2000\n3;10000;1000\n4;inf;3000\n", {}),
    "units of the user": (
        PRONY.replace(" [s]", "").replace(" [MPa]", ""),
        {"units": {"time": "s", "modulus": "MPa"}}),
    "equilibrium above": ("E_inf = 3 MPa\n" + PRONY.replace("inf,3\n", ""), {}),
    "equilibrium below": (PRONY.replace("inf,3", "E_inf,3"), {}),
    "equilibrium of the user": (PRONY.replace("inf,3\n", ""), {"equilibrium": 3e6}),
    "shear": (PRONY.replace("E_i", "G_i"), {"poisson": 0.5, "factor": 3}),
    "shear, said by the user": (
        PRONY.replace("tau", "relaxation time").replace("E_i", "modulus"),
        {"deformation": "shear", "poisson": 0.5, "factor": 3}),
    "ratios and a modulus": ("# E0 = 10 MPa\n# g_i, tau_i [s]\n.4,1e-3\n.2,.1\n.1,10\n", {}),
    "ratios, one of the equilibrium": ("tau_i [s],g_i\n1e-3,.4\n.1,.2\n10,.1\ninf,.3\n",
                                       {"glassy": 1e7}),
    "ratios and the long-time modulus of the user": ("tau_i [s],g_i\n1e-3,.4\n.1,.2\n10,.1\n",
                                                     {"equilibrium": 3e6}),
    "pyvisco": ("i,tau_i,alpha_i,E_0,E_i\n-,s,-,MPa,MPa\n"
                "1,1e-3,0.4,10,4\n2,0.1,0.2,10,2\n3,10,0.1,10,1\n", {}),
    "RepTate": (IN_SHEAR, {"equilibrium": 3e6, "poisson": 0.5}),
    "Abaqus": (ABAQUS, {}),
    "Abaqus, a mark of byte order": ("\ufeff" + ABAQUS, {}),
    "Abaqus, long-term modulus in mm and MPa": (
        "** units: mm, N, MPa, s\n" + ABAQUS.replace("INSTANTANEOUS", "LONG TERM")
        .replace("1.0E7", "3."), {}),
    "Abaqus, long-term by default": (
        ABAQUS.replace(", MODULI=INSTANTANEOUS", "").replace("1.0E7", "3e6"), {}),
    "Abaqus, hyperelastic": (NEOHOOKE.replace("1.0E7, 0.49", f"{1e7 / 6}, 0.0"), {}),
    "Ansys": (ANSYS, {}),
    "Ansys, hyperelastic": (
        ANSYS.replace("MP,EX,7,E0\nMP,NUXY,7,0.49", f"TB,HYPER,7,1,2,NEO\nTBDATA,1,{1e7 / 3},0"),
        {}),
}  # fmt: skip


def check(material, modulus=MODULUS, rtol=1e-12):
    np.testing.assert_allclose(material.modulus(OMEGA), modulus, rtol=rtol)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_series_has_the_modulus_of_its_sum_in_every_layout(tmp_path, layout):
    text, options = LAYOUTS[layout]
    factor = options.get("factor", 1)
    given = {name: value for name, value in options.items() if name != "factor"}
    path = write(tmp_path, text, "series.txt")
    check(read_prony(path, **given), factor * MODULUS)
    for hints in ({}, {"kind": "relaxation"}, {"kind": "relaxation", "units": {"modulus": "MPa"}}):
        with pytest.raises(ValueError, match=r"Prony series"):
            read_moduli(path, **hints)


@pytest.mark.parametrize("form", PRONY_CARDS)
def test_an_exported_card_is_read_back_with_its_numbers(tmp_path, form):
    law = gc.WLF(4.57, 113.6, 298.15)
    for i, material in enumerate((
        gc.tyre_tread(poisson=0.49),
        gc.Prony(1e6 / 3, [2e9 / 3, 1e7 / 7], [1e-9 / 3, 1 / 3], 1 / 3, law),
    )):  # fmt: skip
        found = read_prony(write(tmp_path, export_prony(material, form, name="tread"), f"{i}.txt"))
        for name in ("equilibrium", "strengths", "times", "poisson"):
            # Items have 13 digits; the equilibrium modulus is a small remainder of them.
            loss = float(material.glassy / material.equilibrium) if name == "equilibrium" else 1
            exact = getattr(material, name)
            np.testing.assert_allclose(getattr(found, name), exact, 1e-12 * loss, err_msg=name)
        for name in ("c1", "c2", "reference"):
            same = getattr(found.shift, name), getattr(material.shift, name)
            np.testing.assert_allclose(*same, rtol=1e-12)


# E_inf = 3 MPa, with 50, 20 and 5 MPa at 0.1 ms, 10 ms and 1 s.
LINE = "E_inf = 3 MPa\n"


def refused(tmp_path, text, match, **options):
    with pytest.raises(ValueError, match=match):
        read_prony(write(tmp_path, text), **options)
