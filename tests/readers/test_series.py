"""Prony series in the layouts of programs: one solid, E(ω) summed here by complex arithmetic."""

import logging

import numpy as np
import pytest
from test_instrument_exports import workbook, write

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


def test_hints_make_no_relaxation_modulus_of_a_series(tmp_path):
    """The names of its columns state what they hold."""
    path = write(tmp_path, PRONY)
    with pytest.raises(ValueError, match=r"a Prony series .*`readers.read_prony` reads it"):
        read_moduli(path, columns={"time": 1, "modulus": 2}, kind="relaxation")
    for text in ("1e-3 4\n1e-1 2\n10 1\ninf 3\n", "time [s],E(t) [MPa]\n1,4\n10,2\ninf,1\n"):
        with pytest.raises(ValueError, match="infinite time"):
            path = write(tmp_path, text)
            units = {"time": "s", "modulus": "MPa"}
            read_moduli(path, columns={"time": 1, "modulus": 2}, units=units, kind="relaxation")


def test_a_table_that_may_be_either_is_asked_about_and_a_relaxation_modulus_is_read(tmp_path):
    text = "tau [s],E [MPa]\n1e-3,4\n1e-1,2\n10,1\n"
    path = write(tmp_path, text)
    with pytest.raises(
        ValueError, match=r"may be a Prony series .* or a relaxation modulus E\(t\)"
    ):
        read_moduli(path)
    measured = read_moduli(path, columns={"time": 1, "modulus": 2})
    np.testing.assert_allclose(measured.values, [4e6, 2e6, 1e6])
    assert read_prony(path, equilibrium=3e6).equilibrium == 3e6
    for names in ("time [s],E(t) [MPa]", "Time [s],Relaxation modulus [MPa]"):
        measured = read_moduli(write(tmp_path, text.replace("tau [s],E [MPa]", names)))
        assert measured.kind == "relaxation"
        np.testing.assert_allclose(measured.values, [4e6, 2e6, 1e6])


def test_a_sweep_beside_modes_is_read_and_so_are_the_modes(tmp_path):
    sweep = [["f [Hz]", "E' [MPa]", "E'' [MPa]"], [1, 3, 0.2], [2, 3.1, 0.3]]
    modes = [["tau [s]", "E_i [MPa]"], [1e-3, 4], [0.1, 2], [10, 1], ["inf", 3]]
    path = workbook(tmp_path / "a.xlsx", {"data": sweep, "modes": modes})
    assert len(read_moduli(path).abscissa) == 2
    check(read_prony(path))


@pytest.mark.parametrize(
    "text, options, expected",
    [
        (PRONY.replace(" [s]", ""), {}, r"the time has no unit: .*`units=\{'time': 's'\}`"),
        (PRONY.replace(" [MPa]", ""), {}, r"modulus has no unit: .*`units=\{'modulus': 'MPa'\}`"),
        (PRONY, {"units": {"modulus": "1/MPa"}}, "states 'MPa'; leave out `units=.*"),
        (PRONY, {"deformation": "shear"}, "states 'tension'; leave out `deformation='shear'`"),
        (PRONY, {"equilibrium": 1e6}, "it has a row of the equilibrium: leave out `equilibrium`"),
        (PRONY.replace("tau", "relaxation time").replace("E_i", "modulus"), {},
         "says tension or shear: pass `deformation='tension'` or `deformation='shear'`"),
        ("tau_i [s],g_i\n1e-3,.4\n.1,.2\n", {}, "ratios need a modulus: pass .* as `glassy`"),
        ("tau_i [s],g_i\n1e-3,.9\n.1,.2\n", {"glassy": 1e7},
         "add up to 1.1, which is more than 1; perhaps they are moduli\\.$"),
        ("tau_i [s],E_i [MPa]\n1e-3,4\n-0.1,2\n", {}, "relaxation times must be positive"),
        (ABAQUS.replace("PRONY", "RELAXATION TEST DATA"), {}, "TIME=RELAXATION TEST DATA holds te"),
        (ABAQUS.replace("TIME=PRONY", "FREQUENCY=TABULAR"), {}, "FREQUENCY=TABULAR holds test"),
        (ABAQUS.replace("1.0E7", "5e4"), {}, "the modulus has no unit"),  # kPa, or tens of GPa
        (NEOHOOKE.replace("NEO HOOKE", "OGDEN, N=2"), {}, "HYPERELASTIC, OGDEN, .* is not known"),
        (ELASTIC, {}, r"without a \*VISCOELASTIC: its materials are elastic"),
        (ABAQUS + ABAQUS.replace("RUBBER", "OTHER"), {}, r"\['RUBBER', 'OTHER'\]: .* as `sheet`"),
        (ANSYS.replace("NUXY", "EX,7,1,1\nMP,NUXY"), {}, "MP,EX depends on temperature"),
        ("time [s],E(t) [MPa]\n1,4\n10,2\n", {}, None),
        ("f [Hz],E' [MPa],E'' [MPa]\n1,4,1\n10,2,1\n", {}, "it holds no Prony series"),
    ],
)  # fmt: skip
def test_what_a_series_lacks_is_asked_for_by_its_argument(tmp_path, text, options, expected):
    path = write(tmp_path, text, "series.txt")
    if expected is None:  # who asks for a series says what the table is
        assert read_prony(path, equilibrium=1e6).equilibrium == 1e6
        return
    with pytest.raises(ValueError, match=f"series.txt` is refused: .*{expected}"):
        read_prony(path, **options)


