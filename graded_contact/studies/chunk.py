"""A function at several points by one compiled program: in this process, or in any other.

The points of a chunk are a loop whose length is an argument of the program, so that any number of
points takes the same program and gives the same bits, whatever was kept from an earlier run.
"""

from collections.abc import Callable, Collection, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.problem import RESULTS
from ..files.results import FAILED
from .store import reason_of

Columns = dict[str, np.ndarray]  # scalars of several points, by name


def arrays_of(found: Any) -> dict[str, jax.Array]:
    """Returns the arrays in any nesting by their paths, complex ones as real and imaginary parts.

    How a solve ended is left out: see `chunk_program`.
    """
    leaves, _ = jax.tree_util.tree_flatten_with_path(found, is_leaf=_is_result)
    arrays = {}
    for path, leaf in leaves:
        name = jax.tree_util.keystr(path, simple=True, separator=".") or "value"
        if _is_result(leaf):
            continue
        leaf = jnp.asarray(leaf)
        if jnp.iscomplexobj(leaf):
            arrays |= {f"{name}.real": leaf.real, f"{name}.imag": leaf.imag}
        else:
            arrays[name] = leaf
    return arrays


def chunk_program(function: Callable, size: int) -> Callable:
    """Returns the compiled program that maps columns of `size` points, and how many of them count,
    to the arrays of each point and to the member of `RESULTS` with which its solves ended."""

    def one(point):
        found = function(point)
        end = RESULTS.successful
        for this in jax.tree.leaves(found, is_leaf=_is_result):
            if _is_result(this):  # of several solves, the last that did not succeed
                end = RESULTS.where(this == RESULTS.successful, end, this)
        return arrays_of(found), end

    @jax.jit
    def program(columns, count):
        like = jax.eval_shape(one, {name: column[0] for name, column in columns.items()})
        start = jax.tree.map(lambda x: jnp.zeros((size, *x.shape), x.dtype), like)

        def add(i, found):
            here = one({name: column[i] for name, column in columns.items()})
            return jax.tree.map(lambda all, new: all.at[i].set(new), found, here)

        return jax.lax.fori_loop(0, count, add, start)

    return program


def run_chunk(
    program: Callable, columns: Columns, size: int, keep: Sequence[Collection[str]] | None = None
) -> tuple[list[Columns], list[str]]:
    """Returns the arrays of each point, and how it ended: empty where it succeeded.

    If the program fails the points are tried one by one, to tell which. With `keep`, the names of
    what each point keeps, the other arrays are dropped.
    """
    count = len(next(iter(columns.values())))
    try:
        return _run(program, columns, count, size, keep)
    except (ValueError, RuntimeError) as error:
        reason = FAILED + reason_of(error)
        if count == 1:
            return [{}], [reason]
    alone = [
        run_chunk(
            program,
            {name: column[i : i + 1] for name, column in columns.items()},
            size,
            None if keep is None else keep[i : i + 1],
        )
        for i in range(count)
    ]
    return [one for values, _ in alone for one in values], [m for _, ms in alone for m in ms]


def _run(program, columns, count, size, keep):
    filled = {name: np.resize(column, size) for name, column in columns.items()}
    values, ends = jax.tree.map(np.asarray, program(filled, count))
    names = keep or [values] * count
    # With the ellipsis a number is an array, too.
    points = [{name: values[name][i, ...] for name in names[i]} for i in range(count)]
    return points, [RESULTS[jax.tree.map(lambda a, i=i: a[i, ...], ends)] for i in range(count)]


def _is_result(value):
    return isinstance(value, RESULTS)
