"""The job `compare`: several results in one figure."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.files import check_folder
from ..plot import plot_compare
from ..readers import read_friction
from ..scenes.described import described
from ..scenes.results import older_meaning, read_results
from ..scenes.toml import parse_toml
from .terminal import FigureFormat, refusing, save_figure

if TYPE_CHECKING:
    from xarray import Dataset


def compare(
    result_files: Annotated[
        list[Path],
        typer.Argument(
            metavar="A.h5 B.h5 ...", help="Two or more results; one with --measured.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Figure file. Its extension overrides --format.")
    ] = Path("compare"),
    label: Annotated[list[str] | None, typer.Option(
        help="Name of a result in the legend; once for each result, in their order."
    )] = None,
    measured: Annotated[Path | None, typer.Option(
        metavar="TABLE", help="Measured friction to lay over the results: velocity, friction and, "
        "if known, error and temperature, with units in the headings.", show_default=False,
    )] = None,
    form: FigureFormat = "png",
) -> None:  # fmt: skip
    """Draws friction and contact area of several results in one figure, or beside a measurement.

    The results must vary the same axes. Without --label the legend has the titles of their scenes,
    or the blocks and surfaces, or the names of the files, whichever differ.
    """
    with refusing():
        if len(result_files) < 2 and measured is None:
            raise ValueError("`compare` needs two results or more, or one and `--measured`.")
        points = None if measured is None else read_friction(measured)
        results = [read_results(path) for path in result_files]
        if label and len(label) != len(results):
            raise ValueError(
                f"`--label` is given {len(label)} times for {len(results)} results: give it once "
                "for each."
            )
        for path, one in zip(result_files, results, strict=True):
            if older := older_meaning(one):
                typer.secho(f"Warning: {path} is {older}.", fg="yellow", err=True)
        titles = [str(one.attrs["title"]) for one in results]
        blocks = list(map(_block_and_surface, result_files, results))
        names = (label or titles, blocks, [str(path) for path in result_files])
        chosen = next((n for n in names if all(n) and len({*n}) == len(n)), names[0])
        figure = plot_compare(results, chosen, points)
        formats = figure.canvas.get_supported_filetypes()
        ending = output.suffix.removeprefix(".") or form
        if ending not in formats:
            raise ValueError(f"`--output {output}` is refused: figures are {', '.join(formats)}.")
        check_folder(output.parent)
        output.parent.mkdir(parents=True, exist_ok=True)
        save_figure(figure, output.with_suffix(f".{ending}"), ending)


def _block_and_surface(path: Path, results: "Dataset") -> str:
    """The layers, the base and the surface of the scene of results."""
    try:
        return described(parse_toml(results.attrs["scene"]))
    except Exception as error:  # of many kinds, as what lacks in the scene
        reason = f"{type(error).__name__}: {error}"
        raise ValueError(f"`path={path}` has no scene that is understood ({reason}).") from error
