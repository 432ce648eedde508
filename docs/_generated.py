"""Pages that are made, not written: reference, commands, rows of benchmarks, notebooks."""

import csv
import importlib
import inspect
import pprint
import re
import shutil
from pathlib import Path

from _figures import FIGURES
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact.cli import app

ROOT = Path(__file__).parents[1]
# Namespaces of the package, with pages of their own.
MODULES = (
    "materials", "blocks", "contacts", "shapes", "surface", "design", "plot", "reference",
)  # fmt: skip
TITLES = {
    "rheology": "Materials", "response": "Blocks and their response", "surfaces": "Surfaces",
    "contact and sliding": "Contact and sliding", "mean field": "Mean field",
    "fitting": "Data and fits", "studies": "Many solves and design",
}  # fmt: skip

LONG = 30  # rows that are shown only when asked for

Names = dict[str, list[tuple[str, object]]]  # of modules or groups


def write_all(docs: Path) -> None:
    """Writes into the folders `reference`, `_measured` and `tutorials` of `docs`."""
    for name in ("reference", "_measured", "tutorials"):
        shutil.rmtree(docs / name, ignore_errors=True)
        (docs / name).mkdir()
    for name, text in (reference_pages() | {"commands": commands_page()}).items():
        (docs / "reference" / f"{name}.md").write_text(text, encoding="utf-8")
    shown = "".join(page.read_text(encoding="utf-8") for page in docs.glob("*.md"))
    for name in set(re.findall(r"_measured/(\S+)\.md", shown)):
        rows = rows_page(ROOT / "benchmarks" / "results" / f"{name}.csv")
        (docs / "_measured" / f"{name}.md").write_text(rows, encoding="utf-8")
    for name, draw in FIGURES.items():
        draw(last_run(ROOT / "benchmarks" / "results" / f"{name}.csv")).savefig(
            docs / "_measured" / f"{name}.svg"
        )
    for notebook in sorted((ROOT / "notebooks").glob("*.ipynb")):
        shutil.copy(notebook, docs / "tutorials")


def reference_pages() -> dict[str, str]:
    """Returns a page for each group of `graded_contact.__all__`, and for each of `MODULES`."""
    groups, modules = public_groups(), {name: members_of(name) for name in MODULES}
    # A name that two have is described in the group.
    places = {
        name: f"graded_contact.{module}.{name}"
        for module, members in modules.items()
        for name, _ in members
    }
    places |= {name: f"graded_contact.{name}" for group in groups.values() for name, _ in group}
    pages = {}
    for title, members in groups.items():
        parts = [description(places[name], thing, places) for name, thing in members]
        pages[title.replace(" ", "_")] = "\n\n".join([f"# {TITLES[title]}", *parts])
    for module, members in modules.items():
        about = importlib.import_module(f"graded_contact.{module}").__doc__
        parts = [f"# `graded_contact.{module}`", linked(inspect.cleandoc(about or ""), places)]
        for name, thing in members:
            at = places[name]
            own = at == f"graded_contact.{module}.{name}"
            parts.append(description(at, thing, places) if own else f"- {{py:obj}}`{at}`")
        pages[module] = "\n\n".join(parts)
    return pages


def public_groups() -> Names:
    """Returns the public names by the comments that part them in `__all__`."""
    listed = inspect.getsource(gc).partition("__all__ = [")[2].partition("]")[0]
    groups = {}
    for title, names in re.findall(r"# ([\w ]+)\n((?: +\".*\n)+)", listed):
        found = [name for name in re.findall(r'"(\w+)"', names) if name not in MODULES]
        if found:
            groups[title] = [(name, getattr(gc, name)) for name in found]
    return groups


def members_of(module: str) -> list[tuple[str, object]]:
    """Returns what a namespace offers: what it lists, or its own public functions and classes."""
    found = importlib.import_module(f"graded_contact.{module}")
    own = [
        name
        for name, thing in vars(found).items()
        if getattr(thing, "__module__", None) == found.__name__ and not name.startswith("_")
    ]
    return [(name, getattr(found, name)) for name in getattr(found, "__all__", own)]


