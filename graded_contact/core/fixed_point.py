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
import numpy as np
import scipy
from jax.core import eval_context
from jaxtyping import Array, Float

from .anderson import Iterates, accelerate
from .checks import is_concrete
from .compilation import alone, compiled, varying
from .derivative import linear, still

_MEMORY = 4
_LINEAR_RTOL, _RESTART = 1e-6, 16  # of GMRES
MAX_STEPS = 40
_NEAR = 0.2  # error below which an accelerated iterate may leave the bracket
_PATIENCE = 4  # steps in which one end of the bracket may stay
_NEGATIVE = 0.2  # of the largest unknown, by which others may be less than 0 before an image is


class End(NamedTuple):
    """An end of the bracket of unknowns: the largest of an iterate and of its image."""

    size: Float[Array, ""]
    image: Float[Array, ""]


class FixedPoint(NamedTuple):
    """State of the iteration.

    **Fields:**

    - `history`: the unknowns and the last images; see the properties `x` and `error`.
    - `low`, `high`: the ends of the bracket: an iterate that grew, and one that shrank.
    - `best`: the least error so far.
    - `moved`: how often in a row `high` moved, or -`low`.
    - `state`: what the function carries from one step to the next, such as its start.
    """

    history: Iterates
    low: End
    high: End
    best: Float[Array, ""]
    moved: Float[Array, ""]
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
    most: Float[Array, ""] | None = None,
) -> FixedPoint:  # fmt: skip
    """Returns x = function(x, state)[0] to a change of `rtol` of the largest |x|.

    The function also returns the next state. With `most`, no unknown exceeds it and all grow and
    shrink together, as temperatures do: iterates bracket the fixed point by their largest. At first
    the next iterate is the last image, brought to a size in the bracket; near the fixed point it is
    the accelerated one. If the iterates still grow at `most`, x ends there.
    """

    def step(point: FixedPoint) -> FixedPoint:
        image, state = function(point.x, point.state)
        # The state may hold fields: they do not pass through the program of a few unknowns.
        return _next(point._replace(state=None), image, rtol, most)._replace(state=state)

    running = lambda point: point.history.running  # noqa: E731
    point = step(_first(start)._replace(state=state))
    if not all(map(is_concrete, jax.tree.leaves(point))):
        return jax.lax.while_loop(running, step, varying(point))
    while running(point):
        point = step(point)
    return point


@compiled
def _first(start: Array) -> FixedPoint:
    none, far = jnp.zeros((), start.dtype), jnp.full((), jnp.inf, start.dtype)
    history = Iterates.empty(start, _MEMORY)
    return FixedPoint(history, End(-far, none), End(far, none), far, none, None)


@compiled
def _next(point: FixedPoint, image: Array, rtol: Array, most: Array | None) -> FixedPoint:
    """The next iterate: accelerated, or in the bracket."""
    x = point.x
    change, largest = jnp.max(jnp.abs(image - x)), jnp.max(jnp.abs(image))
    error = change / jnp.where(largest > 0, largest, 1)
    running = ~(error <= rtol) & jnp.isfinite(change)
    history = accelerate(point.history, image, error, running)
    history = dataclasses.replace(history, running=running & (history.cycles < MAX_STEPS))
    if most is None:
        return point._replace(history=history)
    low, high, moved = _moved_ends(point, here := End(jnp.max(x), jnp.max(image)))
    size = _within(low, high)
    bracketed, total = jnp.isfinite(size), jnp.max(history.z)
    inside = (total > low.size) & (total < jnp.minimum(high.size, 2 * here.image))
    short = jnp.max(jnp.abs(history.z - x)) <= 2 * change
    near = (error < _NEAR) | (error < point.best / 2)
    # An image that is nearly nothing shows no profile.
    profile = jnp.where(here.image > here.size / 10, image, x)
    profile = jnp.maximum(profile / jnp.max(profile), -_NEGATIVE / 2)
    overheats = (here.image > here.size) & has_reached(x, most)
    # Where most is cooled the largest unknown says nothing.
    cools = largest > here.image
    inside, bracketed = inside | cools, bracketed & ~cools
    other = jnp.where(bracketed, profile * size, image)
    fast = ~overheats & jnp.where(near, inside | short, ~bracketed & inside)
    z = jnp.where(fast, history.z, other)
    z = z * jnp.minimum(1, most / jnp.maximum(jnp.max(z), most))
    z = jnp.maximum(z, jnp.minimum(jnp.min(image), -_NEGATIVE * jnp.max(z)))
    # Twice: at the first time the profile may belong to a much smaller image.
    ends = overheats & has_reached(point.low.size, most)
    z = jnp.where(running, jnp.where(ends, x, z), x)
    history = dataclasses.replace(history, z=z, running=history.running & ~ends)
    return FixedPoint(history, low, high, jnp.minimum(point.best, error), moved, None)


