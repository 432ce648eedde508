"""Errors of a measured material, propagated to friction or any other result.

A fit knows the covariance C of its unknowns θ; a quantity f(θ) with the slopes g = ∂f/∂θ then has
the variance gᵀ C g to first order. The derivatives of a quantity by the moduli of a table show on
which frequencies of a master curve it depends.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..core.checks import Numbers, as_float, check_shape, check_values, positive, short
from ..core.display import shown
from ..core.parameters import paths, with_values
from ..fitting.prony import AbstractFit, standard_error
from ..materials.material import AbstractMaterial
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


def propagate(
    function: Callable[[Any], Float[Array, "*shape"]],
    known: AbstractFit | Mapping[str, Numbers],
    tree: Any = None,
) -> Estimate:
    """Returns a quantity that follows from a fitted material, or a stack, with its standard error.

    To first order in the errors: of the unknowns of a fit (of a master curve, shifts
    included), or of numbers of any stack. The effect of a misfit of the whole
    series is not included, see `PronyFit.confidence`.

    **Arguments:**

    - `function`: called as function(material), or as function(tree), differentiable, such as
      `lambda rubber: slide(...).friction`; returns a number or an array.
    - `known`: the result of `fit_prony` or `master_curve`; or
      standard deviations of independent errors by the path of the number in `tree`, in its units,
      such as `{"layers[0].thickness": 5e-6}`, see `with_values`.
    - `tree`: with `known` by path, such as a `Stack`.

    **Returns:** the value and its standard error.

    **Raises:** `ValueError` for another kind of fit, for paths or deviations that `tree` has not,
    or under `jit`.
    """
    if isinstance(known, AbstractFit):
        unknowns = known.theta
        spread = jnp.asarray(known.covariance())
        made = lambda unknowns: dataclasses.replace(known, theta=unknowns).material  # noqa: E731
    elif isinstance(known, Mapping):
        deviations = {path: as_float(value, path) for path, value in known.items()}
        found = paths(tree)
        values = {path: found.get(path, deviation) for path, deviation in deviations.items()}
        with_values(tree, values)  # refuses a path that is not there
        for path, deviation in deviations.items():
            check_shape(path, deviation, values[path].shape)
            check_values(path, deviation, "a standard deviation is at least 0", at_least=0)
        unknowns, unravel = ravel_pytree(values)
        spread = jnp.diag(ravel_pytree(deviations)[0] ** 2)
        made = lambda unknowns: with_values(tree, unravel(unknowns))  # noqa: E731
    else:
        raise ValueError(f"`known={short(known)}` must be a fit, or deviations by path.")

    def quantity(unknowns):
        value = jnp.asarray(function(made(unknowns)))
        return value, value

    slopes, value = jax.jacrev(quantity, has_aux=True)(unknowns)
    return Estimate(value, standard_error(slopes, spread))


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
    omega = positive("omega", "[rad/s]", as_float)(omega)
    poisson = jnp.asarray(material.poisson_ratio(omega))
    if poisson.ndim:
        raise ValueError(
            f"`material` has a Poisson's ratio of shape {poisson.shape}, not a number."
        )
    shift = getattr(material, "shift", None)
    table = Tabulated(omega, material.complex_modulus(omega), poisson, shift=shift)

    def quantity(logarithms):
        values = jax.tree.map(jnp.exp, logarithms)
        return jnp.log(function(eqx.tree_at(lambda t: (t.storage, t.loss), table, values)))

    storage, loss = jax.grad(quantity)((jnp.log(table.storage), jnp.log(table.loss)))
    # Decades that each frequency represents, by the trapezoidal rule.
    decades = np.log10(np.asarray(omega))
    width = np.diff(np.concatenate([decades[:1], (decades[1:] + decades[:-1]) / 2, decades[-1:]]))
    return Sensitivity(omega, storage / width, loss / width)
