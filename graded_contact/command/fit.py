"""The job `fit`: measured moduli as the material of a scene."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from ..exports.prony_cards import export_prony
from ..fitting import fit_prony, master_curve
from ..plot import plot_fit, plot_master_curve
from ..readers import read_moduli
from .run import refusing

Pairs = Annotated[list[str] | None, typer.Option(metavar="QUANTITY=...", help="May be repeated.")]


def fit(
    moduli_files: Annotated[list[Path], typer.Argument(metavar="FILE...")],
    output: Annotated[Path | None, typer.Option("--output", "-o")] = None,
    terms: Annotated[int | None, typer.Option(help="Number of terms (default: by BIC).")] = None,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio.")] = 0.5,
    law: Annotated[Literal["wlf", "arrhenius"], typer.Option(help="Shift of isotherms.")] = "wlf",
    deformation: Annotated[
        Literal["tension", "shear"] | None, typer.Option(help="Of the measurement.")
    ] = None,
    temperature: Annotated[
        list[float] | None, typer.Option(help="Of each file [K]; may be repeated.")
    ] = None,
    unit: Pairs = None,
    column: Pairs = None,
) -> None:
    """Fits a Prony series to measured moduli: a table for a scene, and a figure."""
    given = {"deformation": deformation, "temperature": temperature or None}
    with refusing():
        measured = read_moduli(
            moduli_files, poisson=poisson, units=_pairs(unit), columns=_pairs(column), **given
        )
        isotherms = measured.isotherms()
        found: Any
        if len(isotherms) == 1:
            kind = measured.kind
            x, values = measured.abscissa, measured.values
            found = fit_prony(x, values, kind=kind, terms=terms, poisson=poisson)
            material, figure = found.material, plot_fit(found)
        else:
            found = master_curve(isotherms, law=law, terms=terms, poisson=poisson)
            material, figure = found.exported(), plot_master_curve(found)
        name = moduli_files[0].stem
        folder = output or Path(f"{name}-fit")
        folder.mkdir(parents=True, exist_ok=True)
        table = export_prony(material, "toml", name=name)
        (folder / f"{name}.toml").write_text(table, "utf-8")
        figure.savefig(folder / f"{name}.png")
    print(*measured.history, found.report(), table, f"wrote {folder}", sep="\n")


def _pairs(texts: list[str] | None) -> dict[str, str | int] | None:
    """The keys and values of an option that is given as KEY=VALUE."""
    found = (text.partition("=") for text in texts or ())
    return {key: int(at) if at.isdecimal() else at for key, _, at in found} or None
