"""A fitted Prony series, and what is known about its quality."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.special import ndtri

from ..core.checks import Numbers, as_float, check_positive
from ..core.display import shown, with_units
from ..rheology.material import Prony
from ..rheology.measured import is_unknown
from .lengths import best_path, criterion
from .model import material_of, model, series_of
from .observations import Observations, concrete
from .quality import Errors, Floor, errors_of, floor_of, jumps_of, percent, rms, verdict
from .series import Series
from .uncertainty import covariance, resampled

INSTANT = 0.5  # of the first measured strain: less of it is not seen to be instant
VAGUE = 0.5  # deviation of the logarithm of a value that data do not determine


@shown()
class Length(NamedTuple):
    """A step of the path.

    **Fields:**

    - `terms`: their number.
    - `error`: root mean square of ln(model/measured) [1].
    - `bic`: Bayes information criterion [1].
    """

    terms: int
    error: float
    bic: float


@shown("terms", "material", "errors")
class PronyFit(eqx.Module):
    """A fitted Prony series with what is known about its quality.

    **Fields:**

    - `theta`: the unknowns of the fit, see `observations`; shape `(unknowns,)`.
    - `data`: what was fitted.
    - `poisson`: Poisson's ratio of the material [1].
    - `path`: the best fits of every number of terms, if they were needed to choose it. Static.
    """

    theta: Float[Array, " unknowns"]
    data: Observations
    poisson: Float[Array, ""]
    path: tuple[Length, ...] = eqx.field(static=True)

    @property
    def terms(self) -> int:
        """The number of terms that were fitted."""
        count = len(self.theta) - self.data.num_extras
        return count if self.data.times is not None else count // 2

    @property
    def material(self) -> Prony:
        """The fitted material."""
        return with_units(material_of(self.theta, self.data, self.poisson))

    def predict(self, x: Numbers) -> Float[Array, "channels points"]:
        """Returns what the measurement would have shown at other frequencies or times.

        `x` are angular frequencies [rad/s] or times [s], shape `(points,)`. The rows are storage
        and loss modulus [Pa]; or one of moduli [Pa] or compliances [1/Pa].
        """
        return model(self.theta, self.data, as_float(x))

    def errors(self) -> Errors:
        """Returns the errors of the fit."""
        series, theta = self._problem()
        return errors_of(series, theta)

    def floor(self) -> Floor:
        """Returns the errors of the best positive spectra, and whether the channels agree."""
        series, theta = self._problem()
        return floor_of(series, theta)

    def verdict(self) -> str:
        """Returns in plain words whether the data or the number of terms limit the fit."""
        return _verdict(self, self.errors(), self.floor())

    def covariance(self) -> Float[np.ndarray, "unknowns unknowns"]:
        """Returns the covariance of `theta`, of errors in which neighbours may be alike."""
        series, theta = self._problem()
        residual, jacobian, _ = series.derivatives(theta)
        return covariance(series, residual, jacobian, series.within_bounds(theta))

    def with_unknowns(self, unknowns: Float[Array, " unknowns"]) -> "PronyFit":
        """Returns the fit with another `theta`."""
        return eqx.tree_at(lambda fit: fit.theta, self, unknowns)

    def confidence(
        self, omega: Numbers, *, level: float = 0.95, resamples: int = 0, seed: int = 0
    ) -> tuple[Complex[Array, "*w"], Complex[Array, "*w"]]:
        """Returns `(lower, upper)`, limits of E'(ω) and, in the imaginary part, of E''(ω) [Pa].

        **Arguments:**

        - `omega`: angular frequencies [rad/s], positive.
        - `level`: probability that each limit pair encloses the true value.
        - `resamples`: 0 for linearised (Gauss-Newton) limits, or the number of refits to data
          with resampled residuals (bootstrap) whose quantiles are taken; `seed` draws them.

        Outside the measured frequencies (of times, their reciprocals) the limits are NaN: the data
        say nothing there. Within, both kinds suppose errors about a series of this length, alike
        in neighbours as far as the residuals are: where `floor` says that the data contradict
        themselves, the true material may lie outside.
        """
        if not 0 < level < 1:
            raise ValueError(f"`level={level!r}` must lie between 0 and 1.")
        omega = as_float(omega, "omega")
        check_positive("omega", omega, "[rad/s]")
        series, theta = self._problem()
        free = series.within_bounds(theta)
        if resamples:
            refits = jnp.asarray(resampled(series, theta, free, resamples, seed))
            logs = jax.vmap(lambda theta: _log_parts(theta, self.data, omega))(refits)
            tails = jnp.array([(1 - level) / 2, (1 + level) / 2])
            lower, upper = jnp.quantile(logs, tails, axis=0)
        else:
            slopes = np.asarray(_log_slopes(self.theta, self.data, omega))
            spread = self.covariance()
            deviation = np.sqrt(np.einsum("...i,ij,...j->...", slopes, spread, slopes))
            reach = ndtri((1 + level) / 2) * deviation
            middle = _log_parts(self.theta, self.data, omega)
            lower, upper = middle - reach, middle + reach
        return limits_where_known(omega, self.material.coverage(), lower, upper)

    def report(self) -> str:
        """Returns the fit as text: terms, errors, verdict, and the lengths tried."""
        return _report(self)

    def _problem(self) -> tuple[Series, np.ndarray]:
        if not concrete(self.data):
            raise ValueError("The quality of a fit is not available under `jit` or `grad`.")
        return series_of(self.data), np.asarray(self.theta)


def limits_where_known(
    omega: Float[Array, "*w"],
    known: tuple[Any, Any],
    lower: Float[Array, "2 *w"],
    upper: Float[Array, "2 *w"],
) -> tuple[Complex[Array, "*w"], Complex[Array, "*w"]]:
    """Returns limits of E* [Pa] from those of ln E', ln E''; NaN where ω is not `known`."""
    outside = is_unknown(omega, known)
    lower, upper = (jnp.where(outside, jnp.nan, jnp.exp(limit)) for limit in (lower, upper))
    return jax.lax.complex(*lower), jax.lax.complex(*upper)


