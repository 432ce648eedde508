"""The command `graded-contact`: it parses, runs a scene, prints a table, writes HDF5 and PNG.

Exit codes: 0 all is well; 1 some solve failed or did not converge, or a design misses what was
wanted; 2 the input was refused; 130 and 143 ended by Ctrl-C or SIGTERM, with what was finished.
"""

import contextlib
import hashlib
import json
import os
import platform
import re
import stat
from collections.abc import Callable, Iterator
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import numpy as np

    from .files.results import Results
    from .files.scene import Scene
    from .studies.interruption import Interruption
    from .surface import Surface

app = typer.Typer(
    help="Friction and contact area of layered viscoelastic blocks on rough surfaces.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_show_locals=False,
)
Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="Folder for the results.", show_default=False)
]
Replace = Annotated[
    bool, typer.Option("--replace", help="Replace a result of another scene of the same name.")
]

# A transform runs on one thread or on all, as chance will have it, with other last bits.
_ONE_THREAD = "--xla_cpu_multi_thread_eigen=false"
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Only tell memory, number of solves and time.")
]

# Endings of the files that other programs read.
_SUFFIXES = {"abaqus": ".inp", "ansys": ".mac"}
# What stands for the arguments that messages about moduli and their fits name.
_FIT_OPTIONS = {
    "units": "--unit QUANTITY=UNIT", "columns": "--column QUANTITY=NAME",
    "temperature": "--temperature KELVIN", "throw": "--anyway",
    **{name: f"--{name.replace('_', '-')}" for name in (
        "kind", "deformation", "poisson", "sheet", "terms", "law", "scatter", "vertical",
        "equilibrium", "glassy", "storage_weight", "loss_weight",
    )},
}  # fmt: skip

# Column heads and formats of the table, by the name of the quantity.
_COLUMNS = {
    "friction": ("friction", "#.4g"),
    "geometric_friction": ("friction\n(geometric)", "#.4g"),
    "contact_area": ("area\n(pixels)", ".5f"),
    "contact_area_corrected": ("area\n(corrected)", ".5f"),
    "contact_area_smooth": ("area\n(sub-pixel)", ".5f"),
    "mean_gap": ("mean gap\n[m]", ".3e"),
    "num_fft_pairs": ("FFT\npairs", ".1f"),
    "error": ("error", ".1e"),
    "unmeasured_friction": ("on points not\nmeasured", ".1%"),
}


# What to say of solves that did not succeed, by their state.
_STATES = {
    "not converged": "did not converge; their numbers are partial results",
    "failed": "failed",
    "not started": "were not started",
}


def _print_version(wanted: bool) -> bool:
    if wanted:
        typer.echo(f"graded-contact {version('graded_contact')} (jax {version('jax')})")
        raise typer.Exit
    return wanted


@app.callback()
def main(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print versions."),
    ] = False,
) -> None:
    """Friction and contact area of layered viscoelastic blocks on rough surfaces."""


@app.command()
def demo(
    output: Output = None,
    resolution: Annotated[
        int, typer.Option(min=256, help="Points along each edge; the surface stays the same.")
    ] = 256,
    replace: Replace = False,
) -> None:
    """Runs the embedded scene: a 50 µm modified surface layer on tyre tread, on a rough road."""
    _prepare()
    from .files.scene import parse_scene

    text = resources.files("graded_contact.studies").joinpath("demo.toml").read_text("utf-8")
    text = text.replace("shape = [256, 256]", f"shape = [{resolution}, {resolution}]")
    with _refusing():
        scene = parse_scene(text)
    name = "demo" if resolution == 256 else f"demo-{resolution}"
    _run(scene, output or Path("graded-contact-demo"), name, replace)


@app.command()
def run(
    scene_file: Annotated[
        Path, typer.Argument(metavar="SCENE.toml", help="The scene.", show_default=False)
    ],
    output: Output = None,
    replace: Replace = False,
    dry_run: DryRun = False,
) -> None:
    """Runs a scene: prints a table, writes the results (HDF5) and figures (PNG).

    Each solve is kept as it ends: after an interruption the same command goes on from there.
    """
    _prepare()
    from .files.scene import read_scene
    from .studies.cost import scene_cost
    from .studies.run import check_scene

    with _refusing():
        scene = read_scene(scene_file)
        if dry_run:
            typer.echo(scene_cost(scene).report())
            check_scene(scene)
            return
    folder = output or scene.directory or Path(f"{scene_file.stem}-results")
    _run(scene, folder, scene.name or scene_file.stem, replace)


