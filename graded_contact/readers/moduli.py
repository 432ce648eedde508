"""Measured moduli and compliances from files of rheometers, DMAs and spreadsheets.

Columns, units and temperatures that the file names are used; an error lists what is missing. Two
things are assumed, with a warning: a frequency that is not called angular is in Hz without a unit,
and a modulus is Young's if nothing in the file says tension or shear. `Measured.history` records,
in sentences, what was understood, `Measured.assumed` what was assumed.

    a file ──> Sheet (rows of cells) ──> DataTable (names, rows with their segment and step)
           ──> MeasuredTable (a frame of points in SI units, and what they are) ──> Measured
"""

import dataclasses
import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ..core.checks import Numbers, as_scalar, check_poisson, check_positive, short
from ..core.files import Refusal
from ..materials.measured import Measured, distinct, joined
from .cells import TABLE_BYTES, Sheet, holds_data
from .columns import MeasuredTable, Unclear
from .decisions import Options
from .modes import modes_on
from .points import measured_points, one_each
from .prony import written_series
from .registry import opening, read_as
from .series import SERIES
from .steps import rank, understand
from .units import DIMENSIONS, UNITS
from .ways import ALL_WAYS


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
    workbooks (the extra `io`); the JSON of TRIOS; RepTate's `.tts`, `.osc`, `.gt` and `.creep`.
    Columns have a line of names, such as "f, E', tan delta", "Storage modulus [MPa]", "log10 G'",
    "J'' [1/MPa]", "Period [s]" or "G_loss_pa", and may have a line of units below it. Several
    isotherms may be in one table with a column of temperature (steps above 1 K), below one another
    with "25 °C" above each, side by side with "25 °C" above their columns, or on several sheets.
    Creep and relaxation may be columns of stress and strain; a constant stress may be in a line
    above the table ("stress: 2 kPa"). Rows may be in any order. A row that cannot be used is left
    out and reported. An argument fills what the file leaves open, and corrects a unit by one of its
    kind; it never overrides what the file states of another kind.

    **Arguments:**

    - `path`: the file, or a list of files: each holds isotherms, or all parts of one.
    - `kind`: "frequency", "relaxation" or "creep"; for a file without names it also sets the order
      of the columns: frequency, storage, loss; time, modulus; time, compliance.
    - `columns`: which column, by name or by number from 1, is the "frequency", "time",
      "temperature", "storage", "loss", "magnitude", "tan_delta", "phase", "storage_compliance",
      "loss_compliance", "compliance_magnitude", "modulus" (relaxation), "compliance" (creep),
      "stress" or "strain".
    - `units`: of "frequency", "time", "modulus", "compliance", "temperature", "angle", "ratio",
      "stress", "strain", such as "MPa".
    - `deformation`: "tension" (E) or "shear" (G).
    - `poisson`: Poisson's ratio ν, to convert shear to tension by E = 2(1 + ν)G.
    - `temperature`: [K], of the whole file or of each of its curves; of each of several files.
    - `sheet`: of a workbook.
    - `step`: of a test of several steps: numbers from 1, or titles or parts of them. By default
      steps at one frequency are left out if others sweep the frequency.

    **Returns:** isotherms, with a history of the reading and what was assumed, see `Measured`.

    **Raises:** `FileNotFoundError` for a missing file; `ValueError` for a file that is not
    understood, naming the line and the arguments that would help, and for a table of other numbers,
    such as a Prony series, by its name.
    """
    paths = [path] if isinstance(path, str | os.PathLike) else path
    named = isinstance(paths, list | tuple) and len(paths) > 0
    if not named or not all(isinstance(each, str | os.PathLike) for each in paths):
        raise ValueError(f"`path={path!r}` must be the name of a file, or a list of them.")
    if poisson is not None:
        poisson = float(as_scalar(poisson, "poisson"))
        check_poisson("poisson", poisson)
    if temperature is not None:
        try:
            temperature = np.asarray(temperature, float)
        except (TypeError, ValueError):
            words = f"`temperature={short(temperature)}` is refused: numbers [K] are needed."
            raise ValueError(words) from None
        check_positive("temperature", temperature, "[K]")
    options = _checked_options(columns, units, sheet, step, kind, deformation)
    options = dataclasses.replace(options, poisson=poisson)
    each = [temperature] if len(paths) == 1 else one_each(temperature, len(paths), "files")
    parts = [
        _moduli_in(Path(file), dataclasses.replace(options, temperature=kelvin))
        for file, kelvin in zip(paths, each, strict=True)
    ]
    return parts[0] if len(parts) == 1 else joined(parts)


_REACHED = 0.9  # of a strain reached before: amplitudes that are measured scatter


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
    options = dataclasses.replace(_checked_options(columns, units, sheet, step), kind="strain")
    sweep = _moduli_in(Path(path), options)
    strains = sweep.abscissa[np.argsort(sweep.lines)]
    strains = strains if strains[0] < strains[-1] else strains[::-1]
    back = np.any(strains < _REACHED * np.maximum.accumulate(strains))
    if back or len(np.unique(strains)) < len(strains) or np.max(sweep.isotherm) > 0:
        reason = (
            "its strains go up and down: choose one curve by `step`, or write one file for each"
        )
        raise ValueError(f"`path={path}`: {reason}.")
    return sweep


def _checked_options(columns, units, sheet, step, kind=None, deformation=None) -> Options:
    """The arguments of `read_moduli`, checked."""
    columns, units = columns or {}, units or {}
    checks: list[tuple[str, Any, Any, Any]] = [  # name, value, the part to check, what is allowed
        ("kind", kind, kind, tuple(dict.fromkeys(way.kind for way in ALL_WAYS))),
        ("deformation", deformation, deformation, ("tension", "shear")),
        *(("columns", {key: name}, key, DIMENSIONS) for key, name in columns.items()),
        *(("units", {key: unit}, key, UNITS) for key, unit in units.items()),
        *(("units", {key: unit}, unit, UNITS.get(key, ())) for key, unit in units.items()),
    ]
    for name, value, given, allowed in checks:
        if given is not None and (not isinstance(given, str) or given not in allowed):
            raise ValueError(f"`{name}={short(value)}` is refused: use one of {list(allowed)}.")
    steps = [] if step is None else step if isinstance(step, list | tuple) else [step]
    if not all(isinstance(each, str | int) for each in steps):
        raise ValueError(f"`step={short(step)}` must be a number or a title, or a list of them.")
    source = "as given in `units`" if units else ""
    return Options(kind, columns, units, deformation, sheet=sheet, step=tuple(steps), source=source)


def _moduli_in(path: Path, options: Options) -> Measured:
    """The measurements in one file."""
    with opening(path, TABLE_BYTES) as file:
        if written_series(file) is not None:
            raise Refusal(SERIES)
        sheets: list[Sheet] = read_as(file, "moduli")
    try:
        lines = [row.text for sheet in sheets for row in sheet.rows if not holds_data(row)]
        names = [sheet.name for sheet in sheets]
        if options.sheet is not None:
            if options.sheet not in names:
                raise ValueError(f"there is no `sheet={options.sheet!r}`, only {names}")
            sheets = [sheets[names.index(options.sheet)]]
        understood = _sheets_understood(sheets, options)
        if len(understood) > 1:  # otherwise there may be one temperature for each curve
            kelvins = one_each(options.temperature, len(understood), "sheets")
            each = [dataclasses.replace(options, temperature=kelvin) for kelvin in kelvins]
            pairs = zip(understood, each, strict=True)
            understood = [(sheet, table._replace(options=own)) for (sheet, table), own in pairs]
        parts = []
        for sheet, measured in understood:
            rows = f"Read {measured.num_rows} rows of {path.name}, {sheet.layout}."
            measured.log.begin(rows)
            parts.append(measured_points(path, measured, lines))
        names = [sheet.name for sheet, _ in understood]
        if len(parts) > 1 and not distinct(parts):
            same = "have similar tables at one temperature"
            raise ValueError(f"the sheets {names} {same}; pass `sheet`")
    except ValueError as error:
        raise ValueError(f"`path={path}`: {str(error).rstrip('.')}.") from None
    whole = joined(parts) if len(parts) > 1 else parts[0]
    left = ", ".join(repr(sheet.name) for sheet in sheets if sheet.name not in names)
    notes = [f"Left out the sheets {left}."] * bool(left)
    return dataclasses.replace(whole, history=(*whole.history, *notes))


def _sheets_understood(sheets: list[Sheet], options: Options) -> list[tuple[Sheet, MeasuredTable]]:
    """The sheet that ranks first of those understood, and those of the same columns, in order."""
    found, refusals = [], {}
    for sheet in sheets:
        try:
            found.append((sheet, _moduli_on(sheet, options)))
        except ValueError as error:
            refusals[sheet.name] = error
    swept = [name for name, error in refusals.items() if isinstance(error, Unclear)]
    if not found and swept and len(sheets) > 1:
        names = " or ".join(f"`sheet={name!r}`" for name in swept)
        raise ValueError(f"pass {names}, which holds a sweep; {refusals[swept[0]]}")
    if not found:
        words = (f"sheet {name!r}: " * bool(name) + str(refusals[name]) for name in refusals)
        raise ValueError("; ".join(words))

    def key(measured: MeasuredTable) -> tuple:
        table, (sweep, _) = measured.table, rank(measured)
        return measured.kind, measured.columns, table.blocks, len(table.names), sweep

    _, first = max(found, key=lambda pair: rank(pair[1]))
    return [pair for pair in found if key(pair[1]) == key(first)]


def _moduli_on(sheet: Sheet, options: Options) -> MeasuredTable:
    """The moduli on a sheet; raises `ValueError` for a Prony series, by its name."""
    if sheet.fixed.columns and not options.columns:  # others may follow, without a name
        sheet = sheet.numbers_only(len(sheet.fixed.columns))
    options = options.completed(sheet.fixed)
    measured, refusal = None, ValueError()
    try:
        measured = understand(sheet, options)
    except ValueError as error:
        refusal = error
    # A table that may be either is what the user says by `columns`.
    doubtful = "moduli" if options.columns else "refused"
    other = measured is None or measured.kind in ("relaxation", "creep")
    if other and modes_on(sheet, doubtful) is not None:
        raise ValueError(SERIES)
    if measured is None:
        raise refusal
    return measured
