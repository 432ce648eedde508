"""Measured values that no smooth positive spectrum explains (NumPy).

A spectrum is fitted to all values but the wild ones, and wild values are found again, until they
stay the same. A value is wild if its distance from the spectrum is many times that of the others,
of its neighbours as well as of all. A wrong unit, temperature or column moves many values alike;
such values are not wild, and show in the floor of a fit.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..materials.measured import Measured
from .lengths import best_spectrum
from .observations import observe
from .series import SeriesProblem, problem_of

FAR_TIMES = 6.0  # the usual residual
HARMLESS = 0.1  # log residual below which no value harms a fit
ROUGH = 0.03  # usual residual from which on storage and loss have a spectrum each, as in a floor
FAR_OFF = np.log(10)  # off the median of five neighbours: not fitted at first
HUBER = 0.1  # log residual from which on a value counts linearly here
AROUND = 9  # neighbours whose residuals are compared
FEWEST_OF_A_CURVE = 6  # points from which on one can be distinguished from the others
# The unit of frequencies or times, and what each channel holds.
QUANTITIES = {
    "frequency": ("rad/s", "storage modulus", "loss modulus"),
    "relaxation": ("s", "modulus"),
    "creep": ("s", "compliance"),
}
SEARCHES = 8  # for wild values, at most
WEIGHTINGS = 3  # by residuals: with 2, 5 of 83 values off by a factor of 2 are missed


class Wild(NamedTuple):
    """A wild value.

    - `row`: its place in `Measured`; `where`: its line, frequency or time, and temperature.
    - `name`: what it is; `value`: in Pa or 1/Pa.
    - `residual`: ln(value/spectrum).
    """

    row: int
    where: str
    name: str
    value: float
    residual: float

    def __str__(self) -> str:
        ratio = np.exp(self.residual)
        times = f"{ratio:.3g} times" if ratio > 1 else f"1/{1 / ratio:.3g} of"
        unit = "1/Pa" if self.name == "compliance" else "Pa"
        return f"{self.where}: {self.name} {self.value:.4g} {unit}, {times} what is expected"


def wild_values(measured: Measured) -> list[Wild]:
    """Returns the values that no smooth positive spectrum of their isotherm explains.

    **Arguments:**

    - `measured`: moduli, relaxation or creep, see `read_moduli`.

    **Returns:** the values, by row, each with its place in the file. Isotherms with fewer than
    six points are not searched.
    """
    found, (unit, *names) = [], QUANTITIES[measured.kind]
    for i in range(np.max(measured.isotherm) + 1):
        rows = np.flatnonzero(measured.isotherm == i)
        if len(rows) < FEWEST_OF_A_CURVE:
            continue
        x, values = measured.abscissa[rows], measured.values[rows]
        data = observe(measured.kind, x, values, (1.0, 1.0))
        residuals = _wild(problem_of(data))
        for channel, k in np.argwhere(residuals):
            row = int(rows[k])
            where = f"line {measured.lines[row]} ({x[k]:.4g} {unit}"
            if measured.temperature is not None:
                where += f", {measured.temperature[row]:.2f} K"
            numbers = float(data.values[channel, k]), float(residuals[channel, k])
            found.append(Wild(row, f"{where})", names[channel], *numbers))
    return sorted(found)


def without(measured: Measured, wild: list[Wild]) -> Measured:
    """Returns what was measured without the rows of wild values.

    **Arguments:**

    - `measured`: moduli, relaxation or creep, see `read_moduli`.
    - `wild`: of `wild_values`.

    **Returns:** the other rows.
    """
    rows = np.arange(len(measured.lines))
    return measured.part(np.delete(rows, [value.row for value in wild]))


def _wild(series: SeriesProblem) -> np.ndarray:
    """Residuals of wild values, 0 for all others; shape `(channels, points)`."""
    y = series.by_channel(series.log_values)
    wild = np.abs(y - _around(y, 5)) > FAR_OFF
    seen, residual = [], np.zeros_like(y)
    for _ in range(SEARCHES):
        seen.append(wild)
        if np.sum(~wild) < FEWEST_OF_A_CURVE:
            return np.zeros_like(y)
        residual = _off_curve(series, ~wild)
        if len(y) > 1 and np.max(np.median(np.abs(residual), axis=1)) > ROUGH:
            channels = np.eye(len(y), dtype=bool)[:, :, None]
            alone = [_off_curve(series, ~wild & own) * own for own in channels]
            residual = np.sum(alone, axis=0)
        wild = _far(residual)
        if any(np.array_equal(wild, earlier) for earlier in seen):
            break
    return np.where(wild, residual, 0)


def _off_curve(series: SeriesProblem, fitted: np.ndarray) -> np.ndarray:
    """ln(value/spectrum) of all values, by a spectrum of those that are fitted.

    Fits with weights by the last residuals approach that of Huber's cost.
    """
    weights, residual = fitted.astype(float), np.zeros(fitted.shape)
    for _ in range(WEIGHTINGS):
        theta, _ = best_spectrum(dataclasses.replace(series, weights=weights.ravel()))
        residual = (series.log_values - np.log(series.model(theta))).reshape(fitted.shape)
        weights = fitted * HUBER / np.maximum(np.abs(residual), HUBER)
    return residual


def _far(residual: np.ndarray) -> np.ndarray:
    """Where residuals are large compared with those of all values and of the neighbours."""
    size = np.abs(residual)
    usual = np.maximum(np.median(size, axis=1)[:, None], _around(size, AROUND))
    return size > np.maximum(HARMLESS, FAR_TIMES * 1.4826 * usual)


def _around(values: np.ndarray, count: int) -> np.ndarray:
    """The median of so many neighbours in order of frequency or time, the value among them."""
    count = min(count, values.shape[1])
    medians = np.median(np.lib.stride_tricks.sliding_window_view(values, count, axis=1), axis=-1)
    first = np.arange(values.shape[1]) - count // 2
    return medians[:, np.clip(first, 0, medians.shape[1] - 1)]
