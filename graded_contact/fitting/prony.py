"""Prony series from measured moduli or compliances.

    omega, modulus = ...                      # rad/s, E' + iE'' in Pa
    fit = fit_prony(omega, modulus)
    print(fit.report())
    rubber = fit.material                     # a `Prony`, ready for a stack

The fit minimises the sum of squared logarithms of model over measurement. So every decade has the
same weight; in absolute squares the rubbery loss, which friction needs, has none. Strengths are
positive by construction, hence every fit is passive. Times are free within a decade of the data.

A relaxation form of N terms with E_eq > 0 can be written as a creep form of N terms, exactly: the
best fit of one kind is the best of the other, and `fit.material.creep()` is exact.
"""

import abc
import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Complex, Float

from ..core.checks import Numbers, as_float, as_poisson, optional, positive
from ..core.compilation import compiled
from ..core.display import shown
from ..materials.coverage import MeasuredRange, is_unknown
from ..materials.material import Prony
from ..materials.shift import as_temperature
from .implicit import optimum
from .observations import Loss, Observations, Unknowns, observe
from .quality import covariance, far_values, fit_errors, report_of
from .series import NEGLIGIBLE_STRENGTH, SeriesProblem, fixed_columns, problem_of
from .terms import Length


class AbstractFit(eqx.Module):
    """A fitted material, and how well it is known.

    **Fields:**

    - `theta`: the unknowns, shape `(unknowns,)`: logarithms of strengths, times, and the strength
      without a time (E_eq; of compliances 1/E_inf); then shifts.
    - `data`: the fitted observations.
    - `poisson`: Poisson's ratio of the material [1].
    - `path`: the best fits of every number of terms, if they were needed to choose it. Static.
    """

    theta: Unknowns
    data: Observations
    poisson: Float[Array, ""]
    path: tuple[Length, ...] = eqx.field(static=True)

    @property
    @abc.abstractmethod
    def material(self) -> Prony:
        """The fitted material."""

    def _problem(self) -> tuple[SeriesProblem, np.ndarray]:
        """Returns the least-squares problem, and its unknowns, in NumPy: not under `jit`."""
        return problem_of(self.data), np.asarray(self.theta)

    def covariance(self) -> Float[np.ndarray, "unknowns unknowns"]:
        """Returns the covariance of `theta`; errors of neighbours, on an isotherm, may be
        correlated."""
        return covariance(*self._problem())

    def warnings(self) -> tuple[str, ...]:
        """Returns sentences on what makes the fit doubtful, such as values far from it."""
        return far_values(*self._problem())

    def confidence(
        self, omega: Numbers, temperature: Numbers | None = None, *, level: float = 0.95
    ) -> tuple[Complex[Array, "*w"], Complex[Array, "*w"]]:
        """Returns `(lower, upper)`, limits of E'(ω) and, in the imaginary part, of E''(ω) [Pa].

        **Arguments:**

        - `omega`: angular frequencies [rad/s], positive.
        - `temperature`: of a master curve [K]; by default its reference.
        - `level`: probability that each limit pair encloses the true value.

        Outside the measured frequencies (of times, their reciprocals) and temperatures the limits
        are NaN: nothing was measured there. The logarithms of E' and E'' are linearised about the
        unknowns, shifts included. Limits assume that the errors scatter about a
        series of this length, with neighbours as correlated as the residuals show. Where storage
        and loss contradict each other, the true material may lie outside the limits.
        """
        if not 0 < level < 1:
            raise ValueError(f"`level={level!r}` must lie between 0 and 1.")
        omega = positive("omega", "[rad/s]", as_float)(omega)
        kelvin = optional(as_temperature)(temperature)
        reach = jnp.asarray(scipy.special.ndtri((1 + level) / 2))
        return _limits(self, omega, kelvin, jnp.asarray(self.covariance()), reach)


@compiled
def _limits(fit: AbstractFit, omega: Array, kelvin: Array | None, spread: Array, reach: Array):
    """The moduli that are `reach` standard deviations below and above a fit."""

    def logs(theta):
        material = dataclasses.replace(fit, theta=theta).material
        material = material if kelvin is None else material.at(kelvin)
        modulus = material.complex_modulus(omega)
        found = jnp.log(jnp.stack([modulus.real, modulus.imag]))
        return found, (found, is_unknown(omega, material.coverage()))

    slopes, (middle, outside) = jax.jacfwd(logs, has_aux=True)(fit.theta)
    away = reach * standard_error(slopes, spread)
    lower, upper = (jnp.where(outside, jnp.nan, jnp.exp(middle + end)) for end in (-away, away))
    return jax.lax.complex(*lower), jax.lax.complex(*upper)


def standard_error(slopes: Array, spread: Array | np.ndarray) -> Array:
    """Returns standard deviations of quantities from their slopes by unknowns."""
    return jnp.sqrt(jnp.einsum("...i,ij,...j->...", slopes, spread, slopes))


