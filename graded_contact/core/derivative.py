"""Derivatives in separate programs, so that the programs of values are reused.

Outside `jit`, JAX compiles a differentiated function again: one program for the value and
everything that a derivative may need, and one for the derivative. Here the programs of the value
are those that are already compiled. The derivative is one program, which computes again only what
it needs. It is a linear primitive with its transpose, since JAX itself would transpose a program
without the options that make it compile in less time.
"""

import dataclasses
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
from .compilation import alone, compiled, outside_jit

# Fails at run time if its second argument is true, else returns the first, a number.
Check = Callable[[Array, Array], Array]
# Called outside `jit` with a derivative that was NaN and its arguments; may raise a reason.
Explain = Callable[[Callable, tuple, Any], None]

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


def still(tree: T) -> T:
    """Returns the same numbers without derivatives; outside `jit` these are concrete."""
    if alone(tree):
        return tree
    numbers, others = eqx.partition(tree, eqx.is_array)
    leaves, structure = jax.tree.flatten(numbers)
    return eqx.combine(structure.unflatten(_still_p.bind(*leaves)), others)


def _still_jvp(primals, _):
    # Once more, for the derivatives around this one.
    return _still_p.bind(*primals), [ad.Zero(jax.typeof(p).to_tangent_aval()) for p in primals]


# `jax.lax.stop_gradient` takes as long for each array. A primitive, because under `vmap` a custom
# rule makes known numbers unknown.
_still_p = Primitive("still")
_still_p.multiple_results = True
_still_p.def_impl(lambda *leaves: leaves)
_still_p.def_abstract_eval(lambda *leaves: leaves)
ad.primitive_jvps[_still_p] = _still_jvp
batching.primitive_batchers[_still_p] = lambda leaves, axes: (_still_p.bind(*leaves), axes)
mlir.register_lowering(_still_p, mlir.lower_fun(lambda *leaves: leaves, multiple_results=True))


def largest(numbers: Array) -> Array:
    """Returns the largest number, with the mean of the derivatives of all that are as large.

    `jnp.max` looks for the largest again in its derivative. A program that computes the numbers
    twice, with other roundings, then finds none, and the derivative is 0/0.
    """
    fixed = jax.lax.stop_gradient(numbers)
    top = jnp.max(fixed)
    near = fixed >= top - 64 * jnp.finfo(fixed.dtype).eps * jnp.max(jnp.abs(fixed))
    return top + jnp.sum(jnp.where(near, numbers - fixed, 0)) / jnp.sum(near)


def derivative_apart(function: F, check: Check | None = None, explain: Explain | None = None) -> F:
    """Returns a function whose derivative, of any order and mode, is compiled separately.

    `function` takes positional arguments, returns arrays, and is compiled or made of what is.
    `check` fails where a derivative is NaN; before that `explain` may, outside `jit`. They are no
    part of its program: JAX stores no program on disk that calls Python.
    """

    def numbers(moving, fixed):
        return eqx.filter(function(*eqx.combine(moving, fixed)), eqx.is_inexact_array)

    @compiled
    def along(moving, fixed, tangents):
        return jax.jvp(lambda moving: numbers(moving, fixed), (moving,), (tangents,))[1]

    @compiled
    def back(moving, fixed, cotangents):
        return jax.vjp(lambda moving: numbers(moving, fixed), moving)[1](cotangents)[0]

    def change(found, args, tangents):
        given = jax.tree.map(lambda t: t is not None, tangents, is_leaf=lambda t: t is None)
        moving, fixed = eqx.partition(args, given)
        if outside_jit():
            like = eqx.filter(found, eqx.is_inexact_array)
            return _linear(along, back, (moving, fixed), tangents, like, explain)
        # Else a derivative in reverse would store what it needs.
        within = jax.checkpoint(lambda m, t: along(m, fixed, t), prevent_cse=False)
        return within(moving, tangents)

    @eqx.filter_custom_jvp
    def attached(found, args):
        return found

    @attached.def_jvp
    def attached_jvp(primals, tangents):
        # Attached again, so that a derivative of the rule itself moves with what was found.
        (found, args), (_, tangents) = (attached(*primals), primals[1]), tangents
        if check is None:
            return found, change(found, args, tangents)
        return found, _checked(change(found, args, _checked(tangents, check)), check)

    def run(*args):
        if all(map(is_concrete, jax.tree.leaves(args))):
            return function(*args)
        return attached(function(*still(args)), args)

    return cast(F, run)


def _linear(along, back, args: tuple, tangents: T, like: Any, explain: Explain | None) -> T:
    """Returns along(*args, tangents), linear in these, with the tree and the shapes of `like`.

    `back`, with cotangents in place of tangents, is the transpose.
    """
    (given, inner), (returned, outer) = jax.tree.flatten(tangents), jax.tree.flatten(like)
    arrays, others = eqx.partition(args, eqx.is_array)
    (arrays, structure), (fixed, rest) = jax.tree.flatten(arrays), jax.tree.flatten(others)
    of_leaves = partial(_OfLeaves, structure=structure, fixed=(*fixed,), rest=rest, explain=explain)
    changes = _linear_p.bind(
        *arrays, *given, along=of_leaves(along, tree=inner), back=of_leaves(back, tree=outer),
        given=tuple(map(jax.typeof, given)), returned=tuple(map(jax.typeof, returned)),
    )  # fmt: skip
    return outer.unflatten(changes)


