"""Measured moduli and compliances from files of rheometers, DMAs and spreadsheets.

Whatever a file says about its columns, units and temperatures is used; what it leaves open is
asked for. Only a frequency without a unit goes by its name (f is in Hz, omega in rad/s), and a
modulus that is not called one of shear is Young's. What was understood is recorded, in sentences,
in `Measured.history`.
"""

import contextlib
import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.checks import Numbers, check_poisson, check_positive, check_types
from .cells import Sheet, holds_data, is_number, read_sheets
from .layout import KINDS, Layout, Told
from .measured import Measured, apart, joined
from .points import measured_points
from .quantities import DIMENSIONS, OFFSETS, UNITS, parse_unit
from .steps import rank, understand
from .titles import parameters

DEFORMATIONS = ("tension", "shear")

# RepTate's manual fixes the order and units of the columns by the ending of the file, and which
# parameter of its first line is the constant load.
_UNSAID = {".gt": 1.0}  # a strain that is not said: the second column is a modulus
_SWEEP = {"frequency": "rad/s", "storage": "Pa", "loss": "Pa"}
_REPTATE = {
    ".tts": ("frequency", _SWEEP, ""),
    ".osc": ("frequency", _SWEEP, ""),
    ".gt": ("relaxation", {"time": "s", "stress": "Pa"}, "gamma"),
    ".creep": ("creep", {"time": "s", "strain": "1"}, "stress"),
}


@check_types
def read_moduli(
    path: str | os.PathLike | Sequence[str | os.PathLike],
    *,
    kind: str | None = None,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    deformation: str | None = None,
    poisson: Numbers | None = None,
    temperature: Numbers | None = None,
    sheet: str | None = None,
    step: str | int | Sequence[str | int] | None = None,
) -> Measured:
    """Returns the moduli or compliances that a file holds, or several files of one material.

    Understood are text with commas, semicolons, tabs or spaces, with decimal points or commas, and
    Excel workbooks (the extra `io`); a line of names, such as "f, E', tan delta", "Storage modulus
    [MPa]", "log10 G'" or "G_loss_pa", and one of units below it; several isotherms below one
    another, told apart by a column of temperature (steps above 1 K) or by "25 °C" above each, side
    by side, or on several sheets; creep and relaxation as columns of stress and strain; rows in any
    order; missing values; RepTate's `.tts`, `.osc`, `.gt` and `.creep`. A row that cannot be used
    is left out. Every argument but the first overrides what the file says.

    **Arguments:**

    - `path`: the file, or a list of files: each holds isotherms, or all parts of one.
    - `kind`: "frequency", "relaxation" or "creep"; of a file without telling names it also sets
      their order: frequency, storage, loss; time, modulus; time, compliance.
    - `columns`: which column, by name or by number from 1, is the "frequency", "time",
      "temperature", "storage", "loss", "magnitude", "tan_delta", "phase", "modulus" (relaxation),
      "compliance", "stress" or "strain".
    - `units`: of "frequency", "time", "modulus", "compliance", "temperature", "angle", "ratio",
      "stress", "strain": one of `rheology.files.quantities.UNITS`.
    - `deformation`: "tension" (E) or "shear" (G).
    - `poisson`: Poisson's ratio ν, to turn shear into tension by E = 2(1 + ν)G.
    - `temperature`: [K], of the whole file or of each of its curves; of each of several files.
    - `sheet`: of a workbook.
    - `step`: of a test of several steps: numbers from 1, or titles or parts of them. By default
      steps at one frequency are left out where others sweep the frequency.

    A missing file raises `FileNotFoundError`; what cannot be understood `ValueError`, naming the
    file, the line and the arguments that would settle it.

    **Returns:** isotherms with what was understood of the files, see `Measured`.
    """
    paths = _paths(path)
    told = _told(kind, columns or {}, units or {}, deformation, temperature is not None, step)
    poisson = None if poisson is None else _numbers("poisson", poisson, 0)
    temperature = None if temperature is None else _numbers("temperature", temperature, 1)
    if poisson is not None:
        check_poisson("poisson", poisson)
    if temperature is not None:
        check_positive("temperature", temperature, "[K]")
    if len(paths) == 1:
        return _read(paths[0], told, poisson, temperature, sheet)
    each = _one_each(temperature, len(paths), "files")
    return joined(
        [_read(file, told, poisson, t, sheet) for file, t in zip(paths, each, strict=True)]
    )


def _paths(path: Any) -> list[Path]:
    paths = [path] if isinstance(path, str | os.PathLike) else path
    if not isinstance(paths, list | tuple) or not paths:
        raise ValueError(f"`path={path!r}` must be the name of a file, or a list of them.")
    if not all(isinstance(each, str | os.PathLike) for each in paths):
        raise ValueError(f"`path={path!r}` must be the name of a file, or a list of them.")
    return list(map(Path, paths))


def _numbers(name: str, value: Any, most: int) -> np.ndarray:
    """The value as an array of at most so many axes."""
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        array = None
    if array is None or array.ndim > most:
        wanted = "a number or a list of numbers" if most else "a number"
        raise ValueError(f"`{name}={value!r}` is refused: it must be {wanted}.") from None
    return array


def _one_each(temperature: Numbers | None, count: int, what: str) -> list[Numbers | None]:
    if temperature is None:
        return [None] * count
    kelvin = np.asarray(temperature)
    if kelvin.shape not in ((), (count,)):
        raise ValueError(
            f"`temperature` has shape {kelvin.shape}; one number is needed, or one for each of the "
            f"{count} {what}."
        )
    return list(np.broadcast_to(kelvin, count))


