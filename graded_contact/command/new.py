"""The job `new`: a scene from a topography and measured moduli."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from typer import Argument, Option

from ..blocks.stack import LIQUID
from ..core.escaping import in_comment
from ..materials.material import Prony
from ..plot.sweeps import kelvin
from ..readers.topography import read_surface
from ..scenes.plan import plan
from ..scenes.proposal import ProposedLoad, proposed_load
from ..scenes.scene import Scene
from ..scenes.scene_file import parse_scene
from ..scenes.theory import mean_fields
from ..scenes.toml import entry_text
from ..sliding.numbers.doubts import EXTRAPOLATED
from ..studies.dataset import write_whole
from ..surfaces.surface import Surface
from . import fit, moduli_options
from .result_tables import print_caveats, print_surface
from .terminal import Output, Replace, checked_place, refusing

FINEST_EDGE = 512  # points along an edge, for results within minutes
NUM_VELOCITIES = 7


def new(
    surface_file: Annotated[
        Path, Argument(metavar="TOPOGRAPHY", help="Measured surface.", show_default=False)
    ],
    moduli_files: moduli_options.ModuliFiles,
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
    terms: moduli_options.NumTerms = None,
    poisson: moduli_options.PoissonRatio = None,
    kind: moduli_options.DataKind = None,
    temperature: moduli_options.Temperatures = None,
    temperatures: Annotated[list[float] | None, Option(
        metavar="KELVIN",
        help="Temperature of the scene; may be repeated (default: some of those of the data).",
    )] = None,
    sheet: moduli_options.SheetName = None,
    step: moduli_options.StepNames = None,
    law: moduli_options.Law = "wlf",
    equilibrium: moduli_options.Equilibrium = None,
    glassy: moduli_options.Glassy = None,
    unit: moduli_options.UnitTexts = None,
    column: moduli_options.ColumnTexts = None,
    replace: Replace = False,
) -> None:  # fmt: skip
    """Writes a scene that runs, from a topography and moduli of one material.

    Fits the moduli as `fit` does, with its report and figures, and proposes a pressure, velocities
    and temperatures. Several isotherms give a friction master curve.
    """
    with refusing(moduli_options.in_options):
        shifts, name = moduli_options.law_arguments(law), fit.material_name(moduli_files[0])
        stem = checked_place(output or f"{name}-on-{surface_file.stem}", name)
        scene = stem.with_name("scene.toml")
        if scene.exists() and not replace:
            raise ValueError(f"{scene} exists: give another --output, or --replace.")
        surface, read = _finer(surface_file, size=size, unit=height_unit, periodic=periodic)
        found, measured = fit.fitted_files(
            moduli_files, column, unit, temperature, kind, sheet=sheet, step=step,
            terms=terms, poisson=poisson, equilibrium=equilibrium, glassy=glassy, **shifts,
        )  # fmt: skip
        _check_temperatures(found.material, temperatures or [])
        print_surface(surface)  # once both files are read
        print_caveats(surface.warnings)
        fit.write_fit(stem, found, ("toml",))
        if surface.grid.ndim == 2 and found.material.equilibrium == 0:
            raise ValueError(f"[materials.{name}] {LIQUID}")
        load = _load_of(found.material, surface, temperatures, measured)
        path = os.path.relpath(surface_file.absolute(), stem.parent)
        entries = {"kind": "file", "path": Path(path).as_posix(), **read}
        title, card = f"{name} under {surface_file.stem}", _card(found, name)
        known = found.material.measured is not None
        lines = partial(_lines, title, scene, name, entries, card, load, known)
        # What the comments say is computed from the scene, as `run` does.
        draft = parse_scene("\n".join(lines()), stem.parent)
        text = "\n".join(lines(*_by_mean_field(draft, surface)))
        plan(parse_scene(text, stem.parent), surface=surface)  # refuses what does not run
        write_whole(scene, text)
    typer.echo(f"wrote {scene}\nnext: graded-contact run {scene}")


def _finer(surface_file: Path, **given: Any) -> tuple[Surface, dict[str, Any]]:
    """Reads a surface, twice as fine as measured, which resolves the edges of contact.

    The other is what `read_surface` was given.
    """
    read = {key: value for key, value in given.items() if value is not None}
    surface = read_surface(surface_file, **read)
    most = FINEST_EDGE if surface.heights.ndim == 2 else FINEST_EDGE**2
    read["shape"] = tuple(min(2 * n, most) for n in surface.grid.shape)
    return read_surface(surface_file, **read), read


def _load_of(
    material: Prony, surface: Surface, temperatures: list[float] | None, measured: Sequence[float]
) -> ProposedLoad:
    """The first load, at the temperatures that were given, or at some of those of the data."""
    reference = getattr(material.shift, "reference", None)
    usual = [] if reference is None else [float(reference)]
    kelvins = np.array(temperatures or measured or usual)
    return proposed_load(material, surface, kelvins, every=bool(temperatures))


def _card(found: fit.MaterialFit, name: str) -> str:
    """The table of the material in the scene."""
    card = fit.scene_table(found, name).rstrip()
    if found.errors is None:
        return card
    return (
        f'{card}\nerrors = "{name}-errors.csv"  # of the fit; friction then has its standard error'
    )


def _by_mean_field(draft: Scene, surface: Surface) -> tuple[list[float], float]:
    """The areas of contact of a scene, and its largest share of friction not measured [1]."""
    areas, shares = [], [0.0]
    for _, bodies in draft.all_bodies():
        fields = mean_fields(draft, surface, bodies)
        areas += [float(field.contact_area) for field in fields]
        shares += [float(field.extrapolated_friction) for field in fields]
    return areas, max(shares)


def _check_temperatures(material: Prony, temperatures: list[float]) -> None:
    """Raises `ValueError` for temperatures to which the material cannot be brought."""
    if temperatures and material.shift is None:
        raise ValueError(
            f"`temperatures={temperatures[0]:g}` is refused: one isotherm shows no law of "
            "temperature. Give moduli at several temperatures."
        )
    for at in temperatures:
        try:
            material.at(at)
        except ValueError as error:  # `--temperature` is that of the data
            raise ValueError(str(error).replace("`temperature=", "`temperatures=")) from error


def _lines(
    title: str, scene: Path, name: str, surface: dict[str, Any], card: str, load: ProposedLoad,
    known: bool, areas: Sequence[float] = (0.0,), share: float = 0.0,
) -> list[str]:  # fmt: skip
    """The lines of the scene; `areas` of contact and `share` of friction not measured [1].

    `known` says whether the material knows where it was measured.
    """
    low, high = load.velocity
    area = " to ".join(dict.fromkeys(f"{end:.0%}" for end in (min(areas), max(areas))))
    where = ", at measured frequencies" if known and share <= EXTRAPOLATED else ""
    command = f"graded-contact run {scene.name}"
    lines = [
        in_comment(f"{title}, by `graded-contact new`. Change what you know better.", "#"),
        "#",
        in_comment(f"    {command} --dry-run     prints block, surface and loads", "#"),
        in_comment(f"    {command}", "#"),
        "",
        f"title = {entry_text(title)}",
        "",
        "[surface]  # without `shape` the points of the file; more of them resolve the contact",
        *(f"{key} = {entry_text(value)}" for key, value in surface.items()),
        "",
        card,
        "",
        "[base]  # layers go on top of it, each as [[layers]] with `material` and `thickness` [m]",
        'kind = "half_space"',
        f'material = "{name}"',
        "",
        f"[load]  # by mean field: contact on {area} of the area{where}",
        f"pressure = {load.pressure:g}  # [Pa]",
        f"velocity = {{from = {low:g}, to = {high:g}, points = {NUM_VELOCITIES}}}  # [m/s]",
    ]
    if load.temperature:
        shown = ", ".join(map(kelvin, load.temperature))
        lines.append(f"temperature = {entry_text(load.temperature)}  # {shown}")
    if share > EXTRAPOLATED:
        reason = f"up to {share:.0%} of the friction is of frequencies not measured"
        lines.append(f"# {reason}")
    return [*lines, "", "[output]", f"name = {entry_text(name)}", 'directory = "results"', ""]
