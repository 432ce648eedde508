"""Anderson's acceleration of a fixed-point iteration, with a short memory.

D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305. Its cost is that of reading
memory: images are kept as differences, so that the newest are combined with few passes, and on
large grids products are taken over every fourth row.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

_LARGE, _SAMPLE = 2**18, 4  # points of a large grid, and rows of it for one that is used


class History(eqx.Module):
    """State of the acceleration. Entries of one age stand in one slot, the newest in `newest`."""

    z: Float[Array, "*shape"]
    image: Float[Array, "*shape"]  # the last T(z)
    differences: Float[Array, "m *shape"]  # of images, each less the one before
    changes: Float[Array, "m *sampled"]  # T(z) - z
    products: Float[Array, "m m"]
    count: Array
    best: Float[Array, ""]
    cycles: Array
    error: Float[Array, ""]

    @classmethod
    def empty(cls, z, m: int) -> "History":
        fields = jnp.zeros((m, *z.shape), z.dtype)
        changes = jnp.zeros((m, *_sampled(z).shape), z.dtype)
        products, infinite = jnp.zeros((m, m), z.dtype), jnp.asarray(jnp.inf, z.dtype)
        none = jnp.asarray(0)
        return cls(z, z, fields, changes, products, none, infinite, none, infinite)


def accelerate(state: History, image, error) -> History:
    """Returns the next state: an affine combination of images whose changes nearly cancel."""
    m = len(state.products)
    slot = state.cycles % m
    change = _sampled(image) - _sampled(state.z)
    changes = state.changes.at[slot].set(change)
    differences = state.differences.at[slot].set(image - state.image)
    row = jnp.stack(sums(*(changes[i] * change for i in range(m))))
    products = state.products.at[slot, :].set(row).at[:, slot].set(row)
    size = row[slot]
    # A change five times the least so far means that the history misleads: forget it.
    forget = size > 25 * state.best
    count = jnp.where(forget, 1, jnp.minimum(state.count + 1, m))
    age = (slot - jnp.arange(m)) % m
    weights = _weights(products, age < count)
    # What the images weigh that are older than a difference is what the difference takes back.
    back = jnp.sum(jnp.where(age[None, :] > age[:, None], weights, 0), axis=1)
    back = jnp.where(jnp.all(jnp.isfinite(back)), back, 0)
    return History(
        z=image - sum(back[i] * differences[i] for i in range(m)),
        image=image,
        differences=differences,
        changes=changes,
        products=products,
        count=count,
        best=jnp.where(forget, size, jnp.minimum(state.best, size)),
        cycles=state.cycles + 1,
        error=error,
    )


def sums(*fields: Float[Array, "*shape"]) -> tuple[Float[Array, ""], ...]:
    """Returns the sums of fields of one shape, in one pass."""
    zeros = tuple(jnp.zeros((), field.dtype) for field in fields)
    axes = tuple(range(fields[0].ndim))
    return tuple(jax.lax.reduce(fields, zeros, _add, axes))


def _add(a, b):
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _weights(products, used):
    """Weights of sum 1 that make the combined change least."""
    largest = jnp.max(jnp.where(used, jnp.diag(products), 0))
    gram = jnp.where(used[:, None] & used[None, :], products, 0)
    gram = gram / jnp.where(largest > 0, largest, 1)
    ridge = 32 * np.finfo(products.dtype).eps ** 0.75
    gram = gram + jnp.diag(jnp.where(used, ridge * jnp.diag(gram), 1))
    weights = jnp.linalg.solve(gram, used.astype(products.dtype))
    return weights / jnp.sum(weights)


def _sampled(field):
    return field[::_SAMPLE] if field.size >= _LARGE else field
