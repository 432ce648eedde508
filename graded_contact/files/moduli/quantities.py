"""What the columns of a rheometer's or DMA's table are called, and in which units they come.

A heading such as "Storage modulus, MPa", "E' [MPa]", "E_stor (MPa)" or "G_storage_pa" is split
into words and a unit; its words decide the quantity, or leave it undecided.
"""

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
    "temperature": {"C": 1.0, "K": 1.0, "F": 5 / 9},
    "modulus": _MODULUS,
    "stress": _MODULUS,
    "compliance": {"m2/N": 1.0, "mm2/N": 1e-6, "cm2/dyn": 10.0,
                   **{f"1/{unit}": 1 / factor for unit, factor in _MODULUS.items()}},
    "ratio": {"1": 1.0, "%": 0.01},
    "strain": {"1": 1.0, "%": 0.01},
    "angle": {"deg": np.pi / 180, "rad": 1.0},
}  # fmt: skip
SI = {
    "frequency": "rad/s", "time": "s", "temperature": "K", "modulus": "Pa", "stress": "Pa",
    "compliance": "1/Pa", "ratio": "1", "strain": "1", "angle": "rad",
}  # fmt: skip
OFFSETS = {"C": 273.15, "K": 0.0, "F": 459.67 * 5 / 9}

PER_SECOND = "1/s"  # may mean Hz or rad/s: the name of the column decides

# Other spellings, after the folding of `parse_unit`.
_SPELLINGS = {
    "rads-1": "rad/s", "rad.s-1": "rad/s", "rad/sec": "rad/s", "rad_s": "rad/s",
    "hertz": "Hz", "cycles/s": "Hz",
    "1/s": PER_SECOND, "s-1": PER_SECOND, "1/sec": PER_SECOND,
    "sec": "s", "seconds": "s", "µs": "us", "μs": "us", "minutes": "min", "hours": "h", "hr": "h",
    "°c": "C", "degc": "C", "celsius": "C", "kelvin": "K", "°f": "F", "degf": "F",
    "dyne/cm2": "dyn/cm2", "cm2/dyne": "cm2/dyn", "°": "deg", "degrees": "deg", "-": "1", "–": "1",
    "mm/mm": "1", "m/m": "1", "percent": "%",
    **{f"{unit.lower()}-1": f"1/{unit}" for unit in _MODULUS},
}  # fmt: skip
_EXACT = {unit for units in UNITS.values() for unit in units}

# Words of headings, without their accents. Single letters are told apart by their case: t is time
# and T temperature.
_LETTERS = {
    "f": "frequency", "w": "angular", "ω": "angular", "t": "time", "T": "temperature",
    "Ts": "temperature", "δ": "delta", "E": "tension", "G": "shear",
    "J": "shear compliance", "E(t)": "tension relaxation", "G(t)": "shear relaxation",
    "D(t)": "tension compliance", "J(t)": "shear compliance",
    "E'": "tension storage", "E''": "tension loss", "G'": "shear storage", "G''": "shear loss",
    "E1": "tension storage", "E2": "tension loss", "G1": "shear storage", "G2": "shear loss",
    "E*": "tension magnitude", "G*": "shear magnitude",
    "σ": "stress", "τ": "shear stress", "ε": "strain", "γ": "shear strain",
}  # fmt: skip
_WORDS = {
    "frequency": "frequency", "freq": "frequency", "frequenz": "frequency", "hz": "frequency",
    "frequence": "frequency", "angular": "angular", "ang": "angular", "omega": "angular",
    "kreisfrequenz": "angular", "pulsation": "angular", "angulaire": "angular",
    "time": "time", "zeit": "time", "temps": "time",
    "temperature": "temperature", "temp": "temperature", "temperatur": "temperature",
    "storage": "storage", "stor": "storage", "speichermodul": "storage", "elastic": "storage",
    "real": "storage", "loss": "loss", "verlustmodul": "loss", "viscous": "loss", "imag": "loss",
    "imaginary": "loss", "conservation": "storage", "stockage": "storage", "elastique": "storage",
    "perte": "loss", "pertes": "loss", "visqueux": "loss",
    "magnitude": "magnitude", "abs": "magnitude", "complex": "magnitude", "komplexer": "magnitude",
    "complexe": "magnitude",
    "tan": "tan", "delta": "delta", "tand": "tan delta", "tanδ": "tan delta", "factor": "factor",
    "tandelta": "tan delta", "tangent": "factor", "damping": "loss factor",
    "verlustfaktor": "loss factor", "facteur": "factor", "tangente": "factor",
    "amortissement": "loss", "d'amortissement": "loss",
    "phase": "phase", "angle": "phase", "phaseangle": "phase", "phasenwinkel": "phase",
    "dephasage": "phase",
    "relaxation": "relaxation", "relax": "relaxation", "relaxationsmodul": "relaxation",
    "modulus": "modulus", "modul": "modulus", "component": "modulus", "module": "modulus",
    "compliance": "compliance", "creep": "compliance", "nachgiebigkeit": "compliance",
    "kriechnachgiebigkeit": "compliance", "complaisance": "compliance", "fluage": "compliance",
    "stress": "stress", "spannung": "stress", "schubspannung": "shear stress", "sigma": "stress",
    "contrainte": "stress",
    "strain": "strain", "dehnung": "strain", "gamma": "shear strain", "epsilon": "strain",
    "deformation": "strain",
    "tension": "tension", "tensile": "tension", "young's": "tension", "extensional": "tension",
    "traction": "tension", "young": "tension", "d'young": "tension",
    "shear": "shear", "cisaillement": "shear", "step": "step", "interval": "step",
    "segment": "step", "action": "step", "intervalle": "step", "d'intervalle": "step",
    "sequence": "", "de": "", "du": "", "en": "", "au": "",
    "measured": "", "meas": "", "sample": "", "actual": "", "test": "", "reduced": "",
    "shifted": "", "applied": "",
}  # fmt: skip
# Which words, together, mean which quantity; "modulus" and the deformation may be left out.
_MEANINGS = {
    frozenset(words.split()): quantity
    for quantity, spellings in {
        "frequency": ("frequency", "angular", "angular frequency"),
        "time": ("time",),
        "temperature": ("temperature",),
        "storage": ("storage",),
        "loss": ("loss",),
        "magnitude": ("magnitude",),
        "tan_delta": ("tan delta", "factor delta", "loss factor", "loss factor tan delta"),
        "phase": ("delta", "phase", "phase delta", "phase loss"),
        "modulus": ("", "relaxation"),
        "compliance": ("compliance",),
        "stress": ("stress",),
        "strain": ("strain", "compliance strain"),
    }.items()
    for words in spellings
}


