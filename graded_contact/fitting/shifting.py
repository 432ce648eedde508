"""Isotherms checked and joined, and the search for their shifts and series together (NumPy).

The search starts from several alignments of neighbours, fits law, departures and series at once,
and keeps the end of the least criterion.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np

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
from ..core.compilation import compiled
from ..materials.measured import Measured
from .alignment import first_shifts
from .lengths import SEARCH, Length, best_of_length, choose, criterion
from .observations import Observations, Unknowns, observe
from .series import SeriesProblem, problem_of
from .shifts import Isotherms, LawKind, log_shifts

COLDEST_SET = 100.0  # K; if all temperatures of a set are lower, they are thought to be in °C
ROUNDS = 4  # of choosing the number of terms
SETTLED = 0.7  # times the error before: the number of terms then shows
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
        measured = f"isotherms are from {coldest:g} to {hottest:g} K"
        allowed = f'{measured}. With `law="wlf"` take `exported().at(temperature)` of the result'
        check_values("reference", reference, allowed, at_least=coldest - 1, at_most=hottest + 1)
        middle = int(np.argmin(np.abs(temperatures - float(reference))))
    data = observe(kinds[0], jnp.concatenate(x), jnp.concatenate(values), weights, equilibrium)
    if data.flows:
        raise ValueError("`equilibrium=0` is not available for creep at several temperatures.")
    known = Isotherms(
        group=jnp.asarray(np.repeat(np.arange(len(x)), [len(points) for points in x])),
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


def shifts_and_series(
    data: Observations, terms: int | None
) -> tuple[np.ndarray, SeriesProblem, tuple[Length, ...]]:
    """Returns the unknowns, the problem that they solve, and all lengths tried."""
    series, path = problem_of(data), ()
    assert data.isotherms is not None
    ends = [_end(data, start) for start in first_shifts(series, data.isotherms)]
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
        unknowns, cost = series.minimise(unknowns, rtol=SEARCH, max_steps=150)
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
