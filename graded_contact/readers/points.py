"""From the columns of a table to moduli in SI units, point by point, and their isotherms.

Each function adds to `notes` what it understood or did, in sentences; every row that is left out is
reported, with the reason.
"""

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.checks import Numbers
from ..materials.measured import ISOTHERM_GAP, Measured, grouped
from .cells import is_missing
from .columns import CONSTANT, SAME, MeasuredTable, misfit
from .tables import Column, temperature_above
from .units import DIMENSIONS, SI

if TYPE_CHECKING:
    import pandas as pd

CREDIBLE = (1e2, 1e12)  # Pa
# What numbers can be, in SI units: instruments write 9.9e37 and the like where they measured none.
LIMITS = {"modulus": 1e30, "stress": 1e30, "compliance": 1e30}
LIMIT = 1e100  # of shifted frequencies and times
HOTTEST = 1e4  # K
RAMP = 5.0  # K over which no isotherm drifts


def measured_points(
    path: Path,
    measured: MeasuredTable,
    poisson: float | None,
    temperature: Numbers | None,
    notes: list[str],
) -> Measured:
    """Returns the points of a table; `poisson` and `temperature` as in `read_moduli`."""
    kind, table = measured.kind, measured.table
    notes += [column.sentence for column in measured.columns.values()] + measured.notes
    entries = _entries(measured, notes)
    kelvin = _curve_temperatures(measured, entries, temperature, notes)
    if kelvin is not None:
        entries["temperature"] = kelvin
    entries["isotherm"] = _isotherms(entries, separate=table.blocks > 1)
    entries = _at_constant_load(measured, entries, notes)
    values = _moduli(measured, {name: entries[name].to_numpy() for name in measured.columns})
    stiffness = 1 / values if kind == "creep" else values.real
    odd = (stiffness < CREDIBLE[0]) | (stiffness > CREDIBLE[1])
    if np.any(odd):
        where = _listed([(int(line), "") for line in np.unique(entries["line"][odd])])
        notes.append(
            f"Warning: moduli from {np.min(stiffness):.3g} to {np.max(stiffness):.3g} Pa are "
            f"outside the usual {CREDIBLE[0]:g} to {CREDIBLE[1]:g} Pa in line {where}: is the "
            "unit right?"
        )
    if measured.check is not None:
        _compare_tan_delta(measured.check, entries, values, notes)
    deformation, factor = _deformation(measured, poisson, notes)
    values = values / factor if kind == "creep" else factor * values
    order = np.lexsort((entries["abscissa"], entries["isotherm"]))
    entries, values = entries.iloc[order], values[order]
    _note_isotherms(entries, notes)
    if table.blocks == 1 and np.any(np.diff(entries["line"]) < 0):
        notes.append("Sorted the rows.")
    points = Measured(
        kind=kind,
        deformation=deformation,
        abscissa=np.array(entries["abscissa"]),
        values=values,
        temperature=None if kelvin is None else np.array(entries["temperature"]),
        isotherm=np.array(entries["isotherm"]),
        lines=np.array(entries["line"]),
        path=path,
        history=(),
    )
    _check_abscissa(points, notes)
    return points


# Rows to numbers.


def _entries(measured: MeasuredTable, notes: list[str]) -> "pd.DataFrame":
    """The numbers in SI units by quantity, with the abscissa, curve and line of each point."""
    import pandas as pd

    columns, table = measured.columns, measured.table
    width, found = len(table.names), []
    left: dict[str, list[tuple[int, str]]] = {}  # reason: lines, each with its cell
    unusable = 0

    def leave(reason: str, line: int, cell: str = "") -> None:
        left.setdefault(reason, []).append((line, cell))

    rows = [(i, row) for i, segment in enumerate(table.segments) for row in segment.data]
    for (segment, row), block in itertools.product(rows, range(table.blocks)):
        if entries := misfit(row, table.blocks * width, measured.spaced):
            leave(f"{entries} entries in {table.blocks * width} columns", row.line)
            unusable += 1
            continue
        cells = [*row.cells, *[""] * (table.blocks * width)][block * width :]
        empty = sum(is_missing(cells[column.place]) for column in columns.values())
        if empty:
            if table.blocks == 1 or empty < len(columns):  # a curve may end above the others
                leave("a missing value", row.line)
            continue
        numbers = {name: column.si(cells[column.place]) for name, column in columns.items()}
        refused = ((name, _refused(columns[name], number)) for name, number in numbers.items())
        name, reason = next((pair for pair in refused if pair[1]), ("", None))
        if reason:
            column = columns[name]
            cell = repr(cells[column.place])
            leave(f"{column.label}, where the {name} {reason}", row.line, cell)
            unusable += name not in ("stress", "strain")  # none before and after a test
        elif numbers.get("time") == 0:
            leave("the time 0", row.line)
        else:
            check = measured.check.si(cells[measured.check.place]) if measured.check else np.nan
            curve = segment * table.blocks + block
            found.append({**numbers, "check": check, "curve": curve, "line": row.line})
    left_out = [_left_out(reason, lines) for reason, lines in left.items()]
    if len(found) < 2 or unusable > len(found):
        raise ValueError(
            f"{len(found)} complete rows of numbers are left; at least 2 are needed, and half of "
            f"all rows. {' '.join(left_out)} Are the columns and units right (`columns`, `units`)"
        )
    words = [(row.line, "") for segment in table.segments for row in segment.words]
    notes += left_out + [_left_out("having no numbers", words)] * bool(words)
    entries = pd.DataFrame(found)
    entries["abscissa"] = entries[_abscissa(measured.kind)]
    if measured.kind == "strain" and "frequency" in entries:
        omega = entries["frequency"].to_numpy()
        low, high = float(np.min(omega)), float(np.max(omega))
        if high > (1 + CONSTANT) * low:
            raise ValueError(
                f"the frequency varies from {low:.4g} to {high:.4g} rad/s: choose the step that "
                "sweeps the strain by `step`"
            )
    return entries


