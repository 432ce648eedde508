"""Shifts of isotherms from their neighbours, from which a search starts (NumPy).

From a single start one of many isotherms ends decades off now and then: a curve that lies apart
from its neighbours costs nothing, because branches of its own explain it. The starts are

- the shifts where neighbours, as measured, overlap with the least difference,
- the law that is nearest to the shifts of neighbours that overlap,
- the shifts where one spectrum fits both neighbours, which knows more where curves do not overlap.
"""

import dataclasses

import numpy as np
import scipy

from .lengths import non_negative
from .series import SeriesProblem
from .shifts import LAW_LIMITS, LAW_TYPICAL, LN10, Isotherms, law_shifts

OVERLAPS = LN10 * np.arange(-1.0, 8.0, 0.05)  # trial distances of neighbours in ln a
DISTANCES = LN10 * np.arange(-0.5, 6.0, 0.25)  # the same by spectra, each of which is a fit
UNPAIRED = 0.1  # log difference that a point without a partner on the other curve counts as
UNSEEN = 0.01  # weight of a step between curves without overlap in the law


def first_shifts(series: SeriesProblem, isotherms: Isotherms) -> list[np.ndarray]:
    """Returns three sets of unknowns of the shifts."""
    steps, paired = _by_overlap(series, isotherms)
    law = _nearest_law(isotherms, steps, np.where(paired, 1, UNSEEN))
    fitted = _by_spectra(series, isotherms)
    by_spectra = _nearest_law(isotherms, fitted, np.ones(len(fitted)))
    return [
        _unknowns(isotherms, law, _summed_steps(isotherms, steps)),
        _unknowns(isotherms, law, law_shifts(isotherms, law)),
        _unknowns(isotherms, by_spectra, _summed_steps(isotherms, fitted)),
    ]


def _unknowns(isotherms, law, log_shift):
    _, departures, lifts = isotherms.counts
    apart = isotherms.others[:departures] @ (log_shift - law_shifts(isotherms, law))
    return np.concatenate([law, apart, np.zeros(lifts)])


def _summed_steps(isotherms, steps):
    """ln a of each isotherm, of those from each to the next hotter one."""
    log_shift = -np.cumsum([0.0, *steps])
    return log_shift - log_shift[isotherms.reference]


def _nearest_law(isotherms, steps, weights):
    """The law nearest to most of the steps; one that is wrong moves it little."""
    return scipy.optimize.least_squares(
        lambda p: weights * (np.diff(law_shifts(isotherms, p)) + steps),
        np.log(LAW_TYPICAL[isotherms.law]),
        bounds=np.log(LAW_LIMITS[isotherms.law]).T,
        loss="soft_l1",
    ).x


def _by_overlap(series, isotherms):
    """Distances of neighbours in ln a at which their curves differ least, and whether they overlap
    there. Of curves that nowhere fit, the ends meet."""
    channels = list(zip(*map(series.by_channel, (series.log_values, series.weights)), strict=True))
    sign = 1 if series.kind == "frequency" else -1
    steps, paired = [], []
    for colder in range(len(isotherms.temperatures) - 1):
        cost, pairs = np.zeros(len(OVERLAPS)), np.zeros(len(OVERLAPS))
        for values, weights in channels:
            there = (weights > 0) & (series.x > 0)
            cold, hot = (_points_of(series.x, values, there & (series.group == colder + i))
                         for i in (0, 1))  # fmt: skip
            if not (len(cold[0]) and len(hot[0])):
                continue
            weight = np.mean(weights[there])
            for one, other, way in ((cold, hot, sign), (hot, cold, -sign)):
                x = one[0] + way * OVERLAPS[:, None]
                inside = (x >= other[0][0]) & (x <= other[0][-1])
                apart = np.where(inside, np.interp(x, *other) - one[1], UNPAIRED)
                cost += weight * np.sum(apart**2, axis=1)
                pairs += np.sum(inside, axis=1)
        best = np.argmin(cost)
        steps.append(OVERLAPS[best])
        paired.append(pairs[best] > 0)
    return np.array(steps), np.array(paired)


def _points_of(x, values, rows):
    """ln x and values of the rows, in order."""
    order = np.flatnonzero(rows)[np.argsort(x[rows])]
    return np.log(x[order]), values[order]


def _by_spectra(series, isotherms):
    """Distances of neighbours in ln a, by fitting a spectrum to both at trial distances."""
    count, steps = len(isotherms.temperatures), []
    for colder in range(count - 1):
        costs = []
        for distance in DISTANCES:
            shifts = distance * (np.arange(count) == colder)
            pair = np.isin(series.group, (colder, colder + 1))
            part = _restricted(series.shifted(shifts, np.zeros(count)), pair)
            log_times = part.time_grid(4)
            strengths = non_negative(part, log_times)
            columns = np.concatenate([part.branches(log_times), part.static])
            relative = (part.known + strengths @ columns) / np.exp(part.log_values) - 1
            costs.append(part.weights @ relative**2)
        steps.append(DISTANCES[np.argmin(costs)])
    return np.array(steps)


def _restricted(series, points):
    """The problem of some of the points, given as a mask."""
    rows = np.tile(points, len(series.weights) // len(series.x))
    parts = {name: getattr(series, name)[rows] for name in ("log_values", "weights", "known")}
    return dataclasses.replace(series, x=series.x[points], static=series.static[:, rows], **parts)
