"""From the columns of a table to moduli in SI units, point by point.

Each function adds to `notes` what it understood or did, in sentences.
"""

import re
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int

from ..._checks import Numbers, check_positive
from .cells import is_missing, is_number
from .layout import Column, Layout
from .quantities import DIMENSIONS, OFFSETS, UNITS

ISOTHERM_GAP = 1.0  # K from one isotherm to the next; instruments hold a few tenths
CREDIBLE = (1e2, 1e12)  # Pa
_SI = {
    "frequency": "rad/s", "time": "s", "modulus": "Pa", "compliance": "1/Pa", "angle": "rad",
    "ratio": "1",
}  # fmt: skip


class Points(NamedTuple):
    """Measured points, sorted by isotherm, then by frequency or time; see `reading.Measured`."""

    deformation: str
    abscissa: Float[np.ndarray, " points"]
    values: Complex[np.ndarray, " points"] | Float[np.ndarray, " points"]
    temperature: Float[np.ndarray, " points"] | None
    isotherm: Int[np.ndarray, " points"]
    lines: Int[np.ndarray, " points"]


class _Entries(NamedTuple):
    """The numbers of a table as they stand, with the block and line of each."""

    values: dict[str, np.ndarray]
    block: np.ndarray
    lines: np.ndarray


def measured_points(
    layout: Layout, poisson: Numbers | None, temperature: Numbers | None, notes: list[str]
) -> Points:
    """Returns the points of a table; `poisson` and `temperature` as in `read_moduli`."""
    entries = _entries(layout, notes)
    si = {name: _si(layout.columns[name], entries, notes) for name in layout.columns}
    abscissa = si["frequency" if layout.kind == "frequency" else "time"]
    values = _values(layout, si)
    _check_credible(values.real if layout.kind != "creep" else 1 / values, notes)
    if layout.check is not None:
        _compare_tan_delta(layout.check, entries, values, notes)
    deformation, factor = _deformation(layout, poisson, notes)
    values = values / factor if layout.kind == "creep" else factor * values
    kelvin = _temperature(layout, si, temperature, entries.block, notes)
    isotherm = _isotherms(layout, kelvin, entries.block, notes)
    order = np.lexsort((abscissa, isotherm))
    abscissa, isotherm, lines = abscissa[order], isotherm[order], entries.lines[order]
    if layout.blocks == 1 and np.any(np.diff(lines) < 0):
        notes.append("Sorted the rows.")
    _check_sweep(layout, abscissa, isotherm, lines, notes)
    return Points(
        deformation=deformation,
        abscissa=abscissa,
        values=values[order],
        temperature=None if kelvin is None else kelvin[order],
        isotherm=isotherm,
        lines=lines,
    )


def _entries(layout: Layout, notes: list[str]) -> _Entries:
    columns, found, places = layout.columns, [], []
    missing, starts = [], []
    for row in layout.data:
        cells = row.cells + [""] * (layout.blocks * layout.width - len(row.cells))
        for block in range(layout.blocks):
            mine = cells[block * layout.width :][: layout.width]
            wanted = [mine[column.place] for column in columns.values()]
            empty = sum(map(is_missing, wanted))
            if empty:
                if layout.blocks == 1 or empty < len(wanted):
                    missing.append(row.line)
                continue
            numbers = [_number(row.line, column, mine[column.place]) for column in columns.values()]
            if "time" in columns and numbers[list(columns).index("time")] == 0:
                starts.append(row.line)
                continue
            found.append([*numbers, _tan_delta(layout, mine)])
            places.append((block, row.line))
    _note_lines("Left out for a missing value", missing, notes)
    _note_lines("Left out for the time 0", starts, notes)
    _note_lines("Left out for having no numbers", [row.line for row in layout.words], notes)
    if len(found) < 2:
        raise ValueError(f"{len(found)} complete rows of numbers are left; at least 2 are needed")
    table, where = np.array(found).T, np.array(places).T
    return _Entries(dict(zip([*columns, "check"], table, strict=True)), where[0], where[1])


