"""Derivatives in separate programs, so that the programs of values are reused.

Outside `jit`, JAX compiles a differentiated function again: one program for the value and
everything that a derivative may need, and one for the derivative. Here the programs of the value
are those that are already compiled. The derivative is one program, which computes again only what
it needs.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from .checks import is_concrete

# Fails at run time if its second argument is true, else returns the first, a number.
Check = Callable[[Array, Array], Array]

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


def still(tree: T) -> T:
    """Returns the same numbers without derivatives; outside `jit` these are concrete."""
    numbers, others = eqx.partition(tree, eqx.is_array)
    return eqx.combine(_still(numbers), others)


# `jax.lax.stop_gradient` takes as long for each array.
@eqx.filter_custom_jvp
def _still(numbers):
    return numbers


@_still.def_jvp
def _still_jvp(primals, _):
    # Once more, for the derivatives around this one.
    return _still(primals[0]), jax.tree.map(lambda _: None, primals[0])


def derivative_apart(function: F, check: Check | None = None) -> F:
    """Returns a function whose derivative, of any order and mode, is compiled separately.

    `function` takes positional arguments, returns arrays, and is compiled or made of what is.
    `check` fails where a derivative is NaN. It is no part of its program: JAX stores no program on
    disk that calls Python.
    """

    @eqx.filter_jit
    def change(args, tangents):
        moving = jax.tree.map(
            lambda tangent, arg: None if tangent is None else arg,
            tangents,
            args,
            is_leaf=lambda tangent: tangent is None,
        )

        def numbers(moving):
            return eqx.filter(function(*eqx.combine(moving, args)), eqx.is_inexact_array)

        def along(moving, tangents):
            return jax.jvp(numbers, (moving,), (tangents,))[1]

        # Else a derivative in reverse would keep what it needs in a program before.
        return jax.checkpoint(along, prevent_cse=False)(moving, tangents)

    @eqx.filter_custom_jvp
    def attached(found, args):
        return found

    @attached.def_jvp
    def attached_jvp(primals, tangents):
        # Attached again, so that a derivative of the rule itself moves with what was found.
        found = attached(*primals)
        if check is None:
            return found, change(primals[1], tangents[1])
        return found, _checked(change(primals[1], _checked(tangents[1], check)), check)

    def run(*args):
        if all(map(is_concrete, jax.tree.leaves(args))):
            return function(*args)
        return attached(function(*still(args)), args)

    return cast(F, run)


def _checked(tangents: T, check: Check) -> T:
    """The tangents, or in reverse mode the cotangents, the first of which must be no NaN.

    If one is NaN, all are.
    """
    leaves, structure = jax.tree.flatten(tangents)
    leaves[:1] = [_checked_p.bind(leaf, check=check) for leaf in leaves[:1]]
    return jax.tree.unflatten(structure, leaves)


# The identity. A primitive, since outside `jit` its own transpose is to run in Python.
_checked_p = Primitive("checked")


@_checked_p.def_impl
def _look(leaf, *, check: Check):
    return leaf + check(jnp.asarray(-0.0), _is_lost(leaf)).astype(leaf.dtype)


@jax.jit
def _is_lost(leaf):
    return jnp.isnan(jnp.sum(leaf))


def _transposed(cotangent, leaf, *, check: Check):
    return [_checked_p.bind(cotangent, check=check)]


def _batched(leaves, axes, *, check: Check):
    return _checked_p.bind(*leaves, check=check), axes[0]


_checked_p.def_abstract_eval(lambda leaf, *, check: leaf)
ad.deflinear2(_checked_p, _transposed)
batching.primitive_batchers[_checked_p] = _batched
mlir.register_lowering(_checked_p, mlir.lower_fun(_look, multiple_results=False))
