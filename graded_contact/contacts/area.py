"""The contact area, with the edges of contact between the points."""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..fields.grid import Grid, Waves, mode_numbers, multiplicity, wavenumber
from .operators.operator import Field, Scalar, nonzero, positions

# Directions of waves that `edge_stiffness` tells apart.
_SECTORS = 8


def area_in_doubt(indicator: Field, correction: Field) -> Scalar:
    """Returns the fraction of points that may be on the wrong side of the edge of contact [1].

    These are points whose indicator (see `AbstractLaw.contact_indicator`) [Pa] is below four times
    the `correction` of the pressure, there or on average (root mean square). The error of the grid
    adds to it.
    """
    doubt = 4 * jnp.maximum(jnp.abs(correction), jnp.sqrt(jnp.mean(correction**2)))
    return jnp.mean(jnp.abs(indicator) < doubt, dtype=indicator.dtype)


class Edges(eqx.Module):
    """The edges of contact, beside pressures and gaps.

    **Fields:**

    - `softest`: the softest an edge can be over `edge_stiffness`, by which gaps are weighed [1].
    - `cuts`: for each axis, whether the body is cut off after a point, see `cuts_of`.
    """

    softest: Scalar
    cuts: tuple[Array, ...]


@jax.jit
def edge_stiffness(kernels: Waves, grid: Grid) -> tuple[Scalar, Scalar]:
    """Returns the softest and the stiffest that an edge of contact can be, 1/|M| [Pa/m].

    Geometric means of the waves near half the Nyquist number, with the moduli 1/(q |M|) of the
    direction in which these are largest. Under sliding this is along the motion: the field at an
    edge is singular and full of high frequencies. Softest and stiffest differ by the frequency.

    **Arguments:**

    - `kernels`: M [m/Pa] at each frequency that edges may have, shape `(frequencies, *half)`.
    - `grid`: of the waves.
    """
    counts = zip(mode_numbers(grid.shape), grid.shape, strict=True)
    parts = [4 * jnp.asarray(k) / n for k, n in counts]
    radius = sum(part**2 for part in parts)
    near = (radius >= 0.5**2) & (radius <= 1.5**2)
    weight = jnp.where(near, multiplicity(grid.shape), 0).astype(grid.size.dtype)
    sector = jnp.round(_SECTORS / np.pi * jnp.arctan2(parts[0], parts[-1])) % _SECTORS
    sector = jnp.broadcast_to(sector, weight.shape).astype(int)

    def sums(values):
        """Over the waves of each direction."""
        return jnp.zeros(_SECTORS, weight.dtype).at[sector].add(weight * values)

    wave = jnp.log(jnp.where(near, wavenumber(grid), 1))
    # On few points 0 in some directions, on a line in all but one.
    count = sums(jnp.ones_like(weight))
    compliance = [sums(jnp.log(jnp.abs(jnp.where(near, kernel, 1))) + wave) for kernel in kernels]
    compliance = jnp.stack(compliance) / nonzero(count)
    least = jnp.min(jnp.where(count > 0, compliance, jnp.inf), axis=1)
    stiffness = jnp.exp(jnp.sum(weight * wave) / jnp.sum(weight) - least)
    return jnp.min(stiffness), jnp.max(stiffness)


def cuts_of(heights: Field, periodic: bool) -> tuple[Array, ...]:
    """Returns where the body is cut off between a point and the next along each axis, 0 to 1.

    There the heights jump by more than twice what the slopes on both sides explain, in full from
    four times on. The end of a window is a cut, too.
    """
    return tuple(_cuts_along(heights, axis, periodic) for axis in range(heights.ndim))


def _cuts_along(heights, axis, periodic):
    drop = jnp.abs(jnp.roll(heights, -1, axis) - heights)
    last = positions(heights.shape)[axis] == heights.shape[axis] - 1
    ends = last & (not periodic)
    drop = jnp.where(ends, 0, drop)
    # A wave of four points looks like teeth: the second neighbours tell it from one tooth.
    first, second, third, fourth = _rolled(drop, axis, -2, -1, 1, 2)
    around = second + third + (first + fourth) / 4
    jump = drop / nonzero(jnp.maximum(around, drop / 8))
    return jnp.where(ends, 1, _rising(jump, 2.0, 4.0))


