"""The job `table`: friction over pressure, velocity and temperature, for other programs."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from typer import Option

from ..core.checks import check_values
from ..core.display import UNKNOWN
from ..core.quantities import STEADY, in_brackets
from ..exports.friction_cards import export_friction
from ..plot.sweeps import kelvin
from ..scenes.described import described
from ..scenes.plan import build_surface, plan
from ..scenes.scene import Scene
from ..scenes.scene_checks import refuse_liquids, refuse_tables
from ..scenes.scene_file import read_scene
from ..scenes.theory import errors_of_bodies, roughness_of
from ..scenes.toml import parse_toml
from ..sliding.result import warnings_of
from ..studies.dataset import FAILED, read_dataset, write, write_whole
from ..studies.friction_tables import TableMethod, conditions, friction_table
from ..studies.interruption import Interruption, interruptible
from ..surfaces.surface import Surface
from . import terminal
from .result_tables import print_doubts, print_table, print_warnings, size_of

if TYPE_CHECKING:
    from xarray import Dataset

# Methods in words, and what helps where they fail.
METHODS_IN_WORDS = {
    "contact": ("contact", "`--method mean_field` writes cards of the mean field"),
    "mean_field": ("the mean field", "`--method contact` writes cards of contact"),
}


def table(
    scene_file: terminal.SceneFile,
    output: terminal.Output = None,
    replace: terminal.Replace = False,
    method: Annotated[TableMethod, Option(
        help="Contact solves; or the mean field (Persson's theory), which takes seconds."
    )] = "contact",
) -> None:  # fmt: skip
    r"""Writes friction over pressure, velocity and temperature of a scene for other programs.

    Writes NAME-friction.inp (*FRICTION of Abaqus), NAME-friction.csv (brush and ABS models) and
    NAME-friction.h5, with the method, the errors and the conditions. The scene has no other axes:
    neither \[sweep] nor seeds. Contact solves that `run` stored in the same folder are used.
    """
    with terminal.refusing(), interruptible() as interruption:
        scene = read_scene(scene_file)
        _check(scene)
        folder, name = terminal.output_of(scene, scene_file, output)
        stem = terminal.checked_place(folder, f"{name}-friction")
        files = {form: Path(f"{stem}.{form}") for form in ("inp", "csv", "h5")}
        for file in files.values():
            if file.exists() and not replace and not _is_failed_try(files):
                raise ValueError(f"{file} exists: give another --output, or --replace.")
        if method == "contact":
            found = _contacts(scene, stem.with_name(f"{name}.points"), interruption)
        else:
            found = _mean_field(scene, interruption)
        stem.parent.mkdir(parents=True, exist_ok=True)
        write(files["h5"], found)  # first: it also takes points that failed
        typer.echo(f"wrote {files['h5']}")
        if np.any(found["message"] != ""):
            _say_failures(found, method)
            raise typer.Exit(1)
        for form, program in {"inp": "abaqus", "csv": "csv"}.items():
            write_whole(files[form], export_friction(found, program))
            typer.echo(f"wrote {files[form]}")


def _check(scene: Scene) -> None:
    """Raises `ValueError` for a scene that is no table."""
    refuse_tables(scene, "A table of friction", "motion")
    for axis in scene.axes:
        if axis not in ("temperature", "pressure", "velocity"):
            raise ValueError(f"A table of friction has no axis `{axis}`.")
    check_values("velocity", scene.velocity, "a speed [m/s] is not negative", at_least=0)


def _is_failed_try(files: dict[str, Path]) -> bool:
    """Whether a table failed there: its numbers have failed points, and there are no cards."""
    if any(file.exists() for form, file in files.items() if form != "h5"):
        return False
    try:
        return bool(np.any(read_dataset(files["h5"]).get("message", "") != ""))
    except ValueError:  # of something else
        return False


def _contacts(scene: Scene, points: Path, interruption: Interruption) -> "Dataset":
    """The contacts of a scene, without their fields; prints their table."""
    planned = plan(dataclasses.replace(scene, fields="none"))
    with terminal.store_in(points) as store, terminal.progress(interruption) as advance:
        found = planned.run(store=store, workers="auto", progress=partial(advance, "sliding"))
    print_table(found)
    print_doubts(found)
    terminal.end_if_interrupted(interruption)
    found = found.drop_dims([axis for axis in ("x", "y") if axis in found.dims])
    return found.assign_attrs(_about(scene, planned.surface, "contact"))


def _mean_field(scene: Scene, interruption: Interruption) -> "Dataset":
    """The mean field of a scene; prints its numbers."""
    surface = build_surface(scene)
    if not surface.periodic:
        raise ValueError("A surface on a window has no mean field: use --method contact.")
    if not np.all(scene.velocity):
        refuse_liquids(scene)
    names = (
        "pressure",
        "velocity",
        "direction",
        "strain_per_slope",
        "shear",
        "heating",
        "counterface",
    )
    given = {name: getattr(scene, name) for name in names}
    warm = None if scene.temperature is None else np.atleast_1d(scene.temperature)
    with terminal.progress(interruption) as advance:
        found = friction_table(
            scene.stack, roughness_of(scene, surface), temperature=warm, method="mean_field",
            errors=errors_of_bodies(scene), progress=partial(advance, "mean field"), **given,
        )  # fmt: skip
    if interruption.signal is not None:
        raise typer.Exit(interruption.exit_code)
    if "temperature" in found.dims and "temperature" not in scene.axes:
        found = found.isel(temperature=0, drop=True)
    _print_theory(found)
    shares = {"extrapolated_friction": found["extrapolated_friction"]}
    doubts = warnings_of(lambda number: shares.get(number, 0.0), STEADY)
    warnings = [*surface.warnings, *scene.assumed, *(warning.sentence for warning in doubts)]
    print_warnings(warnings)
    about = {"title": scene.title, "scene": scene.text, "warnings": "\n".join(warnings)}
    return found.assign_attrs(about | _about(scene, surface, "mean_field"))


def _print_theory(theory: "Dataset") -> None:
    names = ["friction", "friction_error", "contact_area"]
    rows = theory[names].to_dataframe([*theory["friction"].dims]).reset_index()
    rows.columns = [name + in_brackets(theory[name].attrs.get("units", "1")) for name in rows]
    # An axis has more digits: 283.15 K.
    digits = dict.fromkeys(rows.columns[: theory["friction"].ndim], "{:.6g}".format)
    text = rows.to_string(
        index=False, float_format="{:.4g}".format, formatters=digits, na_rep=UNKNOWN
    )
    typer.echo(f"By the mean field, with the error of its quadrature:\n{text}")


def _about(scene: Scene, surface: Surface, method: TableMethod) -> dict[str, str]:
    """The method of a table, and what it holds for, in lines."""
    lines = [
        f"Block: {described(parse_toml(scene.text))}",
        f"Surface: {' x '.join(map(str, surface.grid.shape))} points, {size_of(surface)}",
    ]
    if scene.temperature is None:
        lines.append("Temperature: that of the materials as they are written")
    elif "temperature" not in scene.axes:
        lines.append(f"Temperature: {kelvin(float(scene.temperature))}")
    lines.append(conditions(scene.direction, scene.shear, scene.heating, method))
    return {"method": method, "conditions": "\n".join(lines)}


def _say_failures(found: "Dataset", method: TableMethod) -> None:
    """Prints that points failed, why, and what the other method offers."""
    reasons = found["message"].values[found["message"].values != ""]
    by, remedy = METHODS_IN_WORDS[method]
    typer.secho(
        f"{reasons.size} of {found['message'].size} points failed by {by}. The first: "
        f"{reasons.flat[0].removeprefix(FAILED)}\nNo card is written. {remedy}.",
        fg="red", err=True,
    )  # fmt: skip
