"""Prony series from measured moduli or compliances.

    omega, modulus = ...                      # rad/s, E' + iE'' in Pa
    fit = fit_prony(omega, modulus)
    print(fit.report())
    rubber = fit.material                     # a `Prony`, ready for a stack

Minimised is the sum of squared logarithms of model over measurement, so that every decade counts
alike; in absolute squares the rubbery loss, which friction lives on, has no say. Strengths are
positive by construction, hence every fit is passive. Times are free within a decade of the data.

The relaxation forms of N terms with E_eq > 0 and the creep forms of N terms are the same functions:
the best of one kind is the best of the other, and `fit.material.creep()` is exact.
"""

import dataclasses

import numpy as np

from ..core.checks import Numbers, as_numbers, as_scalar, check_poisson, check_types
from .lengths import best_of_length, best_spectrum
from .model import objective, series_of
from .observations import Observations, concrete, observe
from .optimum import attach_derivative, search
from .quality import jumps_of, rms
from .result import Length, PronyFit, choose, liquid_of

AS_GOOD = 1.05  # times the error: a liquid that does no worse is what was measured
FOREIGN = 0.3  # median log residual from which on data are no linear viscoelastic moduli


@check_types
def fit_prony(
    omega: Numbers,
    modulus: Numbers,
    *,
    terms: int | None = None,
    within: float | None = None,
    times: Numbers | None = None,
    start: PronyFit | None = None,
    equilibrium: Numbers | None = None,
    glassy: Numbers | None = None,
    storage_weight: Numbers = 1.0,
    loss_weight: Numbers = 1.0,
    huber: Numbers | None = None,
    poisson: Numbers = 0.5,
    throw: bool = True,
) -> PronyFit:
    """Returns the Prony series nearest to a measured complex modulus, in logarithms.

    Differentiable by every number given, if the number of terms does not depend on them (`terms`,
    `times` or `start`); derivatives are those of the optimum (implicit).

    **Arguments:**

    - `omega`: angular frequencies [rad/s], shape `(points,)`, in any order.
    - `modulus`: E' + iE'' [Pa], shape `(points,)`; NaN in either part is a missing value.
    - `terms`: number of terms. By default that of the least Bayes information criterion.
    - `within`: instead, the smallest number whose error is within this fraction of the least.
    - `times`: instead, given relaxation times [s], shape `(terms,)`.
    - `start`: instead, an earlier fit to similar data to begin from, whose length is kept.
    - `equilibrium`: E_eq [Pa] if known, 0 for a liquid. By default fitted; with the number of
      terms free it is 0 where loss exceeds storage at the lowest frequencies and the error is no
      larger for it, as for melts.
    - `glassy`: E_inf [Pa] if known; by default what follows from the branches.
    - `storage_weight`, `loss_weight`: weights of the squared residuals [1], shape `()` or
      `(points,)`; a weight of 0 leaves a value out.
    - `huber`: log residual [1] from which on a value counts linearly (outliers); by default none.
    - `poisson`: Poisson's ratio of the material [1].
    - `throw`: whether to raise for data that no positive spectrum comes near to.

    Raises `ValueError` for input that cannot be fitted, such as moduli that are not positive, and
    for data half of which are off by more than 30 % from every positive spectrum.

    **Returns:** the material, and how well it is known.
    """
    modulus = as_numbers(modulus, "modulus")
    data = observe(
        "frequency",
        omega,
        {
            "modulus.real": (modulus.real, storage_weight),
            "modulus.imag": (modulus.imag, loss_weight),
        },
        equilibrium=equilibrium,
        glassy=glassy,
        times=times,
        huber=huber,
    )
    return _fit(data, terms, within, start, poisson, throw)


@check_types
def fit_relaxation(
    time: Numbers,
    modulus: Numbers,
    *,
    terms: int | None = None,
    within: float | None = None,
    times: Numbers | None = None,
    start: PronyFit | None = None,
    equilibrium: Numbers | None = None,
    glassy: Numbers | None = None,
    weight: Numbers = 1.0,
    huber: Numbers | None = None,
    poisson: Numbers = 0.5,
    throw: bool = True,
) -> PronyFit:
    """Returns the Prony series nearest to a measured relaxation modulus E(t), in logarithms.

    **Arguments:**

    - `time`: times after the step of strain [s], shape `(points,)`.
    - `modulus`: E(t) [Pa], shape `(points,)`; NaN is a missing value.
    - `weight`: weights of the squared residuals [1], shape `()` or `(points,)`.

    The others, and what is raised: as `fit_prony`.

    **Returns:** as `fit_prony`.
    """
    data = observe(
        "relaxation",
        time,
        {"modulus": (modulus, weight)},
        equilibrium=equilibrium,
        glassy=glassy,
        times=times,
        huber=huber,
    )
    return _fit(data, terms, within, start, poisson, throw)


