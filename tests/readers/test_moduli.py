"""Files in many layouts are written here and read back; measured files are beside the project."""

import io
import re
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from test_instrument_exports import (
    HERTZ,
    LOSS,
    MODULUS,
    OMEGA,
    STORAGE,
    check,
    read,
    rows,
    workbook,
    write,
)  # fmt: skip

from graded_contact import read_moduli
from graded_contact.materials.table import Tabulated

DATA = Path(__file__).parents[3] / "shared" / "data" / "rheology"

PLAIN = "f, E', E''\nHz, MPa, MPa\n10, 3, 0.4\n\n# a note\n0.1, 1, 0.2\n1, 2, 0.3\n"


def written(folder, names, columns, separator=",", units=None):
    """A file of columns of numbers, each with 17 digits."""
    numbers = (map(repr, map(float, row)) for row in zip(*columns, strict=True))
    lines = map(separator.join, [names, *([units] if units else []), *numbers])
    return write(folder, "\r\n".join(lines) + "\r\n")


# Measured files: the ranges of RHEOLOGY.md's table, found with other code.


def data(name):
    if not (DATA / name).exists():
        pytest.skip(f"{name} is not beside this checkout")
    return DATA / name


SI_TIME = {"kind": "relaxation", "units": {"time": "s", "modulus": "Pa"}}
POLYMERS = [
    ("pyvisco_freq_user_master.csv", {}, 206, (6.3e-12, 6.3e14), (8.88e7, 9.58e9),
     (1.04e7, 8.74e8)),
    ("pyvisco_eplexor_master.csv", {}, 210, (5.2e-5, 2.5e18), (8e7, 1.02e10), (8.94e6, 9.31e8)),
    ("reptate_PI_634k_T-35.tts", {}, 159, (4.3e-8, 1.2e2), (144, 1.02e6), (3.7e3, 1.08e6)),
    ("pyvisco_time_user_master.csv", {}, 481, (0.0028, 1.4e28), (8.57e7, 1.71e9), None),
    ("pp_stress_relaxation.csv", SI_TIME, 76, (0.001, 1.1e4), (1.47e8, 3.73e8), None),
    ("respect_time_test3.dat", SI_TIME, 200, (0.0001, 1e4), (0.304, 238), None),
]  # fmt: skip


@pytest.mark.parametrize("name, options, count, abscissa, storage, loss", POLYMERS)
def test_measured_files_have_the_tabulated_ranges(name, options, count, abscissa, storage, loss):
    measured = read_moduli(data(name), **options)
    assert measured.kind == ("frequency" if loss else "relaxation")
    assert len(measured.abscissa) == count and len(measured.isotherms()) == 1
    assert np.all(np.diff(measured.abscissa) > 0)
    parts = (measured.abscissa, np.real(measured.values), np.imag(measured.values))
    for values, limits in zip(parts, (abscissa, storage, loss), strict=True):
        if limits:  # the table has two or three digits
            np.testing.assert_allclose([np.min(values), np.max(values)], limits, rtol=0.03)


ISOTHERMS = [
    ("pyvisco_freq_user_raw.csv", {}, 210, 21, (-50, 100), "tension"),
    ("epdm70_tf_015p.csv", {}, 210, 10, (-10, 53), "shear"),
    ("vinylfoam_dma_raw.csv", {"units": {"modulus": "MPa"}}, 209, 19, (-35, 60), "tension"),
    ("reptate_PI600k_raw_isotherms.csv", {}, 159, 9, (-40, 100), "shear"),
]


@pytest.mark.parametrize("name, options, count, isotherms, celsius, deformation", ISOTHERMS)
def test_measured_isotherms_are_separated(name, options, count, isotherms, celsius, deformation):
    measured = read_moduli(data(name), **options)
    assert len(measured.abscissa) == count and measured.deformation == deformation
    parts = measured.isotherms()
    assert len(parts) == isotherms and sum(len(part.lines) for part in parts) == count
    means = np.array([np.mean(part.temperature) for part in parts])
    assert np.all(np.diff(means) > 2)
    np.testing.assert_allclose(means[[0, -1]] - 273.15, celsius, atol=0.3)
    for part in parts:
        assert np.ptp(part.temperature) < 0.4 and np.all(np.diff(part.abscissa) >= 0)


