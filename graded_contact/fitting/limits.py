"""Confidence limits of a fitted modulus."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from scipy.special import ndtri

from ..core.checks import Numbers, as_float, check_positive
from ..materials.coverage import is_unknown
from ..materials.material import Prony


def check_limits(omega: Numbers, level: float) -> Float[Array, "*w"]:
    """Returns the frequencies [rad/s] at which limits of E* are requested, checked."""
    if not 0 < level < 1:
        raise ValueError(f"`level={level!r}` must lie between 0 and 1.")
    omega = as_float(omega, "omega")
    check_positive("omega", omega, "[rad/s]")
    return omega


def linear_limits(logs: Any, unknowns: Array, spread: np.ndarray, level: float) -> Any:
    """Returns limits of `logs(unknowns)`, linearised, for unknowns of this covariance."""
    middle = logs(unknowns)
    reach = ndtri((1 + level) / 2) * deviation(jax.jacfwd(logs)(unknowns), spread)
    return middle - reach, middle + reach


def deviation(slopes: Array, spread: np.ndarray) -> Array:
    """Returns standard deviations of quantities from their slopes by unknowns."""
    return jnp.sqrt(jnp.einsum("...i,ij,...j->...", slopes, spread, slopes))


def limits_where_measured(
    omega: Float[Array, "*w"], material: Prony, limits: Any
) -> tuple[Complex[Array, "*w"], Complex[Array, "*w"]]:
    """Returns limits of E* [Pa] from those of ln E', ln E''; NaN where nothing was measured."""
    outside = is_unknown(omega, material.coverage())
    lower, upper = (jnp.where(outside, jnp.nan, jnp.exp(limit)) for limit in limits)
    return jax.lax.complex(*lower), jax.lax.complex(*upper)
