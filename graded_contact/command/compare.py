"""The job `compare`: several results in one figure."""

from pathlib import Path
from typing import Annotated

import typer

from ..files.paths import check_folder
from ..files.results import read_results
from ..plot import plot_compare
from .session import FigureFormat, Format, refusing, save_figure


def compare(
    result_files: Annotated[
        list[Path],
        typer.Argument(metavar="A.h5 B.h5 ...", help="Two results or more.", show_default=False),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="The figure; its ending, if any, goes before --format."
        ),
    ] = Path("compare"),
    form: FigureFormat = Format.PNG,
) -> None:
    """Draws friction and contact area of several results in one figure, bare beside coated say.

    They must vary the same axes. The legend has the titles of their scenes, or the names of the
    files where titles are missing or alike.
    """
    with refusing():
        if len(result_files) < 2:
            raise ValueError("`compare` takes two results or more.")
        results = [read_results(path) for path in result_files]
        titles = [str(one.attributes["title"]) for one in results]
        told = all(titles) and len(set(titles)) == len(titles)
        figure = plot_compare(results, titles if told else [str(path) for path in result_files])
        formats = figure.canvas.get_supported_filetypes()
        ending = output.suffix.removeprefix(".") or form
        if ending not in formats:
            raise ValueError(f"`--output {output}` is refused: figures are {', '.join(formats)}.")
        check_folder(output.parent)
        output.parent.mkdir(parents=True, exist_ok=True)
        save_figure(figure, output.with_suffix(f".{ending}"), ending)