def _number(line: int, column: Column, cell: str) -> float:
    value = float(cell) if is_number(cell) else np.nan
    allowed = "a number"
    if column.quantity == "time":
        allowed, good = "zero or a positive number", value >= 0
    elif column.quantity == "temperature":
        good = True
    elif column.quantity == "phase":
        right = np.pi / 2 / UNITS["angle"][column.unit]
        allowed, good = f"an angle between 0 and {right:.4g}", 0 < value < right
    else:
        allowed, good = "a positive number", value > 0
    if not (good and np.isfinite(value)):
        raise ValueError(
            f"line {line}, {column.label}: {cell!r} is refused; the {column.quantity} must be "
            f"{allowed}"
        )
    return value


def _tan_delta(layout: Layout, cells: list[str]) -> float:
    cell = "" if layout.check is None else cells[layout.check.place]
    return float(cell) if is_number(cell) else np.nan


def _note_lines(what: str, lines: list[int], notes: list[str]) -> None:
    if lines:
        listed = ", ".join(map(str, lines[:5])) + (", ..." if len(lines) > 5 else "")
        notes.append(f"{what}: {len(lines)} row(s), line {listed}.")


def _si(column: Column, entries: _Entries, notes: list[str]) -> np.ndarray:
    dimension, values = DIMENSIONS[column.quantity], entries.values[column.quantity]
    factor = UNITS[dimension][column.unit]
    label = column.label[0].upper() + column.label[1:]
    note = f"{label}: {column.quantity} in {column.unit}, {column.source}"
    if dimension == "temperature":
        values = factor * values + OFFSETS[column.unit]
        if np.min(values) <= 0:
            line = entries.lines[np.argmin(values)]
            raise ValueError(
                f"line {line}, {column.label}: {np.min(values):.4g} K is below absolute zero. Pass "
                f"`units={{'temperature': ...}}`, one of {list(UNITS['temperature'])}"
            )
        notes.append(f"{note}.")
        return values
    by = "" if factor == 1 else f"; times {factor:.6g} in {_SI[dimension]}"
    notes.append(f"{note}{by}.")
    return factor * values


def _values(layout: Layout, si: dict[str, np.ndarray]) -> Any:
    if layout.kind != "frequency":
        return si["modulus" if layout.kind == "relaxation" else "compliance"]
    if "storage" in si and "loss" in si:
        return si["storage"] + 1j * si["loss"]
    ratio = si["tan_delta"] if "tan_delta" in si else np.tan(si["phase"])
    if "storage" in si:
        return si["storage"] * (1 + 1j * ratio)
    if "magnitude" in si:
        return si["magnitude"] / np.hypot(1, ratio) * (1 + 1j * ratio)
    return si["loss"] * (1 / ratio + 1j)


def _deformation(layout: Layout, poisson: Numbers | None, notes: list[str]) -> tuple[str, float]:
    """Tension or shear, and the factor to the modulus to bring it there."""
    said = {column.deformation for column in layout.columns.values()} - {None}
    if len(said) > 1:
        labels = ", ".join(column.label for column in layout.columns.values())
        raise ValueError(f"{labels} mix tension and shear; tell by `columns` which belong together")
    if said == {"shear"} and poisson is not None:
        factor = 2 * (1 + float(np.asarray(poisson)))
        notes.append(f"Turned from shear into tension: E = {factor:.6g} G, from `poisson`.")
        return "tension", factor
    if said == {"shear"}:
        notes.append("These are of shear (modulus G); `poisson` turns them into tension (E).")
        return "shear", 1.0
    if not said:
        notes.append("Taken as of tension (Young's modulus); otherwise pass `deformation='shear'`.")
    return "tension", 1.0


def _check_credible(stiffness: np.ndarray, notes: list[str]) -> None:
    least, most = np.min(stiffness), np.max(stiffness)
    if least < CREDIBLE[0] or most > CREDIBLE[1]:
        notes.append(
            f"Warning: moduli from {least:.3g} to {most:.3g} Pa leave the usual "
            f"{CREDIBLE[0]:g} to {CREDIBLE[1]:g} Pa: is the unit right?"
        )


