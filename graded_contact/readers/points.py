"""From the columns of a table to moduli in SI units, point by point, and their isotherms.

Each function adds to `notes` what it understood or did, in sentences; every row that is left out is
reported, with the reason.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..materials.measured import Measured
from .cells import is_missing
from .columns import CONSTANT, SAME, MeasuredTable
from .isotherms import curve_temperatures, note_isotherms, numbered
from .tables import LIMIT, Column
from .units import DIMENSIONS, SI

if TYPE_CHECKING:
    import pandas as pd

CREDIBLE = (1e2, 1e12)  # Pa
# What numbers can be, in SI units: instruments write 9.9e37 and the like where they measured none.
LIMITS = {"modulus": 1e30, "stress": 1e30, "compliance": 1e30}
HOTTEST = 1e4  # K


def measured_points(path: Path, measured: MeasuredTable, poisson, temperature) -> Measured:
    """Returns the points of a table; `poisson` and `temperature` as in `read_moduli`."""
    kind, notes = measured.kind, measured.notes
    entries = _entries(measured)
    kelvin = curve_temperatures(measured, entries, temperature)
    if kelvin is not None:
        entries["temperature"] = kelvin
    entries["isotherm"] = numbered(entries, separate=measured.table.blocks > 1)
    entries = _at_constant_load(measured, entries)
    if len(entries) < (total := len(measured.table.rows) * measured.table.blocks):
        notes.append(f"{len(entries)} of {total} points are used.")
    values = _moduli(measured, {name: entries[name].to_numpy() for name in measured.columns})
    stiffness = 1 / values if kind == "creep" else values.real
    odd = (stiffness < CREDIBLE[0]) | (stiffness > CREDIBLE[1])
    if np.any(odd):
        where = _listed([(line, "") for line in np.unique(entries["line"][odd]).tolist()])
        span = f"moduli from {np.min(stiffness):.3g} to {np.max(stiffness):.3g} Pa"
        notes.append(f"Warning: {span} are unusual in line {where}: is the unit right?")
    if measured.check is not None:
        notes.append(_tan_delta_note(measured.check.label, entries, values))
    deformation, factor = _deformation(measured, poisson)
    values = values / factor if kind == "creep" else factor * values
    # Stable: points that repeat a frequency keep the order of the file.
    order = np.lexsort((entries["abscissa"], entries["isotherm"]))
    entries, values = entries.iloc[order], values[order]
    note_isotherms(measured, entries)
    if measured.table.blocks == 1 and np.any(np.diff(entries["line"]) < 0):
        notes.append("Sorted the rows.")
    _check_abscissa(measured, entries, values)
    if measured.unused:
        notes.append(f"Not used: {', '.join(map(repr, dict.fromkeys(measured.unused)))}.")
    names = ("abscissa", "isotherm", "line")
    abscissa, isotherm, lines = (np.array(entries[name]) for name in names)
    kelvin = None if kelvin is None else np.array(entries["temperature"])
    return Measured(
        kind, deformation, abscissa, values, kelvin, isotherm, lines, path, tuple(notes)
    )


# Rows to numbers.


def _entries(measured: MeasuredTable) -> "pd.DataFrame":
    """The numbers in SI units by quantity, with the abscissa, curve and line of each point."""
    import pandas as pd

    table, check = measured.table, measured.check
    found, unusable = [], 0
    left: dict[str, list[tuple[int, str]]] = {}  # reason: lines, each with its cell
    for curve, row, cells in table.curves():
        if entries := table.misfit(row):
            numbers, cell, wrong = {}, "", True
            reason = f"{entries} entries in {table.blocks * len(table.names)} columns"
        else:
            numbers, reason, cell, wrong = _numbers(measured, curve % table.blocks + 1, cells)
        if reason:
            left.setdefault(reason, []).append((row.line, cell))
            unusable += wrong
        else:
            tangent = check.si(cells[check.place]) if check else 0
            found.append({**numbers, "curve": curve, "line": row.line, "check": tangent})
    left_out = [_left_out(reason, lines) for reason, lines in left.items()]
    if len(found) < 2 or unusable > len(found):
        reason = f"{len(found)} complete rows are left; at least 2 and half of all are needed"
        raise ValueError(f"{reason}. {' '.join(left_out)} Check `columns` and `units`")
    words = [(row.line, "") for segment in table.segments for row in segment.words]
    measured.notes.extend(left_out + [_left_out("having no numbers", words)] * bool(words))
    entries = pd.DataFrame(found)
    entries["abscissa"] = entries[measured.abscissa]
    if measured.kind == "strain" and "frequency" in entries:
        low, high = np.min(entries["frequency"]), np.max(entries["frequency"])
        if high > (1 + CONSTANT) * low:
            varied = f"the frequency varies from {low:.4g} to {high:.4g} rad/s"
            raise ValueError(f"{varied}: choose the sweep of strain by `step`")
    return entries


def _numbers(measured: MeasuredTable, block: int, cells: list[str]) -> tuple:
    """The numbers of a point in SI units; why it is left out; by which cell; if that is wrong."""
    columns, blocks = measured.columns, measured.table.blocks
    empty = sum(is_missing(cells[column.place]) for column in columns.values())
    if empty:
        ended = blocks > 1 and empty == len(columns)  # a curve may end above the others
        return {}, f"an empty curve {block} of {blocks}" if ended else "a missing value", "", False
    numbers = {name: column.si(cells[column.place]) for name, column in columns.items()}
    for name, column in columns.items():
        if reason := _refused(column, numbers[name]):
            wrong = name not in ("stress", "strain")  # there is none before and after a test
            cell = repr(cells[column.place])
            return {}, f"{column.label}, where the {name} {reason}", cell, wrong
    return numbers, "the time 0" * (numbers.get("time") == 0), "", False


def _refused(column: Column, value: float) -> str | None:
    """The condition that a number in SI units does not meet."""
    if np.isnan(value):
        return "must be a number"
    if column.quantity == "temperature":
        return None if 0 < value < HOTTEST else f"must lie between absolute zero and {HOTTEST:g} K"
    if column.quantity == "time" and value == 0:
        return None
    if value <= 0 and column.base is None:
        return "must be a positive number"
    if column.quantity == "phase" and not value < np.pi / 2:
        return "must be an angle below 90°"
    limit = LIMITS.get(DIMENSIONS[column.quantity], LIMIT)
    if not 1 / limit <= value <= limit:
        return f"must lie between {1 / limit:g} and {limit:g} {SI[DIMENSIONS[column.quantity]]}"
    return None


def _left_out(reason: str, lines: list[tuple[int, str]]) -> str:
    rows = list(dict.fromkeys(lines))  # side by side, a row has several points
    what = "row" if len(rows) == len(lines) else "point"
    return f"Left out for {reason}: {len(lines)} {what}(s), line {_listed(rows)}."


def _listed(rows: list[tuple[int, str]]) -> str:
    """All lines with their cells; neighbours without a cell as "4-9"."""
    parts: list[list[Any]] = []
    for line, cell in rows:
        if parts and not cell and not parts[-1][2] and line == parts[-1][1] + 1:
            parts[-1][1] = line
        else:
            parts.append([line, line, cell])
    return ", ".join(
        (f"{first}" if first == last else f"{first}-{last}") + (f" ({cell})" if cell else "")
        for first, last, cell in parts
    )


def _at_constant_load(measured: MeasuredTable, entries: "pd.DataFrame") -> "pd.DataFrame":
    """The rows at the load that the test holds constant: not of loading, nor of recovery."""
    if not {"stress", "strain"} <= set(measured.columns):
        return entries
    quantity = "stress" if measured.kind == "creep" else "strain"
    notes, good = measured.notes, np.ones(len(entries), bool)
    for _, load in entries[quantity].groupby(entries["isotherm"]):
        typical = np.median(load[load > 0.5 * np.max(load)])  # neither rest nor recovery
        good[load.index] = np.abs(load / typical - 1) < 2 * CONSTANT
        notes.append(f"Constant {quantity}: {typical:.4g} {SI[quantity]}.")
    if not np.all(good):
        rows = [(line, "") for line in entries["line"][~good].tolist()]
        notes.append(_left_out(f"a {quantity} that differs from it by {2 * CONSTANT:.0%}", rows))
    if np.sum(good) < max(2, 0.5 * len(good)):
        needs = f"the {quantity} is not constant, as {measured.kind} needs"
        raise ValueError(f"{needs}. {' '.join(notes[-2:])}")
    entries = entries.loc[good].copy()
    entries["isotherm"] = np.unique(entries["isotherm"], return_inverse=True)[1]
    return entries


def _moduli(measured: MeasuredTable, si: dict[str, np.ndarray]) -> Any:
    """Complex moduli, relaxation moduli or compliances, from the quantities that there are."""
    for direct in ("modulus", "compliance"):
        if direct in si:
            return si[direct]
    if measured.kind == "creep":
        return si["strain"] / si.get("stress", measured.load)
    if measured.kind == "relaxation":
        return si["stress"] / si.get("strain", measured.load)
    if "storage" in si and "loss" in si:
        return si["storage"] + 1j * si["loss"]
    ratio = si["tan_delta"] if "tan_delta" in si else np.tan(si["phase"])
    if "loss" in si:
        return si["loss"] * (1 / ratio + 1j)
    storage = si["storage"] if "storage" in si else si["magnitude"] / np.hypot(1, ratio)
    return storage * (1 + 1j * ratio)


def _deformation(measured: MeasuredTable, poisson: float | None) -> tuple[str, float]:
    """Tension or shear, and the factor that converts the modulus."""
    notes = measured.notes
    if measured.kind == "strain":
        return "shear", 1.0  # only ratios of the moduli count
    named = {column.deformation for column in measured.columns.values()} - {None}
    if len(named) > 1:
        labels = ", ".join(column.label for column in measured.columns.values())
        raise ValueError(f"{labels} mix tension and shear; choose matching ones by `columns`")
    if not named and measured.shear:
        named = {"shear"}
        reason = f"Read as shear, because of the column {measured.shear!r}"
        notes.append(f"{reason}; otherwise pass `deformation='tension'`.")
    if not named:
        notes.append("Read as tension (Young's modulus); otherwise pass `deformation='shear'`.")
    if named != {"shear"}:
        return "tension", 1.0
    if poisson is None:
        notes.append("These are shear moduli (G); `poisson` converts them to Young's moduli (E).")
        return "shear", 1.0
    factor = 2 * (1 + poisson)
    notes.append(f"Converted from shear to tension by `poisson`: E = {factor:.6g} G.")
    return "tension", factor


# What looks wrong.


def _tan_delta_note(label: str, entries: "pd.DataFrame", values: Any) -> str:
    """Compares a column of tan delta, not needed otherwise, with the moduli."""
    tangent = entries["check"].to_numpy()
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        error = np.where(tangent > 0, np.abs(values.imag / values.real / tangent - 1), 0)
    worst = int(np.argmax(error))
    if error[worst] < 0.02:
        return f"The tan delta of {label} agrees with loss over storage modulus."
    where = f"{100 * error[worst]:.2g} % in line {entries['line'].iloc[worst]}"
    words = f"tan delta of {label} differs from loss over storage modulus by {where}"
    return f"Warning: the {words}: are the columns right?"


def _check_abscissa(measured: MeasuredTable, entries: "pd.DataFrame", values: Any) -> None:
    """Refuses points without a sweep; reports points that repeat others."""
    name, notes = measured.abscissa, measured.notes
    parts = ("abscissa", "line", "isotherm")
    abscissa, lines, isotherm = (entries[part].to_numpy() for part in parts)
    least, most = np.min(abscissa), np.max(abscissa)
    single = name == "frequency" and np.max(isotherm) == 0
    if least == most or (single and most < (1 + CONSTANT) * least):
        hint = " (`readers.read_strain_sweep` reads those over strain)" * (name == "frequency")
        raise ValueError(f"the {name} is the same in every row: no sweep over {name}{hint}")
    near = np.diff(abscissa) <= SAME * abscissa[:-1]
    twice = np.flatnonzero(near & (np.diff(isotherm) == 0))
    if not len(twice):
        return
    first, second = lines[twice[0] : twice[0] + 2]
    where = f"first in lines {first} and {second}"
    notes.append(f"{len(twice)} points repeat the {name} of another ({where}); all are used.")
    difference = np.median(np.abs(values[twice + 1] / values[twice] - 1))
    if len(twice) >= 0.25 * len(lines) and difference > 0.1:
        remedy = "`step`" if "temperature" in entries else "a column of temperature"
        differ = (
            f"repeated points differ by {difference:.0%}: are these several isotherms or tests?"
        )
        notes.append(f"Warning: {differ} Then {remedy} is needed.")
