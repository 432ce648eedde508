"""Anderson's acceleration of a fixed-point iteration, with a short memory.

D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float


class History(eqx.Module):
    """State of the acceleration: the last images T(z), their changes T(z) - z, and products."""

    z: Float[Array, "*shape"]
    images: Float[Array, "m *shape"]
    changes: Float[Array, "m *shape"]
    products: Float[Array, "m m"]
    count: Array
    best: Float[Array, ""]
    cycles: Array
    error: Float[Array, ""]

    @classmethod
    def empty(cls, z, m: int) -> "History":
        fields = jnp.zeros((m, *z.shape), z.dtype)
        none, infinite = jnp.asarray(0), jnp.asarray(jnp.inf, z.dtype)
        return cls(z, fields, fields, jnp.zeros((m, m), z.dtype), none, infinite, none, infinite)


def accelerate(state: History, image, error) -> History:
    """Returns the next state: an affine combination of images whose changes nearly cancel."""
    m = len(state.products)
    change = image - state.z
    size = dot(change, change)
    # A change five times the least so far means that the history misleads: forget it.
    forget = size > 25 * state.best
    count = jnp.where(forget, 1, jnp.minimum(state.count + 1, m))
    slot = state.cycles % m
    images, changes = state.images.at[slot].set(image), state.changes.at[slot].set(change)
    # Sums of products fuse into single passes; a matrix product of the history does not.
    row = jnp.stack([dot(changes[i], change) for i in range(m)])
    products = state.products.at[slot, :].set(row).at[:, slot].set(row)
    used = (slot - jnp.arange(m)) % m < count
    gram = jnp.where(used[:, None] & used[None, :], products, 0) / jnp.where(size > 0, size, 1)
    ridge = 32 * jnp.finfo(size.dtype).eps ** 0.75
    gram = gram + jnp.diag(jnp.where(used, ridge * jnp.diag(gram), 1))
    weights = jnp.linalg.solve(gram, used.astype(size.dtype))
    weights = weights / jnp.sum(weights)
    latest = (jnp.arange(m) == slot).astype(size.dtype)
    weights = jnp.where(jnp.all(jnp.isfinite(weights)), weights, latest)
    return History(
        z=jnp.asarray(sum(weights[i] * images[i] for i in range(m))),
        images=images,
        changes=changes,
        products=products,
        count=count,
        best=jnp.where(forget, size, jnp.minimum(state.best, size)),
        cycles=state.cycles + 1,
        error=error,
    )


def dot(a, b):
    return jnp.sum(a * b)
