"""What a design makes least, and its limits, with derivatives by flat parameters."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .bounds import Box, Flat, text_of
from .evaluations import Evaluation, Evaluations

Limits = tuple[Float[np.ndarray, " constraints"], Float[np.ndarray, "constraints parameters"]]


class Problem:
    """Objective and constraints of a design, each point of it computed once.

    **Arguments:**

    - `objective`, `constraints`: functions of the parameters, the latter or None; if they are
      random, of a key besides.
    - `box`: where the parameters lie.
    - `kept`: what is computed already; of a random problem it names "draw" as a last parameter.
    - `key`: of a random problem.
    """

    def __init__(
        self,
        objective: Callable[..., Array],
        constraints: Callable[..., Array] | None,
        box: Box,
        kept: Evaluations,
        key: Array | None = None,
    ):
        self.box, self.kept, self.key = box, kept, key
        self.constrained = constraints is not None

        def limits(x, *key):
            if constraints is None:
                return jnp.zeros(0)
            return jnp.ravel(jnp.asarray(constraints(box.unravel(x), *key)))

        self._limits = jax.jit(lambda x, *key: (limits(x, *key), jax.jacrev(limits)(x, *key)))
        self._objective = jax.jit(
            jax.value_and_grad(lambda x, *key: objective(box.unravel(x), *key))
        )

    def evaluate(self, x: Flat, draw: int | None = None, *, proven: bool = False) -> Evaluation:
        """Returns objective and constraints; `proven`, even if a file has them already.

        **Arguments:**

        - `x`: flat parameters.
        - `draw`: which draw of a random problem; None of another.

        **Raises:** `ValueError` for what is not finite.
        """
        at = x if draw is None else np.append(x, draw)
        kept = self.kept.get(at, proven)
        if kept is not None:
            return kept
        value, slope = self._objective(x, *self._keys(draw))
        if not np.isfinite(value):
            raise ValueError(f"`objective` is {np.asarray(value)} at {self._text(x, draw)}.")
        limits, slopes = self.limits(x, draw)
        if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(slopes))):
            raise ValueError(f"A derivative is not finite at {self._text(x, draw)}.")
        found = Evaluation(float(value), limits, np.asarray(slope), slopes)
        self.kept.add(at, found)
        return found

    def limits(self, x: Flat, draw: int | None = None) -> Limits:
        """Returns the constraints and their derivatives, computed anew.

        **Raises:** `ValueError` for constraints that are not finite.
        """
        limits, slopes = map(np.asarray, self._limits(x, *self._keys(draw)))
        if not np.all(np.isfinite(limits)):
            raise ValueError(f"`constraints` is {limits} at {self._text(x, draw)}.")
        return limits, slopes

    def prove(self) -> None:
        """Computes the first entry of a file again; other values than are kept are refused."""
        first = self.kept.first
        if first is None:
            return
        x, draw = (first, None) if self.key is None else (first[:-1], int(first[-1]))
        self.evaluate(x, draw, proven=True)

    def _keys(self, draw):
        return () if self.key is None else (jax.random.fold_in(self.key, draw),)

    def _text(self, x: Flat, draw: int | None) -> str:
        return text_of(self.box.unravel(jnp.asarray(x))) + (
            "" if draw is None else f" in draw {draw}"
        )