# Words of columns that only a test in shear has.
_OF_SHEAR = re.compile(
    r"shear|schub|scher|cisaill|torque|drehmoment|\bmoment\b|\bcouple\b|rotation"
    r"|viscosit|viskosität",
    re.I,
)
_LOGARITHM = re.compile(r"(log10|log|lg|ln)(?![a-z0-9])[\s_]*", re.I)


class Heading(NamedTuple):
    """What a column's heading says; None where it does not say it.

    - `quantity`: a key of `DIMENSIONS`.
    - `unit`: a unit of `UNITS`, of any dimension, or `PER_SECOND`.
    - `deformation`: "tension" (E, D) or "shear" (G, J).
    - `angular`: whether a frequency is called angular.
    - `step`: whether a time is called one of the step or interval.
    - `base`: of the logarithms that the column holds: "10" or "e".
    """

    quantity: str | None
    unit: str | None
    deformation: str | None = None
    angular: bool = False
    step: bool = False
    base: str | None = None


def parse_unit(text: str) -> str | None:
    """Returns the unit of `UNITS`, or `PER_SECOND`, that `text` spells; None if there is none."""
    bare = text.strip()
    if re.fullmatch(r"\[.*\]|\(.*\)", bare):
        bare = bare[1:-1]
    for old, new in (("²", "2"), ("⁻¹", "-1"), ("º", "°"), ("˚", "°")):
        bare = bare.replace(old, new)
    bare = re.sub(r"[\s^·*]", "", bare)
    if bare in _EXACT:
        return bare
    if bare == "mPa":  # not a megapascal
        return None
    folded = bare.lower()
    if folded in _SPELLINGS:
        return _SPELLINGS[folded]
    # Lower case is common in names such as E_mpa; mhz could be either of two.
    found = [unit for unit in _EXACT if unit.lower() == folded]
    return found[0] if len(found) == 1 else None


def parse_heading(text: str) -> Heading:
    """Returns what the heading of a column says."""
    inner, base = _without_logarithm(text.strip())
    name, unit = _split_unit(inner)
    words: set[str] = set()
    for word in _words(name):
        meaning = _LETTERS.get(word, _WORDS.get(_unaccented(word.lower())))
        if meaning is None:
            return Heading(None, unit)
        words.update(meaning.split())
    deformations = words & {"tension", "shear"}
    quantity = _MEANINGS.get(frozenset(words - {"tension", "shear", "modulus", "step"}))
    if not words - {"step"} or len(deformations) > 1:
        quantity = None
    deformation = next(iter(deformations), None)
    return Heading(quantity, unit, deformation, "angular" in words, "step" in words, base)


def tells_of_shear(text: str) -> bool:
    """Whether a heading tells that the test was one in shear, whatever its column holds."""
    return _OF_SHEAR.search(text) is not None


def _without_logarithm(text: str) -> tuple[str, str | None]:
    """The heading inside of "log10(...)" or behind "log", and the base."""
    found = _LOGARITHM.match(text)
    if found is None:
        return text, None
    rest = text[found.end() :]
    if rest.startswith("("):
        depths = np.cumsum([(char == "(") - (char == ")") for char in rest])
        end = int(np.argmin(depths != 0))  # the bracket that closes the first one
        rest = rest[1:end] + rest[end + 1 :] if depths[end] == 0 else rest[1:]
    return rest, "e" if found[1].lower() == "ln" else "10"


def _split_unit(text: str) -> tuple[str, str | None]:
    """The heading without its unit, and the unit: the longest ending that is one."""
    text = text.strip()
    for gap in re.finditer(r"[\s_/,;:]+(?:in\s+)?|(?=[\[(])", text):
        ending = text[gap.end() :]
        bare = ending == "1" and gap[0].isspace()  # the first of several such columns
        if gap.start() > 0 and not bare and (unit := parse_unit(ending)):
            return text[: gap.start()], unit
    return text, None


def _unaccented(word: str) -> str:
    letters = unicodedata.normalize("NFD", word)
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def _words(name: str) -> list[str]:
    name = re.sub(r"''|´´|′′|’’|‘‘|[\"″”“]", "''", name)
    name = re.sub(r"[′’‘´`]", "'", name)
    name = re.sub(r"(?i)\btan[\s_(]*(?:delta|δ|d)\b\)?", " tandelta ", name)
    name = re.sub(r"\(\s*(?:ω|omega|w|f)\s*\)", " ", name)
    of_time = re.findall(r"\b[EGJD]\(t\)", name)
    rest = re.sub(r"\b[EGJD]\(t\)", " ", name)
    return of_time + [word for word in re.split(r"[\s_.,:|()\[\]/-]+", rest) if word]
