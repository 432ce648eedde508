"""The notebooks run, in a small size, show figures without warnings, and are stored stripped."""

import os
import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

import graded_contact

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SMALL = 64  # points along each edge
PATIENCE = 600  # s, for a kernel to start or a cell to end on a busy machine


def read(path):
    return nbformat.read(path, as_version=nbformat.NO_CONVERT)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def execute(notebook, folder: Path) -> None:
    """Runs a notebook in `folder`, by this interpreter whatever kernels the machine has."""
    manager = AsyncKernelManager(
        kernel_name="python3", kernel_spec_manager=KernelSpecManager(kernel_dirs=[])
    )
    assert manager.kernel_spec.argv[0] == sys.executable
    package = str(Path(graded_contact.__file__).parents[1])
    environment = {
        "GRADED_CONTACT_NOTEBOOK_SIZE": str(SMALL),
        "PYTHONPATH": os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")])),
        "IPYTHONDIR": str(folder / "ipython"),
    }
    client = NotebookClient(notebook, km=manager, timeout=PATIENCE, startup_timeout=PATIENCE)
    client.execute(cleanup_kc=True, cwd=str(folder), env=os.environ | environment)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path):
    notebook = read(path)
    nbformat.validate(notebook)
    for number, cell in enumerate(code_cells(notebook), 1):
        assert cell.outputs == [], f"code cell {number} has outputs: strip them (nbstripout)"
        assert cell.execution_count is None, f"code cell {number} has an execution count"


# CI has no time for all.
RUNS = [
    pytest.param(path, id=path.stem, marks=[] if path.stem.startswith("01") else pytest.mark.slow)
    for path in NOTEBOOKS
]


@pytest.mark.parametrize("path", RUNS)
def test_a_notebook_runs_and_shows_figures(path, tmp_path):
    notebook = read(path)
    execute(notebook, tmp_path)
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    shown = [output for output in outputs if "image/png" in output.get("data", {})]
    printed = [output.text for output in outputs if output.get("name") == "stderr"]
    assert shown
    assert not [text for text in printed if "Warning" in text]
