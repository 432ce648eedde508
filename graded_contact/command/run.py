"""The jobs `demo`, `run` and `info`: scenes and their results."""

import itertools
from collections.abc import Iterator, Mapping
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import jax.numpy as jnp
import numpy as np
import typer

from .. import plot
from ..core.checks import nearest, within
from ..core.quantities import TRANSIENT
from ..fields.frequency import velocity_along
from ..plot.style import entitle
from ..plot.sweeps import place_of
from ..scenes.plan import Plan, plan
from ..scenes.results import (
    has_numbers,
    kept_contact,
    kept_solves,
    kind_of_results,
    lost_solves,
    older_meaning,
    over_seeds,
    read_results,
    surface_of,
    without_friction,
)
from ..scenes.scene import ONE_OR_AXIS, Scene
from ..scenes.scene_file import parse_scene, read_scene
from ..scenes.theory import mean_field_at, what_decides
from ..scenes.toml import parse_toml
from ..sliding.solve.magnification import cumulative_friction
from ..studies.dataset import NOT_STARTED, package_versions, write, write_csv
from ..studies.interruption import Interruption, interruptible
from ..studies.journal import part_of
from ..studies.store import Store
from ..studies.workers import check_workers
from . import terminal
from .result_tables import (
    print_decisive,
    print_doubts,
    print_read,
    print_steps,
    print_table,
    print_warnings,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

LINEAR_AXES = (*ONE_OR_AXIS, "seed")  # of which differences count, not ratios

AllSeeds = Annotated[bool, typer.Option(
    "--all-seeds", help="Show every random surface, not their mean ± standard error."
)]  # fmt: skip
Full = Annotated[bool, typer.Option("--full", help="Show all numbers in the table.")]


def demo(
    output: terminal.Output = None,
    resolution: Annotated[
        int, typer.Option(min=256, help="Points along each edge; same surface.")
    ] = 256,
    replace: terminal.Replace = False,
    form: terminal.FigureFormat = "png",
) -> None:
    """Runs a built-in scene: tyre tread with a modified layer of 50 µm on a rough road."""
    text = resources.files("graded_contact.scenes").joinpath("demo.toml").read_text("utf-8")
    text = text.replace("shape = [256, 256]", f"shape = [{resolution}, {resolution}]")
    with terminal.refusing():  # a resolution may be too large for the memory
        scene = parse_scene(text)
    name = "demo" if resolution == 256 else f"demo-{resolution}"
    folder = output or Path("graded-contact-demo")
    run_scene_into(scene, folder, name, replace, form, {"workers": "auto"})


def run(
    scene_file: terminal.SceneFile,
    output: terminal.Output = None,
    replace: terminal.Replace = False,
    dry_run: terminal.DryRun = False,
    all_seeds: AllSeeds = False,
    full: Full = False,
    at: Annotated[list[str] | None, typer.Option(
        "--map", metavar="NAME=VALUE",
        help="Draw the contact at this value of an axis, for instance velocity=0.1 (SI units); "
        "may be repeated (default: the last value of each axis).",
    )] = None,
    workers: Annotated[int | None, typer.Option(
        min=1, help="Number of worker processes (default: automatic)."
    )] = None,
    scheduler: Annotated[str | None, typer.Option(
        metavar="tcp://...", help="Use the workers of a running dask scheduler."
    )] = None,
    form: terminal.FigureFormat = "png",
) -> None:  # fmt: skip
    """Runs a scene: prints a table, writes the results (HDF5, CSV) and figures.

    Each solve is stored when it ends: after an interruption the same command solves only the rest.
    All cores are used if that saves time.
    """
    with terminal.refusing():
        # Checked first: a scene may take long to read.
        engine = {"workers": workers or (None if scheduler else "auto"), "client": scheduler}
        check_workers(**engine)
        scene = read_scene(scene_file)
        place = terminal.output_of(scene, scene_file, output)
        # The point nearest to these values; on other axes the last.
        index = {name: len(values) - 1 for name, values in scene.axes.items()}
        for text in at or []:
            index |= [_on_axis(text, scene.axes)]
        engine["kept"] = tuple(index.values())
        if dry_run:
            typer.echo(scene)
            planned, file = _prepared(scene, *place, replace)
            typer.echo(planned)
            _say_stored(planned, Store(_points_of(file)))
            return
    run_scene_into(scene, *place, replace, form, engine, all_seeds, full)


def info(
    result_file: Annotated[
        Path, typer.Argument(metavar="RESULT.h5", help="Result file.", show_default=False)
    ],
    all_seeds: AllSeeds = False,
    full: Full = False,
) -> None:
    """Prints a result file: inputs, versions, and the table of results."""
    with terminal.refusing():
        results = read_results(result_file)
    for name, value in results.attrs.items():
        hidden = name in ("scene", "warnings", "assumed", "kept") or name.startswith("surface_")
        if value != "" and not hidden:
            typer.echo(f"{name:22} {str(value).replace(chr(10), chr(10) + 23 * ' ')}")
    surface = surface_of(results)
    shape, size = surface.grid.shape, surface.grid.size
    typer.echo(f"{'grid':22} {' x '.join(map(str, shape))} points, size {size} m")
    for sentence in surface.history:
        typer.echo(f"{'surface':22} {sentence}")
    print_steps(surface)
    kept = ", ".join(map(str, kept_solves(results))) or "none"
    typer.echo(f"{'fields kept':22} {kept} ({', '.join(map(str, results['message'].dims))})")
    print_table(results, all_seeds, full)
    if older := older_meaning(results):
        typer.secho(f"Warning: this result is {older}.", fg="yellow", err=True)


def run_scene_into(
    scene: Scene, folder: Path, name: str, replace: bool, form: str, engine: dict[str, Any],
    all_seeds: bool = False, full: bool = False,
) -> None:  # fmt: skip
    """Solves a scene, prints its table and writes its files; `Plan.run` takes `engine`."""
    with terminal.refusing(), interruptible() as interruption:
        if scene.title:
            typer.echo(scene.title)
        planned, file = _prepared(scene, folder, name, replace)
        print_warnings(planned.warnings)
        _say_stored(planned, Store(_points_of(file)))
        # The store stays locked: another process writes to neither its points nor the results.
        with terminal.store_in(_points_of(file)) as store:
            results = _solved(planned, store, interruption, engine)
            # Solves that an interruption left out must not replace those of an earlier run.
            finished = results["point"].values[(results["message"] != NOT_STARTED).values]
            lost = 0 if replace else lost_solves(file, finished)[0]
            if lost:
                typer.echo(
                    f"{file} holds {lost} solves that were not done again: it is not changed"
                )
            else:
                means = "seed" in results["message"].dims and not all_seeds
                write(file, results)
                told = over_seeds(results) if means else results
                write_csv(file.with_suffix(".csv"), told)
                typer.echo(f"wrote {file}\nwrote {file.with_suffix('.csv')}")
                if scene.kind == TRANSIENT:
                    over_time = file.with_name(f"{name}-time.csv")
                    write_csv(over_time, told, "time")
                    typer.echo(f"wrote {over_time}")
            print_table(results, all_seeds, full)
            whole = interruption.signal is None
            decided = what_decides(scene, planned.surface) if whole else {}
            print_decisive(decided)
            if not lost:
                kept, shown = kept_solves(results), scene if whole else None
                parts = [contacts(results, index, len(kept), shown) for index in kept]
                for key, figure in itertools.chain(figures(results, decided, all_seeds), *parts):
                    terminal.save_figure(figure, file.with_name(f"{name}-{key}.{form}"), form)
    print_doubts(results)
    if not whole or np.any(results["message"] == NOT_STARTED):
        terminal.end_if_interrupted(interruption)
    if np.any(results["message"] != ""):
        raise typer.Exit(1)


def _on_axis(text: str, axes: Mapping[str, np.ndarray]) -> tuple[str, int]:
    """The axis that NAME=VALUE names, and the index of its nearest value; prints another value."""
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f"`--map {text}` is refused: write NAME=VALUE, such as velocity=0.1.")
    if name not in axes:
        raise ValueError(f"`--map {text}`: {name!r} is no axis; {nearest(name, axes)}")
    values = axes[name]
    with within(f"`--map {text}`:"):
        wanted = float(value)
        # On an axis of ratios the nearest value is that of the nearest ratio.
        ratios = name not in LINEAR_AXES and wanted > 0 and np.all(values > 0)
        scaled = np.log if ratios else np.asarray
        index = int(np.argmin(np.abs(scaled(values) - scaled(wanted))))
        near = float(values[index])
        inside = np.min(values) <= wanted <= np.max(values)
        if not inside and not min(near / 2, near * 2) <= wanted <= max(near / 2, near * 2):
            known = ", ".join(f"{one:g}" for one in values)
            raise ValueError(f"no value of the axis is near: it has {known}.")
    if not np.isclose(near, wanted, rtol=1e-6):
        typer.echo(f"`--map {text}`: the contact at the nearest value, {near:g}, is drawn.")
    return name, index


