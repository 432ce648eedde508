"""Measured friction: columns by their headings, SI units, and what is refused by name."""

import numpy as np
import pytest

from graded_contact.readers import read_friction


def read(folder, text):
    (folder / "m.csv").write_text(text, encoding="utf-8")
    return read_friction(folder / "m.csv")


@pytest.mark.parametrize(
    ("text", "velocity", "friction", "error", "temperature"),
    [
        ("velocity [mm/s],friction,error,T [°C]\n1,0.3,0.01,20\n10,0.4,,-5\n",
         [1e-3, 1e-2], [0.3, 0.4], [0.01, np.nan], [293.15, 268.15]),
        ("mu;std;v\n%;%;km/h\n30;1;36\n40;2;3.6\n", [10, 1], [0.3, 0.4], [0.01, 0.02], None),
        ("sample\tsliding speed (µm/s)\tCOF\nA\t5\t0.5\n", [5e-6], [0.5], None, None),
        ("velocity, m/s\tfriction coefficient\ttemperature in F\n1\t.2\t32\n",
         [1], [0.2], None, [273.15]),
    ],
)  # fmt: skip
def test_columns_are_found_by_their_headings(
    tmp_path, text, velocity, friction, error, temperature
):
    found = read(tmp_path, text)
    expected = (velocity, friction, error, temperature)
    for name, values in zip(
        ("velocity", "friction", "error", "temperature"), expected, strict=True
    ):
        if values is None:
            assert getattr(found, name) is None
        else:
            np.testing.assert_allclose(getattr(found, name), values, rtol=1e-12)
    assert found.name == "m.csv"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("speed [rpm],COF\n36,0.5\n", "its velocity is in 'rpm', as the heading .* m/s is needed"),
        ("v [m/s],friction [N]\n1,2\n", "its friction is in 'N'"),
        ("v [m/s],mu,T [Pa]\n1,2,3\n", "its temperature is in 'Pa'.* K is needed"),
        ("v [m/s],mu,COF\n1,2,3\n", "'mu' and 'COF' may both be its friction"),
        ("a,b\n1,2\n", "no heading names its velocity"),
        ("1,2\n3,4\n", "no heading names its velocity"),
        ("v [m/s],mu\n0,0.2\n", r"`velocity\[0\]=0` is refused"),
        ("v [m/s],mu\n1,\n2,3\n", "line 2 has no number as friction, but ''"),
        ("v [m/s],mu\n1,2\n2,x\n", "line 3 has no number as friction, but 'x'"),
    ],
)
def test_another_table_is_refused_by_name(tmp_path, text, message):
    with pytest.raises(ValueError, match=f"m.csv` is refused: .*{message}"):
        read(tmp_path, text)


def test_a_unit_that_is_assumed_is_a_warning(tmp_path, caplog):
    assert read(tmp_path, "v,mu\n2,0.3\n").velocity == 2
    assert "velocity is assumed to be in m/s" in caplog.text and len(caplog.records) == 1
