"""The job `fit`: measured moduli as a material."""

import ast
import contextlib
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer
from typer import Argument, Option

from ..core.checks import nearest
from ..exports.prony_cards import FORMATS, export_prony
from ..fitting.master import master_curve
from ..fitting.prony import fit_creep, fit_prony, fit_relaxation
from ..fitting.wild import wild_values, without
from ..materials.material import Prony
from ..materials.measured import Measured
from ..plot import plot_fit, plot_master_curve, plot_van_gurp_palmen
from ..readers.moduli import read_moduli
from ..studies.dataset import write_whole
from ..studies.parameter_covariance import Errors, write_errors
from ..studies.uncertainty import errors_of
from .terminal import FigureFormat, Output, checked_place, refusing, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
        "temperatures",
    )},
}  # fmt: skip

WILD = (
    "Warning: no smooth positive spectrum explains the values below, which the fit uses. "
    "Correct them, or leave out their rows with --robust."
)

# Options that `new` has too.
ModuliFiles = Annotated[list[Path], Argument(
    metavar="FILE...", help="Moduli or compliances of one material, in one file or several.",
    show_default=False,
)]  # fmt: skip
Terms = Annotated[
    int | None, Option(min=1, help="Number of terms (default: that of the lowest BIC).")
]
Poisson = Annotated[float, Option(help="Poisson's ratio of the material.")]
DataKind = Annotated[str | None, Option(help="frequency, relaxation or creep.")]
Deformation = Annotated[str | None, Option(help="tension or shear, if it is not in the file.")]
Temperatures = Annotated[list[float] | None, Option(
    "--temperature", metavar="KELVIN",
    help="Temperature of the data: one for all, or one for each file or curve.",
)]  # fmt: skip
UnitTexts = Annotated[list[str] | None, Option(
    "--unit", metavar="QUANTITY=UNIT", help="For instance modulus=MPa; may be repeated."
)]  # fmt: skip
ColumnTexts = Annotated[list[str] | None, Option(
    "--column", metavar="QUANTITY=NAME", help="For instance loss=4; may be repeated."
)]  # fmt: skip

Sheet = Annotated[str | None, Option(help="Name of the sheet of a workbook.")]
Steps = Annotated[list[str] | None, Option(
    metavar="NAME", help="Number or title of a step to read; may be repeated."
)]  # fmt: skip
Law = Annotated[Literal["wlf", "arrhenius"], Option(help="How several isotherms are shifted.")]
Equilibrium = Annotated[float | None, Option(
    metavar="PASCAL", help="E_eq if known; 0 for a liquid."
)]  # fmt: skip
Robust = Annotated[bool, Option(
    "--robust", help="Leave out rows that no smooth positive spectrum explains."
)]  # fmt: skip


def fit(
    moduli_files: ModuliFiles,
    output: Output = None,
    terms: Terms = None,
    poisson: Poisson = 0.5,
    kind: DataKind = None,
    deformation: Deformation = None,
    temperature: Temperatures = None,
    sheet: Sheet = None,
    step: Steps = None,
    law: Law = "wlf",
    shift_std: Annotated[float, Option(
        help="Expected standard deviation of log10 a_T from the law; 0 for none."
    )] = 0.3,
    vertical_shift_std: Annotated[float, Option(
        help="Expected standard deviation of ln b_T, the shift of moduli."
    )] = 0.0,
    equilibrium: Equilibrium = None,
    glassy: Annotated[float | None, Option(
        metavar="PASCAL", help="Instantaneous modulus if known."
    )] = None,
    storage_weight: Annotated[float, Option(help="Weight of storage moduli.")] = 1.0,
    loss_weight: Annotated[float, Option(help="Weight of loss moduli.")] = 1.0,
    anyway: Annotated[bool, Option(
        "--anyway", help="Fit data that are far from all positive spectra."
    )] = False,
    robust: Robust = False,
    unit: UnitTexts = None,
    column: ColumnTexts = None,
    card: Annotated[list[str] | None, Option(
        help="Also write csv, json, abaqus or ansys; may be repeated."
    )] = None,
    form: FigureFormat = "png",
) -> None:  # fmt: skip
    """Fits a Prony series to files of a rheometer or DMA: prints it as a table for a scene.

    Several isotherms, in one file or several, are shifted into a master curve. With a topography
    `graded-contact new` fits and writes the whole scene.
    """
    with refusing(with_options):
        for other in card or []:  # a list takes no `Literal`
            if other not in FORMATS:
                raise ValueError(f"`--card {other}` is not known; {nearest(other, FORMATS)}")
        folder = output or f"{moduli_files[0].stem}-fit"
        stem = checked_place(folder, material_name(moduli_files[0]))
        measured = read_measured(
            moduli_files, column, unit, temperature, kind=kind, deformation=deformation,
            poisson=poisson, sheet=sheet, step=step,
        )  # fmt: skip
        found = fitted(
            looked_through(measured, robust), terms=terms, poisson=poisson,
            equilibrium=equilibrium, glassy=glassy, throw=not anyway, law=law, shift_std=shift_std,
            storage_weight=storage_weight, loss_weight=loss_weight,
            vertical_shift_std=vertical_shift_std,
        )  # fmt: skip
        write_fit(stem, found, card or [], form)
    files = " ".join(map(str, moduli_files))
    typer.echo(f"next: graded-contact new TOPOGRAPHY {files}   (writes a scene that runs)")


