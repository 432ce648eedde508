"""The notebooks run, in a small size, show figures without warnings, and are stored stripped."""

import io
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import pytest

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SMALL = 64  # points along each edge


def read(path):
    return nbformat.read(path, as_version=nbformat.NO_CONVERT)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path):
    notebook = read(path)
    nbformat.validate(notebook)
    for number, cell in enumerate(code_cells(notebook), 1):
        assert cell.outputs == [], f"code cell {number} has outputs: strip them (nbstripout)"
        assert cell.execution_count is None, f"code cell {number} has an execution count"


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_figures(path, tmp_path, monkeypatch, unchecked_types):
    """In this process, whose warnings are errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GRADED_CONTACT_NOTEBOOK_SIZE", str(SMALL))
    names = {"__name__": "notebook"}
    with plt.rc_context():
        for cell in code_cells(read(path)):
            exec(cell.source.replace("%matplotlib inline", ""), names)
        shown = plt.get_fignums()
        for number in shown:
            plt.figure(number).savefig(io.BytesIO())
        plt.close("all")
    assert shown
