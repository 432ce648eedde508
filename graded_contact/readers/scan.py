"""Heights as a file has them, in its own units.

Heights are `[x, y]`, x to the right and y upwards in the picture that the microscope shows, whose
lines run along x from the top to the bottom: `from_lines` makes them from the lines of a picture.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..core.files import Refusal
from .decisions import Log

MOST_HEIGHTS = 2**28
BYTES_OF_POINT = 4  # unpacked; fewer in files that are hardly packed
MISSING_MARK = 0.99e37  # in any unit; 1e37, 1e38 and the largest float32 are in use
_FEWEST_MARKS = 3  # equal heights that look like marks
_FAR = 10  # times the range of all others, from which on they do


@dataclasses.dataclass(frozen=True)
class Scan:
    """The heights in a file, in its own units.

    **Fields:**

    - `heights`: in `unit`, shape `(nx, ny)` or `(nx,)`; NaN where missing.
    - `source`: the part of the file, in words.
    - `size`: edge lengths in `lateral_unit`, shape `(ndim,)`; None if the file has none.
    - `unit`, `lateral_unit`: of heights and lengths; None if the file has none.
    - `positions`: of the points of a profile in `lateral_unit`, ascending, if unequally spaced.
    - `periodic`: whether the file declares the surface periodic.
    - `named`: whether its columns are those that the user named.
    - `log`: how it was understood.
    """

    heights: np.ndarray
    source: str
    size: np.ndarray | None = None
    unit: str | None = None
    lateral_unit: str | None = None
    positions: np.ndarray | None = None
    periodic: bool = False
    named: bool = False
    log: Log = dataclasses.field(default_factory=Log)

    def but(self, **changes: Any) -> "Scan":
        """Returns these heights with other fields, and this log."""
        return dataclasses.replace(self, **changes)

    def part_of(self, name: str) -> "Scan":
        """Returns the same heights; `source` says that they are in a part of this name."""
        return self.but(source=f"{self.source} of {name!r}")

    def without_marks(self) -> "Scan":
        """Returns the heights with NaN for marks of missing points; instruments have no NaN.

        Equal heights far from all others are kept, as they may be measured; the log names them.
        """
        marked = np.abs(self.heights) >= MISSING_MARK
        if not np.any(marked):
            self.log.assume(*_perhaps_marks(self.heights))
            return self
        least = np.min(np.abs(self.heights[marked]))
        self.log.note(f"{np.sum(marked)} heights of {least:.2g} or more count as missing.")
        return self.but(heights=np.where(marked, np.nan, self.heights)).without_marks()


def _perhaps_marks(heights: np.ndarray) -> Iterator[str]:
    """Yields sentences on lowest or highest heights that look like marks of missing points."""
    known = heights[np.isfinite(heights)]
    for value in (np.min(known, initial=np.inf), np.max(known, initial=-np.inf)):
        others = known[known != value]
        count, spread = len(known) - len(others), np.ptp(others) if len(others) else 0.0
        if count >= _FEWEST_MARKS and spread and np.min(np.abs(others - value)) > _FAR * spread:
            seem = f"{count} heights of {value:.8g} lie far from all others, like marks of missing"
            yield f"{seem} points, and count as heights; otherwise write NaN there."


def from_lines(lines: np.ndarray) -> np.ndarray:
    """Returns heights `[x, y]` from the lines of a picture, the topmost first."""
    return lines[::-1].T


def equally_spaced(values: np.ndarray, within: float) -> bool:
    """Returns whether numbers are equally spaced within this part of their step."""
    even = np.linspace(values[0], values[-1], len(values))
    step = abs(values[-1] - values[0]) / (len(values) - 1)
    return bool(np.max(np.abs(values - even)) <= within * step)


def counters(values: np.ndarray) -> bool:
    """Returns whether numbers count points: whole numbers from 0 or 1, mostly in steps of 1."""
    whole = len(values) > 3 and np.all(np.isfinite(values)) and np.all(values == np.rint(values))
    return bool(whole and values[0] in (0, 1) and np.all(np.diff(values) >= 1)
                and np.median(np.diff(values)) == 1)  # fmt: skip


def channel_of(channel: str | int | None, names: Sequence[str], what: str) -> int:
    """Returns the index of the channel; without a choice there must be only one."""
    if isinstance(channel, int) and 0 <= channel < len(names):
        return channel
    if channel in names:
        return names.index(channel)
    if channel is None and len(names) == 1:
        return 0
    wrong = "" if channel is None else f", not {channel!r}"
    raise Refusal(f"{what}; pass `channel`, one of {list(names)[:20]}{wrong}")


def check_count(shape: Any, at_most: float) -> None:
    """Raises `Refusal` for more points than a file has that unpacks to `at_most` bytes."""
    points = math.prod(np.atleast_1d(shape).tolist())
    most = min(MOST_HEIGHTS, at_most / BYTES_OF_POINT)
    if points > most:
        raise Refusal(f"it has {points} points; at most {most:.0f} are read at its packed size")