def _prepared(scene: Scene, folder: Path, name: str, replace: bool) -> tuple[Plan, Path]:
    """The plan of a scene, and the file of its results; prints what was read."""
    file = Path(f"{terminal.checked_place(folder, name)}.h5")
    planned = plan(scene)
    remedy = "Give another --output, or --replace to replace it."
    try:
        lost, earlier = (0, None) if replace else lost_solves(file, planned.points)
    except ValueError as error:
        raise ValueError(f"{error} {remedy}") from error
    if lost and earlier is not None:  # a result of another scene, or of an older version
        if older := older_meaning(earlier):
            raise ValueError(f"{file} is {older}: they would stand beside others. {remedy}")
        versions, about = package_versions(), earlier.attrs
        there = [*about["scene"].splitlines(), *(f"{k} = {about.get(k)}" for k in versions)]
        here = [*scene.text.splitlines(), *(f"{k} = {v}" for k, v in versions.items())]
        # The first line that the other does not have; none is if only a file of data changed.
        old, new = (
            next((line for line in one if line not in other and not line.startswith("title")), "-")
            for one, other in ((there, here), (here, there))
        )
        raise ValueError(
            f"{file} contains {lost} solves of {about['title'] or 'another scene'!r} that this "
            f"scene does not have (file: `{old}`, scene: `{new}`). {remedy}"
        )
    print_read(scene, planned.surface)
    if "design" in parse_toml(scene.text):
        typer.echo("[design] is not used by this command: see `graded-contact design`.")
    return planned, file


