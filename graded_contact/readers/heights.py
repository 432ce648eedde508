"""Heights as a file has them."""

from typing import NamedTuple

import numpy as np

ROUNDED = 0.02  # of a step: how far equally spaced positions may be rounded


class Heights(NamedTuple):
    """The heights in a file, in its own units; None for what the file does not state.

    **Fields:**

    - `heights`: shape `(nx, ny)` or `(nx,)`, NaN where missing.
    - `source`: the part of the file, in words.
    - `size`: edge lengths in `lateral_unit`, shape `(ndim,)`.
    - `unit`, `lateral_unit`: of heights and lengths.
    - `notes`: sentences for the history.
    """

    heights: np.ndarray
    source: str
    size: np.ndarray | None = None
    unit: str | None = None
    lateral_unit: str | None = None
    notes: tuple[str, ...] = ()


def from_lines(lines: np.ndarray) -> np.ndarray:
    """Returns heights `[x, y]` from the lines of a picture, the topmost first."""
    return lines[::-1].T


def step_of(values: np.ndarray, name: str) -> float:
    """Returns the step of ascending numbers; raises `ValueError` unless they are equally spaced."""
    even = np.linspace(values[0], values[-1], len(values))
    step = (values[-1] - values[0]) / (len(values) - 1) if len(values) > 3 else np.nan
    if not np.max(np.abs(values - even)) <= ROUNDED * step:
        raise ValueError(
            f"its {len(values)} values of {name} are not equally spaced: interpolate the heights, "
            "for instance by `numpy.interp`, and pass them to `surface_from_heights`"
        )
    return float(step)
