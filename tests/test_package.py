"""What is installed: public names, their docstrings, and the command."""

import inspect
import runpy
import subprocess
import sys

import pytest

import graded_contact as gc


def test_the_module_is_the_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["graded-contact", "--version"])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("graded_contact", run_name="__main__")
    assert end.value.code == 0 and capsys.readouterr().out.startswith("graded-contact ")


LAZY = """
import sys
import graded_contact as gc
late = {"h5py", "matplotlib", "pandas", "xarray", "scipy.linalg", "scipy.optimize"}
assert not late & set(sys.modules)
assert gc.plot.COLOURS and gc.read_results and "matplotlib" not in sys.modules
assert set(dir(gc)) == {*gc.__all__, '__version__'} and len(gc.__all__) <= 66
"""


def test_every_name_is_there_and_files_and_figures_cost_nothing_until_used():
    subprocess.run([sys.executable, "-c", LAZY], check=True)
    assert all(hasattr(gc, name) for name in gc.__all__)
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        gc.plots  # noqa: B018


NAMES = [getattr(gc, name) for name in gc.__all__ if name not in ("plot", "shapes")]
ROOMS = [room for room in NAMES if inspect.ismodule(room)]
NAMED = [
    *((gc, name) for name in gc.__all__),
    *((room, name) for room in ROOMS for name in getattr(room, "__all__", ())),
]


@pytest.mark.parametrize("module, name", NAMED, ids=lambda entry: getattr(entry, "__name__", entry))
def test_a_public_name_says_what_it_takes_and_returns(module, name):
    """By name, or "as in" another function."""
    found = getattr(module, name)
    text = inspect.getdoc(found) or ""
    assert text
    if inspect.isfunction(found):
        assert "**Returns:**" in text or text.startswith(("Returns ", "Shows "))
        parameters = inspect.signature(found).parameters
        unnamed = [key for key in parameters if f"`{key}`" not in text]
        assert len(parameters) < 5 or not unnamed or " as in `" in text or "as `" in text
