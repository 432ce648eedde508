"""A function of positive, bounded parameters: its constraints, derivatives, and stored values."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..core.display import short
from .program import key_of
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
    names, low = named(lower, "lower")
    high = _flat("upper", upper, names)
    if len(low) == 0:
        raise ValueError("`lower` is empty: at least one parameter is needed.")
    for name, a, b in zip(names, low, high, strict=True):
        if not (np.isfinite(a) and np.isfinite(b) and 0 < a <= b):
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
    own, values = named(tree, argument)
    if own != names:
        raise ValueError(f"`{argument}` must have the same nesting and shapes as `lower`.")
    return values


def named(tree: Any, argument: str = "parameters") -> tuple[list[str], Flat]:
    """Returns names and values of all numbers in a nesting."""
    names, values = [], []
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        try:
            array = np.asarray(leaf, float)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"`{argument}` has {short(leaf)}, which is not a number.") from None
        where = jax.tree_util.keystr(path, simple=True, separator=".") or "parameter"
        for index in np.ndindex(array.shape):
            names.append(where + "".join(f"[{i}]" for i in index))
            values.append(float(array[index]))
    return names, np.array(values)


class Evaluation(NamedTuple):
    """Objective and constraints at some parameters, with their derivatives."""

    value: float
    limits: Float[np.ndarray, " constraints"]
    slope: Float[np.ndarray, " parameters"]
    slopes: Float[np.ndarray, "constraints parameters"]


class Problem:
    """Objective and constraints of a design; each point is computed once.

    **Arguments:**

    - `objective`, `constraints`: functions of the parameters, the latter or None; if they are
      random, also of a key.
    - `box`: bounds of the parameters.
    - `store`: of evaluations, under a name of all that the functions compute, or None.
    - `key`: of a random problem.
    """

    def __init__(
        self, objective: Callable[..., Array], constraints: Callable[..., Array] | None, box: Box,
        store: Store | None, key: Array | None = None,
    ):  # fmt: skip
        self.box, self.store, self.key = box, store, key
        self._found: dict[str, Evaluation] = {}

        def value(x, *key):
            return objective(box.unravel(x), *key)

        def limits(x, *key):
            if constraints is None:
                return jnp.zeros(0)
            return jnp.ravel(jnp.asarray(constraints(box.unravel(x), *key)))

        self._limits = jax.jit(lambda x, *key: (limits(x, *key), jax.jacrev(limits)(x, *key)))
        self._objective = jax.jit(jax.value_and_grad(value))
        if store is not None:
            arguments = jnp.asarray(box.low), *self._keys(None if key is None else 0)
            # The program, not the Python code: another number inside it is another search.
            traced = jax.make_jaxpr(lambda *x: (value(*x), limits(*x)))(*arguments)
            self._name = key_of(traced, str(traced.jaxpr))

    def evaluate(self, x: Flat, draw: int | None = None) -> Evaluation:
        """Returns objective and constraints.

        **Arguments:**

        - `x`: flat parameters.
        - `draw`: number of the draw of a random problem; None for other problems.

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
            value, slope = self._objective(x, *self._keys(draw))
            if not np.isfinite(value):
                raise ValueError(f"`objective` is {np.asarray(value)} at {self._text(x, draw)}.")
            limits, slopes = self.limits(x, draw)
            if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(slopes))):
                where = f"`objective` or `constraints` is not finite at {self._text(x, draw)}"
                raise ValueError(f"A derivative of {where}.")
            found = Evaluation(float(value), limits, np.asarray(slope), slopes)
            if self.store is not None:
                self.store.write(name, Point(jax.tree.map(np.asarray, found._asdict())))
        self._found[at] = found
        return found

    def limits(
        self, x: Flat, draw: int | None = None
    ) -> tuple[Float[np.ndarray, " constraints"], Float[np.ndarray, "constraints parameters"]]:
        """Returns the constraints and their derivatives, computed anew.

        **Raises:** `ValueError` for constraints that are not finite.
        """
        limits, slopes = map(np.asarray, self._limits(x, *self._keys(draw)))
        if not np.all(np.isfinite(limits)):
            raise ValueError(f"`constraints` is {limits} at {self._text(x, draw)}.")
        return limits, slopes

    def _keys(self, draw):
        return () if self.key is None else (jax.random.fold_in(self.key, draw),)

    def _text(self, x: Flat, draw: int | None) -> str:
        text = ", ".join(f"{name} = {v:.6g}" for name, v in zip(self.box.names, x, strict=True))
        return text if draw is None else f"{text} in draw {draw}"
