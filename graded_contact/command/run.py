"""The jobs `demo`, `run` and `info`: scenes and their results."""

import itertools
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import jax.numpy as jnp
import numpy as np
import typer

from ..core.checks import nearest, within
from ..fields.grid import velocity_along
from ..plot import (
    plot_cycle,
    plot_dissipation,
    plot_distributions,
    plot_film,
    plot_outline,
    plot_reduced,
    plot_sensitivity,
    plot_sliding,
    plot_sweep,
)
from ..plot.style import entitle
from ..plot.sweeps import NOTHING
from ..plot.words import label_of, title_of
from ..readers.paths import check_folder, check_name, full_path
from ..scenes.cost import scene_cost
from ..scenes.results import (
    contact_at,
    has_numbers,
    kept_solves,
    lost_solves,
    over_seeds,
    read_results,
    surface_of,
    warnings_of,
)
from ..scenes.run_scene import build_surface, check_run, point_names, run_scene
from ..scenes.scene import Scene, parse_scene, read_scene
from ..scenes.schema import parse_toml
from ..scenes.theory import mean_field_at, what_decides
from ..sliding.magnification import cumulative_friction
from ..studies.dataset import NOT_STARTED, package_versions, write, write_csv
from ..studies.interruption import Interruption, interruptible
from ..studies.store import Store
from ..studies.uncertainty import Sensitivity
from ..studies.workers import check_workers
from ..surfaces.surface import Surface
from .result_tables import print_decisive, print_read, print_steps, print_table
from .terminal import (
    AllSeeds,
    DryRun,
    FigureFormat,
    Format,
    Output,
    Replace,
    Scheduler,
    Workers,
    progress,
    refusing,
    save_figure,
)
from .understood import print_understood

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

Decided = dict[tuple[str, float], Sensitivity]  # by the material's name and the velocity


def demo(
    output: Output = None,
    resolution: Annotated[
        int, typer.Option(min=256, help="Points along each edge; same surface.")
    ] = 256,
    replace: Replace = False,
    form: FigureFormat = Format.PNG,
) -> None:
    """Runs a built-in scene: tyre tread with a modified layer of 50 µm on a rough road."""
    text = resources.files("graded_contact.scenes").joinpath("demo.toml").read_text("utf-8")
    text = text.replace("shape = [256, 256]", f"shape = [{resolution}, {resolution}]")
    with refusing():
        scene = parse_scene(text)
    name = "demo" if resolution == 256 else f"demo-{resolution}"
    folder = output or Path("graded-contact-demo")
    run_scene_into(scene, folder, name, replace, form, {"workers": "auto"})


def run(
    scene_file: Annotated[
        Path, typer.Argument(metavar="SCENE.toml", help="Scene file.", show_default=False)
    ],
    output: Output = None,
    replace: Replace = False,
    dry_run: DryRun = False,
    all_seeds: AllSeeds = False,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="NAME=VALUE",
            help="Draw the contact at this value of an axis, for instance velocity=0.1 (SI units); "
            "may be repeated (default: the last value of each axis).",
        ),
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    form: FigureFormat = Format.PNG,
) -> None:
    """Runs a scene: prints a table, writes the results (HDF5, CSV) and figures.

    Each solve is stored when it ends: after an interruption the same command solves only the rest.
    All cores are used if that saves time.
    """
    with refusing():
        engine = {"workers": workers or (None if scheduler else "auto"), "client": scheduler}
        check_workers(**engine)
        scene = read_scene(scene_file)
        folder = output or scene.directory or Path(f"{scene_file.stem}-results")
        name = scene.name or scene_file.stem
        engine["kept"] = _chosen(scene, at or [])
        if dry_run:
            print_understood(scene)
            typer.echo(scene_cost(scene).report())
            surface, *_ = _prepared(scene, folder, name, replace)
            check_run(scene, surface)
            return
    run_scene_into(scene, folder, name, replace, form, engine, all_seeds)


def _chosen(scene: Scene, texts: list[str]) -> tuple[int, ...]:
    """The index of the point nearest to these values of axes; of other axes the last."""
    index = {name: len(values) - 1 for name, values in scene.axes.items()}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in index:
            raise ValueError(f"`--map {text}`: {name!r} is no axis; {nearest(name, index)}")
        with within(f"`--map {text}`:"):
            index[name] = int(np.argmin(np.abs(scene.axes[name] - float(value))))
    return tuple(index.values())