def test_one_of_several_materials_is_chosen(tmp_path):
    two = ABAQUS + ABAQUS.replace("RUBBER", "OTHER").replace("1.0E7", "2.0E7")
    check(read_prony(write(tmp_path, two), sheet="OTHER"), 2 * MODULUS)


def test_what_is_assumed_of_a_deck_is_a_warning(tmp_path, caplog):
    """A deck without units in mm and MPa; a bulk modulus that does not relax."""
    path = write(tmp_path, ABAQUS.replace("1.0E7", "10.").replace("0.4,0.4", "0.4,"))
    with caplog.at_level(logging.INFO, "graded_contact"):
        found = read_prony(path)
    np.testing.assert_allclose(found.equilibrium, 3e6)
    told = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert told[0].startswith("The modulus is assumed to be in MPa")
    assert told[1].startswith("The time is assumed to be in s")
    # ν = 0.49: K = 50/3 E; G falls to 0.3 G, K to 0.7 K.
    shear, bulk = 0.3 / (2 * 1.49), 0.7 / (3 * 0.02)
    exact = 9 * bulk * shear / (3 * bulk + shear)
    assert f"up to {abs(exact / 0.3 - 1):.1%} off" in told[2]


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


def test_a_scene_table_keeps_a_table_of_shifts_and_what_was_assumed(tmp_path, caplog):
    shift = gc.materials.TabulatedShift([280.0, 300.0], [0.7, 0.0], 300.0)
    material = gc.Prony(1e6, [2e6], [0.1], 0.4, shift)
    text = export_prony(material, "toml", name="tread") + 'assumed = ["Read as tension."]\n'
    with caplog.at_level(logging.WARNING, "graded_contact"):
        found = read_prony(write(tmp_path, text, "tread.toml"))
    assert float(found.at(290.0).times[0]) == float(material.at(290.0).times[0])
    assert [record.message for record in caplog.records] == ["Read as tension."]
    with pytest.raises(ValueError, match="its material of kind 'prony' is not complete"):
        read_prony(write(tmp_path, text.replace("strengths", "strength"), "tread.toml"))


# E_inf = 3 MPa, with 50, 20 and 5 MPa at 0.1 ms, 10 ms and 1 s.
LINE = "E_inf = 3 MPa\n"
ROWS = "tau [s];E_i [MPa]\n0.0001;50\n{}\n1;5\n"
SHARES = "# E_0 = 78 MPa\n# E_inf = 3 MPa\ntau [s];g_i\n1e-4;0.641\n1e-2;0.2564\n1;0.0641\n"
SIDE = "tau [s],E_i [MPa],{}\n1e-4,50,1e-3,40\n1,20,2,10\n"


def refused(tmp_path, text, match, **options):
    with pytest.raises(ValueError, match=match):
        read_prony(write(tmp_path, text), **options)


@pytest.mark.parametrize("row", [
    *(f"{time};20" for time in (
        "0,01", "1e-2 s", "10^-2", "1 e-2", "<0.01", "~0.01", "1E-2*", "", "-", "nan", "1e400", "x",
    )),
    *(f"0.01;{modulus}" for modulus in ("20 MPa", "20,0", "2O", "", "inf")),
    "0.01", "1e-2 s;20 MPa", "n.d.;n.d.", "0.01;20;7",
])  # fmt: skip
def test_a_row_that_is_no_branch_is_refused_and_not_dropped(tmp_path, row):
    assert len(read_prony(write(tmp_path, LINE + ROWS.format("0.01;20"))).times) == 3
    refused(tmp_path, LINE + ROWS.format(row), "a Prony series, but line 4 has .* correct it")


@pytest.mark.parametrize("text", [
    SIDE.format("tau [s],E_i [MPa]"), SIDE.format("Relaxation time [s],E [MPa]"),
    PRONY + "\ntau [ms],E_i [kPa]\n1,2\n3,4\n", PRONY + "tau [ms],E_i [kPa]\n1,2\n3,4\n",
])  # fmt: skip
def test_a_second_series_is_refused(tmp_path, text):
    refused(tmp_path, text, "one series per file, or one per sheet|above another table")


def test_one_series_in_two_units_and_other_tables_below_are_read(tmp_path):
    text = "tau [s],tau [ms],E_i [MPa]\n1e-3,1,4\n1e-1,100,2\n10,10000,1\ninf,inf,3\n"
    check(read_prony(write(tmp_path, text + "\nT [C],a_T\n20,1\n30,0.1\n")))