def _rolled(field, axis, *places):
    """`jnp.roll` to each of several places, as views of one larger field: it saves memory."""
    most = max(map(abs, places))
    widths = [(most, most) if i == axis else (0, 0) for i in range(field.ndim)]
    around = jnp.pad(field, widths, mode="wrap")
    size = field.shape[axis]
    return [jax.lax.slice_in_dim(around, most - k, most - k + size, axis=axis) for k in places]


def _rising(value: Array, low: float, high: float) -> Array:
    """Returns 0 below `low`, 1 above `high`, and smoothly rising numbers between."""
    part = jnp.clip((value - low) / (high - low), 0, 1)
    return part**2 * (3 - 2 * part)


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


@partial(jax.jit, static_argnames="distance")
def contact_shares(
    indicator: Field, edges: Edges, distance: Callable[[Array, int], Array] = edge_distance
) -> Float[Array, "*shape"]:
    """Returns the share of each point in contact [1], with the edges of contact between the points.

    Lines of points along each axis are cut where the contact ends, and the mean of all half lines
    around a point is taken. A point joins the contact with a share of 0, so that the sum never
    jumps.

    **Arguments:**

    - `indicator`: see `AbstractLaw.contact_indicator` [Pa].
    - `edges`: what is known of them.
    - `distance`: function of g/p and the number of dimensions, see `edge_distance`.
    """
    inside, parts = indicator > 0, []
    for axis in range(indicator.ndim):
        further, other, back = _rolled(indicator, axis, -2, -1, 1)
        far = other > 0
        mixed = inside != far
        behind = jnp.where(inside, back, further)
        high, low = jnp.maximum(indicator, other), jnp.minimum(indicator, other)
        high, low = jnp.where(mixed, high, 1), jnp.where(mixed, low, -1)
        ratio = -low / high
        # The root of 0 has no derivative.
        ratios = (jnp.clip(r, 1e-7, 1e6) for r in (ratio, edges.softest * ratio))
        stiff, soft = (distance(r, indicator.ndim) for r in ratios)
        rise = _rise(high, behind)
        x = _unless_cut(_regular_edge(rise, stiff, soft), rise, edges.cuts[axis])
        # Of the half of the line at the point in contact, and at the other one.
        shares = jnp.minimum(2 * x, 1), jnp.maximum(2 * x - 1, 0)
        near, beyond = (
            jnp.where(mixed, jnp.where(touches, *shares), touches) for touches in (inside, far)
        )
        parts += [near, jnp.roll(beyond, 1, axis)]
    return jnp.asarray(sum(parts) / len(parts))


def _regular_edge(rise, stiff, soft):
    """The place of an edge after the last point [spacings], where the body goes on.

    A block that creeps is as stiff as its highest frequencies at an edge that moves, and softer at
    one that rests or moves back slowly: gap and pressure alone do not tell. So between both the
    pressures of two points decide, as far as they follow the root of the distance.
    """
    place = stiff + _rising(rise, 1.0, 2.0) * (_root_law(rise) - stiff)
    return jnp.clip(place, stiff, soft)


def _unless_cut(regular, rise, cut):
    """The place of an edge, half way to the next point where the body is cut off.

    The contact may end before, as the pressure shows. A point alone in contact has no inner one; it
    may leave the contact at any time, without a jump.
    """
    corner = jnp.minimum(_root_law(rise), 0.5)
    held = cut * _rising(rise, 0.0, 0.05)
    return regular + held * jnp.maximum(corner - regular, 0)


def _rise(pressure, behind):
    """The square of the pressure one point further inside over that at the last point [1]."""
    behind = jnp.maximum(behind, 0)
    return (behind / jnp.maximum(pressure, 1e-3 * behind)) ** 2


def _root_law(rise):
    """The place where a pressure that falls as the root of the distance ends, at most 2."""
    return 1 / jnp.maximum(rise - 1, 0.5)


def sub_pixel_area(indicator: Field, edges: Edges) -> Scalar:
    """Returns the contact area fraction, the mean of `contact_shares` [1].

    It is continuous in every parameter and has a derivative, and no contact is so small that it has
    none.
    """
    return jnp.mean(contact_shares(indicator, edges))
