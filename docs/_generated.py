"""Pages that are made, not written: reference, commands, rows of benchmarks, notebooks.

`python docs/_generated.py` writes the table of a scene's keys alone, which the repository keeps.
"""

import csv
import importlib
import inspect
import pprint
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from _examples import EXAMPLES
from _figures import FIGURES
from jaxtyping import ScalarLike
from numpy.typing import ArrayLike
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact.blocks.profile import Blend
from graded_contact.blocks.stack import Layer
from graded_contact.command.app import app
from graded_contact.contacts.solver.nested_solve import DouglasRachford
from graded_contact.core.checks import Numbers
from graded_contact.fields.grid import Grid
from graded_contact.scenes import kinds, scene
from graded_contact.sliding.case import Heating
from graded_contact.sliding.numbers.gap_flow import Fluid

ROOT = Path(__file__).parents[1]
KEYS_FILE = ROOT / "docs" / "scene_keys.md"
TITLES = {
    "materials": "Materials", "blocks": "Blocks", "response": "Response of blocks",
    "kernels": "Kernels", "surfaces": "Surfaces",
    "contacts": "Contact", "sliding": "Sliding", "mean_field": "Mean field", "fitting": "Fits",
    "readers": "Measured files", "studies": "Many solves", "design": "Design", "scenes": "Scenes",
    "plot": "Figures", "page": "The page",
    "fields": "The cell", "core": "Parameters and programs",
    "blocks.shapes": "Shapes of graded layers",
}  # fmt: skip

# What takes the keys of each table of a scene.
TABLES: dict[str, Callable] = {
    "[grid]": Grid,
    **{f'[surface], kind = "{kind}"': make for kind, make in kinds.SURFACES.items()},
    **{f'[materials.NAME], kind = "{kind}"': make for kind, make in kinds.MATERIALS.items()},
    "[[layers]]": Layer,
    "[[layers]] with `top` and `bottom`": Blend,
    **{f'[base], kind = "{kind}"': make for kind, make in kinds.BASES.items()},
    **{f'[motion], kind = "{kind}"': make for kind, make in kinds.CYCLES.items()},
    **{f'[[motion]], kind = "{kind}"': make for kind, make in kinds.TRANSIENTS.items()},
    **{f'[law], kind = "{kind}"': make for kind, make in kinds.CONTACT_LAWS.items()},
    **{f'[shear], kind = "{kind}"': make for kind, make in kinds.SHEAR_LAWS.items()},
    **{
        f'{key}, kind = "{kind}"': make
        for key, nested in kinds.NESTED.items()
        for kind, make in nested.items()
    },
    "[heating]": Heating,
    "[fluid]": Fluid,
    "[observe]": scene.Observe,
    "[solver] (and `rtol`)": DouglasRachford,
    "[output]": scene.Output,
}
LONG = 30  # rows that are shown only when asked for


def write_all(docs: Path) -> None:
    """Writes into the folders `reference`, `_measured` and `tutorials` of `docs`."""
    for name in ("reference", "_measured", "tutorials"):
        shutil.rmtree(docs / name, ignore_errors=True)
        (docs / name).mkdir()
    for name, text in (reference_pages() | {"commands": commands_page()}).items():
        (docs / "reference" / f"{name}.md").write_text(text, encoding="utf-8")
    KEYS_FILE.write_text(keys_page(), encoding="utf-8")
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


def run_program(page: Path) -> dict[str, Any]:
    """Returns all that the Python program of a page defines."""
    found: dict[str, Any] = {"__name__": page.stem}
    text = page.read_text(encoding="utf-8")
    exec("\n".join(re.findall(r"(?ms)^```python\n(.*?)^```", text)), found)
    return found


def reference_pages() -> dict[str, str]:
    """Returns a page for each room of `TITLES`."""
    places = all_places()
    pages = {}
    for room, title in TITLES.items():
        about = importlib.import_module(f"graded_contact.{room}").__doc__
        parts = [f"# {title}: `gc.{room}`", linked(inspect.cleandoc(about or ""), places)]
        parts += [description(places[name], thing, places) for name, thing in members_of(room)]
        pages[room.rpartition(".")[2]] = "\n\n".join(parts)
    return pages


def all_places() -> dict[str, str]:
    """Returns where each public name is described: where a script finds it at the shortest."""
    return {
        name: f"graded_contact.{name}" if name in gc.__all__ else f"graded_contact.{room}.{name}"
        for room in TITLES
        for name, _ in members_of(room)
    }


def members_of(room: str) -> list[tuple[str, object]]:
    """Returns what a room offers: what it lists, or its own public functions and classes."""
    found = importlib.import_module(f"graded_contact.{room}")
    own = [
        name
        for name, thing in vars(found).items()
        if getattr(thing, "__module__", None) == found.__name__ and not name.startswith("_")
    ]
    names = [name for name in getattr(found, "__all__", own) if name != "shapes"]
    return [(name, getattr(found, name)) for name in names]


