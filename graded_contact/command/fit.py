"""The job `fit`: measured moduli as a material."""

import inspect
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import typer

from ..core.escaping import in_comment
from ..exports.prony_cards import export_prony
from ..fitting.master import master_curve
from ..fitting.prony import fit_prony
from ..materials.material import Prony
from ..materials.measured import Measured
from ..plot import plot_fit, plot_master_curve
from ..readers.decisions import Options
from ..readers.moduli import read_moduli
from ..readers.prony import prony_in
from ..scenes.toml import entry_text
from ..studies.dataset import write_whole
from ..studies.parameter_covariance import Errors, write_errors
from ..studies.uncertainty import errors_of_fit
from . import moduli_options
from .result_tables import print_caveats
from .terminal import Output, checked_place, refusing, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Cards of the material: endings of their files and comments in them, by format.
CARDS = {"toml": (".toml", "#"), "abaqus": (".inp", "**"), "ansys": (".mac", "!")}


def fit(
    moduli_files: moduli_options.ModuliFiles,
    output: Output = None,
    terms: moduli_options.NumTerms = None,
    poisson: moduli_options.PoissonRatio = None,
    kind: moduli_options.DataKind = None,
    temperature: moduli_options.Temperatures = None,
    sheet: moduli_options.SheetName = None,
    step: moduli_options.StepNames = None,
    law: moduli_options.Law = "wlf",
    equilibrium: moduli_options.Equilibrium = None,
    glassy: moduli_options.Glassy = None,
    unit: moduli_options.UnitTexts = None,
    column: moduli_options.ColumnTexts = None,
) -> None:
    """Fits a Prony series to files of a rheometer or DMA: prints it as a table for a scene.

    Writes cards for Abaqus and Ansys too. A file that holds a Prony series is only converted: a
    table of relaxation times and moduli, a deck of Abaqus or Ansys. Several isotherms, in one file
    or several, are shifted into a master curve. With a topography `graded-contact new` fits and
    writes the whole scene.
    """
    given = locals()
    with refusing(moduli_options.in_options):
        shifts = moduli_options.law_arguments(law)
        folder = output or f"{moduli_files[0].stem}-fit"
        stem = checked_place(folder, material_name(moduli_files[0]))
        found, _ = fitted_files(
            moduli_files, column, unit, temperature, kind, sheet=sheet, step=step, 
            terms=terms, poisson=poisson, equilibrium=equilibrium, glassy=glassy, **shifts,
        )  # fmt: skip
        write_fit(stem, found, tuple(CARDS))
    words = shlex.join([*map(str, moduli_files), *_typed(given)])
    if found.material.equilibrium == 0:
        words += " --equilibrium PASCAL"  # `new` writes no scene of a liquid
    typer.echo(f"next: graded-contact new TOPOGRAPHY {words}   (writes a scene that runs)")


def _typed(given: dict[str, Any]) -> list[str]:
    """Options of `fit` that are not the default, as they are typed; without the folder."""
    words = []
    for name, parameter in inspect.signature(fit).parameters.items():
        value = given[name]
        if name in ("moduli_files", "output") or value == parameter.default:
            continue
        values = value if isinstance(value, list) else [value]
        words += [f"--{name}"] if value is True else [f"--{name}={each}" for each in values]
    return words


def read_measured(moduli_files, column, unit, temperature, kind, **options) -> Measured:
    """Reads moduli with options as texts, and prints how they were understood."""
    options |= moduli_options.kinds_of(kind)
    columns = moduli_options.keys_and_values("column", column)  # a number counts the columns from 1
    measured = read_moduli(
        moduli_files, units=moduli_options.keys_and_values("unit", unit), **options,
        columns={key: int(v) if v.isdecimal() else v for key, v in columns.items()},
        temperature=temperature[0] if temperature and len(temperature) == 1 else temperature,
    )  # fmt: skip
    print_history(measured.history, measured.assumed)
    return measured


def print_history(history: Sequence[str], assumed: Sequence[str]) -> None:
    """Prints how a file was read, and what was assumed."""
    for sentence in history:
        if sentence not in assumed:
            typer.echo(moduli_options.in_options(sentence))
    print_caveats(map(moduli_options.in_options, assumed))


def material_name(path: Path) -> str:
    """A name for the material of a file, as scenes and other programs take it."""
    name = re.sub(r"\W", "_", path.stem)
    return name if name[:1].isalpha() else f"material_{name}"


