"""The optimum of a search in differentiable programs.

At the optimum θ of an objective f its gradient vanishes, so that dθ = -f_θθ⁻¹ f_θd dd for a change
dd of anything observed or known. Unknowns at a bound stay there. With more terms than the data
determine f_θθ is nearly singular: single terms then have no useful derivative, but E(ω) has.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..core.checks import is_concrete
from ..core.compilation import compiled

RIDGE = 1e-13  # relative to the diagonal of the Hessian: far below what data determine


def search(find: Callable[..., tuple], sizes: tuple[int, ...], *arguments: Any) -> tuple:
    """Returns the arrays that `find(*arguments)` finds in NumPy, also under `jit` and `grad`.

    `arguments` are pytrees of arrays. `find` returns the unknowns, of shape `(sizes[0],)`, which of
    them are at no bound, and float arrays of the other `sizes`. No derivatives are attached.
    """
    arguments = jax.lax.stop_gradient(arguments)
    if all(is_concrete(leaf) for leaf in jax.tree.leaves(arguments)):
        return tuple(map(jnp.asarray, find(*arguments)))
    unknowns, *others = (jax.ShapeDtypeStruct((size,), np.float64) for size in sizes)
    free = jax.ShapeDtypeStruct((sizes[0],), np.bool_)
    return jax.pure_callback(find, (unknowns, free, *others), *arguments, vmap_method="sequential")


@eqx.filter_custom_jvp
def attach_derivative(
    objective: Callable[[Array, Any], Array],
    theta: Float[Array, " unknowns"],
    free: Bool[Array, " unknowns"],
    data: Any,
) -> Float[Array, " unknowns"]:
    """Returns `theta` unchanged, with its derivatives by every number in `data`.

    `theta` must minimise `objective(theta, data)` in its `free` entries; this is not checked.
    """
    return theta


@attach_derivative.def_jvp
def _attach_derivative_jvp(primals, tangents):
    objective, theta, free, data = primals
    return theta, _change_of_optimum(objective, theta, free, data, tangents[3])


@compiled
def _change_of_optimum(objective, theta, free, data, d_data):
    gradient = jax.grad(objective)
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
