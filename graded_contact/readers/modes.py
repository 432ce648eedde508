"""Tables of modes (τ_i, E_i), (τ_i, g_i): what tells them from a relaxation modulus E(t).

A table is a Prony series if its names say so ("tau", "relaxation time"; "E_i", "g_i"), or if a
column of relaxation times has an infinite one or moduli that rise and fall. If the names may mean
E(t) as well, the table is refused with both meanings.
"""

import functools
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..core.display import short
from ..core.files import Refusal
from ..materials.shift import LAWS, AbstractShift, TabulatedShift
from .cells import Row, Sheet, holds_data, holds_number, is_infinite, is_missing
from .decisions import Log
from .series import Doubt, Modes
from .stated_moduli import AGREE, Statement, agreed, is_statement, statements_in
from .units import UNITS, parse_heading, parse_unit, split_heading

# Names without units, spaces and marks; [ijkn] is an index.
_MODE_NAMES = {
    "time": r"(?:tau|τ|lambda|λ)[ijkn]?|t[ijkn]|\w*relax\w*(?:time|zeit)s?\w*|reltime\w*"
            r"|temps\w*relax\w*|relax\w*temps|timeconst\w*",
    "modulus": r"(?:(?:young'?s?|shear)?modulus)?[EG][ijkn]|modulus[ijkn]|\w*mode\w*modul\w*"
               r"|modul\w*mode\w*|(?:branch|spring|maxwell)\w*modul\w*|\w*strengths?[ijkn]?",
    "ratio": r"(?:g|e|alpha|α|w|p|c)[ijkn](?:prony|p)?|rel(?:ative)?mod\w*|\w*weights?"
             r"|\w*fractions?|(?!poisson)\w*ratios?|pronycoeff\w*",
    "bulk": r"k[ijkn](?:prony|p)?",
    "glassy": r"[EG]0|[EG]inst\w*|(?:instantaneous|glassy|unrelaxed|glasmodul|kurzzeit)\w*",
    "equilibrium": r"[EG](?:inf\w*|∞|eq|e|oo)|(?:equilibrium|longterm|relaxed|rubbery"
                   r"|gleichgewicht|langzeit)\w*",
}  # fmt: skip
_POISSON = re.compile(r"(?i)(?:poisson\S*(?:\s+(?:ratio|number))?|\bnu\b|ν)\s*[=:;,]?\s*(0?\.\d+)")
_LAW = re.compile(r"time-temperature shift (\w+?)(?:Shift)?\(([^)]*)\)")  # of `export_prony`
_REPTATE = re.compile(r"(?i)generated with reptate|^\W*reptate")  # whose modes are in s and Pa
_NUMERIC = re.compile(r"\W*\d")  # a number, with whatever behind it
_EQUILIBRIUM_WORDS = re.compile(  # in the place of an infinite time
    r"(?i)\+?(?:inf\w*|∞|oo|unendlich|eq\w*|gleichgewicht\w*|[ée]quilibre|rubbery|long[- ]?term"
    r"|langzeit)\.?"
)
_TIME_LETTERS = re.compile(r"(?i)tau|τ|lambda|λ|time|zeit|temps|\bt")  # in every name of a time
_LONGEST_MODE_NAME = 60  # characters of a name


class _Name(NamedTuple):
    """What the name of a column says: its kind, its unit, E or G, and of which logarithm."""

    kind: str | None
    sure: bool
    unit: str | None
    deformation: str | None
    base: str | None


def modes_on(sheet: Sheet, doubtful: Doubt) -> Modes | None:
    """Returns the Prony series in the table of a sheet; None if there is none.

    **Arguments:**

    - `sheet`: the rows.
    - `doubtful`: what a table is that may be a relaxation modulus as well; "refused" raises
      `Refusal`.
    """
    first = next(_headings(sheet.rows), None)
    return None if first is None else _modes_below(sheet, *first, doubtful)


def _headings(rows: Sequence[Row]) -> Iterator[tuple[int, list[_Name]]]:
    """The rows that name a time and a modulus or ratio, by their places."""
    data = [holds_data(row) for row in rows]
    for i, row in enumerate(rows):
        # A row of units may stand between names and numbers.
        if data[i] or not any(data[i + 1 : i + 3]) or not _TIME_LETTERS.search(row.text):
            continue
        names = [_mode_name(cell) for cell in row.cells]
        kinds = {name.kind for name in names}
        if "time" in kinds and {"modulus", "ratio"} & kinds:
            yield i, names