def has_reached(x: Array, most: Array) -> Array:
    """Returns whether the largest unknown is `most`, up to rounding."""
    return jnp.max(x) >= most * (1 - 1e-6)


def _moved_ends(point: FixedPoint, here: End) -> tuple[End, End, Array]:
    """The bracket with a new iterate, and how often in a row this end moved.

    An end is forgotten if the new iterate contradicts it, or if only the other one moves: it was
    found at another profile.
    """
    grows = here.image > here.size
    moved = jnp.where(grows, jnp.minimum(point.moved, 0) - 1, jnp.maximum(point.moved, 0) + 1)
    stays, again = jnp.abs(moved) > _PATIENCE, jnp.abs(moved) > 1

    def end(is_here, old, other, forgotten, none):
        size = jnp.where(is_here, here.size, jnp.where(forgotten, none, old.size))
        # The other end comes nearer if this one moves again (the rule of Illinois).
        level = jnp.where(old.size > 0, old.size, other.size)
        image = jnp.where(again, jnp.sqrt(jnp.maximum(old.image, 0) * level), old.image)
        return End(size, jnp.where(is_here, here.image, image))

    low, high = point.low, point.high
    return (
        end(grows, low, here, (here.size <= low.size) | (stays & (low.size > 0)), -jnp.inf),
        end(~grows, high, here, (here.size >= high.size) | stays, jnp.inf),
        moved,
    )


def _within(low: End, high: End) -> Array:
    """Where in a bracket the image has the size of the iterate; not finite without a bracket.

    Between the ends the logarithm of the image is taken as linear.
    """
    # Images that are less than nothing have no logarithm.
    least, most = (jnp.log(jnp.maximum(end.image, 1e-6 * high.size)) for end in (high, low))

    def halve(_, ends):
        left, right = ends
        middle = (left + right) / 2
        share = (middle - low.size) / (high.size - low.size)
        grows = most + share * (least - most) > jnp.log(middle)
        return jnp.where(grows, middle, left), jnp.where(grows, right, middle)

    left, right = jax.lax.fori_loop(0, 50, halve, varying((low.size, high.size)))
    return (left + right) / 2


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
        units = jnp.eye(len(x), dtype=x.dtype)
        if alone(primals):
            moves = jax.tree.map(lambda t: t is not None, tangents[1], is_leaf=lambda t: t is None)
            moving, fixed = eqx.partition(given, moves)
            image = lambda moving, x: function(eqx.combine(moving, fixed), x)  # noqa: E731
            with eval_context():  # else JAX traces the constants of the function
                back = jax.vjp(image, moving, x)[1]
            ways = partial(_along, back, units), partial(_back, back, units)
            return x, linear(*ways, tangents[1], x)
        # `map` compiles it once.
        moved = eqx.filter_jvp(lambda given: function(given, x), (given,), tangents[1:])[1]
        image = partial(function, given)
        matrix = jax.lax.map(lambda unit: jax.jvp(image, (x,), (unit,))[1], units).T
        return x, jnp.linalg.solve(units - matrix, moved)

    return attached(x, given)


def _along(back: Callable, units: Array, changes: Any) -> Array:
    """The change of a fixed point: one derivative in reverse per unknown gives both matrices."""
    rows, matrix = zip(*map(back, units), strict=True)
    leaves = jax.tree.leaves(changes)
    moved = [sum(map(jnp.vdot, jax.tree.leaves(row), leaves)) for row in rows]
    return jnp.linalg.solve(units - jnp.stack(matrix), jnp.stack(moved))


def _back(back: Callable, units: Array, pull: Array) -> Any:
    """Its transpose: outside `jit` by GMRES, which needs the derivative of few combinations."""
    if is_concrete(pull):
        operate = lambda v: v - np.asarray(back(jnp.asarray(v, pull.dtype))[1])  # noqa: E731
        operator = scipy.sparse.linalg.LinearOperator(units.shape, operate, dtype=pull.dtype)
        how: dict[str, Any] = {"rtol": _LINEAR_RTOL, "restart": len(pull), "maxiter": 2}
        found, _ = scipy.sparse.linalg.gmres(operator, np.asarray(pull), **how)
    else:
        matrix = jnp.stack([back(unit)[1] for unit in units])
        found = jnp.linalg.solve((units - matrix).T, pull)
    return back(jnp.asarray(found, pull.dtype))[0]


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
