"""Isotherms checked and joined, and the search for their shifts and series together.

The search aligns neighbours, then fits law, departures and series at once (NumPy).
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, get_args

import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from ..core.checks import Numbers, as_float, as_numbers, check_positive, check_values, is_concrete
from ..materials.measured import Measured
from .lengths import (
    SEARCH,
    Length,
    best_of_length,
    choose,
    choose_solid_or_liquid,
    may_be_liquid,
    non_negative,
)
from .observations import Kind, observe
from .series import Series
from .shifted_series import (
    LAW_LIMITS,
    LAW_TYPICAL,
    LN10,
    Isotherms,
    LawKind,
    at_reference,
    shifted_series_of,
)

COLDEST = 100.0  # K; if all temperatures of a set are lower, they are thought to be in °C
Isotherm = tuple[Numbers, Numbers, Numbers]


# Isotherms as given -----------------------------------------------------------------------------


def check_law(law: str) -> None:
    """Raises `ValueError` unless `law` names one of the laws that isotherms are shifted by."""
    if law not in get_args(LawKind):
        raise ValueError(f"`law={law!r}` is refused: use one of {get_args(LawKind)}.")


def isotherms_of(
    isotherms: Measured | Sequence[Measured | Isotherm],
    kind: Any,
    law: Any,
    sizes: tuple[float, float],
    reference: Any,
    weights: tuple[Numbers, Numbers],
    *known: Numbers | None,
) -> Isotherms:
    """Returns the data, checked and sorted by temperature; arguments as in `master_curve`."""
    check_law(law)
    if kind not in get_args(Kind):
        raise ValueError(f"`kind={kind!r}` is refused: use one of {get_args(Kind)}.")
    if isinstance(isotherms, Measured):
        isotherms = isotherms.isotherms()
    curves = [_curve(i, isotherm, kind) for i, isotherm in enumerate(isotherms)]
    if len(curves) < 2:
        raise ValueError(f"`isotherms` holds {len(curves)}; at least 2 are needed.")
    kind = curves[0][0]
    if any(other != kind for other, *_ in curves):
        raise ValueError("`isotherms` are of different kinds; all must be measured alike.")
    curves.sort(key=lambda curve: curve[1])
    temperatures = np.array([temperature for _, temperature, _, _ in curves])
    check_positive("temperature", temperatures, "[K]")
    if float(temperatures[-1]) < COLDEST:
        raise ValueError(
            f"`isotherms` has temperatures up to {float(temperatures[-1]):g}; they are in kelvin."
        )
    for temperature in temperatures[1:][np.diff(temperatures) <= 0]:
        raise ValueError(f"`isotherms` has {temperature:g} K twice: join these first.")
    middle = len(curves) // 2
    if reference is not None:
        coldest, hottest = temperatures[[0, -1]]
        allowed = f"isotherms are from {coldest:g} to {hottest:g} K"
        check_values("reference", reference, allowed, at_least=coldest - 1, at_most=hottest + 1)
        middle = int(np.argmin(np.abs(temperatures - float(reference))))
    x, values = (jnp.concatenate([curve[i] for curve in curves]) for i in (2, 3))
    used = weights if kind == "frequency" else weights[:1]
    equilibrium, glassy, huber = known
    observations = observe(kind, x, values, used, equilibrium, glassy, None, huber)
    if observations.flows:
        raise ValueError("`equilibrium=0` is not available for creep at several temperatures.")
    return Isotherms(
        observations=observations,
        group=jnp.repeat(jnp.arange(len(curves)), np.array([len(x) for *_, x, _ in curves])),
        temperatures=jnp.asarray(temperatures),
        penalty=jnp.zeros(2),
        reference=middle,
        law=law,
        departs=sizes[0] > 0,
        lifts=sizes[1] > 0,
    )


def _curve(number, isotherm, kind) -> tuple[Any, ...]:
    """Kind, temperature, x and values of an isotherm."""
    if isinstance(isotherm, Measured):
        missing = ["`poisson`"] if isotherm.deformation != "tension" else []
        missing += ["`temperature`"] if isotherm.temperature is None else []
        if missing or isotherm.temperature is None:
            raise ValueError(
                f"`isotherms[{number}]` from {isotherm.path} must be in tension and have a "
                f"temperature: read the file with {' and '.join(missing)}."
            )
        kind = isotherm.kind
        isotherm = (np.mean(isotherm.temperature), isotherm.abscissa, isotherm.values)
    temperature, x, values = isotherm
    if not is_concrete(temperature):
        raise ValueError(f"`isotherms[{number}]` must have a concrete temperature.")
    x, values = as_float(x, "x"), as_numbers(values, "values")
    if x.ndim != 1 or x.shape != values.shape:
        raise ValueError(
            f"`isotherms[{number}]` has x of shape {x.shape} and values of {values.shape}; two "
            "one-dimensional arrays of equal length are needed."
        )
    return kind, float(temperature), x, values


# Shifts and series ------------------------------------------------------------------------------


def shifts_and_series(
    data: Isotherms, sizes: tuple[float, float], choose_series: Callable[[Series], tuple]
) -> tuple[tuple, Any]:
    """Returns unknowns, which of them are free, and the penalty; and the second of what
    `choose_series` returns."""

    def expecting(variance):
        """The problem with squares of departures weighed against residuals of this variance."""
        penalty = np.array([variance / size**2 if size > 0 else 0.0 for size in sizes])
        return shifted_series_of(dataclasses.replace(data, penalty=jnp.asarray(penalty))), penalty

    shared, _ = expecting(0.0)
    log_shift = _aligned(shared)
    law = least_squares(
        lambda p: shared.law_shifts(p) - log_shift,
        np.log(LAW_TYPICAL[data.law]),
        bounds=np.log(LAW_LIMITS[data.law]).T,
        loss="soft_l1",
    ).x
    if not data.departs:
        log_shift = shared.law_shifts(law)
    series = shared.shifted(log_shift, np.zeros(len(log_shift)))
    shortest, longest = series.time_limits()
    theta, _ = best_of_length(series, max(int(np.ceil((longest - shortest) / LN10)), 1))
    unknowns, penalty = shared.join(theta, law, log_shift), None
    # The residuals' variance is known only once the shifts are.
    for _ in range(2):
        series, residual, _, _ = shared.derivatives(unknowns)
        rows = series.measured
        shared, penalty = expecting(np.average(residual[rows] ** 2, weights=series.weights[rows]))
        unknowns = shared.minimise(unknowns, rtol=SEARCH)
    theta, path = choose_series(shared.shifted(*shared.shifts(unknowns)))
    start = np.concatenate([theta, *shared.split(unknowns)[1:]])
    unknowns = shared.minimise(start, rtol=0)
    lower, upper = shared.bounds(start)
    return (unknowns, (unknowns > lower) & (unknowns < upper), penalty), path


def shifted_solid_or_liquid(
    data: Isotherms, sizes: tuple[float, float], within: float | None
) -> tuple[Isotherms, tuple, tuple[Length, ...]]:
    """Returns the data, with E_eq = 0 if once shifted they need none; what was found; lengths."""

    def search_in(data):
        return shifts_and_series(data, sizes, lambda series: choose(series, within))

    found, path = search_in(data)
    shifted = at_reference(jnp.asarray(found[0]), data)
    if not may_be_liquid(shifted) or choose_solid_or_liquid(shifted, within)[0] is shifted:
        return data, found, path
    liquid = dataclasses.replace(data, observations=data.observations.as_liquid())
    return liquid, *search_in(liquid)


def _aligned(shared):
    """ln a of each isotherm, by fitting a spectrum to every two neighbours at trial distances."""
    distances = LN10 * np.arange(-0.5, 6.0, 0.25)
    count, steps = len(shared.data.temperatures), []
    for colder in range(count - 1):
        costs = []
        for distance in distances:
            shifts = distance * (np.arange(count) == colder)
            pair = np.isin(shared.group, (colder, colder + 1))
            part = shared.shifted(shifts, np.zeros(count)).restricted(pair)
            shortest, longest = part.time_limits()
            log_times = np.linspace(shortest, longest, int(4 * (longest - shortest) / LN10) + 2)
            strengths = non_negative(part, log_times)
            columns = np.concatenate([part.branches(log_times), part.static])
            relative = (part.known + strengths @ columns) / np.exp(part.log_values) - 1
            costs.append(part.weights @ relative**2)
        steps.append(distances[np.argmin(costs)])
    log_shift = -np.cumsum([0.0, *steps])
    return log_shift - log_shift[shared.data.reference]
