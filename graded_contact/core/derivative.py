"""Derivatives in programs of their own, which compile in less time; and what has no derivative.

JAX takes no options for the programs of a derivative outside `jit`: a first gradient of a contact
would take three times as long. So the value has the programs that it has alone, and the
derivative is one more, which computes again only what it needs. For JAX it is a linear primitive.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from .checks import is_concrete
from .compilation import alone, compiled_loop

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


def still(tree: T) -> T:
    """Stops gradients through all arrays of a tree."""
    return jax.tree.map(lambda a: a if is_concrete(a) else jax.lax.stop_gradient(a), tree)


def largest(numbers: Array) -> Array:
    """Returns the largest number, with the mean of the derivatives of all that are as large.

    `jnp.max` looks for the largest again in its derivative. A program that computes the numbers
    twice, with other roundings, then finds none, and the derivative is 0/0.
    """
    fixed = jax.lax.stop_gradient(numbers)
    top = jnp.max(fixed)
    near = fixed >= top - 64 * jnp.finfo(fixed.dtype).eps * jnp.max(jnp.abs(fixed))
    return top + jnp.sum(jnp.where(near, numbers - fixed, 0)) / jnp.sum(near)


def root_or_zero(square: Array) -> Array:
    """Returns the square root, with the derivative 0 at 0; below 0 it is 0."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1)), 0)


def derivative_apart(function: F) -> F:
    """Returns a function whose first derivative outside `jit` is compiled separately.

    `function` takes positional arguments, returns arrays, and is compiled or made of what is.
    """

    def numbers(moving, fixed):
        return eqx.filter(function(*eqx.combine(moving, fixed)), eqx.is_inexact_array)

    @compiled_loop
    def along(moving, fixed, tangents):
        return jax.jvp(lambda moving: numbers(moving, fixed), (moving,), (tangents,))[1]

    @compiled_loop
    def back(moving, fixed, cotangents):
        return jax.vjp(lambda moving: numbers(moving, fixed), moving)[1](cotangents)[0]

    @eqx.filter_custom_jvp
    def attached(found, args):
        return found

    @attached.def_jvp
    def attached_jvp(primals, tangents):
        # Attached again, so that a derivative of the rule itself moves with what was found.
        found, args, changes = attached(*primals), primals[1], tangents[1]
        given = jax.tree.map(lambda t: t is not None, changes, is_leaf=lambda t: t is None)
        moving, fixed = eqx.partition(args, given)
        if alone(args):
            ways = partial(along, moving, fixed), partial(back, moving, fixed)
            return found, linear(*ways, changes, eqx.filter(found, eqx.is_inexact_array))
        # Else a derivative in reverse would store what it needs.
        within = jax.checkpoint(lambda m, t: along(m, fixed, t), prevent_cse=False)
        return found, within(moving, changes)

    def run(*args):
        if all(map(is_concrete, jax.tree.leaves(args))):
            return function(*args)
        return attached(function(*still(args)), args)

    return cast(F, run)


def linear(along: Callable, back: Callable, changes: Any, like: T) -> T:
    """Returns along(changes), with the tree and the shapes of `like`; `back` is the transpose."""
    (leaves, inner), (returned, outer) = jax.tree.flatten(changes), jax.tree.flatten(like)
    shapes = tuple(map(jax.typeof, leaves)), tuple(map(jax.typeof, returned))
    found = _linear_p.bind(*leaves, ways=(along, back), trees=(inner, outer), shapes=shapes)
    return outer.unflatten(found)


_linear_p = Primitive("linear")
_linear_p.multiple_results = True


@_linear_p.def_impl
def _run_along(*leaves, ways, trees, shapes):
    return jax.tree.leaves(ways[0](trees[0].unflatten(leaves)))


def _transposed(cotangents, *_, **how):
    turned = {name: pair[::-1] for name, pair in how.items()}
    return _linear_p.bind(*map(ad.instantiate_zeros, cotangents), **turned)


def _batched(leaves, axes, **how):
    # One by one in the program that is compiled already.
    placed = [*zip(leaves, axes, strict=True)]
    count = next(leaf.shape[axis] for leaf, axis in placed if axis is not None)

    def row(i):
        rows = (leaf if axis is None else jnp.take(leaf, i, axis) for leaf, axis in placed)
        return _linear_p.bind(*rows, **how)

    changes = [jnp.stack(column) for column in zip(*map(row, range(count)), strict=True)]
    return changes, [0] * len(changes)


_linear_p.def_abstract_eval(lambda *_, shapes, **__: shapes[1])
ad.deflinear2(_linear_p, _transposed)
batching.primitive_batchers[_linear_p] = _batched
mlir.register_lowering(_linear_p, mlir.lower_fun(_run_along, multiple_results=True))
