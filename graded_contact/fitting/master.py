"""Master curves: one Prony series and one shift law from measurements at several temperatures.

Shifts and spectrum are fitted together, to storage and loss at once, so that what is shifted is a
material. Where an isotherm is flat its shift is ill determined (by decades, below the glass
transition). Shifts are therefore tied to a law, WLF or Arrhenius, from which each may depart by an
amount expected beforehand, and their uncertainty is reported.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import (
    Numbers,
    as_scalar,
    check_poisson,
    check_values,
    is_concrete,
)
from ..core.compilation import compiled
from ..core.display import shown
from ..materials.coverage import MeasuredRange
from ..materials.material import Prony
from ..materials.measured import Measured
from ..materials.shift import AbstractShift, TabulatedShift
from .alignment import NUM_STARTS, gaps
from .implicit import attach_derivative, search
from .lengths import check_terms, choose_liquid
from .prony import AbstractFit, PronyFit, deviation, refuse_nonsense
from .quality import percent
from .series import objective, problem_of
from .shifting import Isotherm, at_reference, joined_curves, shifts_and_series, with_found
from .shifts import LAW_LIMITS, LN10, Isotherms

SERVES = 1.05  # times the error with the fitted shifts: a law that does no worse replaces them
RIVAL = 0.1  # decades from which on other shifts are another result
STEEP_SHIFT = 0.4  # decades per kelvin, two within 5 K


@shown("law", "temperatures", "log10_shifts", "vertical_shifts", "fit")
class MasterCurve(AbstractFit):
    """A master curve: a fitted series with its shifts.

    Fields as in `AbstractFit`; `data` are the isotherms, as measured.
    """

    @property
    def isotherms(self) -> Isotherms:
        """The temperatures, and what was expected of the shifts."""
        assert self.data.isotherms is not None
        return self.data.isotherms

    @property
    def fit(self) -> PronyFit:
        """The series, fitted to all data shifted to the reference temperature.

        Its errors and floor are those of the master curve; its `confidence` takes the shifts as
        known.
        """
        series = self.theta[: len(self.theta) - self.data.num_shifts]
        return PronyFit(series, at_reference(self.theta, self.data), self.poisson, self.path)

    @property
    def law(self) -> AbstractShift:
        """The fitted law about the reference temperature, without departures from it."""
        return self.isotherms.law_of(self.isotherms.split(self.theta)[0])

    @property
    def shift(self) -> AbstractShift:
        """The fitted shifts: a table, or the law if both standard deviations of shifts are 0."""
        if not any(self.isotherms.stds):
            return self.law
        across = self.vertical_shifts
        # Moduli change by the reciprocal of the factor of a compliance.
        across = 1 / across if self.data.kind == "creep" else across
        return TabulatedShift(
            temperatures=self.temperatures,
            log10_factors=self.log10_shifts,
            reference=self.temperatures[self.isotherms.reference],
            vertical_factors=across if self.isotherms.stds[1] else None,
        )

    @property
    def material(self) -> Prony:
        """The material at the reference temperature; `material.at(T)` is that at another.

        It carries the fitted shifts, and so has the error of the fit on every isotherm; and the
        temperatures of the isotherms, beyond which it was not measured.
        """
        return self._material(self.shift)

    def law_material(self) -> Prony:
        """Returns the material with the law alone, which also holds between and beyond isotherms.

        Its error on the isotherms is `law_error`.
        """
        return self._material(self.law)

    def law_error(self) -> float:
        """Returns the rms log error on all isotherms of the series shifted by the law alone."""
        series, theta = self._problem()
        by_law = self.isotherms.law_shifts(self.isotherms.split(theta)[0])
        single = series.shifted(by_law, np.zeros_like(by_law))
        return single.rms(theta[: len(theta) - series.num_shifts])

    def exported(self) -> Prony:
        """Returns the material for export: with the law if it fits as well as the fitted shifts.

        It does where its error is at most 1.05 times that of the fit and no constant has run to
        its bound; otherwise the material carries the table of shifts.
        """
        serves = self.law_error() <= SERVES * self.fit.errors().total
        return self.law_material() if serves and not self._at_bounds() else self.material

    @property
    def temperatures(self) -> Float[Array, " isotherms"]:
        """Temperatures of the isotherms [K], increasing."""
        return self.isotherms.temperatures

    @property
    def log10_shifts(self) -> Float[Array, " isotherms"]:
        """log10 a_T of the isotherms; 0 at the reference."""
        return self.isotherms.shifts(self.theta)[0] / LN10

    @property
    def vertical_shifts(self) -> Float[Array, " isotherms"]:
        """b_T of the isotherms: moduli there are b_T (creep: compliances) times the master's."""
        return jnp.exp(self.isotherms.shifts(self.theta)[1])

    def shift_deviations(self) -> tuple[Float[Array, " isotherms"], Float[Array, " isotherms"]]:
        """Returns standard deviations of log10 a_T and of ln b_T.

        They are large for isotherms too flat to be placed by anything but the law.
        """
        spread = self.covariance()
        along, across = _slopes(self.isotherms, self.theta)
        return deviation(along / LN10, spread), deviation(across, spread)

    def report(self) -> str:
        """Returns shifts with their uncertainty, then the report of the fit, as text."""
        import pandas as pd

        along, across = self.shift_deviations()
        columns = (self.temperatures, self.log10_shifts, along, self.vertical_shifts, across)
        table = pd.DataFrame(np.transpose(columns)).to_string(
            index=False,
            header=["T [K]", "log10 a_T", "+-", "b_T", "+-"],
            formatters=[f"{{:.{digits}f}}".format for digits in (2, 3, 3, 4, 4)],
        )
        doubts = [f"Warning: {sentence}" for sentence in self.warnings()]
        lines = [*_law_words(self), "", table, *_step_words(self), *doubts, "", self.fit.report()]
        return "\n".join(lines)

    def warnings(self) -> tuple[str, ...]:
        """Returns sentences on shifts that the overlap of neighbours does not determine."""
        series, theta = self._problem()
        kelvin = np.asarray(self.temperatures)
        pairs = itertools.pairwise(kelvin)
        apart = [f"{a:.2f} and {b:.2f} K" for (a, b), gap in
                 zip(pairs, gaps(series, theta), strict=True) if gap > 0]  # fmt: skip
        said = []
        if apart:
            said.append(
                f"The shifted curves of {', '.join(apart)} do not overlap: only the law shows how "
                "far they lie apart. Measure at more temperatures or frequencies."
            )
        slopes = self.isotherms.slopes(theta)[0]
        along = np.asarray(self.isotherms.rivals)[:, : len(slopes)] @ slopes
        far = np.max(np.abs(along), axis=0, initial=0) / LN10
        if np.any(far > RIVAL):
            which = ", ".join(f"{kelvin[i]:.2f}" for i in np.flatnonzero(far > RIVAL))
            said.append(
                f"Other shifts, by up to {np.max(far):.2g} decades, explain the isotherms of "
                f"{which} K about as well; the errors contain them."
            )
        return tuple(said)

    def _at_bounds(self):
        """Whether unknowns of the law are no result but the end of the search."""
        found = np.asarray(self.isotherms.split(self.theta)[0])
        lower, upper = np.log(LAW_LIMITS[self.isotherms.law]).T
        return bool(np.any((found < lower + 1e-3) | (found > upper - 1e-3)))

    def _material(self, shift):
        material = self.fit.material
        assert material.measured is not None
        measured = MeasuredRange(material.measured.omega, self.temperatures[np.array([0, -1])])
        return dataclasses.replace(material, shift=shift, measured=measured)


