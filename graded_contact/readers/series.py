"""Friction over velocity, and motions and loads over time, from tables."""

import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, ScalarLike

from ..core.checks import check_positive
from ..core.display import shown
from ..fields.grid import Grid
from ..sliding.motion.motion import Motion
from ..sliding.motion.periodic import recorded
from .columns import Heading, understood
from .source import Layout, NotPlain, source_of
from .tables import read_table

_FRICTION = {
    "velocity": Heading("velocity", r"v|velocity|speed|slidingvelocity|slidingspeed"),
    "friction": Heading("ratio", r"µ|μ|mu|cof|friction(coefficient)?|coefficientoffriction", "1"),
    "error": Heading("ratio", r"error|std|sd|uncertainty|errorof(friction|µ|μ|mu)", "1"),
    "temperature": Heading("temperature", r"T|temp(erature)?"),
}
_OVER_TIME = {
    "time": Heading("time", r"t|times?"),
    "displacements": Heading("length", r"s|x|displacements?|position|way"),
    "pressures": Heading("pressure", r"p|pressures?|load"),
}
_HEADS = {"displacements": "time [ms], displacement [mm]", "pressures": "time [s], pressure [kPa]"}


@shown("name", "velocity", "friction", "error", "temperature", unset=False)
class MeasuredFriction(NamedTuple):
    """Friction that was measured.

    **Fields:**

    - `velocity`: [m/s], positive, shape `(n,)`.
    - `friction`: [1].
    - `error`: of each friction [1], NaN where it is not known; or None.
    - `temperature`: of each [K], or None.
    - `name`: of the file.
    """

    velocity: Float[np.ndarray, " n"]
    friction: Float[np.ndarray, " n"]
    error: Float[np.ndarray, " n"] | None = None
    temperature: Float[np.ndarray, " n"] | None = None
    name: str = "measured"


def read_friction(
    path: str | os.PathLike,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    layout: Layout | None = None,
) -> MeasuredFriction:
    """Returns friction that was measured at some velocities, from a table.

    **Arguments:**

    - `path`: the file, text or Excel: "velocity [mm/s], friction", and if known "error" and
      "temperature [°C]".
    - `columns`, `units`: of these quantities, where the file does not name them; as in
      `read_moduli`.
    - `layout`: of a table that is not plain, as in `read_moduli`.

    **Returns:** the friction, see `MeasuredFriction`.

    **Raises:** `FileNotFoundError`; `ValueError` for a table that needs options.
    """
    table = read_table(
        source_of(path, "read_friction", columns=columns, units=units, layout=layout)
    )
    ways = [("velocity", "friction")]
    found = understood(table, _FRICTION, ways, also=["error", "temperature"])
    check_positive("velocity", found.numbers["velocity"], "[m/s]")
    return MeasuredFriction(**found.numbers, name=table.source.path.name)


def read_motion(
    path: os.PathLike, period: ScalarLike, num_times: int | None = None, grid: Grid | None = None
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