def test_the_eplexor_workbook_is_read_as_its_decoded_form():
    pytest.importorskip("xlrd")
    workbook = read_moduli(data("pyvisco_freq_Eplexor_master.xls"))
    decoded = read_moduli(data("pyvisco_eplexor_master.csv"))
    check(workbook, decoded.abscissa, decoded.values, rtol=1e-14)
    assert any("tan delta of column 16 (tan delta) agrees" in note for note in workbook.history)
    np.testing.assert_allclose(workbook.temperature, 24.97374 + 273.15)


def test_creep_curves_side_by_side_become_isotherms():
    celsius = np.array([144.9, 133.8, 125, 114.5, 109.6, 106.7, 104.5, 101.8, 100.6, 97])
    measured = read_moduli(
        data("plazek1965_ps_creep_isotherms.csv"),
        kind="creep",
        units={"time": "s", "compliance": "cm2/dyn"},
        temperature=celsius + 273.15,
    )
    parts = measured.isotherms()
    np.testing.assert_allclose([part.temperature[0] - 273.15 for part in parts], celsius[::-1])
    raw = np.genfromtxt(DATA / "plazek1965_ps_creep_isotherms.csv", delimiter=",", skip_header=2)
    for i, part in enumerate(parts):
        time, compliance = raw[:, 2 * (9 - i)], raw[:, 2 * (9 - i) + 1]
        there = np.isfinite(time)
        order = np.argsort(time[there], kind="stable")
        np.testing.assert_array_equal(part.abscissa, time[there][order])
        np.testing.assert_allclose(part.values, 10 * compliance[there][order], rtol=1e-14)


# Layouts, each with the same four points.


@pytest.mark.parametrize(
    "names, units, scales",
    [
        (["Angular frequency (rad/s)", "E' / GPa", 'E" / GPa'], None, (2 * np.pi, 1e-9, 1e-9)),
        (["ω", "E′ [Pa]", "E″ [Pa]"], ["s⁻¹", "", ""], (2 * np.pi, 1, 1)),
        (["freq_khz", "E_storage_mpa", "E_loss_mpa"], None, (1e-3, 1e-6, 1e-6)),
        (["Frequency", "Storage modulus", "Loss modulus"], ["Hz", "psi", "psi"],
         (1, 1 / 6894.757293168361, 1 / 6894.757293168361)),
        (["w", "E1 (N/mm²)", "E2 (dyn/cm^2)"], ["rad·s^-1", "", ""], (2 * np.pi, 1e-6, 10)),
    ],
)  # fmt: skip
def test_names_and_units_of_columns(tmp_path, names, units, scales):
    columns = [scale * c for scale, c in zip(scales, (HERTZ, STORAGE, LOSS), strict=True)]
    check(read_moduli(written(tmp_path, names, columns, ";", units)))


@pytest.mark.parametrize(
    "names, columns",
    [
        (["E' [Pa]", "tan delta"], [STORAGE, LOSS / STORAGE]),
        (["E' [Pa]", "tan(δ) [%]"], [STORAGE, 100 * LOSS / STORAGE]),
        (["|E*| [Pa]", "Phase angle [°]"], [abs(MODULUS), np.degrees(np.angle(MODULUS))]),
        (["E* [Pa]", "delta [rad]"], [abs(MODULUS), np.angle(MODULUS)]),
        (["Loss modulus [Pa]", "Loss factor"], [LOSS, LOSS / STORAGE]),
    ],
)
def test_tan_delta_phase_and_magnitude_stand_for_a_modulus(tmp_path, names, columns):
    check(read_moduli(written(tmp_path, ["f", *names], [HERTZ, *columns])))


@pytest.mark.parametrize(
    "scale, name, column, warning",
    [
        (1, "tan delta", LOSS / STORAGE * [1, 1, 1.5, 1], "33 % in line 4"),
        (1e-6, "strain", HERTZ, "1.25 to 25 Pa"),
        (1, "T_C", [20, 20.9, 21.8, 22.7], "drifts by 2.7 K"),
    ],
)
def test_doubtful_columns_are_warned_of(tmp_path, scale, name, column, warning):
    columns = [HERTZ, scale * STORAGE, scale * LOSS, column]
    path = written(tmp_path, ["f", "E' [Pa]", "E'' [Pa]", name], columns)
    assert any(warning in note for note in read_moduli(path).history)


