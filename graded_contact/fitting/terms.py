"""The number of Prony terms, and the best series of each number.

    best positive spectrum -> one term fewer, again and again -> least criterion -> one term more
                                                                                  and one fewer

The best positive spectrum of all is found by non-negative least squares on a dense grid of times
(C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, SIAM 1995, ch. 23), its neighbours
merged, then all unknowns refined. From it a walk leads down: each time the two branches are joined
(or one is dropped) where that costs least. Down alone ends in a poor local minimum now and then, so
a branch more and one fewer are tried with the number that is chosen.
"""

from typing import NamedTuple

import numpy as np
import scipy

from ..core.checks import check_whole
from ..core.display import shown
from .minimum import Fitted
from .observations import Observations, concrete
from .series import SeriesProblem

SEARCH = 1e-5  # relative tolerance of the cost
WALK = 1e-4  # of each length along a walk: its neighbours follow
MOST_POINTS_SEARCHED = 500  # that a search goes through
TIMES_PER_DECADE = 10
ROUNDS = 3  # of a branch more and one fewer, to a given length
NO_GAIN = 1.001  # of the cost, up to which a series is as good as a longer one
LEAST_GAIN = 1e-3  # of such a round, to go on
RESOLUTION = 1e-6  # of measured values, relative


@shown()
class Length(NamedTuple):
    """A number of terms that was tried.

    **Fields:**

    - `terms`: their number.
    - `error`: root mean square of ln(model/measured) [1].
    - `bic`: Bayes information criterion [1].
    """

    terms: int
    error: float
    bic: float


# The number of terms ----------------------------------------------------------------------------


def check_terms(data: Observations, terms: int | None) -> None:
    """Raises `ValueError` for a number of terms that the data cannot have."""
    if terms is None:
        if not concrete(data):
            raise ValueError(
                "`terms=None` needs values that are concrete: under `jit`, `grad` or `vmap` give "
                "`terms`."
            )
        return
    check_whole("terms", terms, int(not data.num_extras))
    count = np.sum(np.asarray(data.weights) > 0) if concrete(data) else np.inf
    if (unknowns := 2 * terms + data.num_extras) > count:
        raise ValueError(
            f"`terms={terms}` has {unknowns} unknowns, more than the {count} measured values."
        )


def choose(series: SeriesProblem, terms: int | None) -> tuple[np.ndarray, tuple[Length, ...]]:
    """Returns the unknowns of `terms` branches, or of the least criterion and all lengths tried."""
    few, path = thinned(series), []
    if terms is None:
        fitted = _walk_down(few, _dense_start(few))
        count = np.sum(series.measured)
        fitted = [fit for fit in fitted if len(fit[0]) < count] or fitted[:1]
        for theta, _ in fitted:
            bic = criterion(series, len(theta), series.total_cost(theta))
            path.append(Length(series.terms(theta), series.rms(theta), bic))
        theta = fitted[np.argmin([length.bic for length in path])][0]
        theta = _exchanged(few, theta)
    else:
        theta = best_of_length(few, terms)
    return series.minimise(theta, rtol=0)[0], tuple(path)


def criterion(series: SeriesProblem, unknowns: int, cost: float) -> float:
    """Returns the Bayes information criterion n ln(mean square) + p ln n of p unknowns [1].

    G. Schwarz, Ann. Statist. 6 (1978) 461, doi:10.1214/aos/1176344136. Errors below `RESOLUTION`
    are rounding and no reason for a further unknown.
    """
    count, total = np.sum(series.measured), np.sum(series.weights[series.measured])
    return float(count * np.log(2 * cost / total + RESOLUTION**2) + unknowns * np.log(count))


# The best series --------------------------------------------------------------------------------


def best_of_length(series: SeriesProblem, terms: int) -> np.ndarray:
    """Returns the best series found of exactly `terms` branches."""
    few = thinned(series)
    theta = _dense_start(few)
    while few.terms(theta) > terms:
        theta = _one_fewer(few, theta)[0]
    while few.terms(theta) < terms:
        theta = _with_branch(few, theta)
    return _exchanged(few, theta, _spaced_start(few, terms))


def _walk_down(few, theta) -> list[Fitted]:
    """The best series found of each length, the shortest first."""
    fitted = [few.minimise(theta, rtol=SEARCH)]
    static = few.known + np.sum(few.static, axis=0)
    least = int(np.any(static[few.measured] <= 0))
    while few.terms(theta := fitted[-1][0]) > least:
        tried = [few.minimise(start, rtol=WALK) for start in _one_fewer(few, theta)]
        shorter = min(tried, key=lambda fit: fit[1])
        if len(fitted) == 1 and shorter[1] < NO_GAIN * fitted[0][1]:
            fitted.clear()  # no data show the longest series
        fitted.append(shorter)
    return fitted[::-1]