def test_e_and_g_of_one_file_are_converted_by_a_known_poisson_s_ratio(tmp_path):
    """E = 2(1 + ν)G, with ν = 0.4: 2.8."""
    rubber = LINE + "tau [s],G_i [MPa]\n1,2\n"
    refused(tmp_path, rubber, "moduli in shear and in tension: pass `poisson`")
    for text, options in ((rubber, {"poisson": 0.4}), ("nu = 0.4\n" + rubber, {})):
        found = read_prony(write(tmp_path, text), **options)
        np.testing.assert_allclose([found.equilibrium, *found.strengths], [3e6, 5.6e6])
    reverse = "G_{inf} = 1 MPa\ntau [s],E_i [MPa]\n1,2\n"
    found = read_prony(write(tmp_path, reverse), poisson=0.4)
    np.testing.assert_allclose([found.equilibrium, *found.strengths], [2.8e6, 2e6])


def test_a_modulus_without_a_unit_is_asked_for_its_unit(tmp_path):
    text = "# E_inf: {}\n" + ROWS.format("0.01;20")
    refused(tmp_path, text.format("3e6"), "'E_inf: 3e6' has no unit: .*`units=.'modulus': 'MPa'.`")
    found = read_prony(write(tmp_path, text.format("3")), units={"modulus": "MPa"})
    assert found.equilibrium == 3e6
    table = "tau_i [s],E_0 [GPa],E_i [MPa]\n1,0.01,5\n2,0.01,2\n"
    np.testing.assert_allclose(read_prony(write(tmp_path, table)).equilibrium, 3e6)


@pytest.mark.parametrize("text, expected", [
    ("E_0 = 100 MPa\n" + LINE + ROWS.format("0.01;20"), r"1e\+08 Pa is not the sum .* 7.5e\+07"),
    (SHARES.replace("1e-2;0.2564\n", ""), r"7.8e\+07 Pa is not the sum .* 3e\+06 Pa"),
    (LINE + "E_inf = 4 MPa\n" + ROWS.format("0.01;20"), "'E_inf = 3 MPa' and 'E_inf = 4 MPa'"),
    (LINE + PRONY.replace("inf,3", "inf,4"), r"row of the equilibrium has 4e\+06 Pa, but"),
    (LINE.replace("3", "3,000") + PRONY, "'E_inf = 3 000': are its digits one number"),
    (LINE.replace("3", "3,000") + ROWS.format("0.01;20"), "3,000 MPa': are its digits one number"),
])  # fmt: skip
def test_statements_that_contradict_each_other_are_refused(tmp_path, text, expected):
    refused(tmp_path, text, expected)


def test_statements_that_agree_are_read(tmp_path):
    check(read_prony(write(tmp_path, "E_0 = 10 MPa\n" + LINE + PRONY)))
    found = read_prony(write(tmp_path, SHARES))
    np.testing.assert_allclose(found.strengths, [50e6, 20e6, 5e6], rtol=1e-3)
    assert found.equilibrium == 3e6


@pytest.mark.parametrize("last", [
    *("unendlich", "infini", "eq", "oo", "inf.", "Gleichgewicht", "équilibre", "1e99"),
])  # fmt: skip
def test_the_row_of_the_equilibrium_is_known_by_its_words(tmp_path, last):
    check(read_prony(write(tmp_path, PRONY.replace("inf", last))))
    ratios = f"tau_i [s],g_i\n1e-3,.4\n.1,.2\n10,.1\n{last},.3\n"
    check(read_prony(write(tmp_path, ratios), glassy=1e7))


def test_the_row_of_the_equilibrium_is_known_by_its_label(tmp_path):
    check(read_prony(write(tmp_path, "i,tau [s],E_i [MPa]\n1,1e-3,4\n2,.1,2\n3,10,1\ninf,,3\n")))


@pytest.mark.parametrize("line", [
    "Gleichgewichtsmodul: 3 MPa", "Module à l'équilibre : 3 MPa", "rubbery plateau 3 MPa",
    "Langzeit-E-Modul = 3 MPa", "equilibrium Young’s modulus: 3 MPa", "module caoutchoutique 3 MPa",
    "E_{inf} = 3,0 MPa", "Glasmodul: 10 MPa", "module instantané : 10 MPa", "E_0 [kPa] = 10000",
])  # fmt: skip
def test_a_line_states_a_modulus_in_the_words_of_three_languages(tmp_path, line):
    check(read_prony(write(tmp_path, f"{line}\n" + PRONY.replace("inf,3\n", "").replace(",", ";"))))


def test_a_unit_that_is_not_known_is_refused_with_those_that_are(tmp_path):
    (tmp_path / "a.csv").write_text("tau;E_i\n1e-3;4\n10;1\ninf;3\n")
    with pytest.raises(ValueError, match=r"'modulus': '1'.* is refused: use one of \['Pa'"):
        read_prony(tmp_path / "a.csv", units={"modulus": "1", "time": "s"})