def _abscissa(kind: str) -> str:
    return kind if kind in ("frequency", "strain") else "time"


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
    rows = list(dict.fromkeys(lines))
    return f"Left out for {reason}: {len(rows)} row(s), line {_listed(rows)}."


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


def _at_constant_load(
    measured: MeasuredTable, entries: "pd.DataFrame", notes: list[str]
) -> "pd.DataFrame":
    """The rows at the load that the test holds constant: not of loading, nor of recovery."""
    if not {"stress", "strain"} <= set(measured.columns):
        return entries
    quantity = "stress" if measured.kind == "creep" else "strain"
    good = np.ones(len(entries), bool)
    for _, load in entries[quantity].groupby(entries["isotherm"]):
        typical = np.median(load[load > 0.5 * np.max(load)])
        good[load.index] = np.abs(load / typical - 1) < 2 * CONSTANT
        notes.append(f"Constant {quantity}: {typical:.4g} {SI[quantity]}.")
    if not np.all(good):
        rows = [(int(line), "") for line in entries["line"][~good]]
        notes.append(_left_out(f"a {quantity} that differs from it by {2 * CONSTANT:.0%}", rows))
    if np.sum(good) < max(2, 0.5 * len(good)):
        raise ValueError(
            f"the {quantity} is not constant, as {measured.kind} needs. {' '.join(notes[-2:])}"
        )
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


def _deformation(
    measured: MeasuredTable, poisson: float | None, notes: list[str]
) -> tuple[str, float]:
    """Tension or shear, and the factor that converts the modulus."""
    if measured.kind == "strain":
        return "shear", 1.0  # only ratios of the moduli count
    named = {column.deformation for column in measured.columns.values()} - {None}
    if len(named) > 1:
        labels = ", ".join(column.label for column in measured.columns.values())
        raise ValueError(f"{labels} mix tension and shear; choose matching ones by `columns`")
    if not named and measured.shear:
        named = {"shear"}
        notes.append(
            f"Read as shear, because of the column {measured.shear!r}; otherwise pass "
            "`deformation='tension'`."
        )
    if not named:
        notes.append("Read as tension (Young's modulus); otherwise pass `deformation='shear'`.")
    if named != {"shear"}:
        return "tension", 1.0
    if poisson is None:
        notes.append("These are shear moduli (G); `poisson` converts them to Young's moduli (E).")
        return "shear", 1.0
    factor = 2 * (1 + float(poisson))
    notes.append(f"Converted from shear to tension by `poisson`: E = {factor:.6g} G.")
    return "tension", factor


# Temperatures and isotherms.


def one_each(temperature: Numbers, count: int, what: str) -> np.ndarray:
    """Returns a temperature for each of so many files, sheets or curves."""
    kelvin = np.asarray(temperature)
    if kelvin.shape not in ((), (count,)):
        raise ValueError(
            f"`temperature` has shape {kelvin.shape}; one number is needed, or one for each of the "
            f"{count} {what}."
        )
    return np.broadcast_to(kelvin, (count,))


def _curve_temperatures(
    measured: MeasuredTable, entries: "pd.DataFrame", given: Numbers | None, notes: list[str]
) -> Any:
    """[K] as given, from a column, or from titles such as "25 °C" above curves."""
    table, curve = measured.table, entries["curve"].to_numpy()
    if given is not None:
        return one_each(given, table.blocks * len(table.segments), "curve(s)")[curve]
    if "temperature" in entries:
        return entries["temperature"]
    found = []
    width = len(table.names)
    for segment, block in itertools.product(table.segments, range(table.blocks)):
        rows = segment.titles
        if table.blocks > 1:  # the last line above has a title over each block
            part = slice(block * width, (block + 1) * width)
            rows = [row._replace(cells=row.cells[part]) for row in rows[-1:]]
        found.append(temperature_above([row for row in rows if row.cells]))
    if None in found:
        return None
    listed = ", ".join(f"{value:.2f}" for value in found)
    notes.append(f"Took the temperature from the lines above the numbers: {listed} K.")
    return np.array(found)[curve]


