"""The site: `sphinx-build -W docs site`; with `-D nb_execution_mode=cache` the notebooks run."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import _generated

import graded_contact

project, author = "graded_contact", "graded_contact maintainers"
version = release = graded_contact.__version__
copyright = "the graded_contact maintainers"

extensions = [
    "myst_nb",
    "sphinx_copybutton",
    "sphinx_design",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline"]
myst_heading_anchors = 3
nb_execution_mode = "off"
nb_execution_timeout = 600
nitpicky = True
exclude_patterns = ["_*"]
# Pages that may not be there.
suppress_warnings = ["toc.empty_glob"]

html_theme = "pydata_sphinx_theme"
html_title = "graded_contact"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
}

_generated.write_all(Path(__file__).parent)
