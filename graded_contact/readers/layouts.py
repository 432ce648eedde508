"""The lines of a text, and the tables that seem to be in them.

Sections are chosen by what is found here, and messages propose it. It decides no number: a line
that does not fit the table is refused by `tables`.
"""

import csv
import itertools
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .units import parse_unit

SPACES = r"\s+"
SEPARATORS = ("\t", ";", ",", SPACES)


class Section(NamedTuple):
    """Lines of numbers below one another, with as many cells each.

    **Fields:**

    - `name`: in the lines above, empty if there is none.
    - `header`: the line of the names of the columns, or the last line above the numbers.
    - `last`: the last line of numbers.
    - `width`: how many cells these lines have.
    - `named`: whether it has a line of names.
    """

    name: str
    header: int
    last: int
    width: int
    named: bool


def text_lines(content: bytes) -> dict[int, str]:
    """Returns the lines of a text by their numbers, without empty ones."""
    code = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = content.decode(code)
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")
    lines = {number: line.strip("\r\n ") for number, line in enumerate(text.split("\n"), start=1)}
    return {number: line for number, line in lines.items() if line.strip()}


def cells_of(line: str, separator: str, decimal: str | None = None) -> list[str]:
    """Returns the cells of a line, with points as decimal marks."""
    if separator in (" ", SPACES):
        row = line.split()
    else:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return pointed([cell.strip() for cell in row], decimal)


def pointed(cells: list[str], decimal: str | None) -> list[str]:
    """Returns cells with points as decimal marks; one between thousands is refused later."""
    if decimal in (None, "."):
        return cells
    return [cell.replace(".", "'").replace(decimal, ".") for cell in cells]


def number_in(cell: str) -> float | None:
    """Returns the number that a cell holds, None for another text."""
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def likely_marks(lines: Mapping[int, str]) -> tuple[str, str]:
    """Returns the separator and the decimal mark with which most lines hold numbers."""
    marks = [(mark, decimal) for mark in SEPARATORS for decimal in ".,"[: 1 + (mark != ",")]]
    first = list(itertools.islice(lines.values(), 200))

    def total(marks: tuple[str, str]) -> int:
        counts = (numbers_in(cells_of(line, *marks)) for line in first)
        return sum(count for count in counts if count >= 2)

    return max(marks, key=total)


def sections_of(lines: Mapping[int, str], separator: str, decimal: str) -> list[Section]:
    """Returns the tables of a text, in order."""
    rows = {number: cells_of(line, separator, decimal) for number, line in lines.items()}

    def width(number: int) -> int:
        return len(rows[number]) if numbers_in(rows[number]) >= 2 else 0

    found: list[Section] = []
    above: list[int] = []
    for size, group in itertools.groupby(rows, key=width):
        run = list(group)
        if size and len(run) > 1:
            found.append(_section(lines, rows, above, run, separator == SPACES))
            above = []
        else:
            above += run
    return _numbered(found)


def likely_layout(lines: Mapping[int, str]) -> dict[str, Any]:
    """Returns options for a text that holds a table among other lines; empty if none is seen."""
    separator, decimal = likely_marks(lines)
    sections = sections_of(lines, separator, decimal)
    spelt = {} if separator == SPACES else {"separator": separator}
    spelt |= {"decimal": ","} if decimal == "," else {}
    if len([section for section in sections if section.name]) > 1:
        return {"section": "...", **spelt}
    if not sections:
        return {}
    section = max(sections, key=lambda section: section.last - section.header)
    found = {"header": section.header, "end": section.last, **spelt}
    usual = {"header": (0, min(lines)), "end": (max(lines),)}  # need not be given
    return {name: each for name, each in found.items() if each not in usual.get(name, ())}


def _section(lines, rows, above: Sequence[int], run: Sequence[int], spaced: bool) -> Section:
    """The table in `run`; `spaced` if its cells have only spaces between them, as words have."""
    head: list[int] = []  # the line of names, and the line of units below it
    for number in reversed(above):
        row = rows[number]
        if len(row) != len(rows[run[0]]) or numbers_in(row) or len(head) == 2:
            break
        head.append(number)
        if not _is_units(row):
            break
    named = bool(head) and any(re.search(r"[^\W\d_]", cell) for cell in rows[head[-1]])
    titles = above[: -len(head)] if named else above
    parts = [[lines[n]] if spaced else [cell for cell in rows[n] if cell] for n in titles]
    name = next((part[-1] for part in reversed(parts) if len(part) < 3), "")
    header = head[-1] if named else above[-1] if above else 0
    return Section(name.lstrip("# "), header, run[-1], len(rows[run[0]]), named)


def _numbered(sections: list[Section]) -> list[Section]:
    """The sections; one without a title is the next of the title before."""
    found: list[Section] = []
    title, count = "", 1
    for section in sections:
        count = 1 if section.name else count + section.named
        title = section.name or title
        unnamed = title and section.named and not section.name
        found.append(section._replace(name=f"{title} #{count}") if unnamed else section)
    return found


def _is_units(cells: Sequence[str]) -> bool:
    """Whether most cells of a line are units."""
    filled = [cell.strip("[]() ") for cell in cells if cell]
    return 2 * sum(parse_unit(cell) is not None for cell in filled) >= max(len(filled), 1)


def numbers_in(cells: Sequence[str]) -> int:
    """Returns how many cells hold numbers."""
    return sum(number_in(cell) is not None for cell in cells)
