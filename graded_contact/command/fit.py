"""The job `fit`: measured moduli as a material."""

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from ..core.checks import nearest
from ..exports.prony_cards import FORMATS, export_prony
from ..fitting.master import master_curve
from ..fitting.prony import fit_creep, fit_prony, fit_relaxation
from ..fitting.shifting import check_law
from ..fitting.wild import wild_values, without
from ..materials.measured import Measured
from ..plot import plot_fit, plot_master_curve, plot_van_gurp_palmen
from ..readers.moduli import read_moduli
from ..readers.paths import check_folder, full_path
from ..studies.dataset import write_whole
from ..studies.parameter_covariance import write_errors
from ..studies.uncertainty import errors_of
from .terminal import FigureFormat, Format, Output, refusing, save_figure

# Endings of the files that other programs read.
_SUFFIXES = {"abaqus": ".inp", "ansys": ".mac"}
# Options of the command, by the arguments that messages about moduli and their fits name.
_FIT_OPTIONS = {
    "units": "--unit QUANTITY=UNIT", "columns": "--column QUANTITY=NAME",
    "temperature": "--temperature KELVIN", "throw": "--anyway",
    "size": "--size METRES", "unit": "--height-unit",
    **{name: f"--{name.replace('_', '-')}" for name in (
        "kind", "deformation", "poisson", "sheet", "step", "terms", "law", "shift_std",
        "vertical_shift_std", "equilibrium", "glassy", "storage_weight", "loss_weight",
    )},
}  # fmt: skip

Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...", help="Moduli or compliances of one material, in one file or several.",
        show_default=False,
    ),
]  # fmt: skip
Text, Texts, Number = str | None, list[str] | None, float | None
Terms = Annotated[
    int | None, Option(min=1, help="Number of terms (default: that of the lowest BIC).")
]
Poisson = Annotated[float, Option(help="Poisson's ratio of the material.")]
Kind = Annotated[Text, Option(help="frequency, relaxation or creep.")]
Deformation = Annotated[Text, Option(help="tension or shear, if it is not in the file.")]
Temperature = Annotated[
    list[float] | None,
    Option(
        metavar="KELVIN",
        help="Temperature of the data: one for all, or one for each file or curve.",
    ),
]
SheetName = Annotated[Text, Option(help="Name of the sheet of a workbook.")]
Steps = Annotated[
    Texts, Option(metavar="NAME", help="Number or title of a step to read; may be repeated.")
]
Law = Annotated[str, Option(help="Shifts several isotherms: wlf or arrhenius.")]
ShiftStd = Annotated[
    float, Option(help="Expected standard deviation of log10 a_T from the law; 0 for none.")
]
VerticalShiftStd = Annotated[
    float, Option(help="Expected standard deviation of ln b_T, the shift of moduli.")
]
Equilibrium = Annotated[Number, Option(metavar="PASCAL", help="E_eq if known; 0 for a liquid.")]
Glassy = Annotated[Number, Option(metavar="PASCAL", help="Instantaneous modulus if known.")]
StorageWeight = Annotated[float, Option(help="Weight of storage moduli.")]
LossWeight = Annotated[float, Option(help="Weight of loss moduli.")]
Anyway = Annotated[
    bool, Option("--anyway", help="Fit data that are far from all positive spectra.")
]
Robust = Annotated[
    bool, Option("--robust", help="Leave out rows that no smooth positive spectrum explains.")
]
Units = Annotated[
    Texts, Option(metavar="QUANTITY=UNIT", help="For instance modulus=MPa; may be repeated.")
]
Columns = Annotated[
    Texts, Option(metavar="QUANTITY=NAME", help="For instance loss=4; may be repeated.")
]
Cards = Annotated[Texts, Option(help="Also write toml, csv, json, abaqus or ansys.")]


def fit(
    moduli_files: Files,
    output: Output = None,
    terms: Terms = None,
    poisson: Poisson = 0.5,
    kind: Kind = None,
    deformation: Deformation = None,
    temperature: Temperature = None,
    sheet: SheetName = None,
    step: Steps = None,
    law: Law = "wlf",
    shift_std: ShiftStd = 0.3,
    vertical_shift_std: VerticalShiftStd = 0.0,
    equilibrium: Equilibrium = None,
    glassy: Glassy = None,
    storage_weight: StorageWeight = 1.0,
    loss_weight: LossWeight = 1.0,
    anyway: Anyway = False,
    robust: Robust = False,
    unit: Units = None,
    column: Columns = None,
    card: Cards = None,
    form: FigureFormat = Format.PNG,
) -> None:
    """Fits a Prony series to files of a rheometer or DMA: prints it as a table for a scene.

    Several isotherms, in one file or several, are shifted into a master curve. With a topography
    `graded-contact new` fits and writes the whole scene.
    """
    with refusing(), naming_options():
        for other in card or []:
            if other not in FORMATS:
                raise ValueError(f"`--card {other}` is not known; {nearest(other, FORMATS)}")
        folder = full_path(str(output or f"{moduli_files[0].stem}-fit"))
        check_folder(folder)
        measured = read_measured(
            moduli_files, column, unit, temperature, kind=kind, deformation=deformation,
            poisson=poisson, sheet=sheet, step=step,
        )  # fmt: skip
        measured = _without_wild(measured, robust)
        arguments = {
            "terms": terms, "poisson": poisson, "equilibrium": equilibrium, "glassy": glassy,
            "throw": not anyway,
        }  # fmt: skip
        weights = {"storage_weight": storage_weight, "loss_weight": loss_weight}
        shifts = {"law": law, "shift_std": shift_std, "vertical_shift_std": vertical_shift_std}
        found = fitted(measured, shifts, weights, arguments)
        write_fit(folder, material_name(moduli_files[0]), found, ("toml", *(card or [])), form)
    files = " ".join(map(str, moduli_files))
    typer.echo(f"next: graded-contact new TOPOGRAPHY {files}   (writes a scene that runs)")