QUOTED = "".join(
    f'"{f}","{storage}","{loss}"\n'.replace(".", ",")
    for f, storage, loss in zip(HERTZ, STORAGE, LOSS, strict=True)
)


@pytest.mark.parametrize(
    "text, options",
    [
        ("# omega E'[Pa] E''[Pa]\n" + rows(OMEGA, STORAGE, LOSS, separator=" "), {}),  # NumPy's
        ("omega\tE'\tE''\n" + rows(OMEGA, STORAGE, LOSS), {"units": {"modulus": "Pa"}}),
        ("f\tE'\tE''\n" + rows(HERTZ, STORAGE, LOSS), {"units": {"modulus": "Pa"}}),
        ('"f, in Hz","E\' [Pa]","E\'\' [Pa]"\n' + QUOTED, {}),
    ],
)
def test_headings_as_comments_without_units_and_in_quotes(tmp_path, text, options):
    """A frequency without a unit goes by its name: f is in Hz, omega in rad/s."""
    check(read(tmp_path, text, **options))


def test_curves_side_by_side_with_temperatures_in_their_titles(tmp_path):
    text = "at 80 °C,,,at 60.5 °C,,\nf,E',E'',f,E',E''\nHz,Pa,Pa,Hz,Pa,Pa\n"
    text += rows(HERTZ, STORAGE, LOSS, HERTZ, 2 * STORAGE, 2 * LOSS, separator=",")
    text = text[: text.rindex(",100,")] + ",,,\n"  # one curve is shorter
    cold, hot = read(tmp_path, text).isotherms()
    check(hot)
    check(cold, OMEGA[:3], 2 * MODULUS[:3])
    np.testing.assert_allclose([cold.temperature[0], hot.temperature[0]], [333.65, 353.15])


def test_workbooks_are_read_from_the_sheet_that_is_understood(tmp_path):
    columns = zip(HERTZ, STORAGE / 1e6, LOSS / 1e6, strict=True)
    # One column was imported as text with decimal commas.
    numbers = [[None, f, str(storage).replace(".", ","), loss] for f, storage, loss in columns]
    heads = [["device", "DMA 7"], [None, "f", "E'", "E''"], [None, "Hz", "MPa", "MPa"]]
    other = [["f [Hz]", "E' [Pa]", "E'' [Pa]"], [1, 3e6, 2e5], [2, 3e6, 2e5]]
    sheets = {"Sheet": [["a note"]], "sweep": [*heads, *numbers], "other": other}
    path = workbook(tmp_path / "a.xlsx", sheets)
    check(read_moduli(path))
    measured = read_moduli(path, sheet="other")
    check(measured, 2 * np.pi * np.array([1.0, 2.0]), np.full(2, 3e6 + 2e5j))
    with pytest.raises(ValueError, match=r"no `sheet='x'`, only \['Sheet', 'sweep', 'other'\]"):
        read_moduli(path, sheet="x")


# Kinds, overrides, and what is recorded.


def test_replicates_side_by_side_are_numbered_and_chosen_by_number(tmp_path):
    """Columns of one name, on a sheet behind one of single frequencies; then repeated lanes."""
    f, ones = np.array([1.0, 2.0, 4.0, 8.0]), np.ones(4)
    names = ["f (Hz)", *3 * ["G' (Pa)"], *3 * ["G'' (Pa)"]]
    values = [f, *(k * 1e6 * f for k in (1, 2, 3)), *(k * 1e5 * f for k in (1, 2, 3))]
    table = [names, *np.transpose(values).tolist()]
    single = [names, *np.transpose([10 * ones, *values[1:]]).tolist()]
    path = tmp_path / "a.xlsx"
    workbook(path, {"grade": single, "sweep": table})
    with pytest.raises(ValueError) as found:
        read_moduli(path)
    told = str(found.value)
    assert "pass `sheet='sweep'`, which holds a sweep" in told and "'grade'" not in told
    assert all(f"column {i} (G' (Pa))" in told for i in (2, 3, 4)), told
    assert "for instance by `columns={'storage': 2, 'loss': 5}`" in told
    third = read_moduli(path, sheet="sweep", columns={"storage": 4, "loss": 7})
    np.testing.assert_allclose(third.values, (3e6 + 3e5j) * f)
    # The same lanes side by side: two materials, each at two temperatures.
    lane = np.transpose([[20, 20, 50, 50], [1, 2, 1, 2], 1e6 * f, 1e5 * f])
    names = ["T (°C)", "f (Hz)", "G' (Pa)", "G'' (Pa)"]
    rows = [2 * names, *np.hstack([lane, lane * [1, 1, 7, 7]]).tolist()]
    text = "\n".join(",".join(map(str, row)) for row in rows)
    (tmp_path / "b.csv").write_text(text)
    with pytest.raises(ValueError, match="side by side, numbers above 4 in `columns` choose one"):
        read_moduli(tmp_path / "b.csv")
    numbers = {"temperature": 5, "frequency": 6, "storage": 7, "loss": 8}
    second = read_moduli(tmp_path / "b.csv", columns=numbers)
    np.testing.assert_allclose(second.values, 7 * (1e6 + 1e5j) * f)


