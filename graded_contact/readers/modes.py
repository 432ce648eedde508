"""Tables of modes (τ_i, E_i), (τ_i, g_i): what tells them from a relaxation modulus E(t).

A table is a Prony series if its names say so ("tau", "relaxation time"; "E_i", "g_i"), or if a
column of relaxation times has an infinite one or moduli that rise and fall. If the names may mean
E(t) as well, the table is refused with both meanings.
"""

import functools
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core.files import Refusal
from .cells import Row, Sheet, holds_data, is_infinite, is_number
from .series import Doubt, Series
from .units import UNITS, parse_heading, parse_unit, split_heading

# Names without units, spaces and marks; [ijkn] is an index.
_NAMES = {
    "time": r"(?:tau|τ|lambda|λ)[ijkn]?|t[ijkn]|\w*relax\w*(?:time|zeit)s?\w*|reltime\w*"
            r"|temps\w*relax\w*|relax\w*temps|timeconst\w*",
    "modulus": r"(?:(?:young'?s?|shear)?modulus)?[EG][ijkn]|modulus[ijkn]|\w*mode\w*modul\w*"
               r"|modul\w*mode\w*|(?:branch|spring|maxwell)\w*|\w*strengths?[ijkn]?",
    "ratio": r"(?:g|e|alpha|α|w|p|c)[ijkn](?:prony|p)?|rel(?:ative)?mod\w*|\w*weights?"
             r"|\w*fractions?|\w*ratios?|pronycoeff\w*",
    "bulk": r"k[ijkn](?:prony|p)?",
    "glassy": r"[EG]0|[EG]inst\w*|(?:instantaneous|glassy|unrelaxed)\w*",
    "equilibrium": r"[EG](?:inf\w*|∞|eq|e|oo)|(?:equilibrium|longterm|relaxed|rubbery)\w*",
}  # fmt: skip
_NUMBER = r"\s*(?:[\[(]([^\])]*)[\])])?\s*[=:;,]?\s*([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)\s*([^\s,;)]*)"
_WORDS = r"(?:[-_ ]?(?:young'?s|shear|tensile))?[-_ ]?modul\w*(?:[-_ ,]*\(?[EG]_?\w*\)?)?"
_STATED = {
    "glassy": rf"(?:\b[EG]_?0\b|(?i:\b(?:instantaneous|glassy|unrelaxed|short[- ]?term){_WORDS}))",
    "equilibrium": r"(?:\b[EG]_?\{?(?:inf(?:ty|inity)?|∞|eq|e)\}?(?!\w)|(?i:\b(?:equilibrium|"
                   rf"long[- ]?(?:term|time)|relaxed|rubbery)(?:{_WORDS})?))",
}  # fmt: skip
_POISSON = re.compile(r"(?i)(?:poisson\S*(?:\s+(?:ratio|number))?|\bnu\b|ν)\s*[=:;,]?\s*(0?\.\d+)")
_FOREIGN = re.compile(r"(?i)generated with reptate|^\W*reptate")  # whose modes are in s and Pa


_LONGEST = 60  # characters of a name


class _Name(NamedTuple):
    """What the name of a column says: its kind, its unit, E or G, and of which logarithm."""

    kind: str | None
    sure: bool
    unit: str | None
    deformation: str | None
    base: str | None


def modes_on(sheet: Sheet, doubtful: Doubt) -> Series | None:
    """Returns the Prony series in the table of a sheet; None if there is none.

    **Arguments:**

    - `sheet`: the rows.
    - `doubtful`: what a table is that may be a relaxation modulus as well; "refused" raises
      `Refusal`.
    """
    data = [holds_data(row) for row in sheet.rows]
    for i, row in enumerate(sheet.rows):
        if data[i] or not any(data[i + 1 : i + 3]):  # no names: a row of units may be between
            continue
        names = [_understood(cell) for cell in row.cells]
        kinds = [name.kind for name in names]
        if "time" in kinds and {"modulus", "ratio"} & set(kinds):
            return _series(sheet, i, names, doubtful)
    return None


@functools.lru_cache(maxsize=512)
def _understood(cell: str) -> _Name:
    if len(cell) > _LONGEST:
        return _Name(None, False, None, None, None)
    bare, unit, base = split_heading(cell)
    heading, key = parse_heading(cell), re.sub(r"[\s_.{}()\[\]^,-]", "", bare)
    kind = next((kind for kind, names in _NAMES.items() if re.fullmatch(names, key)), None)
    folded = key if key[:1] in "EGegk" and len(key) <= 4 else key.lower()
    kind = kind or next(
        (kind for kind, names in _NAMES.items() if re.fullmatch(names, folded)), None
    )
    if kind == "time" and unit is not None and unit not in UNITS["time"]:
        kind = None  # τ may be a stress, λ a wavelength
    if kind == "ratio" and unit in UNITS["modulus"]:
        kind = "modulus"
    sure = kind is not None
    kind = kind or {"time": "time", "modulus": "modulus"}.get(heading.quantity or "")
    letter = {"E": "tension", "G": "shear", "g": "shear"}.get(key[:1] if len(key) <= 4 else "")
    deformation = heading.deformation or (letter if kind != "time" else None)
    return _Name(kind, sure, unit, deformation, base)


