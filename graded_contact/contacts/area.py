"""The contact area: counted, and with the edges of contact between the points."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..fields.grid import Grid, Waves, mode_numbers, multiplicity
from .operator import Field, Scalar


def counted_area(contact: Bool[Array, "*shape"]) -> Scalar:
    """Returns the fraction of points in contact [1]. Piecewise constant: it has no derivative."""
    return jnp.mean(contact, dtype=jnp.result_type(float))


def area_in_doubt(indicator: Field, correction: Field) -> Scalar:
    """Returns the fraction of points that may be on the wrong side of the edge of contact [1].

    These are points whose indicator (see `AbstractLaw.contact_indicator`) [Pa] is below four times
    the `correction` of the pressure, there or on average (root mean square). The error of the grid
    adds to it.
    """
    doubt = 4 * jnp.maximum(jnp.abs(correction), jnp.sqrt(jnp.mean(correction**2)))
    return jnp.mean(jnp.abs(indicator) < doubt, dtype=indicator.dtype)


def edge_stiffness(kernel: Waves, grid: Grid) -> Scalar:
    """Returns a stiffness 1/|M| near the edge of contact [Pa/m], which weighs gaps there.

    It is the geometric mean over the waves of all directions near half the Nyquist number, since
    edges run in all directions and a wave across the velocity excites no losses.
    """
    counts = zip(mode_numbers(grid.shape), grid.shape, strict=True)
    radius = sum((4 * jnp.asarray(k) / n) ** 2 for k, n in counts)
    near = (radius >= 0.5**2) & (radius <= 1.5**2)
    weight = jnp.where(near, multiplicity(grid.shape), 0).astype(grid.size.dtype)
    logarithm = jnp.log(jnp.abs(jnp.where(near, kernel, 1)))
    return jnp.exp(-jnp.sum(weight * logarithm) / jnp.sum(weight))


def edge_distance(ratio: Array, ndim: int) -> Array:
    """Returns the distance of the last point in contact from the edge [spacings].

    At the distance s from an edge the pressure is k √s, and outside the gap is 4/3 k/E* s^(3/2),
    since the contact is not singular there. With p at the last point inside and g at the next one,
    the gap times the stiffness of the block, (1 - x)³ = r² x where r = 3/π g/p. An edge at an angle
    θ to the line has 1/cos θ times this ratio, which is π/2 in the mean over all edges that a line
    meets. The root is 1/(1 + r^(2/3) + r²) up to 0.02.

    **Arguments:**

    - `ratio`: g/p [1].
    - `ndim`: dimensions of the surface; in one an edge is always across.
    """
    r = (3 / np.pi if ndim == 1 else 3 / 2) * ratio
    return 1 / (1 + jnp.cbrt(r) ** 2 + r**2)


def contact_shares(
    indicator: Field, edge: Callable[[Array, int], Array] = edge_distance
) -> Float[Array, "*shape"]:
    """Returns the share of each point in contact [1], with the edges of contact between the points.

    Lines of points along each axis are cut where the contact ends, and the mean of all half lines
    around a point is taken. A point joins the contact with a share of 0, so that the sum never
    jumps.

    **Arguments:**

    - `indicator`: see `AbstractLaw.contact_indicator` [Pa].
    - `edge`: function of g/p and the number of dimensions, see `edge_distance`.
    """
    inside, parts = indicator > 0, []
    for axis in range(indicator.ndim):
        other = jnp.roll(indicator, -1, axis)
        far = other > 0
        mixed = inside != far
        high, low = jnp.maximum(indicator, other), jnp.minimum(indicator, other)
        ratio = jnp.where(mixed, -low / jnp.where(mixed, high, 1), 1)
        x = edge(jnp.clip(ratio, 1e-7, 1e6), indicator.ndim)  # the root of 0 has no derivative
        # Of the half of the line at the point in contact, and at the other one.
        shares = jnp.minimum(2 * x, 1), jnp.maximum(2 * x - 1, 0)
        near, beyond = (
            jnp.where(mixed, jnp.where(touches, *shares), touches) for touches in (inside, far)
        )
        parts += [near, jnp.roll(beyond, 1, axis)]
    return jnp.asarray(sum(parts) / len(parts))


def sub_pixel_area(indicator: Field) -> Scalar:
    """Returns the contact area fraction, the mean of `contact_shares` [1].

    It is continuous in every parameter and has a derivative, and no contact is so small that it has
    none.
    """
    return jnp.mean(contact_shares(indicator))
