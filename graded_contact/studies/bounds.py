"""Positive parameters between bounds, in any nesting, as flat numbers with names."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

Flat = Float[np.ndarray, " parameters"]


class Box(NamedTuple):
    """Flat bounds, the names of what they bound, and what gives flat values their nesting."""

    low: Flat
    high: Flat
    names: list[str]
    unravel: Callable[[Array], Any]


def box_of(lower: Any, upper: Any) -> Box:
    """Returns the bounds, checked.

    **Raises:** `ValueError` unless both have the same nesting and 0 < lower <= upper.
    """
    if jax.tree.structure(lower) != jax.tree.structure(upper):
        raise ValueError("`lower` and `upper` must have the same nesting.")
    names, low = named(lower)
    names_high, high = named(upper)
    if names != names_high:
        raise ValueError("`lower` and `upper` must have arrays of the same shapes.")
    if len(low) == 0:
        raise ValueError("`lower` holds no parameter.")
    for name, a, b in zip(names, low, high, strict=True):
        if not (np.isfinite(a) and np.isfinite(b) and 0 < a <= b):
            raise ValueError(
                f"Bounds of {name} are {a:g} and {b:g}; they must be positive, and the lower one "
                "not above the upper."
            )
    _, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.asarray(leaf, float), lower))
    return Box(low, high, names, unravel)


def first_in(box: Box, start: Any, lower: Any) -> Flat:
    """Returns where a search begins: `start`, checked, or the middle on the logarithm."""
    if start is None:
        return np.sqrt(box.low * box.high)
    if jax.tree.structure(start) != jax.tree.structure(lower):
        raise ValueError("`start` must have the nesting of `lower`.")
    names, first = named(start)
    if first.shape != box.low.shape:
        raise ValueError("`start` must have arrays of the same shapes as `lower`.")
    for name, x, a, b in zip(names, first, box.low, box.high, strict=True):
        if not a * (1 - 1e-9) <= x <= b * (1 + 1e-9):
            raise ValueError(f"`start` has {name} = {x:g}, not between {a:g} and {b:g}.")
    return np.clip(first, box.low, box.high)


def named(tree: Any) -> tuple[list[str], Flat]:
    """Returns names and values of all numbers in a nesting."""
    names, values = [], []
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        array = np.asarray(leaf, float)
        where = jax.tree_util.keystr(path, simple=True, separator=".") or "parameter"
        for index in np.ndindex(array.shape):
            names.append(where + "".join(f"[{i}]" for i in index))
            values.append(float(array[index]))
    return names, np.array(values)


def text_of(parameters: Any) -> str:
    """Returns names and values in one line."""
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(*named(parameters), strict=True))
