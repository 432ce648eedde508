"""What a file states counts: compliances, periods, tension and shear, tables of other numbers."""

import re

import numpy as np
import pytest
from test_instrument_exports import HERTZ, LOSS, MODULUS, OMEGA, STORAGE, check, read, rows

# D* = 1/E* in 1/MPa, and D* = D' - iD''.
D1, D2 = STORAGE / (STORAGE**2 + LOSS**2) * 1e6, LOSS / (STORAGE**2 + LOSS**2) * 1e6
SIZE, TANGENT = np.hypot(D1, D2), LOSS / STORAGE
DEGREES = np.degrees(np.arctan2(LOSS, STORAGE))
TENSION = "assumed to be Young's (tension), because no column and no line of the file says"


@pytest.mark.parametrize(
    "names, columns, deformation",
    [
        ("D' [1/MPa];D'' [1/MPa]", [D1, D2], "tension"),
        ("J' (MPa-1);J'' (MPa^-1)", [D1, D2], "shear"),
        ("J′ / MPa⁻¹;J″ / MPa⁻¹", [D1, D2], "shear"),
        ("Storage compliance D' [mm²/N];Loss compliance D'' [mm^2/N]", [D1, D2], "tension"),
        ("J' [cm²/dyn];J'' [m²/N]", [D1 * 1e-7, D2 * 1e-6], "shear"),
        ("J' [1/GPa];tan delta", [D1 * 1e3, TANGENT], "shear"),
        ("|D*| [1/MPa];delta [°]", [SIZE, DEGREES], "tension"),
        ("J* [1/MPa];tan δ", [SIZE, TANGENT], "shear"),
        ("D'' [1/MPa];phase [deg]", [D2, DEGREES], "tension"),
    ],
)
def test_dynamic_compliances_are_read_as_such(tmp_path, names, columns, deformation):
    """E' = D'/(D'² + D''²), E'' = D''/(D'² + D''²)."""
    text = f"f [Hz];{names}\n" + rows(HERTZ, *columns, separator=";")
    check(read(tmp_path, text), deformation=deformation)


def test_a_dynamic_modulus_with_a_phase_is_the_size_of_the_modulus(tmp_path):
    text = "f [Hz];Dynamic modulus (Pa);Phase angle (°)\n"
    check(read(tmp_path, text + rows(HERTZ, np.abs(MODULUS), DEGREES, separator=";")))


@pytest.mark.parametrize("name, size, roles", [
    ("Compliance [1/MPa]", SIZE, ("storage_compliance", "compliance_magnitude")),
    ("Modulus [Pa]", np.abs(MODULUS), ("storage", "magnitude")),
])  # fmt: skip
def test_a_number_beside_a_loss_tangent_may_be_a_part_or_the_size(tmp_path, name, size, roles):
    text = f"f [Hz];{name};tan δ\n" + rows(HERTZ, size, TANGENT, separator=";")
    with pytest.raises(ValueError, match=f"by `columns`, '{roles[0]}' or '{roles[1]}'"):
        read(tmp_path, text)
    check(read(tmp_path, text, columns={roles[1]: 2}))


@pytest.mark.parametrize(
    "options, expected",
    [
        ({"units": {"modulus": "MPa"}}, r".: the file states '1/MPa'; leave out `units="),
        ({"columns": {"storage": 2, "loss": 3}}, "states 'storage_compliance'; leave out `col"),
        ({"columns": {"storage": 2, "loss": 3}, "units": {"modulus": "MPa"}, "kind": "frequency"},
         "states 'storage_compliance'"),
    ],
)  # fmt: skip
def test_no_option_makes_moduli_of_compliances(tmp_path, options, expected):
    text = "f [Hz],J' [1/MPa],J'' [1/MPa]\n" + rows(HERTZ, D1, D2, separator=",")
    with pytest.raises(ValueError, match=expected):
        read(tmp_path, text, **options)
    check(read(tmp_path, text, units={"compliance": "1/MPa"}), deformation="shear")
    other = read(tmp_path, text, units={"compliance": "1/kPa"})  # a unit of the same kind
    np.testing.assert_allclose(other.values, MODULUS / 1e3, rtol=1e-7)


def test_a_unit_of_another_kind_is_no_unit_of_a_modulus(tmp_path):
    text = "f [Hz],E' [MPa],E'' [1/MPa]\n" + rows(HERTZ, STORAGE, LOSS, separator=",")
    with pytest.raises(ValueError, match="has '1/MPa' as unit, which is none of a modulus"):
        read(tmp_path, text)
    with pytest.raises(ValueError, match=r"states '1/MPa'; leave out `units=\{'modulus': 'MPa'\}`"):
        read(tmp_path, text, units={"modulus": "MPa"})


def test_periods_become_frequencies(tmp_path):
    text = "Period [ms],E' [Pa],E'' [Pa]\n" + rows(1e3 / HERTZ, STORAGE, LOSS, separator=",")
    measured = read(tmp_path, text)
    check(measured)
    assert any("period (ω = 2π/T) in ms" in sentence for sentence in measured.history)
    with pytest.raises(ValueError, match=r"has no known unit; .*`units=\{'time': 's'\}`"):
        read(tmp_path, text.replace(" [ms]", ""))


