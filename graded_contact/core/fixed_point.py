"""Fixed points of a few unknowns, with their implicit derivative.

Anderson's acceleration (D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305): the next
iterate combines the last images such that their changes nearly cancel. Outside `jit` the loop runs
in Python, so that the function is compiled in its own programs.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .checks import is_concrete

_MEMORY = 4
MAX_STEPS = 40


class FixedPoint(NamedTuple):
    """State of the iteration.

    **Fields:**

    - `x`: the unknowns.
    - `state`: what the function carries from one step to the next, such as its start.
    - `error`: the largest change of the last step, over the largest unknown.
    - `iterates`, `images`: the last ones, the newest first.
    - `low`, `high`: the highest iterate that grew, and the lowest that shrank, by their sums.
    - `best`: the least change so far.
    - `num_steps`: images computed.
    """

    x: Float[Array, " n"]
    state: Any
    error: Float[Array, ""]
    iterates: Float[Array, "m n"]
    images: Float[Array, "m n"]
    low: Float[Array, " n"]
    high: Float[Array, " n"]
    best: Float[Array, ""]
    num_steps: Array


def find_fixed_point(
    function: Callable[[Array, Any], tuple[Array, Any]],
    start: Float[Array, " n"],
    state: Any,
    rtol: Float[Array, ""],
) -> FixedPoint:
    """Returns x = function(x, state)[0] to a change of `rtol` of the largest |x|.

    The function also returns the next state.
    """

    def step(point: FixedPoint) -> FixedPoint:
        image, state = function(point.x, point.state)
        iterates = jnp.concatenate([point.x[None], point.iterates[:-1]])
        images = jnp.concatenate([image[None], point.images[:-1]])
        largest = jnp.max(jnp.abs(image))
        error = jnp.max(jnp.abs(image - point.x)) / jnp.where(largest > 0, largest, 1)
        used = np.arange(_MEMORY) <= point.num_steps
        # The fixed point lies above iterates that grow, and below those that shrink.
        grows = jnp.sum(image - point.x) > 0
        low = jnp.where(grows & (jnp.sum(point.x) > jnp.sum(point.low)), point.x, point.low)
        high = jnp.where(~grows & (jnp.sum(point.x) < jnp.sum(point.high)), point.x, point.high)
        # Sums alone may contradict each other: forget them.
        crossed = jnp.sum(low) >= jnp.sum(high)
        low = jnp.where(crossed & ~grows, -jnp.inf, low)
        high = jnp.where(crossed & grows, jnp.inf, high)
        best = jnp.minimum(point.best, jnp.max(jnp.abs(image - point.x)))
        slack = len(start) * best
        x = _combined(iterates, images, used)
        between = (jnp.sum(x) > jnp.sum(low) - slack) & (jnp.sum(x) < jnp.sum(high) + slack)
        middle = jnp.where(jnp.all(jnp.isfinite(high - low)), (low + high) / 2, image)
        x = jnp.where(error <= rtol, image, jnp.where(between, x, middle))
        steps = point.num_steps + 1
        return FixedPoint(x, state, error, iterates, images, low, high, best, steps)

    def running(point: FixedPoint):
        return ~(point.error <= rtol) & (point.num_steps < MAX_STEPS)

    rows = jnp.zeros((_MEMORY, len(start)), start.dtype)
    far, most, none = jnp.full_like(start, jnp.inf), jnp.full((), jnp.inf), jnp.asarray(0)
    most = most.astype(start.dtype)
    point = step(FixedPoint(start, state, most, rows, rows, -far, far, most, none))
    if not all(map(is_concrete, jax.tree.leaves(point))):
        return jax.lax.while_loop(running, step, point)
    while running(point):
        point = step(point)
    return point


@jax.jit
def _combined(iterates, images, used):
    """The newest image plus multiples of differences that make the combined change least."""
    changes = images - iterates
    older = jnp.where(used[1:, None], 1, 0)
    by_change, by_image = older * (changes[1:] - changes[0]), older * (images[1:] - images[0])
    gram = by_change @ by_change.T
    scale = jnp.trace(gram)
    ridge = jnp.where(scale > 0, 1e-14 * scale, 1) + jnp.where(used[1:], 0, 1.0)
    weights = jnp.linalg.solve(gram + jnp.diag(ridge), -by_change @ changes[0])
    return images[0] + weights @ by_image


def attach_fixed_point(
    function: Callable[[Array], Array], x: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Returns x = function(x) unchanged, with the derivative by what `function` closes over.

    It takes the derivative of `function` along each unknown, and a linear system of their number.
    """

    def solve(linear, rhs):
        matrix = jax.lax.map(linear, jnp.eye(len(rhs), dtype=rhs.dtype)).T
        return jnp.linalg.solve(matrix, rhs)

    return jax.lax.custom_root(lambda x: function(x) - x, x, lambda _, x: x, solve)