@app.command()
def info(
    result_file: Annotated[
        Path, typer.Argument(metavar="RESULT.h5", help="A result.", show_default=False)
    ],
) -> None:
    """Prints what a result file holds: inputs, versions, and the table of results."""
    _prepare()
    from .files.results import read_results

    with _refusing():
        results = read_results(result_file)
    for name, value in results.attributes.items():
        if name != "scene" and value != "":
            typer.echo(f"{name:22} {str(value).replace(chr(10), chr(10) + 23 * ' ')}")
    grid = results.surface.grid
    typer.echo(f"{'grid':22} {' x '.join(map(str, grid.shape))} points, size {grid.size} m")
    for sentence in results.surface.history:
        typer.echo(f"{'surface':22} {sentence}")
    _print_steps(results.surface)
    kept = ", ".join(map(str, results.fields)) or "none"
    typer.echo(f"{'fields kept':22} {kept} (pressure, velocity)")
    _print_table(results)


@app.command()
def fit(
    moduli_files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Moduli or compliances of one material, in one file or several.",
            show_default=False,
        ),
    ],
    output: Output = None,
    terms: Annotated[int | None, typer.Option(min=1, help="Number of terms.")] = None,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio of the material.")] = 0.5,
    kind: Annotated[str | None, typer.Option(help="frequency, relaxation or creep.")] = None,
    deformation: Annotated[
        str | None, typer.Option(help="tension or shear, if the file does not say.")
    ] = None,
    temperature: Annotated[
        list[float] | None,
        typer.Option(metavar="KELVIN", help="One, or one for each file (or curve), in order."),
    ] = None,
    sheet: Annotated[str | None, typer.Option(help="Name of the sheet of a workbook.")] = None,
    law: Annotated[str, typer.Option(help="Shifts several isotherms: wlf or arrhenius.")] = "wlf",
    scatter: Annotated[
        float, typer.Option(help="Expected departures of log10 a_T from the law; 0 for none.")
    ] = 0.3,
    vertical: Annotated[
        float, typer.Option(help="Expected size of ln b_T, the shifts of their moduli.")
    ] = 0.0,
    equilibrium: Annotated[
        float | None, typer.Option(metavar="PASCAL", help="E_eq if known; 0 for a liquid.")
    ] = None,
    glassy: Annotated[
        float | None, typer.Option(metavar="PASCAL", help="Instantaneous modulus if known.")
    ] = None,
    storage_weight: Annotated[float, typer.Option(help="Weight of storage moduli.")] = 1.0,
    loss_weight: Annotated[float, typer.Option(help="Weight of loss moduli.")] = 1.0,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Fit data that no positive spectrum comes near to.")
    ] = False,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="QUANTITY=UNIT", help="For instance modulus=MPa; may be repeated."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="QUANTITY=NAME", help="For instance loss=4; may be repeated."),
    ] = None,
    card: Annotated[
        list[str] | None, typer.Option(help="Also write toml, csv, json, abaqus or ansys.")
    ] = None,
) -> None:
    """Fits a Prony series to files of a rheometer or DMA: prints it as a table for a scene.

    Several isotherms, in one file or several, are shifted into a master curve.
    """
    _prepare()
    from .files.moduli.reading import read_moduli
    from .files.output import check_folder, full_path
    from .files.prony_cards import FORMATS, export_prony
    from .files.toml import nearest

    with _refusing(), _naming_options():
        for form in card or []:
            if form not in FORMATS:
                raise ValueError(f"`--card {form}` is not known; {nearest(form, FORMATS)}")
        folder = full_path(str(output or f"{moduli_files[0].stem}-fit"))
        check_folder(folder)
        measured = read_moduli(
            moduli_files,
            kind=kind,
            deformation=deformation,
            units=_pairs("unit", unit),
            columns={
                key: int(v) if v.isdecimal() else v for key, v in _pairs("column", column).items()
            },
            poisson=poisson,
            temperature=temperature[0] if temperature and len(temperature) == 1 else temperature,
            sheet=sheet,
        )
        for sentence in measured.history:
            typer.echo(sentence)
        arguments = {
            "terms": terms, "poisson": poisson, "equilibrium": equilibrium, "glassy": glassy,
            "throw": not anyway,
        }  # fmt: skip
        weights = {"storage_weight": storage_weight, "loss_weight": loss_weight}
        shifts = {"law": law, "scatter": scatter, "vertical": vertical}
        figure, material, report = _fitted(measured, shifts, weights, arguments)
        name = re.sub(r"\W", "_", moduli_files[0].stem)
        name = name if name[:1].isalpha() else f"material_{name}"
        typer.echo(f"\n{report}\n\n{export_prony(material, 'toml', name=name)}")
        folder.mkdir(parents=True, exist_ok=True)
        figure.savefig(folder / f"{name}.png")
        typer.echo(f"wrote {folder / f'{name}.png'}")
        for form in ("toml", *(card or [])):
            path = folder / f"{name}{_SUFFIXES.get(form, f'.{form}')}"
            path.write_text(export_prony(material, form, name=name), encoding="utf-8")
            typer.echo(f"wrote {path}")