@check_types
def fit_creep(
    time: Numbers,
    compliance: Numbers,
    *,
    terms: int | None = None,
    within: float | None = None,
    times: Numbers | None = None,
    start: PronyFit | None = None,
    equilibrium: Numbers | None = None,
    glassy: Numbers | None = None,
    weight: Numbers = 1.0,
    huber: Numbers | None = None,
    poisson: Numbers = 0.5,
    throw: bool = True,
) -> PronyFit:
    """Returns the series nearest to a measured creep compliance, in logarithms.

    Fitted is J(t) = 1/E_inf + Σ_j H_j (1 - exp(-t/t_j)), with + t/η for a liquid
    (`equilibrium=0`); the material is its exact relaxation form.

    **Arguments:**

    - `time`: times after the step of stress [s], shape `(points,)`.
    - `compliance`: strain over stress [1/Pa], shape `(points,)`; NaN is a missing value.
    - `times`: given retardation times t_j [s].
    - `weight`: weights of the squared residuals [1], shape `()` or `(points,)`.

    The others, and what is raised: as `fit_prony`.

    **Returns:** as `fit_prony`.
    """
    data = observe(
        "creep",
        time,
        {"compliance": (compliance, weight)},
        equilibrium=equilibrium,
        glassy=glassy,
        times=times,
        huber=huber,
    )
    return _fit(data, terms, within, start, poisson, throw)


def _fit(data, terms, within, start, poisson, throw):
    poisson = as_scalar(poisson, "poisson")
    check_poisson("poisson", poisson)
    choices = {"terms": terms, "within": within, "times": data.times, "start": start}
    given = [name for name, choice in choices.items() if choice is not None]
    if len(given) > 1:
        raise ValueError(f"`{given[0]}` and `{given[1]}` both set the number of terms: give one.")
    path, begin = (), None
    if data.times is not None:
        terms = data.times.size
    elif start is not None:
        begin, terms = _unknowns(start, data), start.terms
    elif terms is None:
        require_known(data)
        data, begin, path = solid_or_liquid(data, within)
        terms = (len(begin) - data.num_extras) // 2
    check_terms(data, terms)

    def find(data, begin):
        series = series_of(data)
        if begin is None:
            theta, _ = best_of_length(series, 0 if data.times is not None else terms)
        else:
            theta, _ = series.minimise(np.asarray(begin), rtol=0)
        return theta, series.within_bounds(theta)

    theta, free = search(find, (data.num_unknowns(terms),), data, begin)
    theta = attach_derivative(objective, theta, free, data)
    fit = PronyFit(theta=theta, data=data, poisson=poisson, path=path)
    if throw and concrete(data):
        refuse_nonsense(fit)
    return fit


def solid_or_liquid(
    data: Observations, within: float | None
) -> tuple[Observations, np.ndarray, tuple[Length, ...]]:
    """Returns the data, with E_eq = 0 where they ask for none; the unknowns; lengths tried.

    They ask for none if no spectrum near to them is better for it: slow branches far outside would
    stand for any E_eq.
    """
    series = series_of(data)
    begin, path = choose(series, within)
    if (liquid := liquid_of(data)) is not None:
        near = dataclasses.replace(series_of(liquid), reach=series.reach)
        other, lengths = choose(near, within)
        if rms(near, other) <= AS_GOOD * rms(series, begin):
            return liquid, other, lengths
    return data, begin, path


def _unknowns(start, data):
    alike = (start.data.kind, start.data.num_extras) == (data.kind, data.num_extras)
    if not alike or start.data.times is not None:
        raise ValueError(
            f"`start` is a fit of kind {start.data.kind!r} in which other end values were known, "
            "or the times; it must be one of the same form as is asked for."
        )
    return start.theta


def require_known(data: Observations) -> None:
    """Raises `ValueError` under transformations: the number of terms depends on the values."""
    if not concrete(data):
        raise ValueError(
            "`terms=None` needs values that are known: under `jit`, `grad` or `vmap` give "
            "`terms`, `times`, or `start` from a fit to similar data."
        )


def check_terms(data: Observations, terms: int) -> None:
    """Raises `ValueError` for a number of terms that the data cannot have."""
    least = 0 if data.num_extras or data.times is not None else 1
    if not isinstance(terms, int | np.integer) or terms < least:
        raise ValueError(f"`terms={terms}` must be a whole number, at least {least}.")
    if concrete(data) and data.times is None:
        count, unknowns = int(np.sum(np.asarray(data.weights) > 0)), data.num_unknowns(terms)
        if unknowns > count:
            raise ValueError(
                f"`terms={terms}` has {unknowns} unknowns, more than the {count} measured values."
            )


def refuse_nonsense(fit: PronyFit) -> None:
    """Raises `ValueError` if half of the data are far from every positive spectrum."""
    series = series_of(fit.data)
    if _typical(series, np.asarray(fit.theta)) < FOREIGN:
        return
    off = _typical(series, best_spectrum(series)[0])
    if off > FOREIGN:
        raise ValueError(
            f"{jumps_of(series)}Half of the measured values are off by more than "
            f"{np.expm1(off):.0%} from every positive spectrum (moduli grow with frequency and "
            "fall with time; storage and loss have one spectrum). Are the columns in the right "
            "order and in one unit? Is a given `equilibrium` or `glassy` compatible with them? A "
            "weight of 0 leaves a channel out (`loss_weight`), and `throw=False` fits them as they "
            "are."
        )


def _typical(series, theta):
    """The median size of the log residuals, of the worse channel.

    A channel of small weight is not trusted, and may be off by as much more.
    """
    shape = (-1, len(series.x))
    trust = np.sqrt(series.weights / np.max(series.weights)).reshape(shape)
    sizes = trust * np.abs(series.residual(series.model(theta))).reshape(shape)
    rows = zip(sizes, series.measured.reshape(shape), strict=True)
    return max(float(np.median(size[counted])) for size, counted in rows if np.any(counted))
