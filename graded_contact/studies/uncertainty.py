"""What is known of a measured material, carried to friction or whatever else follows from it.

A fit knows the covariance C of its unknowns θ; a quantity f(θ) with the slopes g = ∂f/∂θ then has
the variance gᵀ C g to first order. Where in frequency a quantity draws on a master curve tell its
derivatives by the moduli of a table.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._checks import Numbers, as_float, check_positive
from ..fitting.master import MasterCurve
from ..fitting.result import PronyFit
from ..rheology.material import AbstractMaterial, Prony
from ..rheology.tabulated import Tabulated


class Estimate(eqx.Module):
    """A quantity that follows from a fit.

    **Fields:**

    - `value`: at the fitted unknowns, any shape.
    - `standard_error`: of `value`, in its units, same shape.
    """

    value: Float[Array, "*shape"]
    standard_error: Float[Array, "*shape"]


class Sensitivity(eqx.Module):
    """What decides a quantity f: its relative change per decade of frequency.

    **Fields:**

    - `omega`: angular frequencies [rad/s], shape `(points,)`.
    - `storage`, `loss`: ∂ ln f/∂ ln E' and ∂ ln f/∂ ln E'' around each ω per decade of ω [1], same
      shape. Integrated over log10 ω they are the relative change of f per that of all of E' or E''.
    """

    omega: Float[Array, " points"]
    storage: Float[Array, " points"]
    loss: Float[Array, " points"]


def propagate(
    function: Callable[[Prony], Float[Array, "*shape"]], fit: PronyFit | MasterCurve
) -> Estimate:
    """Returns a quantity that follows from a fitted material, with its standard error.

    To first order in the errors of the unknowns (of a master curve, those of the shifts included),
    which are taken to be independent from point to point about a series of the fitted length; what
    a misfit of the whole series means it does not know, see `PronyFit.confidence`.

    **Arguments:**

    - `function`: called as function(material), differentiable, such as `lambda rubber: slide(...)
      .friction`; returns a number or an array.
    - `fit`: what `fit_prony`, `fit_relaxation`, `fit_creep` or `master_curve` returned.

    **Returns:** the value and its standard error.

    **Raises:** `ValueError` for another kind of fit, or under `jit`.
    """
    if not isinstance(fit, PronyFit | MasterCurve):
        raise ValueError(f"`fit={fit!r}` must be a fit of a Prony series or a master curve.")
    unknowns = fit.theta if isinstance(fit, PronyFit) else fit.unknowns
    spread = fit.covariance()

    def quantity(unknowns):
        return jnp.asarray(function(fit.with_unknowns(unknowns).material))

    value, slopes = quantity(unknowns), jax.jacrev(quantity)(unknowns)
    variance = jnp.einsum("...i,ij,...j->...", slopes, spread, slopes)
    return Estimate(value, jnp.sqrt(variance))


def sensitivity(
    function: Callable[[Tabulated], Float[Array, ""]], material: AbstractMaterial, omega: Numbers
) -> Sensitivity:
    """Returns which part of a master curve decides a quantity.

    The material is replaced by a table of its moduli at `omega`, which goes on level beyond its
    ends: outside, nothing is told.

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
            f"`material` has a Poisson's ratio of shape {poisson.shape}: a table of moduli has one "
            "number."
        )
    table = Tabulated(
        omega, material.modulus(omega), poisson, shift=getattr(material, "shift", None),
        extrapolate="plateau",
    )  # fmt: skip

    def quantity(logarithms):
        values = jax.tree.map(jnp.exp, logarithms)
        return jnp.log(function(eqx.tree_at(lambda t: (t.storage, t.loss), table, values)))

    storage, loss = jax.grad(quantity)((jnp.log(table.storage), jnp.log(table.loss)))
    # Decades that each frequency stands for, by the trapezoidal rule.
    decades = np.log10(np.asarray(omega))
    width = np.diff(np.concatenate([decades[:1], (decades[1:] + decades[:-1]) / 2, decades[-1:]]))
    return Sensitivity(omega, storage / width, loss / width)
