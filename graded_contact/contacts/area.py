"""The contact area: counted, corrected for the edges, and by a contour between the points."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from ..fields.devices import interleaved_rows
from ..fields.grid import Grid, mode_numbers, multiplicity
from .operator import Field, Scalar, Waves

# Area of a pixel count beyond the true one, per pixel edge between contact and gap.
# V. A. Yastrebov, G. Anciaux, J.-F. Molinari, Tribol. Int. 114 (2017) 161, arXiv:1701.02727.
_EDGE_EXCESS = (np.pi - 1 + np.log(2)) / 24
# How far, in pixels, the contour below lies outside the edge of a straight contact front:
# mean over sub-pixel positions of Westergaard's contact, spread 0.02.
_CONTOUR_OFFSET = 0.14


def counted_area(contact: Bool[Array, "*shape"]) -> Scalar:
    """Returns the fraction of points in contact [1]. Piecewise constant: it has no derivative."""
    return jnp.mean(contact, dtype=jnp.result_type(float))


def area_without_edges(contact: Bool[Array, "*shape"]) -> Scalar:
    """Returns the fraction of points in contact less the excess at the contact's edges [1].

    Each pixel edge between contact and gap takes (π - 1 + ln 2)/24 of a pixel (Yastrebov et al.
    2017, see above). In one dimension there is nothing to correct.
    """
    area = counted_area(contact)
    if contact.ndim == 1:
        return area
    edges = sum(
        jnp.mean(contact != jnp.roll(contact, 1, axis), dtype=area.dtype) for axis in (0, 1)
    )
    return area - _EDGE_EXCESS * edges


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


def area_of_contour(indicator: Field) -> Scalar:
    """Returns a sub-pixel contact area fraction [1], continuous in every parameter.

    The indicator (see `AbstractLaw.contact_indicator`), for a hard wall the pressure in contact and
    minus gap times `edge_stiffness` outside, is interpolated linearly on the four triangles of each
    pixel, and the area where it is positive is summed exactly. A point joins the contact with
    indicator 0, so the area never jumps. On a grid the contour lies 0.14 pixels outside a straight
    edge of contact; that much of its length is subtracted. If this area differs much from the pixel
    count, the grid does not resolve the contact.
    """
    if indicator.ndim == 1:
        return jnp.mean(_positive_part_of_segment(indicator, jnp.roll(indicator, -1)))

    # Row by row of each device, and again for a derivative: whole fields of intermediate values
    # cost more.
    @jax.checkpoint
    def add_row(total, sides):
        left, right = sides
        up, corner = jnp.roll(left, -1, -1), jnp.roll(right, -1, -1)
        centre = (left + right + up + corner) / 4
        for a, b in pairwise((left, right, corner, up, left)):
            area, length = _triangle(a, b, centre)
            total = total + (area - _CONTOUR_OFFSET * length)
        return total, None

    rows = (interleaved_rows(indicator), interleaved_rows(jnp.roll(indicator, -1, 0)))
    total, _ = jax.lax.scan(add_row, jnp.zeros_like(rows[0][0]), rows)
    # A contact of a few pixels is smaller than its own correction.
    return jnp.maximum(jnp.mean(total) / len(rows[0]), 0)


def contact_shares(indicator: Field) -> Field:
    """Returns the share of each point's cell that is in contact [1], with the contour above."""
    if indicator.ndim == 1:
        sides = (jnp.roll(indicator, 1), jnp.roll(indicator, -1))
        halves = [_positive_part_of_segment(indicator, (indicator + side) / 2) for side in sides]
        return (halves[0] + halves[1]) / 2
    total = jnp.zeros_like(indicator)
    for dx, dy in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        along, across = jnp.roll(indicator, dx, 0), jnp.roll(indicator, dy, 1)
        centre = (indicator + along + across + jnp.roll(along, dy, 1)) / 4
        for side in (along, across):
            # A quarter is the whole of a triangle there.
            total = total + _triangle(indicator, (indicator + side) / 2, centre)[0] / 2
    return total


def _positive_part_of_segment(a, b):
    """Fraction of a segment on which its linear interpolant is positive."""
    mixed = (a > 0) != (b > 0)
    span = jnp.where(mixed, jnp.abs(a) + jnp.abs(b), 1)
    return jnp.where(mixed, jnp.maximum(a, b) / span, jnp.where(a > 0, 1, 0).astype(a.dtype))


def _triangle(a, b, c):
    """Area where the interpolant of a, b and the centre c is positive, and its contour."""
    in_a, in_b, in_c = a > 0, b > 0, c > 0
    # The vertex whose sign differs from the other two, if there is one, and the next two.
    by_a, by_b = (in_a != in_b) & (in_a != in_c), (in_b != in_a) & (in_b != in_c)
    by_c = (in_c != in_a) & (in_c != in_b)
    lone = jnp.where(by_a, a, jnp.where(by_b, b, c))
    first = jnp.where(by_a, b, jnp.where(by_b, c, a))
    second = jnp.where(by_a, c, jnp.where(by_b, a, b))
    cut = by_a | by_b | by_c
    # How far along each side the contour cuts it, seen from the lone vertex.
    s = lone / jnp.where(cut, lone - first, 1)
    t = lone / jnp.where(cut, lone - second, 1)
    corner = 0.25 * s * t
    whole = jnp.where(in_a, 0.25, 0.0).astype(a.dtype)
    area = jnp.where(cut, jnp.where(lone > 0, corner, 0.25 - corner), whole)
    # Sides between a or b and c are 1/√2 long, at right angles in c.
    squared = jnp.where(by_a, 1, 0.5) * s * s + jnp.where(by_b, 1, 0.5) * t * t
    squared = squared - jnp.where(by_c, 0, s * t)
    crossed = cut & (squared > 0)
    return area, jnp.where(crossed, jnp.sqrt(jnp.where(crossed, squared, 1)), 0)
