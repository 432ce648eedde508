"""The job `table`: friction over pressure, velocity and temperature, for other programs."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from typer import Option

from ..core.checks import check_values
from ..core.display import UNKNOWN
from ..core.quantities import in_brackets
from ..exports.friction_cards import export_friction
from ..mean_field.diffusion import Correction
from ..plot.words import kelvin
from ..scenes.described import described
from ..scenes.run_scene import build_surface, run_scene
from ..scenes.scene import Scene, read_scene, refuse_liquids, refuse_tables
from ..scenes.schema import parse_toml
from ..scenes.theory import check_frequencies_of, errors_of_stack, roughness_of
from ..studies.dataset import FAILED, write, write_whole
from ..studies.friction_tables import Method, beside, conditions, friction_table
from ..studies.interruption import Interruption, interruptible
from ..studies.store import Store
from ..surfaces.surface import Surface
from . import terminal
from .result_tables import print_table, size_of

if TYPE_CHECKING:
    from xarray import Dataset

OPTIONS = ("num_wavenumbers", "num_angles", "correction", "rtol")  # of the mean field
# Methods in words, and what helps where they fail.
WAYS = {
    "contact": ("contact", "`--method mean_field` writes cards of the mean field"),
    "mean_field": ("the mean field", "`--method contact` writes cards of contact"),
}


def table(
    scene_file: terminal.SceneFile,
    output: terminal.Output = None,
    replace: terminal.Replace = False,
    method: Annotated[Method, Option(
        help="Contact solves; the mean field (Persson's theory), which takes seconds; or both."
    )] = "contact",
    num_wavenumbers: Annotated[int | None, Option(
        help="Mean field: intervals of the quadrature over wavenumbers (default: 64)."
    )] = None,
    num_angles: Annotated[int | None, Option(
        help="Mean field: intervals of the quadrature over a quarter turn (default: 16)."
    )] = None,
    correction: Annotated[Correction | None, Option(
        help="Mean field: how partial contact counts (default: yang_persson)."
    )] = None,
    rtol: Annotated[float | None, Option(
        help="Mean field: largest relative error of the quadrature (default: 1e-4)."
    )] = None,
) -> None:  # fmt: skip
    r"""Writes friction over pressure, velocity and temperature of a scene for other programs.

    Writes NAME-friction.inp (*FRICTION of Abaqus), NAME-friction.csv (brush and ABS models) and
    NAME-friction.h5, with the method, the errors and the conditions. The scene has no other axes:
    neither \[sweep] nor seeds. Contact solves that `run` stored in the same folder are used.
    """
    given = zip(OPTIONS, (num_wavenumbers, num_angles, correction, rtol), strict=True)
    options: dict[str, Any] = {name: value for name, value in given if value is not None}
    with terminal.refusing(), interruptible() as interruption:
        if options and method == "contact":
            name = _with_options(f"`{next(iter(options))}`")
            raise ValueError(f"{name} is an option of the mean field: add --method both.")
        scene = read_scene(scene_file)
        _check(scene)
        folder, name = terminal.place_of(scene, scene_file, output)
        stem = terminal.checked_place(folder, f"{name}-friction")
        files = {form: Path(f"{stem}.{form}") for form in ("inp", "csv", "h5")}
        for file in files.values():
            if file.exists() and not replace:
                raise ValueError(f"{file} exists: give another --output, or --replace.")
        surface = build_surface(scene)
        if method != "contact" and not surface.periodic:
            raise ValueError("A surface on a window has no mean field: use --method contact.")
        found = None
        if method != "mean_field":
            with Store(stem.with_name(f"{name}.points")) as store:
                found = _contacts(scene, surface, store, interruption)
        if method != "contact":
            theory = _mean_field(scene, surface, interruption, options)
            _print_theory(theory)
            found = theory if found is None else beside(found, theory)
        assert found is not None
        found.attrs |= {"method": method, "conditions": _conditions(scene, surface, method)}
        stem.parent.mkdir(parents=True, exist_ok=True)
        write(files["h5"], found)  # first: it also takes points that failed
        typer.echo(f"wrote {files['h5']}")
        if np.any(found["message"] != ""):
            _say_failures(found, method)
            raise typer.Exit(1)
        for form, program in {"inp": "abaqus", "csv": "csv"}.items():
            write_whole(files[form], export_friction(found, program))
            typer.echo(f"wrote {files[form]}")
        if "mean_field.message" in found and np.any(found["mean_field.message"] != ""):
            _say_failures(found, "mean_field", "mean_field.message")


def _check(scene: Scene) -> None:
    """Raises `ValueError` for a scene that is no table."""
    refuse_tables(scene, "A table of friction", "motion")
    for axis in scene.axes:
        if axis not in ("temperature", "pressure", "velocity"):
            raise ValueError(f"A table of friction has no axis `{axis}`.")
    check_values("velocity", scene.velocity, "a speed [m/s] is not negative", at_least=0)


def _with_options(message: str) -> str:
    """A message with options in place of the arguments of the mean field."""
    for name in OPTIONS:
        message = message.replace(f"`{name}", f"`--{name.replace('_', '-')}")
    return message


def _contacts(
    scene: Scene, surface: Surface, store: Store, interruption: Interruption
) -> "Dataset":
    """The contacts of a scene, without their fields; prints their table."""
    with terminal.progress(interruption) as advance:
        found = run_scene(
            dataclasses.replace(scene, fields="none"), surface=surface, store=store,
            workers="auto", progress=partial(advance, "sliding"),
        )  # fmt: skip
    print_table(found)
    terminal.end_if_interrupted(interruption)
    return found.drop_dims([axis for axis in ("x", "y") if axis in found.dims])


def _mean_field(
    scene: Scene, surface: Surface, interruption: Interruption, options: dict[str, Any]
) -> "Dataset":
    if not np.all(scene.velocity):
        refuse_liquids(scene)
    check_frequencies_of(scene, surface)
    names = ("strain_per_slope", "shear", "heating")
    given = {name: getattr(scene, name) for name in names} | options
    warm = None if scene.temperature is None else np.atleast_1d(scene.temperature)
    try:
        with terminal.progress(interruption) as advance:
            found = friction_table(
                scene.stack, roughness_of(scene, surface), pressure=scene.pressure,
                velocity=scene.velocity, temperature=warm, direction=scene.direction,
                method="mean_field", mean_field_options=given, errors=errors_of_stack(scene),
                progress=partial(advance, "mean field"),
            )  # fmt: skip
    except ValueError as error:
        raise ValueError(_with_options(str(error))) from error
    if interruption.signal is not None:
        raise typer.Exit(interruption.exit_code)
    if not _varies(scene) and "temperature" in found.dims:  # no axis of the scene
        found = found.isel(temperature=0, drop=True)
    caveats = "\n".join((*surface.caveats, *scene.assumed))
    return found.assign_attrs(title=scene.title, scene=scene.text, caveats=caveats)


def _print_theory(theory: "Dataset") -> None:
    names = ["friction", "friction_error", "contact_area"]
    rows = theory[names].to_dataframe([*theory["friction"].dims]).reset_index()
    rows.columns = [name + in_brackets(theory[name].attrs.get("units", "1")) for name in rows]
    text = rows.to_string(index=False, float_format="{:.4g}".format, na_rep=UNKNOWN)
    typer.echo(f"By the mean field, with the error of its quadrature:\n{text}")


def _varies(scene: Scene) -> bool:
    return scene.temperature is not None and np.ndim(scene.temperature) > 0


def _conditions(scene: Scene, surface: Surface, method: Method) -> str:
    """What a table holds for, in lines."""
    points = " x ".join(map(str, surface.grid.shape))
    warm = [] if _varies(scene) else [f"Temperature: {_temperature(scene)}"]
    return "\n".join([
        f"Block: {described(parse_toml(scene.text))}",
        f"Surface: {points} points, {size_of(surface)}",
        *warm,
        conditions(scene.direction, scene.shear, scene.heating, method),
    ])  # fmt: skip


def _temperature(scene: Scene) -> str:
    if scene.temperature is None:
        return "that of the materials as they are written"
    return kelvin(float(scene.temperature))


def _say_failures(found: "Dataset", method: Method, messages: str = "message") -> None:
    """Prints that points failed by one method, why, and what the other method offers."""
    by = "mean_field" if method == "mean_field" else "contact"
    reasons = found[messages].values[found[messages].values != ""]
    reason = reasons.flat[0].removeprefix(FAILED)
    reason = _with_options(reason) if by == "mean_field" else reason
    text = f"{reasons.size} of {found[messages].size} points failed by {WAYS[by][0]}. The first: "
    text += reason
    if messages == "message":
        text += f"\nNo card is written. {WAYS[by][1]}."
    typer.secho(text, fg="red", err=True)
