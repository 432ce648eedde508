"""What a file of heights says, in its own units, and units of length."""

import re
from typing import NamedTuple

import numpy as np


class Scan(NamedTuple):
    """Heights as a file gives them.

    **Fields:**

    - `heights`: in `unit`, shape `(nx, ny)` or `(nx,)`; NaN where missing.
    - `source`: what in the file it is, in words.
    - `size`: edge lengths in `lateral_unit`, shape `(ndim,)`; None if the file does not tell.
    - `unit`, `lateral_unit`: of heights and lengths; None if the file does not tell.
    - `positions`: of the points of a profile in `lateral_unit`, ascending, if unequally spaced.
    - `periodic`: whether the file says that the surface is.
    - `notes`: how it was understood, one sentence each.
    """

    heights: np.ndarray
    source: str
    size: np.ndarray | None = None
    unit: str | None = None
    lateral_unit: str | None = None
    positions: np.ndarray | None = None
    periodic: bool = False
    notes: tuple[str, ...] = ()


class Refusal(Exception):
    """A reason to refuse a file, to be completed with its path."""


_METRES = {
    "m": 1.0, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12,
    "km": 1e3, "å": 1e-10, "angstrom": 1e-10, "inch": 0.0254, "mil": 2.54e-5,
    "micron": 1e-6, "microns": 1e-6, "micrometer": 1e-6, "micrometre": 1e-6, "millimeter": 1e-3,
    "millimetre": 1e-3, "nanometer": 1e-9, "nanometre": 1e-9, "meter": 1.0, "metre": 1.0,
    "micrometers": 1e-6, "micrometres": 1e-6, "nanometers": 1e-9, "nanometres": 1e-9,
    "millimeters": 1e-3, "millimetres": 1e-3, "meters": 1.0, "metres": 1.0,
}  # fmt: skip
_NAMED = "|".join(sorted(map(re.escape, _METRES), key=len)[::-1])
# A unit stands at the end of a heading: "z [nm]", "Height (µm)", "depth / mm", "z_um", "unit: nm".
_AT_END = re.compile(rf"(?:^|[\[(<{{/_:=,\s])({_NAMED})\s*[\])>}}]?\s*[.:;,]*$", re.IGNORECASE)


def metres(unit: str) -> float | None:
    """Returns metres per unit of length, or None for what is none."""
    return _METRES.get(_folded(unit))


def unit_in(heading: str) -> str | None:
    """Returns the unit of length that stands at the end of a heading, or None."""
    found = _AT_END.search(_folded(heading))
    return found.group(1) if found else None


def _folded(text: str) -> str:
    return text.replace("µ", "u").replace("μ", "u").replace("Å", "å").strip().lower()
