"""Quantities and units that the headings of measured tables name.

A heading such as "Storage modulus, MPa", "E' [MPa]", "E_stor (MPa)" or "G_storage_pa" is split
into words and a unit; its words decide the quantity, or leave it undecided.
"""

import functools
import re
import unicodedata
from typing import NamedTuple

import numpy as np

# The quantities a column may hold, each with its dimension.
DIMENSIONS = {
    "frequency": "frequency", "time": "time", "temperature": "temperature",
    "storage": "modulus", "loss": "modulus", "magnitude": "modulus",
    "tan_delta": "ratio", "phase": "angle",
    "modulus": "modulus", "compliance": "compliance", "stress": "stress", "strain": "strain",
    "storage_compliance": "compliance", "loss_compliance": "compliance",
    "compliance_magnitude": "compliance",
}  # fmt: skip

_MODULUS = {
    "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/m2": 1.0, "N/mm2": 1e6,
    "dyn/cm2": 0.1, "kgf/cm2": 98066.5, "psi": 6894.757293168361, "ksi": 6894757.293168361,
    "bar": 1e5,
}  # fmt: skip
# Factors to SI; of a temperature, factor and offset: K = factor x value + offset.
UNITS: dict[str, dict[str, float]] = {
    "frequency": {"rad/s": 1.0, "Hz": 2 * np.pi, "kHz": 2e3 * np.pi, "MHz": 2e6 * np.pi,
                  "mHz": 2e-3 * np.pi},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "temperature": {"K": 1.0, "C": 1.0, "F": 5 / 9},
    "modulus": _MODULUS,
    "stress": _MODULUS,
    "compliance": {**{f"1/{unit}": 1 / factor for unit, factor in _MODULUS.items()},
                   "m2/N": 1.0, "mm2/N": 1e-6, "cm2/N": 1e-4, "cm2/dyn": 10.0},
    "ratio": {"1": 1.0, "%": 0.01},
    "strain": {"1": 1.0, "%": 0.01},
    "angle": {"rad": 1.0, "deg": np.pi / 180},
}  # fmt: skip
SI = {dimension: next(iter(units)) for dimension, units in UNITS.items()}
OFFSETS = {"C": 273.15, "K": 0.0, "F": 459.67 * 5 / 9}

LONGEST_UNIT = 40  # characters, with brackets and spaces
PER_SECOND = "1/s"  # may mean Hz or rad/s: the name of the column decides

# Other spellings, after the folding of `parse_unit`.
_SPELLINGS = {
    "rads-1": "rad/s", "rad.s-1": "rad/s", "rad/sec": "rad/s", "rad_s": "rad/s",
    "hertz": "Hz", "cycles/s": "Hz",
    "1/s": PER_SECOND, "s-1": PER_SECOND, "1/sec": PER_SECOND,
    "sec": "s", "seconds": "s", "µs": "us", "μs": "us", "minutes": "min", "hours": "h", "hr": "h",
    "°c": "C", "degc": "C", "celsius": "C", "kelvin": "K", "°f": "F", "degf": "F",
    "dyne/cm2": "dyn/cm2", "cm2/dyne": "cm2/dyn", "°": "deg", "degrees": "deg", "-": "1", "–": "1",
    "mm/mm": "1", "m/m": "1", "percent": "%", "pct": "%",
    **{f"{unit.lower()}-1": f"1/{unit}" for unit in _MODULUS},
    "m2n-1": "m2/N", "mm2n-1": "mm2/N", "cm2dyn-1": "cm2/dyn",
}  # fmt: skip
_EXACT = {unit for units in UNITS.values() for unit in units}

# Metres per unit of length, as the headings of topographies spell it, after `_folded`.
_METRES = {
    "m": 1.0, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12, "fm": 1e-15,
    "km": 1e3, "å": 1e-10, "angstrom": 1e-10, "ångström": 1e-10,
    "micron": 1e-6, "microns": 1e-6,
    "in": 0.0254, "inch": 0.0254, "inches": 0.0254, "ft": 0.3048, "feet": 0.3048,
    "mil": 2.54e-5, "mils": 2.54e-5, "thou": 2.54e-5,
    "uin": 2.54e-8, "uinch": 2.54e-8, "microinch": 2.54e-8, "microinches": 2.54e-8,
    **{f"{prefix}{word}": factor
       for prefix, factor in (("", 1.0), ("milli", 1e-3), ("micro", 1e-6), ("nano", 1e-9))
       for word in ("meter", "metre", "meters", "metres")},
}  # fmt: skip
_LENGTHS_OF = "|".join(sorted(map(re.escape, _METRES), key=len)[::-1])
# A unit is at the end of a heading: "z [nm]", "Height (µm)", "depth / mm", "z_um", "unit: nm".
_AT_END = re.compile(rf"(?:^|[\[(<{{/_:=,\s])({_LENGTHS_OF})\s*[\])>}}]?\s*[.:;,]*$", re.IGNORECASE)
# "in" behind a space may be the English word, as in "heights in:".
_WORD = re.compile(r"\w\s+in\s*[.:;,]*$", re.IGNORECASE)