def description(place: str, thing: object, places: dict[str, str]) -> str:
    """Returns a class or function from its docstring, with the methods and properties it has."""
    if not callable(thing):
        return f":::{{py:data}} {place}\n```python\n{pprint.pformat(thing)}\n```\n:::"
    kind = "class" if inspect.isclass(thing) else "function"
    module, _, name = place.rpartition(".")
    head = f"::::{{py:{kind}}} {name}{signature(thing)}\n:module: {module}\n"
    parts = [head, documented(thing, places)]
    if name in EXAMPLES:
        parts += [f"**Example:**\n\n```python\n{EXAMPLES[name].strip()}\n```"]
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
    """Returns the arguments with their types and defaults."""
    try:
        entries = list(inspect.signature(thing).parameters.values())
    except (TypeError, ValueError):
        return "()"
    written = [argument(entry) for entry in entries if entry.name != "self"]
    named = [entry.name for entry in entries if entry.kind is entry.KEYWORD_ONLY]
    if named and not any(entry.kind is entry.VAR_POSITIONAL for entry in entries):
        written.insert(len(written) - len(named), "*")
    return f"({', '.join(written)})"


def argument(entry: inspect.Parameter) -> str:
    """Returns one argument; a default that is an object is shown as a call of its class."""
    default = entry.default
    plain = default is entry.empty or isinstance(default, int | float | str | tuple | None)
    text = str(entry.replace(annotation=entry.empty, default=entry.empty))
    kind = entry.annotation
    if kind is not entry.empty:
        text += ": " + short_type(kind)
    if default is entry.empty:
        return text
    equals = "=" if kind is entry.empty else " = "
    shown = repr(default) if plain else f"{type(default).__name__}()"
    return text + equals + re.sub(r"<[^>]*>", "...", shown)


def short_type(annotation: object) -> str:
    """Returns an annotation without the modules of its names, and with the names of unions."""
    text = bare_type(annotation)
    for name, union in (("Numbers", Numbers), ("Scalar", ScalarLike), ("Numbers", ArrayLike)):
        members = bare_type(union).removesuffix("]")
        text = text.replace(members + ", NoneType]", name + " | None")
        text = text.replace(members + "]", name)
    return re.sub(r"Union\[Key\[.*?\'4\'\]\]", "Key", text)


def bare_type(annotation: object) -> str:
    text = annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
    text = re.sub(r"(?:jaxtyping\.)?\w+\[(?:\w+\.)*Array, '[^']*'\]", "Array", text)
    return re.sub(r"\b(?:[a-zA-Z_]\w*\.)+(?=\w)", "", text.replace("~", ""))


def linked(text: str, places: dict[str, str]) -> str:
    """Returns a text in which names of the reference, and calls of them, are links."""

    def link(found):
        name, rest = found.groups()
        name = name.removeprefix("graded_contact.").removeprefix("gc.")
        last = name.rpartition(".")[2]
        place = places.get(name) or places.get(last)
        if place is None or not place.endswith(f".{name}"):
            return found[0]
        return f"{{py:obj}}`{name}{rest} <{place}>`"

    return re.sub(r"(?<![`}])`([\w.]+)((?:\([^`<>]*\))?)`(?!`)", link, text)


def commands_page() -> str:
    """Returns what the commands say of themselves."""
    runner = CliRunner(env={"COLUMNS": "80", "TERM": "dumb", "NO_COLOR": "1"})
    names = [command.callback.__name__ for command in app.registered_commands if command.callback]
    parts = ["# The command `graded-contact`"]
    for name in ("", *names):
        said = runner.invoke(
            app, [*filter(None, [name]), "--help"], prog_name="graded-contact"
        ).output
        lines = "\n".join(line.rstrip() for line in said.strip().splitlines())
        parts += [f"## `graded-contact {name}`" if name else "", f"```text\n{lines}\n```"]
    return "\n\n".join(parts)


def keys_page() -> str:
    """Returns the keys of scenes, table by table: the parameters of what a table makes."""
    about = inspect.cleandoc(scene.__doc__ or "").partition("\n\n")[2]
    made = (
        "`python docs/_generated.py` makes this page from the code. [Describe your own scene]"
        '(howto/own_scene.md) explains scenes by examples. For None write "none", or leave out a '
        "key without a default."
    )
    parts = ["# The keys of a scene", about, made]
    for title, make in TABLES.items():
        given = [
            each for each in inspect.signature(make).parameters.values() if each.name != "grid"
        ]
        rows = [[f"`{each.name}`", meaning_of(each.name, make), default_of(each)] for each in given]
        if rows:
            head = [["key", "meaning", "default"], 3 * ["---"]]
            lines = ["| " + " | ".join(row) + " |" for row in head + rows]
            heading = re.sub(r'kind = "\w+"', r"`\g<0>`", title)
            parts += [f"## {heading}", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def meaning_of(name: str, make: Any) -> str:
    """Returns what the docstring of a function or class says of an argument."""
    pattern = r"^ *- (`[^:]*`[^:]*): (.*?)(?=^ *- `|^ *$|\Z)"
    text = make.__doc__ or ""
    for other in re.findall(r"`(read_moduli|read_surface|SelfAffine|random_surface)`", text):
        text += "\n\n" + (getattr(gc, other).__doc__ or "")
    entries = re.findall(pattern, text, re.MULTILINE | re.DOTALL)
    found = [" ".join(words.split()) for names, words in entries if f"`{name}`" in names]
    return found[0].removesuffix(" Static.").replace("|", "\\|") if found else ""


def default_of(parameter: inspect.Parameter) -> str:
    """Returns the value of a key that is missing."""
    if parameter.default is parameter.empty:
        return "required"
    value = parameter.default
    return f"{value}" if isinstance(value, bool | int | float | str) else ""


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


if __name__ == "__main__":
    KEYS_FILE.write_text(keys_page(), encoding="utf-8")
