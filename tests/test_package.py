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


def is_told(found) -> bool:
    """Whether a docstring says what a function takes, by name or "as in" another, and returns."""
    text = inspect.getdoc(found) or ""
    if not inspect.isfunction(found):
        return bool(text)
    parameters = inspect.signature(found).parameters
    named = len(parameters) < 5 or all(f"`{key}`" in text for key in parameters)
    returned = "**Returns:**" in text or text.startswith(("Returns ", "Shows "))
    return returned and (named or " as in `" in text or "as `" in text)


def test_public_names_say_what_they_take_and_return():
    """Not in a parameter for each name: pages and figures take seconds to import."""
    names = [getattr(gc, name) for name in gc.__all__ if name not in ("plot", "shapes")]
    rooms = [gc, *filter(inspect.ismodule, names)]
    places = [(room, name) for room in rooms for name in getattr(room, "__all__", ())]
    assert len(places) > 150
    silent = [(room.__name__, name) for room, name in places if not is_told(getattr(room, name))]
    assert silent == []
