"""How the quadrature of a mean field is refined until it meets its tolerance."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Array, Bool, Float

from ..core.checks import is_concrete

T = TypeVar("T")
DOUBLINGS = 3  # of the nodes, at most


class Nodes(NamedTuple):
    """Intervals of the quadrature in q and in angle, see `mean_field_friction`."""

    num_wavenumbers: int = 80
    num_angles: int = 20


NODES = Nodes()


def solve_refined(solve: Callable[[Nodes], tuple[T, Any]], nodes: Nodes = NODES) -> tuple[T, Nodes]:
    """Returns the first result that meets its tolerance, or the last one, and its nodes.

    Nodes are doubled at most three times; inside `jit`, where it is not known whether a result
    meets its tolerance, never.

    **Arguments:**

    - `solve`: returns the result with so many nodes, and where it misses its tolerance.
    - `nodes`: with which it begins.
    """
    found, missed = solve(nodes)
    for _ in range(DOUBLINGS):
        if not is_concrete(missed) or not np.any(np.asarray(missed)):
            break
        nodes = Nodes(2 * nodes.num_wavenumbers, 2 * nodes.num_angles)
        found, missed = solve(nodes)
    return found, nodes


def misses(error: Float[Array, "*n"], rtol: float) -> Bool[Array, "*n"]:
    """Returns where more nodes may help: an error that is not finite is of no quadrature."""
    return (error > rtol) & (error < np.inf)
