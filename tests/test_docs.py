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
from graded_contact.scenes.scene_file import parse_scene

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


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.stem)
def test_the_files_that_a_page_names_exist(page):
    """From the root, or from the end of their path."""
    for name in set(re.findall(r"[\w./-]+\.py\b", page.read_text(encoding="utf-8"))):
        folders = ("graded_contact", "benchmarks", "docs")
        assert (ROOT / name).exists() or any(any((ROOT / f).rglob(name)) for f in folders), name


def test_the_steps_from_slide_to_friction_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    steps = re.findall(r"(\w+)(?:\.\w+)?  \((\w+/\w+\.py)\)", text)
    assert len(steps) == 11
    for name, file in steps:
        source = (ROOT / "graded_contact" / file).read_text(encoding="utf-8")
        assert re.search(rf"(def|class) {name}\b", source), (name, file)


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
    rooms = {name: getattr(gc, name) for name in gc.ROOMS}
    assert set(gc.__all__) - set(rooms) <= described
    for room in rooms.values():
        assert {name for name in getattr(room, "__all__", ()) if name.islower()} <= described | {
            "shapes"
        }
    assert set(rooms) <= set(pages)


def test_no_docstring_lists_a_field_or_an_argument_twice():
    for path in (ROOT / "graded_contact").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                for part in (ast.get_docstring(node) or "").split("\n\n"):
                    entries = re.findall(r"^- (`[^:]*`):", part, flags=re.MULTILINE)
                    names = re.findall(r"`([^`]*)`", " ".join(entries))
                    assert len(names) == len(set(names)), (path.name, node.name, names)


def test_the_table_of_keys_is_that_of_the_code(monkeypatch):
    """`python docs/_generated.py` writes it anew."""
    monkeypatch.syspath_prepend(str(DOCS))
    made = importlib.import_module("_generated").keys_page()
    assert (DOCS / "scene_keys.md").read_text(encoding="utf-8") == made


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_whole_scenes_of_a_page_are_read(page):
    text = page.read_text(encoding="utf-8")
    for scene in re.findall(r"^```toml\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL):
        if "[surface]" in scene and "[base]" in scene and "path" not in scene:
            parse_scene(scene).surface.build()


@pytest.fixture
def checks(monkeypatch):
    """What the build of the site refuses."""
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("_checks")


@pytest.mark.parametrize(
    "formula", [r"\tfrac43\,(k/E^*)", r"-\tfrac83\gamma", r"\frac\mu2", r"\dfrac 12"]
)
def test_a_fraction_without_braces_is_refused(checks, formula):
    """docutils shows the first as 43 over a space."""
    with pytest.raises(ValueError, match="with braces"):
        checks.check_formula(formula)


def test_all_fractions_have_braces(checks):
    for part, ending in (("docs", "md"), ("graded_contact", "py"), ("notebooks", "ipynb")):
        for path in (ROOT / part).rglob(f"*.{ending}"):
            checks.check_formula(path.read_text(encoding="utf-8"))


def test_links_of_the_site_to_no_file_and_to_no_anchor_are_found(checks, tmp_path):
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "a b.png").touch()
    links = [
        "#top", "b.html#%C3%A9", "b.html", "pictures/a%20b.png", "https://example.org/#none",
        "mailto:a@example.org", "#none", "b.html#top", "c.html", "pictures/a%20b.png#none",
    ]  # fmt: skip
    anchors = "".join(f'<a href="{link}"></a>' for link in links)
    (tmp_path / "a.html").write_text(f'<p id="top">{anchors}<img src="c.png"></p>')
    (tmp_path / "b.html").write_text(
        '<p id="\u00e9"><a href="a.html#top"></a></p>', encoding="utf-8"
    )
    assert checks.dead_links(tmp_path) == [
        f"a.html: {link}" for link in (*links[6:], "c.png")
    ]  # fmt: skip


def test_messages_on_the_page_of_symptoms_are_printed_by_the_package():
    """They have more than five words; … stands for values."""
    texts = []
    for path in (ROOT / "graded_contact").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = [getattr(part, "value", "…") for part in node.values]
                texts.append("".join(part if isinstance(part, str) else "…" for part in parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(re.sub(r"\{.*?\}|NUMBER", "…", node.value))
    known = "\n".join(texts)
    page = (DOCS / "howto" / "something_wrong.md").read_text(encoding="utf-8")
    quoted = [text for _, text in re.findall(r"(`+)(.+?)\1(?!`)", page.replace("\n", " "))]
    messages = [text for text in quoted if text.count(" ") > 4]
    assert len(messages) > 15
    for message in messages:
        assert all(part.strip() in known for part in message.split("…")), message


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
