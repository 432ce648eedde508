"""The site: every public name is described, and what its pages call exists; `.ci/run` builds it."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import graded_contact as gc
from graded_contact.scenes import parse_scene

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.glob("*.md"), *DOCS.glob("[ht]*/*.md"), ROOT / "README.md"])


def python_blocks(page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def called(node: ast.AST) -> object:
    """What `gc.name.name` stands for, or None for anything else."""
    if isinstance(node, ast.Name):
        return gc if node.id == "gc" else None
    owner = called(node.value) if isinstance(node, ast.Attribute) else None
    return None if owner is None else getattr(owner, node.attr)


def check_calls(block: str) -> None:
    for node in ast.walk(ast.parse(block)):
        if isinstance(node, ast.Attribute):
            called(node)
        if isinstance(node, ast.Call) and (function := called(node.func)) is not None:
            given = [keyword.arg for keyword in node.keywords if keyword.arg]
            inspect.signature(function).bind_partial(*node.args, **dict.fromkeys(given))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_calls_exists_and_takes_its_arguments(page):
    for block in python_blocks(page):
        check_calls(block)


def test_what_examples_call_exists_and_takes_their_arguments(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    for name, block in importlib.import_module("_examples").EXAMPLES.items():
        assert hasattr(gc, name)
        check_calls(block)


def test_every_public_name_is_described_with_its_docstring(monkeypatch):
    """Names without a docstring, and methods as well, are refused by what makes the pages."""
    monkeypatch.syspath_prepend(str(DOCS))
    pages = importlib.import_module("_generated").reference_pages()
    described = set(re.findall(r"\{py:(?:class|function)\} (\w+)\(", "".join(pages.values())))
    names = {name: getattr(gc, name) for name in gc.__all__ if name != "shapes"}
    rooms = {name: room for name, room in names.items() if inspect.ismodule(room)}
    assert set(gc.__all__) - set(rooms) <= described
    for room in rooms.values():
        assert {name for name in getattr(room, "__all__", ()) if name.islower()} <= described | {
            "shapes"
        }
    assert set(rooms) <= set(pages)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_whole_scenes_of_a_page_are_read(page):
    text = page.read_text(encoding="utf-8")
    for scene in re.findall(r"^```toml\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL):
        if "[surface]" in scene and "[base]" in scene and "path" not in scene:
            parse_scene(scene)


@pytest.fixture
def checks(monkeypatch):
    """What the build of the site refuses."""
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("_checks")


RUN = [
    "choose", "coat_against_cracks", "design", "indenter", "own_law", "own_profile", "own_solver",
    "precision", "shear_and_heat", "short_answers", "studies",
]  # fmt: skip


# Alone, these pages say all that their programs need.
@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_programs_of_a_page_run(name, tmp_path):
    program = "\n".join(python_blocks(DOCS / "howto" / f"{name}.md"))
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_network_that_is_trained_through_slide_makes_friction_flat(monkeypatch):
    """By the program of its page, which draws its figure, too."""
    monkeypatch.syspath_prepend(str(DOCS))
    found = importlib.import_module("_generated").run_program(DOCS / "howto" / "neural_profile.md")
    ratios = [float(found[name].max() / found[name].min()) for name in ("before", "after")]
    assert ratios[0] > 1.7 and ratios[1] < 1.06
    figure = importlib.import_module("_figures").neural_profile(found)
    assert len(figure.axes) == 2
