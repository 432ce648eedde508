"""A function of positive, bounded parameters: its constraints, derivatives, and stored values."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..core.compilation import compiled
from ..core.display import short
from .program import key_of, text_of
from .store import Point, Store, fingerprint

Flat = Float[np.ndarray, " parameters"]


class Box(NamedTuple):
    """Flat bounds, their names, and the function that restores the nesting of flat values."""

    low: Flat
    high: Flat
    names: list[str]
    unravel: Callable[[Array], Any]


def box_of(lower: Any, upper: Any) -> Box:
    """Returns the bounds, checked.

    **Raises:** `ValueError` unless both have the same nesting and 0 < lower <= upper.
    """
    names, low = numbers_in(lower, "lower")
    high = _flat("upper", upper, names)
    if len(low) == 0:
        raise ValueError("`lower` is empty: at least one parameter is needed.")
    for name, a, b in zip(names, low, high, strict=True):
        if not 0 < a <= b < np.inf:
            raise ValueError(
                f"`lower` and `upper` of {name} are {a:g} and {b:g}; they must be positive, and "
                "`lower` at most `upper`."
            )
    _, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.asarray(leaf, float), lower))
    return Box(low, high, names, unravel)


def first_in(box: Box, start: Any) -> Flat:
    """Returns where a search begins: `start`, checked, or the middle on the logarithm."""
    if start is None:
        return np.sqrt(box.low * box.high)
    first = _flat("start", start, box.names)
    for name, x, a, b in zip(box.names, first, box.low, box.high, strict=True):
        # A start may come from a file, with rounded digits.
        if not a * (1 - 1e-9) <= x <= b * (1 + 1e-9):
            raise ValueError(f"`start` has {name} = {x:g}; it must be between {a:g} and {b:g}.")
    return np.clip(first, box.low, box.high)


def _flat(argument: str, tree: Any, names: list[str]) -> Flat:
    """The values of a tree whose numbers have these names."""
    own, values = numbers_in(tree, argument)
    if own != names:
        raise ValueError(f"`{argument}` must have the same nesting and shapes as `lower`.")
    return values


def numbers_in(tree: Any, argument: str = "parameters") -> tuple[list[str], Flat]:
    """Returns names and values of all numbers in a nesting."""

    def number(leaf):
        try:
            return np.asarray(leaf, float)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"`{argument}` has {short(leaf)}, which is not a number.") from None

    arrays = jax.tree.map(number, tree)
    values = [array.ravel() for array in jax.tree.leaves(arrays)]
    return _names_of(arrays, "parameter"), np.concatenate([*values, np.zeros(0)])


def _names_of(tree: Any, alone: str) -> list[str]:
    """The names of all numbers in a nesting of arrays; `alone` without a nesting."""
    return [
        (jax.tree_util.keystr(path, simple=True, separator=".") or alone)
        + "".join(f"[{i}]" for i in index)
        for path, array in jax.tree_util.tree_leaves_with_path(tree)
        for index in np.ndindex(array.shape)
    ]


def _with_slopes(function: Callable[..., Array]) -> Callable[..., tuple[Array, Array]]:
    """The program of a vector and its derivatives by the first argument, row by row."""

    def run(x, *others):
        values, pull = jax.vjp(lambda x: function(x, *others), x)
        # Not `vmap`: a solve of one row would last as long as that of the slowest.
        rows = jnp.eye(len(values), dtype=values.dtype)
        return values, jax.lax.map(lambda row: pull(row)[0], rows)

    return compiled(run)


class Evaluation(NamedTuple):
    """Objective and constraints at some parameters, with their derivatives."""

    value: float
    limits: Float[np.ndarray, " constraints"]
    slope: Float[np.ndarray, " parameters"]
    slopes: Float[np.ndarray, "constraints parameters"]


class Evaluations:
    """Objective and constraints of a search; each point is computed once.

    **Arguments:**

    - `objective`: function of the parameters; if it is random, also of a key. It gives a number, or
      a pair of a number and constraints, if one solve gives both.
    - `constraints`: of the same arguments, or None.
    - `box`: bounds of the parameters.
    - `store`: of evaluations, under a name of all that the functions compute, or None.
    - `key`: of a random objective.
    """

    def __init__(
        self, objective: Callable[..., Any], constraints: Callable[..., Any] | None, box: Box,
        store: Store | None, key: Array | None = None,
    ):  # fmt: skip
        self.box, self.store, self.key = box, store, key
        self._found: dict[str, Evaluation] = {}
        self._names: dict[str, list[str]] = {}

        def value(x, *key):
            found = objective(box.unravel(x), *key)
            value, limits = found if isinstance(found, tuple) else (found, ())
            return jnp.append(jnp.reshape(value, 1), self._flat("objective", limits))

        def limits(x, *key):
            found = () if constraints is None else constraints(box.unravel(x), *key)
            return self._flat("constraints", found)

        self._programs = {"objective": _with_slopes(value), "constraints": _with_slopes(limits)}
        if store is not None:
            arguments = jnp.asarray(box.low), *self._keys(None if key is None else 0)
            # The program, not the Python code: another number inside it is another search.
            traced = jax.make_jaxpr(lambda *x: (value(*x), limits(*x)))(*arguments)
            self._name = key_of(traced, text_of(traced.jaxpr))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the constraints, known after the first evaluation."""
        return tuple(name for part in self._programs for name in self._names[part])

    def _flat(self, part: str, limits: Any) -> Array:
        """Constraints as one array; their names are kept when the program is traced."""
        limits = jax.tree.map(jnp.asarray, limits)
        self._names[part] = _names_of(limits, "constraint")
        return ravel_pytree(limits)[0]

    def at(self, x: Flat, draw: int | None = None) -> Evaluation:
        """Returns objective and constraints.

        **Arguments:**

        - `x`: flat parameters.
        - `draw`: number of the draw of a random objective; None for others.

        **Raises:** `ValueError` for what is not finite.
        """
        # All starts are evaluated before the runs, and the best parameters after them.
        at = fingerprint(x, *map(jax.random.key_data, self._keys(draw)))
        if at in self._found:
            return self._found[at]
        name = "" if self.store is None else fingerprint(self._name, at)
        point = None if self.store is None else self.store.read(name, Evaluation._fields)
        if point is not None:
            arrays: Any = point.values
            found = Evaluation(**arrays)._replace(value=float(arrays["value"]))
        else:
            values, slopes = self._run("objective", x, draw)
            others, theirs = self._run("constraints", x, draw)
            limits, theirs = np.append(values[1:], others), np.concatenate([slopes[1:], theirs])
            found = Evaluation(float(values[0]), limits, slopes[0], theirs)
            if self.store is not None:
                self.store.write(name, Point(jax.tree.map(np.asarray, found._asdict())))
        self._found[at] = found
        return found

    def constraints(
        self, x: Flat, draw: int | None = None
    ) -> tuple[Float[np.ndarray, " constraints"], Float[np.ndarray, "constraints parameters"]]:
        """Returns the constraints and their derivatives, without an objective that gives none."""
        if self._names.get("objective"):
            found = self.at(x, draw)
            return found.limits, found.slopes
        return self._run("constraints", x, draw)

    def _run(self, part: str, x: Flat, draw: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Values and derivatives of a part, finite."""
        values, slopes = map(np.asarray, self._programs[part](x, *self._keys(draw)))
        found = values[~np.isfinite(values)]
        if found.size or not np.all(np.isfinite(slopes)):
            at = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.box.names, x, strict=True))
            at += "" if draw is None else f" in draw {draw}"
            if found.size:
                raise ValueError(f"`{part}` is {found[0]} at {at}.")
            raise ValueError(f"A derivative of `{part}` is not finite at {at}.")
        return values, slopes

    def _keys(self, draw):
        return () if self.key is None else (jax.random.fold_in(self.key, draw),)