@pytest.mark.parametrize("apart", [None, ",", ",,"])
def test_every_point_of_three_replicates_is_used_or_left_out_with_a_reason(tmp_path, apart):
    """Below one another, or side by side with an empty column between them or none."""
    names = "f [Hz],G' [Pa],G'' [Pa]"
    curves = [[f"{10 ** (k / 7):.6g},{1e5 + k},{1e4 + k}" for k in range(21)] for _ in range(3)]
    curves[0][4], curves[0][5], curves[1][4] = "2,,3e4", "2.5,broken,3e4", "2,-1,3e4"
    curves[1][12:], curves[2][15:] = [",,"] * 9, [",,"] * 6  # these end above the others
    rows = [names, *curves[0], *curves[1], *curves[2]]
    if apart is not None:
        rows = [apart.join(3 * [names]), *map(apart.join, zip(*curves, strict=True))]
    path = write(tmp_path, "\n".join(row for row in rows if row.strip(",")) + "\n")
    measured = read_moduli(path, temperature=298.0)
    total = 48 if apart is None else 63  # rows without a cell are no rows
    if apart is not None:
        assert f"{len(measured.abscissa)} of 63 points are used." in measured.history
    left = [re.search(r"(\d+) (?:row|point).s., line", note) for note in measured.history]
    assert len(measured.abscissa) == 45
    assert 45 + sum(int(found[1]) for found in left if found) == total, measured.history


def test_empty_places_of_a_curve_side_by_side_are_counted(tmp_path):
    text = "f (Hz),G' (Pa),G'' (Pa),f (Hz),G' (Pa),G'' (Pa)\n"
    text += "1,1e6,1e5,1,2e6,2e5\n2,1e6,1e5,2,2e6,2e5\n4,1e6,1e5,,,\n8,1e6,1e5,,,\n"
    (tmp_path / "a.csv").write_text(text)
    measured = read_moduli(tmp_path / "a.csv")
    assert len(measured.abscissa) == 6
    assert "Left out for an empty curve 2 of 2: 2 row(s), line 4-5." in measured.history
    assert len(measured.isotherms()) == 2
    joined = read_moduli(tmp_path / "a.csv", temperature=298.0)  # replicates
    assert len(joined.isotherms()) == 1 and len(joined.abscissa) == 6
    two = read_moduli(tmp_path / "a.csv", temperature=[320.0, 298.0]).isotherms()
    assert [len(each.abscissa) for each in two] == [2, 4]


def test_poissons_ratio_converts_shear_moduli_and_compliances(tmp_path):
    path = written(tmp_path, ["f_Hz", "G_storage_pa", "G_loss_pa"], [HERTZ, STORAGE, LOSS])
    measured = read_moduli(path)
    assert measured.deformation == "shear" and measured.temperature is None
    np.testing.assert_array_equal(measured.values, MODULUS)
    with pytest.raises(ValueError, match=r"in shear; a table needs"):
        measured.table()
    check(read_moduli(path, poisson=0.4), modulus=2.8 * MODULUS)
    with pytest.raises(ValueError, match="states 'shear'; leave out `deformation='tension'`"):
        read_moduli(path, deformation="tension")
    path = written(tmp_path, ["t [min]", "G(t) [kPa]"], [[0.0, 1, 10], [9.0, 5, 2]])
    measured = read_moduli(path, poisson=0.25)
    assert (measured.kind, measured.deformation) == ("relaxation", "tension")
    np.testing.assert_allclose(measured.abscissa, [60, 600])
    np.testing.assert_allclose(measured.values, [12.5e3, 5e3])
    assert any("time 0: 1 row(s), line 2" in note for note in measured.history)
    path = written(tmp_path, ["Time [s]", "Creep compliance J(t) [1/MPa]"], [[1, 10], [2.0, 5]])
    measured = read_moduli(path)
    assert (measured.kind, measured.deformation) == ("creep", "shear")
    np.testing.assert_allclose(measured.values, [2e-6, 5e-6])
    np.testing.assert_allclose(read_moduli(path, poisson=0.25).values, [0.8e-6, 2e-6])


