"""Strain sweeps, and motions and loads over time, from tables."""

from pathlib import Path

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.readers import NotPlain, read_strain_sweep
from graded_contact.readers.series import read_motion, read_over_time

DATA = Path(__file__).parents[3] / "shared" / "data"
measured_files = pytest.mark.skipif(
    not DATA.exists(), reason="the measured files lie beside the repository"
)


def write(folder, text):
    path = folder / "a.csv"
    path.write_text(text)
    return path


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
    np.testing.assert_allclose(soft.modulus(np.array([1.0]))[0].real, 1e7 * sweep[1][-1])


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