def _report(fit):
    error, floor, material = fit.errors(), fit.floor(), fit.material
    lowest, highest = material.coverage()
    lines = [
        _verdict(fit, error, floor),
        f"{fit.terms} terms, E_eq = {float(material.equilibrium):.4g} Pa, "
        f"E_inf = {float(material.glassy):.4g} Pa, Poisson's ratio {float(fit.poisson):.3g}",
        *_undetermined(fit),
        f"Measured from {float(lowest):.4g} to {float(highest):.4g} rad/s; outside, where limits "
        "end, the series is an extrapolation.",
        "",
        "rms log error    total  storage     loss",
        f"this fit      {_row(error)}",
        f"floor         {_row(floor[:3])}",
    ]
    if fit.path:
        lines += ["", "terms      error        BIC"]
        for length in fit.path:
            chosen = " *" if length.terms == fit.terms else ""
            lines.append(
                f"{length.terms:5d} {percent(length.error):>10} {length.bic:10.1f}{chosen}"
            )
    return "\n".join(lines)


def _verdict(fit, error, floor):
    unknown = [name for name in ("glassy", "equilibrium") if getattr(fit.data, name) is None]
    return jumps_of(series_of(fit.data)) + verdict(fit.terms, error, floor, unknown)


def _undetermined(fit):
    """A sentence on the end value that the data do not tell, if there is one."""
    if _flows(fit.data) and float(fit.material.equilibrium) == 0:
        return [
            "The data end where they flow, loss above storage, and tell of no equilibrium modulus."
        ]
    if fit.data.kind != "creep" or fit.data.glassy is not None:
        return []
    series, theta = fit._problem()
    place = len(theta) - fit.data.num_extras  # of 1/E_inf
    spread = fit.covariance()[place, place]
    first = np.min(series.log_values[series.measured])
    if theta[place] > first + np.log(INSTANT) and spread < VAGUE**2:
        return []
    return [
        "E_inf is not determined by these data, which begin too late to show the instant strain: "
        "it is only as high as they allow. Give `glassy` if you know it."
    ]


def _row(errors):
    return " ".join("" if value is None else f"{percent(value):>8}" for value in errors)


def choose(series: Series, within: float | None) -> tuple[np.ndarray, tuple[Length, ...]]:
    """Returns the unknowns of the best length, see `fit_prony`, and all lengths tried."""
    if within is not None and not within > 0:
        raise ValueError(f"`within={within!r}` must be a positive number [1].")
    most = (np.sum(series.measured) - 1 - len(series.static)) // 2
    fitted = best_path(series, max(int(most), 1))
    path = tuple(
        Length(n, rms(series, theta), criterion(series, theta, cost))
        for n, (theta, cost) in fitted.items()
    )
    if within is None:
        chosen = min(path, key=lambda length: length.bic)
    else:
        least = min(length.error for length in path)
        chosen = next(length for length in path if length.error <= (1 + within) * least)
    return fitted[chosen.terms][0], path


def liquid_of(data: Observations) -> Observations | None:
    """Returns the same data of a liquid if that may be what they are of, else None.

    They may if E_eq is not known and loss exceeds storage at the lowest frequencies.
    """
    if data.equilibrium is not None or data.times is not None or not _flows(data):
        return None
    return eqx.tree_at(
        lambda d: d.equilibrium, data, jnp.zeros(()), is_leaf=lambda leaf: leaf is None
    )


def _flows(data):
    if data.kind != "frequency":
        return False
    both = np.all(np.asarray(data.weights) > 0, axis=0)
    lowest = np.argsort(np.where(both, np.asarray(data.x), np.inf))[: min(3, int(np.sum(both)))]
    storage, loss = np.asarray(data.values)[:, lowest]
    return bool(len(lowest) and np.all(loss > storage))


@eqx.filter_jit
def _log_parts(theta, data, omega):
    """ln E' and ln E'', stacked."""
    modulus = material_of(theta, data, 0.5).modulus(omega)
    return jnp.log(jnp.stack([modulus.real, modulus.imag]))


@eqx.filter_jit
def _log_slopes(theta, data, omega):
    return jax.jacfwd(_log_parts)(theta, data, omega)
