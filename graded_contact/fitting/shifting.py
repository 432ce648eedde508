"""The search for shifts and series together: neighbours are aligned, then all is fitted (NumPy)."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from .lengths import SEARCH, best_of_length, non_negative
from .prony import solid_or_liquid
from .result import Length, choose, liquid_of
from .series import Series
from .shifted_observations import Isotherms, at_reference, shared_series_of
from .shifted_series import LN10


def shifts_and_series(
    data: Isotherms, sizes: tuple[float, float], choose_series: Callable[[Series], tuple]
) -> tuple[tuple, Any]:
    """Returns unknowns, which are free, and penalty; and what `choose_series` tells (NumPy)."""

    def expecting(variance):
        """The problem with squares of departures weighed against residuals of this variance."""
        penalty = np.array([variance / size**2 if size > 0 else 0.0 for size in sizes])
        return shared_series_of(eqx.tree_at(lambda d: d.penalty, data, penalty)), penalty

    shared, _ = expecting(0.0)
    log_shift = _aligned(shared)
    law = _nearest_law(shared.law, log_shift)
    if not data.departs:
        log_shift = shared.law.shifts(law)[0]
    series = shared.shifted(log_shift, np.zeros(len(log_shift)))
    shortest, longest = series.time_limits()
    theta, _ = best_of_length(series, max(int(np.ceil((longest - shortest) / LN10)), 1))
    unknowns = shared.join(theta, law, log_shift)
    # The scatter of the data is known only once the shifts are.
    for _ in range(2):
        shared, penalty = expecting(_mean_square(shared, unknowns))
        unknowns, _ = shared.minimise(unknowns, rtol=SEARCH)
    theta, path = choose_series(shared.shifted(*shared.shifts(unknowns)))
    unknowns = np.concatenate([theta, *shared.split(unknowns)[1:]])
    lower, upper = shared.bounds(unknowns)
    unknowns, _ = shared.minimise(unknowns, rtol=0)
    return (unknowns, (unknowns > lower) & (unknowns < upper), penalty), path


def shifted_solid_or_liquid(
    data: Isotherms, sizes: tuple[float, float], within: float | None
) -> tuple[Isotherms, tuple, tuple[Length, ...]]:
    """Returns the data, with E_eq = 0 if once shifted they ask for it; what was found; lengths."""

    def search_in(data):
        return shifts_and_series(data, sizes, lambda series: choose(series, within))

    found, path = search_in(data)
    shifted = at_reference(jnp.asarray(found[0]), data)
    if liquid_of(shifted) is None or solid_or_liquid(shifted, within)[0] is shifted:
        return data, found, path
    equilibrium = jnp.zeros(())
    liquid = eqx.tree_at(
        lambda d: d.observations.equilibrium, data, equilibrium, is_leaf=lambda leaf: leaf is None
    )
    return liquid, *search_in(liquid)


def _mean_square(shared, unknowns):
    series, residual, _, _ = shared.derivatives(unknowns)
    rows = series.measured
    return float(np.average(residual[rows] ** 2, weights=series.weights[rows]))


def _aligned(shared):
    """ln a of each isotherm, by fitting a spectrum to every two neighbours at trial distances."""
    distances = LN10 * np.arange(-0.5, 6.0, 0.25)
    steps = []
    for colder in range(len(shared.law.temperatures) - 1):
        costs = []
        for distance in distances:
            shifts = np.zeros(len(shared.law.temperatures))
            shifts[colder] = distance
            pair = np.isin(shared.group, (colder, colder + 1))
            part = shared.shifted(shifts, np.zeros(len(shifts))).restricted(pair)
            shortest, longest = part.time_limits()
            log_times = np.linspace(shortest, longest, int(4 * (longest - shortest) / LN10) + 2)
            strengths = non_negative(part, log_times)
            columns = np.concatenate([part.branches(log_times), part.static])
            relative = (part.known + strengths @ columns) / np.exp(part.log_values) - 1
            costs.append(part.weights @ relative**2)
        steps.append(distances[np.argmin(costs)])
    log_shift = -np.cumsum([0.0, *steps])
    return log_shift - log_shift[shared.reference]


def _nearest_law(law, log_shift):
    found = least_squares(
        lambda p: law.shifts(p)[0] - log_shift, law.typical, bounds=law.bounds, loss="soft_l1"
    )
    return found.x
