"""Isotherms side by side: temperatures above the columns, names in one row or two."""

import numpy as np
import pytest
from test_instrument_exports import read, workbook

from graded_contact import read_moduli

E, TWO = "E' [MPa],E'' [MPa]", "1,2,.5,4,.7\n2,3,.6,5,.8\n"
COLD = np.array([2e6 + 0.5e6j, 3e6 + 0.6e6j])
HOT = np.array([4e6 + 0.7e6j, 5e6 + 0.8e6j])


def check(measured, celsius=(20, 40), values=(COLD, HOT)):
    parts = measured.isotherms()
    np.testing.assert_allclose([part.temperature[0] - 273.15 for part in parts], celsius)
    for part, expected in zip(parts, values, strict=True):
        np.testing.assert_allclose(part.values, expected)


@pytest.mark.parametrize(
    "head",
    [
        f",20 °C,,40 °C,\nf [Hz],{E},{E}\n",
        f",20°C,20°C,40°C,40°C\nf [Hz],{E},{E}\n",
        f",T = 20 °C,,T = 40°C,\nf [Hz],{E},{E}\n",
        f",293.15 K,,313.15 K,\nf [Hz],{E},{E}\n",
        f"T [°C],20,20,40,40\nf [Hz],{E},{E}\n",
        f"Temperature (K),293.15,,313.15,\nf [Hz],{E},{E}\n",
        f"f [Hz],20 °C,,40 °C,\n,{E},{E}\n",  # the first cell is merged with that below
        f"T [°C],20,20,40,40\n,{E},{E}\nf [Hz],,,,\n",  # pandas
        "T [°C],20,,40,\nf,E',E'',E',E''\nHz,MPa,MPa,MPa,MPa\n",
        "f [Hz],E' 20°C [MPa],E'' 20°C [MPa],E' 40°C [MPa],E'' 40°C [MPa]\n",
        f"a sample of SBR\n\n,20 °C,,40 °C,\nf [Hz],{E},{E}\n",
    ],
)
def test_isotherms_that_share_their_frequencies_are_separated(tmp_path, head):
    measured = read(tmp_path, head + TWO)
    check(measured)
    assert measured.assumed == ()


def test_columns_may_be_grouped_by_quantity_or_have_their_own_frequencies(tmp_path):
    head = ",20 °C,40 °C,20 °C,40 °C\nf [Hz],E' [MPa],E' [MPa],E'' [MPa],E'' [MPa]\n"
    check(read(tmp_path, head + "1,2,4,.5,.7\n2,3,5,.6,.8\n"))
    head = f"20 °C,,,40 °C,,\nf [Hz],{E},f [Hz],{E}\n"
    check(read(tmp_path, head + "1,2,.5,1,4,.7\n2,3,.6,2,5,.8\n"))
    text = "t [s],20 °C,40 °C\n,E(t) [MPa],E(t) [MPa]\n1,4,2\n2,3,1\n"
    check(read(tmp_path, text), values=(np.array([4e6, 3e6]), np.array([2e6, 1e6])))


def test_a_curve_may_end_above_the_others(tmp_path):
    text = f",20 °C,,40 °C,\nf [Hz],{E},{E}\n{TWO}3,4,.7,,\n"
    measured = read(tmp_path, text)
    check(measured, values=(np.append(COLD, 4e6 + 0.7e6j), HOT))


def test_temperatures_without_a_unit_are_assumed_or_asked_for(tmp_path):
    text = f",{{}},,{{}},\nf [Hz],{E},{E}\n{TWO}"
    measured = read(tmp_path, text.format(20, 40))
    check(measured)
    assert "are assumed to be in °C" in measured.assumed[0]
    with pytest.raises(ValueError, match=r"\(293.15, 313.15\) have no unit: pass .*'temperature'"):
        read(tmp_path, text.format(293.15, 313.15))
    kelvin = read(tmp_path, text.format(293.15, 313.15), units={"temperature": "K"})
    check(kelvin)
    assert kelvin.assumed == ()


def test_merged_cells_of_a_workbook_are_those_of_all_their_columns(tmp_path):
    path = tmp_path / "a.xlsx"
    numbers = [[1, 2, 0.5, 4, 0.7], [2, 3, 0.6, 5, 0.8]]
    names = ["E' [MPa]", "E'' [MPa]", "E' [MPa]", "E'' [MPa]"]
    heads = [["f [Hz]", "20 °C", None, 40, None], [None, *names]]
    check(read_moduli(workbook(path, {"a": [*heads, *numbers]})))
    heads = [[None, 20, None, 40, None], ["\ufefff [Hz]", *names]]
    check(read_moduli(workbook(path, {"a": [*heads, *numbers]})))


def test_replicates_at_one_temperature_are_chosen_between(tmp_path):
    with pytest.raises(ValueError, match=r"column 2 .* and column 4 .* may be the storage"):
        read(tmp_path, f",20 °C,,20 °C,\nf [Hz],{E},{E}\n{TWO}")
    assert len(read(tmp_path, f",20 °C,,40 °C,\nf [Hz],{E},{E}\n{TWO}",
                    columns={"storage": 4, "loss": 5}).abscissa) == 2  # fmt: skip


PLAIN = "f [Hz];E' [MPa];E'' [MPa]\n1,5;2,0;0,5\n2,5;3,0;0,6\n"


@pytest.mark.parametrize(
    "content",
    [
        ("\ufeff" + PLAIN).encode(),
        ("\ufeff\ufeff" + PLAIN).encode(),
        ("# joined\n\ufeff" + PLAIN).encode(),
        PLAIN.replace("2,5;3", "\ufeff2,5;3").encode(),
        ('\ufeff"' + PLAIN.replace(";", '";"', 2).replace("]\n", ']"\n', 1)).encode(),
        ("\ufeff" + PLAIN).encode("utf-16-le"),
        ("\ufeff" + PLAIN).encode("utf-16-be"),
        PLAIN.encode("utf-16-le"),
        b"\xef\xbb\xbf" + PLAIN.replace("f [Hz]", "f [Hz];T [°C]").replace(",5;", ",5;20;", 1)
        .replace("\n2,5;", "\n2,5;20;").encode("latin-1"),
    ],
)  # fmt: skip
def test_marks_of_byte_order_are_no_part_of_a_name_or_number(tmp_path, content):
    measured = read(tmp_path, content)
    np.testing.assert_allclose(measured.values, COLD)
    np.testing.assert_allclose(measured.abscissa, 2 * np.pi * np.array([1.5, 2.5]))
