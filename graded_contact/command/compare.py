"""The job `compare`: several results in one figure."""

from pathlib import Path
from typing import Annotated

import typer

from ..core.files import check_folder
from ..plot import plot_compare
from ..scenes.results import read_results
from .terminal import FigureFormat, refusing, save_figure


def compare(
    result_files: Annotated[
        list[Path],
        typer.Argument(metavar="A.h5 B.h5 ...", help="Two or more results.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Figure file. Its extension overrides --format.")
    ] = Path("compare"),
    form: FigureFormat = "png",
) -> None:
    """Draws friction and contact area of several results in one figure.

    The results must vary the same axes. The legend has the titles of their scenes, or the names of
    the files if titles are missing or equal.
    """
    with refusing():
        if len(result_files) < 2:
            raise ValueError("`compare` needs two results or more.")
        results = [read_results(path) for path in result_files]
        titles = [str(one.attrs["title"]) for one in results]
        if not all(titles) or len(set(titles)) < len(titles):
            titles = [str(path) for path in result_files]
        figure = plot_compare(results, titles)
        formats = figure.canvas.get_supported_filetypes()
        ending = output.suffix.removeprefix(".") or form
        if ending not in formats:
            raise ValueError(f"`--output {output}` is refused: figures are {', '.join(formats)}.")
        check_folder(output.parent)
        output.parent.mkdir(parents=True, exist_ok=True)
        save_figure(figure, output.with_suffix(f".{ending}"), ending)