def with_options(message: str) -> str:
    """Returns a message with options in place of the arguments that it names."""

    def option(found: re.Match) -> str:
        name, value = found.groups()
        spelt = _FIT_OPTIONS.get(name, "")
        with contextlib.suppress(SyntaxError, ValueError):  # a long value is cut
            pairs = ast.literal_eval(value or "")
            if spelt and isinstance(pairs, dict):  # as it is typed
                flag = spelt.split()[0]
                typed = (f"{flag} {shlex.quote(f'{key}={each}')}" for key, each in pairs.items())
                return f"`{' '.join(typed)}`"
        # An option that shows its form, or takes nothing, is named without the value.
        if value and spelt and " " not in spelt and name != "throw":
            spelt += " " + shlex.quote(value.strip("'"))
        return f"`{spelt}`" if spelt else found[0]

    return re.sub(r"`(\w+)(?:=([^`]*))?`", option, message)


def read_measured(moduli_files, column, unit, temperature, **options) -> Measured:
    """Reads moduli with options as texts, and prints how they were understood."""
    columns = _pairs("column", column)  # a number counts the columns from 1
    measured = read_moduli(
        moduli_files, units=_pairs("unit", unit), **options,
        columns={key: int(v) if v.isdecimal() else v for key, v in columns.items()},
        temperature=temperature[0] if temperature and len(temperature) == 1 else temperature,
    )  # fmt: skip
    for sentence in measured.history:
        typer.echo(with_options(sentence))
    return measured


def looked_through(measured: Measured, robust: bool) -> Measured:
    """Returns the data, if `robust` without the rows of wild values; prints these values."""
    wild = wild_values(measured)
    if wild and robust:
        typer.echo("Left out, because no smooth positive spectrum explains their values:")
    elif wild:
        typer.secho(WILD, fg="yellow", err=True)
    elif robust:
        typer.echo("--robust leaves out no row: a smooth positive spectrum explains them all.")
    for value in wild:
        typer.echo(str(value), err=not robust)
    return without(measured, wild) if robust else measured


def _pairs(option: str, texts: list[str] | None) -> dict[str, str]:
    """The keys and values of an option given as KEY=VALUE, any number of times."""
    for text in texts or []:
        if "=" not in text:
            raise ValueError(f"`--{option} {text}` is refused: write QUANTITY={option.upper()}.")
    return dict(text.split("=", 1) for text in texts or [])


def material_name(path: Path) -> str:
    """A name for the material of a file, as scenes and other programs take it."""
    name = re.sub(r"\W", "_", path.stem)
    return name if name[:1].isalpha() else f"material_{name}"


class MaterialFit(NamedTuple):
    """A material with its errors, a report, and figures by the ends of their names."""

    material: Prony
    errors: Errors
    report: str
    figures: "dict[str, Figure]"


def fitted(
    measured: Measured,
    *,
    storage_weight: float = 1.0,
    loss_weight: float = 1.0,
    law: str = "wlf",
    shift_std: float = 0.3,
    vertical_shift_std: float = 0.0,
    **arguments: Any,
) -> MaterialFit:
    """Fits one isotherm by a series, and several by a master curve; these take `arguments`."""
    isotherms, kind = measured.isotherms(), measured.kind
    weights = {"storage_weight": storage_weight, "loss_weight": loss_weight}
    if kind != "frequency" and {storage_weight, loss_weight} != {1.0}:
        raise ValueError(f"`storage_weight`, `loss_weight`: {kind} has one channel only.")
    if len(isotherms) == 1:
        function = {"frequency": fit_prony, "relaxation": fit_relaxation, "creep": fit_creep}[kind]
        arguments |= weights if kind == "frequency" else {}
        found = function(measured.abscissa, measured.values, **arguments)
        errors = errors_of(found, found.material)
        return MaterialFit(found.material, errors, found.report(), {"": plot_fit(found)})
    curve = master_curve(
        isotherms, law=law, shift_std=shift_std, vertical_shift_std=vertical_shift_std,
        weight=storage_weight, loss_weight=loss_weight, **arguments,
    )  # fmt: skip
    figures = {"": plot_master_curve(curve)}
    if kind == "frequency":
        figures["-van-gurp-palmen"] = plot_van_gurp_palmen(curve)
    material = curve.exported()
    return MaterialFit(material, errors_of(curve, material), curve.report(), figures)


def write_fit(stem: Path, found: MaterialFit, cards: list[str], form: str) -> None:
    """Prints the report and the table for a scene, and writes files that begin with `stem`."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    texts = {card: export_prony(found.material, card, name=stem.name) for card in ("toml", *cards)}
    typer.echo(f"\n{found.report}\n\n{texts['toml']}")
    for card, text in texts.items():
        path = f"{stem}{_SUFFIXES.get(card, f'.{card}')}"
        write_whole(path, text)
        typer.echo(f"wrote {path}")
    write_errors(f"{stem}-errors.csv", found.errors)
    typer.echo(f"wrote {stem}-errors.csv")
    for ending, figure in found.figures.items():
        save_figure(figure, Path(f"{stem}{ending}.{form}"), form)
