"""Files as instruments and programs write them, each made here of the same few points."""

import contextlib
import json

import numpy as np
import pytest

from graded_contact import read_moduli

HERTZ = np.array([0.1, 1.0, 10.0, 100.0])
OMEGA = 2 * np.pi * HERTZ
STORAGE = np.array([1.25e6, 2.5e6, 5.75e6, 2.5e7])
LOSS = np.array([2.5e5, 7.5e5, 3.25e6, 1.5e7])
TANGENT = LOSS / STORAGE
MODULUS = STORAGE + 1j * LOSS
MAGNITUDE, DEGREES = np.abs(MODULUS), np.degrees(np.angle(MODULUS))
CELSIUS = np.array([20.1, 20.0, 19.9, 20.0])


def rows(*columns, separator="\t", decimal=".", start=""):
    """Lines of numbers; a column may be one text for all lines."""
    columns = [[column] * len(HERTZ) if isinstance(column, str) else column for column in columns]
    lines = []
    for entries in zip(*columns, strict=True):
        cells = [e if isinstance(e, str) else f"{e:.9g}".replace(".", decimal) for e in entries]
        lines.append(start + separator.join(cells))
    return "\n".join(lines) + "\n"


def write(folder, content, name="table.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return path


def read(folder, content, name="table.csv", encoding="utf-8", **options):
    return read_moduli(write(folder, content, name, encoding), **options)


def workbook(path, sheets):
    """Writes a workbook: rows by the names of the sheets."""
    book = pytest.importorskip("openpyxl").Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    book.save(path)
    return path


def check(measured, omega=OMEGA, modulus=MODULUS, *, deformation="tension", rtol=1e-7):
    assert measured.kind == "frequency" and measured.deformation == deformation
    np.testing.assert_allclose(measured.abscissa, omega, rtol=rtol)
    np.testing.assert_allclose(measured.values.real, modulus.real, rtol=rtol)
    np.testing.assert_allclose(measured.values.imag, modulus.imag, rtol=rtol)


def trios(celsius=(20.0, 40.0)):
    """TRIOS: details, then sections with a title, names, units and numbers between tabs."""
    text = "Filename\tsbr\nInstrument name\tDHR-2\nrundate\t1/2/2020\nGeometry\tplates\n"
    text += "[File Parameters]\nLoading gap\t15\tmm\n"
    for i, t in enumerate(celsius):
        text += f"\n[step]\nFrequency sweep - {i + 1}\n"
        text += "Storage modulus\tLoss modulus\tTan(delta)\tAngular frequency\tFrequency\t"
        text += "Oscillation torque\tStep time\tTemperature\nMPa\tMPa\t\trad/s\tHz\tN.m\ts\t°C\n"
        text += rows(
            (1 + i) * STORAGE / 1e6, (1 + i) * LOSS / 1e6, TANGENT, OMEGA, HERTZ, HERTZ, HERTZ,
            t + CELSIUS - 20,
        )  # fmt: skip
    return text


def rheocompass(decimal="."):
    """RheoCompass: numbers begin in the second column; units two lines below the names."""
    text = "Project:\tSBR\nTest:\tSweeps\n\n"
    for i, t in enumerate((20, 40)):
        text += f"Result:\tFrequency sweep {i + 1}\n\nInterval and data points:\t1\t4\n"
        text += "Interval data:\tPoint No.\tAngular Frequency\tStorage Modulus\tLoss Modulus\t"
        text += "Shear Strain\tTorque\tTemperature\tStatus\n\t\t\t\t\t\t\t\t\n"
        text += "\t\t[rad/s]\t[kPa]\t[kPa]\t[%]\t[mN·m]\t[°C]\t\n"
        text += rows(
            ["1", "2", "3", "4"], OMEGA, (1 + i) * STORAGE / 1e3, (1 + i) * LOSS / 1e3, HERTZ,
            HERTZ, t + CELSIUS - 20, "WMa,TruStrain™", start="\t", decimal=decimal,
        )  # fmt: skip
        text += "\n"
    return text


def test_trios_text_with_steps_and_both_frequencies(tmp_path):
    cold, hot = read(tmp_path, trios()).isotherms()
    check(cold, deformation="shear")
    check(hot, modulus=2 * MODULUS, deformation="shear")
    np.testing.assert_allclose(cold.temperature, 273.15 + CELSIUS)


def trios_json(celsius=(20.0, 40.0)):
    """The same measurements as TRIOS writes them in JSON, with a text and a time in each row."""
    units = {"Storage modulus": "MPa", "Loss modulus": "MPa", "Angular frequency": "rad/s",
             "Oscillation torque": "µN.m", "Temperature": "°C", "Tan(delta)": None}  # fmt: skip
    headers: dict = {f"{name}_{unit}": {"DisplayName": name, "ValueType": "Number"} | (
        {"Unit": {"Name": unit}} if unit else {}) for name, unit in units.items()}  # fmt: skip
    headers["Status bits"] = {"DisplayName": "Status bits", "ValueType": "Text"}
    headers["Date and time"] = {"DisplayName": "Date and time", "ValueType": "DateTime"}
    lines, steps = [], []
    for i, t in enumerate(celsius):
        steps.append({"Id": f"a8b6-{i}", "Name": f"Frequency sweep - {i + 1}"})
        for row in zip((1 + i) * STORAGE / 1e6, (1 + i) * LOSS / 1e6, OMEGA, HERTZ,
                       t + CELSIUS - 20, TANGENT, strict=True):  # fmt: skip
            cells = dict(zip(headers, map(float, row), strict=False))
            lines.append({**cells, "Status bits": "0x1", "Date and time": "2023-01-09T09:27:17Z",
                          "Results Step Id": steps[-1]["Id"]})  # fmt: skip
    table = {"ResultsSteps": steps, "ColumnHeaders": headers, "Rows": lines}
    raw = {**table, "Rows": lines[:1]}
    return {"Sample": {"Name": "sbr"}, "Results": {"Unprocessed": raw, "Processed": table}}


def test_trios_json_has_the_steps_of_its_text(tmp_path):
    content = json.dumps(trios_json())
    cold, hot = read(tmp_path, content, name="a.json").isotherms()
    check(cold, deformation="shear")
    check(hot, modulus=2 * MODULUS, deformation="shear")
    np.testing.assert_allclose(cold.temperature, 273.15 + CELSIUS)
    check(read(tmp_path, content, step="Frequency sweep - 1"), deformation="shear")
    for other, message in [
        ('{"a": [1, 2]}', "it is a JSON without the `ColumnHeaders` and `Rows` of TRIOS: export"),
        ('{"ColumnHeaders": {}, "Rows": [3]}', "the file is damaged"),
        ('{"a": ', "no table of numbers is found"),
    ]:
        with pytest.raises(ValueError, match=message):
            read(tmp_path, other)


def test_signs_of_both_deformations_are_refused(tmp_path):
    text = trios().replace("plates", "Tension fixture (rectangle)")
    with pytest.raises(
        ValueError, match=r"in shear has a column 'Oscillation torque': pass `deformation"
    ):
        read(tmp_path, text)
    check(read(tmp_path, text, deformation="tension").isotherms()[0])


@pytest.mark.parametrize("decimal, encoding", [(".", "utf-16"), (",", "utf-16-le")])
def test_rheocompass_is_of_shear_by_its_other_columns(tmp_path, decimal, encoding):
    measured = read(tmp_path, rheocompass(decimal=decimal), "export.csv", encoding)
    cold, hot = measured.isotherms()
    check(cold, deformation="shear")
    check(hot, modulus=2 * MODULUS, deformation="shear")
    assert any("'Shear Strain'" in note and "shear" in note for note in measured.history)


HEAD_TA = "Nsig\t4\nSig1\tFrequency (Hz)\nSig2\tTemperature (°C)\nSig3\tStorage Modulus (MPa)\n"
SHEAR_MODULI = (
    "Shear modulus (elastic component)(Pa);Shear modulus (viscous component)(Pa);"
    "Shear modulus (complex component)(Pa)"
)
# Name, text, arguments, deformation.
EXPORTS = {
    "Universal Analysis": (
        "Version\tV4\nInstrument\tDMA Q800\n" + HEAD_TA + "Sig4\tLoss Modulus (MPa)\n"
        "Date\t1-Jan-10\nStartOfData\n" + rows(HERTZ, CELSIUS, STORAGE / 1e6, LOSS / 1e6),
        {}, "tension",
    ),
    "ARES": (
        "Freq\tG'\tG\"\tTan_Delta\tStrain\tTorque\tTemp\n"
        "rad/s\tdyn/cm²\tdyn/cm²\t\t%\tg-cm\t°C\n"
        + rows(OMEGA, 10 * STORAGE, 10 * LOSS, TANGENT, HERTZ, HERTZ, CELSIUS),
        {}, "shear",
    ),
    "Kinexus": (
        f"Action Name;Time (action)(s);Frequency(Hz);{SHEAR_MODULI};Phase angle(°);"
        "Temperature(°C)\n"
        + rows("Sweep", HERTZ, HERTZ, STORAGE, LOSS, MAGNITUDE, DEGREES, CELSIUS, separator=";"),
        {}, "shear",
    ),
    "STARe": (
        "Curve Name:\n   [SBR]\nCurve Values:\n"
        "      Index      f      Ts   Storage Modulus   Loss Modulus\n"
        "         []   [Hz]    [°C]             [MPa]          [MPa]\n"
        + rows(["0", "1", "2", "3"], HERTZ, CELSIUS, STORAGE / 1e6, LOSS / 1e6, separator="   "),
        {}, "tension",
    ),
    "Eplexor": (
        "Probe;SBR\nPrüfart;Frequenzsweep\n"
        "Frequenz;Temperatur;E*;E';E\";tan δ\nHz;°C;MPa;MPa;MPa;-\n"
        + rows(HERTZ, CELSIUS, MAGNITUDE / 1e6, STORAGE / 1e6, LOSS / 1e6, TANGENT,
               separator=";", decimal=","),
        {}, "tension",
    ),
    "Proteus": (
        "#EXPORTTYPE:DATA ALL\n#INSTRUMENT:NETZSCH DMA 242\n#DECIMAL:POINT\n"
        "##Temp./°C;f/Hz;E'/MPa;E\"/MPa;tan delta\n"
        + rows(CELSIUS, HERTZ, STORAGE / 1e6, LOSS / 1e6, TANGENT, separator=";"),
        {}, "tension",
    ),
    "logarithms": (
        "log10(f [Hz]), log E' [MPa], ln E'' [Pa]\n"
        + rows(np.log10(HERTZ), np.log10(STORAGE / 1e6), np.log(LOSS), separator=","),
        {}, "tension",
    ),
    "German thousands": (
        "f [Hz];E' [Pa];E'' [Pa]\n"
        + rows(HERTZ, *(np.char.translate([f"{x:,.2f}" for x in part], str.maketrans(",.", ".,"))
                        .tolist() for part in (STORAGE, LOSS)), separator=";", decimal=","),
        {}, "tension",
    ),
    "Fahrenheit": (
        "f [Hz],E' [Pa],E'' [Pa],T [°F]\n"
        + rows(HERTZ, STORAGE, LOSS, 1.8 * CELSIUS + 32, separator=","),
        {}, "tension",
    ),
    "remarks, blank lines and another order": (
        "# sweep of a tread\n\nf [Hz]  E' [Pa]  E'' [Pa]\n\n10 5.75e6 3.25e6 # repeated\n"
        "# 1 7e6 7e6\n100 2.5e7 1.5e7\n\n\n0.1 1.25D+06 2.5D+05\n1 2.5e6 7.5e5\n# the end\n",
        {}, "tension",
    ),
    "French": (
        "Pulsation (rad/s)\tTempérature (°C)\tModule de conservation (Pa)\t"
        "Module de perte (Pa)\tCouple (mN·m)\n"
        + rows(OMEGA, CELSIUS, STORAGE, LOSS, HERTZ, decimal=","),
        {}, "shear",
    ),
    "RepTate, ending .dat": (
        "T=20;Mw=94.9;chem=PI;\nw G' G''\n" + rows(OMEGA, STORAGE, LOSS, separator="   "),
        {"units": {"modulus": "Pa"}}, "shear",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_are_read_in_every_encoding_that_holds_them(tmp_path, name):
    text, options, deformation = EXPORTS[name]
    for encoding in ("utf-8-sig", "utf-16", "latin-1"):
        with contextlib.suppress(UnicodeEncodeError):
            measured = read(tmp_path, text, "export.csv", encoding, **options)
            check(measured, deformation=deformation)


def test_a_column_of_moments_means_shear(tmp_path):
    """German exports name the torque `Moment`; taken as tension, moduli were 3 times too low."""
    text = "Kreisfrequenz;Speichermodul;Verlustmodul;Deformation;Moment\nrad/s;Pa;Pa;%;mN·m\n"
    text += rows(OMEGA, STORAGE, LOSS, HERTZ, HERTZ, separator=";")
    check(read(tmp_path, text, poisson=0.5), modulus=3 * MODULUS)
