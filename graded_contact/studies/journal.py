"""The steps of what happens once: counted, and kept in a store from segment to segment.

A solve has a few histories, one after the other: its own, and those for its errors. Of each the
store has a state under the name of the point and a number: the last one after Ctrl-C, one that is
`STORED_EVERY` seconds old after a kill. A point that ended has none.
"""

import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .store import Point, Store

_STEP = "step"
STORED_EVERY = 20.0  # s between two states in the store: one of 256² points takes 55 MB


class PointJournal:
    """Follows the histories of one point, see `followed`.

    **Arguments:**

    - `store`: keeps them, or None.
    - `name`: of the point in the store.
    - `say`: called with the number of steps done; what it raises ends the point.
    """

    def __init__(self, store: Store | None, name: str, say: Callable[[int], None]):
        self._store, self._name, self._say = store, name, say
        self._number, self._before, self._step = -1, 0, 0
        self._unsaved, self._saved = None, time.monotonic()

    def begin(self, start: Any) -> tuple[int, Any]:
        """Returns the step at which the next history goes on, and what is known there."""
        self._save()
        self._number, self._before, self._step = self._number + 1, self._before + self._step, 0
        leaves, form = jax.tree.flatten(start)
        names = [_STEP, *map(str, range(len(leaves)))]
        found = self._store and self._store.read(part_of(self._name, self._number), names)
        if not found:
            return 0, start
        self._step = int(found.values[_STEP])
        leaves = [jnp.asarray(found.values[name]) for name in names[1:]]
        return self._step, jax.tree.unflatten(form, leaves)

    def keep(self, step: int, found: Any) -> None:
        """Says how far the point is, and stores what is known before a step."""
        self._step, self._unsaved = step, found
        try:
            self._say(self._before + step)
        except KeyboardInterrupt:
            self._save()
            raise
        if time.monotonic() > self._saved + STORED_EVERY:
            self._save()

    def _save(self) -> None:
        if self._store is not None and self._unsaved is not None:
            leaves = enumerate(jax.tree.leaves(self._unsaved))
            values = {str(i): np.asarray(leaf) for i, leaf in leaves}
            known = Point(values | {_STEP: np.asarray(self._step)})
            self._store.write(part_of(self._name, self._number), known)
        self._unsaved, self._saved = None, time.monotonic()


def part_of(name: str, number: int = 0) -> str:
    """Returns the name in a store of a history of a point that has not ended."""
    return f"{name}-{number}"


def forget(store: Store, name: str) -> None:
    """Removes the histories of a point that ended."""
    number = 0
    while (path := store.path(part_of(name, number))).exists():
        path.unlink()
        number += 1