def _exchanged(few, *starts):
    """The best series after a branch more and one fewer, as long as that lowers the error."""
    best = min((few.minimise(start, rtol=SEARCH) for start in starts), key=lambda fit: fit[1])
    for _ in range(ROUNDS if few.terms(best[0]) else 0):
        longer, _ = few.minimise(_with_branch(few, best[0]), rtol=SEARCH)
        tried = [few.minimise(start, rtol=SEARCH) for start in _one_fewer(few, longer)]
        before, best = best[1], min([best, *tried], key=lambda fit: fit[1])
        if best[1] > (1 - LEAST_GAIN) * before:
            break
    return best[0]


def thinned(series: SeriesProblem) -> SeriesProblem:
    """Returns the problem of at most so many points, evenly chosen: a search costs no more."""
    rank = np.argsort(np.argsort(series.x))
    return series.part(rank % int(np.ceil(len(rank) / MOST_POINTS_SEARCHED)) == 0)


def _spaced_start(series, terms):
    """Times evenly spaced in their logarithm over the data."""
    shortest, longest = series.time_limits()
    log_times = shortest + (longest - shortest) * (np.arange(terms) + 0.5) / max(terms, 1)
    faint = np.exp(series.faintest()) * 1e3
    strengths = np.log(np.maximum(non_negative(series, log_times), faint))
    return np.concatenate([strengths[:terms], log_times, strengths[terms:]])


def _dense_start(series):
    """Non-negative least squares of relative errors on a dense grid, neighbours merged."""
    log_times, faint = series.time_grid(TIMES_PER_DECADE), np.exp(series.faintest())
    strengths = non_negative(series, log_times)
    branches, static = np.split(strengths, [len(log_times)])
    # A time between two of the grid becomes a branch at each: a run of them is one branch.
    present = np.flatnonzero(branches > faint)
    clusters = np.split(present, np.flatnonzero(np.diff(present) > 1) + 1) if len(present) else []
    merged = [np.sum(branches[cluster]) for cluster in clusters]
    means = [np.average(log_times[cluster], weights=branches[cluster]) for cluster in clusters]
    return np.concatenate([np.log(merged), means, np.log(np.maximum(static, faint))])


def non_negative(series: SeriesProblem, log_times: np.ndarray) -> np.ndarray:
    """Returns strengths >= 0 of branches at given times, then of the static columns.

    They minimise the sum of squared relative errors.
    """
    rows = series.weights > 0
    columns = series.columns(log_times)[:, rows]
    if not len(columns):  # SciPy's nnls corrupts memory
        return np.zeros(0)
    scale = np.sqrt(series.weights[rows])
    values = np.exp(series.log_values[rows])
    matrix = columns * (scale / values)
    target = scale * (1 - series.known[rows] / values)
    # Of unit norm, because strengths range over many decades.
    norms = np.linalg.norm(matrix, axis=1)
    norms[norms == 0] = 1
    matrix = (matrix / norms[:, None]).T
    strengths, _ = scipy.optimize.nnls(matrix, target, maxiter=30 * len(norms))
    return strengths / norms


def _with_branch(series, theta):
    """The series with the new branch that lowers the cost most, to second order."""
    log_times, model = series.time_grid(TIMES_PER_DECADE), series.model(theta)
    residual = series.residual(model)
    effect, weights = series.branches(log_times) / model, series.pulling(residual)
    pull = effect @ (weights * residual)
    stiffness = effect**2 @ weights + 1e-300
    gains = np.where(pull < 0, pull**2 / (2 * stiffness), 0)
    best = np.argmax(gains)
    s, known_times, c = series.split(theta)
    strength = max(-0.3 * pull[best] / stiffness[best], 1e3 * np.exp(series.faintest()))
    return np.concatenate([s, [np.log(strength)], known_times, [log_times[best]], c])


def _one_fewer(series, theta):
    """The two cheapest of all series with one branch fewer, before any fit."""
    s, log_times, c = series.split(theta)
    order = np.argsort(log_times)
    s, log_times = s[order], log_times[order]
    parts = np.exp(s)[:, None] * series.branches(log_times)
    model = series.model(theta)
    joined = np.logaddexp(s[1:], s[:-1])
    share = np.exp(s[1:] - joined)
    middle = share * log_times[1:] + (1 - share) * log_times[:-1]
    merged = model - parts[1:] - parts[:-1] + np.exp(joined)[:, None] * series.branches(middle)
    # Without the branches that are dropped, a fit of few branches is up to 13 % worse.
    models = np.concatenate([merged, model - parts])
    costs = series.cost(series.residual(np.maximum(models, 1e-6 * model)))
    shorter = []
    for i in np.argsort(costs)[:2]:
        gone = i if i < len(joined) else i - len(joined)
        fewer, fewer_times = np.delete(s, gone), np.delete(log_times, gone)
        if i < len(joined):
            fewer[i], fewer_times[i] = joined[i], middle[i]
        shorter.append(np.concatenate([fewer, fewer_times, c]))
    return shorter
