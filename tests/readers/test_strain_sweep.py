"""Strain sweeps in files: amplitudes and factors of the moduli, for `StrainSoftening`."""

from pathlib import Path

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.materials import StrainSoftening
from graded_contact.readers import read_strain_sweep
from graded_contact.scenes.scene import parse_scene

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
    "descending": table(
        "Shear strain [1]\tG'\tG''\n1\tPa\tPa", [a[::-1] for a in (STRAIN, STORAGE, LOSS)]
    ),
    "german": table(
        "Dehnung [%];Speichermodul [kPa];Verlustmodul [kPa]",
        (PERCENT, STORAGE / 1e3, LOSS / 1e3),
        ";",
        ",",
    ),
    "instrument": table(
        "Oscillation strain\tStorage modulus\tTan(delta)\tAngular frequency\tTemperature\n"
        "%\tPa\t-\trad/s\t°C",
        (PERCENT, STORAGE, TAN, 0 * TAN + 62.8, TEMPERATURE),
    ),
    "dma": table(
        "run,freq_hz,G_storage_pa,G_loss_pa,tan_delta,strain_dyn_pct,strain_stat_pct",
        (TAN, 0 * TAN + 10, STORAGE, LOSS, TAN, PERCENT, 0 * TAN + 5),
        ",",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_spellings_of_one_sweep(name, tmp_path):
    (tmp_path / "sweep.csv").write_text(FILES[name])
    strain, storage, loss = read_strain_sweep(tmp_path / "sweep.csv")
    np.testing.assert_allclose(strain, STRAIN, rtol=1e-12)
    np.testing.assert_allclose(storage, STORAGE / STORAGE[0], rtol=1e-8)
    np.testing.assert_allclose(loss, LOSS / LOSS[0], rtol=1e-8)


def test_a_scene_names_the_file(tmp_path):
    (tmp_path / "payne.csv").write_text(FILES["percent"])
    text = (
        '[materials.tread]\nkind = "prony"\nequilibrium = 1e6\nstrengths = [4e6]\ntimes = [1e-2]\n'
    )
    text += '[materials.soft]\nkind = "strain_sweep"\nmaterial = "tread"\npath = "payne.csv"\n'
    text += "amplitude = 0.01\n"
    text += (
        '[base]\nkind = "half_space"\nmaterial = "soft"\n[load]\npressure = 1e5\nvelocity = 1.0\n'
    )
    text += '[surface]\nkind = "self_affine"\nrms_slope = 0.1\nhurst = 0.8\n'
    text += "q_low = 6e3\nq_roll = 6e3\nq_high = 3e4\n[grid]\nshape = [16, 16]\nsize = 1e-3\n"
    scene = parse_scene(text, folder=tmp_path)
    soft = scene.stack.base.material
    found, linear = soft.modulus(1e3), soft.material.modulus(1e3)
    np.testing.assert_allclose(found, 0.9 * linear.real + 1.5j * linear.imag, rtol=1e-8)
    assert any("strain in %" in note for note in scene.notes)


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


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (table("f [Hz],Strain [%],E' [Pa],E'' [Pa]", ([1, 2, 4], PERCENT, STORAGE, LOSS), ","),
         r"the frequency varies from 6\.283 to 25\.13"),
        (table("Strain,E' [Pa],E'' [Pa]", (PERCENT, STORAGE, LOSS), ","), "Pass `units`: strain"),
        (table("strain [mm],E' [Pa],E'' [Pa]", (PERCENT, STORAGE, LOSS), ","),
         r"\(strain \[mm\]\), the strain, has no known unit"),
        (table("t [s],E' [Pa],E'' [Pa]", (PERCENT, STORAGE, LOSS), ","), "Needed: strain, storage"),
        (2 * table("Strain [%],E' [Pa],E'' [Pa]", (PERCENT, STORAGE, LOSS), ","), "has several"),
    ],
)  # fmt: skip
def test_what_is_no_strain_sweep_is_refused(text, words, tmp_path):
    (tmp_path / "other.csv").write_text(text)
    with pytest.raises(ValueError, match=words):
        read_strain_sweep(tmp_path / "other.csv")


def test_the_reader_of_moduli_names_the_reader_of_sweeps(tmp_path):
    columns = ([10.0, 10, 10], PERCENT, STORAGE, LOSS)
    (tmp_path / "s.csv").write_text(table("f [Hz],Strain [%],E' [Pa],E'' [Pa]", columns, ","))
    with pytest.raises(ValueError, match=r"`materials\.read_strain_sweep` reads those"):
        gc.read_moduli(tmp_path / "s.csv")


@pytest.mark.parametrize("strains", [[1, 10, 1.01, 10.1], [1, 10, 30, 9], [1, 1, 10, 30]])
def test_several_curves_in_one_file_are_refused(tmp_path, strains):
    moduli = np.linspace(2e6, 1e6, 4), np.linspace(2e5, 1e5, 4)
    (tmp_path / "s.csv").write_text(table("strain [%],E' [Pa],E'' [Pa]", (strains, *moduli), ","))
    with pytest.raises(ValueError, match="several curves, or a sweep up and a sweep down"):
        read_strain_sweep(tmp_path / "s.csv")
