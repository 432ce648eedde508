"""The search for the shifts of isotherms and their series together (NumPy).

Law, departures and series are fitted at once, from several starts; the end of the least criterion
is taken. From a single start one of many isotherms ends decades off now and then: a curve that lies
apart from its neighbours costs nothing, because branches of its own explain it. The starts are

- the shifts where neighbours, as measured, overlap with the least difference,
- the shifts where one spectrum fits both neighbours, which knows more where curves do not overlap.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy

from ..core.compilation import compiled
from .observations import Observations, Unknowns
from .series import SeriesProblem, problem_of
from .shifts import LAW_LIMITS, LAW_TYPICAL, LN10, law_shifts, log_shifts
from .terms import WALK, Length, best_of_length, choose, criterion, non_negative

OVERLAPS = LN10 * np.arange(-1.0, 8.0, 0.05)  # trial distances of neighbours in ln a
DISTANCES = LN10 * np.arange(-0.5, 6.0, 0.25)  # trial distances by spectra; each takes a fit
UNPAIRED = 0.1  # log difference that a point without a partner on the other curve counts as
UNSEEN = 0.01  # weight of a step between curves without overlap in the law
ROUNDS = 4  # of choosing the number of terms
SETTLED = 0.7  # times the error before: the number of terms then shows


def _unknowns(isotherms, steps, weights):
    """The unknowns of the distances in ln a from each isotherm to the next hotter one."""
    law = _nearest_law(isotherms, steps, weights)
    log_shift = -np.cumsum([0.0, *steps])
    log_shift = log_shift - log_shift[isotherms.reference]
    _, departures, lifts = isotherms.counts
    apart = isotherms.others[:departures] @ (log_shift - law_shifts(isotherms, law))
    return np.concatenate([law, apart, np.zeros(lifts)])


def _nearest_law(isotherms, steps, weights):
    """The law nearest to most of the steps; one that is wrong moves it little."""
    return scipy.optimize.least_squares(
        lambda p: weights * (np.diff(law_shifts(isotherms, p)) + steps),
        np.log(LAW_TYPICAL[isotherms.law]),
        bounds=np.log(LAW_LIMITS[isotherms.law]).T,
        loss="soft_l1",
    ).x


def _by_overlap(series, isotherms):
    """Distances of neighbours in ln a at which their curves differ least, and their weights.

    Of curves that nowhere fit, the ends meet.
    """
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
    return np.array(steps), np.where(paired, 1, UNSEEN)


def _points_of(x, values, rows):
    """ln x and values of the rows, in order."""
    order = np.flatnonzero(rows)[np.argsort(x[rows])]
    return np.log(x[order]), values[order]


def _by_spectra(series, isotherms):
    """Distances of neighbours in ln a by fits of a spectrum to both, and their weights."""
    count, steps = len(isotherms.temperatures), []
    for colder in range(count - 1):
        costs = []
        for distance in DISTANCES:
            shifts = distance * (np.arange(count) == colder)
            pair = np.isin(series.group, (colder, colder + 1))
            part = series.shifted(shifts, np.zeros(count)).part(pair)
            log_times = part.time_grid(4)
            strengths = non_negative(part, log_times)
            model = part.known + strengths @ part.columns(log_times)
            relative = model / np.exp(part.log_values) - 1
            costs.append(part.weights @ relative**2)
        steps.append(DISTANCES[np.argmin(costs)])
    return np.array(steps), np.ones(len(steps))


# Shifts and series ------------------------------------------------------------------------------


def shifts_and_series(
    data: Observations, terms: int | None
) -> tuple[np.ndarray, SeriesProblem, tuple[Length, ...]]:
    """Returns the unknowns, the problem that they solve, and all lengths tried."""
    series, path = problem_of(data), ()
    if data.isotherms is None:
        theta, path = choose(series, terms)
        return theta, series, path
    isotherms = data.isotherms
    first = (_unknowns(isotherms, *way(series, isotherms)) for way in (_by_overlap, _by_spectra))
    ends = [_end(data, start) for start in first]
    _, unknowns = min(ends, key=lambda end: end[0])
    for _ in range(ROUNDS):
        series = _expecting(data, series.noise(unknowns))
        theta, path = choose(series.at(unknowns), terms)
        start = np.concatenate([theta, unknowns[len(unknowns) - series.num_shifts :]])
        unknowns, _ = series.minimise(start, rtol=0)
        # At wrong shifts the error hides how many terms the data show.
        if series.rms(unknowns) > SETTLED * series.rms(start):
            break
    return unknowns, series, path


def _end(data, shifts):
    """The criterion of the minimum that is reached from a start, and its unknowns."""
    series = problem_of(data)
    alone = series.at(shifts)
    terms = max(len(alone.time_grid(1)) - 1, 1)  # one a decade, whatever the shifts
    unknowns, cost = np.concatenate([best_of_length(alone, terms), shifts]), np.inf
    # The residuals' variance is known only once the shifts are: the law holds less and less.
    for _ in range(3):
        series = _expecting(data, series.noise(unknowns))
        unknowns, cost = series.minimise(unknowns, rtol=WALK, max_steps=150)
    return criterion(series, len(unknowns), cost), unknowns


def _expecting(data, error):
    """The problem in which departures and ln b cost what is expected beside such errors."""
    stds = data.isotherms.stds
    penalty = np.array([(error / std) ** 2 if std > 0 else 0.0 for std in stds])
    return problem_of(eqx.tree_at(lambda data: data.isotherms.penalty, data, penalty))


@compiled
def at_reference(unknowns: Unknowns, data: Observations) -> Observations:
    """Returns all measurements as if made at the reference temperature."""
    isotherms = data.isotherms
    assert isotherms is not None
    along, across = (jnp.exp(part)[isotherms.group] for part in log_shifts(isotherms, unknowns))
    x = data.x * along if data.kind == "frequency" else data.x / along
    values = jnp.where(data.weights > 0, data.values / across, 1)
    return dataclasses.replace(data, x=x, values=values, isotherms=None)
