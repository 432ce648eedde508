"""Design with a random objective: parameters that minimise its mean.

    def objective(parameters, key):           # friction on a new surface
        surface = random_surface(spectrum, grid, key)
        return slide(with_values(stack, parameters), surface, ...).friction

A design for a few given surfaces is good on these surfaces only; here every step draws a new one.
Steps come from an optimiser of optax (by default Adam: D. P. Kingma, J. Ba, arXiv:1412.6980) on
the logarithms of the parameters, projected on the bounds. Constraints enter by an augmented
Lagrangian whose multipliers move with every step (R. T. Rockafellar, SIAM J. Control 12 (1974) 268,
doi:10.1137/0312021). The result is the mean of the later steps, which reduces noise (B. T. Polyak,
A. B. Juditsky, SIAM J. Control Optim. 30 (1992) 838, doi:10.1137/0330046).
"""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PRNGKeyArray

from ..core.compilation import jit
from ..core.display import shown
from ..studies.points import patiently
from .search import box_of, first_in

STIFFNESS = 2.0  # of the penalty: a constraint missed by a half weighs as much as the objective
RISE = 0.1  # share of a multiplier's full step in each draw


@shown("value", "error", "parameters", "constraints", "constraints_error")
class ExpectedDesign(eqx.Module):
    """Parameters that minimise a mean.

    **Fields:**

    - `parameters`: as `lower` and `upper` were given.
    - `value`, `error`: mean of the objective over new draws, and its standard error.
    - `constraints`, `constraints_error`: means of the constraints and their standard errors, flat.
    - `history`: the objective of each step, with its draw.
    """

    parameters: Any
    value: float
    error: float
    constraints: Float[np.ndarray, " constraints"]
    constraints_error: Float[np.ndarray, " constraints"]
    history: Float[np.ndarray, " steps"]


def minimise_expected(
    objective: Callable[[Any, PRNGKeyArray], Float[Array, ""]],
    lower: Any,
    upper: Any,
    start: Any = None,
    *,
    constraints: Callable[[Any, PRNGKeyArray], Any] = lambda parameters, key: (),
    optimiser: optax.GradientTransformation | None = None,
    num_steps: int = 200,
    num_checks: int = 16,
    seed: int = 0,
) -> ExpectedDesign:
    """Returns the parameters between `lower` and `upper` that minimise the mean of `objective`.

    **Arguments:**

    - `objective`: parameters and a key of JAX -> a number, differentiable by JAX; it is jitted.
      Draw all random numbers with the key, which is a new one in each step.
    - `lower`, `upper`, `start`: as in `minimise`; there is one start.
    - `constraints`: parameters and the key -> numbers whose means must not be negative.
    - `optimiser`: any of optax, for the logarithms of the parameters; by default `optax.adam` with
      a rate that falls from 0.1 to 0.
    - `num_steps`: number of steps, a draw each; the result is the mean of the latter half.
    - `num_checks`: number of new draws that evaluate the result.
    - `seed`: of all draws.

    **Returns:** the parameters, and mean and standard error of the value over new draws.
    """
    box = box_of(lower, upper)
    low, high = np.log(box.low), np.log(box.high)
    optimiser = optimiser or optax.adam(optax.cosine_decay_schedule(0.1, num_steps))
    keys = jax.random.split(jax.random.key(seed), num_steps + num_checks)

    @partial(jit, small=0)  # it may draw large surfaces
    def parts(u: Array, key: Array) -> tuple[Array, Array]:
        parameters = box.unravel(jnp.clip(jnp.exp(u), box.low, box.high))
        limits = ravel_pytree(constraints(parameters, key))[0]
        return jnp.reshape(objective(parameters, key), ()), limits

    @partial(jit, small=0)
    def step(u: Array, state: Any, multipliers: Array, stiffness: Array, key: Array) -> tuple:
        def lagrangian(u: Array) -> tuple[Array, tuple[Array, Array]]:
            value, limits = parts(u, key)
            # A constraint that holds with room to spare pulls with neither multiplier nor penalty.
            pull = jnp.maximum(multipliers - stiffness * limits, 0)
            return value + jnp.sum(pull**2) / (2 * stiffness), (value, limits)

        slope, (value, limits) = jax.grad(lagrangian, has_aux=True)(u)
        updates, state = optimiser.update(slope, state, u)
        u = jnp.clip(jnp.asarray(optax.apply_updates(u, updates)), low, high)
        return u, state, jnp.maximum(multipliers - RISE * stiffness * limits, 0), value

    def work(stop: threading.Event) -> ExpectedDesign:
        u = jnp.log(first_in(box, start))
        value, limits = parts(u, keys[0])
        state, multipliers, path, values = optimiser.init(u), jnp.zeros_like(limits), [], []
        size = jnp.abs(value)
        for key in keys[:num_steps]:
            u, state, multipliers, value = step(u, state, multipliers, STIFFNESS * size, key)
            path.append(u)
            values.append(float(value))
            size = jnp.asarray(np.mean(np.abs(values)))
            if stop.is_set():
                raise KeyboardInterrupt
        u = jnp.mean(jnp.stack(path[num_steps // 2 :]), axis=0)
        checks = [np.append(*parts(u, key)) for key in keys[num_steps:]]
        mean = np.mean(checks, axis=0)
        error = np.std(checks, axis=0, ddof=1) / np.sqrt(num_checks)
        return ExpectedDesign(
            parameters=box.unravel(jnp.clip(jnp.exp(u), box.low, box.high)),
            value=float(mean[0]),
            error=float(error[0]),
            constraints=mean[1:],
            constraints_error=error[1:],
            history=np.array(values),
        )

    return patiently(work)