@contextlib.contextmanager
def _naming_options() -> Iterator[None]:
    """Adds to a message of `fit` the options that stand for the arguments it names."""
    try:
        yield
    except ValueError as error:
        named = dict.fromkeys(re.findall(r"`(\w+)(?:=[^`]*)?`", str(error)))
        options = [_FIT_OPTIONS[name] for name in named if name in _FIT_OPTIONS]
        if not options:
            raise
        raise ValueError(f"{error} (Here: {', '.join(options)}.)") from error


def _fitted(measured, shifts, weights, arguments):
    """The figure of the fit, its material with its shifts, and the report."""
    from .fitting.master import check_law, master_curve
    from .fitting.prony import fit_creep, fit_prony, fit_relaxation
    from .plot import plot_fit, plot_master_curve

    check_law(shifts["law"])
    isotherms = measured.isotherms()
    if measured.kind != "frequency" and set(weights.values()) != {1.0}:
        raise ValueError(f"`storage_weight`, `loss_weight`: {measured.kind} has one channel only.")
    if len(isotherms) == 1:
        functions = {"frequency": fit_prony, "relaxation": fit_relaxation, "creep": fit_creep}
        if measured.kind == "frequency":
            arguments = {**arguments, **weights}
        found = functions[measured.kind](measured.abscissa, measured.values, **arguments)
        return plot_fit(found), found.material, found.report()
    weight, loss_weight = weights.values()
    curve = master_curve(isotherms, **shifts, **arguments, weight=weight, loss_weight=loss_weight)
    return plot_master_curve(curve), curve.exported(), curve.report()


@app.command()
def design(
    scene_file: Annotated[
        Path, typer.Argument(metavar="SCENE.toml", help="The scene.", show_default=False)
    ],
    output: Output = None,
    dry_run: DryRun = False,
) -> None:
    r"""Designs the block of a scene with a table \[design]: prints it before and after.

    Each evaluation and each verified surface is kept: after an interruption the same command goes
    on from there.
    """
    _prepare()
    from .files.design_scene import read_design
    from .files.output import check_folder, check_name, full_path
    from .plot import plot_design
    from .studies.cost import design_cost
    from .studies.interruption import Interrupted, interruptible
    from .studies.report_design import designed_values, missed, report
    from .studies.run_design import check_design, run_design
    from .studies.store import Store

    with _refusing(), interruptible() as interruption:
        study = read_design(scene_file)
        if dry_run:
            typer.echo(design_cost(study).report())
            check_design(study)
            return
        folder = output or study.scene.directory or Path(f"{scene_file.stem}-results")
        name = f"{study.scene.name or scene_file.stem}-design"
        check_name(name)
        folder = full_path(str(folder))
        check_folder(folder)
        if study.scene.title:
            typer.echo(study.scene.title)
        try:
            with (
                Store(folder / f"{name}.points") as store,
                _progress(interruption) as advance,
            ):
                results = run_design(study, store=store, progress=advance)
            text = report(results)
            typer.echo(f"\n{text}\n")
            stem = folder / name
            values = json.dumps(designed_values(results), indent=2) + "\n"
            for suffix, content in (("json", values), ("txt", f"{text}\n")):
                Path(f"{stem}.{suffix}").write_text(content, encoding="utf-8")
                typer.echo(f"wrote {stem}.{suffix}")
            interruption.check()
            plot_design(results).savefig(f"{stem}.png")
            typer.echo(f"wrote {stem}.png")
        except Interrupted:
            typer.echo("Interrupted: the same command goes on from here.", err=True)
            raise typer.Exit(interruption.exit_code) from None
        except RuntimeError as error:  # the reason, without the traceback in it
            reason = str(error).rpartition("RuntimeError: ")[2].partition("\n\n")[0]
            typer.secho(f"Error: {reason}", fg="red", err=True)
            raise typer.Exit(1) from error
    for sentence in missed(results):
        typer.secho(f"Warning: {sentence}", fg="red", err=True)
    if missed(results) or not results.design.converged:
        raise typer.Exit(1)


