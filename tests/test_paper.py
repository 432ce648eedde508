"""The script that draws the paper's figures of contacts runs, from stored results."""

import runpy
import sys
from pathlib import Path

import matplotlib

FOLDER = Path(__file__).parents[1] / "examples" / "paper"


def test_the_contacts_have_their_seven_figures(tmp_path, monkeypatch, unchecked_types):
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", ["contacts", "--output", str(tmp_path)])
    with matplotlib.rc_context({"savefig.dpi": 20}):
        runpy.run_path(str(FOLDER / "contacts.py"), run_name="__main__")
    assert len(list(tmp_path.glob("*.png"))) == 7
