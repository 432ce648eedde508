"""Prony series from files: tables of modes, decks of Abaqus and Ansys, tables of a scene."""

import logging
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..core.checks import Numbers, as_scalar, check_poisson, check_positive, check_types
from ..core.files import Refusal
from ..materials.material import Prony
from .cells import LARGEST, Sheet
from .decisions import Log
from .modes import modes_on
from .registry import READERS, File, find_readers, opened, read
from .series import SERIES, Doubt, Series, material_of


@check_types
def read_prony(
    path: str | os.PathLike,
    *,
    units: Mapping[str, str] | None = None,
    glassy: Numbers | None = None,
    equilibrium: Numbers | None = None,
    deformation: str | None = None,
    poisson: Numbers | None = None,
    sheet: str | None = None,
) -> Prony:
    """Returns the material of a Prony series in a file.

    Files: tables of relaxation times and moduli (τ_i, E_i or G_i) or ratios (g_i, α_i), as RepTate,
    pyvisco, IRIS and spreadsheets have them, a time "inf" for the equilibrium; decks of Abaqus
    (*ELASTIC or *HYPERELASTIC, *VISCOELASTIC with TIME=PRONY, *TRS) and of Ansys (MP, TB,PRONY,
    TB,SHIFT); the cards of `export_prony`. The log (`graded_contact`) has the history of the
    reading, with what was assumed as warnings.

    **Arguments:**

    - `path`: the file.
    - `units`: of "modulus" and "time", if the file states none, such as "MPa".
    - `glassy`: instantaneous modulus E_0 [Pa] of ratios, or `equilibrium`, if the file has neither.
    - `equilibrium`: long-time modulus E_eq [Pa] of a table of moduli or ratios; 0 for a liquid.
    - `deformation`: "tension" (E) or "shear" (G) of the moduli in the file.
    - `poisson`: Poisson's ratio ν; None for that of the file, or else 0.5. Moduli in shear become
      Young's moduli by E = 2(1 + ν)G.
    - `sheet`: of a workbook; the material of a deck or of a scene.

    **Returns:** the material.

    **Raises:** `FileNotFoundError`; `ValueError` for another file, or for a series that lacks a
    unit, a modulus or its deformation, with the argument that gives it.
    """
    options = (units, glassy, equilibrium, deformation, poisson, sheet)
    found = prony_in(path, *options, doubtful="series")
    if found is None:
        raise ValueError(
            f"`path={path}` is refused: it holds no Prony series, a table of relaxation times τ_i "
            "and moduli E_i (G_i) or ratios g_i, or a deck of Abaqus or Ansys."
        )
    material, log = found
    logger = logging.getLogger("graded_contact")
    for sentence in log.history:
        logger.log(logging.WARNING if sentence in log.assumed else logging.INFO, sentence)
    return material


def prony_in(
    path: str | os.PathLike,
    units: Mapping[str, str] | None = None,
    glassy: Numbers | None = None,
    equilibrium: Numbers | None = None,
    deformation: str | None = None,
    poisson: Numbers | None = None,
    sheet: str | None = None,
    *,
    doubtful: Doubt = "refused",
) -> tuple[Prony, Log] | None:
    """Returns the Prony series in a file with the log of the reading, None for another file.

    Arguments as in `read_prony`; `doubtful` says what a table is that may hold E(t) as well.
    """
    numbers = {"glassy": glassy, "equilibrium": equilibrium, "poisson": poisson}
    given = {name: None if x is None else float(as_scalar(x, name)) for name, x in numbers.items()}
    if given["glassy"] is not None:
        check_positive("glassy", given["glassy"], "[Pa]")
    if given["poisson"] is not None:
        check_poisson("poisson", given["poisson"])
    with opened(path, LARGEST) as file:
        series = series_in(file, sheet, doubtful)
        if series is None:
            return None
        log = Log()
        log.note(f"{Path(path).name} holds a Prony series: {series.layout}.")
        try:
            return material_of(series, log, dict(units or {}), deformation, **given), log
        except ValueError as error:
            raise Refusal(str(error)) from None


def series_in(file: File, sheet: str | None, doubtful: Doubt) -> Series | None:
    """Returns the Prony series that a file holds; None if it holds none."""
    find_readers()
    for reader in READERS["prony"]:
        if reader.knows(file):
            series: dict[str, Series] = read(file, "prony")
            return series[_chosen(sheet, series)]
    return series_of(read(file, "moduli").sheets, sheet, doubtful)


def check_no_series(file: File) -> None:
    """Raises `Refusal` for a deck, and for a table of a scene with a Prony series."""
    find_readers()
    if any(reader.knows(file) for reader in READERS["prony"]):
        read(file, "prony")  # which says what else the deck is
        raise Refusal(SERIES)


def series_of(sheets: Iterable[Sheet], sheet: str | None, doubtful: Doubt) -> Series | None:
    """Returns the Prony series on sheets, None if there is none; `doubtful` as in `prony_in`."""
    found = {each.name: modes_on(each, doubtful) for each in sheets}
    series = {name: each for name, each in found.items() if each is not None}
    if not series or (sheet is not None and sheet not in series):
        return None
    return series[_chosen(sheet, series)]


def _chosen(sheet: str | None, series: Mapping[str, Series]) -> str:
    """The name of the series to read."""
    if sheet is None and len(series) == 1:
        return next(iter(series))
    if sheet is None or sheet not in series:
        raise Refusal(f"it holds Prony series named {list(series)}: pass one of them as `sheet`")
    return sheet
