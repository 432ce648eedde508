"""What was recorded over time, from a table: a motion, or a load."""

import logging
import os
import re
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, ScalarLike

from ..core.files import Refusal
from ..fields.grid import Grid
from ..sliding.motion.motion import Motion
from ..sliding.motion.periodic import recorded
from .cells import TABLE_BYTES, holds_data
from .decisions import Log
from .registry import opening, read_as
from .units import UNITS, length_unit, metres, parse_heading, parse_unit

_BRACKETS = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$")


def read_motion(
    path: os.PathLike,
    period: ScalarLike,
    num_times: int | None = None,
    grid: Grid | None = None,
) -> Motion:
    """Returns the motion of a table with the columns time and displacement, see `recorded`.

    **Arguments:**

    - `path`: of the table, text or Excel. The first column is the time, the second the
      displacement, with units in the headings: "time [ms]", "s (mm)". Without them seconds and
      metres are assumed: a warning of a scene, a warning in the log (`graded_contact`).
    - `period`: T [s].
    - `num_times`, `grid`: as in `recorded`.

    **Raises:** `FileNotFoundError`; `ValueError` for a file that is no such table.
    """
    motion, log = motion_in(path, period, num_times, grid)
    for sentence in log.assumed:
        logging.getLogger("graded_contact").warning(sentence)
    return motion


def motion_in(
    path: os.PathLike, period: ScalarLike, num_times: int | None, grid: Grid | None
) -> tuple[Motion, Log]:
    """Returns the motion of a table and the log of the reading, arguments as in `read_motion`."""
    times, displacement, log = read_over_time(path, "displacements")
    return recorded(times, displacement, period, num_times, grid), log


def read_over_time(
    path: os.PathLike, what: str
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Log]:
    """Returns the times [s] and the numbers of a table in SI, and the log of the reading.

    **Arguments:**

    - `path`: of the table, as in `read_motion`.
    - `what`: its second column, a name in `RECORDED_COLUMNS`.
    """
    log, (factor_of, usual, example) = Log(), RECORDED_COLUMNS[what]
    with opening(path, TABLE_BYTES) as file:
        rows = read_as(file, "moduli")[0].rows
        data = [row.cells[:2] for row in rows if holds_data(row)]
        try:
            times, numbers = np.array(data, float).T
        except ValueError:
            needed = f"two columns of numbers are needed, times [s] and {what} [{usual}]"
            raise Refusal(needed) from None
        heads = [row.cells for row in rows if len(row.cells) > 1 and not holds_data(row)][:2]
        firsts, seconds = [head[0] for head in heads], [head[1] for head in heads]
        second = _factor(log, "times", firsts, _unit_of("time"), "s", "time [ms]")
        unit = _factor(log, what, seconds, factor_of, usual, example)
    return second * times, unit * numbers, log


def _unit_of(dimension: str) -> Callable[[str], float | None]:
    return lambda head: UNITS[dimension].get(parse_heading(head).unit or parse_unit(head) or "")


def _metres_of_heading(head: str) -> float | None:
    return metres(length_unit(head) or "")


# What a second column may hold: the factor of its unit in a heading, the unit that is assumed
# without one, and a heading as an example.
RECORDED_COLUMNS = {
    "displacements": (_metres_of_heading, "m", "displacement [mm]"),
    "pressures": (_unit_of("modulus"), "Pa", "pressure [kPa]"),
}


def _factor(log: Log, what: str, heads: list[str], factor, usual: str, example: str) -> float:
    """The factor to SI of the unit in the headings of a column; `usual` is assumed without any."""
    found = next((each for head in heads if (each := factor(head)) is not None), None)
    if found is not None:
        return found
    stated = next((unit[1] for head in heads if (unit := _BRACKETS.search(head))), None)
    if stated is not None:
        raise Refusal(f"its {what} are in {stated!r}, as the heading states, but {usual} is needed")
    log.assume(
        f"The {what} are assumed to be in {usual}, because the headings name no unit; otherwise "
        "write the unit into the heading, such as "
        f"{example!r}."
    )
    return 1.0
