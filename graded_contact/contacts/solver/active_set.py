"""Pressures on a given set of points, for the Newton steps of `semismooth_newton.py`.

The equations of the solid K + λ with heights h and mean pressure p̄, on the set A of points in
contact:

    (K + λ) σ - h + c = 0 on A,   σ = 0 elsewhere,   mean σ = p̄.

If A has few points, a dense system is solved: the matrix of K between them is gathered from the
response to one loaded point. Otherwise generalised conjugate residuals solve it, preconditioned by
the inverse kernel on A: two FFT pairs for each direction, with a limited number of directions.

S. C. Eisenstat, H. C. Elman & M. H. Schultz, SIAM J. Numer. Anal. 20 (1983) 345,
doi:10.1137/0720023.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...core.compilation import varying
from ...fields.devices import num_devices
from ..operators.operator import AbstractOperator, Field, Scalar, nonzero
from .splitting import DRAFTED_FROM

REDUCTION = 0.1  # of the residual by one iterated step
_NUM_DIRECTIONS, _NUM_DIRECTIONS_OF_LARGE = 24, 8  # on large grids, in single precision
_FEWEST, _MOST = 128, 2048  # limits of the number of eliminated points


class Coated(NamedTuple):
    """A solid under a coat of springs, all in units of pressure.

    **Fields:**

    - `operator`: K.
    - `green`: the gap that one point of unit pressure opens, K in space, see `green_of`.
    - `coat`: compliance λ of the springs.
    - `heights`: h, 0 at q = 0 except for the rest of the springs.
    - `load`: mean of the pressure.
    """

    operator: AbstractOperator
    green: Field | None
    coat: Scalar
    heights: Field
    load: Float[Array, "..."]


def green_of(operator: AbstractOperator, shape: tuple[int, ...]) -> Field | None:
    """Returns the displacement around one loaded point, or None if it differs between points."""
    return operator.to_field(operator.compliance + 0j, shape) if operator.of_distance else None


def pressure_on(contact, solid: Coated, pressure: Field, tolerance: Scalar, unchanged, budget):
    """Returns pressure, gap, relative residual before, and FFT pairs.

    **Arguments:**

    - `contact`: the set A.
    - `pressure`: to begin from.
    - `tolerance`: relative residual that is small enough.
    - `unchanged`: whether A is as in the last step, so that the residual should become as small;
      else one step reduces it tenfold.
    - `budget`: FFT pairs after which no direction is begun.
    """
    operator, green, lam, heights, load = solid
    coated = operator.with_kernel(operator.kernel + lam)
    mask = contact.astype(pressure.dtype)
    share, coat = nonzero(operator.mean(mask)), jnp.broadcast_to(lam, mask.shape)

    def iterate():
        begun = mask * pressure
        begun = begun + mask * ((load - operator.mean(begun)) / share)
        return _iterated(coated, mask, heights, begun, tolerance, unchanged, budget // 2)

    def eliminate(room):
        assert green is not None  # of a matrix between few points
        found = solve_on_few(mask, green, coat, heights, load * mask.size, room)
        return varying((found, jnp.zeros((), found.dtype), jnp.asarray(0)))

    # Matrices of a few sizes, each four times the last.
    most = most_eliminated(operator, pressure)
    rooms = [room for n in (3, 2, 1, 0) if (room := most >> 2 * n) >= _FEWEST]
    fitting = sum((jnp.sum(mask) > room for room in rooms), jnp.asarray(0))
    ways = [*(functools.partial(eliminate, room) for room in rooms), iterate]
    pressure, off, pairs = jax.lax.switch(fitting, ways)
    gap = coated.displace(pressure) - heights
    return pressure, gap - operator.mean(mask * gap) / share, off, pairs + 1


def most_eliminated(operator: AbstractOperator, field: Array) -> int:
    """Returns the largest number of points to eliminate, in the time of about forty FFT pairs.

    It is 0 for a field over several devices, because elimination would gather the field, and for an
    operator whose matrix does not follow from one loaded point.
    """
    if num_devices(field) > 1 or not operator.of_distance:
        return 0
    return min(_MOST, 2 ** math.ceil(math.log2(4 * math.sqrt(field.size))), field.size // 2)


def solve_on_few(
    weight: Field, green: Field, diagonal: Field, rhs: Field, total: Scalar | None, room: int
) -> Field:
    """Returns f with d f + w K w f + c w = rhs and Σ w f = total where w is not 0, and 0 elsewhere.

    `weight` w is not 0 at `room` points at most, `green` is K in space. Without a `total`, c = 0.
    """
    # Points of equal value come in their order. `jnp.nonzero` compiles to twenty kernels.
    _, where = jax.lax.top_k((weight != 0).ravel().astype(jnp.float32), room)
    where = jnp.unravel_index(where, weight.shape)
    used = jnp.arange(room) < jnp.sum(weight != 0)
    offsets = tuple((i[:, None] - i) % n for i, n in zip(where, weight.shape, strict=True))
    one, w = jnp.eye(room, dtype=green.dtype), jnp.where(used, weight[where], 0)
    matrix = w[:, None] * green[offsets] * w + jnp.where(used, diagonal[where], 1) * one
    sides = jnp.stack([jnp.where(used, rhs[where], 0), w], axis=1)
    found, by_weight = jnp.linalg.solve(matrix, sides).T
    if total is not None:  # the sum is 0 where there is no point
        found = found + by_weight * ((total - jnp.sum(w * found)) / nonzero(jnp.sum(w * by_weight)))
    return jnp.zeros_like(green).at[where].add(found)


def _iterated(coated, mask, heights, pressure, tolerance, unchanged, most):
    """The pressure closer to the solution, the relative residual before, and FFT pairs."""
    inverse, share = coated.inverse, nonzero(coated.mean(mask))

    def project(field):
        return mask * (field - coated.mean(mask * field) / share)

    def solve(field):
        return project(coated.filtered(inverse, project(field)))

    residual = solve(heights - coated.displace(pressure))
    size, begun = _norm(pressure), _norm(residual)
    close = tolerance * size
    goal = jnp.where(unchanged, close, jnp.maximum(REDUCTION * begun, close))
    operate = lambda field: solve(coated.displace(field))  # noqa: E731
    change, num = _conjugate_residuals(operate, residual, goal, most)
    return pressure + change, begun / size, 2 + 2 * num


def _conjugate_residuals(operate, residual, goal, most):
    """The change that brings a residual's norm below a goal, and the number of directions."""
    large = residual.size >= DRAFTED_FROM
    stored = _NUM_DIRECTIONS_OF_LARGE if large else _NUM_DIRECTIONS
    fields = jnp.zeros((stored, *residual.shape), jnp.float32 if large else residual.dtype)
    axes = tuple(range(1, fields.ndim))

    def running(state):
        _, residual, _, _, num = state
        return (_norm(residual) > goal) & (num < most)

    def body(state):
        change, residual, directions, images, num = state
        image = operate(residual)
        weights = jnp.sum(images * image, axis=axes, keepdims=True)
        image = image - jnp.sum(weights * images, axis=0)
        direction = residual - jnp.sum(weights * directions, axis=0)
        size = _norm(image)
        scale = 1 / jnp.where(size > 0, size, 1)
        image, direction = image * scale, direction * scale
        along = jnp.sum(image * residual)
        slot = num % stored
        return (
            change + along * direction,
            residual - along * image,
            directions.at[slot].set(direction.astype(fields.dtype)),
            images.at[slot].set(image.astype(fields.dtype)),
            num + 1,
        )

    start = (jnp.zeros_like(residual), residual, fields, fields, jnp.asarray(0))
    change, *_, num = jax.lax.while_loop(running, body, varying(start))
    return change, num


def _norm(field):
    return jnp.sqrt(jnp.sum(field * field))
