"""Anderson's acceleration of a fixed-point iteration, with few earlier iterates.

D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305: the next iterate is the affine
combination of the last images whose changes nearly cancel. Contacts use it on whole fields, where
its cost is reading memory: images are stored as differences, so that the newest are
combined in few passes. On large grids they are stored in single precision, which changes the
combination by 1e-7 of the residual, and their products are summed over every fourth row.
"""

import operator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

# Points of a grid whose history exceeds the cache; there every fourth row enters the weights.
SAMPLED_FROM = 2**16
_SAMPLE = 4
STEPS_OF_CYCLE = 2  # steps of a contact between accelerations


class Iterates(eqx.Module):
    """State of the iteration and its history. Cycle i is in slot i mod m of every array."""

    z: Float[Array, "*shape"]
    image: Float[Array, "*shape"]  # the last T(z)
    differences: Float[Array, "m *shape"]  # of images from the image before
    changes: Float[Array, "m *sampled"]  # T(z) - z
    products: Float[Array, "m m"]
    count: Array
    best: Float[Array, ""]
    cycles: Array
    error: Float[Array, ""]
    running: Bool[Array, ""]

    @property
    def num_steps(self) -> Array:
        return self.cycles * STEPS_OF_CYCLE

    @classmethod
    def empty(cls, z: Float[Array, "*shape"], m: int) -> "Iterates":
        """Returns the state at a start z, before its first image."""
        stored = jnp.float32 if z.size >= SAMPLED_FROM else z.dtype
        fields = jnp.zeros((m, *z.shape), stored)
        changes = jnp.zeros((m, *z[_rows_of_sample(z.size)].shape), stored)
        products, infinite = jnp.zeros((m, m), z.dtype), jnp.asarray(jnp.inf, z.dtype)
        none, running = jnp.asarray(0), jnp.asarray(True)
        return cls(z, z, fields, changes, products, none, infinite, none, infinite, running)


def accelerate(state: Iterates, image, error, running) -> Iterates:
    """Returns the next state: an affine combination of images whose changes nearly cancel.

    The newest image alone if the iteration is not `running` any more.
    """
    m = len(state.products)
    slot, order = jax.lax.rem(state.cycles, m), np.arange(m)
    rows = _rows_of_sample(image.size)
    change = (image[rows] - state.z[rows]).astype(state.changes.dtype)
    changes = jax.lax.dynamic_update_index_in_dim(state.changes, change, slot, 0)
    difference = (image - state.image).astype(state.differences.dtype)
    differences = jax.lax.dynamic_update_index_in_dim(state.differences, difference, slot, 0)
    weighed = change.astype(image.dtype)
    row = jnp.stack(sums(*(changes[i] * weighed for i in range(m))))
    newest = order == slot
    products = jnp.where(newest[:, None], row, state.products)
    products = jnp.where(newest, row[:, None], products)
    size = jnp.sum(jnp.where(newest, row, 0))
    # A change five times the least so far means that the history misleads: forget it.
    forget = size > 25 * state.best
    count = jnp.where(forget, 1, jnp.minimum(state.count + 1, m))
    age = jnp.where(order > slot, slot - order + m, slot - order)
    weights = _weights(products, age < count)
    # A difference takes back the weights of all images that are older than it.
    back = jnp.sum(jnp.where(age[None, :] > age[:, None], weights, 0), axis=1)
    back = jnp.where(running & jnp.all(jnp.isfinite(back)), back, 0)
    z = image - sum(back[i] * differences[i] for i in range(m))
    best = jnp.where(forget, size, jnp.minimum(state.best, size))
    return Iterates(
        z, image, differences, changes, products, count, best, state.cycles + 1, error, running
    )


def _rows_of_sample(count: int) -> slice:
    """Returns the rows of a field of `count` points that products are taken over."""
    return slice(1, None, _SAMPLE) if count >= SAMPLED_FROM else slice(None)


def sums(*fields: Float[Array, "*shape"]) -> tuple[Float[Array, ""], ...]:
    """Returns the sums of fields of one shape, in one pass."""
    zeros = tuple(jnp.zeros((), field.dtype) for field in fields)
    axes = tuple(range(fields[0].ndim))
    add = lambda a, b: tuple(map(operator.add, a, b))  # noqa: E731
    return tuple(jax.lax.reduce(fields, zeros, add, axes))


def _weights(products, used):
    """Weights of sum 1 that make the combined change least."""
    m = len(products)
    order = np.arange(m)
    diagonal = order[:, None] == order
    largest = jnp.max(jnp.where(diagonal & used, products, 0))
    gram = jnp.where(used[:, None] & used, products, 0) / jnp.where(largest > 0, largest, 1)
    ridge = 32 * np.finfo(products.dtype).eps ** 0.75
    gram = jnp.where(diagonal, jnp.where(used, (1 + ridge) * gram, 1), gram)

    def eliminate(k, system):
        pivot = system[k] / system[k, k]
        return jnp.where(order[:, None] == k, pivot, system - system[:, k, None] * pivot)

    # A loop: factorisations from libraries take longer to compile and to run. The matrix is
    # positive definite, which needs no exchange of rows.
    system = jnp.concatenate([gram, used[:, None].astype(gram.dtype)], axis=1)
    weights = jax.lax.fori_loop(0, m, eliminate, system)[:, m]
    return weights / jnp.sum(weights)
