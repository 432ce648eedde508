"""What the lines above heights state: the units of lengths and heights, and which column is which.

A unit counts for what is named before it: "x, y [mm]; z [um]". Without a name ("unit: um"), it
counts for all numbers.
"""

import re
from typing import NamedTuple

from .cells import Row
from .units import length_unit, metres

# Of a header that are looked at, and characters of a cell.
HEADER_ROWS, HEADER_CELLS, LONGEST_HEADING = 100, 50, 200
_Z_WORDS = r"height\w*|höhe\w*|hoehe|z|values?|werte?|topograph\w*|depth|tiefe|elevation|hauteur"
_LENGTHS = r"width|length|size|pixel|step|spacing|lateral|area|range|axes|[xy]|distance|position"
_OF_HEIGHTS = re.compile(rf"(?<![^\W_])({_Z_WORDS})(?![^\W_])", re.I)
_OF_LENGTHS = re.compile(rf"(?<![^\W_])({_LENGTHS})s?(?![^\W_])", re.I)
_XY = re.compile(r"(?<![^\W_])[xy](?![^\W_])", re.I)
_OF_ALL = re.compile(r"(?<![^\W_])(units?|einheit(en)?|all|alle)(?![^\W_])", re.I)
# One thing is said between these.
_CUTS = re.compile(r"[;|\\]|,(?=\s*[^\W\d])|\s(?:/|and|und|et)\s|(?<=[\])])|\s(?=[xyz]_)", re.I)
_BRACKETED = re.compile(r"\[\s*([^\[\]]*?)\s*\]\s*[.:;,]*$|\(\s*([^()]*?)\s*\)\s*[.:;,]*$")
_COUNTS = {
    "px", "pixel", "pixels", "pt", "pts", "point", "points", "#", "index", "sample", "samples",
}  # fmt: skip
# Units of other kinds; in square brackets any word is a unit.
_OTHER_UNITS = {
    "v", "mv", "µv", "a", "na", "pa", "n", "mn", "nn", "hz", "khz", "deg", "°", "rad", "s", "ms",
    "min", "a.u.", "au", "arb. units", "arb", "%", "counts", "bit", "°c", "k",
}  # fmt: skip

# Names of columns without their units, by what they are.
_ROLES = {
    "x": r"x([ _-]?(pos|position|coord|coordinate|axis|value|dist|distance))?|pos|position|"
    r"((lateral|scan|profile|track|traverse) ?)?(distance|length|position)|lateral|weg|strecke|"
    r"abstand|messweg|abscissa",
    "y": r"y([ _-]?(pos|position|coord|coordinate|axis|value))?",
    "z": r"z([ _-]?(pos|position|coord|coordinate|axis|value|height))?|h|heights?|höhe|hoehe|"
    r"depth|tiefe|topography|elevation|profile|profil|(surface |profile )?height|hauteur",
    "index": r"|#|index|idx|i|n|no\.?|nr\.?|row|point|punkt|sample|unnamed: ?\d+|id|number|zeile",
}


class Units(NamedTuple):
    """The units that a header states; None where it is silent.

    - `heights`, `lengths`: of lengths, or of another kind, as "V".
    - `shared`: a unit whose numbers are not named, as in "unit: um".
    """

    heights: str | None = None
    lengths: str | None = None
    shared: str | None = None

    @property
    def of_heights(self) -> str | None:
        """The stated unit of heights, of all numbers if that is all."""
        return self.heights or self.shared

    @property
    def of_lengths(self) -> str | None:
        """The stated unit of positions, of all numbers if that is all."""
        return self.lengths or self.shared


def counts_points(unit: str | None) -> bool:
    """Whether positions in this unit are counters of points."""
    return unit is not None and unit.lower() in _COUNTS


