"""Temperatures and isotherms of the points of a table."""

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Int

from ..core.checks import Numbers
from ..materials.measured import ISOTHERM_GAP, grouped
from .columns import MeasuredTable
from .tables import temperature_above

if TYPE_CHECKING:
    import pandas as pd

RAMP = 5.0  # K over which no isotherm drifts


def one_each(temperature: Numbers, count: int, what: str) -> np.ndarray:
    """Returns a temperature for each of so many files, sheets or curves."""
    kelvin = np.asarray(temperature)
    if kelvin.shape not in ((), (count,)):
        raise ValueError(
            f"`temperature` has shape {kelvin.shape}; one number is needed, or one for each of the "
            f"{count} {what}."
        )
    return np.broadcast_to(kelvin, (count,))


def temperatures_of(
    measured: MeasuredTable, entries: "pd.DataFrame", given: Numbers | None, notes: list[str]
) -> Any:
    """[K] as given, from a column, or from titles such as "25 °C" above curves."""
    table = measured.table
    count = table.blocks * len(table.segments)
    curve = entries["curve"].to_numpy()
    if given is not None:
        return one_each(given, count, "curve(s)")[curve]
    if "temperature" in entries:
        return entries["temperature"]
    found = []
    width = len(table.names)
    for segment, block in itertools.product(table.segments, range(table.blocks)):
        rows = segment.titles
        if table.blocks > 1:
            part = slice(block * width, (block + 1) * width)
            rows = [row._replace(cells=row.cells[part]) for row in rows[-1:]]
        found.append(temperature_above([row for row in rows if row.cells]))
    if None in found:
        return None
    listed = ", ".join(f"{value:.2f}" for value in found)
    notes.append(f"Took the temperature from the lines above the numbers: {listed} K.")
    return np.array(found)[curve]


def isotherm_numbers(entries: "pd.DataFrame", separate: bool) -> Int[np.ndarray, " points"]:
    """Numbers of isotherms from 0, the coldest first.

    An isotherm is a group of temperatures; or a curve, if these are `separate`. Without
    temperatures the curves are isotherms if they overlap.
    """
    curve, abscissa = entries["curve"].to_numpy(), entries["abscissa"].to_numpy()
    if "temperature" not in entries:
        ends = sorted((part.min(), part.max()) for _, part in entries.groupby("curve")["abscissa"])
        over = any(low < high for (_, high), (low, _) in itertools.pairwise(ends))
        if separate or over:
            return np.unique(curve, return_inverse=True)[1]
        return np.zeros_like(curve)
    kelvin = entries["temperature"].to_numpy()
    if separate:
        return _by_mean(kelvin, curve)
    isotherm = grouped(kelvin)
    if _drift(kelvin, isotherm) <= RAMP:
        return isotherm
    # A slow ramp, on which each sweep is a separate isotherm.
    steps = np.diff(np.log(abscissa), prepend=np.log(abscissa[0]))
    back = steps * np.sign(np.median(steps)) < 0
    return _by_mean(kelvin, np.cumsum(back))


def _by_mean(kelvin: np.ndarray, group: np.ndarray) -> np.ndarray:
    """The groups, numbered by their mean temperature."""
    names, group = np.unique(group, return_inverse=True)
    means = [np.mean(kelvin[group == i]) for i in range(len(names))]
    return np.argsort(np.argsort(means, kind="stable"))[group]


def _drift(kelvin: np.ndarray, isotherm: np.ndarray) -> float:
    return max(float(np.ptp(kelvin[isotherm == i])) for i in np.unique(isotherm))


def note_isotherms(entries: "pd.DataFrame", notes: list[str]) -> None:
    """Reports the number of isotherms; refuses temperatures that change during a sweep."""
    isotherm = entries["isotherm"].to_numpy()
    count = np.max(isotherm) + 1
    if "temperature" not in entries:
        if count > 1:
            notes.append(f"{count} curves of unknown temperature; pass their `temperature`s [K].")
        return
    kelvin = entries["temperature"].to_numpy()
    drift = _drift(kelvin, isotherm)
    notes.append(
        f"{count} isotherm(s), {np.min(kelvin):.2f} to {np.max(kelvin):.2f} K, each constant "
        f"within {drift:.2g} K."
    )
    if drift > RAMP:
        raise ValueError(
            f"the temperature changes by {drift:.3g} K within a sweep: isotherms are needed"
        )
    if drift > 2 * ISOTHERM_GAP:
        notes.append(
            f"Warning: a temperature drifts by {drift:.3g} K without a step above "
            f"{ISOTHERM_GAP:g} K; these may not be isotherms."
        )
