"""Damaged files are read or refused with a message; every row is read or reported as left out."""

import re
from pathlib import Path

import numpy as np
import pytest
from scene_texts import damaged
from test_instrument_exports import EXPORTS, rheocompass, trios

from graded_contact import read_moduli

SEED = 20261
CREEP = "Time [s];Shear strain [%];Shear stress [kPa]\n" + "".join(
    f"{10**i};{1 + i};2,0{i}\n" for i in range(6)
)
SAMPLES = {
    **{f"{name}.txt": (text.encode(), options) for name, (text, options, _) in EXPORTS.items()},
    "trios.txt": (trios().encode("cp1252"), {}),
    "rheocompass.csv": (rheocompass(decimal=",").encode("utf-16"), {}),
    "creep.csv": (CREEP.encode(), {}),
    "sweep.tts": (b"T=-35;Mw=2;\n" + b"".join(b"%d 1e5 2e%d 0\n" % (i, i) for i in range(9)), {}),
}


def check_damaged(folder, name: str, content: bytes, options: dict) -> bool:
    """Reads a file; whether it was accepted."""
    path = folder / Path(name).name.replace(",", "")
    path.write_bytes(content)
    try:
        measured = read_moduli(path, **options)
    except (ValueError, OSError, ImportError) as error:
        assert path.name in str(error), error
        assert len(str(error)) < 20_000
        return False
    values = np.stack([measured.values.real, measured.values.imag])
    assert np.all(np.isfinite(values)) and np.all(values[0] > 0)
    assert measured.kind != "frequency" or np.all(values[1] > 0)
    assert np.all(np.isfinite(measured.abscissa)) and np.all(measured.abscissa > 0)
    assert all(np.all(np.diff(part.abscissa) >= 0) for part in measured.isotherms())
    if not any("side by side" in note or "curves" in note for note in measured.history):
        history = " ".join(measured.history)
        there = sum(map(int, re.findall(r"Read (\d+) rows", history)))
        left = re.findall(r"Left out for (?!having no numbers)[^:]*: (\d+) row\(s\)", history)
        assert there == len(measured.lines) + sum(map(int, left)), measured.history
    return True


@pytest.mark.parametrize("name", SAMPLES)
def test_damaged_exports_are_read_or_refused(tmp_path, name):
    content, options = SAMPLES[name]
    draw = np.random.default_rng([SEED, *name.encode()])
    for _ in range(20):
        check_damaged(tmp_path, name, damaged(content, draw), options)
