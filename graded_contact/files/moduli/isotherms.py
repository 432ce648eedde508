"""Temperatures of measured points, and the isotherms that they make."""

import itertools

import numpy as np
from jaxtyping import Float, Int

from ...core.checks import Numbers
from .layout import Layout
from .titles import temperature_above

ISOTHERM_GAP = 1.0  # K from one isotherm to the next; instruments hold a few tenths
RAMP = 5.0  # K over which no isotherm drifts


def temperatures(
    layout: Layout,
    curve: Int[np.ndarray, " points"],
    column: Float[np.ndarray, " points"] | None,
    told: Numbers | None,
    notes: list[str],
) -> Float[np.ndarray, " points"] | None:
    """Returns [K] as told, from a column, or from titles such as "25 °C" above curves."""
    count = layout.blocks * len(layout.segments)
    if told is not None:
        kelvin = np.asarray(told)
        if kelvin.shape not in ((), (count,)):
            raise ValueError(
                f"`temperature` has shape {kelvin.shape}; one number is needed, or one for each of "
                f"the {count} curve(s)"
            )
        return np.broadcast_to(kelvin, (count,))[curve]
    if column is not None:
        return column
    found = []
    for segment in layout.segments:
        for block in range(layout.blocks):
            rows = segment.titles
            if layout.blocks > 1:
                rows = [
                    row._replace(cells=row.cells[block * layout.width :][: layout.width])
                    for row in rows[-1:]
                ]
            found.append(temperature_above(rows))
    if None in found:
        return None
    listed = ", ".join(f"{value:.2f}" for value in found)
    notes.append(f"Took the temperature from the lines above the numbers: {listed} K.")
    return np.array(found)[curve]


def isotherms(
    kelvin: np.ndarray | None, curve: np.ndarray, abscissa: np.ndarray, apart: bool
) -> Int[np.ndarray, " points"]:
    """Returns numbers of isotherms from 0, the coldest first.

    Groups of temperatures; curves where they are `apart`; where no temperature is known, curves
    that lie over one another.
    """
    if kelvin is None:
        ranges = sorted(
            (np.min(abscissa[curve == i]), np.max(abscissa[curve == i])) for i in np.unique(curve)
        )
        over = any(low < high for (_, high), (low, _) in itertools.pairwise(ranges))
        return np.unique(curve, return_inverse=True)[1] if apart or over else np.zeros_like(curve)
    if apart:
        return _by_mean(kelvin, curve)
    isotherm = grouped(kelvin)
    if _drift(kelvin, isotherm) <= RAMP:
        return isotherm
    # A slow ramp, on which each sweep is an isotherm of its own.
    steps = np.diff(np.log(abscissa), prepend=np.log(abscissa[0]))
    back = steps * np.sign(np.median(steps)) < 0
    return _by_mean(kelvin, np.cumsum(back))


def grouped(kelvin: np.ndarray) -> Int[np.ndarray, " points"]:
    """Returns numbers of groups of temperatures, from 0, the coldest first."""
    order = np.argsort(kelvin, kind="stable")
    group = np.empty(len(kelvin), int)
    group[order] = np.cumsum(np.diff(kelvin[order], prepend=kelvin[order[0]]) > ISOTHERM_GAP)
    return group


def _by_mean(kelvin: np.ndarray, group: np.ndarray) -> np.ndarray:
    """The groups, numbered by their mean temperature."""
    names, group = np.unique(group, return_inverse=True)
    means = [np.mean(kelvin[group == i]) for i in range(len(names))]
    return np.argsort(np.argsort(means, kind="stable"))[group]


def _drift(kelvin: np.ndarray, isotherm: np.ndarray) -> float:
    return max(float(np.ptp(kelvin[isotherm == i])) for i in range(np.max(isotherm) + 1))


def note_isotherms(kelvin: np.ndarray | None, isotherm: np.ndarray, notes: list[str]) -> None:
    """Tells how many isotherms there are; refuses temperatures that run through a sweep."""
    count = np.max(isotherm) + 1
    if kelvin is None:
        if count > 1:
            notes.append(f"{count} curves of unknown temperature; pass their `temperature`s [K].")
        return
    drift = _drift(kelvin, isotherm)
    notes.append(
        f"{count} isotherm(s), {np.min(kelvin):.2f} to {np.max(kelvin):.2f} K, each held "
        f"within {drift:.2g} K."
    )
    if drift > RAMP:
        raise ValueError(
            f"the temperature runs through {drift:.3g} K within a sweep: these are no isotherms"
        )
    if drift > 2 * ISOTHERM_GAP:
        notes.append(
            f"Warning: a temperature drifts by {drift:.3g} K without a step above "
            f"{ISOTHERM_GAP:g} K; these may not be isotherms."
        )