def test_everything_can_be_overridden(tmp_path):
    path = written(tmp_path, ["a", "b", "c", "d"], [LOSS, HERTZ, [1, 2, 3, 4], STORAGE])
    columns = {"frequency": "b", "storage": 4, "loss": "a"}
    units = {"frequency": "rad/s", "modulus": "kPa"}
    measured = read_moduli(
        path, columns=columns, units=units, temperature=300.0, deformation="tension"
    )
    check(measured, HERTZ, 1e3 * MODULUS)
    assert set(measured.temperature) == {300.0}
    assert "Column 2 (b): frequency in rad/s, as given in `units`." in measured.history
    assert "Not used: 'c'." in measured.history


def test_both_deformations_in_a_file_are_chosen_between(tmp_path):
    names = ["f", "E' [Pa]", "E'' [Pa]", "G' [Pa]", "G'' [Pa]"]
    path = written(tmp_path, names, [HERTZ, STORAGE, LOSS, STORAGE / 3, LOSS / 3])
    with pytest.raises(ValueError, match=r"column 2 \(E' \[Pa\]\) and column 4 .* `deformation`"):
        read_moduli(path)
    check(read_moduli(path, deformation="tension"))
    check(read_moduli(path, deformation="shear", poisson=0.5))


def test_a_table_makes_a_material_and_repeats_are_refused_by_line(tmp_path):
    measured = read(tmp_path, PLAIN)
    material = Tabulated(*measured.table())
    np.testing.assert_allclose(material.modulus(2 * np.pi), 2e6 + 3e5j)
    repeated = read(tmp_path, PLAIN + "10, 5, 0.1\n")
    assert any("lines 3 and 8" in note for note in repeated.history)
    with pytest.raises(ValueError, match=r"table.csv`, lines 3 and 8: both have the frequency"):
        repeated.table()


# Rows that cannot be used.


@pytest.mark.parametrize(
    "row, sentence",
    [
        ("1, 2, ?", r"column 3 .E''., where the loss must be a number: 1 row.s., line 7 .'\?'."),
        ("1, -2, 0.3", r"column 2 .E'., where the storage must be a positive .* line 7 .'-2'."),
        (
            "1e999, 2, 0.3",
            r"column 1 .f., where the frequency must be a number: .* line 7 .'1e999'.",
        ),
        ("1,5, 2, 0,3", "5 entries in 3 columns: 1 row.s., line 7."),
        ("1, --, 0.3", "a missing value: 1 row.s., line 7."),
    ],
)
def test_a_row_that_cannot_be_used_is_left_out_with_line_and_reason(tmp_path, row, sentence):
    measured = read(tmp_path, PLAIN.replace("1, 2, 0.3", row))
    np.testing.assert_allclose(measured.values, [1e6 + 0.2e6j, 3e6 + 0.4e6j])
    assert any(re.match(f"Left out for {sentence}", note) for note in measured.history)


def test_a_file_of_which_half_cannot_be_used_is_refused_with_the_reasons(tmp_path):
    path = written(tmp_path, ["f", "E' [Pa]", "E'' [Pa]"], [HERTZ, STORAGE, [-1, -1, -1, 5.0]])
    with pytest.raises(ValueError, match=r"table.csv`: 1 complete rows .* line 2 .'-1.0'., 3"):
        read_moduli(path)


# Creep and relaxation as stress and strain.

TIME = np.array([0.1, 1.0, 10.0, 100.0])


