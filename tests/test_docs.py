"""What the pages and examples call exists and takes its arguments; their scenes are read."""

import ast
import csv
import inspect
import re
from pathlib import Path

import pytest

import graded_contact as gc
from graded_contact.scenes import parse_scene

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("docs/*.md"), ROOT / "README.md"])


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def called(node: ast.AST) -> object:
    """What `gc.name.name` stands for, or None for anything else."""
    if isinstance(node, ast.Name):
        return gc if node.id == "gc" else None
    owner = called(node.value) if isinstance(node, ast.Attribute) else None
    return None if owner is None else getattr(owner, node.attr)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
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


def stored(benchmark: str, column: str, **where: str) -> list[float]:
    """Returns a column of the stored rows of a benchmark."""
    path = ROOT / f"benchmarks/results/bench_{benchmark}.csv"
    with open(path, newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if where.items() <= row.items()]
    return [float(row[column]) for row in rows]


def test_pages_claim_what_is_stored():
    peers = {
        load: stored("contact-elastic", "over our time", solver="tamaas", **{"p/E*": load})
        for load in ("0.01", "0.1", "0.3")
    }
    partial, full = peers["0.01"] + peers["0.1"], peers["0.3"]
    gradients = stored("contact-gradient", "gradient over friction")
    claims = (
        f"{1e15 * stored('response-hard', 'error: worst', stacks='all')[0]:.0f}·10⁻¹⁵",
        f"{min(partial):.0f} to {max(partial):.0f} times faster than by Tamaas",
        f"full contact {min(full):.0f} to {max(full):.0f})",
        f"{min(gradients):.2f} to {max(gradients):.2f} solves",
    )
    for page in ("README.md", "docs/index.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        assert not [claim for claim in claims if claim not in text], page
    text = (ROOT / "docs/performance.md").read_text(encoding="utf-8")
    for call in ("slide", "gradient"):
        assert f"{stored('contact-first', 'time [s]', call=call)[0]:.0f} s for" in text, call
