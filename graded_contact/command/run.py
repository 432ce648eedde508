"""The jobs `run`, `demo` and `info`: scenes, their results, tables and figures."""

import contextlib
import tomllib
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import jax
import numpy as np
import typer

from .. import plot
from ..core.quantities import in_brackets
from ..scenes import Scene, parse_scene, read_results, read_scene, run_scene
from ..scenes.run import numbers_at, write_results
from ..studies.sweep import NOT_STARTED
from .tables import print_results

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Scene file.")]
Output = Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the results.")]
Full = Annotated[bool, typer.Option("--full", help="Show all numbers in the table.")]
Format = Annotated[
    Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the figures.")
]
VARIED = ("title", "load", "sweep", "output")  # tables that may change between runs of a scene


@contextlib.contextmanager
def refusing() -> Iterator[None]:
    """Prints the message of a refused input without a traceback; exits with code 2."""
    try:
        yield
    except (ValueError, OSError, ImportError, MemoryError) as error:
        typer.secho(f"Error: {error}", fg="red", err=True)
        raise typer.Exit(2) from error


def demo(output: Output = None, form: Format = "png") -> None:
    """Runs a built-in scene: tyre tread with a modified layer of 50 µm on a rough road."""
    text = resources.files("graded_contact.scenes").joinpath("demo.toml").read_text("utf-8")
    run_into(output or Path("graded-contact-demo"), "demo", parse_scene(text), form)


def run(
    scene_file: SceneFile,
    output: Output = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Number of worker processes.")] = None,
    full: Full = False,
    form: Format = "png",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check the scene and print it, then exit.")
    ] = False,
) -> None:
    """Runs a scene: prints a table, writes the results (HDF5, CSV) and figures.

    Each solve is stored when it ends: after an interruption the same command solves only the rest.
    """
    with refusing():
        scene = read_scene(scene_file)
        if dry_run:
            scene.case(scene.last)
            jax.eval_shape(lambda point: numbers_at(scene, point), scene.last)
            typer.echo(scene)
            return
    folder = output or Path(f"{scene_file.stem}-results")
    run_into(folder, scene_file.stem, scene, form, full, workers)


def info(
    result_file: Annotated[Path, typer.Argument(metavar="RESULT.h5", help="Result file.")],
    full: Full = False,
) -> None:
    """Prints a result file: the scene, the version that ran it, and the table of results."""
    with refusing():
        results = read_results(result_file)
    typer.echo(f"{results.attrs['scene']}\ngraded_contact {results.attrs['version']}\n")
    print_results(results, full)


def run_into(
    folder: Path, name: str, scene: Scene, form: str, full: bool = False, workers: int | None = None
) -> None:
    """Runs a scene, prints its table, and writes its results and figures to a folder."""
    file = folder / f"{name}.h5"
    with refusing():
        folder.mkdir(parents=True, exist_ok=True)
        check_same_scene(file, scene)
        typer.echo("\n".join(filter(None, (scene.title, *scene.surface_at(scene.last).history))))
        store = folder / f"{name}.points"
        results = run_scene(scene, store=store, workers=workers, progress=True)
        write_results(file, results)
        write_csv(file.with_suffix(".csv"), results)
    print_results(results, full)
    typer.echo(f"wrote {file}\nwrote {file.with_suffix('.csv')}")
    for key, figure in figures_of(scene, results):
        figure.savefig(path := folder / f"{name}-{key}.{form}")
        typer.echo(f"wrote {path}")
    if np.any(results["message"] == NOT_STARTED):
        typer.echo("Interrupted: run the same command again to continue.", err=True)
        raise typer.Exit(130)
    if np.any(results["message"] != ""):
        raise typer.Exit(1)


def check_same_scene(file: Path, scene: Scene) -> None:
    """Raises `ValueError` if a file has results of a scene that differs in more than its axes."""
    if not file.exists():
        return
    earlier, now = map(_fixed_tables, (read_results(file).attrs["scene"], scene.text))
    if earlier != now:
        differ = ", ".join(f"[{k}]" for k in {**earlier, **now} if earlier.get(k) != now.get(k))
        raise ValueError(f"{file} has results of a scene with another {differ}: give an --output.")


def _fixed_tables(text: str) -> dict[str, Any]:
    tables = tomllib.loads(text)
    tables["surface"].pop("seeds", None)  # an axis, too
    return {name: table for name, table in tables.items() if name not in VARIED}


def write_csv(path: Path, results: "Dataset") -> None:
    """Writes a row for each solve, or of a motion for each of its times."""
    table = results.drop_dims({"x", "y", "field_time"} & {*results.dims})
    heads = {
        str(n): f"{n}{in_brackets(v.attrs.get('units', ''))}" for n, v in table.variables.items()
    }
    table.to_dataframe().reset_index().rename(columns=heads).to_csv(path, index=False)


def figures_of(scene: Scene, results: "Dataset") -> "Iterator[tuple[str, Figure]]":
    """Yields each figure of results with the end of its name."""
    if not np.any(results["message"] == ""):
        return
    draw = {"steady": plot.plot_sweep, "cycle": plot.plot_cycle, "transient": plot.plot_transient}
    yield "sweep" if scene.kind == "steady" else scene.kind, draw[scene.kind](results)
    if "leakage_along_x" in results and "time" not in results.dims:
        names = ["leakage_along_x", "leakage_along_y"]
        yield "leakage", plot.plot_sweep(results, names, "pressure")
    if "reduced_velocity" in results and scene.kind == "steady":
        yield "master", plot.plot_sweep(results, along="reduced_velocity")
    last = results.isel(dict.fromkeys(scene.axes, -1))
    if "contact_pressure" not in results or last["message"] != "":
        return
    case = scene.case(scene.last)
    fields = last[["contact_pressure", "gap"]].drop_vars("pressure", errors="ignore")
    fields = fields.rename(contact_pressure="pressure")
    if scene.kind == "steady":
        found: Any = SimpleNamespace(pressure=fields.pressure, gap=fields.gap, law=case.law)
        yield "contact", plot.plot_sliding(found, case.surface, case.velocity)
    else:
        yield "film", plot.plot_film(fields, case.surface)
