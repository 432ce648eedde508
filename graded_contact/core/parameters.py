"""Numbers inside a stack, or any other module, by their path: "layers[0].thickness"."""

import dataclasses
from collections.abc import Mapping
from typing import TypeVar

import equinox as eqx
import jax

from .checks import Numbers, as_float, check_shape, nearest, short

T = TypeVar("T")


def paths(tree: object) -> dict[str, jax.Array]:
    """Returns all numbers and arrays in `tree` by their path, one entry of an array included.

    An array of n numbers has n + 1 paths: "layers[0].material.times" and, of its entries,
    "layers[0].material.times[2]".

    **Arguments:**

    - `tree`: for example a `Stack`.

    **Returns:** arrays by path.
    """
    found = {}
    for path, leaf in jax.tree_util.tree_leaves_with_path(eqx.filter(tree, eqx.is_array)):
        found[name := _name(path)] = leaf
        if leaf.ndim == 1:
            found |= {f"{name}[{i}]": leaf[i] for i in range(len(leaf))}
    return found


def with_values(tree: T, values: Mapping[str, Numbers]) -> T:
    """Returns `tree` with other values at some paths; differentiable in them.

    **Arguments:**

    - `tree`: for example a `Stack`.
    - `values`: by path, see `paths`.

    **Returns:** the tree, checked as its constructors do.

    **Raises:** `ValueError` for a path that is not there, a value of another shape, and what the
    constructors refuse.
    """
    known = paths(tree)
    leaves = {}
    for path, value in values.items():
        if path not in known:
            raise ValueError(f"`tree` has no number {short(path)}; {nearest(path, known)}")
        value = as_float(value, path).astype(known[path].dtype)
        check_shape(path, value, known[path].shape)
        # Several entries of one array are set one after the other.
        whole, bracket, index = path.rpartition("[")
        if bracket and whole in known:
            leaves[whole] = leaves.get(whole, known[whole]).at[int(index[:-1])].set(value)
        else:
            leaves[path] = value
    changed = jax.tree_util.tree_map_with_path(
        lambda path, leaf: leaves.get(_name(path), leaf), tree
    )
    _check(changed)
    return changed


def _name(path):
    """The path of a leaf as text."""
    return jax.tree_util.keystr(path).removeprefix(".")


def _check(tree):
    """Runs the checks of the constructors of all modules in `tree`, the innermost first."""
    if isinstance(tree, eqx.Module):
        for field in dataclasses.fields(tree):
            value = getattr(tree, field.name)
            _check(value)
            field.metadata.get("converter", lambda value: value)(value)
        getattr(tree, "__check_init__", lambda: None)()
    elif isinstance(tree, tuple | list):
        for part in tree:
            _check(part)