SIGNAL = "".join(f"{i / 10},{np.sin(i)},{np.sin(i + 0.3)}\n" for i in range(30))


@pytest.mark.parametrize(
    "text, what",
    [
        ("f [Hz],tan delta\n1,.2\n2,.3\n", "the loss tangent alone has no modulus: export E'"),
        (
            "Torque [mN m],Angle [mrad],f [Hz]\n1,2,1\n2,2,2\n",
            "it is torque and angle: .* geometry",
        ),
        ("T,log_aT\nC,-\n20,0\n30,-1\n", "it is a table of shift factors a_T over temperature"),
        ("Temperature [°C],Shift factor\n20,1\n30,.1\n", "shift factors a_T over temperature"),
        ("q [1/m],C(q) [m^4]\n1e5,1e-20\n1e6,1e-23\n", "it is a spectrum of heights, C.q."),
        ("Wavenumber (1/m),PSD (m³)\n1e5,1e-20\n1e6,1e-23\n", "a spectrum of heights"),
        ("tau [s],H [Pa]\n1,1e5\n2,2e5\n", "it is a continuous relaxation spectrum"),
        ("time [s],force [N],displacement [mm]\n" + SIGNAL, "a raw signal, force and displacement"),
        ("time [s],stress [Pa],strain [%]\n" + SIGNAL, "the signal of a dynamic test"),
        ("f [Hz],complex viscosity [Pa s]\n1,2\n2,1\n", "a complex viscosity over frequency"),
    ],
)
def test_other_tables_are_refused_by_their_name_whatever_the_hints(tmp_path, text, what):
    for hints in ({}, {"kind": "relaxation", "units": {"time": "s", "modulus": "Pa"}}):
        with pytest.raises(ValueError, match=what):
            read(tmp_path, text, **hints)


def test_a_column_that_the_user_names_is_read_beside_other_quantities(tmp_path):
    text = "time [s],force [N],displacement [mm],real,imag,f [Hz]\n"
    text += rows(HERTZ, HERTZ, HERTZ, STORAGE, LOSS, HERTZ, separator=",")
    columns = {"storage": "real", "loss": "imag"}
    check(read(tmp_path, text, columns=columns, units={"modulus": "Pa"}))


BARE = "Frequency [Hz],Storage modulus [Pa],Loss modulus [Pa]\n" + rows(
    HERTZ, STORAGE, LOSS, separator=","
)


@pytest.mark.parametrize(
    "line, deformation",
    [
        ("Anton Paar MCR 302", "shear"), ("Instrument,ARES-G2", "shear"), ("DSR of SBR", "shear"),
        ("Discovery HR-2", "shear"), ("Geometry,25 mm parallel plates", "shear"),
        ("Measuring system: PP25", "shear"), ("gap: 1 mm", "shear"), ("Rheometer: 7", "shear"),
        ("DMA Q800; clamp: shear sandwich", "shear"), ("DMA 850", "tension"),
        ("Clamp,dual cantilever", "tension"), ("Eplexor 500 N", "tension"),
        ("MCR 702; geometry: tension fixture", "tension"), ("Mode: 3-point bending", "tension"),
    ],
)  # fmt: skip
def test_tension_or_shear_is_found_in_the_lines_of_a_file(tmp_path, line, deformation):
    measured = read(tmp_path, f"{line}\n{BARE}")
    check(measured, deformation=deformation)
    assert measured.assumed == ()


@pytest.mark.parametrize("head", ["", "Sample: SBR\n", "DHR-3; DMA mode\n"])
def test_tension_that_nobody_states_is_a_caveat(tmp_path, head):
    measured = read(tmp_path, head + BARE)
    check(measured)
    (sentence,) = measured.assumed
    assert sentence in measured.history and "`deformation='shear'`" in sentence
    assert (TENSION in sentence) == ("DMA" not in head)
    assert measured.part(measured.isotherm == 0).assumed == measured.assumed
    assert read(tmp_path, head + BARE, deformation="tension").assumed == ()
    check(read(tmp_path, head + BARE, deformation="shear", poisson=0.5), modulus=3 * MODULUS)


def test_an_option_makes_no_tension_of_shear_moduli(tmp_path):
    text = BARE.replace("Storage modulus", "G'").replace("Loss modulus", "G''")
    with pytest.raises(ValueError, match="states 'shear'; leave out `deformation='tension'`"):
        read(tmp_path, text, deformation="tension")


def test_hertz_that_a_file_does_not_state_is_a_caveat(tmp_path):
    text = "{},E' [Pa],E'' [Pa]\n" + rows(HERTZ, STORAGE, LOSS, separator=",")
    (sentence,) = read(tmp_path, text.format("Frequency")).assumed
    assert "frequency in Hz, assumed by its name" in sentence
    assert read(tmp_path, text.format("omega")).assumed == ()
    assert read(tmp_path, text.format("Frequency"), units={"frequency": "Hz"}).assumed == ()


def test_an_infinite_value_is_called_so(tmp_path):
    text = "f [Hz],E' [Pa],E'' [Pa]\n" + rows(HERTZ, STORAGE, LOSS, separator=",") + "inf,1,1\n"
    measured = read(tmp_path, text)
    check(measured)
    assert any(re.match("Left out for an infinite value: .* line 6", s) for s in measured.history)
    assert len(OMEGA) == len(measured.abscissa)
