"""Isotherms checked and joined_curves, and the search for their shifts and series together (NumPy).

The search aligns neighbours, then fits law, departures and series at once.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from ..core.checks import (
    Numbers,
    as_float,
    as_numbers,
    as_scalar,
    check_positive,
    check_values,
    is_concrete,
    short,
)
from ..materials.measured import Measured
from .lengths import SEARCH, Length, best_of_length, choose, non_negative
from .observations import Observations, Unknowns, observe
from .series import problem_of
from .shifts import LAW_LIMITS, LAW_TYPICAL, LN10, Isotherms, LawKind

COLDEST_SET = 100.0  # K; if all temperatures of a set are lower, they are thought to be in °C
Isotherm = tuple[Numbers, Numbers, Numbers]


# Isotherms as given -----------------------------------------------------------------------------


def joined_curves(
    isotherms: Measured | Sequence[Measured | Isotherm], kind: Any, law: Any,
    stds: tuple[float, float], reference: Any, weights: tuple[Numbers, Numbers],
    equilibrium: Numbers | None,
) -> Observations:  # fmt: skip
    """Returns the data, checked and sorted by temperature; arguments as in `master_curve`."""
    if law not in get_args(LawKind):
        raise ValueError(f"`law={law!r}` is refused: use one of {get_args(LawKind)}.")
    if isinstance(isotherms, Measured):
        isotherms = isotherms.isotherms()
    if not isinstance(isotherms, Sequence):
        raise ValueError(f"`isotherms={short(isotherms)}` must be a list of isotherms.")
    curves = [_curve(i, isotherm, kind) for i, isotherm in enumerate(isotherms)]
    if len(curves) < 2:
        raise ValueError(f"`isotherms` holds {len(curves)}; at least 2 are needed.")
    curves.sort(key=lambda curve: curve[1])
    kinds, kelvin, x, values = zip(*curves, strict=True)
    if len(set(kinds)) > 1:
        raise ValueError("`isotherms` are of different kinds; all must be measured alike.")
    temperatures = np.array(kelvin)
    check_positive("temperature", temperatures, "[K]")
    coldest, hottest = kelvin[0], kelvin[-1]
    if hottest < COLDEST_SET:
        raise ValueError(f"`isotherms` has temperatures up to {hottest:g}; they are in kelvin.")
    for twice in temperatures[1:][np.diff(temperatures) <= 0]:
        raise ValueError(f"`isotherms` has {twice:g} K twice: join these first.")
    middle = len(curves) // 2
    if reference is not None:
        as_scalar(reference, "reference")
        allowed = f"isotherms are from {coldest:g} to {hottest:g} K"
        check_values("reference", reference, allowed, at_least=coldest - 1, at_most=hottest + 1)
        middle = int(np.argmin(np.abs(temperatures - float(reference))))
    data = observe(kinds[0], jnp.concatenate(x), jnp.concatenate(values), weights, equilibrium)
    if data.flows:
        raise ValueError("`equilibrium=0` is not available for creep at several temperatures.")
    known = Isotherms(
        group=jnp.repeat(jnp.arange(len(x)), np.array([len(points) for points in x])),
        temperatures=jnp.asarray(temperatures),
        penalty=jnp.zeros(2),
        reference=middle,
        law=law,
        stds=stds,
    )
    return dataclasses.replace(data, isotherms=known)


def _curve(number, isotherm, kind) -> tuple[Any, ...]:
    """Kind, temperature, x and values of an isotherm."""
    if isinstance(isotherm, Measured):
        missing = ["`poisson`"] if isotherm.deformation != "tension" else []
        missing += ["`temperature`"] if isotherm.temperature is None else []
        if isotherm.temperature is None or missing:
            raise ValueError(
                f"`isotherms[{number}]` from {isotherm.path} must be in tension and have a "
                f"temperature: read the file with {' and '.join(missing)}."
            )
        kind = isotherm.kind
        isotherm = (np.mean(isotherm.temperature), isotherm.abscissa, isotherm.values)
    if not isinstance(isotherm, Sequence) or len(isotherm) != 3:
        needed = "`(temperature, x, values)` is needed"
        raise ValueError(f"`isotherms[{number}]={short(isotherm)}` is refused: {needed}.")
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


def with_penalty(data: Observations, penalty: Any) -> Observations:
    """Returns the data with other weights of the squares of departures and of ln b."""
    return eqx.tree_at(lambda data: data.isotherms.penalty, data, jnp.asarray(penalty))


def shifts_and_series(data: Observations, terms: int | None) -> tuple[tuple, tuple[Length, ...]]:
    """Returns unknowns, which of them are free, and the penalty; and all lengths tried."""
    series, isotherms = problem_of(data), data.isotherms
    assert isotherms is not None
    log_shift = _aligned(series, isotherms)
    law = least_squares(
        lambda p: isotherms.law_shifts(p) - log_shift,
        np.log(LAW_TYPICAL[isotherms.law]),
        bounds=np.log(LAW_LIMITS[isotherms.law]).T,
        loss="soft_l1",
    ).x
    by_law, (_, departures, lifts) = isotherms.law_shifts(law), isotherms.counts
    steps = isotherms.others[:departures] @ (log_shift - by_law)
    shifts = np.concatenate([law, steps, np.zeros(lifts)])
    alone = series.at(shifts)
    theta, _ = best_of_length(alone, max(len(alone.time_grid(1)) - 1, 1))
    unknowns, penalty = np.concatenate([theta, shifts]), np.zeros(2)
    # The residuals' variance is known only once the shifts are.
    for _ in range(2):
        variance = series.rms(unknowns) ** 2
        penalty = np.array([variance / std**2 if std > 0 else 0.0 for std in isotherms.stds])
        series = problem_of(with_penalty(data, penalty))
        unknowns, _ = series.minimise(unknowns, rtol=SEARCH, max_steps=150)
    theta, path = choose(series.at(unknowns), terms)
    start = np.concatenate([theta, unknowns[len(unknowns) - len(shifts) :]])
    lower, upper = series.bounds(start)
    unknowns, _ = series.minimise(start, rtol=0, max_steps=150)
    return (unknowns, (unknowns > lower) & (unknowns < upper), penalty), path


@eqx.filter_jit
def at_reference(unknowns: Unknowns, data: Observations) -> Observations:
    """Returns all measurements as if made at the reference temperature."""
    isotherms = data.isotherms
    assert isotherms is not None
    along, across = (jnp.exp(part)[isotherms.group] for part in isotherms.shifts(unknowns))
    x = data.x * along if data.kind == "frequency" else data.x / along
    values = jnp.where(data.weights > 0, data.values / across, 1)
    return dataclasses.replace(data, x=x, values=values, isotherms=None)


def _restricted(series, points):
    """The problem of some of the points, given as a mask."""
    rows = np.tile(points, len(series.weights) // len(series.x))
    parts = {name: getattr(series, name)[rows] for name in ("log_values", "weights", "known")}
    return dataclasses.replace(
        series, x=series.x[points], static=series.static[:, rows], num_ends=0, **parts
    )


def _aligned(series, isotherms):
    """ln a of each isotherm, by fitting a spectrum to every two neighbours at trial distances."""
    distances = LN10 * np.arange(-0.5, 6.0, 0.25)
    count, steps = len(isotherms.temperatures), []
    for colder in range(count - 1):
        costs = []
        for distance in distances:
            shifts = distance * (np.arange(count) == colder)
            pair = np.isin(series.group, (colder, colder + 1))
            part = _restricted(series.shifted(shifts, np.zeros(count)), pair)
            log_times = part.time_grid(4)
            strengths = non_negative(part, log_times)
            columns = np.concatenate([part.branches(log_times), part.static])
            relative = (part.known + strengths @ columns) / np.exp(part.log_values) - 1
            costs.append(part.weights @ relative**2)
        steps.append(distances[np.argmin(costs)])
    log_shift = -np.cumsum([0.0, *steps])
    return log_shift - log_shift[isotherms.reference]