def info(
    result_file: Annotated[
        Path, typer.Argument(metavar="RESULT.h5", help="Result file.", show_default=False)
    ],
    all_seeds: AllSeeds = False,
) -> None:
    """Prints a result file: inputs, versions, and the table of results."""
    with refusing():
        results = read_results(result_file)
    for name, value in results.attrs.items():
        if (
            name not in ("scene", "caveats", "kept")
            and not name.startswith("surface_")
            and value != ""
        ):
            typer.echo(f"{name:22} {str(value).replace(chr(10), chr(10) + 23 * ' ')}")
    surface = surface_of(results)
    shape, size = surface.grid.shape, surface.grid.size
    typer.echo(f"{'grid':22} {' x '.join(map(str, shape))} points, size {size} m")
    for sentence in surface.history:
        typer.echo(f"{'surface':22} {sentence}")
    print_steps(surface)
    kept = ", ".join(map(str, kept_solves(results))) or "none"
    typer.echo(f"{'fields kept':22} {kept} ({', '.join(map(str, results['message'].dims))})")
    print_table(results, all_seeds)


def run_scene_into(
    scene: Scene,
    folder: Path,
    name: str,
    replace: bool,
    form: str,
    engine: dict[str, Any],
    all_seeds: bool = False,
) -> None:
    """Solves a scene, prints its table and writes its files; `run_scene` takes `engine`."""
    with refusing(), interruptible() as interruption:
        surface, names, file = _prepared(scene, folder, name, replace)
        folder = file.parent
        with Store(folder / f"{name}.points") as store:
            results = _solved(scene, surface, names, store, interruption, engine)
            written = _write(file, results, replace, all_seeds)
            print_table(results, all_seeds)
            whole = interruption.signal is None
            decided = what_decides(scene, surface) if whole else {}
            print_decisive(decided)
            if written:
                figures = [_figures(results, decided, all_seeds)]
                kept = kept_solves(results)
                figures += [_contacts(scene, results, index, len(kept), whole) for index in kept]
                for key, figure in itertools.chain(*figures):
                    save_figure(figure, file.with_name(f"{file.stem}-{key}.{form}"), form)
    if warnings := warnings_of(results):
        where = np.any([warning.where for warning in warnings], axis=0)
        typer.secho(
            f"Warning: {np.sum(where)} of {where.size} solves are doubtful; the reasons are below "
            "the table and in the file.",
            fg="yellow",
            err=True,
        )
    if interruption.signal is not None:
        typer.echo("Interrupted: the same command continues.", err=True)
        raise typer.Exit(interruption.exit_code)
    if np.any(results["message"] != ""):
        raise typer.Exit(1)


def _prepared(
    scene: Scene, folder: Path, name: str, replace: bool
) -> tuple[Surface, np.ndarray, Path]:
    """The surface, the names of the solves, and the file of their results; prints what was read."""
    check_name(name)
    folder = full_path(str(folder))
    check_folder(folder)
    surface = build_surface(scene)
    names, file = point_names(scene, surface), folder / f"{name}.h5"
    if not replace:
        _refuse_other(file, scene, names)
    print_read(scene, surface)
    if "design" in parse_toml(scene.text):
        typer.echo("[design] is not used by this command: see `graded-contact design`.")
    return surface, names, file


def _solved(
    scene: Scene,
    surface: Surface,
    names: np.ndarray,
    store: Store,
    interruption: Interruption,
    engine: dict[str, Any],
) -> "Dataset":
    """The results of a scene: solves that the store has, and those still to be computed."""
    found = sum(store.path(point).exists() for point in names.flat)
    if found:
        typer.echo(f"{found} of {names.size} solves are found in {store.folder}")
    try:
        interruption.check()
        with progress(interruption) as advance:
            results = run_scene(
                scene,
                surface=surface,
                store=store,
                progress=lambda *counts: advance("sliding", *counts),
                **engine,
            )
    except KeyboardInterrupt:
        typer.echo("Nothing was finished.", err=True)
        raise typer.Exit(interruption.exit_code) from None
    except OSError as error:
        raise OSError(
            f"{error} Run the same command again to continue from the stored solves."
        ) from error
    for path in store.damaged:
        typer.echo(f"{path} is damaged: it is computed again", err=True)
    return results


