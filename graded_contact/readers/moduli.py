"""Measured moduli and compliances from files of rheometers, DMAs and spreadsheets.

Columns, units and temperatures that the file names are used; an error lists what is missing. Only a
frequency without a unit goes by its name (f is in Hz, omega in rad/s), and a modulus is Young's
unless its name or another column implies shear. `Measured.history` records, in sentences, what was
understood.
"""

import contextlib
import dataclasses
import logging
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ..core.checks import Numbers, check_poisson, check_positive, check_types, short
from ..materials.measured import Measured, distinct, joined
from .cells import Sheet, holds_data, is_number, read_sheets
from .columns import WAYS, MeasuredTable, Options
from .isotherms import one_each
from .points import measured_points
from .steps import rank, understand
from .tables import parameters
from .units import DIMENSIONS, OFFSETS, UNITS, parse_unit

# RepTate's manual fixes the order and units of the columns by the ending of the file, and which
# parameter of its first line is the constant load.
_LOAD = {".gt": 1.0}  # without a strain the second column is a modulus
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
    """Returns the moduli or compliances in a file, or in several files of one material.

    Files: text with commas, semicolons, tabs or spaces, with decimal points or commas; Excel
    workbooks (the extra `io`); RepTate's `.tts`, `.osc`, `.gt` and `.creep`. Columns have a line of
    names, such as "f, E', tan delta", "Storage modulus [MPa]", "log10 G'" or "G_loss_pa", and may
    have a line of units below it. Several isotherms may be in one table with a column of
    temperature (steps above 1 K), below one another with "25 °C" above each, side by side, or on
    several sheets. Creep and relaxation may be columns of stress and strain. Rows may be in any
    order. A row that cannot be used is left out and reported. Every argument but the first
    overrides the file.

    **Arguments:**

    - `path`: the file, or a list of files: each holds isotherms, or all parts of one.
    - `kind`: "frequency", "relaxation" or "creep"; for a file without names it also sets the order
      of the columns: frequency, storage, loss; time, modulus; time, compliance.
    - `columns`: which column, by name or by number from 1, is the "frequency", "time",
      "temperature", "storage", "loss", "magnitude", "tan_delta", "phase", "modulus" (relaxation),
      "compliance", "stress" or "strain".
    - `units`: of "frequency", "time", "modulus", "compliance", "temperature", "angle", "ratio",
      "stress", "strain": one of `files.units.UNITS`.
    - `deformation`: "tension" (E) or "shear" (G).
    - `poisson`: Poisson's ratio ν, to convert shear to tension by E = 2(1 + ν)G.
    - `temperature`: [K], of the whole file or of each of its curves; of each of several files.
    - `sheet`: of a workbook.
    - `step`: of a test of several steps: numbers from 1, or titles or parts of them. By default
      steps at one frequency are left out if others sweep the frequency.

    **Returns:** isotherms, with a history of the reading, see `Measured`.

    **Raises:** `FileNotFoundError` for a missing file; `ValueError` for a file that is not
    understood, naming the line and the arguments that would help.
    """
    paths = [path] if isinstance(path, str | os.PathLike) else path
    if not isinstance(paths, list | tuple) or not paths or not all(
        isinstance(each, str | os.PathLike) for each in paths
    ):  # fmt: skip
        raise ValueError(f"`path={path!r}` must be the name of a file, or a list of them.")
    options = _options(kind, columns or {}, units or {}, deformation, temperature is not None, step)
    poisson = None if poisson is None else _numbers("poisson", poisson, 0)
    temperature = None if temperature is None else _numbers("temperature", temperature, 1)
    if poisson is not None:
        check_poisson("poisson", poisson)
    if temperature is not None:
        check_positive("temperature", temperature, "[K]")
    if len(paths) == 1:
        return _read(Path(paths[0]), options, poisson, temperature, sheet)
    each: list[Numbers | None] = [None] * len(paths)
    if temperature is not None:
        each = list(one_each(temperature, len(paths), "files"))
    return joined(
        [_read(Path(file), options, poisson, t, sheet)
         for file, t in zip(paths, each, strict=True)]
    )  # fmt: skip


