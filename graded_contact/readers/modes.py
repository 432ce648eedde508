"""Tables of modes (τ_i, E_i), (τ_i, g_i): what tells them from a relaxation modulus E(t).

A table is a Prony series if its names say so ("tau", "relaxation time"; "E_i", "g_i"), or if a
column of relaxation times has an infinite one or moduli that rise and fall. If the names may mean
E(t) as well, the table is refused with both meanings.
"""

import functools
import re
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..core.files import Refusal
from ..materials.shift import LAWS, TabulatedShift
from .cells import Row, Sheet, holds_data, is_infinite, is_missing, is_number
from .series import Doubt, Series
from .units import UNITS, parse_heading, parse_unit, split_heading

# Names without units, spaces and marks; [ijkn] is an index.
_NAMES = {
    "time": r"(?:tau|τ|lambda|λ)[ijkn]?|t[ijkn]|\w*relax\w*(?:time|zeit)s?\w*|reltime\w*"
            r"|temps\w*relax\w*|relax\w*temps|timeconst\w*",
    "modulus": r"(?:(?:young'?s?|shear)?modulus)?[EG][ijkn]|modulus[ijkn]|\w*mode\w*modul\w*"
               r"|modul\w*mode\w*|(?:branch|spring|maxwell)\w*modul\w*|\w*strengths?[ijkn]?",
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
_LAW = re.compile(r"time-temperature shift (\w+?)(?:Shift)?\(([^)]*)\)")  # of `export_prony`
_REPTATE = re.compile(r"(?i)generated with reptate|^\W*reptate")  # whose modes are in s and Pa


_TIMES = re.compile(r"(?i)tau|τ|lambda|λ|time|zeit|temps|\bt")  # in every name of a time
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
        # A row of units may stand between names and numbers.
        if data[i] or not any(data[i + 1 : i + 3]) or not _TIMES.search(row.text):
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
    places = {name.kind: i for i, name in reversed([*enumerate(names)])}
    time, strength = places["time"], places.get("modulus", places.get("ratio", 0))
    ratios = names[strength].kind == "ratio"
    below = sheet.rows[start + 1 :]
    units_below = below[0].cells if not holds_data(below[0]) else []
    modes = [row for row in _first_table(below) if _is_mode(row, time, strength)]
    if not modes:
        return None

    def numbers(place: int) -> list[float]:
        base = {None: None, "10": 10.0, "e": np.e}[names[place].base]
        cells = [row.cells[place] if place < len(row.cells) else "" for row in modes]
        found = [np.inf if is_infinite(c) else float(c) if is_number(c) else 0.0 for c in cells]
        return found if base is None else [base**value for value in found]

    def unit(place: int, dimension: str) -> str | None:
        found = names[place].unit or parse_unit("".join(units_below[place : place + 1]))
        return found if found in UNITS[dimension] else None

    times, strengths = numbers(time), numbers(strength)
    if not _is_series(names[time], names[strength], times, strengths, doubtful):
        return None
    kept = {row.line for row in modes}
    lines = [row.text for row in sheet.rows if row.line not in kept]
    seconds, pascals = unit(time, "time"), None if ratios else unit(strength, "modulus")
    if any(map(_REPTATE.search, lines)):
        seconds, pascals = seconds or "s", pascals or "Pa"
    stated, pascals, letter = _stated(lines, pascals)
    for kind in {"glassy", "equilibrium"} & set(places):  # it is repeated in every row
        stated[kind] = numbers(places[kind])[0]
        pascals = pascals or unit(places[kind], "modulus")
        letter = letter or names[places[kind]].deformation
    units = {"time": seconds, "modulus": pascals}
    return Series(
        strengths,
        times,
        ratios,
        numbers(places["bulk"]) if "bulk" in places and ratios else None,
        equilibrium=stated.get("equilibrium"),
        glassy=stated.get("glassy"),
        units={name: unit for name, unit in units.items() if unit is not None},
        deformation=letter if ratios else names[strength].deformation or letter,
        poisson=next((float(n[1]) for line in lines if (n := _POISSON.search(line))), None),
        **_law(lines),
        lines=lines,
        layout=f"a table of {len(modes)} relaxation times, line {sheet.rows[start].line}",
    )


def _law(lines: Sequence[str]) -> dict[str, Any]:
    """The shift that a CSV of `export_prony` names; one in a table is left out, with a caveat."""
    found = next((found for line in lines if (found := _LAW.search(line))), None)
    if found is None:
        return {}
    law = LAWS.get(found[1].lower(), TabulatedShift)
    if law is TabulatedShift:
        return {"assumed": ["The table of shift factors in the file is left out: take its TOML."]}
    pairs = re.findall(r"(\w+)=([^\s,]+)", found[2])
    return {"shift": law(**{name: float(value) for name, value in pairs})}


def _first_table(rows: Sequence[Row]) -> Iterator[Row]:
    """The rows up to the names of another table."""
    begun = False
    for row in rows:
        words = sum(not is_number(cell) and not is_missing(cell) for cell in row.cells)
        if begun and words > 1 and not holds_data(row):
            return
        begun |= holds_data(row)
        yield row


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
    if strength.kind == "ratio" or (time.sure and (strength.sure or infinite or rises)):
        return True
    told = infinite or strength.sure
    if doubtful != "refused" or not (time.sure or told):
        return doubtful == "series"
    raise Refusal(
        "its table may be a Prony series (relaxation times and moduli of branches) or a relaxation "
        "modulus E(t): `readers.read_prony` reads a series; for E(t) name the time and the modulus "
        "by `columns`, and leave out a row at an infinite time"
    )


def _stated(
    lines: Sequence[str], unit: str | None
) -> tuple[dict[str, float], str | None, str | None]:
    """The instantaneous and the long-time modulus of lines, their unit, and tension or shear.

    The unit is that of the moduli of the table, if it has one.
    """
    stated, letter = {}, None
    for kind, pattern in _STATED.items():
        found = next((f for line in lines if (f := re.search(f"({pattern}){_NUMBER}", line))), None)
        if found is None:
            continue
        own = parse_unit(found[2] or "") or parse_unit(found[4])
        own = own if own in UNITS["modulus"] else unit
        unit = unit or own
        factor = UNITS["modulus"][own] / UNITS["modulus"][unit] if own and unit else 1.0
        stated[kind] = factor * float(found[3])
        if sign := re.search(r"\b([EG])_?\W?\w*$|(?i:(young|tensile)|(shear))", found[1]):
            letter = "shear" if sign[1] == "G" or sign[3] else "tension"
    return stated, unit, letter
