"""The site: `sphinx-build -W docs site`; `-D nb_execution_mode=off` does not run the notebooks."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import _generated
from _checks import check_formula, dead_links
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.addnodes import desc_signature
from sphinx.application import Sphinx
from sphinx.errors import SphinxError

import graded_contact

project, author = "graded_contact", "graded_contact maintainers"
version = release = graded_contact.__version__
copyright = "the graded_contact maintainers"

extensions = [
    "sphinx.ext.viewcode",
    "myst_nb",
    "sphinx_copybutton",
    "sphinx_design",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 600
nb_merge_streams = True
nitpicky = True
nitpick_ignore_regex = [("py:class", ".*")]  # types of arguments
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
exclude_patterns = ["_*"]
# Pages that may not be there.
suppress_warnings = ["toc.empty_glob"]

html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme = "pydata_sphinx_theme"
html_title = "graded_contact"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "navbar_end": ["theme-switcher"],
    "navbar_persistent": ["search-button"],
    "navbar_align": "left",
    "header_links_before_dropdown": 10,
    "secondary_sidebar_items": {"**": ["page-toc"], "index": []},
}
html_sidebars = {"index": [], "explore": []}  # the only ones of their sections
smartquotes = False  # quotes in keys and commands can be copied
html_math_renderer = "mathml"


def setup(app: Sphinx) -> None:
    """Formulas become MathML: browsers typeset it without scripts."""
    app.add_html_math_renderer("mathml", (inline_formula, None), (block_formula, None))
    app.connect("source-read", link_names)
    app.connect("doctree-read", unbroken)
    app.connect("doctree-read", name_in_each_module)
    app.connect("build-finished", check_links)


def link_names(app: Sphinx, page: str, source: list[str]) -> None:
    """Names in the tables of the reference are links."""
    if page == "reference":
        source[0] = _generated.linked(source[0], _generated.all_places())


def unbroken(app: Sphinx, tree: nodes.document) -> None:
    """Lines do not break inside a number, nor between a number and its unit."""
    for cell in tree.findall(nodes.entry):
        if re.fullmatch(r"[-+\d.,e±% ]+", cell.astext()):
            cell["classes"].append("number")
    for text in list(tree.findall(nodes.Text)):
        if not isinstance(text.parent, nodes.literal | nodes.literal_block | nodes.math):
            unit = r"(?<=\d) (?=(?:%|°C|[kMGTnµm]?(?:m|s|Pa|K|J|Hz|rad|GiB|MB)\b))"
            text.parent.replace(text, nodes.Text(re.sub(unit, "\N{NO-BREAK SPACE}", text)))


def name_in_each_module(app: Sphinx, tree: nodes.document) -> None:
    """Each name of a page has an anchor in all modules of this page.

    Links of `viewcode` from a source to its names all have the module of the first of them.
    """
    names = list(tree.findall(desc_signature))
    modules = {name["module"] for name in names}
    for name in names:
        anchors = sorted(f"{module}.{name['fullname']}" for module in modules)
        name["ids"] += [anchor for anchor in anchors if anchor not in name["ids"]]


def check_links(app: Sphinx, error: Exception | None) -> None:
    """Ends the build with the links that lead nowhere."""
    if error is None and (dead := dead_links(Path(app.outdir))):
        raise SphinxError("These links lead nowhere:\n" + "\n".join(dead))


def formula(node, as_block: bool = False) -> str:
    """Returns the MathML of a formula, with bars of full length and spaces after functions."""
    check_formula(node.astext())
    text = tex2mathml(node.astext(), as_block=as_block)
    space = '<mspace width="0.17em"></mspace>'
    text = re.sub(r"<mo>&ApplyFunction;</mo>(?!\s*<mo)", space, text)
    return text.replace(">_</mo>", ' stretchy="true">‾</mo>')


def inline_formula(translator, node) -> None:
    translator.body.append(formula(node))
    raise nodes.SkipNode


def block_formula(translator, node) -> None:
    translator.body.append(f'<div class="formula">{formula(node, as_block=True)}</div>')
    raise nodes.SkipNode


_generated.write_all(Path(__file__).parent)