_BACK = 0.9  # of a strain reached before: amplitudes that are measured scatter


@check_types
def read_strain_sweep(
    path: str | os.PathLike,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    sheet: str | None = None,
    step: str | int | Sequence[str | int] | None = None,
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Returns strain amplitudes ε [1] and the factors f of E' and g of E'' [1] in a strain sweep.

    They are what `materials.StrainSoftening` takes: `StrainSoftening(rubber, *read_strain_sweep(
    "sweep.csv"))`. The factors are relative to the smallest strain. Strains are those of the file:
    a peak-to-peak amplitude is to be halved (by `StrainSoftening(rubber, strain / 2, f, g)`).

    **Arguments:** as in `read_moduli`; columns of strain (% or 1), moduli in tension or shear.

    **Returns:** ε, f and g, in order of ε. The log (`graded_contact`, level INFO) has the history
    of the reading, with the rows that were left out.

    **Raises:** as `read_moduli`; also for several curves, for a sweep up and down, and for a
    varying frequency.
    """
    sweep = strain_sweep(path, columns, units, sheet, step)
    for sentence in sweep.history:
        logging.getLogger("graded_contact").info(sentence)
    parts = np.real(sweep.values), np.imag(sweep.values)
    return sweep.abscissa, *(part / part[0] for part in parts)


def strain_sweep(path, columns, units, sheet, step) -> Measured:
    """Returns the moduli over the strain amplitude [1], arguments as in `read_strain_sweep`."""
    options = _options(None, columns or {}, units or {}, None, True, step)
    options = dataclasses.replace(options, kind="strain")
    sweep = _read(Path(path), options, None, None, sheet)
    if np.max(sweep.isotherm) > 0:
        raise ValueError(f"`path={path}`: it has several curves; choose one by `step`.")
    strains = sweep.abscissa[np.argsort(sweep.lines)]
    strains = strains if strains[0] < strains[-1] else strains[::-1]
    back = np.any(strains < _BACK * np.maximum.accumulate(strains))
    if back or len(np.unique(strains)) < len(strains):
        raise ValueError(
            f"`path={path}`: its strains do not increase (or decrease) from row to row. Put "
            "several curves, or a sweep up and a sweep down, into separate files."
        )
    return sweep


def _numbers(name: str, value: Any, most: int) -> np.ndarray:
    """The value as an array of at most so many axes."""
    try:
        array = np.asarray(value, float)
    except (TypeError, ValueError):
        array = None
    if array is None or array.ndim > most:
        allowed = "a number or a list of numbers" if most else "a number"
        raise ValueError(f"`{name}={value!r}` is refused: it must be {allowed}.") from None
    return array


def _options(
    kind: str | None,
    columns: Mapping[str, str | int],
    units: Mapping[str, str],
    deformation: str | None,
    temperature: bool,
    step: str | int | Sequence[str | int] | None,
) -> Options:
    kinds = tuple(dict.fromkeys(kind for kind, _ in WAYS))
    choices = (("kind", kind, kinds), ("deformation", deformation, ("tension", "shear")))
    for name, value, allowed in choices:
        if value not in (None, *allowed):
            raise ValueError(f"`{name}={value!r}` is refused: use one of {allowed}.")
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
    steps: Any = [] if step is None else step if isinstance(step, list | tuple) else [step]
    if not all(isinstance(each, str | int) for each in steps):
        raise ValueError(f"`step={short(step)}` must be a number or a title, or a list of them.")
    return Options(kind, columns, units, deformation, temperature, tuple(steps))


def _read(
    path: Path,
    options: Options,
    poisson: Numbers | None,
    temperature: Numbers | None,
    name: str | None,
) -> Measured:
    """The measurements in one file."""
    sheets = read_sheets(path)
    with _naming(path):
        if path.suffix.lower() in _REPTATE:
            options, temperature, sheets = _as_reptate(path, options, temperature, sheets)
        if name is not None:
            names = [sheet.name for sheet in sheets]
            if name not in names:
                raise ValueError(f"there is no `sheet={name!r}`, only {names}")
            sheets = [sheets[names.index(name)]]
        understood = _understood(sheets, options)
        each: list[Numbers | None] = [temperature] * len(understood)
        if len(understood) > 1 and temperature is not None and np.ndim(temperature) == 1:
            each = list(one_each(temperature, len(understood), "sheets"))
        parts = []
        for (sheet, measured), kelvin in zip(understood, each, strict=True):
            notes = [f"Read {len(measured.table.rows)} rows of {path.name}, {sheet.layout}."]
            points = measured_points(path, measured, poisson, kelvin, notes)
            if measured.unused:
                notes.append(f"Not used: {', '.join(map(repr, measured.unused))}.")
            parts.append(dataclasses.replace(points, history=tuple(notes)))
        names = [sheet.name for sheet, _ in understood]
        if len(parts) > 1 and not distinct(parts):
            raise ValueError(
                f"the sheets {names} have similar tables of the same temperature; pass `sheet`"
            )
        whole = joined(parts) if len(parts) > 1 else parts[0]
        left = [repr(sheet.name) for sheet in sheets if sheet.name not in names]
        notes = [f"Left out the sheets {', '.join(left)}."] if left else []
        return dataclasses.replace(whole, history=(*whole.history, *notes))


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        raise ValueError(f"`path={path}`: {str(error).rstrip('.')}.") from None


def _as_reptate(
    path: Path, options: Options, temperature: Numbers | None, sheets: list[Sheet]
) -> tuple[Options, Numbers | None, list[Sheet]]:
    """What RepTate's formats fix; temperature [°C] and load are in the first line."""
    suffix = path.suffix.lower()
    kind, columns, load = _REPTATE[suffix]
    rows = sheets[0].rows
    given = parameters(rows[0]) if rows else {}
    if temperature is None and is_number(given.get("T", "")):
        temperature = float(given["T"]) + OFFSETS["C"]
    below = [[parse_unit(cell) for cell in row.cells[: len(columns)]] for row in rows[1:4]]
    own = next((units for units in below if len(units) == len(columns) and all(units)), None)
    units = zip(columns, own or columns.values(), strict=True)
    units = {DIMENSIONS[name]: str(unit) for name, unit in units}
    if any(unit not in UNITS[dimension] for dimension, unit in units.items()):
        raise ValueError(f"its columns must be {', '.join(columns)}, in this order; pass `columns`")
    if not options.columns:  # others may follow, without a name, or be missing
        rows = [row._replace(cells=row.cells[: len(columns)]) for row in rows if holds_data(row)]
    usual = "as in the file" if own else "as in all of RepTate's"
    options = dataclasses.replace(
        options,
        kind=options.kind or kind,
        columns=options.columns or {quantity: i + 1 for i, quantity in enumerate(columns)},
        units={**units, **options.units},
        deformation=options.deformation or "shear",
        temperature=temperature is not None,
        load=float(given[load]) if is_number(given.get(load, "")) else _LOAD.get(suffix),
        source=options.source if options.units else usual,
    )
    return options, temperature, [sheets[0]._replace(rows=rows)]


def _understood(sheets: list[Sheet], options: Options) -> list[tuple[Sheet, MeasuredTable]]:
    """The sheet that ranks first of those understood, and those of the same columns, in order."""
    found, refusals = [], []
    for sheet in sheets:
        try:
            found.append((sheet, understand(sheet, options)))
        except ValueError as error:
            refusals.append(f"sheet {sheet.name!r}: {error}" if sheet.name else str(error))
    if not found:
        raise ValueError("; ".join(refusals))

    def key(measured: MeasuredTable) -> tuple:
        table = measured.table
        columns = (measured.kind, measured.columns, table.blocks, len(table.names))
        return columns, rank(measured)[0]

    _, first = max(found, key=lambda pair: rank(pair[1]))
    return [pair for pair in found if key(pair[1]) == key(first)]