@compiled
def _slopes(isotherms: Isotherms, theta):
    """Derivatives of ln a and ln b of each isotherm by all unknowns."""
    return jax.jacfwd(isotherms.shifts)(theta)


def master_curve(
    isotherms: Measured | Sequence[Measured | Isotherm],
    *,
    kind: str = "frequency",
    law: str = "wlf",
    shift_std: Numbers = 0.3,
    vertical_shift_std: Numbers = 0.0,
    reference: Numbers | None = None,
    terms: int | None = None,
    equilibrium: Numbers | None = None,
    weights: tuple[Numbers, Numbers] = (1.0, 1.0),
    poisson: Numbers = 0.5,
) -> MasterCurve:
    """Returns the Prony series and the shifts that together are nearest to all isotherms.

    **Arguments:**

    - `isotherms`: at least two, each `(temperature [K], x, values)` with frequencies or times `x`
      and moduli or compliances `values` as in `fit_prony`; or what `read_moduli(path)` returned.
    - `kind`: "frequency", "relaxation" or "creep"; files know their own.
    - `law`: "wlf" or "arrhenius".
    - `shift_std`: expected standard deviation of log10 a_T from the law [decades]; with 0 the
      shifts follow the law, with 3 they are practically free.
    - `vertical_shift_std`: expected standard deviation of ln b_T [1], such as 0.1; 0 for no
      vertical shifts.
    - `reference`: the isotherm nearest to this temperature [K] stays in place; by default the
      middle one.
    - `terms`, `equilibrium`, `weights`, `poisson`: as in `fit_prony`; the first weight is that of
      all values in time.

    Differentiable if `terms` is given; the weight of `shift_std` and `vertical_shift_std` relative
    to the error of the fit is then a fixed number.

    **Returns:** shifts, their law, and the fit of the shifted isotherms.

    **Raises:** `ValueError` as `fit_prony`, and for fewer than two isotherms or not in kelvin.
    """
    poisson = as_scalar(poisson, "poisson")
    check_poisson("poisson", poisson)
    given: dict[str, Any] = {"shift_std": shift_std, "vertical_shift_std": vertical_shift_std}
    for name, std in given.items():
        if not is_concrete(std):
            raise ValueError(f"`{name}` must be a concrete number: it decides what is fitted.")
        as_scalar(std, name)
        check_values(name, std, "it must be zero or positive", at_least=0)
    along, across = map(float, given.values())
    data = joined_curves(
        isotherms, kind, law, (LN10 * along, across), reference, weights, equilibrium
    )
    check_terms(data, terms)
    path = ()
    if terms is None:
        found, path = shifts_and_series(data, terms)
        error, shifted = problem_of(data).rms(found[0]), at_reference(jnp.asarray(found[0]), data)
        if choose_liquid(shifted, error):
            data = data.as_liquid()
            found, path = shifts_and_series(data, terms)
        theta, free, *rest = map(jnp.asarray, found)
    else:

        def find(data):
            return shifts_and_series(data, terms)[0]

        sizes = data.num_unknowns(terms), 2, NUM_STARTS * data.num_shifts
        theta, free, *rest = search(find, sizes, data)
    data = with_found(data, *rest)
    theta = attach_derivative(objective, theta, free, data)
    curve = MasterCurve(theta, data, poisson, path)
    refuse_nonsense(curve.fit)
    return curve


