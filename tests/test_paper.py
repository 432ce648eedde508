"""The script of the paper's figures of contacts runs, from stored results."""

import runpy
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "examples" / "paper"


def test_the_contacts_have_their_seven_figures(tmp_path, monkeypatch, unchecked_types):
    """They are made, but not drawn, which takes long."""
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", ["contacts", "--output", str(tmp_path)])
    import system

    made = []
    monkeypatch.setattr(system, "save", lambda *figures: made.append(figures))
    runpy.run_path(str(FOLDER / "contacts.py"), run_name="__main__")
    assert len(made) == 7
