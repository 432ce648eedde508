"""Files as instruments and programs write them, each made here of the same few points."""

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


# Name, text, arguments, deformation.
