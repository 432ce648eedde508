"""What pages, notebooks and examples call exists and takes its arguments; scenes are read."""

import ast
import inspect
import json
import re
from pathlib import Path

import pytest

import graded_contact as gc
from graded_contact.scenes import parse_scene

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("docs/*.md"), ROOT / "README.md"])
SCRIPTS = sorted([*ROOT.glob("notebooks/*.ipynb"), *ROOT.glob("examples/**/*.py")])


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".py":
        return [text]
    if page.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
        return ["".join(cell["source"]).replace("%matplotlib", "#") for cell in cells]
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def called(node: ast.AST) -> object:
    """What `gc.name.name` stands for, or None for anything else."""
    if isinstance(node, ast.Name):
        return gc if node.id == "gc" else None
    owner = called(node.value) if isinstance(node, ast.Attribute) else None
    return None if owner is None else getattr(owner, node.attr)


@pytest.mark.parametrize("page", PAGES + SCRIPTS, ids=lambda page: page.stem)
def test_what_a_page_calls_exists_and_takes_its_arguments(page):
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Attribute):
                called(node)
            if isinstance(node, ast.Call) and (function := called(node.func)) is not None:
                given = [keyword.arg for keyword in node.keywords if keyword.arg]
                inspect.signature(function).bind_partial(*node.args, **dict.fromkeys(given))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_whole_scenes_of_a_page_are_read(page):
    for text in blocks(page, "toml"):
        if "[surface]" in text and "[base]" in text and "path" not in text:
            scene = parse_scene(text)
            scene.case(scene.first)
