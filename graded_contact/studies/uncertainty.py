"""Errors of a measured material, propagated to friction or any other result.

A fit knows the covariance C of its unknowns θ; a quantity f(θ) with the slopes g = ∂f/∂θ then has
the variance gᵀ C g to first order. The derivatives of a quantity by the moduli of a table show on
which frequencies of a master curve it depends.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import Numbers, as_float, check_positive
from ..core.display import shown
from ..fitting.prony import AbstractFit, deviation
from ..materials.material import AbstractMaterial, Prony
from ..materials.table import Tabulated


@shown()
class Estimate(eqx.Module):
    """A quantity that follows from a fit.

    **Fields:**

    - `value`: at the fitted unknowns, any shape.
    - `standard_error`: of `value`, in its units, same shape.
    """

    value: Float[Array, "*shape"]
    standard_error: Float[Array, "*shape"]


@shown()
class Sensitivity(eqx.Module):
    """The sensitivity of a quantity f: its relative change per decade of frequency.

    **Fields:**

    - `omega`: angular frequencies [rad/s], shape `(points,)`.
    - `storage`, `loss`: ∂ ln f/∂ ln E' and ∂ ln f/∂ ln E'' around each ω per decade of ω [1], same
      shape. Integrated over log10 ω they are ∂ ln f/∂ ln E' or E''.
    """

    omega: Float[Array, " points"]
    storage: Float[Array, " points"]
    loss: Float[Array, " points"]


def propagate(function: Callable[[Prony], Float[Array, "*shape"]], fit: AbstractFit) -> Estimate:
    """Returns a quantity that follows from a fitted material, with its standard error.

    To first order in the errors of the unknowns, of a master curve with its shifts. The effect of a
    misfit of the whole series is not included, see `PronyFit.confidence`.

    **Arguments:**

    - `function`: of the material, differentiable, such as `lambda rubber: slide(...).friction`;
      returns a number or an array.
    - `fit`: the result of `fit_prony` or `master_curve`.

    **Returns:** the value and its standard error.
    """

    def quantity(unknowns):
        value = jnp.asarray(function(dataclasses.replace(fit, theta=unknowns).material))
        return value, value

    slopes, value = jax.jacrev(quantity, has_aux=True)(fit.theta)
    return Estimate(value, deviation(slopes, fit.covariance()))


def sensitivity(
    function: Callable[[Tabulated], Float[Array, ""]], material: AbstractMaterial, omega: Numbers
) -> Sensitivity:
    """Returns the sensitivity of a quantity to each part of a master curve.

    The material is replaced by a table of its moduli at `omega`. Beyond its ends the moduli are
    constant, and nothing is reported.

    **Arguments:**

    - `function`: called as function(table) with that `Tabulated`, differentiable; returns a number.
    - `material`: any; its Poisson's ratio must not depend on frequency.
    - `omega`: angular frequencies [rad/s], shape `(points,)`, increasing.

    **Returns:** the relative change of the quantity per decade of frequency.

    **Raises:** `ValueError` for a Poisson's ratio that varies, and for `omega` as `Tabulated` does.
    """
    omega = as_float(omega, "omega")
    check_positive("omega", omega, "[rad/s]")
    poisson = jnp.asarray(material.poisson_ratio(omega))
    if poisson.ndim:
        raise ValueError(
            f"`material` has a Poisson's ratio of shape {poisson.shape}, not a number."
        )
    shift = getattr(material, "shift", None)
    table = Tabulated(omega, material.modulus(omega), poisson, shift=shift)

    def quantity(logarithms):
        values = jax.tree.map(jnp.exp, logarithms)
        return jnp.log(function(eqx.tree_at(lambda t: (t.storage, t.loss), table, values)))

    storage, loss = jax.grad(quantity)((jnp.log(table.storage), jnp.log(table.loss)))
    # Decades that each frequency represents, by the trapezoidal rule.
    decades = np.log10(np.asarray(omega))
    width = np.diff(np.concatenate([decades[:1], (decades[1:] + decades[:-1]) / 2, decades[-1:]]))
    return Sensitivity(omega, storage / width, loss / width)
