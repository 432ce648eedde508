"""The scripts that draw the paper's figures run."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples" / "paper"


@pytest.mark.parametrize("script", ["contacts", "response"])
def test_a_script_draws_its_seven_figures(script, tmp_path):
    command = [sys.executable, FOLDER / f"{script}.py", "--output", tmp_path]
    subprocess.run(command, check=True, capture_output=True)
    assert len(list(tmp_path.glob("*.png"))) == 7
