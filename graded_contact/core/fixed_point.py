"""Fixed points by Anderson's acceleration, with their implicit derivative.

Outside `jit` the loop runs in Python, so that the function is compiled in its own programs.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .anderson import Iterates, accelerate
from .checks import is_concrete
from .compilation import alone
from .derivative import still

_MEMORY = 4
_LINEAR_RTOL, _RESTART = 1e-6, 16  # of GMRES
MAX_STEPS = 40


class FixedPoint(NamedTuple):
    """State of the iteration.

    **Fields:**

    - `history`: the unknowns and the last images; see the properties `x` and `error`.
    - `low`, `high`: the highest iterate that grew, and the lowest that shrank, by their sums.
    - `best`: the least change so far.
    - `state`: what the function carries from one step to the next, such as its start.
    """

    history: Iterates
    low: Float[Array, "..."]
    high: Float[Array, "..."]
    best: Float[Array, ""]
    state: Any

    @property
    def x(self) -> Float[Array, "..."]:
        """The unknowns."""
        return self.history.z

    @property
    def error(self) -> Float[Array, ""]:
        """The largest change of the last step, over the largest unknown."""
        return self.history.error


def find_fixed_point(
    function: Callable, start: Float[Array, "..."], state: Any, rtol: Float[Array, ""],
    *, ordered: bool = True,
) -> FixedPoint:  # fmt: skip
    """Returns x = function(x, state)[0] to a change of `rtol` of the largest |x|.

    The function also returns the next state. `ordered` unknowns grow and shrink together, so that
    iterates can bracket the fixed point.
    """

    def step(point: FixedPoint) -> FixedPoint:
        image, state = function(point.x, point.state)
        # The state may hold fields: they do not pass through the program of a few unknowns.
        return _next(point._replace(state=None), image, rtol, ordered)._replace(state=state)

    running = lambda point: point.history.running  # noqa: E731
    point = step(_first(start)._replace(state=state))
    if not all(map(is_concrete, jax.tree.leaves(point))):
        return jax.lax.while_loop(running, step, point)
    while running(point):
        point = step(point)
    return point


@jax.jit
def _first(start: Array) -> FixedPoint:
    far = jnp.full_like(start, jnp.inf)
    return FixedPoint(Iterates.empty(start, _MEMORY), -far, far, far.ravel()[0], None)


@partial(jax.jit, static_argnames="ordered")
def _next(point: FixedPoint, image: Array, rtol: Array, ordered: bool) -> FixedPoint:
    """The accelerated iterate, or the middle of the bracket if it lies outside."""
    x, low, high = point.x, point.low, point.high
    change, largest = jnp.max(jnp.abs(image - x)), jnp.max(jnp.abs(image))
    error = change / jnp.where(largest > 0, largest, 1)
    running = ~(error <= rtol)
    history = accelerate(point.history, image, error, running)
    history = dataclasses.replace(history, running=running & (history.cycles < MAX_STEPS))
    if not ordered:
        return point._replace(history=history)
    # The fixed point lies above iterates that grow, and below those that shrink.
    grows = jnp.sum(image - x) > 0
    low = jnp.where(grows & (jnp.sum(x) > jnp.sum(low)), x, low)
    high = jnp.where(~grows & (jnp.sum(x) < jnp.sum(high)), x, high)
    # Sums alone may contradict each other: forget them.
    crossed = jnp.sum(low) >= jnp.sum(high)
    low = jnp.where(crossed & ~grows, -jnp.inf, low)
    high = jnp.where(crossed & grows, jnp.inf, high)
    best = jnp.minimum(point.best, change)
    total, slack = jnp.sum(history.z), len(x) * best
    inside = (total > jnp.sum(low) - slack) & (total < jnp.sum(high) + slack)
    middle = jnp.where(jnp.all(jnp.isfinite(high - low)), (low + high) / 2, image)
    z = jnp.where(inside | ~running, history.z, middle)
    return FixedPoint(dataclasses.replace(history, z=z), low, high, best, None)


def attach_fixed_point(function: Callable, given: Any, x: Float[Array, " n"]) -> Float[Array, " n"]:
    """Returns x = function(given, x) unchanged, with its derivative by `given`, of any order.

    It takes the derivative of each of the few unknowns, and a linear system of their number.
    """

    @eqx.filter_custom_jvp
    def attached(x, given):
        return x

    @attached.def_jvp
    def attached_jvp(primals, tangents):
        # Attached again, so that a derivative of the rule itself moves with the fixed point.
        x, given = attached(*primals), primals[1]
        moved = eqx.filter_jvp(lambda given: function(given, x), (given,), tangents[1:])[1]
        image, units = partial(function, given), jnp.eye(len(x), dtype=x.dtype)
        if alone(primals):  # in the programs that a derivative in reverse has
            back = jax.vjp(image, x)[1]
            matrix = jnp.stack([back(unit)[0] for unit in units])
        else:  # `map` compiles it once
            matrix = jax.lax.map(lambda unit: jax.jvp(image, (x,), (unit,))[1], units).T
        return x, jnp.linalg.solve(units - matrix, moved)

    return attached(x, given)


def attach_fixed_field(
    function: Callable, given: Any, x: Float[Array, "*shape"]
) -> Float[Array, "*shape"]:
    """Returns x = function(given, x) unchanged, with its first derivative by `given`.

    For fields: GMRES solves the linear system.
    """
    fixed = still(given)
    image = function(given, x)
    change = image - jax.lax.stop_gradient(image)
    return x + solve_lagged(lambda v: jax.jvp(lambda x: function(fixed, x), (x,), (v,))[1], change)


def solve_lagged(linear: Callable, rhs: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Returns x = rhs + linear(x) by GMRES, with its derivative."""

    def solve(operate, rhs):
        how: dict[str, Any] = {"tol": _LINEAR_RTOL, "restart": _RESTART, "maxiter": 4}
        return jax.scipy.sparse.linalg.gmres(operate, rhs, solve_method="incremental", **how)[0]

    return jax.lax.custom_linear_solve(lambda v: v - linear(v), rhs, solve, solve)
