"""Prony series, strain sweeps, friction and motions from tables."""

from pathlib import Path

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.readers import NotPlain, read_friction, read_prony, read_strain_sweep
from graded_contact.readers.series import read_motion, read_over_time

DATA = Path(__file__).parents[3] / "shared" / "data"
measured_files = pytest.mark.skipif(
    not DATA.exists(), reason="the measured files lie beside the repository"
)


def write(folder, text):
    path = folder / "a.csv"
    path.write_text(text)
    return path


def check_rubber(found, factor=1.0):
    assert float(found.equilibrium) == pytest.approx(3e6 * factor)
    np.testing.assert_allclose(found.strengths, np.array([4e6, 2e6, 1e6]) * factor)
    np.testing.assert_allclose(found.times, [1e-3, 0.1, 10.0])


MODULI = "tau [s],{}_i [MPa]\n1e-3,4\n1e-1,2\n10,1\n"
RATIOS = "tau [ms],g_i\n1,0.4\n100,0.2\n1e4,0.1\n"
SERIES = [
    (MODULI.format("E") + "inf,3\n", {}),
    (MODULI.format("E"), {"equilibrium": 3e6}),
    (MODULI.format("E"), {"glassy": 1e7}),
    (RATIOS, {"glassy": 1e7}),
    (RATIOS, {"equilibrium": 3e6}),
    ("a,b\n4,1e-3\n2,1e-1\n1,10\n",
     {"columns": {"time": "b", "modulus": 1}, "units": {"time": "s", "modulus": "MPa"},
      "deformation": "tension", "equilibrium": 3e6}),
]  # fmt: skip


@pytest.mark.parametrize("text, options", SERIES)
def test_series_of_moduli_and_of_ratios(tmp_path, text, options):
    check_rubber(read_prony(write(tmp_path, text), **options))


def test_moduli_in_shear_become_moduli_in_tension(tmp_path):
    path = write(tmp_path, MODULI.format("G"))
    check_rubber(read_prony(path, equilibrium=3e6, poisson=0.25), 2.5)
    check_rubber(read_prony(path, glassy=1e7, poisson=0.25), 2.5)


REFUSED = [
    (MODULI.format("E"), {}),
    (MODULI.format("E") + "inf,3\n", {"equilibrium": 3e6}),
    (MODULI.format("E"), {"glassy": 1e6}),
    (RATIOS, {}),
    (RATIOS, {"glassy": 1e7, "equilibrium": 3e6}),
    (RATIOS.replace("0.4", "0.9"), {"glassy": 1e7}),
    ("tau [s],E_i\n1e-3,4\n10,1\n", {"equilibrium": 3e6}),
    ("tau [s],E_i [Pa]\n-1e-3,4\n10,1\n", {"equilibrium": 3e6}),
    ("tau [s],E [1/MPa]\n1e-3,4\n10,1\n", {"equilibrium": 3e6}),
    ("t [s],E [MPa]\n1e-3,4\n10,1\n", {"equilibrium": 3e6}),  # E(t)
]


@pytest.mark.parametrize("text, options", REFUSED)
def test_incomplete_and_contradicting_series_are_refused(tmp_path, text, options):
    with pytest.raises(ValueError, match=r"a\.csv|glassy"):
        read_prony(write(tmp_path, text), **options)


STRAIN, STORAGE = np.array([1e-3, 1e-2, 0.1]), np.array([2e6, 1.8e6, 9e5])
LOSS = np.array([2e5, 3e5, 1.5e5])


@pytest.mark.parametrize("order", [1, -1])
def test_a_strain_sweep_gives_factors(tmp_path, order):
    lines = [f"{100 * s},{e},{l}" for s, e, l in zip(STRAIN, STORAGE, LOSS, strict=True)][::order]
    sweep = read_strain_sweep(write(tmp_path, "\n".join(["strain [%],G' [Pa],G'' [Pa]", *lines])))
    for found, expected in zip(sweep, (STRAIN, STORAGE / 2e6, LOSS / 2e5), strict=True):
        np.testing.assert_allclose(found, expected)
    with pytest.raises(NotPlain):  # a part or per cent
        read_strain_sweep(write(tmp_path, "\n".join(["strain,G' [Pa],G'' [Pa]", *lines])))
    twice = ["strain [%],G' [Pa],G'' [Pa]", *lines, *lines[::-1]]
    with pytest.raises(NotPlain):
        read_strain_sweep(write(tmp_path, "\n".join(twice)))


@measured_files
def test_a_measured_strain_sweep_softens_a_rubber():
    sweep = read_strain_sweep(DATA / "rheology" / "epdm70_sd_10hz.csv")
    soft = gc.materials.StrainSoftening(gc.Elastic(1e7, 0.49), *sweep, amplitude=sweep[0][-1])
    np.testing.assert_allclose(soft.complex_modulus(np.array([1.0]))[0].real, 1e7 * sweep[1][-1])


@measured_files
def test_a_measured_series_has_its_instantaneous_modulus():
    path = DATA / "rheology" / "pyvisco_verif_time_prony_terms_KPf_MD.csv"
    rubber = read_prony(path, glassy=1739.03e6, units={"time": "s"})
    assert len(rubber.times) == 31
    assert float(rubber.equilibrium + np.sum(rubber.strengths)) == pytest.approx(1739.03e6)


def test_friction_with_errors_and_temperatures(tmp_path):
    text = "v [mm/s],µ,std [%],T [°C]\n1,0.5,2,20\n10,0.7,,20\n100,0.6,3,20\n"
    found = read_friction(write(tmp_path, text))
    np.testing.assert_allclose(found.velocity, [1e-3, 1e-2, 0.1])
    np.testing.assert_allclose(found.friction, [0.5, 0.7, 0.6])
    np.testing.assert_allclose(found.error, [0.02, np.nan, 0.03])
    np.testing.assert_allclose(found.temperature, 293.15)
    with pytest.raises(NotPlain) as error:
        read_friction(write(tmp_path, "v,friction\n1,0.5\n10,0.7\n"))
    assert error.value.options == {"units": {"velocity": "..."}}


def test_motions_and_loads_over_time(tmp_path):
    times = np.linspace(0, 95, 20)
    lines = [f"{t},{np.sin(2 * np.pi * t / 100)}" for t in times]
    path = write(tmp_path, "\n".join(["time [ms],displacement [mm]", *lines]))
    motion = read_motion(path, period=0.1, num_times=16)
    phase = 2 * np.pi * np.arange(16) / 16
    np.testing.assert_allclose(motion.displacement, 1e-3 * np.sin(phase), atol=3e-5)
    path = write(tmp_path, "\n".join(["time [min],pressure [kPa]", *lines]))
    seconds, pressure = read_over_time(path, "pressures")
    np.testing.assert_allclose(seconds, 60 * times)
    np.testing.assert_allclose(pressure, 1e3 * np.sin(2 * np.pi * times / 100))
    with pytest.raises(ValueError, match=r"time \[ms\], displacement \[mm\]"):
        read_motion(path, period=0.1)