@functools.lru_cache(maxsize=512)
def _mode_name(cell: str) -> _Name:
    if len(cell) > _LONGEST_MODE_NAME:
        return _Name(None, False, None, None, None)
    bare, unit, base = split_heading(cell)
    heading, key = parse_heading(cell), re.sub(r"[\s_.{}()\[\]^,-]", "", bare)
    kind = next((kind for kind, names in _MODE_NAMES.items() if re.fullmatch(names, key)), None)
    folded = key if key[:1] in "EGegk" and len(key) <= 4 else key.lower()
    kind = kind or next(
        (kind for kind, names in _MODE_NAMES.items() if re.fullmatch(names, folded)), None
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


def _modes_below(sheet: Sheet, start: int, names: list[_Name], doubtful: Doubt) -> Modes | None:
    """The series of the table whose names are in a row."""
    places = {name.kind: i for i, name in reversed([*enumerate(names)])}
    time, strength = places["time"], places.get("modulus", places.get("ratio", 0))
    ratios = names[strength].kind == "ratio"
    below = sheet.rows[start + 1 :]
    units_below = below[0].cells if not holds_data(below[0]) else []
    rows = list(_mode_rows(below, time, strength))
    faults = {row.line: _fault(row, len(names), time, strength) for row in rows}
    modes = [row for row in rows if not faults[row.line]]
    if not modes:
        return None

    def numbers(place: int) -> list[float]:
        base = {None: None, "10": 10.0, "e": np.e}[names[place].base]
        cells = [_entry(row, place) for row in modes]
        found = [float(c) if holds_number(c) else 0.0 for c in cells]
        if names[place].kind == "time":
            found = [
                np.inf if _is_last(row, time, strength) else value
                for row, value in zip(modes, found, strict=True)
            ]
        return found if base is None else [base**value for value in found]

    def unit(place: int, dimension: str) -> str | None:
        found = names[place].unit or parse_unit("".join(units_below[place : place + 1]))
        return found if found in UNITS[dimension] else None

    times, strengths = numbers(time), numbers(strength)
    if not _is_series(names[time], names[strength], times, strengths, doubtful):
        return None
    if fault := next(filter(None, faults.values()), None):
        raise Refusal(f"it holds a Prony series, but {fault}")
    _check_only_series(sheet, names, numbers, max(row.line for row in modes))
    kept = {row.line for row in modes}
    others = [row for row in sheet.rows if row.line not in kept]
    lines = [row.text for row in others]
    seconds, pascals = unit(time, "time"), None if ratios else unit(strength, "modulus")
    if any(map(_REPTATE.search, lines)):
        seconds, pascals = seconds or "s", pascals or "Pa"
    inside = {row.line for row in below if not row.comment and holds_number(_entry(row, strength))}
    stated = [
        # A number in the column of the moduli has their unit.
        *statements_in(f"{r.text} {pascals or ''}" if r.line in inside else r.text for r in others),
        *(
            Statement(kind, value, unit(place, "modulus"), names[place].deformation, kind)
            for place, name in enumerate(names)
            if (kind := name.kind) in ("glassy", "equilibrium")
            for row, value in zip(modes, numbers(place), strict=True)
            if holds_number(_entry(row, place))
        ),
    ]
    pascals = pascals or next((each.unit for each in stated if each.unit), None)
    letter = None if ratios else names[strength].deformation
    counting = agreed(stated, pascals, letter)
    letters = {kind: each.deformation for kind, each in counting.items() if each.deformation}
    units = {"time": seconds, "modulus": pascals}
    log = Log()
    return Modes(
        f"a table of {len(modes)} relaxation times, line {sheet.rows[start].line}",
        log,
        strengths,
        times,
        ratios,
        numbers(places["bulk"]) if "bulk" in places and ratios else None,
        equilibrium=counting["equilibrium"].value if "equilibrium" in counting else None,
        glassy=counting["glassy"].value if "glassy" in counting else None,
        bare=next((e.words for e in counting.values() if pascals and not e.unit), None),
        letters=letters,
        units={name: unit for name, unit in units.items() if unit is not None},
        deformation=letter or next(iter(letters.values()), None),
        poisson=next((float(n[1]) for line in lines if (n := _POISSON.search(line))), None),
        shift=_shift_law(lines, log),
        lines=lines,
    )


def _shift_law(lines: Sequence[str], log: Log) -> AbstractShift | None:
    """The shift that a CSV of `export_prony` names; one in a table is left out, with a warning."""
    found = next((found for line in lines if (found := _LAW.search(line))), None)
    if found is None:
        return None
    law = LAWS.get(found[1].lower(), TabulatedShift)
    if law is TabulatedShift:
        log.assume("The table of shift factors in the file is left out: take its TOML.")
        return None
    pairs = re.findall(r"(\w+)=([^\s,]+)", found[2])
    return law(**{name: float(value) for name, value in pairs})


def _entry(row: Row, place: int) -> str:
    return row.cells[place] if place < len(row.cells) else ""


def _mode_rows(rows: Sequence[Row], time: int, strength: int) -> Iterator[Row]:
    """The rows of the series, whole or not, up to the names of another table."""
    begun = False
    for i, row in enumerate(rows):
        cells = _entry(row, time), _entry(row, strength)
        units = i == 0 and parse_unit(cells[0]) in UNITS["time"]
        label = not holds_number(cells[0]) and not _EQUILIBRIUM_WORDS.fullmatch(cells[0])
        stated = label and (is_statement(row.text) or _POISSON.search(row.text))
        if row.comment or units or stated:
            continue
        # A row of words between rows of numbers is one of them; other tables stand apart.
        amid = rows[i - 1].line + 1 == row.line and any(map(holds_data, rows[i + 1 : i + 2]))
        words = sum(not is_missing(cell) for cell in row.cells) > 1
        if any(_NUMERIC.match(cell) or is_infinite(cell) for cell in cells) or (
            begun and words and amid
        ):
            begun = True
            yield row
        elif begun and words:
            return


def _fault(row: Row, width: int, time: int, strength: int) -> str | None:
    """Why a row is no relaxation time with a modulus or ratio, None if it is."""
    remedy = "correct it; begin a remark with #, and leave an empty line above another table"
    last = _is_last(row, time, strength)
    for place, what in ((time, "relaxation time"), (strength, "modulus or ratio")):
        cell = _entry(row, place)
        if not holds_number(cell) and not (last and place == time):
            remedy = "write inf for the equilibrium, or " * (place == time) + remedy
            return f"line {row.line} has {short(cell)} as {what}, which is no number: {remedy}"
    if any(map(holds_number, row.cells[width:])):
        return f"line {row.line} has {len(row.cells)} entries under {width} names: {remedy}"
    return None


def _is_last(row: Row, time: int, strength: int) -> bool:
    """Whether a row is that of the equilibrium: by its time, or by its label if it has no time."""
    cells = [_entry(row, time)]
    if is_missing(cells[0]):
        cells += [cell for i, cell in enumerate(row.cells) if i != strength]
    return any(is_infinite(cell) or _EQUILIBRIUM_WORDS.fullmatch(cell) for cell in cells)


def _check_only_series(sheet: Sheet, names: list[_Name], numbers, end: int) -> None:
    """Refuses a second series, beside the first one or below it."""
    remedy = "write one series per file, or one per sheet of a workbook"
    for kind in ("time", "modulus", "ratio", "bulk"):
        places = [i for i, name in enumerate(names) if name.kind == kind]
        units = UNITS["time" if kind == "time" else "modulus"]
        values = [units.get(names[i].unit or "", 1.0) * np.asarray(numbers(i)) for i in places]
        for other, each in zip(places[1:], values[1:], strict=True):
            if not np.allclose(values[0], each, rtol=AGREE, atol=0):
                raise Refusal(
                    f"its columns {places[0] + 1} and {other + 1} are both of a {kind}, with "
                    f"other numbers: {remedy}"
                )
    for i, others in _headings(sheet.rows):
        line = sheet.rows[i].line
        if line > end and any(name.kind == "time" and name.sure for name in others):
            raise Refusal(f"line {line} begins a second Prony series: {remedy}")


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