def read_measured(moduli_files, column, unit, temperature, **options) -> Measured:
    """Reads moduli with options as texts, and prints how they were understood."""
    columns = _pairs("column", column)
    measured = read_moduli(
        moduli_files, units=_pairs("unit", unit), **options,
        columns={key: int(v) if v.isdecimal() else v for key, v in columns.items()},
        temperature=temperature[0] if temperature and len(temperature) == 1 else temperature,
    )  # fmt: skip
    for sentence in measured.history:
        typer.echo(_with_options(sentence))
    return measured


def material_name(path: Path) -> str:
    """A name for the material of a file, as scenes and other programs take it."""
    name = re.sub(r"\W", "_", path.stem)
    return name if name[:1].isalpha() else f"material_{name}"


def _without_wild(measured: Measured, robust: bool) -> Measured:
    """Prints the rows that no smooth positive spectrum explains; leaves them out if `robust`."""
    wild = wild_values(measured)
    if wild and robust:
        typer.echo("Left out, because no smooth positive spectrum explains their values:")
    elif wild:
        warning = (
            "Warning: no smooth positive spectrum explains the values below. The fit uses them "
            "and is less accurate. Correct them, or leave out their rows with --robust."
        )
        typer.secho(warning, fg="yellow", err=True)
    elif robust:
        typer.echo("--robust leaves out no row: a smooth positive spectrum explains all values.")
    for value in wild:
        typer.echo(str(value), err=not robust)
    return without(measured, wild) if robust else measured


def write_fit(folder: Path, name: str, found: tuple, cards: tuple, form: str) -> None:
    """Prints the report, and writes figures, cards and errors of what `fitted` returned."""
    figures, material, errors, report = found
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}{_SUFFIXES.get(card, f'.{card}')}" for card in cards]
    for path, card in zip(paths, cards, strict=True):
        write_whole(path, export_prony(material, card, name=name))
    paths.append(folder / f"{name}-errors.csv")
    write_errors(paths[-1], errors)
    typer.echo(f"\n{report}\n\n{export_prony(material, 'toml', name=name)}")
    for path in paths:
        typer.echo(f"wrote {path}")
    for ending, figure in figures.items():
        save_figure(figure, folder / f"{name}{ending}.{form}", form)


def _with_options(message: str) -> str:
    """The message with options in place of the arguments that it names."""

    def option(found: re.Match) -> str:
        name, value = found.groups()
        spelt = _FIT_OPTIONS.get(name)
        if spelt is None:
            return found[0]
        if value is None or " " in spelt or name == "throw":
            return f"`{spelt}`"
        return "`{} {}`".format(spelt, value.strip("'"))

    return re.sub(r"`(\w+)(?:=([^`]*))?`", option, message)


@contextlib.contextmanager
def naming_options() -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(_with_options(str(error))) from error


def fitted(measured, shifts, weights, arguments):
    """Figures by the ends of their names; the material, its errors, and the report."""
    check_law(shifts["law"])
    isotherms = measured.isotherms()
    if measured.kind != "frequency" and set(weights.values()) != {1.0}:
        raise ValueError(f"`storage_weight`, `loss_weight`: {measured.kind} has one channel only.")
    if len(isotherms) == 1:
        function = {"frequency": fit_prony, "relaxation": fit_relaxation, "creep": fit_creep}
        given = {**arguments, **weights} if measured.kind == "frequency" else arguments
        found = function[measured.kind](measured.abscissa, measured.values, **given)
        material = found.material
        return {"": plot_fit(found)}, material, errors_of(found, material), found.report()
    weight, loss_weight = weights.values()
    curve = master_curve(isotherms, **shifts, **arguments, weight=weight, loss_weight=loss_weight)
    material = curve.exported()
    figures = {"": plot_master_curve(curve)}
    if measured.kind == "frequency":
        figures["-van-gurp-palmen"] = plot_van_gurp_palmen(curve)
    return figures, material, errors_of(curve, material), curve.report()


def _pairs(option: str, texts: list[str] | None) -> dict[str, str]:
    """The keys and values of an option given as KEY=VALUE, any number of times."""
    for text in texts or []:
        if "=" not in text:
            raise ValueError(f"`--{option} {text}` is refused: write QUANTITY={option.upper()}.")
    return dict(text.split("=", 1) for text in texts or [])