def test_creep_is_strain_over_a_constant_stress(tmp_path):
    strain = np.array([0.01, 0.02, 0.035, 0.05])
    names = ["Step time [min]", "Shear strain [%]", "Shear stress [kPa]", "Time [min]"]
    columns = [TIME, 100 * strain, [2.0, 2.01, 1.99, 2.0], TIME + 7]
    measured = read_moduli(written(tmp_path, names, columns))
    assert (measured.kind, measured.deformation) == ("creep", "shear")
    np.testing.assert_allclose(measured.abscissa, 60 * TIME)
    np.testing.assert_allclose(measured.values, strain / (1e3 * np.array(columns[2])))
    assert "Constant stress: 2000 Pa." in measured.history
    # Loading before and recovery after are no creep.
    more = ([1e-3, 200, 300], [0.1, 3, 2], [0.5, 0, 0.01], [7, 207, 307])
    columns = [np.append(*pair) for pair in zip(columns, more, strict=True)]
    again = read_moduli(written(tmp_path, names, columns))
    np.testing.assert_array_equal(again.values, measured.values)
    left = " ".join(note for note in again.history if note.startswith("Left out"))
    assert "must be a positive number: 1 row(s), line 7" in left
    assert "a stress that differs from it by 10%: 2 row(s), line 6, 8" in left


def test_a_constant_stress_may_stand_above_the_table(tmp_path):
    text = "Creep of SBR\nApplied stress: 2 kPa\nTime [s],Strain [1]\n"
    text += "".join(f"{t},{1e-3 * (1 + i)}\n" for i, t in enumerate(TIME))
    measured = read(tmp_path, text)
    assert measured.kind == "creep"
    np.testing.assert_allclose(measured.values, 1e-3 * np.arange(1, 5) / 2e3)
    with pytest.raises(ValueError, match="understood: strain, time"):
        read(tmp_path, text.replace("stress", "load"))


def test_relaxation_is_stress_over_a_constant_strain(tmp_path):
    stress = np.array([9.0, 5.0, 3.0, 2.0])
    path = written(
        tmp_path, ["Time [s]", "Stress [MPa]", "Strain [%]"], [TIME, stress, [0.5, 0.5, 0.5, 0.501]]
    )
    measured = read_moduli(path)
    assert (measured.kind, measured.deformation) == ("relaxation", "tension")
    np.testing.assert_allclose(measured.values[:3], 1e6 * stress[:3] / 5e-3)
    path = written(tmp_path, ["Time [s]", "Stress [MPa]", "Strain [%]"], [TIME, stress, stress])
    with pytest.raises(ValueError, match="neither of stress and strain is constant; pass `k"):
        read_moduli(path)


def test_reptates_files_of_sweeps_creep_and_relaxation(tmp_path):
    """Columns without names may follow; a space in the first line changes nothing."""
    numbers = "\n".join(f"  {w!r} {g!r} {h!r} 1.5 0" for w, g, h in zip(
        OMEGA.tolist(), STORAGE.tolist(), LOSS.tolist(), strict=True))  # fmt: skip
    for name, first in (("a.osc", "Mw = 634.5; T = -35;chem=PI;"), ("a.tts", "T =-35 ;Mw=1")):
        text = f"{first}\n#Dummy header line\nw     G'     G''     Temp\n{numbers}\n"
        measured = read(tmp_path, text, name, poisson=0.5)
        check(measured, modulus=3 * MODULUS)
        np.testing.assert_allclose(measured.temperature, 238.15, rtol=1e-15)
    text = "T=150;stress=10;\nt strain\ns -\n1E-3 -1e-6\n0.1 2e-5\n1 4e-5\n"
    measured = read(tmp_path, text, "a.creep")
    assert (measured.kind, measured.deformation) == ("creep", "shear")
    np.testing.assert_allclose(measured.values, [2e-6, 4e-6])
    with pytest.raises(ValueError, match="its columns must be time, strain, in this order"):
        read(tmp_path, text.replace("s -", "- s"), "b.creep")
    text = "Mw=224;gamma=0.5;\nt sxy\n1 4e5\n2 3e5\n"
    measured = read(tmp_path, text, "a.gt")
    np.testing.assert_allclose(measured.values, [8e5, 6e5])
    measured = read(tmp_path, text.replace("gamma=0.5;", ""), "a.gt")
    np.testing.assert_allclose(measured.values, [4e5, 3e5])