def _refuse_other(file: Path, scene: Scene, names: np.ndarray) -> None:
    """Refuses to replace a file that has solves which the scene does not have."""
    remedy = "Give another --output, or --replace to replace it."
    try:
        lost, earlier = lost_solves(file, names)
    except ValueError as error:
        raise ValueError(f"{error} {remedy}") from error
    if not lost:
        return
    texts = [
        [line for line in text.splitlines() if not line.startswith("title")]
        for text in (earlier["scene"], scene.text)
    ]
    lines = itertools.zip_longest(*texts, fillvalue="")
    versions = ((f"{k} = {earlier.get(k)}", f"{k} = {v}") for k, v in package_versions().items())
    inputs = [("another file of data", "the files named")]
    there, here = next((a, b) for a, b in (*lines, *versions, *inputs) if a.strip() != b.strip())
    raise ValueError(
        f"{file} contains {lost} solves of {earlier['title'] or 'another scene'!r} that "
        f"{scene.title or 'this scene'!r} does not have. File: `{there}`. Scene: `{here}`. "
        f"{remedy}"
    )


def _write(file: Path, results: "Dataset", replace: bool, all_seeds: bool) -> bool:
    """Writes results unless the file that exists holds more, and returns whether it did."""
    finished = results["point"].values[(results["message"] != NOT_STARTED).values]
    if not replace and (lost := lost_solves(file, finished)[0]):
        typer.echo(f"{file} holds {lost} solves that were not done again: it is not changed")
        return False
    write(file, results)
    means = "seed" in results["message"].dims and not all_seeds
    write_csv(file.with_suffix(".csv"), over_seeds(results) if means else results)
    for path in (file, file.with_suffix(".csv")):
        typer.echo(f"wrote {path}")
    return True


def _figures(
    results: "Dataset", decided: Decided, all_seeds: bool
) -> Iterator[tuple[str, "Figure"]]:
    """Yields each figure of all solves with the end of its name."""
    if not np.any(has_numbers(results)):
        typer.echo(NOTHING)
        return
    if "time" in results.dims:
        if not np.all(np.isnan(results["friction"])):
            yield "cycle", plot_cycle(results)
        return
    yield "sweep", plot_sweep(results, all_seeds=all_seeds)
    if "reduced_velocity" in results:
        yield "master", plot_reduced(results)
    elif "master_curve" in results.attrs:
        typer.echo(results.attrs["master_curve"])
    if decided:
        yield (
            "sensitivity",
            plot_sensitivity(
                {f"{name}, {speed:.3g} m/s": found for (name, speed), found in decided.items()}
            ),
        )


def _contacts(
    scene: Scene, results: "Dataset", index: tuple[int, ...], num_kept: int, whole: bool
) -> Iterator[tuple[str, "Figure"]]:
    """Yields each figure of a solve that was kept; only the maps if the run was interrupted."""
    fields, surface = contact_at(results, index)
    at = results["message"].isel(dict(zip(results["message"].dims, index, strict=True)))
    velocity = velocity_along(at["velocity"].item(), results.attrs["direction"])
    if scene.motion is not None:
        figures = {"film": plot_film(fields, surface)}
    else:
        figures = {"contact": plot_sliding(fields, surface, velocity)}
    if whole and scene.motion is None and surface.periodic:
        theory = mean_field_at(scene, surface, index)
        figures["outline"] = plot_outline(fields, surface)
        figures["distributions"] = plot_distributions(fields, theory)
        if at["velocity"] != 0:
            pressure, displacement = (jnp.asarray(fields[n]) for n in ("pressure", "displacement"))
            waves = cumulative_friction(pressure, displacement, surface.grid, velocity)
            curves = {"contact": waves, "mean field": theory.against_cutoff}
            figures["dissipation"] = plot_dissipation(curves)
    title = ", ".join(
        f"{title_of(str(name), scene.text)} {label_of(at[name])}" for name in at.coords
    )
    if scene.motion is not None:
        title = title.replace(title_of("velocity"), "highest speed")
    for key, figure in figures.items():
        entitle(figure, title)
        yield "-".join(map(str, (key, *(index if num_kept > 1 else ())))), figure
