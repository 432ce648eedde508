"""Files in many layouts are written here and read back; measured files are beside the project."""

from pathlib import Path

import numpy as np
import pytest
from test_instrument_exports import (
    HERTZ,
    LOSS,
    MODULUS,
    STORAGE,
    check,
    read,
    write,
)  # fmt: skip

from graded_contact import read_moduli

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


# Kinds, overrides, and what is recorded.


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


# Rows that cannot be used.


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


# Refusals, each with the file and the remedy.
