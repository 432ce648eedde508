"""Measured friction over velocity, from a table."""

import logging
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..core.checks import check_positive
from ..core.display import shown
from ..core.files import Refusal
from .cells import TABLE_BYTES, is_missing
from .decisions import Log
from .registry import opening, read_as
from .units import OFFSETS, UNITS, metres, parse_unit

_UNIT = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]\s*$|(?:,|\bin)\s+(\S+)$")
# Words of headings, in the order in which they are looked for: "error of friction" is an error.
_WORDS = {
    "error": r"err|±|\+/-|std|\bsd\b|dev|uncert|spread|streuung|fehler",
    "temperature": r"temp|^t\b",
    "velocity": r"vel|speed|geschw|^v\b",
    "friction": r"fric|reib|\bcof\b|^µ|^μ|^mu\b|frott",
}
_NEEDED = "with the columns velocity, friction and, if known, error and temperature"


@shown("name", "velocity", "friction", "error", "temperature", unset=False)
class MeasuredFriction(NamedTuple):
    """Friction that was measured.

    **Fields:**

    - `velocity`: [m/s], positive, shape `(n,)`.
    - `friction`: [1].
    - `error`: of each friction [1], or None.
    - `temperature`: of each [K], or None.
    - `name`: of the file.
    """

    velocity: Float[np.ndarray, " n"]
    friction: Float[np.ndarray, " n"]
    error: Float[np.ndarray, " n"] | None = None
    temperature: Float[np.ndarray, " n"] | None = None
    name: str = "measured"


def read_friction(path: str | os.PathLike) -> MeasuredFriction:
    """Returns friction that was measured at some velocities, from a table; figures lay it over
    results (`plot.plot_sweep`, `plot.plot_compare`).

    **Arguments:**

    - `path`: of the table, text or Excel, with the columns velocity, friction and, if known, error
      and temperature, and units in their headings: "velocity [mm/s]", "error [%]", "T [°C]".
      Without units m/s, 1 and K are assumed, and a warning of the log (`graded_contact`) says so.

    **Returns:** the friction, see `MeasuredFriction`.

    **Raises:** `FileNotFoundError`; `ValueError` for a file that is no such table.
    """
    log = Log()
    with opening(path, TABLE_BYTES) as file:
        rows = read_as(file, "moduli")[0].rows
        numbered = (i for i, row in enumerate(rows) if row.num_numbers and not row.comment)
        first = next(numbered, len(rows))
        heads, *units = [row.cells for row in rows[:first] if len(row.cells) > 1] or [[]]
        if units:  # in a line of their own
            below = [*units[0], *[""] * len(heads)]
            heads = [f"{h} [{u}]" if u else h for h, u in zip(heads, below, strict=False)]
        at = _columns(heads)
        numbers = {name: _numbers(rows[first:], name, i) for name, i in at.items()}
        for name, i in at.items():
            factor, offset = _factor(log, name, heads[i])
            numbers[name] = factor * numbers[name] + offset
        found = MeasuredFriction(**numbers, name=Path(path).name)
        try:
            check_positive("velocity", found.velocity, "[m/s]")
        except ValueError as error:
            raise Refusal(str(error)) from None
    for sentence in log.assumed:
        logging.getLogger("graded_contact").warning(sentence)
    return found


def _columns(heads: list[str]) -> Mapping[str, int]:
    """The number of the column of each quantity, by its heading."""
    at: dict[str, int] = {}
    for i, head in enumerate(heads):
        words = head.strip().lower()
        name = next((name for name, word in _WORDS.items() if re.search(word, words)), None)
        if name in at:
            raise Refusal(f"{heads[at[name]]!r} and {head!r} may both be its {name}: remove one")
        if name is not None:
            at[name] = i
    if lacking := [name for name in ("velocity", "friction") if name not in at]:
        raise Refusal(f"no heading names its {lacking[0]}; a table {_NEEDED} is needed")
    return at


def _numbers(rows, name: str, column: int) -> Float[np.ndarray, " n"]:
    found = []
    for row in rows:
        if row.comment or not any(row.cells):
            continue
        cell = row.cells[column] if column < len(row.cells) else ""
        if is_missing(cell) and name == "error":  # of a point that was measured once
            found.append(np.nan)
            continue
        try:
            found.append(float(cell))
        except ValueError:
            raise Refusal(f"line {row.line} has no number as {name}, but {cell!r}") from None
    return np.array(found)


def _factor(log: Log, name: str, head: str) -> tuple[float, float]:
    """Factor and offset of a column to SI: of the unit in its heading, or of the assumed one."""
    usual = {"velocity": "m/s", "temperature": "K"}.get(name, "1")
    stated = _UNIT.search(head.strip())
    if stated is None:
        if usual != "1":
            log.assume(
                f"The {name} is assumed to be in {usual}, because its heading {head!r} names no "
                f"unit; otherwise write the unit into the heading, such as '{name} [{usual}]'."
            )
        return 1.0, 0.0
    text = stated[1] or stated[2]
    unit = parse_unit(text)
    length, _, per = text.partition("/")
    long, seconds = metres(length), UNITS["time"].get(parse_unit(per) or "")
    if name == "velocity" and long and seconds:
        return long / seconds, 0.0
    if name == "temperature" and unit in OFFSETS:
        return UNITS["temperature"][unit], OFFSETS[unit]
    if name in ("friction", "error") and unit in UNITS["ratio"]:
        return UNITS["ratio"][unit], 0.0
    raise Refusal(f"its {name} is in {text!r}, as the heading states, but {usual} is needed")