# Several tables, sheets and files.


def test_isotherms_below_one_another_take_temperatures_from_the_lines_above(tmp_path):
    table = "f [Hz],E' [Pa],E'' [Pa]\n0.1,{0}e6,1e5\n1,{1}e6,2e5\n"
    text = "Ramp 5 K/min\nat 25 °C\n" + table.format(1, 2) + "at -5.5 °C\n" + table.format(3, 4)
    cold, hot = read(tmp_path, text).isotherms()
    np.testing.assert_allclose(cold.temperature, 267.65)
    np.testing.assert_allclose(cold.values.real, [3e6, 4e6])
    np.testing.assert_allclose(hot.temperature, 298.15)
    without = read(tmp_path, text.replace("°C", ""))
    assert len(without.isotherms()) == 2 and without.temperature is None
    assert any("2 curves of unknown temperature" in note for note in without.history)
    told = read(tmp_path, text.replace("°C", ""), temperature=[298.15, 267.65])
    np.testing.assert_array_equal(told.values, np.concatenate([cold.values, hot.values]))


def test_a_slow_ramp_with_sweeps_is_cut_into_isotherms_and_a_plain_ramp_refused(tmp_path):
    celsius = 20 + 0.5 * np.arange(40)
    names = ["T [°C]", "f [Hz]", "E' [Pa]", "E'' [Pa]"]
    values = [1e6 + celsius, 1e5 + celsius]
    measured = read_moduli(written(tmp_path, names, [celsius, 10 * [1, 3, 10, 30], *values]))
    assert len(measured.isotherms()) == 10
    np.testing.assert_allclose(measured.isotherms()[1].values.real, 1e6 + celsius[4:8])
    with pytest.raises(ValueError, match=r"the temperature changes by 19.5 K within a sweep"):
        read_moduli(written(tmp_path, names, [celsius, 1 + np.arange(40), *values]))


def test_sheets_of_one_isotherm_each_are_joined_and_of_one_temperature_refused(tmp_path):
    def save(*temperatures):
        heads = [["f", "E'", "E''", "T"], ["Hz", "MPa", "MPa", "°C"]]
        sheets = {"Details": [["Details"]]}
        for i, celsius in enumerate(temperatures):
            numbers = [[f, 3 + i, 0.5, celsius] for f in (1, 2)]
            sheets[f"step {i}"] = [[f"Sweep {i}"], *heads, *numbers]
        return workbook(tmp_path / "a.xlsx", sheets)

    cold, hot = read_moduli(save(40, 20)).isotherms()
    np.testing.assert_allclose(cold.values, 4e6 + 5e5j)
    np.testing.assert_allclose(hot.temperature, 313.15)
    with pytest.raises(ValueError, match=r"'step 0', 'step 1'.* have similar tables.*pass `sheet`"):
        read_moduli(save(20, 20))
    assert len(read_moduli(save(20, 20), sheet="step 1").abscissa) == 2


def test_several_files_are_isotherms_of_one_material(tmp_path):
    text = "f [Hz],E' [Pa],E'' [Pa]\n{0},1e6,1e5\n{1},2e6,2e5\n"
    paths = [
        write(tmp_path, text.format(*hertz), name)
        for name, hertz in (("a.csv", (1, 2)), ("b.csv", (1, 2)), ("c.csv", (10, 20)))
    ]
    measured = read_moduli(paths, temperature=[300.0, 280.0, 300.2])
    cold, hot = measured.isotherms()
    assert len(cold.abscissa) == 2
    np.testing.assert_allclose(hot.abscissa, 2 * np.pi * np.array([1, 2, 10, 20]))
    assert "Together 2 isotherm(s), 280.00 to 300.20 K, of 6 points." in measured.history
    with pytest.raises(ValueError, match=r"lacks the temperature of .*a.csv'.*: pass"):
        read_moduli(paths)
    with pytest.raises(ValueError, match=r"`temperature` has shape .2,.; .* of the 3 files"):
        read_moduli(paths, temperature=[300.0, 280.0])
    shear = write(tmp_path, text.replace("E'", "G'").format(1, 2), "d.csv")
    with pytest.raises(ValueError, match=r"files of different deformation: .'a.csv': 'tension'"):
        read_moduli([paths[0], shear], temperature=[300.0, 280.0])
    with pytest.raises(ValueError, match=r"`path=\[\]` must be the name of a file, or a list"):
        read_moduli([])