def _law_words(curve):
    """The law, how well it represents the fitted shifts, and which of both is exported."""
    law = curve.law
    if curve.isotherms.law == "wlf":
        words = f"WLF with c1 = {float(law.c1):.4g}, c2 = {float(law.c2):.4g} K"
    else:
        words = f"Arrhenius with Q = {float(law.activation_energy) / 1e3:.4g} kJ/mol"
    lines = [f"{words} about {float(law.reference):.2f} K."]
    if not any(curve.isotherms.stds):
        return lines
    if curve._at_bounds():
        lines.append(
            "Error: a constant of this law ran to the end of its range: the shifts follow no such "
            "law."
        )
    by_law, by_table = percent(curve.law_error()), percent(curve.fit.errors().total)
    if isinstance(curve.exported().shift, TabulatedShift):
        exported = f". The exported table of shifts fits them to {by_table}."
    else:
        exported = f" and is exported. The shifts of this table fit them to {by_table}."
    return [*lines, f"This law fits the isotherms to {by_law}{exported}"]


def _step_words(curve):
    """A sentence on neighbours whose shifts are hardly those of one material."""
    temperatures, shifts = np.asarray(curve.temperatures), np.asarray(curve.log10_shifts)
    rates = np.diff(shifts) / np.diff(temperatures)
    steps = [
        f"{temperatures[i]:.2f} to {temperatures[i + 1]:.2f} K ({shifts[i + 1] - shifts[i]:+.2f})"
        for i in np.flatnonzero((rates < -STEEP_SHIFT) | (rates > 0))
    ]
    return steps and [
        f"Look at the steps of log10 a_T from {', '.join(steps)}: more than two decades within 5 "
        "K, or upwards, are seldom those of one material."
    ]
