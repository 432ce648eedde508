"""What the lines above a table say of all of it: its title, the temperature, the constant stress of
a creep test, the geometry. Only a value with its unit counts, and only if no line says another.
"""

import re
from collections.abc import Sequence

from .cells import Row, is_number
from .quantities import OFFSETS, UNITS, parse_unit

_NUMBER = r"([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)"
# Not "10 °C/min", and not the end of a word or of another number.
_TEMPERATURE = re.compile(
    rf"(?<![\w.,]){_NUMBER}\s*(?:°|º|deg\.?)?\s*([CK])\b(?!\s*(?:/|\^|min|per))"
)
_STRESS = re.compile(
    rf"(?i)\b(?:schub)?(?:stress|spannung)\b[^\w+-]*{_NUMBER}\s*([a-z][a-z0-9/^²]*)"
)

_TENSION = re.compile(
    r"(?i)(?:geometr|clamp|fixture|holder|halter|probe).*"
    r"(?:tension|tensile|compression|bending|cantilever|zug|biege|druck)"
)
_TEST = re.compile(
    r"(?i)sweep|ramp|hold|relax|creep|soak|step|test|balayage|rampe|fluage|paliers?|essai|kriech|versuch"
)
_COUNT = re.compile(r"(?i)(?:interval|abschnitt)")  # "Interval and data points: 1 29"
# Settings of an instrument that are no temperature of a test.
_SETTING = re.compile(r"(?i)toleran|limit|offset|compensation|expansion|calibration|span|range")


def title_above(rows: Sequence[Row]) -> str:
    """Returns the title of the step that follows, "Frequency sweep - 2" say; empty if none is."""
    marks = [i for i, row in enumerate(rows) if row.cells[0].casefold() == "[step]"]
    if marks and marks[-1] + 1 < len(rows):
        return _last(rows[marks[-1] + 1])
    for row in reversed(rows):
        if _TEST.search(" ".join(row.cells)) and not _COUNT.match(row.cells[0]):
            return _last(row)
    return ""


def _last(row: Row) -> str:
    return next((cell for cell in reversed(row.cells) if cell), "")[:60]


def temperature_above(rows: Sequence[Row]) -> float | None:
    """Returns the only temperature [K] that the rows name, such as "25 °C"."""
    found = {
        _value(number) + OFFSETS[unit]
        for row in rows
        if not _SETTING.search(row.cells[0])
        for number, unit in _TEMPERATURE.findall(" ".join(row.cells))
    }
    for row in rows:
        given = parameters(row)
        if "chem" in given and is_number(given.get("T", "")):  # as RepTate's files begin
            found.add(float(given["T"]) + OFFSETS["C"])
    return found.pop() if len(found) == 1 else None


def stress_above(rows: Sequence[Row]) -> float | None:
    """Returns the only stress [Pa] that the rows name, such as "Stress: 2 kPa"."""
    found = {
        _value(number) * UNITS["stress"][unit]
        for row in rows
        for number, word in _STRESS.findall(" ".join(row.cells))
        if (unit := parse_unit(word)) in UNITS["stress"]
    }
    return found.pop() if len(found) == 1 else None


def tension_above(rows: Sequence[Row]) -> bool:
    """Returns whether a row names a geometry of tension, compression or bending."""
    return any(_TENSION.search(" ".join(row.cells)) for row in rows)


def parameters(row: Row) -> dict[str, str]:
    """Returns the parameters of a line such as "T=-35; Mw = 634.5;", as RepTate's files begin."""
    text = " ".join(row.cells)
    entries = [entry.split("=", 1) for entry in text.split(";") if entry.strip()]
    if not all(len(entry) == 2 for entry in entries):
        return {}
    return {name.strip(): value.strip() for name, value in entries}


def _value(text: str) -> float:
    return float(text.replace(",", "."))
