"""The errors of a fit, the smallest error of any positive spectrum, and the report."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..core.display import shown
from .covariance import LEAST_NOISE
from .lengths import best_spectrum, flows
from .observations import Observations
from .series import SeriesProblem, problem_of

# How far times of the best spectra may lie outside the data, before and after. Those that decay
# before the data, or are over by their first strain, show in none of them.
WIDEST = {"frequency": (1e6, 1e6), "relaxation": (1.0, 1e6), "creep": (1.0, 1e6)}
_NEAR_END = 1.2  # a known modulus over a measured one that noise explains
JUMP = 0.1  # log difference of neighbours beyond what any spectrum allows
JUMPING = 0.25  # share of neighbours: fewer are noise
CONTRADICTION = 1e-4  # chance of agreement below which storage and loss contradict each other
INSTANT = 0.5  # of the first measured strain: less of it is not seen to be instant
VAGUE = 0.5  # deviation of the logarithm of a value that data do not determine


@shown()
class FitErrors(NamedTuple):
    """Root-mean-square of ln(model/measured).

    A channel without measured values has none; moduli in time are all `storage`.

    **Fields:**

    - `total`: of all values [1].
    - `storage`, `loss`: of each channel [1].
    """

    total: float
    storage: float | None
    loss: float | None


@shown()
class Floor(NamedTuple):
    """FitErrors of the best positive spectra of any length, the lower bound of all fits.

    Relaxation times may lie six decades outside the data, where a branch is a dashpot or a spring
    to a millionth: a wider reach would lower no error.

    **Fields:**

    - `total`: of one spectrum for all values, as in a real material (Kramers-Kronig relations) [1].
    - `storage`, `loss`: of a spectrum for that channel alone [1].
    - `chance`: probability that data of one material, with independent errors, would show a
      `total` so far above the others (F test); None where too few values are left to judge.
    - `near`: `total` of spectra whose times lie as near to the data as those of a fit.
    """

    total: float
    storage: float | None
    loss: float | None
    chance: float | None
    near: float


def _channels(series):
    """The problems of storage and of loss moduli alone; None for a channel without values."""
    storage = np.arange(len(series.weights)) < len(series.x)
    weights = (np.where(rows, series.weights, 0) for rows in (storage, ~storage))
    parts = (dataclasses.replace(series, weights=some) for some in weights)
    return [part if np.any(part.measured) else None for part in parts]


def fit_errors(series: SeriesProblem, theta: np.ndarray) -> FitErrors:
    """Returns the errors of the fit `theta`."""
    storage, loss = (part and part.rms(theta) for part in _channels(series))
    return FitErrors(series.rms(theta), storage, loss)


def floor_of(series: SeriesProblem, theta: np.ndarray) -> Floor:
    """Returns the errors of the best positive spectra, of which the fit `theta` is one."""
    near = min(_best(series).error, series.rms(theta))
    reach = tuple(map(max, series.reach, WIDEST[series.kind]))
    series = dataclasses.replace(series, reach=reach)
    both = _best(series)
    total = min(both.error, near)
    if series.kind != "frequency":
        return Floor(total, total, None, None, near)
    parts = [part and _best(part) for part in _channels(series)]
    chance = None if None in parts else _chance(np.sum(series.measured), both, *parts)
    storage, loss = (part and part.error for part in parts)
    return Floor(total, storage, loss, chance, near)


class _Best(NamedTuple):
    error: float
    cost: float
    unknowns: int


def _best(series):
    """The best positive spectrum."""
    theta, cost = best_spectrum(series)
    return _Best(series.rms(theta), cost, int(np.sum(series.within_bounds(theta))))


def _chance(count, both, storage, loss):
    """Significance of the cost that one spectrum has over two, by its F distribution."""
    saved = max(storage.unknowns + loss.unknowns - both.unknowns, 1)
    spare = count - storage.unknowns - loss.unknowns
    if spare < 1:
        return None
    noise = max((storage.cost + loss.cost) / spare, LEAST_NOISE**2)
    more = max(both.cost - storage.cost - loss.cost, 0)
    return float(scipy.special.fdtrc(saved, spare, more / saved / noise))


def jumps_of(series: SeriesProblem) -> str:
    """Returns a sentence on data that jump as several isotherms in one do; empty if they do not.

    No positive spectrum lets E' or E'' change faster than ω².
    """
    if series.kind != "frequency":
        return ""
    order = np.argsort(series.x[: len(series.x) - series.num_ends], kind="stable")
    share = 0.0
    channels = map(series.by_channel, (series.measured, series.log_values))
    for measured, y in zip(*channels, strict=True):
        rows = order[measured[order]]
        if len(rows) > 1:
            most = JUMP + 2 * np.diff(np.log(series.x[rows]))
            share = max(share, np.mean(np.abs(np.diff(y[rows])) > most))
    if share < JUMPING:
        return ""
    return (
        f"Of neighbouring values {share:.0%} differ by more than any spectrum allows. If these are "
        "isotherms of several temperatures, fit them with `master_curve`. "
    )


def _against_ends(data: Observations) -> str:
    """A sentence on a known modulus that lies between the measured ones; empty if none does."""
    used = np.asarray(data.values)[0][np.asarray(data.weights)[0] > 0]
    if not used.size:
        return ""
    moduli, words = 1 / used if data.kind == "creep" else used, ""
    if data.equilibrium is not None and data.equilibrium > _NEAR_END * np.min(moduli):
        words = f"`equilibrium={data.equilibrium:.3g}` Pa exceeds the lowest modulus, "
        words += f"{np.min(moduli):.3g} Pa: the fit cannot come near. "
    if data.glassy is not None and data.glassy * _NEAR_END < np.max(moduli):
        words += f"`glassy={data.glassy:.3g}` Pa is below the highest modulus, "
        words += f"{np.max(moduli):.3g} Pa: the fit cannot come near. "
    return words


def verdict_of(fit: Any, error: FitErrors, floor: Floor) -> str:
    """Returns in plain words whether the data or the number of terms limit a `PronyFit`."""
    if error.total <= 1.1 * floor.total:
        words = "The data limit this fit: no positive spectrum of any length is much nearer."
    elif error.total <= 1.1 * floor.near:
        words = (
            "The ends of the data limit this fit: nearer spectra have relaxation times far outside "
            "the data, which cannot place them. Times may lie beyond an end whose modulus is "
            "given: `equilibrium` (0 for a liquid) or, of `fit_prony`, `glassy`."
        )
    else:
        words = f"{fit.terms} terms limit this fit: longer series are nearer."
    words = jumps_of(problem_of(fit.data)) + _against_ends(fit.data) + words
    if floor.storage is None or floor.loss is None:
        return words
    if floor.chance is None:
        return f"{words} These values are too few to judge whether storage and loss agree."
    if floor.chance > CONTRADICTION:
        return f"{words} Storage and loss agree (Kramers-Kronig)."
    return (
        f"{words} Storage and loss contradict each other (Kramers-Kronig): look at the shifts and "
        "at thermal drift, or give the channel you trust less a smaller weight."
    )


def report_of(fit: Any) -> str:
    """Returns the report of a `PronyFit`: verdict, end values, errors and the lengths tried."""
    import pandas as pd

    error, floor, material = fit.errors(), fit.floor(), fit.material
    lowest, highest = material.coverage()
    rows = {"this fit": error, "floor, each alone": floor[:3]}
    errors = pd.DataFrame(rows, error._fields).T.dropna(axis="columns")
    errors.columns.name = "rms log error"
    lines = [
        verdict_of(fit, error, floor),
        f"{fit.terms} terms, E_eq = {float(material.equilibrium):.4g} Pa, "
        f"E_inf = {float(material.glassy):.4g} Pa, Poisson's ratio {float(fit.poisson):.3g}",
        *_undetermined(fit),
        f"Measured from {float(lowest):.4g} to {float(highest):.4g} rad/s; outside, where limits "
        "end, the series is an extrapolation.",
        "",
        errors.map(percent).to_string(),
    ]
    if fit.path:
        path = pd.DataFrame(fit.path).rename(columns={"bic": "BIC"})
        path[""] = np.where(path["terms"] == fit.terms, "*", "")
        formats = [str, percent, "{:.1f}".format, str]
        lines += ["", path.to_string(index=False, formatters=formats)]
    return "\n".join(lines)


def _undetermined(fit):
    """A sentence on an end value that the data do not determine, if there is one."""
    data = fit.data
    if flows(data) and float(fit.material.equilibrium) == 0:
        return [
            "The data end where they flow, loss above storage, and show no equilibrium modulus."
        ]
    if data.kind != "creep" or data.glassy is not None:
        return []
    series, place = problem_of(data), 2 * fit.terms  # of 1/E_inf
    first = np.min(series.log_values[series.measured])
    instant = float(fit.theta[place]) > first + np.log(INSTANT)
    if instant and fit.covariance()[place, place] < VAGUE**2:
        return []
    return [
        "E_inf is not determined by these data, which begin too late to show the instant strain: "
        "it is only as high as they allow. Give `glassy` if you know it."
    ]


def percent(value: float) -> str:
    """Returns a share as text."""
    return f"{100 * value:.3g} %"
