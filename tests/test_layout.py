"""Data flows one way: each file imports only from files before it in this list (DESIGN.md §2)."""

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "graded_contact"
ORDER = [
    "_checks", "_shown", "_derivative", "_devices", "_fft", "_memory", "caveats", "parameters",
    "grid", "spectrum", "cutoff", "surface", "random_surfaces",
    "rheology/shift", "rheology/measured", "rheology/creep", "rheology/material",
    "rheology/tabulated", "rheology/tabulated_shift", "rheology/library",
    "response/shape", "response/profile", "response/profile_check", "response/stack",
    "response/hyperbolic", "response/slab", "response/recursion",
    "response/column", "response/grading", "response/mesh", "response/layering",
    "response/rates", "response/riccati", "response/compliance", "response/table",
    "response/kernel", "response/matrix", "response/depth", "response/interior",
    "contact/law", "contact/adhesion", "contact/anderson", "contact/solver",
    "contact/splitting", "contact/held_points", "contact/linear", "contact/newton_steps",
    "contact/on_grid", "contact/epochs",
    "contact/douglas_rachford", "contact/rmd",
    "contact/implicit", "contact/estimates", "contact/solution", "contact/newton", "contact/wanted",
    "contact/problem", "contact/path",
    "contact/observables", "contact/area", "contact/friction_and_area", "sliding", "magnification",
    "persson/diffusion", "persson/modes", "persson/isotropic", "persson/mean_field",
    "files/given", "files/moduli/cells", "files/topography/scan", "files/topography/text",
    "files/topography/road",
    "files/topography/library", "files/topography/holes", "files/topography/preparation",
    "files/topography/reading",
    "files/moduli/quantities", "files/moduli/tables",
    "files/moduli/titles", "files/moduli/layout", "files/moduli/isotherms", "files/moduli/measured",
    "files/moduli/points", "files/moduli/steps", "files/moduli/reading",
    "files/toml_text", "files/prony_cards", "files/sealed", "files/hdf5", "files/output",
    "files/toml", "files/errors",
    "files/signatures", "files/study", "files/results", "files/surfaces", "files/block",
    "files/scene", "files/design_scene",
    "fitting/newton", "fitting/series", "fitting/observations", "fitting/model",
    "fitting/lengths", "fitting/optimum", "fitting/uncertainty",
    "fitting/quality", "fitting/result", "fitting/prony",
    "fitting/shifted_series", "fitting/shifted_observations", "fitting/isotherms",
    "fitting/shifting", "fitting/master_report", "fitting/master", "fitting/wild",
    "studies/interruption", "studies/store", "studies/checkpoint",
    "studies/program", "studies/chunk", "studies/cluster", "studies/engine", "studies/sweep",
    "studies/objectives", "studies/evaluations",
    "studies/bounds", "studies/problem", "studies/design", "studies/alternatives",
    "studies/stochastic",
    "studies/uncertainty", "studies/extrapolation", "studies/scene_theory", "studies/scene_errors",
    "studies/run",
    "studies/design_problem", "studies/run_design", "studies/report_design", "studies/cost",
    "shapes", "design", "reference",
    "plot/style", "plot/contact", "plot/patches", "plot/distributions", "plot/wavenumbers",
    "plot/materials", "plot/isotherms", "plot/designs", "plot/sensitivities", "plot/lines",
    "plot/sweeps", "plot/slider",
    "page/document", "page/knobs", "page/model", "page/shown", "page/latest", "page/figures",
    "page/section", "page/sliders", "page/tools", "page/view", "page/page", "page/serving",
    "command/session", "command/tables", "command/scene", "command/compare", "command/fit",
    "command/design", "command/explore",
    "cli", "__main__",
]  # fmt: skip
# What a file or folder must not see although it comes before: contact gets a kernel, not layers.
HIDDEN = {
    "contact": ("rheology", "response"),
    "studies/design": ("contact",),
    "studies/stochastic": ("contact",),
}
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.name != "__init__.py"]


def imports(source: str, place: str) -> set[str]:
    """Modules of ORDER imported by a file at `place`; a folder stands for its last module."""
    names, here = set(), ["graded_contact", *place.split("/")]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = [
                *here[: len(here) - node.level if node.level else 0],
                *filter(None, [node.module]),
            ]
            names |= {".".join([*base, alias.name]) for alias in node.names}
    found = set()
    for first, *parts in (name.split(".") for name in names):
        while first == "graded_contact":
            path = "/".join(parts)
            known = ORDER if path else ORDER[: ORDER.index("command/session")]
            inside = [m for m in known if m == path or m.startswith(f"{path}/" if path else "")]
            if inside:
                found.add(inside[-1])
                break
            parts.pop()  # a name inside a module, or of the folder's `__init__`
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_follow_the_table(path):
    place = path.relative_to(PACKAGE).with_suffix("").as_posix()
    assert place in ORDER, f"{place} is not in the table of files: give it its place there"
    for module in imports(path.read_text(), place):
        assert module != "reference", f"{place} imports the closed forms"
        assert ORDER.index(module) < ORDER.index(place), f"{place} imports {module}"
        for owner, hidden in HIDDEN.items():
            seen = place.startswith(owner) and module.startswith(hidden)
            assert not seen, f"{place} imports {module}"


def test_the_drawing_of_the_rooms_is_in_step():
    """A room on a higher floor has no file that comes before one of a lower floor."""
    text = PACKAGE.with_name("CONTRIBUTING.md").read_text(encoding="utf-8")
    floors = re.findall(r"^ ?\d+  (\S+(?: \S+)*)", text, flags=re.MULTILINE)
    drawn = [room.rstrip("/") for floor in reversed(floors) for room in floor.split()]
    assert len(drawn) == len(set(drawn))
    assert set(drawn) == {place.partition("/")[0] for place in ORDER} - {"__main__"}
    level = {room.rstrip("/"): -i for i, floor in enumerate(floors) for room in floor.split()}
    levels = [level[place.partition("/")[0]] for place in ORDER if place != "__main__"]
    assert levels == sorted(levels)


def test_the_table_names_files_that_exist():
    places = {path.relative_to(PACKAGE).with_suffix("").as_posix() for path in FILES}
    assert set(ORDER) == places


@pytest.mark.parametrize(
    "place, source, expected",
    [
        ("rheology/library", "from .material import WLF, Prony", "rheology/material"),
        ("rheology/material", "from .._checks import as_float", "_checks"),
        ("contact/law", "from .. import grid", "grid"),
        ("sliding", "from .rheology import Prony", "rheology/library"),
        ("sliding", "def f():\n  import graded_contact.contact.law as law", "contact/law"),
        ("grid", "from . import Prony", "page/serving"),
        ("grid", "from graded_contact import surface", "surface"),
    ],
)
def test_imports_are_seen_however_they_are_written(place, source, expected):
    assert imports(source, place) == {expected}


def test_imports_of_other_packages_are_ignored():
    assert imports("import numpy.linalg\nfrom collections.abc import Callable", "grid") == set()