# Words of headings, without their accents. Single letters are distinguished by their case: t is
# time and T temperature.
_LETTERS = {
    "f": "frequency", "w": "angular", "ω": "angular", "t": "time", "T": "temperature",
    "Ts": "temperature", "δ": "delta", "E": "tension", "G": "shear",
    "J": "shear compliance", "E(t)": "tension relaxation", "G(t)": "shear relaxation",
    "D(t)": "tension compliance", "J(t)": "shear compliance",
    "E'": "tension storage", "E''": "tension loss", "G'": "shear storage", "G''": "shear loss",
    "E1": "tension storage", "E2": "tension loss", "G1": "shear storage", "G2": "shear loss",
    "E*": "tension magnitude", "G*": "shear magnitude",
    "D'": "tension storage compliance", "D''": "tension loss compliance",
    "J'": "shear storage compliance", "J''": "shear loss compliance",
    "D*": "tension magnitude compliance", "J*": "shear magnitude compliance",
    "σ": "stress", "τ": "shear stress", "ε": "strain", "γ": "shear strain",
}  # fmt: skip
_HEADING_WORDS = {
    word: meaning
    for meaning, words in {
        "frequency": "frequency freq frequenz hz frequence",
        "angular": "angular ang omega kreisfrequenz pulsation angulaire",
        "time": "time zeit temps",
        "period": "period periode periodendauer schwingungsdauer",
        "temperature": "temperature temp temperatur",
        "storage": "storage stor speichermodul elastic real conservation stockage elastique",
        "loss": "loss verlustmodul viscous imag imaginary perte pertes visqueux amortissement"
        " d'amortissement",
        "magnitude": "magnitude abs complex komplexer complexe dynamic dynamischer dynamique",
        "tan": "tan",
        "delta": "delta",
        "tan delta": "tand tanδ tandelta",
        "factor": "factor tangent facteur tangente",
        "loss factor": "damping verlustfaktor",
        "phase": "phase angle phaseangle phasenwinkel dephasage",
        "relaxation": "relaxation relax relaxationsmodul",
        "modulus": "modulus modul component module",
        "compliance": "compliance creep nachgiebigkeit kriechnachgiebigkeit complaisance fluage",
        "stress": "stress spannung sigma contrainte",
        "shear stress": "schubspannung",
        "strain": "strain dehnung epsilon deformation",
        "shear strain": "gamma",
        "tension": "tension tensile young's extensional traction young d'young",
        "shear": "shear cisaillement",
        "step": "step interval segment action intervalle d'intervalle",
        "": "sequence de du en au measured meas sample actual test reduced shifted applied",
    }.items()
    for word in words.split()
}
# Which words, together, mean which quantity, beside its own name; "modulus" and the deformation may
# be left out.
_SPELLED = {
    "frequency": ("angular", "angular frequency", "period"),
    "storage_compliance": ("storage compliance",),
    "loss_compliance": ("loss compliance",),
    "compliance_magnitude": ("magnitude compliance",),
    "tan_delta": ("tan delta", "factor delta", "loss factor", "loss factor tan delta"),
    "phase": ("delta", "phase delta", "phase loss"),
    "modulus": ("", "relaxation"),
    "strain": ("compliance strain",),
}
_MEANINGS = {
    frozenset(words.split()): quantity
    for quantity in DIMENSIONS
    for words in (quantity, *_SPELLED.get(quantity, ()))
}
_LOGARITHM = re.compile(r"(log10|log|lg|ln)(?![a-z0-9])[\s_]*", re.I)


class Heading(NamedTuple):
    """The quantity and unit that a heading names; None for what it does not name.

    - `quantity`: a key of `DIMENSIONS`.
    - `unit`: a unit of `UNITS`, of any dimension, or `PER_SECOND`.
    - `deformation`: "tension" (E, D) or "shear" (G, J).
    - `angular`: whether a frequency is called angular.
    - `step`: whether a time is called one of the step or interval.
    - `base`: "10" or "e" of a column of logarithms.
    - `period`: whether it names the period T of a frequency f = 1/T.
    """

    quantity: str | None
    unit: str | None
    deformation: str | None = None
    angular: bool = False
    step: bool = False
    base: str | None = None
    period: bool = False