def _pairs(option: str, texts: list[str] | None) -> dict[str, str]:
    """The keys and values of an option given as KEY=VALUE, any number of times."""
    for text in texts or []:
        if "=" not in text:
            raise ValueError(f"`--{option} {text}` is refused: write QUANTITY={option.upper()}.")
    return dict(text.split("=", 1) for text in texts or [])


def _run(scene: "Scene", folder: Path, name: str, replace: bool) -> None:
    import numpy as np

    from .files.output import check_folder, check_name, full_path
    from .studies.interruption import Interrupted, interruptible
    from .studies.run import build_surface, point_names, run_scene
    from .studies.store import Store

    with _refusing(), interruptible() as interruption:
        check_name(name)
        folder = full_path(str(folder))
        check_folder(folder)
        surface = build_surface(scene)
        names, file = point_names(scene, surface), folder / f"{name}.h5"
        if not replace:
            _refuse_other(file, scene, names)
        if scene.title:
            typer.echo(scene.title)
        for sentence in scene.notes:
            typer.echo(sentence)
        for sentence in surface.history:
            typer.echo(f"surface: {sentence}")
        _print_steps(surface)
        with Store(folder / f"{name}.points") as store:
            found = sum(store.path(point).exists() for point in names.flat)
            if found:
                typer.echo(f"{found} of {names.size} solves are found in {store.folder}")
            try:
                interruption.check()
                with _progress(interruption) as advance:
                    results = run_scene(
                        scene,
                        surface=surface,
                        store=store,
                        progress=lambda *counts: advance("sliding", *counts),
                    )
            except Interrupted:
                typer.echo("Nothing was finished.", err=True)
                raise typer.Exit(interruption.exit_code) from None
            except OSError as error:
                raise OSError(f"{error} The same command goes on from what is kept.") from error
            for path in store.damaged:
                typer.echo(f"{path} was damaged: it is computed again", err=True)
            _print_table(results)
            _write(file, results, replace)
    if results.caveats:
        where = np.any([caveat.where for caveat in results.caveats], axis=0)
        typer.secho(
            f"Warning: {np.sum(where)} of {where.size} solves are doubtful; the reasons stand "
            "below the table and in the file.",
            fg="yellow",
            err=True,
        )
    if interruption.signal is not None:
        typer.echo("Interrupted: the same command goes on from here.", err=True)
        raise typer.Exit(interruption.exit_code)
    if not results.complete:
        raise typer.Exit(1)


def _refuse_other(file: Path, scene: "Scene", names: "np.ndarray") -> None:
    """Refuses to replace a file with solves that the scene has not."""
    from itertools import zip_longest

    from .files.results import lost_solves, package_versions

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
    lines = zip_longest(*texts, fillvalue="")
    versions = ((f"{k} = {earlier.get(k)}", f"{k} = {v}") for k, v in package_versions().items())
    inputs = [("another file of data", "the files named")]
    there, here = next((a, b) for a, b in (*lines, *versions, *inputs) if a.strip() != b.strip())
    raise ValueError(
        f"{file} holds {lost} solves of {earlier['title'] or 'another scene'!r} that "
        f"{scene.title or 'this scene'!r} does not ask for: there `{there}`, here `{here}`. "
        f"{remedy}"
    )


def _write(file: Path, results: "Results", replace: bool) -> None:
    """Writes results and figures, unless the file that exists holds more."""
    from .files.results import NOT_STARTED, lost_solves, write_results
    from .files.sealed import replacing
    from .plot import plot_sliding, plot_sweep
    from .studies.extrapolation import velocity_vector

    finished = results.point[results.state != NOT_STARTED]
    if not replace and (lost := lost_solves(file, finished)[0]):
        typer.echo(f"{file} holds {lost} solves that were not done again: it stays as it is")
        return
    figures = {"sweep": plot_sweep(results)}
    for (i, j), fields in results.fields.items():
        key = f"contact-{i}-{j}" if len(results.fields) > 1 else "contact"
        velocity = velocity_vector(results.velocity[j], results.attributes["direction"])
        figures[key] = plot_sliding(fields, results.surface, velocity)
        load = f"mean pressure {results.pressure[i] / 1e6:.4g} MPa"
        figures[key].suptitle(f"{load}, velocity {results.velocity[j]:.3g} m/s")
    write_results(file, results)
    typer.echo(f"wrote {file}")
    for key, figure in figures.items():
        path = file.with_name(f"{file.stem}-{key}.png")
        with replacing(path) as partial:
            figure.savefig(partial, format="png")
        typer.echo(f"wrote {path}")