def _points_of(file: Path) -> Path:
    """The folder of the solves of a file of results."""
    return file.with_suffix(".points")


def _say_stored(planned: Plan, store: Store) -> None:
    """Prints how many solves of a plan were done before, and begun."""
    if found := sum(store.path(point).exists() for point in planned.points.flat):
        typer.echo(f"{found} of {planned.points.size} solves are found in {store.folder}")
    if begun := sum(store.path(part_of(point)).exists() for point in planned.points.flat):
        typer.echo(f"{begun} of them begun: the steps done are in {store.folder}")


def _solved(
    planned: Plan, store: Store, interruption: Interruption, engine: dict[str, Any]
) -> "Dataset":
    """The results of a scene: solves that the store has, and those still to be computed."""
    try:
        interruption.check()
        with terminal.progress(interruption) as advance:
            say = partial(advance, "sliding")
            return planned.run(store=store, progress=say, **engine)
    except KeyboardInterrupt:
        typer.echo("Nothing was finished.", err=True)
        _say_stored(planned, store)
        raise typer.Exit(interruption.exit_code) from None


def figures(results: "Dataset", decided: dict, all_seeds: bool) -> Iterator[tuple[str, "Figure"]]:
    """Yields each figure of all solves with the end of its name.

    `decided` says which moduli decide the friction, see `what_decides`.
    """
    if not np.any(has_numbers(results)):
        typer.echo("No solve succeeded: no figure is drawn.")
        return
    if "time" in results.dims:
        if not np.all(np.isnan(results["friction"])):
            once = kind_of_results(results) == TRANSIENT
            draw = plot.plot_transient if once else plot.plot_cycle
            yield "history" if once else "cycle", draw(results)
        return
    yield "sweep", plot.plot_sweep(results)
    if "flow_along_x" in results:
        flows = [n for n in ("leakage_along_x", "leakage_along_y") if n in results]
        flows = flows or ["flow_along_x", "flow_along_y"]
        along = "pressure" if results.sizes["pressure"] > 1 else None
        yield "leakage", plot.plot_sweep(results, flows, along)
    if not np.any(results["velocity"]):
        return  # a master curve over a_T v has one point
    if "reduced_velocity" in results:
        yield "master", plot.plot_sweep(results, along="reduced_velocity")
    elif "master_curve" in results.attrs:
        typer.echo(results.attrs["master_curve"])
    if decided:
        labels = (f"{name}, {speed:.3g} m/s" for name, speed in decided)
        curves = dict(zip(labels, decided.values(), strict=True))
        yield "sensitivity", plot.plot_sensitivity(curves)


def contacts(
    results: "Dataset", index: tuple[int, ...], num_kept: int, scene: Scene | None = None
) -> Iterator[tuple[str, "Figure"]]:
    """Yields each figure of a solve that was kept; without a `scene` only the maps."""
    fields, surface = kept_contact(results, index)
    if not np.any(fields["pressure"] > 0):
        typer.echo("The surfaces do not touch: no maps are drawn.")
        return
    solve = results.isel(dict(zip(results["message"].dims, index, strict=True)))
    at, title = solve["message"], place_of(solve)
    if "time" in results.dims:
        drawn = {"film": plot.plot_film(fields, surface)}
    else:
        direction = float(at.coords.get("direction", results.attrs.get("direction")))
        velocity = velocity_along(at["velocity"].item(), direction)
        drawn = {"contact": plot.plot_sliding(fields, surface, velocity)}
        if scene is not None and surface.periodic:
            theory = mean_field_at(scene, surface, index)
            drawn["distributions"] = plot.plot_distributions(fields, theory)
            if not without_friction(solve):
                pressure, moved = (jnp.asarray(fields[n]) for n in ("pressure", "displacement"))
                waves = cumulative_friction(pressure, moved, surface.grid, velocity)
                curves = {"contact": waves}
                if theory is not None:
                    curves["mean field"] = theory.against_cutoff
                drawn["dissipation"] = plot.plot_dissipation(curves)
    for key, figure in drawn.items():
        entitle(figure, title)
        yield "-".join(map(str, (key, *(index if num_kept > 1 else ())))), figure