def _read(
    path: Path, told: Told, poisson: Numbers | None, temperature: Numbers | None, name: str | None
) -> Measured:
    """What one file holds."""
    sheets = read_sheets(path)
    with _naming(path):
        if path.suffix.lower() in _REPTATE:
            told, temperature, sheets = _as_reptate(path.suffix.lower(), told, temperature, sheets)
        if name is not None:
            sheets = _named(sheets, name)
        understood = _understood(sheets, told)
        each: list[Numbers | None] = [temperature] * len(understood)
        if len(understood) > 1 and temperature is not None and np.ndim(temperature) == 1:
            each = _one_each(temperature, len(understood), "sheets")
        parts = []
        for (sheet, layout), kelvin in zip(understood, each, strict=True):
            rows = sum(len(segment.data) for segment in layout.segments)
            notes = [f"Read {rows} rows of {path.name}, {sheet.layout}."]
            points = measured_points(layout, poisson, kelvin, notes)
            if layout.unused:
                notes.append(f"Not used: {', '.join(map(repr, layout.unused))}.")
            parts.append(
                Measured(kind=layout.kind, path=path, history=tuple(notes), **points._asdict())
            )
        names = [sheet.name for sheet, _ in understood]
        if len(parts) > 1 and not apart(parts):
            raise ValueError(
                f"the sheets {names} hold tables alike, not of different temperatures; pass `sheet`"
            )
        left = [repr(sheet.name) for sheet in sheets if sheet.name not in names]
        notes = [f"Left out the sheets {', '.join(left)}."] if left else []
        whole = joined(parts) if len(parts) > 1 else parts[0]
        return dataclasses.replace(whole, history=(*whole.history, *notes))


def _told(
    kind: str | None,
    columns: Mapping[str, str | int],
    units: Mapping[str, str],
    deformation: str | None,
    temperature: bool,
    step: str | int | Sequence[str | int] | None,
) -> Told:
    choices = {"kind": (kind, KINDS), "deformation": (deformation, DEFORMATIONS)}
    for name, (value, allowed) in choices.items():
        if value is not None and value not in allowed:
            raise ValueError(f"`{name}={value!r}` is refused: use one of {allowed}.")
    for name, mapping in (("columns", columns), ("units", units)):
        if not isinstance(mapping, Mapping):
            raise ValueError(f"`{name}={mapping!r}` must be a dictionary.")
    for quantity in columns:
        if quantity not in DIMENSIONS:
            raise ValueError(
                f"`columns` has the key {quantity!r}; the quantities are {tuple(DIMENSIONS)}."
            )
    for dimension, unit in units.items():
        if dimension not in UNITS:
            raise ValueError(f"`units` has the key {dimension!r}; use one of {tuple(UNITS)}.")
        if not isinstance(unit, str) or unit not in UNITS[dimension]:
            raise ValueError(
                f"`units`: {unit!r} of the {dimension} is refused; use one of "
                f"{tuple(UNITS[dimension])}."
            )
    chosen = () if step is None else (step,) if isinstance(step, str | int) else tuple(step)
    return Told(kind, columns, units, deformation, temperature, chosen)


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(f"`path={path}`: {str(error).rstrip('.')}.") from None


def _as_reptate(
    suffix: str, told: Told, temperature: Numbers | None, sheets: list[Sheet]
) -> tuple[Told, Numbers | None, list[Sheet]]:
    """What RepTate's formats fix; temperature [°C] and load stand in the first line."""
    kind, columns, load = _REPTATE[suffix]
    rows = sheets[0].rows
    given = parameters(rows[0]) if rows else {}
    if temperature is None and is_number(given.get("T", "")):
        temperature = float(given["T"]) + OFFSETS["C"]
    said = [[parse_unit(cell) for cell in row.cells[: len(columns)]] for row in rows[1:4]]
    own = next((units for units in said if len(units) == len(columns) and all(units)), None)
    units = own or columns.values()
    if not told.columns:  # others may follow, without a name, or be missing
        rows = [row._replace(cells=row.cells[: len(columns)]) for row in rows if holds_data(row)]
    told = dataclasses.replace(
        told,
        kind=told.kind or kind,
        columns=told.columns or {quantity: i + 1 for i, quantity in enumerate(columns)},
        units={
            **{DIMENSIONS[name]: str(unit) for name, unit in zip(columns, units, strict=True)},
            **told.units,
        },
        deformation=told.deformation or "shear",
        temperature=temperature is not None,
        held=float(given[load]) if is_number(given.get(load, "")) else _UNSAID.get(suffix),
        source="as told" if told.units else "as the file says" if own else "as in all of RepTate's",
    )
    return told, temperature, [sheets[0]._replace(rows=rows)]


def _named(sheets: list[Sheet], name: str) -> list[Sheet]:
    names = [sheet.name for sheet in sheets]
    if name not in names:
        raise ValueError(f"there is no `sheet={name!r}`, only {names}")
    return [sheets[names.index(name)]]


def _understood(sheets: list[Sheet], told: Told) -> list[tuple[Sheet, Layout]]:
    """The sheet that ranks first of those understood, and those alike, in their order."""
    found, refusals = [], []
    for sheet in sheets:
        try:
            found.append((sheet, understand(sheet, told)))
        except ValueError as error:
            refusals.append(f"sheet {sheet.name!r}: {error}" if sheet.name else str(error))
    if not found:
        raise ValueError("; ".join(refusals))

    def columns(layout: Layout) -> tuple:
        return layout.kind, layout.columns, layout.blocks, layout.width

    _, first = max(found, key=lambda pair: rank(pair[1]))
    alike = columns(first), rank(first)[0]
    return [pair for pair in found if (columns(pair[1]), rank(pair[1])[0]) == alike]
