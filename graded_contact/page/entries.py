"""What a user enters in a field: a number, with or without a unit, or values with their names."""

import re

from ..readers.units import OFFSETS, UNITS, metres, parse_unit

_ENTRY = re.compile(r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)")
# Units of conductivity, which no reader knows, without spaces and brackets.
_CONDUCTIVITIES = {"W/mK": 1.0, "W/m/K": 1.0, "mW/mK": 1e-3, "kW/mK": 1e3}


def read_entry(text: str, unit: str) -> float:
    """Returns the number [SI] in a text: "2.5", "2,5 µm", "0.5 MPa", "20 °C".

    **Arguments:**

    - `text`: of the field.
    - `unit`: of a number without one; one of another size, such as MPa for kPa, may follow it.

    **Raises:** `ValueError` for a text that is no number, or that has a unit of another dimension.
    """
    found = _ENTRY.fullmatch(text.strip())
    if found is None:
        raise ValueError("no number")
    number, given = float(found[1].replace(",", ".")), found[2] or unit
    known = dimension_of(given)
    if known is None:
        raise ValueError(f"the unit {given[:20]} is not known")
    dimension, factor, offset = known
    if known[:1] != (dimension_of(unit) or ())[:1]:
        raise ValueError(f"{given} is a unit of {dimension}")
    # Twelve digits: 0.3 kPa are 300 Pa.
    return float(f"{number * factor + offset:.12g}")


def dimension_of(unit: str) -> tuple[str, float, float] | None:
    """Returns dimension, factor and offset of a unit, to SI; None if the unit is not known."""
    if length := metres(unit):
        return "length", length, 0.0
    if dimension := _listed(unit):
        spelt = parse_unit(unit) or ""
        name = "pressure" if dimension == "modulus" else dimension
        offset = OFFSETS[spelt] if dimension == "temperature" else 0.0
        return name, UNITS[dimension][spelt], offset
    if (factor := _CONDUCTIVITIES.get(re.sub(r"[\s()·*]", "", unit))) is not None:
        return "conductivity", factor, 0.0
    above, slash, below = unit.replace("²", "2").replace("^", "").partition("/")
    time = UNITS["time"].get(parse_unit(below) or "")
    squared = above.strip().endswith("2")
    length = metres(above.strip().removesuffix("2"))
    if not (slash and time and length):
        return None
    return ("diffusivity", length**2 / time, 0.0) if squared else ("velocity", length / time, 0.0)


def _listed(unit: str) -> str | None:
    """The dimension of a unit of moduli, as `UNITS` names it; None for another unit."""
    return next((name for name, units in UNITS.items() if parse_unit(unit) in units), None)


def read_units(text: str) -> dict[str, str | int]:
    """Returns the units in a text by their dimensions: "MPa; frequency=Hz" has both.

    **Raises:** `ValueError` as `read_pairs`, for a unit that is not known and has no name.
    """
    parts = ((part.strip(), _listed(part)) for part in re.split("[,;]", text))
    return read_pairs(",".join(f"{name}={part}" if name else part for part, name in parts))


def read_pairs(text: str) -> dict[str, str | int]:
    """Returns the values in a text by their names: "storage=2, loss=3"; whole numbers as such.

    **Raises:** `ValueError` for a text of another form.
    """
    found = {}
    for part in filter(None, map(str.strip, re.split("[,;]", text))):
        name, equals, value = map(str.strip, part.partition("="))
        if not (name and equals and value):
            raise ValueError(f"{part} has no name and value")
        found[name] = int(value) if value.isdecimal() else value
    return found
