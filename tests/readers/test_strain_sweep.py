"""Strain sweeps in files: amplitudes and factors of the moduli, for `StrainSoftening`."""

from pathlib import Path

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.materials import StrainSoftening
from graded_contact.readers import read_strain_sweep

STRAIN = np.array([1e-3, 1e-2, 0.1])
STORAGE, LOSS = np.array([2e6, 1.8e6, 9e5]), np.array([2e5, 3e5, 1.5e5])
MEASURED = Path(__file__).parents[2].parent / "shared/data/rheology/epdm70_sd_10hz.csv"


def table(heading, columns, mark="\t", decimal="."):
    rows = [mark.join(f"{x:.9g}" for x in row) for row in zip(*columns, strict=True)]
    return heading + "\n" + "\n".join(rows).replace(".", decimal) + "\n"


PERCENT, TAN = 100 * STRAIN, LOSS / STORAGE
TEMPERATURE = [22.0, 24.5, 26.0]  # it heats itself
FILES = {
    "percent": table("Strain [%],E' [MPa],E'' [MPa]", (PERCENT, STORAGE / 1e6, LOSS / 1e6), ","),
    "descending": table("Shear strain [1]\tG'\tG''\n1\tPa\tPa",
                        [a[::-1] for a in (STRAIN, STORAGE, LOSS)]),
    "german": table("Dehnung [%];Speichermodul [kPa];Verlustmodul [kPa]",
                    (PERCENT, STORAGE / 1e3, LOSS / 1e3), ";", ","),
    "instrument": table(
        "Oscillation strain\tStorage modulus\tTan(delta)\tAngular frequency\tTemperature\n"
        "%\tPa\t-\trad/s\t°C",
        (PERCENT, STORAGE, TAN, 0 * TAN + 62.8, TEMPERATURE),
    ),
    "trios": table(
        "Strain ratio\tOscillation strain (cmd)\tOscillation strain\tG'\tG''\n"
        "\t%\t%\tPa\tPa",
        (0 * TAN + 0.99, 1.1 * PERCENT, PERCENT, STORAGE, LOSS),
    ),
    "dma": table(
        "run,freq_hz,G_storage_pa,G_loss_pa,tan_delta,strain_dyn_pct,strain_stat_pct",
        (TAN, 0 * TAN + 10, STORAGE, LOSS, TAN, PERCENT, 0 * TAN + 5),
        ",",
    ),
}  # fmt: skip


def test_a_measured_sweep():
    if not MEASURED.exists():
        pytest.skip("the measured file is not here")
    rows = np.loadtxt(MEASURED, delimiter=",", skiprows=1, usecols=(3, 4, 8))
    strain, storage, loss = read_strain_sweep(MEASURED)
    np.testing.assert_allclose(strain, rows[:, 2] / 100, rtol=1e-12)
    np.testing.assert_allclose(storage, rows[:, 0] / rows[0, 0], rtol=1e-12)
    np.testing.assert_allclose(loss, rows[:, 1] / rows[0, 1], rtol=1e-12)
    rubber = gc.Prony(1e6, [4e6], [1e-2])
    softest = StrainSoftening(rubber, strain, storage, loss, amplitude=1.0).modulus(1e3).real
    np.testing.assert_allclose(softest, storage[-1] * rubber.modulus(1e3).real, rtol=1e-12)


def sweep(heading, *columns):
    return table(heading + ",E' [Pa],E'' [Pa]", (*columns, STORAGE, LOSS), ",")