@dataclasses.dataclass(frozen=True)
class _OfLeaves:
    """A function of arguments and changes, linear in these, as one of their leaves."""

    function: Callable
    structure: Any  # of the arrays of the arguments
    fixed: tuple  # leaves of the rest of these, and their structure
    rest: Any
    tree: Any  # of the changes
    explain: Explain | None = dataclasses.field(compare=False)

    def __call__(self, arrays, changes):
        others = self.rest.unflatten(self.fixed)
        args = eqx.combine(self.structure.unflatten(arrays), others)
        changes = self.tree.unflatten(changes)
        found = jax.tree.leaves(self.function(*args, changes))
        if self.explain is not None and is_concrete(found[0]) and _is_lost(found[0]):
            self.explain(self.function, args, changes)
        return found


@dataclasses.dataclass(frozen=True)
class _Varied:
    """What changes of some arrays change in a function of leaves, and its transpose.

    The last of its arrays are the `count` changes of the function.
    """

    function: "_OfLeaves | _Varied"
    which: tuple[int, ...]
    count: int
    way: Callable  # `_varied_along` or `_varied_back`

    def __call__(self, arrays, changes):
        split = len(arrays) - self.count
        given = list(arrays[:split]), list(arrays[split:]), list(changes)
        return self.way(self.function, self.which, *given)


def _of_some(function, which, arrays, changes):
    """A function of leaves, of some of its arrays, and these."""

    def run(some):
        known = dict(zip(which, some, strict=True))
        return function([known.get(i, array) for i, array in enumerate(arrays)], changes)

    return run, [arrays[i] for i in which]


@compiled
def _varied_along(function, which, arrays, changes, moved):
    run, some = _of_some(function, which, arrays, changes)
    return jax.jvp(run, (some,), (moved,))[1]


@compiled
def _varied_back(function, which, arrays, changes, cotangents):
    run, some = _of_some(function, which, arrays, changes)
    return jax.vjp(run, some)[1](cotangents)[0]


_linear_p = Primitive("linear")
_linear_p.multiple_results = True


@_linear_p.def_impl
def _run_along(*leaves, along, given, **_):
    num = len(leaves) - len(given)
    return along(leaves[:num], leaves[num:])


def _linear_transposed(cotangents, *leaves, along, back, given, returned):
    arrays = leaves[: len(leaves) - len(given)]
    cotangents = map(ad.instantiate_zeros, cotangents)
    turned = dict(along=back, back=along, given=returned, returned=given)
    return [None for _ in arrays] + _linear_p.bind(*arrays, *cotangents, **turned)


def _linear_batched(leaves, axes, **directions):
    if not outside_jit():
        changes = jax.vmap(partial(_run_along, **directions), axes)(*leaves)
        return changes, [0] * len(changes)
    # One by one in the program that is compiled already.
    placed = [*zip(leaves, axes, strict=True)]
    count = next(leaf.shape[axis] for leaf, axis in placed if axis is not None)

    def row(i):
        leaves = (leaf if axis is None else jnp.take(leaf, i, axis) for leaf, axis in placed)
        return _linear_p.bind(*leaves, **directions)

    changes = [jnp.stack(column) for column in zip(*map(row, range(count)), strict=True)]
    return changes, [0] * len(changes)


def _linear_jvp(primals, tangents, *, along, back, given, returned):
    count, directions = len(primals) - len(given), dict(along=along, back=back)
    found = _linear_p.bind(*primals, **directions, given=given, returned=returned)
    parts = []
    if any(type(t) is not ad.Zero for t in tangents[count:]):
        moved = map(ad.instantiate_zeros, tangents[count:])
        bound = dict(directions, given=given, returned=returned)
        parts.append(_linear_p.bind(*primals[:count], *moved, **bound))
    if which := tuple(i for i in range(count) if type(tangents[i]) is not ad.Zero):
        moved = [tangents[i] for i in which]
        varied = partial(_Varied, along, which, len(given))
        parts.append(
            _linear_p.bind(
                *primals, *moved, along=varied(_varied_along), back=varied(_varied_back),
                given=tuple(map(jax.typeof, moved)), returned=returned,
            )
        )  # fmt: skip
    return found, [sum(column[1:], column[0]) for column in zip(*parts, strict=True)]


_linear_p.def_abstract_eval(lambda *_, returned, **__: returned)
ad.deflinear2(_linear_p, _linear_transposed)
ad.primitive_jvps[_linear_p] = _linear_jvp
batching.primitive_batchers[_linear_p] = _linear_batched
mlir.register_lowering(_linear_p, mlir.lower_fun(_run_along, multiple_results=True))


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
    lost = _is_lost(leaf)
    if is_concrete(lost) and not lost:
        return leaf
    return leaf + check(jnp.asarray(-0.0), lost).astype(leaf.dtype)


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
