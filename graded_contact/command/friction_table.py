"""The job `table`: friction over pressure, velocity and temperature, for other programs."""

from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from ..exports.friction_cards import export_friction
from ..scenes.run_scene import build_surface
from ..scenes.scene import read_scene, refuse_liquids, refuse_tables
from ..scenes.theory import check_frequencies_of, roughness_of
from ..studies.dataset import write, write_whole
from ..studies.friction_tables import Method, friction_table
from ..studies.interruption import interruptible
from .terminal import Output, Replace, SceneFile, checked_place, place_of, progress, refusing


def table(
    scene_file: SceneFile,
    output: Output = None,
    replace: Replace = False,
    method: Annotated[
        Method, typer.Option(help="Contact solves, the mean field, or both beside each other.")
    ] = "mean_field",
) -> None:
    r"""Writes friction over pressure, velocity and temperature of a scene for other programs.

    Writes NAME-friction.inp (*FRICTION of Abaqus), NAME-friction.csv (brush and ABS models; with
    errors) and NAME-friction.h5. The scene has no other axes: neither \[sweep] nor seeds.
    """
    with refusing(), interruptible() as interruption:
        scene = read_scene(scene_file)
        refuse_tables(scene, "A table of friction", "motion", "shear", "heating")
        for axis in scene.axes:
            if axis not in ("temperature", "pressure", "velocity"):
                raise ValueError(f"{scene_file}: a table of friction has no axis `{axis}`.")
        folder, name = place_of(scene, scene_file, output)
        stem = checked_place(folder, f"{name}-friction")
        files = {form: Path(f"{stem}.{form}") for form in ("inp", "csv", "h5")}
        for file in files.values():
            if file.exists() and not replace:
                raise ValueError(f"{file} exists: give another --output, or --replace.")
        surface = build_surface(scene)
        simple = method == "mean_field" and surface.periodic
        if (surface.grid.ndim == 2 and not simple) or not np.all(scene.velocity):
            refuse_liquids(scene)
        check_frequencies_of(scene, surface)
        common = {"graded_solver": scene.graded_solver, "strain_per_slope": scene.strain_per_slope}
        with progress(interruption) as advance:
            warm = None if scene.temperature is None else np.atleast_1d(scene.temperature)
            found = friction_table(
                scene.stack, roughness_of(scene, surface) if simple else surface,
                pressure=scene.pressure, velocity=scene.velocity, temperature=warm,
                direction=scene.direction, method=method, mean_field_options=common,
                slide_options={
                    "solver": scene.solver, "rtol": scene.rtol, "law": scene.contact_law,
                    **common,
                },
                progress=partial(advance, "friction"),
            )  # fmt: skip
        if interruption.signal is not None:
            raise typer.Exit(interruption.exit_code)
        stem.parent.mkdir(parents=True, exist_ok=True)
        write(files["h5"], found)  # first: it also takes points that failed
        typer.echo(f"wrote {files['h5']}")
        for form, program in {"inp": "abaqus", "csv": "csv"}.items():
            write_whole(files[form], export_friction(found, program))
            typer.echo(f"wrote {files[form]}")