def metres(unit: str) -> float | None:
    """Returns metres per unit of length, or None if the text is not a unit of length."""
    return _METRES.get("å" if unit == "A" else _folded_unit(unit))


def length_unit(heading: str) -> str | None:
    """Returns the unit of length at the end of a heading, or None."""
    found = None if _WORD.search(heading) else _AT_END.search(_folded_unit(heading))
    return found.group(1) if found else None


def _folded_unit(text: str) -> str:
    # Unicode has two signs for micro, and two for the ångström.
    return text.replace("µ", "u").replace("μ", "u").replace("Å", "å").strip().lower()


def parse_unit(text: str) -> str | None:
    """Returns the unit of `UNITS`, or `PER_SECOND`, that `text` spells; None if there is none."""
    if len(text) > LONGEST_UNIT:
        return None
    bare = re.sub(r"^\[(.*)\]$|^\((.*)\)$", r"\1\2", text.strip())
    for old, new in (("²", "2"), ("⁻¹", "-1"), ("−1", "-1"), ("º", "°"), ("˚", "°")):
        bare = bare.replace(old, new)
    bare = re.sub(r"[\s^·*]", "", bare)
    if bare in _EXACT:
        return bare
    if "mPa" in bare:  # not a megapascal
        return None
    folded = bare.lower()
    # Lower case is common in names such as E_mpa; mhz could be either of two.
    found = [unit for unit in _EXACT if unit.lower() == folded]
    return _SPELLINGS.get(folded) or (found[0] if len(found) == 1 else None)


@functools.lru_cache(maxsize=512)  # each heading is looked at many times
def parse_heading(text: str) -> Heading:
    """Returns the quantity and unit that the heading of a column names."""
    name, unit, base = split_heading(text)
    words: set[str] = set()
    for word in _words_of(name):
        letters = unicodedata.normalize("NFD", word.lower())  # accents as letters of their own
        bare = "".join(letter for letter in letters if not unicodedata.combining(letter))
        meaning = _LETTERS.get(word, _HEADING_WORDS.get(bare))
        if meaning is None:  # one unknown word can change the meaning of all others
            return Heading(None, unit)
        words.update(meaning.split())
    deformations = words & {"tension", "shear"}
    quantity = _MEANINGS.get(frozenset(words - {"tension", "shear", "modulus", "step"}))
    if not words - {"step"} or len(deformations) > 1:
        quantity = None
    deformation = next(iter(deformations), None)
    said = ("angular" in words, "step" in words, base, "period" in words)
    return Heading(quantity, unit, deformation, *said)


def split_heading(text: str) -> tuple[str, str | None, str | None]:
    """Returns the name in a heading, its unit, and the base of a logarithm."""
    inner, base = _without_logarithm(text.strip())
    name, unit = _split_unit(inner.strip())
    return name, unit, base


def _without_logarithm(text: str) -> tuple[str, str | None]:
    """The heading inside of "log10(...)" or behind "log", and the base."""
    found = _LOGARITHM.match(text)
    if found is None:
        return text, None
    # Brackets may hold others, as those of a unit.
    rest = re.sub(r"^\(((?:[^()]|\([^()]*\))*)\)", r"\1", text[found.end() :]).removeprefix("(")
    return rest, "e" if found[1].lower() == "ln" else "10"


def _split_unit(text: str) -> tuple[str, str | None]:
    """The heading without its unit, and the unit: the longest ending that is one."""
    for gap in re.finditer(r"[\s_/,;:]+(?:in\s+)?|(?=[\[(])", text):
        ending = text[gap.end() :]
        bare = ending == "1" and gap[0].isspace()  # the first of several such columns
        if gap.start() > 0 and not bare and (unit := parse_unit(ending)):
            return text[: gap.start()], unit
    return text, None


def _words_of(name: str) -> list[str]:
    """The words of a heading, primes in one spelling, and "E(t)" as one word."""
    name = re.sub(r"''|´´|′′|’’|‘‘|[\"″”“]", "''", name)
    name = re.sub(r"[′’‘´`]", "'", name)
    name = re.sub(r"(?i)\btan[\s_(]*(?:delta|δ|d)\b\)?", " tandelta ", name)
    name = re.sub(r"\(\s*(?:ω|omega|w|f)\s*\)", " ", name)
    return re.findall(r"\b[EGJD]\(t\)|[^\s_.,:|()\[\]/-]+", name)
