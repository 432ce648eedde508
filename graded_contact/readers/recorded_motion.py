"""A recorded motion from a table of times and displacements."""

import os

import numpy as np
from jaxtyping import ScalarLike

from ..core.files import Refusal
from ..fields.grid import Grid
from ..sliding.motion import Motion, recorded
from .cells import LARGEST, holds_data
from .registry import opened, read
from .units import UNITS, length_unit, metres, parse_heading


def read_motion(
    path: os.PathLike,
    period: ScalarLike,
    num_times: int | None = None,
    grid: Grid | None = None,
) -> Motion:
    """Returns the motion of a table with the columns time and displacement, see `recorded`.

    **Arguments:**

    - `path`: of the table, text or Excel. The first column is the time in seconds, the second the
      displacement in metres, unless headings name other units: "time [ms]", "s (mm)".
    - `period`: T [s].
    - `num_times`, `grid`: as in `recorded`.

    **Raises:** `FileNotFoundError`; `ValueError` for a file that is no such table.
    """
    with opened(path, LARGEST) as file:
        rows = read(file, "moduli").sheets[0].rows
        data = [row.cells[:2] for row in rows if holds_data(row)]
        try:
            time, displacement = np.array(data, float).T
        except ValueError:
            needed = "two columns of numbers are needed, times [s] and displacements [m]"
            raise Refusal(needed) from None
    words = (row.cells for row in rows if len(row.cells) > 1 and not holds_data(row))
    head = next(words, ["", ""])
    time = time * UNITS["time"].get(parse_heading(head[0]).unit or "s", 1.0)
    displacement = displacement * (metres(length_unit(head[1]) or "m") or 1.0)
    return recorded(time, displacement, period, num_times, grid)
