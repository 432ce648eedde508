"""The job `design`: the block of a scene before and after."""

import json
from pathlib import Path

import typer

from ..designs.plan import plan_design
from ..designs.table import read_design
from ..plot import plot_design, plot_history
from ..studies.dataset import write_whole
from ..studies.interruption import interruptible
from ..surfaces.surface import Surface
from . import terminal
from .designed_scene import designed_scene
from .result_tables import print_caveats, print_read


def design(
    scene_file: terminal.SceneFile,
    output: terminal.Output = None,
    dry_run: terminal.DryRun = False,
    form: terminal.FigureFormat = "png",
) -> None:
    r"""Designs the block of a scene with a table \[design]: prints the block before and after.

    Each evaluation and each verified surface is stored. After an interruption the same command
    continues from there.
    """
    with terminal.refusing(), interruptible() as interruption:
        study = read_design(scene_file)
        if dry_run:
            typer.echo(study)
        planned = plan_design(study)
        if dry_run:
            typer.echo(planned)
            rough = study.spectrum
            print_read(study.scene, rough if isinstance(rough, Surface) else None)
            return
        folder, name = terminal.output_of(study.scene, scene_file, output)
        stem = terminal.checked_place(folder, f"{name}-design")
        if study.scene.title:
            typer.echo(study.scene.title)
        try:
            folder = Path(f"{stem}.points")
            with terminal.store_in(folder) as store, terminal.progress(interruption) as advance:
                results = planned.run(store=store, progress=advance)
            text, following = results.report(), ""
            write_whole(f"{stem}.json", json.dumps(results.values(), indent=2) + "\n")
            write_whole(f"{stem}.txt", f"{text}\n")
            typer.echo(f"\n{text}\n")
            print_caveats(planned.caveats)
            typer.echo(f"wrote {stem}.json\nwrote {stem}.txt")
            try:
                text = designed_scene(results, scene_file, stem.parent)
            except ValueError as error:
                typer.secho(f"No scene of the designed block: {error}", fg="yellow", err=True)
            else:
                write_whole(new := stem.with_name(f"{name}-designed.toml"), text)
                following = f"next: graded-contact run {new}"
                typer.echo(f"wrote {new}")
            interruption.check()
            terminal.save_figure(plot_design(results), Path(f"{stem}.{form}"), form)
            history = plot_history(results.design, scene=study.scene.text)
            terminal.save_figure(history, Path(f"{stem}-history.{form}"), form)
            if following:
                typer.echo(following)
        except KeyboardInterrupt:
            terminal.end_if_interrupted(interruption)
            raise
        except RuntimeError as error:  # the reason, without the traceback in it
            reason = str(error).rpartition("RuntimeError: ")[2].partition("\n\n")[0]
            typer.secho(f"Error: {reason}", fg="red", err=True)
            raise typer.Exit(1) from error
    for sentence in results.missed():
        typer.secho(f"Warning: {sentence}", fg="red", err=True)
    if results.missed() or not results.design.converged:
        raise typer.Exit(1)
