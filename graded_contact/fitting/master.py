"""Master curves: one Prony series and one shift law from measurements at several temperatures.

Shifts and spectrum are fitted together, to storage and loss at once, so that what is shifted is a
material. Where an isotherm is flat its shift is ill determined (by decades, below the glass
transition). Shifts are therefore tied to a law, WLF or Arrhenius, from which each may depart by an
amount expected beforehand, and their uncertainty is reported.
"""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.special import ndtri

from ..core.checks import Numbers, as_float, check_poisson, check_positive, check_types
from ..core.display import shown
from ..files.moduli.points import Measured
from ..rheology.material import Prony
from ..rheology.measured import MeasuredRange
from ..rheology.shift import AbstractShift
from .isotherms import Isotherm, isotherms_of, size_of
from .lengths import best_of_length
from .master_report import report_of
from .observations import concrete
from .optimum import attach_derivative, search
from .prony import check_terms, refuse_nonsense, require_known
from .quality import rms
from .result import PronyFit, limits_where_known
from .shifted_observations import (
    Isotherms,
    at_reference,
    law_of,
    log_shift_of,
    log_vertical_of,
    shared_objective,
    shared_series_of,
    shift_of,
)
from .shifted_series import LN10
from .shifting import shifted_solid_or_liquid, shifts_and_series
from .uncertainty import covariance

SERVES = 1.05  # times the error with the shifts as found: a law that does no worse replaces them


@shown("law", "temperatures", "log10_shifts", "vertical_shifts", "fit")
class MasterCurve(eqx.Module):
    """A master curve: a fitted series with its shifts.

    **Fields:**

    - `fit`: the series, fitted to all data shifted to the reference temperature. Its errors and
      floor are those of the master curve; its `confidence` takes the shifts as known.
    - `unknowns`: of series and shifts together, see `shifted_series`.
    - `data`: what was fitted.
    """

    fit: PronyFit
    unknowns: Float[Array, " unknowns"]
    data: Isotherms

    @property
    def law(self) -> AbstractShift:
        """The fitted law about the reference temperature, without departures from it."""
        return law_of(self.unknowns, self.data)

    @property
    def shift(self) -> AbstractShift:
        """The shifts as found: a table, or the law if `scatter` and `vertical` are 0."""
        return shift_of(self.unknowns, self.data)

    @property
    def material(self) -> Prony:
        """The material at the reference temperature; `material.at(T)` is that at another.

        It carries the shifts as found, and so has the error of the fit on every isotherm; and the
        temperatures of the isotherms, beyond which it was not measured.
        """
        return self._material(self.shift)

    def law_material(self) -> Prony:
        """Returns the material with the law alone, which also holds between and beyond isotherms.

        `law_error` says how far it is off.
        """
        return self._material(self.law)

    def law_error(self) -> float:
        """Returns the rms log error on all isotherms of the series shifted by the law alone."""
        self._require_known()
        shared = shared_series_of(self.data)
        by_law = shared.law.shifts(shared.split(np.asarray(self.unknowns)).law)[0]
        return rms(shared.shifted(by_law, np.zeros_like(by_law)), np.asarray(self.fit.theta))

    def exported(self) -> Prony:
        """Returns the material to hand on: with the law if it serves as well as the shifts found.

        It does where its error is at most 1.05 times that of the fit and no constant has run to
        its bound; otherwise the material carries the table of shifts.
        """
        return self.law_material() if self._law_serves() else self.material

    def _law_serves(self):
        bounded = self._constants_at_bounds()
        return not bounded and self.law_error() <= SERVES * self.fit.errors().total

    def _constants_at_bounds(self):
        """Which unknowns of the law are no result but the end of the search."""
        shared = shared_series_of(self.data)
        found = shared.split(np.asarray(self.unknowns)).law
        lower, upper = shared.law.bounds
        return bool(np.any((found < lower + 1e-3) | (found > upper - 1e-3)))

    def _material(self, shift):
        material = self.fit.material
        assert material.measured is not None
        measured = MeasuredRange(material.measured.omega, self.temperatures[np.array([0, -1])])
        return dataclasses.replace(material, shift=shift, measured=measured)

    @property
    def temperatures(self) -> Float[Array, " isotherms"]:
        """Temperatures of the isotherms [K], increasing."""
        return self.data.temperatures

    @property
    def log10_shifts(self) -> Float[Array, " isotherms"]:
        """log10 a_T of the isotherms; 0 at the reference."""
        return log_shift_of(self.unknowns, self.data) / LN10

    @property
    def vertical_shifts(self) -> Float[Array, " isotherms"]:
        """b_T of the isotherms: moduli there are b_T (creep: compliances) times the master's."""
        return jnp.exp(log_vertical_of(self.unknowns, self.data))

    def shift_deviations(
        self,
    ) -> tuple[Float[Array, " isotherms"], Float[Array, " isotherms"]]:
        """Returns standard deviations of log10 a_T and of ln b_T.

        Large ones tell of isotherms too flat to be placed by anything but the law.
        """
        spread = self.covariance()
        shifts = jax.jacfwd(log_shift_of)(self.unknowns, self.data) / LN10
        verticals = jax.jacfwd(log_vertical_of)(self.unknowns, self.data)
        return _deviation(shifts, spread), _deviation(verticals, spread)

    def confidence(
        self, omega: Numbers, temperature: Numbers | None = None, *, level: float = 0.95
    ) -> tuple[Complex[Array, "*w"], Complex[Array, "*w"]]:
        """Returns `(lower, upper)` limits of E*(ω) at a temperature, as `PronyFit.confidence`.

        The uncertainty of the shifts is included. `temperature` [K] is by default the reference;
        beyond the isotherms all limits are NaN.
        """
        if not 0 < level < 1:
            raise ValueError(f"`level={level!r}` must lie between 0 and 1.")
        omega = as_float(omega, "omega")
        check_positive("omega", omega, "[rad/s]")

        def logs(unknowns):
            modulus = _at(self.with_unknowns(unknowns).material, temperature).modulus(omega)
            return jnp.log(jnp.stack([modulus.real, modulus.imag]))

        middle, slopes = logs(self.unknowns), jax.jacfwd(logs)(self.unknowns)
        reach = ndtri((1 + level) / 2) * _deviation(slopes, self.covariance())
        known = _at(self.material, temperature).coverage()
        return limits_where_known(omega, known, middle - reach, middle + reach)

    def with_unknowns(self, unknowns: Float[Array, " unknowns"]) -> "MasterCurve":
        """Returns the master curve with other `unknowns`, those of its series included."""
        return eqx.tree_at(
            lambda curve: (curve.unknowns, curve.fit.theta),
            self,
            (unknowns, unknowns[: len(self.fit.theta)]),
        )

    def report(self) -> str:
        """Returns shifts with their uncertainty, then the report of the fit, as text."""
        return report_of(self)

    def _require_known(self):
        if not concrete(self.data.observations):
            raise ValueError("The quality of a fit is not available under `jit` or `grad`.")

    def covariance(self) -> Float[np.ndarray, "unknowns unknowns"]:
        """Returns the covariance of `unknowns`; neighbours on an isotherm may err alike."""
        self._require_known()
        shared, unknowns = shared_series_of(self.data), np.asarray(self.unknowns)
        series, residual, jacobian, _ = shared.derivatives(unknowns)
        lower, upper = shared.bounds(unknowns)
        free = (unknowns > lower) & (unknowns < upper)
        penalty = shared.penalty(unknowns)
        return covariance(series, residual, jacobian, free, penalty, shared.group)


