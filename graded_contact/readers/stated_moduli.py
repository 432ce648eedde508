"""The instantaneous and the long-time modulus that lines of a file state, in their words."""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from ..core.files import Refusal
from .units import UNITS, parse_unit

AGREE = 0.01  # relative: how far two statements of one number differ by their digits

_NUMBER_BEHIND = (
    r"\s*(?:[\[(]([^\])]*)[\])])?\s*[=:;,≈~]?\s*"
    r"([-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\s,;)]*)"
)
_MODUL = r"(?:[-_ ]?(?:young['’]?s?|shear|tensile))?[-_ ]?modul\w*(?:[-_ ,]*\(?[EG]_?\w*\)?)?"
_WORDS_AFTER = r"(?:[-_ ]?(?:E|G|schub|elastizitäts))?-?modul\w*"  # in German
_PATTERNS = {
    "glassy": rf"(?:\b[EG]_?0\b|(?i:\b(?:instantaneous|glassy|unrelaxed|short[- ]?term){_MODUL}"
              rf"|\b(?:glas|kurzzeit|moment\w*|anfangs|instantan\w*){_WORDS_AFTER}"
              r"|\bmodule\s+(?:instantan[ée]|vitreux|non[- ]relax[ée]|initial|à court terme)))",
    "equilibrium": r"(?:\b[EG]_?\{?(?:inf(?:ty|inity)?|∞|oo|eq|e)\}?(?!\w)|(?i:\b(?:equilibrium|"
                   rf"long[- ]?(?:term|time)|relaxed|rubbery)(?:{_MODUL}|[- ]plateau)?"
                   rf"|\b(?:gleichgewichts|langzeit|gummi(?:plateau)?){_WORDS_AFTER}"
                   r"|\bgummiplateau\b|\bplateau caoutchouti\w*"
                   r"|\bmodule\s+(?:[àa] l['’]\s?[ée]quilibre|d['’]\s?[ée]quilibre|relax[ée]"
                   r"|caoutchouti\w*|(?:à|a|de) long terme)))",
}  # fmt: skip
_STATEMENTS = {kind: re.compile(f"({words}){_NUMBER_BEHIND}") for kind, words in _PATTERNS.items()}
_LETTER = re.compile(
    r"\b([EG])_?\{?(?:0|inf(?:ty|inity)?|∞|oo|eq|e)?\}?\)?$|(?i:(young|tensile)|(shear|schub))"
)


class Statement(NamedTuple):
    """A modulus that a line states: its kind, number, unit, tension or shear, and the words."""

    kind: str
    value: float
    unit: str | None
    deformation: str | None
    words: str


def statements_in(lines: Iterable[str]) -> Iterator[Statement]:
    """Yields what lines state; raises `Refusal` for a number that may be read in two ways."""
    for line in lines:
        for kind, pattern in _STATEMENTS.items():
            for found in pattern.finditer(line):
                if found[4][:1].isdecimal() or re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}", found[3]):
                    raise Refusal(
                        f"{found[0]!r}: are its digits one number? Write it with a decimal point"
                    )
                own = parse_unit(found[2] or "") or parse_unit(found[4])
                letter = _LETTER.search(found[1])
                shear = letter and (letter[1] == "G" or letter[3])
                yield Statement(
                    kind, float(found[3].replace(",", ".")),
                    own if own in UNITS["modulus"] else None,
                    None if letter is None else "shear" if shear else "tension", found[0].strip(),
                )  # fmt: skip


def is_statement(line: str) -> bool:
    """Whether a line states a modulus."""
    return any(pattern.search(line) for pattern in _STATEMENTS.values())


def agreed(
    stated: Iterable[Statement], unit: str | None, deformation: str | None
) -> dict[str, Statement]:
    """Returns one statement of each kind, in a unit; raises `Refusal` if two contradict.

    Of statements in tension and in shear, that of the deformation of the table counts.
    """
    found: dict[str, Statement] = {}
    for each in sorted(stated, key=lambda each: each.deformation != deformation):
        if each.unit and unit:
            factor = UNITS["modulus"][each.unit] / UNITS["modulus"][unit]
            each = each._replace(value=factor * each.value)
        first = found.setdefault(each.kind, each)
        if first.deformation == each.deformation and differ(first.value, each.value):
            raise Refusal(f"it states {first.words!r} and {each.words!r}, which contradict")
    return found


def differ(first: float, second: float) -> bool:
    """Whether two numbers differ by more than their digits."""
    return abs(first - second) > AGREE * max(abs(first), abs(second))
