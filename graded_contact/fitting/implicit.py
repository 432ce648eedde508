"""The optimum of a fit in differentiable programs.

At the optimum θ of the cost f its gradient vanishes, so that dθ = -f_θθ⁻¹ f_θd dd for a change
dd of anything observed or known. Unknowns at a bound stay there. With more terms than the data
determine f_θθ is nearly singular: single terms then have no useful derivative, but E(ω) has.
"""

import dataclasses
from typing import get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from ..core.checks import check_type
from ..core.compilation import compiled, one_thread_of_lapack
from .alignment import shifts_and_series
from .observations import Loss, Observations, Unknowns, concrete
from .series import problem_of
from .terms import Length, check_terms

SOFTENINGS = 5  # at most: the first scales have the bad values' pull on the fit in them
SETTLED = 0.9  # times the scale before
RIDGE = 1e-13  # relative to the diagonal of the Hessian: far below what data determine


def optimum(
    data: Observations, terms: int | None, loss: Loss
) -> tuple[Unknowns, Observations, tuple[Length, ...]]:
    """Returns the unknowns of a fit with their derivatives, the data, and all lengths tried.

    **Arguments:**

    - `data`: those that are returned hold the scale of the loss, and what the search expected of
      shifts.
    - `terms`: needed under `jit` and `grad`.
    - `loss`: as in `fit_prony`.
    """
    check_type("loss", loss, *get_args(Loss))
    check_terms(data, terms)
    path = ()

    def searched(data):
        nonlocal path
        # On matrices of this size more threads gain nothing; on a busy machine they cost much.
        with one_thread_of_lapack:
            theta, series, path = shifts_and_series(data, terms)
            for _ in range(0 if loss == "linear" else SOFTENINGS):
                before = np.inf if series.scale is None else float(series.scale)
                scale = series.median_deviation(theta)
                data = dataclasses.replace(data, scale=jnp.asarray(scale))
                theta, series, path = shifts_and_series(data, terms)
                if scale > SETTLED * before:
                    break
        expected = np.zeros(2) if series.isotherms is None else series.isotherms.penalty
        scale = np.inf if series.scale is None else series.scale
        return theta, series.within_bounds(theta), np.asarray(expected), np.asarray(scale)

    fixed = jax.lax.stop_gradient(data)
    if concrete(fixed):
        found = map(jax.device_put, searched(fixed))
    else:
        assert terms is not None
        count = 2 * terms + data.num_extras + data.num_shifts
        sizes = ((count,), float), ((count,), bool), ((2,), float), ((), float)
        shapes = tuple(jax.ShapeDtypeStruct(*size) for size in sizes)
        found = jax.pure_callback(searched, shapes, fixed, vmap_method="sequential")
    theta, free, expected, scale = found
    if data.isotherms is not None:
        data = eqx.tree_at(lambda data: data.isotherms.penalty, data, expected)
    if loss != "linear":
        data = dataclasses.replace(data, scale=scale)
    return attach_derivative(theta, free, data), data, path


@eqx.filter_custom_jvp
def attach_derivative(
    theta: Unknowns, free: Bool[Array, " unknowns"], data: Observations
) -> Unknowns:
    """Returns `theta` unchanged, with its derivatives by every number in `data`.

    `theta` must minimise the cost in its `free` entries; this is not checked.
    """
    return theta


@attach_derivative.def_jvp
def _attach_derivative_jvp(primals, tangents):
    theta, free, data = primals
    return theta, _change_of_optimum(theta, free, data, tangents[2])


@compiled
def _change_of_optimum(theta, free, data, d_data):
    gradient = jax.grad(lambda theta, data: problem_of(data, jnp).total_cost(theta))
    _, forcing = eqx.filter_jvp(lambda data: gradient(theta, data), (data,), (d_data,))

    def column(direction):
        return jax.jvp(lambda theta: gradient(theta, data), (theta,), (direction,))[1]

    # One column at a time: all at once would take unknowns times the memory of a gradient.
    hessian = jax.lax.map(column, jnp.eye(len(theta), dtype=theta.dtype))
    scale = jnp.sqrt(jnp.maximum(jnp.abs(jnp.diagonal(hessian)), 1e-300))
    scale = jnp.where(free, scale, 1)
    both = free[:, None] & free
    matrix = jnp.where(both, hessian / scale / scale[:, None], 0)
    matrix = matrix + jnp.diag(jnp.where(free, RIDGE, 1))
    change = jnp.linalg.solve(matrix, jnp.where(free, forcing / scale, 0))
    return -change / scale