@shown("terms", "material", "errors")
class PronyFit(AbstractFit):
    """A fitted Prony series and its quality; fields as in `AbstractFit`."""

    @property
    def terms(self) -> int:
        """The number of terms that were fitted."""
        return (len(self.theta) - self.data.num_extras) // 2

    @property
    def material(self) -> Prony:
        """The fitted material."""
        return prony_material(self.theta, self.data, self.poisson)

    def predict(self, x: Numbers) -> Float[Array, "channels points"]:
        """Returns the fitted values at other frequencies or times.

        `x` are angular frequencies [rad/s] or times [s], shape `(points,)`. The rows are storage
        and loss modulus [Pa]; or one of moduli [Pa] or compliances [1/Pa].
        """
        x = as_float(x)
        known, static = fixed_columns(self.data, x, jnp)
        lowest = jnp.full(known.shape, -jnp.inf)
        series = dataclasses.replace(
            problem_of(self.data, jnp), x=x, known=known, static=static, log_values=lowest
        )
        return series.by_channel(series.model(self.theta))

    def errors(self) -> dict[str, float]:
        """Returns root-mean-squares of ln(model/measured) [1]: "total", "storage" and "loss".

        Moduli in time have the total only, and a modulus without measured values has none.
        """
        return fit_errors(*self._problem())

    def report(self) -> str:
        """Returns the fit as text: terms, errors, warnings and the lengths tried."""
        return report_of(self, self.warnings())


def fit_prony(
    x: Numbers,
    values: Numbers,
    *,
    kind: str = "frequency",
    terms: int | None = None,
    equilibrium: Numbers | None = None,
    weights: tuple[Numbers, Numbers] = (1.0, 1.0),
    poisson: Numbers = 0.5,
    loss: Loss = "linear",
) -> PronyFit:
    """Returns the Prony series nearest to measured moduli or compliances, in logarithms.

    Differentiable by every number given, if `terms` is given; derivatives are of the optimum
    (implicit).

    **Arguments:**

    - `x`: angular frequencies [rad/s], or times after the step of strain or stress [s], shape
      `(points,)`, in any order.
    - `values`: what was measured, shape `(points,)`, see `kind`; NaN is a missing value, also in
      one part of a complex modulus.
    - `kind`: "frequency" for E' + iE'' [Pa]; "relaxation" for E(t) [Pa]; or "creep" for the
      compliance J(t) = 1/E_inf + Σ_j H_j (1 - exp(-t/t_j)) [1/Pa] of a solid, whose exact
      relaxation form is the material.
    - `terms`: number of terms. By default the number with the least Bayes information criterion.
    - `equilibrium`: E_eq [Pa] if known, 0 for a liquid, such as a melt. By default fitted, for
      creep always.
    - `weights`: of the squared residuals of storage and of loss [1], each of shape `()` or
      `(points,)`; the first is also for values in time. A weight of 0 leaves a value out.
    - `poisson`: Poisson's ratio of the material [1].
    - `loss`: "linear" for least squares, or "soft_l1", by which values far from the others count
      less: such as SciPy's, beyond one standard deviation (by the median).

    Raises `ValueError` for input that cannot be fitted, such as moduli that are not positive.

    **Returns:** the material, and how well it is known.
    """
    data = observe(kind, x, values, weights, equilibrium)
    poisson = as_poisson(poisson)
    theta, data, path = optimum(data, terms, loss)
    return PronyFit(theta, data, poisson, path)


@compiled
def prony_material(theta: Unknowns, data: Observations, poisson: Numbers) -> Prony:
    """Returns the material with these unknowns, in relaxation form."""
    strengths, times, extras = map(jnp.exp, problem_of(data, jnp).split(theta))
    used = (data.x > 0) & jnp.any(data.weights > 0, axis=0)
    x = jax.lax.stop_gradient(data.x)
    ends = jnp.stack([jnp.min(jnp.where(used, x, jnp.inf)), jnp.max(jnp.where(used, x, 0))])
    ends = ends if data.kind == "frequency" else 1 / ends[::-1]  # a time t counts as 1/t
    common = {"poisson": poisson, "measured": MeasuredRange(ends)}
    if data.kind != "creep":
        equilibrium = data.equilibrium
        if equilibrium is None:  # exactly zero where the data need none
            smallest = jnp.min(jnp.where(data.weights > 0, data.values, jnp.inf))
            least = 1.001 * NEGLIGIBLE_STRENGTH * smallest
            equilibrium = jnp.where(extras[0] > least, extras[0], 0)
        return Prony(equilibrium=equilibrium, strengths=strengths, times=times, **common)
    glassy = 1 / extras[0]
    if not len(times):
        return Prony(equilibrium=glassy, strengths=strengths, times=times, **common)
    # Retardation times that coincide after the fit are separated by 1e-6.
    meet = jnp.abs(times[:, None] - times) < 1e-7 * times
    times = times * (1 + 1e-6 * jnp.sum(jnp.tril(meet, -1), axis=1))
    return Prony.from_creep(glassy, strengths, times, **common)