def _isotherms(entries: "pd.DataFrame", separate: bool) -> np.ndarray:
    """Numbers of isotherms from 0, the coldest first.

    An isotherm is a group of temperatures; or a curve, if these are `separate`. Without
    temperatures the curves are isotherms if they overlap.
    """
    curve, abscissa = entries["curve"].to_numpy(), entries["abscissa"].to_numpy()
    if "temperature" not in entries:
        ends = sorted((part.min(), part.max()) for _, part in entries.groupby("curve")["abscissa"])
        over = any(low < high for (_, high), (low, _) in itertools.pairwise(ends))
        return np.unique(curve, return_inverse=True)[1] if separate or over else 0 * curve
    kelvin = entries["temperature"].to_numpy()
    if not separate:
        isotherm = grouped(kelvin)
        if _drift(kelvin, isotherm) <= RAMP:
            return isotherm
        # A slow ramp, on which each sweep is a separate isotherm.
        steps = np.diff(np.log(abscissa), prepend=np.log(abscissa[0]))
        curve = np.cumsum(steps * np.sign(np.median(steps)) < 0)
    names, curve = np.unique(curve, return_inverse=True)
    means = [np.mean(kelvin[curve == i]) for i in range(len(names))]
    return np.argsort(np.argsort(means, kind="stable"))[curve]


def _drift(kelvin: np.ndarray, isotherm: np.ndarray) -> float:
    return max(float(np.ptp(kelvin[isotherm == i])) for i in np.unique(isotherm))


def _note_isotherms(entries: "pd.DataFrame", notes: list[str]) -> None:
    """Reports the number of isotherms; refuses temperatures that change during a sweep."""
    isotherm = entries["isotherm"].to_numpy()
    count = np.max(isotherm) + 1
    if "temperature" not in entries:
        if count > 1:
            notes.append(f"{count} curves of unknown temperature; pass their `temperature`s [K].")
        return
    kelvin = entries["temperature"].to_numpy()
    drift = _drift(kelvin, isotherm)
    if drift > RAMP:
        raise ValueError(
            f"the temperature changes by {drift:.3g} K within a sweep: isotherms are needed"
        )
    notes.append(
        f"{count} isotherm(s), {np.min(kelvin):.2f} to {np.max(kelvin):.2f} K, each constant "
        f"within {drift:.2g} K."
    )
    if drift > 2 * ISOTHERM_GAP:
        notes.append(
            f"Warning: a temperature drifts by {drift:.3g} K without a step above "
            f"{ISOTHERM_GAP:g} K; these may not be isotherms."
        )


# What looks wrong.


def _compare_tan_delta(
    check: Column, entries: "pd.DataFrame", values: Any, notes: list[str]
) -> None:
    """Compares a column of tan delta, not needed otherwise, with the moduli."""
    tangent = entries["check"].to_numpy()
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        error = np.where(tangent > 0, np.abs(values.imag / values.real / tangent - 1), 0)
    worst = int(np.argmax(error))
    if error[worst] < 0.02:
        notes.append(f"The tan delta of {check.label} agrees with loss over storage modulus.")
    else:
        notes.append(
            f"Warning: the tan delta of {check.label} differs from loss over storage modulus by "
            f"{100 * error[worst]:.2g} % in line {entries['line'].iloc[worst]}: are the columns "
            "right?"
        )


def _check_abscissa(points: Measured, notes: list[str]) -> None:
    """Refuses points without a sweep; reports points that repeat others."""
    name = _abscissa(points.kind)
    abscissa, lines = points.abscissa, points.lines
    least, most = np.min(abscissa), np.max(abscissa)
    single = name == "frequency" and np.max(points.isotherm) == 0
    if least == most or (single and most < (1 + CONSTANT) * least):
        hint = " (`readers.read_strain_sweep` reads those over strain)" * (name == "frequency")
        raise ValueError(f"the {name} is the same in every row: no sweep over {name}{hint}")
    near = np.diff(abscissa) <= SAME * abscissa[:-1]
    twice = np.flatnonzero(near & (np.diff(points.isotherm) == 0))
    if not len(twice):
        return
    first, second = lines[twice[0] : twice[0] + 2]
    notes.append(
        f"{len(twice)} points repeat the {name} of another at their temperature (first in "
        f"lines {first} and {second}); all are used."
    )
    difference = np.median(np.abs(points.values[twice + 1] / points.values[twice] - 1))
    if len(twice) >= 0.25 * len(lines) and difference > 0.1:
        remedy = "`step`" if points.temperature is not None else "a column of temperature"
        notes.append(
            f"Warning: repeated points differ by {difference:.0%}: are these several isotherms or "
            f"tests? Then {remedy} is needed."
        )