# Refusals, each with the file and the remedy.


@pytest.mark.parametrize(
    "old, new, options, expected",
    [
        ("f, ", "x, ", {}, "line 1: there are the columns 'x', .*`columns`: frequency, storage"),
        ("f, E', E''\nHz, MPa, MPa\n", "", {"kind": "frequency"},
         "column 1, the frequency, .*`units=.*; column 2, the storage, .*; column 3, the loss, "),
        ("Hz, MPa, MPa", "Hz, MPa, mPa", {}, "line 1: column 3 .E''., the loss, has 'mPa' as unit"),
        ("0.4\n\n# a note\n0.1, 1, 0.2\n1, 2, 0.3", "0.4", {}, "no table of numbers"),
        ("", "", {"columns": {"storage": "G"}}, "names 'G', but no columns have that name"),
        ("f, E', E''\nHz", "rate, E', E''\n", {"columns": {"frequency": "rate"}},
         r"column 1 \(rate\), the frequency, has no known unit"),
        ("", "", {"columns": {"modul": "f"}}, r"`columns=\{'modul': 'f'\}` is refused: use one of"),
        ("", "", {"units": {"force": "N"}}, r"`units=\{'force': 'N'\}` is refused: use one of"),
        ("", "", {"units": {"modulus": "N"}}, r"`units=\{'modulus': 'N'\}` is refused: use one of"),
        ("", "", {"kind": "dma"}, "`kind='dma'` is refused: use one of"),
        ("", "", {"poisson": 0.6}, r"`poisson=0.6` is refused"),
        ("", "", {"temperature": -3.0}, r"`temperature=-3` is refused"),
        ("", "", {"temperature": "warm"}, r"`temperature='warm'` is refused"),
        ("", "", {"temperature": [300.0, 310.0]}, "`temperature` has shape .2,."),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_refused_by_line(tmp_path, old, new, options, expected):
    with pytest.raises(ValueError, match=expected):
        read(tmp_path, PLAIN.replace(old, new), **options)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("f, E', G''\nHz, Pa, Pa\n1, 2, 3\n2, 3, 4\n", "mix tension and shear"),
        ("t, E(t), J(t)\ns, Pa, 1/Pa\n1, 2, 3\n2, 3, 4\n", "line 1: it has a modulus and a comp"),
        ("f E' E''\nHz Pa Pa\n1 2 3\n2 3\n", "2 entries in 3 columns: .* line 4"),
        ("f, E', E'', T\nHz, Pa, Pa, K\n1, 2, 3, -20\n2, 3, 4, -20\n", "absolute zero.*line 3"),
        ("f, E*, delta\nHz, Pa, deg\n1, 2, 90\n2, 3, 4\n", "below 90°: .* line 3 .'90'."),
        ("", "it is empty"),
        ("f, E', E''\0\n", "neither a table of text nor an Excel"),
        ("7" * 200_000, "its lines are too long for a table"),
    ],
)  # fmt: skip
def test_ambiguous_or_broken_files_are_refused(tmp_path, text, expected):
    with pytest.raises(ValueError, match=expected) as refusal:
        read(tmp_path, text)
    assert "table.csv" in str(refusal.value)


def test_a_missing_file_a_folder_and_a_damaged_workbook_are_refused(tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError, match=r"nowhere.csv` does not exist"):
        read_moduli(tmp_path / "nowhere.csv")
    with pytest.raises(ValueError, match="is a folder; a file is needed"):
        read_moduli(tmp_path)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
    for content, library in ((b"\xd0\xcf\x11\xe0", "xlrd"), (stream.getvalue(), "openpyxl")):
        pytest.importorskip(library)
        with pytest.raises(ValueError, match=r"a.xls` is refused: its .* the file is damaged"):
            read(tmp_path, content, "a.xls")
        with pytest.raises(ValueError, match=r"a.xls` is refused: .*damaged|cannot be read"):
            read(tmp_path, content[:4] + bytes(range(256)), "a.xls")
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(ImportError, match=rf"{library}: pip install graded_contact\[io\]"):
            read(tmp_path, content, "a.xls")