@check_types
def master_curve(
    isotherms: Measured | Sequence[Measured | Isotherm],
    *,
    kind: str = "frequency",
    law: str = "wlf",
    scatter: Numbers = 0.3,
    vertical: Numbers = 0.0,
    reference: Numbers | None = None,
    terms: int | None = None,
    within: float | None = None,
    equilibrium: Numbers | None = None,
    glassy: Numbers | None = None,
    weight: Numbers = 1.0,
    loss_weight: Numbers | None = None,
    huber: Numbers | None = None,
    poisson: Numbers = 0.5,
    throw: bool = True,
) -> MasterCurve:
    """Returns the Prony series and the shifts that together are nearest to all isotherms.

    **Arguments:**

    - `isotherms`: at least two, each `(temperature [K], x, values)` with frequencies or times `x`
      and moduli or compliances `values` as in `fit_prony`, `fit_relaxation` and `fit_creep`; or
      what `read_moduli(path)` returned.
    - `kind`: "frequency", "relaxation" or "creep"; files know their own.
    - `law`: "wlf" or "arrhenius".
    - `scatter`: expected departure of log10 a_T from the law [decades]; 0 holds the shifts to it,
      3 leaves them practically free.
    - `vertical`: expected size of ln b_T [1], such as 0.1; 0 for no vertical shifts.
    - `reference`: the isotherm nearest to this temperature [K] stays in place; by default the
      middle one.
    - `weight`, `loss_weight`: of the squared residuals [1]; the latter, of loss moduli, is by
      default the same.

    The others: as `fit_prony`. Differentiable if `terms` is given; what
    `scatter` and `vertical` mean beside the error of the fit then counts as known.

    **Returns:** shifts, their law, and the fit of the shifted isotherms.

    **Raises:** `ValueError` as `fit_prony`, and for fewer than two isotherms or not in kelvin.
    """
    poisson = as_float(poisson, "poisson")
    check_poisson("poisson", poisson)
    sizes = size_of("scatter", scatter) * LN10, size_of("vertical", vertical)
    data = isotherms_of(
        isotherms, kind, law, sizes, reference,
        channels=(weight, weight if loss_weight is None else loss_weight),
        equilibrium=equilibrium, glassy=glassy, huber=huber,
    )  # fmt: skip
    if terms is not None and within is not None:
        raise ValueError("`terms` and `within` both set the number of terms: give one.")
    if terms is None:
        require_known(data.observations)
        data, found, path = shifted_solid_or_liquid(data, sizes, within)
        unknowns, free, penalty = map(jnp.asarray, found)
    else:
        check_terms(data.observations, terms)
        count = data.observations.num_unknowns(terms) + data.num_shift_unknowns
        unknowns, free, penalty = search(
            lambda data: shifts_and_series(
                data, sizes, lambda s: (best_of_length(s, terms)[0], ())
            )[0],
            (count, 2),
            data,
        )
        path = ()
    data = eqx.tree_at(lambda d: d.penalty, data, penalty)
    unknowns = attach_derivative(shared_objective, unknowns, free, data)
    fit = PronyFit(
        theta=unknowns[: len(unknowns) - data.num_shift_unknowns],
        data=at_reference(unknowns, data),
        poisson=poisson,
        path=path,
    )
    if throw and concrete(fit.data):
        refuse_nonsense(fit)
    return MasterCurve(fit=fit, unknowns=unknowns, data=data)


def _at(material, temperature):
    return material if temperature is None else material.at(temperature)


def _deviation(slopes, spread):
    return jnp.sqrt(jnp.einsum("...i,ij,...j->...", slopes, spread, slopes))
