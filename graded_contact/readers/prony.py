"""Prony series from files: tables of modes, decks of Abaqus and Ansys, tables of a scene."""

import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.checks import Numbers, as_scalar, check_poisson, check_positive
from ..core.files import Refusal
from ..materials.material import Prony
from .cells import TABLE_BYTES
from .decisions import Log, Options
from .modes import modes_on
from .registry import READERS, File, find_readers, opening, read_as
from .series import Doubt, Modes, material_of_series


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
    numbers = {"glassy": glassy, "equilibrium": equilibrium, "poisson": poisson}
    given: dict[str, Any] = {
        name: None if x is None else float(as_scalar(x, name)) for name, x in numbers.items()
    }
    options = Options(units=units or {}, deformation=deformation, sheet=sheet, **given)
    found = prony_in(path, options, "series")
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
    path: str | os.PathLike, options: Options, doubtful: Doubt
) -> tuple[Prony, Log] | None:
    """Returns the Prony series in a file with the log of the reading, None for another file.

    `doubtful` says what a table is that may hold E(t) as well.
    """
    if options.glassy is not None:
        check_positive("glassy", options.glassy, "[Pa]")
    if options.poisson is not None:
        check_poisson("poisson", options.poisson)
    with opening(path, TABLE_BYTES) as file:
        series = written_series(file)
        if series is None:
            found = {each.name: modes_on(each, doubtful) for each in read_as(file, "moduli")}
            series = {name: each for name, each in found.items() if each is not None}
            if not series or (options.sheet is not None and options.sheet not in series):
                return None
        name = options.sheet
        if name is None and len(series) == 1:
            name = next(iter(series))
        if name is None or name not in series:
            known = f"it holds Prony series named {list(series)}"
            raise Refusal(f"{known}: pass one of them as `sheet`")
        log = series[name].log
        log.begin(f"{Path(path).name} holds a Prony series: {series[name].layout}.")
        try:
            return material_of_series(series[name], options), log
        except ValueError as error:
            raise Refusal(str(error)) from None


def written_series(file: File) -> dict[str, Modes] | None:
    """Returns the Prony series in a deck or a scene by the names of their materials, else None."""
    find_readers()
    known = any(each.knows(file) for each in READERS["prony"])
    return read_as(file, "prony") if known else None
