"""The errors of a fit, and its report."""

from typing import Any, NamedTuple

import numpy as np

from ..core.display import shown
from .covariance import LEAST_NOISE
from .series import SeriesProblem

FAR = 5  # robust standard deviations
MOST_NAMED = 10


@shown()
class FitErrors(NamedTuple):
    """Root-mean-square of ln(model/measured) [1], of all values, of storage and of loss.

    A channel without measured values has none; moduli in time are all `storage`.
    """

    total: float
    storage: float | None
    loss: float | None


def fit_errors(series: SeriesProblem, theta: np.ndarray) -> FitErrors:
    """Returns the errors of the fit `theta`."""
    weights = np.where(series.measured, series.weights, 0)
    storage = np.arange(len(weights)) < len(series.x)
    misfit = series.misfit(theta) ** 2
    total, *parts = (
        float(np.sqrt(np.average(misfit, weights=some))) if np.any(some) else None
        for some in (weights, weights * storage, weights * ~storage)
    )
    assert total is not None
    return FitErrors(total, *parts)


def far_values(series: SeriesProblem, theta: np.ndarray) -> tuple[str, ...]:
    """Returns a sentence that names the values beyond five robust deviations of their channel."""
    names = ("storage", "loss") if series.kind == "frequency" else ("value",)
    unit, found = "rad/s" if series.kind == "frequency" else "s", []
    rows = zip(names, *map(series.by_channel, (series.misfit(theta), series.measured)), strict=True)
    for name, misfit, measured in rows:
        usual = 1.4826 * np.median(np.abs(misfit[measured])) if np.any(measured) else np.inf
        for i in np.flatnonzero(measured & (np.abs(misfit) > FAR * max(usual, LEAST_NOISE))):
            kelvin = ""
            if series.isotherms is not None:
                kelvin = f" and {float(series.isotherms.temperatures[series.group[i]]):.2f} K"
            off = np.expm1(-misfit[i])
            found.append(f"{name} at {series.x[i]:.4g} {unit}{kelvin} ({off:+.0%})")
    if not found:
        return ()
    named = ", ".join(found[:MOST_NAMED]) + (", ..." if len(found) > MOST_NAMED else "")
    remedy = "" if series.scale is not None else ', or fit with `loss="soft_l1"`'
    return (
        f"{len(found)} values lie beyond {FAR} standard deviations (by the median) of the fit: "
        f"{named}. Correct them, leave them out (NaN){remedy}.",
    )


def report_of(fit: Any, warnings: tuple[str, ...]) -> str:
    """Returns the report of a `PronyFit`: end values, errors, warnings and the lengths tried."""
    import pandas as pd

    material, (lowest, highest) = fit.material, fit.material.coverage()
    errors = {name: percent(error) for name, error in fit.errors()._asdict().items() if error}
    lines = [
        f"{fit.terms} terms, E_eq = {float(material.equilibrium):.4g} Pa, "
        f"E_inf = {float(material.glassy):.4g} Pa, Poisson's ratio {float(fit.poisson):.3g}",
        f"Measured from {float(lowest):.4g} to {float(highest):.4g} rad/s; beyond, the series is "
        "an extrapolation.",
        "rms of ln(fit/measured): " + ", ".join(f"{k} {v}" for k, v in errors.items()),
        *(f"Warning: {sentence}" for sentence in warnings),
    ]
    if fit.path:
        path = pd.DataFrame(fit.path).rename(columns={"bic": "BIC"})
        path[""] = np.where(path["terms"] == fit.terms, "*", "")
        formats = [str, percent, "{:.1f}".format, str]
        lines += ["", path.to_string(index=False, formatters=formats)]
    return "\n".join(lines)


def percent(value: float) -> str:
    """Returns a share as text."""
    return f"{100 * value:.3g} %"