def description(place: str, thing: object, places: dict[str, str]) -> str:
    """Returns a class or function from its docstring, with the methods and properties it has."""
    if not callable(thing):
        return f":::{{py:data}} {place}\n```python\n{pprint.pformat(thing)}\n```\n:::"
    kind = "class" if inspect.isclass(thing) else "function"
    parts = [f"::::{{py:{kind}}} {place}{signature(thing)}", documented(thing, places)]
    for name, found in vars(thing).items() if kind == "class" else ():
        function = found.fget if isinstance(found, property) else getattr(found, "__func__", found)
        if name.startswith("_") or not inspect.isfunction(function) or not function.__doc__:
            continue
        if isinstance(found, property):
            head = f":::{{py:property}} {name}"
        else:
            head = f":::{{py:method}} {name}{signature(getattr(thing, name))}"
        parts += [f"{head}\n{documented(function, places)}\n:::"]
    return "\n\n".join([*parts, "::::"])


def documented(thing: object, places: dict[str, str]) -> str:
    """Returns the docstring of an object; a public one without is an error."""
    text = vars(thing).get("__doc__") if inspect.isclass(thing) else thing.__doc__
    assert text, f"{thing} has no docstring"
    return linked(inspect.cleandoc(text), places)


def signature(thing) -> str:
    """Returns the arguments with their defaults; what they may be is in the docstring."""
    try:
        entries = inspect.signature(thing).parameters.values()
    except (TypeError, ValueError):
        return "()"
    bare = [entry.replace(annotation=entry.empty) for entry in entries if entry.name != "self"]
    # Objects show themselves over several lines, and functions by their address.
    written = [
        str(entry.replace(default=entry.empty)) + f"={type(entry.default).__name__}()"
        if not isinstance(entry.default, int | float | str | tuple | None | type(entry.empty))
        else str(entry)
        for entry in bare
    ]
    return re.sub(r"<[^>]*>", "...", f"({', '.join(written)})")


def linked(text: str, places: dict[str, str]) -> str:
    """Returns a docstring in which names of the reference are links."""

    def link(found):
        name = found[1].removeprefix("graded_contact.").removeprefix("gc.")
        return f"{{py:obj}}`{name} <{places[name]}>`" if name in places else found[0]

    return re.sub(r"(?<![`}])`([\w.]+)`(?!`)", link, text)


def commands_page() -> str:
    """Returns what the commands say of themselves."""
    runner = CliRunner(env={"COLUMNS": "90", "TERM": "dumb", "NO_COLOR": "1"})
    names = [command.callback.__name__ for command in app.registered_commands if command.callback]
    parts = ["# The command `graded-contact`"]
    for name in ("", *names):
        said = runner.invoke(app, [*filter(None, [name]), "--help"]).output
        lines = "\n".join(line.rstrip() for line in said.strip().splitlines())
        parts += [f"## `graded-contact {name}`" if name else "", f"```text\n{lines}\n```"]
    return "\n\n".join(parts)


def last_run(path: Path) -> list[dict[str, str]]:
    """Returns the rows of a benchmark's last run; none without a file."""
    if not path.exists():
        return []
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return [row for row in rows if row["measured"] == rows[-1]["measured"]]


def rows_page(path: Path) -> str:
    """Returns the rows of a benchmark's last run, and where it ran."""
    script, _, section = path.stem.partition("-")
    command = f"python benchmarks/{script}.py {section.replace('--', ' --')}".strip()
    rows = last_run(path)
    if not rows:
        return f"Not measured yet: `{command}`.\n"
    head = list(rows[0])[:-1]
    table = [head, ["---"] * len(head), *([row[name] for name in head] for row in rows)]
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in table]
    if len(rows) > LONG:
        lines = [f":::{{dropdown}} {len(rows)} rows", *lines, ":::"]
    return "\n".join([f"`{command}`, {rows[0]['measured']}:", "", *lines, ""])
