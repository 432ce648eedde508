"""A function of a point as JAX sees it: its key, and the compiled code.

Arrays that the function closes over (heights, moduli of a stack) become arguments of the compiled
code. So functions that differ in these arrays alone share it, and compiling does not slow down with
the surface.
"""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend import core

from ..contacts.solution import RESULTS
from ..core.checks import nearest
from ..core.compilation import options
from ..sliding.result import with_observables
from .dataset import FAILED, package_versions
from .store import Point, fingerprint

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
_MOST_COMPILED = 8  # programs that stay for later sweeps in this process
_COMPILED: dict[str, Any] = {}

# The numbers of a point, and the names of its results that are needed; None: all.
Task = tuple[dict[str, np.generic], Collection[str] | None]


class Program(NamedTuple):
    """A traced function (https://docs.jax.dev/en/latest/jaxpr.html).

    **Fields:**

    - `function`: what was traced.
    - `point`: a point at which it was traced; only names and dtypes matter.
    - `closed`: the jaxpr, and the arrays that the function closes over.
    - `text`: of the jaxpr and of the names of what it returns.
    - `like`: shapes and dtypes of what it returns: arrays by name, and a member of `RESULTS`.
    - `steps`: of a function of histories that is run step by step, how many a point has at most; 0
      for a function that is compiled as a whole.
    """

    function: Callable[[dict[str, Any]], Any]
    point: dict[str, np.generic]
    closed: core.ClosedJaxpr
    text: str
    like: tuple[dict[str, jax.ShapeDtypeStruct], Any]
    steps: int = 0

    @property
    def key(self) -> str:
        """64 hexadecimal digits that differ if the function computes anything else.

        They count each array that it closes over, bit for bit, but not what Python does in a
        callback.
        """
        return key_of(self.closed, self.text)

    def names_of(self, columns: Mapping[str, np.ndarray]) -> list[str]:
        """Returns a name for each point, by which a store knows what decides its results.

        **Arguments:**

        - `columns`: one number per point by the names of the axes, in any order.
        """
        key, rows = self.key, zip(*columns.values(), strict=True)
        return [
            fingerprint(key, dict(zip(columns, map(np.asarray, row), strict=True))) for row in rows
        ]

    @property
    def unused(self) -> list[str]:
        """Names of the axes on which no result depends."""
        jaxpr = self.closed.jaxpr
        used = {id(atom) for equation in jaxpr.eqns for atom in equation.invars}
        used |= {id(atom) for atom in jaxpr.outvars}
        return [
            n for n, v in zip(sorted(self.point), jaxpr.invars, strict=True) if id(v) not in used
        ]


def trace(
    function: Callable[[dict[str, Any]], Any], point: dict[str, np.generic], steps: int = 0
) -> Program:
    """Returns the program of a function of a point.

    The program returns the arrays of the function by their paths, complex ones as real and
    imaginary parts, and how its solves ended: the last that did not succeed.

    **Raises:** `ValueError` if the function reads a name that the point does not have; what JAX
    raises for a function that it cannot trace.
    """
    # The arrays of a jitted function would be constants of the compiled code.
    inner: Any = function
    if isinstance(function, jax.stages.Wrapped):
        inner = inner.__wrapped__
    try:
        named = lambda p: _named(with_observables(inner(p)))  # noqa: E731
        closed, like = jax.make_jaxpr(named, return_shape=True)(point)
    except KeyError as error:
        name = error.args[0] if error.args else None
        if not isinstance(name, str) or name in point:
            raise
        raise ValueError(
            f"`function` reads {name!r}, which is no axis; {nearest(name, point)}"
        ) from error
    names = jax.tree.structure((point, like))
    return Program(inner, point, closed, f"{text_of(closed.jaxpr)} {names}", like, steps)


def text_of(jaxpr: core.Jaxpr) -> str:
    """Returns a text that differs if a jaxpr computes anything else.

    JAX's own is laid out for readers, which takes several times as long as to trace.
    """
    lines: list[str] = []
    kinds: dict[Any, int] = {}
    _write(jaxpr, lines, {}, kinds)
    return "\n".join([*lines, str([*kinds])])


def _write(jaxpr: Any, lines: list[str], written: dict[int, str], kinds: dict[Any, int]) -> str:
    """Adds the line of a jaxpr behind those of the jaxprs inside, each once; returns its name.

    Its variables have numbers, and so have their `kinds`.
    """
    jaxpr = getattr(jaxpr, "jaxpr", jaxpr)
    if id(jaxpr) in written:
        return written[id(jaxpr)]
    numbers: dict[int, int] = {}
    line: list[Any] = []
    for variable in (*jaxpr.constvars, *jaxpr.invars):
        numbers[id(variable)] = len(numbers)
        line.append(kinds.setdefault(variable.aval, len(kinds)))
    for equation in jaxpr.eqns:
        line.append(equation.primitive)
        for name, value in equation.params.items():
            if hasattr(value, "eqns"):
                value = _write(value, lines, written, kinds)
            elif isinstance(value, tuple) and any(hasattr(part, "eqns") for part in value):
                value = [_write(part, lines, written, kinds) for part in value]
            line.append((name, value))
        for variable in equation.invars:
            known = isinstance(variable, core.Literal)
            line.append(str(variable) if known else numbers[id(variable)])
        for variable in equation.outvars:
            numbers[id(variable)] = len(numbers)
            line.append(kinds.setdefault(variable.aval, len(kinds)))
    line += [str(v) if isinstance(v, core.Literal) else numbers[id(v)] for v in jaxpr.outvars]
    lines.append(str(line))
    return written.setdefault(id(jaxpr), f"jaxpr {len(written)}")


