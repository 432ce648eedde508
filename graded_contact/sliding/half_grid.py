"""Heights and fields on half the grid of a surface, and the waves that it lacks."""

import functools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..contacts.operators.operator import nonzero
from ..core.compilation import compiled
from ..fields.grid import Grid, derivative, resampled

_FEWEST = 4  # points along an axis that are not halved again
NOTHING_LACKS = 1e-5  # of the squared slope: below it half the grid lacks nothing


def halved(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Returns half as many points along each axis that has enough."""
    return tuple(n if n < 2 * _FEWEST else n // 2 for n in shape)


@compiled
def heights_on(
    heights: Array, grid: Grid, half: tuple[int, ...], window: bool
) -> tuple[Array, Array, Array]:
    """Returns heights on half the grid, on the grid without the waves it lacks, and their share.

    The share is of the squared slope [1].
    """
    if window:
        return _means(heights, half), heights, jnp.zeros((), heights.dtype)
    less = resampled(heights, half)
    cut = resampled(less, heights.shape)
    axes = range(heights.ndim)
    lost, all_of = (
        jnp.sum(jnp.stack([jnp.mean(derivative(field, grid, axis) ** 2) for axis in axes]))
        for field in (heights - cut, heights)
    )
    return less, cut, lost / nonzero(all_of)


def roughness_on(
    rough: tuple[Array, ...], grid: Grid, half: tuple[int, ...], window: bool
) -> tuple[tuple[Array, ...], tuple[Array, ...], Array]:
    """Returns `heights_on` of all rough bodies, with the largest share."""
    parts = [heights_on(heights, grid, half, window) for heights in rough]
    on_half, cut, lacking = zip(*parts, strict=True)
    return on_half, cut, functools.reduce(jnp.maximum, lacking)


def _means(heights: Array, shape: tuple[int, ...]) -> Array:
    """The heights of a window on fewer points: of an even number the means of two neighbours."""
    for axis, (n, m) in enumerate(zip(heights.shape, shape, strict=True)):
        if n == m:
            continue
        place = (np.arange(m) + 0.5) * (n / m) - 0.5
        left = np.floor(place).astype(int)
        weight = (place - left).reshape([-1 if i == axis else 1 for i in range(heights.ndim)])
        low, high = (jnp.take(heights, i, axis) for i in (left, np.minimum(left + 1, n - 1)))
        heights = low + jnp.asarray(weight, heights.dtype) * (high - low)
    return heights
