"""Temperatures of the curves of a table, and the isotherms that curves and replicates form."""

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.checks import Numbers
from ..materials.measured import ISOTHERM_GAP, grouped
from ..materials.shift import check_kelvin
from .cells import Row
from .columns import MeasuredTable
from .tables import temperature_above

if TYPE_CHECKING:
    import pandas as pd

RAMP = 5.0  # K over which no isotherm drifts


def one_each(temperature: Numbers | None, count: int, what: str) -> Any:
    """Returns a temperature for each of so many files, sheets or curves; None if it is unknown."""
    if temperature is None:
        return [None] * count
    kelvin = np.asarray(temperature, float)
    check_kelvin("temperature", kelvin)
    if kelvin.shape not in ((), (count,)):
        needed = f"one number is needed, or one for each of the {count} {what}"
        raise ValueError(f"`temperature` has shape {kelvin.shape}; {needed}.")
    return np.broadcast_to(kelvin, (count,))


def curve_temperatures(measured: MeasuredTable, entries: "pd.DataFrame", given) -> Any:
    """Returns temperatures [K]: as given, of a column, or of titles above curves ("25 °C")."""
    table, curve = measured.table, entries["curve"].to_numpy()
    if given is not None:
        return one_each(given, table.blocks * len(table.segments), "curve(s)")[curve]
    if "temperature" in entries:
        return entries["temperature"]
    found, width = [], len(table.names)
    for segment, block in itertools.product(table.segments, range(table.blocks)):
        rows = segment.titles
        if table.blocks > 1:  # the last line above has a title over each block
            cells = [row.cells[block * width : (block + 1) * width] for row in rows[-1:]]
            rows = [Row(rows[-1].line, part) for part in cells if part]
        found.append(temperature_above(rows))
    if None in found:
        return None
    listed = ", ".join(f"{value:.2f}" for value in found)
    measured.notes.append(f"Took the temperature from the lines above the numbers: {listed} K.")
    return np.array(found)[curve]


def numbered(entries: "pd.DataFrame", separate: bool) -> np.ndarray:
    """Returns numbers of isotherms from 0, the coldest first.

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
    means = np.array([np.mean(kelvin[curve == i]) for i in range(len(names))])
    if separate:  # replicates side by side, of one temperature, are one isotherm
        return grouped(means)[curve]
    return np.argsort(np.argsort(means, kind="stable"))[curve]


def _drift(kelvin: np.ndarray, isotherm: np.ndarray) -> float:
    return max(float(np.ptp(kelvin[isotherm == i])) for i in np.unique(isotherm))


def note_isotherms(measured: MeasuredTable, entries: "pd.DataFrame") -> None:
    """Reports the number of isotherms; refuses temperatures that change during a sweep."""
    notes, table = measured.notes, measured.table
    isotherm = entries["isotherm"].to_numpy()
    count = np.max(isotherm) + 1
    if "temperature" not in entries:
        if count > 1:
            notes.append(f"{count} curves of unknown temperature; pass their `temperature`s [K].")
        return
    kelvin = entries["temperature"].to_numpy()
    drift = _drift(kelvin, isotherm)
    if drift > RAMP:
        changes = f"the temperature changes by {drift:.3g} K within a sweep"
        beyond = f"numbers above {len(table.names)} in `columns` choose one curve"
        several = f"; of those side by side, {beyond}"
        raise ValueError(f"{changes}: isotherms are needed{several if table.blocks > 1 else ''}")
    ends = f"{np.min(kelvin):.2f} to {np.max(kelvin):.2f} K"
    notes.append(f"{count} isotherm(s), {ends}, each constant within {drift:.2g} K.")
    if drift > 2 * ISOTHERM_GAP:
        drifts = f"a temperature drifts by {drift:.3g} K without a step above {ISOTHERM_GAP:g} K"
        notes.append(f"Warning: {drifts}; these may not be isotherms.")
