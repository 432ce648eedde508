"""The scripts that draw the paper's figures run."""

import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples" / "paper"


@pytest.mark.parametrize("script", ["contacts", "response"])
def test_a_script_draws_its_seven_figures(script, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", [script, "--output", str(tmp_path)])
    runpy.run_path(str(FOLDER / f"{script}.py"), run_name="__main__")
    assert len(list(tmp_path.glob("*.png"))) == 7
