"""Master curves: one Prony series and one shift law from measurements at several temperatures.

Shifts and spectrum are fitted together, to storage and loss at once, so that what is shifted is a
material. Where an isotherm is flat its shift is ill determined (by decades, below the glass
transition). Shifts are therefore tied to a law, WLF or Arrhenius, from which each may depart by an
amount expected beforehand, and their uncertainty is reported.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import Numbers, as_poisson, scalar
from ..core.display import shown
from ..materials.coverage import MeasuredRange
from ..materials.material import Prony
from ..materials.measured import Measured
from ..materials.shift import AbstractShift, TabulatedShift
from .alignment import at_reference
from .implicit import optimum
from .observations import Isotherm, Loss, joined_curves
from .prony import AbstractFit, PronyFit, standard_error
from .quality import report_of
from .shifts import LN10, Isotherms, law_shifts, log_shifts, split_shifts
from .terms import criterion

STD = "a standard deviation is zero or positive"


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

        It has the errors of the master curve; its `confidence` takes the shifts as known.
        """
        series = self.theta[: len(self.theta) - self.data.num_shifts]
        return PronyFit(series, at_reference(self.theta, self.data), self.poisson, self.path)

    @property
    def law(self) -> AbstractShift:
        """The fitted law about the reference temperature, without departures from it."""
        return self.isotherms.law_of(split_shifts(self.isotherms, self.theta)[0])

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
        """The material at the reference temperature, with the fitted shifts.

        `material.at(T)` is that at another temperature.
        """
        return self._with_shift(self.shift)

    def _with_shift(self, shift: AbstractShift) -> Prony:
        material = self.fit.material
        assert material.measured is not None
        measured = MeasuredRange(material.measured.omega, self.temperatures[np.array([0, -1])])
        return dataclasses.replace(material, shift=shift, measured=measured)

    def law_error(self) -> float:
        """Returns the rms log error on all isotherms of the series shifted by the law alone."""
        alone, few = self._by_law_alone()
        return alone.rms(few)

    def law_serves(self) -> bool:
        """Returns whether the law alone describes the data as well, for its few constants (BIC)."""
        series, theta = self._problem()
        alone, few = self._by_law_alone()
        _, departures, lifts = self.isotherms.counts
        by_law = criterion(alone, len(theta) - departures - lifts, alone.total_cost(few))
        free = criterion(series, len(theta), series.cost(series.misfit(theta)))
        return by_law <= free

    def _by_law_alone(self):
        """The problem of the data shifted by the law alone, and the unknowns of the series."""
        series, theta = self._problem()
        by_law = law_shifts(self.isotherms, split_shifts(self.isotherms, theta)[0])
        few = theta[: len(theta) - series.num_shifts]
        return series.shifted(by_law, np.zeros_like(by_law)), few

    def exported(self) -> Prony:
        """Returns the material for export: with the law alone if it serves, else with a table.

        With `law="table"` always with a table.
        """
        by_law = self.isotherms.law != "table" and self.law_serves()
        return self._with_shift(self.law if by_law else self.shift)

    @property
    def temperatures(self) -> Float[Array, " isotherms"]:
        """Temperatures of the isotherms [K], increasing."""
        return self.isotherms.temperatures

    @property
    def log10_shifts(self) -> Float[Array, " isotherms"]:
        """log10 a_T of the isotherms; 0 at the reference."""
        return log_shifts(self.isotherms, self.theta)[0] / LN10

    @property
    def vertical_shifts(self) -> Float[Array, " isotherms"]:
        """b_T of the isotherms: moduli there are b_T (creep: compliances) times the master's."""
        return jnp.exp(log_shifts(self.isotherms, self.theta)[1])

    def shift_deviations(self) -> tuple[Float[Array, " isotherms"], Float[Array, " isotherms"]]:
        """Returns standard deviations of log10 a_T and of ln b_T.

        They are large for isotherms too flat to be placed by anything but the law.
        """
        shifts = jax.jacfwd(lambda theta: log_shifts(self.isotherms, theta))
        along, across = jax.jit(shifts)(self.theta)
        spread = self.covariance()
        return standard_error(along / LN10, spread), standard_error(across, spread)

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
        return "\n".join([str(self.law), "", table, "", report_of(self.fit, self.warnings())])

    def warnings(self) -> tuple[str, ...]:
        """Returns sentences on what makes the fit doubtful, such as values far from it."""
        if self.isotherms.law == "table" or not any(self.isotherms.stds) or self.law_serves():
            return super().warnings()
        return (
            *super().warnings(),
            f"With {self.law} alone the error is {self.law_error():.2g}: the export has a table of "
            "shifts, which ends at the temperatures that were measured.",
        )


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
    loss: Loss = "linear",
) -> MasterCurve:
    """Returns the Prony series and the shifts that together are nearest to all isotherms.

    **Arguments:**

    - `isotherms`: at least two, each `(temperature [K], x, values)` with frequencies or times `x`
      and moduli or compliances `values` as in `fit_prony`; or what `read_moduli(path)` returned.
    - `kind`: "frequency", "relaxation" or "creep"; files know their own.
    - `law`: "wlf" or "arrhenius", which an exported material has if it describes the data as well,
      also beyond their temperatures; or "table" for the shifts of the isotherms.
    - `shift_std`: expected standard deviation of log10 a_T from the law [decades]; with 0 the
      shifts follow the law, with 3 they are practically free.
    - `vertical_shift_std`: expected standard deviation of ln b_T [1], such as 0.1; 0 for no
      vertical shifts.
    - `reference`: the isotherm nearest to this temperature [K] stays in place; by default the
      middle one.
    - `terms`, `equilibrium`, `weights`, `poisson`, `loss`: as in `fit_prony`; the first weight is
      also the weight of values in time.

    Differentiable if `terms` is given; the weight of `shift_std` and `vertical_shift_std` relative
    to the error of the fit is then a fixed number.

    **Returns:** shifts, their law, and the fit of the shifted isotherms.

    **Raises:** `ValueError` as `fit_prony`, and for fewer than two isotherms or not in kelvin.
    """
    poisson = as_poisson(poisson)
    along = scalar("shift_std", STD, at_least=0)(shift_std)
    across = scalar("vertical_shift_std", STD, at_least=0)(vertical_shift_std)
    data = joined_curves(
        isotherms, kind, law, (LN10 * float(along), float(across)), reference, weights, equilibrium
    )
    theta, data, path = optimum(data, terms, loss)
    return MasterCurve(theta, data, poisson, path)