@contextlib.contextmanager
def _progress(interruption: "Interruption") -> Iterator[Callable[[str, int, int], None]]:
    """A bar on the error stream, moved by what is being done, and how much of how much is done.

    After a signal, moving it ends the command: between two steps that is safe.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("", total=None)

        def advance(text: str, done: int, total: int) -> None:
            bar.update(task, description=text, completed=done, total=total)
            interruption.check()

        yield advance


def _print_table(results: "Results") -> None:
    """Prints one line per solve; below them, why any did not converge."""
    import numpy as np
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    columns = dict(_COLUMNS)
    if results.surface.measured is None:
        del columns["unmeasured_friction"]
    heads = ["velocity\n[m/s]", "pressure\n[MPa]", *(head for head, _ in columns.values()), ""]
    for head in heads:
        table.add_column(Text(head), justify="right", no_wrap=True)
    caveats = results.caveats
    for i, j in np.ndindex(results.friction.shape):
        cells = [
            format(getattr(results, name)[i, j], style) for name, (_, style) in columns.items()
        ]
        state = str(results.state[i, j])
        mark = state and f"[bold red]{state}[/] "
        doubts = ",".join(str(n) for n, c in enumerate(caveats, start=1) if c.where[i, j])
        mark += f"[yellow]({doubts})[/]" if doubts else ""
        load = f"{results.pressure[i] / 1e6:.4g}"
        table.add_row(f"{results.velocity[j]:.3e}", load, *cells, mark)
    console = Console()
    # A narrower screen wraps the lines; it must not cut the numbers.
    console.width = max(console.width, 150)
    console.print(table)
    for number, caveat in enumerate(caveats, start=1):
        console.print(f"[bold yellow]({number})[/] {escape(caveat.sentence)}", soft_wrap=True)
    warning = Console(stderr=True)
    for state, text in _STATES.items():
        chosen = results.state == state
        if np.any(chosen):
            warning.print(f"[bold red]Warning:[/] {chosen.sum()} of {chosen.size} solves {text}.")
            for message in sorted(set(results.message[chosen]) - {state}):
                warning.print(message, markup=False)


def _print_steps(surface: "Surface") -> None:
    """Prints the roughness after every step of reading, one line each."""
    if surface.steps:
        heads = f"{'rms height [m]':>16}{'rms slope':>12}{'peak/rms':>10}{'missing':>9}"
        typer.echo(f"{'surface, after the step':24}{heads}")
    for name, *numbers in surface.steps:
        rms_height, rms_slope, peak, missing = numbers
        line = f"{name:24}{rms_height:16.4g}{rms_slope:12.4g}{peak:10.3g}{missing:9.1%}"
        typer.echo(line)


@contextlib.contextmanager
def _refusing() -> Iterator[None]:
    """Prints the message of a refused input, without a traceback, and exits with code 2."""
    try:
        yield
    except (ValueError, OSError, ImportError, MemoryError) as error:
        typer.secho(f"Error: {error}", fg="red", err=True)
        raise typer.Exit(2) from error


def _prepare() -> None:
    """Switches on double precision, and the cache of compiled code if its folder is safe."""
    flags = os.environ.get("XLA_FLAGS", "")
    if _ONE_THREAD.split("=")[0] not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_ONE_THREAD}".strip()
    import jax

    jax.config.update("jax_enable_x64", True)
    folder = _cache_folder()
    if folder is not None:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def _cache_folder() -> Path | None:
    """The user's cache folder for this kind of machine; None if others could write to it.

    What lies in it is executed: it belongs to the user alone, and to one kind of processor.
    """
    home = os.environ.get("XDG_CACHE_HOME")
    with contextlib.suppress(OSError, RuntimeError):
        root = (Path(home) if home else Path.home() / ".cache") / "graded_contact"
        folder = root / hashlib.sha256(_processor().encode()).hexdigest()[:16]
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        states = [path.stat() for path in (root, folder)]
        own = all(state.st_uid == os.getuid() for state in states) if os.name == "posix" else True
        shared = any(stat.S_IMODE(state.st_mode) & 0o022 for state in states)
        if own and (not shared or os.name != "posix") and os.access(folder, os.W_OK):
            return folder
    return None


def _processor() -> str:
    """What decides whether compiled code runs here: the processor's model and instructions."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        kept = {line for line in lines if line.startswith(("model name", "flags", "Features"))}
        return "\n".join(sorted(kept))
    return f"{platform.machine()} {platform.processor()}"