def _series(sheet: Sheet, start: int, names: list[_Name], doubtful: Doubt) -> Series | None:
    """The series of the table whose names are in a row."""
    kinds = [name.kind for name in names]
    time, places = (
        kinds.index("time"),
        {kind: kinds.index(kind) for kind in reversed(kinds) if kind},
    )
    strength = places.get("modulus", places.get("ratio", 0))
    wanted = {
        kind: place for kind, place in places.items() if kind not in ("time", "modulus", "ratio")
    }
    below = sheet.rows[start + 1 :]
    units = below[0].cells if below and not holds_data(below[0]) else []
    modes = [row for row in below if _is_mode(row, time, strength)]
    if not modes:
        return None
    rows, lines_of_modes = [row.cells for row in modes], {row.line for row in modes}

    def numbers(place: int) -> list[float]:
        base = {None: None, "10": 10.0, "e": np.e}[names[place].base]
        found = (np.inf if is_infinite(cells[place]) else float(cells[place]) for cells in rows)
        return [value if base is None else base**value for value in found]

    times, strengths = numbers(time), numbers(strength)
    if not _is_series(names[time], names[strength], times, strengths, doubtful):
        return None
    units = {name: names[place].unit or parse_unit("".join(units[place : place + 1]))
             for name, place in (("time", time), ("modulus", strength))}  # fmt: skip
    lines = [row.text for row in sheet.rows if row.line not in lines_of_modes]
    if any(map(_FOREIGN.search, lines)):
        units = {"time": units["time"] or "s", "modulus": units["modulus"] or "Pa"}
    ratios = kinds[strength] == "ratio"
    if ratios:
        units["modulus"] = None
    stated, letter = _stated(lines, units)
    for kind in ("glassy", "equilibrium"):  # a column that repeats it in every row
        if (
            kind in wanted
            and len(cells := rows[0]) > wanted[kind]
            and is_number(cells[wanted[kind]])
        ):
            stated[kind] = float(cells[wanted[kind]])
            unit = names[wanted[kind]].unit or parse_unit(
                "".join(below[0].cells[wanted[kind] :][:1])
            )
            units["modulus"] = units["modulus"] or unit
            letter = letter or names[wanted[kind]].deformation
    poisson = next((float(found[1]) for line in lines if (found := _POISSON.search(line))), None)
    bulk = numbers(wanted["bulk"]) if "bulk" in wanted and ratios else None
    return Series(
        strengths, times, ratios, bulk, **stated,
        units={name: unit for name, unit in units.items() if unit in UNITS[name]},
        deformation=letter if ratios else names[strength].deformation or letter,
        poisson=poisson, lines=lines,
        layout=f"a table of {len(rows)} relaxation times, line {sheet.rows[start].line}",
    )  # fmt: skip


def _is_mode(row: Row, time: int, strength: int) -> bool:
    """Whether a row holds a relaxation time and a modulus or ratio."""
    if len(row.cells) <= max(time, strength) or row.comment:
        return False
    finite = is_number(row.cells[time]) or is_infinite(row.cells[time])
    return finite and is_number(row.cells[strength])


def _is_series(time: _Name, strength: _Name, times: list, strengths: list, doubtful: Doubt) -> bool:
    """Whether a table is a Prony series; `doubtful` as in `modes_on`."""
    infinite, order = np.any(np.isinf(times)), np.argsort(times)
    rises = np.any(np.diff(np.asarray(strengths)[order]) > 0)
    if time.sure and (strength.sure or infinite or rises):
        return True
    told = infinite or (strength.sure and strength.kind == "modulus")
    if doubtful != "refused" or not (time.sure or told):
        return doubtful == "series"
    raise Refusal(
        "its table may be a Prony series (relaxation times and moduli of branches) or a relaxation "
        "modulus E(t): read a series by `readers.read_prony`; for E(t) name the columns "
        "'time' and 'E(t)', without a row at an infinite time"
    )


def _stated(lines: Sequence[str], units: dict) -> tuple[dict[str, float], str | None]:
    """The instantaneous and the long-time modulus that lines name, in the unit of the moduli."""
    stated, letter = {}, None
    for kind, pattern in _STATED.items():
        for line in lines:
            if found := re.search(f"({pattern}){_NUMBER}", line):
                unit = parse_unit(found[2] or "") or parse_unit(found[4])
                unit = unit if unit in UNITS["modulus"] else None
                units["modulus"] = units["modulus"] or unit
                factor = 1.0
                if unit and units["modulus"] in UNITS["modulus"]:
                    factor = UNITS["modulus"][unit] / UNITS["modulus"][units["modulus"]]
                stated[kind] = factor * float(found[3])
                sign = re.search(r"\b([EG])_?\W?\w*$|(?i:(young|tensile)|(shear))", found[1])
                if sign:
                    letter = "shear" if sign[1] == "G" or sign[3] else "tension"
                break
    return stated, letter
