"""One long solve that can continue after its process was killed.

While the solve iterates on the finest grid, the current pressure is stored under the fingerprint of
the problem. After a kill the same call starts from this pressure. It gives the same contact to
`rtol`, but not the same bits, and takes two to six FFT pairs more than without the kill. A solve
without interruption takes the same steps as one without a store, to rounding. A law that attracts
may have several contacts; the result is then the contact that follows from the stored pressure.
"""

import os
import time
import warnings
from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import numpy as np

from ..contacts.nested_solve import DouglasRachford
from ..core.checks import check_values
from .dataset import package_versions
from .store import Point, Store, fingerprint

T = TypeVar("T")


def checkpointed(
    folder: str | os.PathLike,
    solve: Callable[..., T],
    *inputs: Any,
    every: float = 60.0,
    **given: Any,
) -> T:
    """Returns what `solve(*inputs, **given)` returns, continued from the last stored state.

    Each process compiles it again, which takes seconds. Not under `jit` or `grad`.

    **Arguments:**

    - `folder`: where the pressure is stored; it may contain pressures of other problems.
    - `solve`: `slide` or `solve_contact`.
    - `inputs`, `given`: its arguments. A `start` among them is used if nothing is stored.
    - `every`: least time from one writing to the next [s].

    **Returns:** the solution. The stored state stays, and a further call starts from it.

    **Raises:** `BlockingIOError` if another process solves in this folder; `ValueError` for another
    solver than `DouglasRachford`; and the errors of `solve`. If the folder cannot be written, the
    solve continues with a warning. If the stored state is damaged, the solve starts again with a
    warning.
    """
    check_values("every", every, "a time [s] is at least 0", at_least=0)
    solver = given.pop("solver", DouglasRachford())
    if not isinstance(solver, DouglasRachford):
        raise ValueError(f"`solver={solver!r}` has no checkpoints; use `DouglasRachford`.")
    begin = given.pop("start", None)
    name = fingerprint(package_versions(), solve.__name__, inputs, given, solver)
    with Store(folder) as store:
        earlier = store.read(name, ("pressure",))
        if store.damaged:
            warnings.warn(f"{store.path(name)} is damaged: the solve starts again", stacklevel=2)
        if earlier is not None:
            begin = earlier.values["pressure"]
        written = time.monotonic()

        def keep(pressure):
            nonlocal written
            if time.monotonic() - written < every:
                return
            try:
                store.write(name, Point({"pressure": np.asarray(pressure)}))
            except OSError as error:
                warnings.warn(f"{error} The solve continues.", stacklevel=2)
            written = time.monotonic()

        solver = eqx.tree_at(lambda s: s.callback, solver, keep, is_leaf=lambda leaf: leaf is None)
        return solve(*inputs, solver=solver, start=begin, **given)
