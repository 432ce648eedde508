"""Plain tables of moduli are read; all others are refused with the options that read them."""

from pathlib import Path

import numpy as np
import pytest
from exports import (
    CELSIUS,
    DEGREES,
    EXPORTS,
    HERTZ,
    LOSS,
    MAGNITUDE,
    MODULUS,
    OMEGA,
    STORAGE,
    TANGENT,
    rows,
    trios,
)

from graded_contact import read_moduli
from graded_contact.readers import NotPlain

DATA = Path(__file__).parents[3] / "shared" / "data"


def write(folder, text, encoding="utf-8", name="a.csv"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def table(folder, head, *columns, **options):
    options = {"separator": ",", **options}
    return write(folder, head + "\n" + rows(*columns, **options))


def check(measured, modulus=MODULUS, deformation="tension"):
    assert (measured.kind, measured.deformation) == ("frequency", deformation)
    np.testing.assert_allclose(measured.abscissa, OMEGA, rtol=1e-7)
    np.testing.assert_allclose(measured.values, modulus, rtol=1e-7)


COMPLIANCE = 1 / MODULUS
PSI = 6894.757293168361
PLAIN = [
    ("f [Hz],E' [Pa],E'' [Pa]", [HERTZ, STORAGE, LOSS]),
    ("f, E_stor, E_loss\nHz, MPa, MPa", [HERTZ, STORAGE / 1e6, LOSS / 1e6]),
    ("# omega_rad_s,E_storage_Pa,E_loss_kPa", [OMEGA, STORAGE, LOSS / 1e3]),
    ("Frequency (Hz),E' (psi),tan delta", [HERTZ, STORAGE / PSI, TANGENT]),
    ("f [Hz],|E*| [N/mm²],phase [°]", [HERTZ, MAGNITUDE / 1e6, DEGREES]),
    ("f [mHz],|E*| [Pa],tan(delta) [%]", [1e3 * HERTZ, MAGNITUDE, 100 * TANGENT]),
    ("f [Hz],D' [1/MPa],D'' [1/MPa]", [HERTZ, 1e6 * COMPLIANCE.real, -1e6 * COMPLIANCE.imag]),
]


@pytest.mark.parametrize("head, columns", PLAIN)
def test_plain_tables_need_no_options(tmp_path, head, columns):
    check(read_moduli(table(tmp_path, head, *columns)))
    with_tabs = table(tmp_path, head.replace(",", "\t"), *columns, separator="\t")
    check(read_moduli(with_tabs))


def test_relaxation_creep_and_shear(tmp_path):
    falling, rising = STORAGE[::-1], 1 / STORAGE[::-1]
    measured = read_moduli(table(tmp_path, "t [ms],G(t) [kPa]", 1e3 * HERTZ, falling / 1e3))
    assert (measured.kind, measured.deformation) == ("relaxation", "shear")
    np.testing.assert_allclose(measured.values, falling)
    np.testing.assert_allclose(measured.abscissa, HERTZ)
    measured = read_moduli(table(tmp_path, "t [h],J [1/Pa]", HERTZ, rising), poisson=0.5)
    assert (measured.kind, measured.deformation) == ("creep", "tension")
    np.testing.assert_allclose(measured.values, rising / 3)
    np.testing.assert_allclose(measured.abscissa, 3600 * HERTZ)
    measured = read_moduli(table(tmp_path, "f [Hz],G' [Pa],G'' [Pa]", HERTZ, STORAGE, LOSS),
                           poisson=0.25)  # fmt: skip
    check(measured, 2.5 * MODULUS)


TWICE = [np.tile(HERTZ, 2), np.tile(STORAGE, 2), np.tile(LOSS, 2)]


def test_isotherms_by_a_column_or_by_files(tmp_path):
    kelvins = np.concatenate([CELSIUS, CELSIUS + 20])
    lines = [f"{t},{f},{e},{l}" for t, f, e, l in zip(kelvins, *TWICE, strict=True)]
    one = table(tmp_path, "f [Hz],E' [Pa],E'' [Pa]", HERTZ, STORAGE, LOSS)
    both = write(tmp_path, "\n".join(["T [°C],f [Hz],E' [Pa],E'' [Pa]", *lines]), name="b.csv")
    for measured in (read_moduli(both), read_moduli([one, one], temperature=[293.15, 313.15])):
        cold, hot = measured.isotherms()
        check(cold)
        check(hot)
        np.testing.assert_allclose(hot.temperature, 313.15, atol=0.11)
    with pytest.raises(ValueError, match="temperature"):
        read_moduli(both, temperature=293.15)


def test_units_of_temperature(tmp_path):
    for unit, values in [("K", CELSIUS + 273.15), ("°F", 1.8 * CELSIUS + 32)]:
        path = table(tmp_path, f"f [Hz],E' [Pa],E'' [Pa],T [{unit}]", HERTZ, STORAGE, LOSS, values)
        np.testing.assert_allclose(read_moduli(path).temperature, 273.15 + CELSIUS)


# Heading and options that leave something open or contradict the file.
UNCLEAR = [
    ("f [Hz],storage modulus [Pa],loss modulus [Pa]", {}),
    ("f [Hz],E' [mPa],E'' [mPa]", {}),
    ("frequency [1/s],E' [Pa],E'' [Pa]", {}),
    ("frequency [rpm],E' [Pa],E'' [Pa]", {}),
    ("f [Hz],E' [1/MPa],E'' [1/MPa]", {"units": {"modulus": "MPa"}}),
    ("f [Hz],J' [1/MPa],J'' [1/MPa]",
     {"columns": {"storage": 2, "loss": 3}, "units": {"modulus": "MPa"}, "deformation": "shear"}),
    ("f [Hz],E' [Pa],G'' [Pa]", {}),
    ("f [Hz],E' [Pa],E' [Pa]", {}),
    ("log f,log E',log E''", {"columns": {"frequency": 1, "storage": 2, "loss": 3},
                              "units": {"frequency": "Hz", "modulus": "Pa"}}),
    ("f [Hz],E' [Pa],E'' [Pa]", {"units": {"modulus": "MPa"}}),
    ("f [Hz],E' [Pa],E'' [Pa]", {"units": {"time": "s"}}),
    ("f [Hz],E' [Pa],E'' [Pa]", {"deformation": "shear"}),
    ("f [Hz],E' [Pa],E'' [Pa]", {"layout": {"header": 2}}),
    ("f [Hz],E' [Pa],E'' [Pa]", {"layout": {"line": 2}}),
    ("f [Hz],E' [Pa],E'' [Pa]", {"columns": {"tan_delta": 3}}),
    ("f [Hz],|E*| [Pa],phase", {}),
    ("f [Hz],E' [Pa],T", {}),
    ("torque [mN.m],angle [rad],strain", {}),
]  # fmt: skip


@pytest.mark.parametrize("head, options", UNCLEAR)
def test_what_is_not_stated_is_asked_for(tmp_path, head, options):
    with pytest.raises(ValueError, match=r"a\.csv|layout|units"):
        read_moduli(table(tmp_path, head, HERTZ, STORAGE, LOSS), **options)


AMBIGUOUS = [
    "f [Hz],E' [MPa],E'' [MPa]\n0,15,1,05,2,71\n0,31,1,99,2,03\n",
    "f [Hz];E' [kPa];E'' [kPa]\n1;1.250;250\n2;2.500;750\n3;25.000;3.250\n",
    'f [Hz],E\' [Pa],E\'\' [Pa]\n1,"1,250,000","250,000"\n2,"2,500,000","750,000"\n',
    "f [Hz],E' [Pa],E'' [Pa]\n1,2e6,3e5\n2,2e6,bad\n3,3e6,4e5\n",
    "f [Hz],E' [Pa],E'' [Pa]\n1,2e6,3e5\n2,2e6,3e5\n" * 2,
    "t [s],E [Pa]\n1,2e6\n2,3e6\n3,4e6\n",
    "f [Hz],E' [Pa],E'' [Pa]\n1,2e6,3e5\n1,2e6,3e5\n1,3e6,4e5\n",
    "f [Hz],E' [Pa],E'' [Pa]\n" + "1,2e6,3e5\n2,2e6,3e5\n" * 3,
    "tau [s],E_i [MPa]\n1e-3,4\n1e-1,2\n10,1\ninf,3\n",
    "",
]


@pytest.mark.parametrize("text", AMBIGUOUS)
def test_tables_that_may_be_read_in_two_ways_are_refused(tmp_path, text):
    with pytest.raises(ValueError, match="path="):
        read_moduli(write(tmp_path, text))


def completed(options, known):
    """The options of a message, with what the owner of the file knows in the place of "..."."""
    filled = {}
    for name, value in options.items():
        if isinstance(value, dict):
            stated = {key: each for key, each in value.items() if each != "..."}
            filled[name] = stated | known.get(name, {})
        else:
            filled[name] = known[name] if value == "..." else value
    return filled


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_are_read_plainly_or_as_their_messages_ask(tmp_path, name):
    text, known, deformation = EXPORTS[name]
    encoding = "utf-16" if "Rheo" in name else "utf-8-sig"
    path, options = write(tmp_path, text, encoding), {}
    known = {**known, "deformation": deformation}
    for _ in range(5):
        try:
            check(read_moduli(path, **options), deformation=deformation)
            return
        except NotPlain as error:
            assert error.options != options
            options = completed(error.options, known)
    pytest.fail(f"no end: {options}")


def test_sections_are_isotherms_and_interrupted_ones_are_refused(tmp_path):
    names = ["Frequency sweep - 1", "Frequency sweep - 2"]
    options = {"columns": {"frequency": "Frequency"}, "deformation": "shear"}
    path = write(tmp_path, trios())
    cold, hot = read_moduli(path, layout={"section": names}, **options).isotherms()
    check(cold, deformation="shear")
    check(hot, 2 * MODULUS, deformation="shear")
    with pytest.raises(NotPlain) as error:
        read_moduli(path, layout={"section": "Sweep"}, **options)
    assert all(repr(name) in str(error.value) for name in names)
    lines = trios().splitlines()
    lines.insert(12, "\t".join(["---"] * 8))
    with pytest.raises(NotPlain, match="interrupted"):
        read_moduli(write(tmp_path, "\n".join(lines)), layout={"section": names[0]}, **options)


def test_a_message_has_lines_and_calls_and_no_proposal_of_columns_or_units(tmp_path):
    text = "test 1\nf;E';E''\nHz;MPa;MPa\n"
    path = write(
        tmp_path, text + rows(HERTZ, STORAGE / 1e6, LOSS / 1e6, separator=";", decimal=",")
    )
    with pytest.raises(NotPlain) as error:
        read_moduli(path)
    layout = {"header": 2, "separator": ";", "decimal": ","}
    assert error.value.options == {"layout": layout}
    assert "line 2: f;E';E''" in str(error.value)
    assert f"read_moduli('a.csv', layout={layout})" in str(error.value)
    assert error.value.flags == '--layout header=2 --layout "separator=;" --layout "decimal=,"'
    check(read_moduli(path, **error.value.options))
    with pytest.raises(NotPlain) as error:
        read_moduli(table(tmp_path, "x,y,z", HERTZ, STORAGE, LOSS))
    assert error.value.options == {"columns": {"...": "..."}, "deformation": "..."}


def test_rows_without_positive_numbers_are_left_out(tmp_path):
    path = table(tmp_path, "f [Hz],E' [Pa],E'' [Pa]", HERTZ, STORAGE, LOSS)
    path.write_text(path.read_text() + "1e3,9.9e37,1\n1e4,-1,1\n1e5,,1\n1e6,1,n/a\n")
    measured = read_moduli(path)
    check(measured)
    assert "6, 7, 8, 9" in measured.history[-1]


def test_workbooks(tmp_path):
    book = pytest.importorskip("openpyxl").Workbook()
    for name in ("Data", "More"):
        sheet = book.create_sheet(name)
        lines = zip(HERTZ.tolist(), STORAGE.tolist(), LOSS.tolist(), strict=True)
        for line in [["of a tread"], ["f [Hz]", "E' [Pa]", "E'' [Pa]"], *lines]:
            sheet.append(list(line))
    book.save(tmp_path / "a.xlsx")
    check(read_moduli(tmp_path / "a.xlsx", layout={"sheet": "More", "header": 2}))
    with pytest.raises(NotPlain, match="'Data', 'More'"):
        read_moduli(tmp_path / "a.xlsx")
    (tmp_path / "b.xlsx").write_bytes((tmp_path / "a.xlsx").read_bytes()[:900])
    with pytest.raises(ValueError, match=r"b\.xlsx"):
        read_moduli(tmp_path / "b.xlsx")


SI = {"time": "s", "modulus": "Pa"}
TIME = {"columns": {"time": 1, "modulus": 2}, "units": SI, "deformation": "shear"}
BOOK = {"layout": {"sheet": "Binder Frequency Sweep", "header": 3}, "deformation": "shear",
        "columns": {"temperature": 1, "frequency": 2, "storage": 6, "loss": 7}}  # fmt: skip
# Name, options, points, isotherms.
FILES = [
    ("epdm70_tf_015p.csv", {}, 210, 10),
    ("pyvisco_eplexor_master.csv", {}, 210, 1),
    ("pyvisco_freq_user_master.csv", {}, 206, 1),
    ("pyvisco_freq_user_raw.csv", {}, 210, 21),
    ("pyvisco_time_user_master.csv", {}, 481, 1),
    ("vinylfoam_dma_raw.csv", {"units": {"modulus": "MPa"}}, 209, 19),
    ("pp_stress_relaxation.csv", {"units": SI, "deformation": "tension"}, 76, 1),
    ("respect_time_test3.dat", TIME, 200, 1),
    ("reptate_PI600k_raw_isotherms.csv", {"columns": {"temperature": "T_set"}}, 159, 9),
    ("pyvisco_freq_Eplexor_master.xls", {"layout": {"sheet": "Exported Data"}}, 210, 1),
    ("tfhrc_RuttingBinderPTF_Data.xlsx", BOOK, 217, 7),
]


@pytest.mark.skipif(not DATA.exists(), reason="the measured files lie beside the repository")
@pytest.mark.parametrize("name, options, count, isotherms", FILES)
def test_measured_moduli(name, options, count, isotherms):
    measured = read_moduli(DATA / "rheology" / name, **options)
    assert (len(measured.abscissa), len(measured.isotherms())) == (count, isotherms)
    if options:
        with pytest.raises(NotPlain):
            read_moduli(DATA / "rheology" / name)