def _compare_tan_delta(check: Column, entries: _Entries, values: Any, notes: list[str]) -> None:
    """Compares a column of tan delta, not needed otherwise, with the moduli read."""
    told = UNITS["ratio"][check.unit] * entries.values["check"]
    error = np.where(told > 0, np.abs(values.imag / values.real / told - 1), 0)
    worst = int(np.argmax(error))
    if error[worst] < 0.02:
        notes.append(f"The tan delta of {check.label} agrees with loss over storage modulus.")
    else:
        notes.append(
            f"Warning: the tan delta of {check.label} differs from loss over storage modulus by "
            f"{100 * error[worst]:.2g} % in line {entries.lines[worst]}: are the columns right?"
        )


def _temperature(
    layout: Layout,
    si: dict[str, np.ndarray],
    told: Numbers | None,
    block: np.ndarray,
    notes: list[str],
) -> np.ndarray | None:
    """Temperatures [K]: as told, from a column, or from titles such as "25 °C" above blocks."""
    if told is not None:
        kelvin = np.asarray(told, float)
        check_positive("temperature", kelvin, "[K]")
        if kelvin.shape not in ((), (layout.blocks,)):
            raise ValueError(
                f"`temperature` has shape {kelvin.shape}; one number is needed, or one for each of "
                f"the {layout.blocks} curve(s) side by side"
            )
        return np.broadcast_to(kelvin, (layout.blocks,))[block]
    if "temperature" in si:
        return si["temperature"]
    if layout.blocks == 1 or layout.titles is None:
        return None
    titles = [
        " ".join(layout.titles.cells[i * layout.width :][: layout.width])
        for i in range(layout.blocks)
    ]
    found = [re.search(r"(-?\d+(?:[.,]\d+)?)\s*°?\s*([CK])\b", title) for title in titles]
    kelvin = [float(m[1].replace(",", ".")) + OFFSETS[m[2]] for m in found if m]
    if len(kelvin) < layout.blocks:
        return None
    notes.append(f"Took the temperatures from line {layout.titles.line}.")
    return np.array(kelvin)[block]


def _isotherms(
    layout: Layout, kelvin: np.ndarray | None, block: np.ndarray, notes: list[str]
) -> np.ndarray:
    """Numbers from 0: the curves side by side, or groups of temperatures, the coldest first."""
    if kelvin is None:
        if layout.blocks > 1:
            notes.append(f"{layout.blocks} curves side by side; pass their `temperature`s [K].")
        return block
    if layout.blocks > 1:
        mean = [np.mean(kelvin[block == i]) for i in range(layout.blocks)]
        isotherm = np.argsort(np.argsort(mean, kind="stable"))[block]
    else:
        order = np.argsort(kelvin)
        isotherm = np.empty(len(kelvin), int)
        isotherm[order] = np.cumsum(np.diff(kelvin[order], prepend=kelvin[order[0]]) > ISOTHERM_GAP)
    groups = [kelvin[isotherm == i] for i in range(np.max(isotherm) + 1)]
    drift = max(float(np.ptp(group)) for group in groups)
    notes.append(
        f"{len(groups)} isotherm(s), {np.min(kelvin):.2f} to {np.max(kelvin):.2f} K, each held "
        f"within {drift:.2g} K."
    )
    if drift > 2 * ISOTHERM_GAP:
        notes.append(
            f"Warning: a temperature drifts by {drift:.3g} K without a step above "
            f"{ISOTHERM_GAP:g} K; these may not be isotherms."
        )
    return isotherm


def _check_sweep(
    layout: Layout,
    abscissa: np.ndarray,
    isotherm: np.ndarray,
    lines: np.ndarray,
    notes: list[str],
) -> None:
    name = "frequency" if layout.kind == "frequency" else "time"
    if np.ptp(abscissa) == 0:
        raise ValueError(f"the {name} is the same in every row: this is no sweep over {name}")
    twice = np.flatnonzero((np.diff(abscissa) == 0) & (np.diff(isotherm) == 0))
    if len(twice):
        first, second = lines[twice[0] : twice[0] + 2]
        notes.append(
            f"{len(twice)} points repeat the {name} of another at their temperature (first in "
            f"lines {first} and {second}); all are kept."
        )