class MaterialFit(NamedTuple):
    """A material with its errors, a report, and figures by the ends of their names.

    The errors of a series that was only converted are not known. `assumed` has sentences on what
    the numbers rest on.
    """

    material: Prony
    errors: Errors | None
    report: str
    figures: "dict[str, Figure]"
    assumed: tuple[str, ...] = ()


def fitted_files(
    moduli_files: Sequence[Path], column, unit, temperature, kind, *, sheet, step,
    glassy: float | None, poisson: float | None, equilibrium: float | None, **arguments: Any,
) -> tuple[MaterialFit, list[float]]:  # fmt: skip
    """Returns the fit to moduli, or the Prony series in a file, and the temperatures [K] if known.

    `arguments` are of `fitted`.
    """
    ratio = 0.5 if poisson is None else poisson
    try:
        if "series" in (kind or []):
            raise ValueError("`--kind series` is refused: no file, or not one alone, holds one.")
        measured = read_measured(
            moduli_files, column, unit, temperature, kind, poisson=ratio, sheet=sheet, step=step
        )
    except ValueError:
        if len(moduli_files) > 1:
            raise
        kinds = moduli_options.kinds_of(kind)
        options = Options(
            units=moduli_options.keys_and_values("unit", unit), poisson=poisson, sheet=sheet,
            deformation=kinds.get("deformation"), glassy=glassy, equilibrium=equilibrium,
        )  # fmt: skip
        read = prony_in(moduli_files[0], options, "series" if "doubtful" in kinds else "refused")
        if read is None:
            raise
        series, log = read
        print_history(log.history, log.assumed)
        report = "The file holds a Prony series: nothing is fitted."
        return MaterialFit(series, None, report, {}, tuple(log.assumed)), []
    if glassy is not None:
        raise ValueError("`glassy` is refused: it is for the ratios of a Prony series.")
    found = fitted(measured, poisson=ratio, equilibrium=equilibrium, **arguments)
    caveats = "".join(
        f"\nWarning: {moduli_options.in_options(sentence)}" for sentence in measured.assumed
    )
    means = [part.temperature for part in measured.isotherms() if part.temperature is not None]
    assumed = *measured.assumed, *found.assumed
    found = found._replace(report=found.report + caveats, assumed=assumed)
    return found, [float(np.mean(part)) for part in means]


def scene_table(found: MaterialFit, name: str) -> str:
    """Returns the table [materials.NAME] of a scene, with what the numbers rest on."""
    lines, told = export_prony(found.material, "toml", name=name), []
    for sentence in found.assumed:
        spelt = moduli_options.in_options(sentence)
        # A scene takes no options: its reader has to know whose they are.
        whose = "" if spelt == sentence else " These are options of `graded-contact fit` and `new`."
        told.append(spelt + whose)
    return lines + f"assumed = {entry_text(told)}\n" * bool(told)


def fitted(measured: Measured, law: str, **arguments: Any) -> MaterialFit:
    """Fits one isotherm by a series, and several by a master curve; these take `arguments`."""
    isotherms, kind = measured.isotherms(), measured.kind
    if len(isotherms) == 1:
        for name in ("shift_std", "vertical_shift_std"):
            arguments.pop(name, None)
        found = fit_prony(measured.abscissa, measured.values, kind=kind, **arguments)
        errors = errors_of_fit(found, found.material)
        return MaterialFit(found.material, errors, found.report(), {"": plot_fit(found)})
    curve = master_curve(isotherms, law=law, **arguments)
    figures = {"": plot_master_curve(curve)}
    material = curve.exported()
    errors = errors_of_fit(curve, material)
    return MaterialFit(material, errors, curve.report(), figures, curve.warnings())


def write_fit(stem: Path, found: MaterialFit, cards: Sequence[str]) -> None:
    """Prints the report and the table for a scene, and writes files that begin with `stem`."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    table = scene_table(found, stem.name)
    typer.echo(f"\n{found.report}\n\n{table}")
    for card in cards:
        ending, comment = CARDS[card]
        path = f"{stem}{ending}"
        caveats = "".join(f"{in_comment(f'Warning: {each}', comment)}\n" for each in found.assumed)
        try:
            exported = export_prony(found.material, card, name=stem.name)
            write_whole(path, table if card == "toml" else caveats + exported)
            typer.echo(f"wrote {path}")
        except ValueError as error:
            typer.echo(f"no {path}: {error}")
    if found.errors is not None:
        write_errors(f"{stem}-errors.csv", found.errors)
        typer.echo(f"wrote {stem}-errors.csv")
    for ending, figure in found.figures.items():
        save_figure(figure, Path(f"{stem}{ending}.png"), "png")
