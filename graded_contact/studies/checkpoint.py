"""One long solve that can continue after its process was killed.

While it iterates on the finest grid, the pressure found so far is kept in a store, under the
fingerprint of the problem. From it the same call begins again: the same contact to `rtol`, though
not to the bit, and two to six FFT pairs more than without an end in between. A solve that is not
interrupted takes the same steps as one that keeps nothing, to rounding. A law that attracts may
have several contacts; it is then the one that the pressure leads to.
"""

import os
import time
import warnings
from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import numpy as np

from ..contact.nested_solve import DouglasRachford
from ..core.checks import check_values
from ..files.dataset import package_versions
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

    Compiled in every process anew, which takes seconds; not under `jit` or `grad`.

    **Arguments:**

    - `folder`: where the pressure is kept; it may hold that of other problems.
    - `solve`: `slide` or `solve_contact`.
    - `inputs`, `given`: its arguments. A `start` among them counts if nothing is kept.
    - `every`: least time from one writing to the next [s].

    **Returns:** the solution. What was kept stays, and a further call begins from there.

    **Raises:** `BlockingIOError` if another process solves in this folder; `ValueError` for another
    solver than `DouglasRachford`; and as `solve`. If nothing can be written the solve goes on, and
    warns; so it does where what was kept is damaged, and begins anew.
    """
    check_values("every", every, "a time [s] is at least 0", at_least=0)
    solver = given.pop("solver", DouglasRachford())
    if not isinstance(solver, DouglasRachford):
        raise ValueError(f"`solver={solver!r}` keeps nothing: `DouglasRachford` does.")
    begin = given.pop("start", None)
    name = fingerprint(package_versions(), solve.__name__, inputs, given, solver)
    with Store(folder) as store:
        earlier = store.read(name)
        if store.damaged:
            warnings.warn(f"{store.path(name)} was damaged: the solve begins anew", stacklevel=2)
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
                warnings.warn(f"{error} The solve goes on.", stacklevel=2)
            written = time.monotonic()

        solver = eqx.tree_at(lambda s: s.callback, solver, keep, is_leaf=lambda leaf: leaf is None)
        return solve(*inputs, solver=solver, start=begin, **given)
