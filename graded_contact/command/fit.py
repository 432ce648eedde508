"""The job `fit`: measured moduli as a material of a scene."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from ..fitting.cards import toml_table
from ..fitting.master import master_curve
from ..fitting.prony import fit_prony
from ..plot import plot_fit, plot_master_curve
from ..readers import NotPlain, read_moduli
from .run import Output, refusing

Pairs = Annotated[list[str] | None, typer.Option(metavar="NAME=VALUE", help="May be repeated.")]


def fit(
    moduli_files: Annotated[list[Path], typer.Argument(metavar="FILE...")],
    output: Output = None,
    terms: Annotated[int | None, typer.Option(help="Number (default: lowest BIC).")] = None,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio.")] = 0.5,
    law: Annotated[
        Literal["wlf", "arrhenius", "table"], typer.Option(help="Of the shifts of isotherms.")
    ] = "wlf",
    deformation: Annotated[
        Literal["tension", "shear"] | None, typer.Option(help="Where the files do not say it.")
    ] = None,
    loss: Annotated[
        Literal["linear", "soft_l1"], typer.Option(help="soft_l1: values far off count less.")
    ] = "linear",
    temperature: Annotated[
        list[float] | None, typer.Option(help="Of all files, or of each [K].")
    ] = None,
    unit: Pairs = None,
    column: Pairs = None,
    layout: Pairs = None,
) -> None:
    """Fits a Prony series to files of a rheometer or DMA: a table for a scene, and a figure.

    Several temperatures are shifted into a master curve. `--unit`, `--column` and `--layout` are
    the arguments of `read_moduli`, such as `--unit modulus=MPa`.
    """
    kelvin = temperature[0] if temperature and len(temperature) == 1 else temperature
    with refusing():
        try:
            measured = read_moduli(
                moduli_files,
                columns=pairs("column", column),
                units=pairs("unit", unit),
                layout=pairs("layout", layout),
                deformation=deformation,
                poisson=poisson,
                temperature=kelvin,
            )
        except NotPlain as error:
            raise ValueError(error.with_remedy(f"Options to add: {error.flags}")) from error
        isotherms = measured.isotherms()
        given: dict[str, Any] = {"terms": terms, "poisson": poisson, "loss": loss}
        if len(isotherms) == 1:
            x, values = measured.abscissa, measured.values
            found = fit_prony(x, values, kind=measured.kind, **given)
            material, figure = found.material, plot_fit(found)
        else:
            found = master_curve(isotherms, law=law, **given)
            material, figure = found.exported(), plot_master_curve(found)
        name = moduli_files[0].stem
        table = toml_table(material, name)
        folder = output or Path(f"{name}-fit")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.toml").write_text(table, "utf-8")
        figure.savefig(folder / f"{name}.png")
    typer.echo("\n".join([*measured.history, found.report(), "", table, f"wrote {folder}"]))


def pairs(option: str, texts: list[str] | None) -> dict[str, Any] | None:
    """Returns the names and values of an option that is given as NAME=VALUE."""
    found = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"`--{option} {text}` must be NAME=VALUE.")
        found[name] = int(value) if value.isdecimal() else value.replace("\\t", "\t")
    return found or None