def stated_unit(heading: str) -> str | None:
    """Returns the unit at the end of a heading, of a length or of another kind; or None."""
    heading = heading.strip()[-LONGEST_HEADING:]
    if (unit := length_unit(heading)) is not None:
        return unit
    found = _BRACKETED.search(heading)
    if found is None:
        return None
    square, round_ = found.groups()
    if square is not None:
        return square if re.search(r"[^\W\d_]|[°%#]", square) else None
    return round_ if round_.lower() in _OTHER_UNITS | _COUNTS else None


def units_of_columns(header: list[Row], width: int) -> list[str | None]:
    """Returns the unit of each column, from the last two rows above with a cell for each."""
    units: list[str | None] = [None] * width
    rows = [row.cells for row in header[-2:] if len(row.cells) == width]
    for cells in rows:
        found = [stated_unit(cell) for cell in cells]
        if cells is not rows[0]:  # a row of units alone
            found = [u or (c if c.lower() in _OTHER_UNITS | _COUNTS else None)
                     for u, c in zip(found, cells, strict=True)]  # fmt: skip
        units = [unit or old for unit, old in zip(found, units, strict=True)]
    return units


def units_above(header: list[Row]) -> Units:
    """Returns the units that rows above numbers state, as `units_in`."""
    lines = []
    for row in header[-HEADER_ROWS:]:
        cells = [cell[:LONGEST_HEADING] for cell in row.cells[:HEADER_CELLS] if cell]
        # Cells of one word may have been separated by spaces.
        lines.append((", " if any(" " in cell for cell in cells) else " ").join(cells))
    return units_in(lines)


def units_in(lines: list[str]) -> Units:
    """Returns the units that lines of text state; what they contradict counts as not stated."""
    found: dict[str, set[str]] = {"heights": set(), "lengths": set(), "shared": set()}
    for line in lines:
        named: set[str] = set()
        for part in _CUTS.split(line):
            named |= {"lengths"} if _OF_LENGTHS.search(part) else set()
            named |= {"heights"} if _OF_HEIGHTS.search(part) else set()
            unit = stated_unit(part)
            if unit is None or _is_value(part, unit):
                continue
            bare = len(part.strip(" []().:;,")) == len(unit)
            # "x y z [um]", but neither "range of z [um]" nor "x_mm z_um".
            if len(named) == 1 or (_XY.search(line) and _num_units(part) == 1):
                for name in named:
                    found[name].add(unit)
            if not named and (bare or _OF_ALL.search(part)):
                found["shared"].add(unit)
            named = set()
    return Units(
        **{name: units.pop() if len(units) == 1 else None for name, units in found.items()}
    )


def _num_units(part: str) -> int:
    return len({metres(word) for word in re.split(r"[\W_]+", part) if metres(word)})


def _is_value(part: str, unit: str) -> bool:
    """Whether a number stands before the unit, as in "Height: 10 um", which is a size."""
    return re.search(rf"\d\s*[\[(]?\s*{re.escape(unit)}[\])]?\s*[.:;,]*$", part, re.I) is not None


def roles_of(names: list[str]) -> list[str | None]:
    """Returns "x", "y", "z" or "index" for each name of a column, None for other names."""
    return [_role(name[:LONGEST_HEADING]) for name in names[:HEADER_CELLS]]


def bare_name(name: str) -> str:
    """Returns a name of a column in lower case, without its unit."""
    name, unit = name.rstrip(" .:;,"), stated_unit(name)
    if unit is not None and name.endswith(tuple("])>}")):
        name = re.sub(r"[\[(<{][^\[(<{]*$", "", name)
    elif unit is not None:
        name = re.sub(r"\s+in\s*$", "", name[: -len(unit)])
    return name.strip(" _/:,=").lower()


def _role(name: str) -> str | None:
    names = bare_name(name), re.sub(r"\s*\(.*\)$", "", bare_name(name))  # "Height (measured)"
    return next(
        (role for role, words in _ROLES.items() for each in names if re.fullmatch(words, each)),
        None,
    )


def same_unit(one: str, other: str) -> bool:
    """Whether two units of length are equal, such as "um" and "µm"."""
    return metres(one) == metres(other)
