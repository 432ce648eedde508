"""Motions and loads over time, from tables."""

import os

import numpy as np
from jaxtyping import Float, ScalarLike

from ..fields.grid import Grid
from ..sliding.motion.motion import Motion
from ..sliding.motion.periodic import recorded
from .columns import Heading, understood
from .source import NotPlain, source_of
from .tables import read_table

_OVER_TIME = {
    "time": Heading("time", r"t|times?"),
    "displacements": Heading("length", r"s|x|displacements?|position|way"),
    "pressures": Heading("pressure", r"p|pressures?|load"),
}
_HEADS = {
    "displacements": "time [ms], displacement [mm]",
    "pressures": "time [s], pressure [kPa]",
}


def read_motion(
    path: os.PathLike,
    period: ScalarLike,
    num_times: int | None = None,
    grid: Grid | None = None,
) -> Motion:
    """Returns the motion of a table, see `recorded`.

    **Arguments:**

    - `path`: of the table, text or Excel, that begins with "time [ms], displacement [mm]".
    - `period`: T [s].
    - `num_times`, `grid`: as in `recorded`.

    **Raises:** `FileNotFoundError`; `ValueError` for another table.
    """
    return recorded(*read_over_time(path, "displacements"), period, num_times, grid)


def read_over_time(
    path: os.PathLike, what: str
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Returns the times [s] and the "displacements" [m] or "pressures" [Pa] of a table."""
    try:
        found = understood(read_table(source_of(path, "")), _OVER_TIME, [("time", what)])
    except NotPlain as error:
        remedy = f"Its first line must be such as: {_HEADS[what]}"
        raise ValueError(error.with_remedy(remedy)) from None
    return found.numbers["time"], found.numbers[what]
