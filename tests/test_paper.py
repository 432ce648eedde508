"""The scripts that draw the paper's figures, at small size, contacts first."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks" / "paper"
MODULES = ("system", "contacts", "coated_half_space")
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem not in MODULES)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Runs a script into a folder that has the contacts, and returns what it printed."""
    folder = tmp_path_factory.mktemp("paper")

    def run(script):
        small = [] if script == "response" else ["--small"]
        done = subprocess.run(
            [sys.executable, FOLDER / f"{script}.py", *small, "--output", folder],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "wrote" in run("contacts")
    return run


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS)
def test_script_runs_at_small_size_and_no_contact_fails(drawn, script):
    printed = drawn(script)
    assert "NOT CONVERGED" not in printed
    assert " 0 failed" in printed or "failed" not in printed
    assert "nan" not in printed
