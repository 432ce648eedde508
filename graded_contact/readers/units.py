"""Units of measured numbers, and the units that headings of columns name.

pint does not fit: it takes 1 Hz for 1 rad/s, and knows neither "rad_s" nor "N/mm2".
"""

import re

import numpy as np

_PASCALS = {
    "Pa": 1.0,
    "kPa": 1e3,
    "MPa": 1e6,
    "GPa": 1e9,
    "N/m2": 1.0,
    "N/mm2": 1e6,
    "dyn/cm2": 0.1,
    "psi": 6894.757293168361,
    "ksi": 6894757.293168361,
    "bar": 1e5,
}
_LENGTHS = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "pm": 1e-12,
    "km": 1e3,
    "Å": 1e-10,
    "in": 0.0254,
    "mil": 2.54e-5,
}
_HERTZ = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "mHz": 1e-3}
# Factors to SI by dimension; of a temperature, K = factor x value + offset.
UNITS: dict[str, dict[str, float]] = {
    "frequency": {"rad/s": 1.0} | {unit: 2 * np.pi * each for unit, each in _HERTZ.items()},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "temperature": {"K": 1.0, "C": 1.0, "F": 5 / 9},
    "modulus": _PASCALS,
    "pressure": _PASCALS,
    "compliance": {f"1/{unit}": 1 / factor for unit, factor in _PASCALS.items()},
    "ratio": {"1": 1.0, "%": 0.01},
    "angle": {"rad": 1.0, "deg": np.pi / 180},
    "length": _LENGTHS,
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "km/h": 1 / 3.6},
}
OFFSETS = {"K": 0.0, "C": 273.15, "F": 459.67 * 5 / 9}
_ALL = {unit for units in UNITS.values() for unit in units}
_SPELLINGS = {
    "rads-1": "rad/s",
    "rad_s": "rad/s",
    "sec": "s",
    "hours": "h",
    "°c": "C",
    "°f": "F",
    "°": "deg",
    "-": "1",
    "pct": "%",
    "percent": "%",
    "micron": "um",
    "inch": "in",
}
# The last two of each pair of signs that look alike.
_SIGNS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "º": "°", "\u212b": "Å"})
_BRACKETS = re.compile(r"\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")


def parse_unit(text: str) -> str | None:
    """Returns the unit of `UNITS` that a text spells, None if there is none, or several."""
    bare = re.sub(r"[\s^·*]", "", text.translate(_SIGNS).replace("⁻¹", "-1"))
    if bare in _ALL:
        return bare
    folded = [unit for unit in _ALL if unit.lower() == bare.lower()]
    # Millipascal is no MPa, mhz is mHz or MHz, and f is no Fahrenheit.
    if "mPa" in bare or len(folded) > 1 or (bare.isalpha() and len(bare) == 1):
        return None
    return _SPELLINGS.get(bare.lower()) or next(iter(folded), None)


def metres(text: str) -> float | None:
    """Returns metres per unit of length, None for another text."""
    return UNITS["length"].get(parse_unit(text) or "")


def split_heading(text: str) -> tuple[str, str | None]:
    """Returns the name and the unit in a heading: "E' [MPa]", "T (°C)", "f, Hz" or "G_loss_Pa".

    A text in brackets is a unit, known or not; otherwise the longest ending that is one.
    """
    text = text.strip()
    if (found := _BRACKETS.search(text)) and found.start() and found[1] not in ("t", "delta", "δ"):
        return text[: found.start()], parse_unit(found[1]) or found[1]
    for gap in re.finditer(r"[\s_,/]+", text):
        if gap.start() and (unit := parse_unit(text[gap.end() :])):
            return text[: gap.start()], unit
    return text, None
