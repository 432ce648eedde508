"""The job `new`: a scene from a topography and measured moduli."""

import os
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from typer import Argument, Option

from ..core.warnings import EXTRAPOLATED
from ..exports.prony_cards import export_prony
from ..plot.words import kelvin
from ..readers.topography import read_surface
from ..scenes.proposal import CONTACT_SHARE, Load, proposed_load
from ..scenes.schema import entry_text
from ..studies.dataset import write_whole
from . import fit
from .result_tables import print_steps
from .terminal import FigureFormat, Output, Replace, checked_place, refusing

FINEST_EDGE = 512  # points along an edge, for results within minutes
NUM_VELOCITIES = 7


def new(
    surface_file: Annotated[
        Path, Argument(metavar="TOPOGRAPHY", help="Measured surface.", show_default=False)
    ],
    moduli_files: fit.ModuliFiles,
    output: Output = None,
    size: Annotated[float | None, Option(
        metavar="METRES", help="Edge of the surface, if the file does not state it."
    )] = None,
    height_unit: Annotated[str | None, Option(
        help="Unit of the surface's numbers, likewise: um, nm, ..."
    )] = None,
    periodic: Annotated[str, Option(
        help="How its edges are joined: harmonic, mirror, window or none."
    )] = "harmonic",
    terms: fit.Terms = None,
    poisson: fit.Poisson = 0.5,
    kind: fit.DataKind = None,
    deformation: fit.Deformation = None,
    temperature: fit.Temperatures = None,
    unit: fit.UnitTexts = None,
    column: fit.ColumnTexts = None,
    replace: Replace = False,
    form: FigureFormat = "png",
) -> None:  # fmt: skip
    """Writes a scene that runs, from a topography and moduli of one material.

    Fits the moduli as `fit` does, with its report and figures, and proposes a pressure, velocities
    and temperatures. Several isotherms give a friction master curve.
    """
    with refusing(fit.with_options):
        name = fit.material_name(moduli_files[0])
        stem = checked_place(output or f"{name}-on-{surface_file.stem}", name)
        scene = stem.with_name("scene.toml")
        if scene.exists() and not replace:
            raise ValueError(f"{scene} exists: give another --output, or --replace.")
        read: dict[str, Any] = {"size": size, "unit": height_unit, "periodic": periodic}
        read = {key: value for key, value in read.items() if value is not None}
        surface = read_surface(surface_file, **read)
        # Twice as fine as measured, which resolves the edges of contact.
        most = FINEST_EDGE if surface.heights.ndim == 2 else FINEST_EDGE**2
        read["shape"] = tuple(min(2 * n, most) for n in surface.grid.shape)
        surface = read_surface(surface_file, **read)
        for sentence in surface.history:
            typer.echo(sentence)
        print_steps(surface)
        measured = fit.read_measured(
            moduli_files, column, unit, temperature, kind=kind, deformation=deformation,
            poisson=poisson,
        )  # fmt: skip
        found = fit.fitted(measured, terms=terms, poisson=poisson)
        parts = [part.temperature for part in measured.isotherms()]
        kelvins = [np.mean(part) for part in parts if part is not None]
        load = proposed_load(found.material, surface, np.array(kelvins))
        fit.write_fit(stem, found, [], form)
        path = os.path.relpath(surface_file.absolute(), stem.parent)
        entries = {"kind": "file", "path": Path(path).as_posix(), **read}
        title = f"{name} under {surface_file.stem}"
        card = export_prony(found.material, "toml", name=name)
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
        f"#     graded-contact run {scene.name} --dry-run     prints block, surface and loads",
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
        f"velocity = {{from = {low:g}, to = {high:g}, points = {NUM_VELOCITIES}}}  # [m/s]",
    ]
    if load.temperature:
        shown = ", ".join(map(kelvin, load.temperature))
        lines.append(f"temperature = {entry_text(load.temperature)}  # {shown}")
    if load.extrapolated > EXTRAPOLATED:
        share = f"# up to {load.extrapolated:.0%} of the friction is of frequencies not measured"
        lines += [share, "extrapolate = true"]
    return "\n".join([*lines, "", "[output]", 'name = "friction"', 'directory = "results"', ""])
