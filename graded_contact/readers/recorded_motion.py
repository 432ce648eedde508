"""What was recorded over time, from a table: a motion, or a load."""

import os

import numpy as np
from jaxtyping import Float, ScalarLike

from ..fields.grid import Grid
from ..sliding.motion import Motion, recorded
from ..sliding.single_motion import SingleMotion, recorded_once
from .columns import Quantity, understood
from .tables import NotPlain, read_table, source_of

_QUANTITIES = {
    "time": Quantity("time", r"t|times?"),
    "displacement": Quantity("length", r"s|x|displacements?|position|way"),
    "pressure": Quantity("pressure", r"p|pressures?|load"),
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
    return recorded(*read_over_time(path, "displacement"), period, num_times, grid)


def read_single_motion(path: os.PathLike, grid: Grid) -> SingleMotion:
    """Returns the motion of a table that need not close; its first time is the time 0.

    **Arguments:**

    - `path`: of the table, as in `read_motion`.
    - `grid`: as in `recorded_once`.
    """
    return recorded_once(*read_over_time(path, "displacement"), grid)


def read_over_time(
    path: os.PathLike, what: str
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Returns the times [s] and the "displacement" [m] or "pressure" [Pa] of a table."""
    try:
        found = understood(read_table(source_of(path, "")), _QUANTITIES, [("time", what)])
    except NotPlain as error:
        unit = "mm" if what == "displacement" else "kPa"
        remedy = f"its first line must be such as: time [s], {what} [{unit}]"
        raise ValueError(error.with_remedy(remedy)) from None
    return found.numbers["time"], found.numbers[what]
