"""The scripts that draw the paper's figures, at small size, contacts first."""

import argparse
import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from PIL import Image

FOLDER = Path(__file__).parents[1] / "examples" / "paper"
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


def test_tables_are_kept_in_one_file_that_another_process_may_read(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    system = importlib.import_module("system")
    given = argparse.Namespace(output=tmp_path, small=False, again=False)

    def table(number):
        return lambda: xarray.Dataset({"friction": ("x", [number])})

    system.kept(given, "first", table(1.0))
    with h5py.File(tmp_path / "results.h5"):
        system.kept(given, "second", table(2.0))
    for name, number in (("first", 1.0), ("second", 2.0)):
        assert system.kept(given, name, table(0.0)).friction == number


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS)
def test_script_runs_at_small_size_and_no_contact_fails(drawn, script):
    printed = drawn(script)
    assert "NOT CONVERGED" not in printed
    assert " 0 failed" in printed or "failed" not in printed
    assert "nan" not in printed


@pytest.mark.slow
@pytest.mark.parametrize("script", [name for name in SCRIPTS if name != "two_methods"])
def test_committed_figures_are_what_the_stored_results_give(tmp_path, script):
    """By what `save` writes into each file: pixels differ with fonts and versions of Matplotlib."""
    committed = FOLDER.parents[1] / "docs" / "paper"
    shutil.copy(committed / "results.h5", tmp_path)
    command = [sys.executable, FOLDER / f"{script}.py", "--output", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for drawing in tmp_path.glob("*.png"):
        new, old = (
            json.loads(Image.open(folder / drawing.name).text["Comment"])
            for folder in (tmp_path, committed)
        )
        assert new["texts"] == old["texts"], drawing.name
        # Some figures draw errors of a method, which end at rounding.
        np.testing.assert_allclose(
            new["numbers"], old["numbers"], rtol=1e-3, atol=1e-13, err_msg=drawing.name
        )