def key_of(closed: core.ClosedJaxpr, text: str) -> str:
    """Returns the key of a traced function and its text, see `Program.key`."""
    # The text of a jaxpr names its constants without their values.
    arrays = [*closed.consts, *_inside(closed.jaxpr)]
    versions = [package_versions()[f"version_{name}"] for name in ("graded_contact", "jax")]
    return fingerprint(versions, _ADDRESS.sub("", text), *map(_plain, arrays))


def runner(program: Program) -> Callable[[Task], Point]:
    """Returns what solves one point; a point that fails has no values and its reason."""
    run = _step_by_step(program) if program.steps else _as_a_whole(program)
    names = jax.tree.structure(program.like)

    def solve(task):
        point, needed = task
        try:
            found = jax.tree.map(np.asarray, run(*jax.tree.leaves(point)))
        except (ValueError, RuntimeError) as error:  # `eqx.error_if` raises through XLA
            # Equinox puts a stack before the message, and advice on debugging after it.
            reason = str(error).rpartition("Error: ")[2].partition("\n\n")[0].strip()
            if "RESOURCE_EXHAUSTED" in str(error):  # neither this nor Ctrl-C is the point's fault
                raise MemoryError(reason) from error
            if "KeyboardInterrupt" in str(error):
                raise KeyboardInterrupt from error
            return Point({}, FAILED + reason)
        values, end = jax.tree.unflatten(names, found)
        message = "" if end == RESULTS.successful else RESULTS[end]
        return Point({name: values[name] for name in needed or values}, message)

    return solve


def _step_by_step(program: Program) -> Callable[..., list[jax.Array]]:
    """What runs a function as it is: histories in it have programs for their segments."""
    names = jax.tree.structure(program.point)

    def run(*numbers):
        point = jax.tree.unflatten(names, map(jnp.asarray, numbers))
        return jax.tree.leaves(_named(with_observables(program.function(point))))

    return run


def _as_a_whole(program: Program) -> Callable[..., list[jax.Array]]:
    """What runs a function as one compiled program."""
    jaxpr = program.closed.jaxpr
    # Constants become the first arguments, so that XLA neither copies nor compiles them in.
    open_jaxpr = jaxpr.replace(constvars=[], invars=[*jaxpr.constvars, *jaxpr.invars])
    code = fingerprint(program.text, *map(_plain, _inside(jaxpr)))
    if code not in _COMPILED:
        if len(_COMPILED) == _MOST_COMPILED:  # the oldest goes
            del _COMPILED[next(iter(_COMPILED))]
        run = jax.jit(core.jaxpr_as_fun(core.ClosedJaxpr(open_jaxpr, [])))
        arguments = *program.closed.consts, *jax.tree.leaves(program.point)
        _COMPILED[code] = run.lower(*arguments).compile(options(2))
    return partial(_COMPILED[code], *jax.device_put(program.closed.consts))


def _named(found: Any) -> tuple[dict[str, jax.Array], Any]:
    arrays, end = {}, RESULTS.successful
    is_result = lambda value: isinstance(value, RESULTS)  # noqa: E731
    for path, leaf in jax.tree_util.tree_leaves_with_path(found, is_leaf=is_result):
        name = jax.tree_util.keystr(path, simple=True, separator=".") or "value"
        if is_result(leaf):
            # Of several solves, the last that did not succeed is told.
            end = RESULTS.where(leaf == RESULTS.successful, end, leaf)
        elif jnp.iscomplexobj(leaf):
            arrays |= {f"{name}.real": jnp.real(leaf), f"{name}.imag": jnp.imag(leaf)}
        else:
            arrays[name] = jnp.asarray(leaf)
    return arrays, end


def _inside(jaxpr: Any) -> Iterator[Any]:
    """The arrays that jitted functions inside close over, which the text abridges."""
    for equation in jaxpr.eqns:
        for inner in jax.tree.leaves(equation.params):
            if hasattr(inner, "eqns"):
                yield from getattr(inner, "consts", ())
                yield from _inside(inner)


def _plain(array: Any) -> np.ndarray:
    if jnp.issubdtype(array.dtype, jax.dtypes.prng_key):
        array = jax.random.key_data(array)
    return np.asarray(array)
