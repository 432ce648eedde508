"""The site: `sphinx-build -W docs site`; with `-D nb_execution_mode=off` notebooks are not run."""

import csv
import importlib
import re
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from _keys import keys_page
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

import graded_contact

DOCS = Path(__file__).parent
ROOT = DOCS.parent
ROOMS = {
    "materials": "Materials", "blocks": "Blocks", "response": "Response", "kernels": "Kernels",
    "surfaces": "Surfaces", "contacts": "Contact", "sliding": "Sliding",
    "mean_field": "Mean field", "fitting": "Fits", "readers": "Measured files",
    "studies": "Many solves", "design": "Design", "scenes": "Scenes", "plot": "Figures",
    "page": "The page", "fields": "Grids", "core": "Parameters and programs",
}  # fmt: skip

project, author = "graded_contact", "graded_contact maintainers"
version = release = graded_contact.__version__
copyright = "the graded_contact maintainers"
extensions = [
    "sphinx.ext.autodoc", "sphinx.ext.viewcode", "myst_nb", "sphinx_copybutton", "sphinx_design",
]  # fmt: skip
myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_inline"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 600
nb_merge_streams = True
default_role = "code"  # docstrings write `names` as Markdown does
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types of arguments
autodoc_typehints = "none"
autodoc_member_order = "bysource"
exclude_patterns = ["_*"]
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme = "pydata_sphinx_theme"
html_title = "graded_contact"
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "navbar_center": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"**": ["globaltoc.html"]}  # all pages beside each page
html_show_sourcelink = False
html_math_renderer = "mathml"
smartquotes = False  # quotes in keys and commands can be copied


def write_reference() -> None:
    """Writes a page for each room, of the names in its `__all__`."""
    folder = DOCS / "reference"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for room, title in ROOMS.items():
        module = importlib.import_module(f"graded_contact.{room}")
        lines = [f"# {title}", "", "```{eval-rst}", f".. currentmodule:: {module.__name__}", ""]
        for name in module.__all__:
            made = getattr(module, name)
            if callable(made):
                kind = "autoclass" if isinstance(made, type) else "autofunction"
                lines.append(f".. {kind}:: {name}")
        (folder / f"{room}.md").write_text("\n".join([*lines, "```", ""]), "utf-8")


def without_bars(app, what, name, made, options, lines: list[str]) -> None:
    """Escapes |x| in docstrings, which would name a substitution."""
    for i, line in enumerate(lines):
        parts = line.split("`")
        parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
        lines[i] = "`".join(parts)


def write_rows() -> None:
    """Writes the stored rows of each benchmark as a table, and how they were measured."""
    folder = DOCS / "_measured"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in (ROOT / "benchmarks" / "results").glob("*.csv"):
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        columns = [name for name in rows[0] if name != "measured"]
        lines = [
            columns,
            ["---"] * len(columns),
            *([unbroken(row[name]) for name in columns] for row in rows),
        ]
        table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        command = path.stem.replace("-", ".py ", 1)
        runs = "; ".join(sorted({row["measured"] for row in rows}))
        note = f"`python benchmarks/{command}`, {runs}"
        (folder / f"{path.stem}.md").write_text(f"{table}\n\n{note}\n", "utf-8")


def unbroken(cell: str) -> str:
    """Returns a number with a hyphen at which no line ends."""
    return re.sub(r"(?<=\de)-", "\N{NON-BREAKING HYPHEN}", cell)


def copy_notebooks() -> None:
    """Copies the notebooks into the sources of the site."""
    shutil.rmtree(DOCS / "notebooks", ignore_errors=True)
    shutil.copytree(ROOT / "notebooks", DOCS / "notebooks")


def setup(app: Sphinx) -> None:
    """Formulas become MathML: browsers typeset it without scripts."""
    app.add_html_math_renderer("mathml", (inline_formula, None), (block_formula, None))
    app.connect("autodoc-process-docstring", without_bars)
    (DOCS / "scene_keys.md").write_text(keys_page(), "utf-8")
    write_reference()
    write_rows()
    copy_notebooks()


def inline_formula(translator, node) -> None:
    translator.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def block_formula(translator, node) -> None:
    formula = tex2mathml(node.astext(), as_block=True)
    translator.body.append(f'<div class="formula">{formula}</div>')
    raise nodes.SkipNode
