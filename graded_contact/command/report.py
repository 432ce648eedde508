"""The job `report`: a result file as one page that can be read and sent without the package."""

import base64
import contextlib
import html
import io
import itertools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.display import number
from ..core.escaping import in_html
from ..core.files import check_folder
from ..plot.style import caption
from ..scenes.results import (
    kept_solves,
    older_meaning,
    read_results,
    surface_of,
)
from ..studies.dataset import write_whole
from .result_tables import marked_warnings, print_notes, print_rows, print_steps
from .run import AllSeeds, Full, contacts, figures
from .terminal import refusing

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

SHEET = """body {font: 15px/1.45 system-ui, sans-serif; color: #2b2f36; max-width: 1000px;
  margin: 2em auto; padding: 0 1em; overflow-wrap: anywhere}
pre, table {display: block; max-width: 100%; overflow-x: auto}
pre {font-size: 12px; background: #f4f5f7; padding: .8em; border-radius: 4px}
figure {margin: 1.5em 0} img {max-width: 100%} figcaption {color: #5b616b}
td {padding: 0 1.5em .2em 0; vertical-align: top; white-space: pre-line} .doubt {color: #a33600}"""
# What results tell of how they were made; of programs the names are their own.
MADE = {
    "largest_error": "largest relative error of the pressure", "rtol": "tolerance of the pressure",
    "format": "format of the result file", "dtype": "kind of numbers", "inputs": "files it read",
    "moduli": "how moduli were read", "direction": "direction of sliding [rad]",
    "seed": "seed of the random surface",
}  # fmt: skip


def report(
    result_file: Annotated[
        Path, typer.Argument(metavar="RESULT.h5", help="Result file.", show_default=False)
    ],
    output: Annotated[Path | None, typer.Option(
        "--output", "-o", help="File of the report (default: RESULT.html).", show_default=False
    )] = None,
    all_seeds: AllSeeds = False,
    full: Full = False,
) -> None:  # fmt: skip
    """Writes a result file as one HTML page: table, doubts, figures, inputs and versions."""
    with refusing():
        results = read_results(result_file)
        target = output or result_file.with_suffix(".html")
        check_folder(target.parent)
        target.parent.mkdir(parents=True, exist_ok=True)
        page = _page(results, result_file.name, all_seeds, full)
        write_whole(target, page.encode())
    typer.echo(f"wrote {target}")


def _page(results: "Dataset", name: str, all_seeds: bool, full: bool) -> str:
    about, surface = results.attrs, surface_of(results)
    title = in_html(about["title"] or name)
    doubts = [f"({mark}) {caveat.sentence}" for mark, caveat in marked_warnings(results)]
    doubts += [f"This result is {older}." for older in [older_meaning(results)] if older]
    rows = "".join(
        f"<tr><td>{in_html(key)}</td><td>{in_html(value)}</td></tr>"
        for key, value in _made_by(about)
    )
    kept = kept_solves(results)
    drawn = itertools.chain(
        figures(results, {}, all_seeds), *(contacts(results, at, len(kept)) for at in kept)
    )
    parts = {
        "Results": _preformatted(lambda: print_rows(results, all_seeds, full))
        + _preformatted(lambda: print_notes(results, full)),
        "Doubts": "".join(f'<p class="doubt">{in_html(sentence)}</p>' for sentence in doubts),
        "Figures": "".join(_shown(figure) for _, figure in drawn),
        "Surface": _preformatted(lambda: print_steps(surface))
        + "".join(f"<p>{in_html(sentence)}</p>" for sentence in surface.history),
        "Scene": f"<pre>{html.escape(about['scene'])}</pre>",
        "Made by": f"<table>{rows}</table>",
    }
    body = "".join(f"<h2>{head}</h2>{part}" for head, part in parts.items() if part)
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{SHEET}</style></head><body><h1>{title}</h1>{body}</body></html>\n"
    )


def _made_by(about: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What the attributes of results tell of how they were made: a name and a text each."""
    hidden = ("scene", "caveats", "assumed", "kept", "title", "master_curve")
    counts = ("num_solves", "num_converged")
    for key, value in about.items():
        if value == "" or key in (*hidden, *counts) or key.startswith("surface_"):
            continue
        yield (
            MADE.get(key, key.replace("_", " ")),
            number(value, ".3g") if isinstance(value, float) else str(value),
        )
    if {*counts} <= {*about}:
        yield "solves", f"{about['num_converged']} of {about['num_solves']} converged"


def _preformatted(say: Callable[[], None]) -> str:
    """What a function prints, as HTML."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        say()
    text = printed.getvalue()
    return f"<pre>{html.escape(text)}</pre>" if text else ""


def _shown(figure: "Figure") -> str:
    """A figure with its caption; pictures are in the file."""
    content, text = io.BytesIO(), in_html(caption(figure))
    figure.savefig(content, format="png", dpi=130)
    picture = base64.b64encode(content.getvalue()).decode()
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{picture}">'
        f"<figcaption>{text}</figcaption></figure>"
    )
