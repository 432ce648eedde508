"""What a function computes: its program, apart from the numbers that go into it.

Heights of a surface, properties of a stack and whatever else a function closes over become
arguments of the program, so that functions that differ in these numbers alone take the same
compiled code, and compiling does not slow down with the surface.
"""

import re
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend import core

from ..contact.problem import RESULTS
from ..files.toml import nearest
from ..friction.sliding import with_observables
from .store import fingerprint

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


class Program(NamedTuple):
    """A function of a point as JAX sees it (https://docs.jax.dev/en/latest/jaxpr.html).

    **Fields:**

    - `function`: what was traced.
    - `jaxpr`: takes `numbers`, then those of a point.
    - `text`: of `jaxpr`, which takes longer to write than many a solve.
    - `numbers`: arrays that the function closes over.
    - `point`: one that it was traced with; only dtypes count.
    - `like`: shapes and dtypes of what it returns: arrays by name, and a member of `RESULTS`.
    """

    function: Callable[[dict[str, Any]], Any]
    jaxpr: core.Jaxpr
    text: str
    numbers: list[Any]
    point: dict[str, np.generic]
    like: tuple[dict[str, jax.ShapeDtypeStruct], Any]

    @property
    def unused(self) -> list[str]:
        """Names of the numbers of a point on which nothing depends."""
        used = {id(atom) for equation in self.jaxpr.eqns for atom in equation.invars}
        used |= {id(atom) for atom in self.jaxpr.outvars}
        names = zip(sorted(self.point), self.jaxpr.invars[len(self.numbers) :], strict=True)
        return [name for name, variable in names if id(variable) not in used]

    def __call__(self, numbers: list[Any], point: dict[str, Any]) -> tuple[dict[str, Any], Any]:
        """Returns what the function gives with other numbers, at another point."""
        run = core.jaxpr_as_fun(core.ClosedJaxpr(self.jaxpr, []))
        flat = run(*numbers, *jax.tree.leaves(point))
        return jax.tree.unflatten(jax.tree.structure(self.like), flat)


def trace(function: Callable[[dict[str, Any]], Any], point: dict[str, np.generic]) -> Program:
    """Returns the program of a function of a point.

    It gives the arrays that the function returns, in any nesting, by their paths, complex ones as
    real and imaginary parts; and how its solves ended: of several, the last that did not succeed.

    **Raises:** `ValueError` if the function asks for what the point does not have; what JAX raises
    for a function that it cannot trace.
    """
    # What is compiled apart would keep its numbers.
    apart = isinstance(function, jax.stages.Wrapped)
    inner = cast(Any, function).__wrapped__ if apart else function
    try:
        closed, like = jax.make_jaxpr(
            lambda p: _named(with_observables(inner(p))), return_shape=True
        )(point)
    except KeyError as error:
        name = error.args[0] if error.args else None
        if not isinstance(name, str) or name in point:
            raise
        raise ValueError(
            f"`function` asks for {name!r}, which no axis has; {nearest(name, point)}"
        ) from error
    variables, numbers = list(closed.jaxpr.constvars), list(closed.consts)

    def lifted(atom):  # single numbers stand in the text of the program
        shape: Any = atom.aval
        if not isinstance(atom, core.Literal) or not jnp.issubdtype(shape.dtype, jnp.inexact):
            return atom
        variables.append(core.Var(shape))
        numbers.append(np.asarray(atom.val, shape.dtype))
        return variables[-1]

    equations = [
        equation.replace(invars=[lifted(atom) for atom in equation.invars])
        for equation in closed.jaxpr.eqns
    ]
    arguments = [*variables, *closed.jaxpr.invars]
    jaxpr = closed.jaxpr.replace(constvars=[], invars=arguments, eqns=equations)
    return Program(inner, jaxpr, str(jaxpr), numbers, point, like)


def identity(program: Program) -> str:
    """Returns 64 hexadecimal digits that differ if a program computes anything else.

    Each number that it closes over counts bit for bit. A library that changes the program changes
    them as well. What Python does in a callback they do not see.
    """
    numbers = [_plain(number) for number in (*program.numbers, *_inside(program.jaxpr))]
    return fingerprint(_ADDRESS.sub("", program.text), *numbers)


def code_of(program: Program) -> str:
    """Returns 64 hexadecimal digits that differ if compiled code would, in this process.

    Unlike in `identity`, numbers that are its arguments do not count, and callbacks do.
    """
    inside = [_plain(number) for number in _inside(program.jaxpr)]
    names = str(jax.tree.structure((program.point, program.like)))
    return fingerprint(program.text, names, *inside)


def _named(found: Any) -> tuple[dict[str, jax.Array], Any]:
    leaves, _ = jax.tree_util.tree_flatten_with_path(found, is_leaf=_is_result)
    arrays, end = {}, RESULTS.successful
    for path, leaf in leaves:
        name = jax.tree_util.keystr(path, simple=True, separator=".") or "value"
        if _is_result(leaf):
            end = RESULTS.where(leaf == RESULTS.successful, end, leaf)
            continue
        leaf = jnp.asarray(leaf)
        if jnp.iscomplexobj(leaf):
            arrays |= {f"{name}.real": leaf.real, f"{name}.imag": leaf.imag}
        else:
            arrays[name] = leaf
    return arrays, end


def _is_result(value: Any) -> bool:
    return isinstance(value, RESULTS)


def _inside(jaxpr: Any) -> Iterator[Any]:
    """The numbers that programs inside a program close over, which their text abridges."""
    for equation in jaxpr.eqns:
        for inner in jax.tree.leaves(equation.params):
            if hasattr(inner, "eqns"):
                yield from getattr(inner, "consts", ())
                yield from _inside(inner)


def _plain(number: Any) -> np.ndarray:
    if jnp.issubdtype(number.dtype, jax.dtypes.prng_key):
        number = jax.random.key_data(number)
    return np.asarray(number)
