"""A recorded motion from a table of times and displacements."""

import logging
import os
import re

import numpy as np
from jaxtyping import ScalarLike

from ..core.files import Refusal
from ..fields.grid import Grid
from ..sliding.motion import Motion, recorded
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
      metres are assumed: a caveat of a scene, a warning in the log (`graded_contact`).
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
    log = Log()
    with opening(path, TABLE_BYTES) as file:
        rows = read_as(file, "moduli")[0].rows
        data = [row.cells[:2] for row in rows if holds_data(row)]
        try:
            time, displacement = np.array(data, float).T
        except ValueError:
            needed = "two columns of numbers are needed, times [s] and displacements [m]"
            raise Refusal(needed) from None
        heads = [row.cells for row in rows if len(row.cells) > 1 and not holds_data(row)][:2]
        times, lengths = [head[0] for head in heads], [head[1] for head in heads]
        second = _factor(log, "times", times, _seconds_of_heading, "s")
        metre = _factor(log, "displacements", lengths, _metres_of_heading, "m")
    return recorded(second * time, metre * displacement, period, num_times, grid), log


def _seconds_of_heading(head: str) -> float | None:
    return UNITS["time"].get(parse_heading(head).unit or parse_unit(head) or "")


def _metres_of_heading(head: str) -> float | None:
    return metres(length_unit(head) or "")


def _factor(log: Log, what: str, heads: list[str], factor, usual: str) -> float:
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
        f"{'time [ms]' if usual == 's' else 'displacement [mm]'!r}."
    )
    return 1.0
