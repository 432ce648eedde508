"""The job `new`: a scene from a topography and measured moduli."""

import os
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..core.warnings import EXTRAPOLATED
from ..exports.prony_cards import export_prony
from ..plot.words import kelvin
from ..readers.paths import check_folder, full_path
from ..readers.topography import read_surface
from ..scenes.proposal import CONTACT_SHARE, Load, proposed_load
from ..scenes.schema import entry_text
from ..studies.dataset import write_whole
from .fit import (
    Columns,
    Deformation,
    Files,
    Kind,
    Poisson,
    Temperature,
    Terms,
    Units,
    fitted,
    material_name,
    naming_options,
    read_measured,
    write_fit,
)
from .result_tables import print_steps
from .terminal import FigureFormat, Format, Output, Replace, refusing

MOST = 512  # points along an edge, for results within minutes
POINTS = 7  # velocities
SHIFTS = {"law": "wlf", "shift_std": 0.3, "vertical_shift_std": 0.0}
WEIGHTS = {"storage_weight": 1.0, "loss_weight": 1.0}


def new(
    surface_file: Annotated[
        Path, typer.Argument(metavar="TOPOGRAPHY", help="Measured surface.", show_default=False)
    ],
    moduli_files: Files,
    output: Output = None,
    size: Annotated[
        float | None,
        typer.Option(metavar="METRES", help="Edge of the surface, if the file does not state it."),
    ] = None,
    height_unit: Annotated[
        str | None, typer.Option(help="Unit of the surface's numbers, likewise: um, nm, ...")
    ] = None,
    periodic: Annotated[
        str, typer.Option(help="How its edges are joined: harmonic, mirror, window or none.")
    ] = "harmonic",
    terms: Terms = None,
    poisson: Poisson = 0.5,
    kind: Kind = None,
    deformation: Deformation = None,
    temperature: Temperature = None,
    unit: Units = None,
    column: Columns = None,
    replace: Replace = False,
    form: FigureFormat = Format.PNG,
) -> None:
    """Writes a scene that runs, from a topography and moduli of one material.

    Fits the moduli as `fit` does, with its report and figures, and proposes a pressure, velocities
    and temperatures. Several isotherms give a friction master curve.
    """
    with refusing(), naming_options():
        name = material_name(moduli_files[0])
        folder = full_path(str(output or f"{name}-on-{surface_file.stem}"))
        check_folder(folder)
        scene = folder / "scene.toml"
        if scene.exists() and not replace:
            raise ValueError(f"{scene} exists: give another --output, or --replace.")
        read = {"size": size, "unit": height_unit, "periodic": periodic}
        read = {key: value for key, value in read.items() if value is not None}
        surface = read_surface(surface_file, **read)
        # Twice as fine as measured, which resolves the edges of contact.
        most = MOST if surface.heights.ndim == 2 else MOST**2
        read["shape"] = tuple(min(2 * n, most) for n in surface.grid.shape)
        surface = read_surface(surface_file, **read)
        for sentence in surface.history:
            typer.echo(sentence)
        print_steps(surface)
        measured = read_measured(
            moduli_files, column, unit, temperature, kind=kind, deformation=deformation,
            poisson=poisson,
        )  # fmt: skip
        found = fitted(measured, SHIFTS, WEIGHTS, {"terms": terms, "poisson": poisson})
        _, material, *_ = found
        parts = [part.temperature for part in measured.isotherms()]
        kelvins = [np.mean(part) for part in parts if part is not None]
        load = proposed_load(material, surface, np.array(kelvins))
        write_fit(folder, name, found, ("toml",), form)
        path = os.path.relpath(surface_file.absolute(), folder)
        entries = {"kind": "file", "path": Path(path).as_posix(), **read}
        card = export_prony(material, "toml", name=name)
        title = f"{name} under {surface_file.stem}"
        write_whole(scene, _text(title, scene, name, entries, card, load))
    typer.echo(f"wrote {scene}\nnext: graded-contact run {scene}")


def _text(
    title: str, scene: Path, name: str, surface: dict[str, Any], card: str, load: Load
) -> str:
    """The text of the scene."""
    low, high = load.velocity
    lines = [
        f"# {title}, by `graded-contact new`. Change what you know better.",
        "#",
        f"#     graded-contact run {scene.name} --dry-run     prints what is understood",
        f"#     graded-contact run {scene.name}",
        "",
        f"title = {entry_text(title)}",
        "",
        "[surface]  # without `shape` the points of the file; more of them resolve the contact",
        *(f"{key} = {entry_text(value)}" for key, value in surface.items()),
        "",
        card.rstrip(),
        f'errors = "{name}-errors.csv"  # of the fit; friction then has its standard error',
        "",
        "[base]  # layers go on top of it, each as [[layers]] with `material` and `thickness` [m]",
        'kind = "half_space"',
        f'material = "{name}"',
        "",
        f"[load]  # contact on about {CONTACT_SHARE:.0%} of the area, at measured frequencies",
        f"pressure = {load.pressure:g}  # [Pa]",
        f"velocity = {{from = {low:g}, to = {high:g}, points = {POINTS}}}  # [m/s]",
    ]
    if load.temperature:
        shown = ", ".join(map(kelvin, load.temperature))
        lines.append(f"temperature = {entry_text(load.temperature)}  # {shown}")
    if load.extrapolated > EXTRAPOLATED:
        share = f"# up to {load.extrapolated:.0%} of the friction is of frequencies not measured"
        lines += [share, "extrapolate = true"]
    return "\n".join([*lines, "", "[output]", 'name = "friction"', 'directory = "results"', ""])
