"""Which column of a table of measurements is which quantity, in which unit.

A table may repeat its columns side by side, one block for each curve.
"""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

from .cells import Row, Sheet, holds_data, is_missing
from .quantities import DIMENSIONS, PER_SECOND, UNITS, Heading, parse_heading, parse_unit

# The quantities that make a measurement of each kind, the most direct ones first; in the order of
# the first of a kind the columns of a file without telling names are read.
WAYS = (
    ("frequency", ("frequency", "storage", "loss")),
    ("frequency", ("frequency", "storage", "tan_delta")),
    ("frequency", ("frequency", "storage", "phase")),
    ("frequency", ("frequency", "magnitude", "tan_delta")),
    ("frequency", ("frequency", "magnitude", "phase")),
    ("frequency", ("frequency", "loss", "tan_delta")),
    ("frequency", ("frequency", "loss", "phase")),
    ("relaxation", ("time", "modulus")),
    ("creep", ("time", "compliance")),
)
KINDS = tuple(dict.fromkeys(kind for kind, _ in WAYS))


class Column(NamedTuple):
    """A column of a table.

    - `quantity`: a key of `quantities.DIMENSIONS`.
    - `label`: how messages call it.
    - `place`: counted from 0, within a block.
    - `unit`: one of `UNITS` of its dimension.
    - `source`: whence the unit is known.
    - `deformation`: "tension", "shear" or None, as its name says.
    """

    quantity: str
    label: str
    place: int
    unit: str
    source: str
    deformation: str | None


@dataclasses.dataclass(frozen=True)
class Told:
    """What the caller says of a file; None and empty where the file is to tell.

    - `kind`: one of `KINDS`.
    - `columns`: name, or number counted from 1, of the column of a quantity.
    - `units`: unit of a dimension.
    - `deformation`: "tension" or "shear".
    - `temperature`: whether it is told, so that a column of it is not needed.
    - `source`: who tells it, in words.
    """

    kind: str | None
    columns: Mapping[str, str | int]
    units: Mapping[str, str]
    deformation: str | None
    temperature: bool
    source: str = "as told"


class Layout(NamedTuple):
    """A table whose columns are understood.

    - `kind`: one of `KINDS`.
    - `columns`: those needed, by quantity.
    - `check`: the column of tan delta, if the moduli do without it.
    - `data`: rows of numbers; `words`: other rows below the names, left out.
    - `blocks`: how often the columns are repeated; `width`: columns of a block.
    - `titles`: the row above the names, if any.
    - `unused`: labels of the other columns.
    """

    kind: str
    columns: dict[str, Column]
    check: Column | None
    data: list[Row]
    words: list[Row]
    blocks: int
    width: int
    titles: Row | None
    unused: list[str]


class _Head(NamedTuple):
    """Names and units of the columns of one block, and where they stand."""

    place: str
    names: list[str]
    units: list[str]
    headings: list[Heading]
    blocks: int


def understand(sheet: Sheet, told: Told) -> Layout:
    """Returns the table on a sheet, or raises `ValueError` naming the line not understood."""
    start = _header(sheet.rows, told)
    if start is None:
        data, words, titles = [row for row in sheet.rows if holds_data(row)], [], None
        width = max((len(row.cells) for row in data), default=0)
        head = _Head("no line of names", [""] * width, [""] * width, [parse_heading("")] * width, 1)
    else:
        below = sheet.rows[start + 1 :]
        data = [row for row in below if holds_data(row)]
        units = below[0] if below and not holds_data(below[0]) else None
        units = units if units and any(map(parse_unit, units.cells)) else None
        repeated = [row.cells for row in (sheet.rows[start], units) if row]
        words = [row for row in below if not holds_data(row) and row.cells not in repeated]
        titles = sheet.rows[start - 1] if start else None
        head = _head(sheet.rows[start], units)
    if len(data) < 2:
        raise ValueError("no table of numbers is found; rows of at least two numbers are needed")
    _check_widths(head, data, sheet.spaced)
    chosen = _chosen(head, told)
    if told.temperature:
        chosen.pop("temperature", None)
    kind, names = _way(head, set(chosen), told)
    needed = [*names, "temperature"] if "temperature" in chosen else names
    columns = {quantity: _column(head, quantity, chosen[quantity], told) for quantity in needed}
    check = len(chosen.get("tan_delta", [])) == 1 and names == WAYS[0][1]
    used = {column.place for column in columns.values()}
    return Layout(
        kind=kind,
        columns=columns,
        check=_column(head, "tan_delta", chosen["tan_delta"], told) if check else None,
        data=data,
        words=words,
        blocks=head.blocks,
        width=len(head.names),
        titles=titles,
        unused=[name for i, name in enumerate(head.names) if name and i not in used],
    )


def _header(rows: list[Row], told: Told) -> int | None:
    """Where the names of the columns stand: the row that names most quantities."""
    named = {name for name in told.columns.values() if isinstance(name, str)}

    def score(row: Row) -> int:
        quantities = {parse_heading(cell).quantity for cell in row.cells} - {None}
        return len(quantities) + len(named & set(row.cells))

    words = [i for i, row in enumerate(rows) if not holds_data(row)]
    best = max(words, key=lambda i: score(rows[i]), default=None)
    if best is not None and score(rows[best]) >= 2:
        return best
    # Otherwise the last row of words before the numbers.
    first = next((i for i, row in enumerate(rows) if holds_data(row)), 0)
    above = [i for i in words if i < first and len(rows[i].cells) > 1 and not _only_units(rows[i])]
    return above[-1] if above else None


def _only_units(row: Row) -> bool:
    return all(is_missing(cell) or parse_unit(cell) for cell in row.cells)


def _head(row: Row, units: Row | None) -> _Head:
    names = _stripped(row.cells)
    cells = [] if units is None else units.cells
    below = [cells[i] if i < len(cells) else "" for i in range(len(names))]
    columns = list(zip(names, below, strict=True))
    repeats = (
        width
        for width in range(2, len(names))
        if len(names) % width == 0 and columns == columns[:width] * (len(names) // width)
    )
    width = next(repeats, len(names))
    headings = [parse_heading(name) for name in names[:width]]
    return _Head(f"line {row.line}", names[:width], below[:width], headings, len(names) // width)


def _check_widths(head: _Head, data: list[Row], spaced: bool) -> None:
    """Refuses rows whose entries cannot be told to the columns."""
    width = head.blocks * len(head.names)
    for row in data:
        entries = len(_stripped(row.cells))
        # Where spaces separate, a missing entry would move those after it.
        if entries > width or (spaced and entries < width):
            raise ValueError(
                f"line {row.line} has {entries} entries, but there are {width} columns "
                f"({head.place}: {_listed(head)})"
            )


def _stripped(cells: list[str]) -> list[str]:
    """Cells without the empty ones at the end."""
    count = max((i + 1 for i, cell in enumerate(cells) if cell), default=0)
    return cells[:count]


def _chosen(head: _Head, told: Told) -> dict[str, list[int]]:
    """The places at which each quantity stands, as told or as the headings say."""
    chosen: dict[str, list[int]] = {}
    for i, heading in enumerate(head.headings):
        if heading.quantity is not None:
            chosen.setdefault(heading.quantity, []).append(i)
    if told.deformation is not None:
        for quantity, places in chosen.items():
            named = [i for i in places if head.headings[i].deformation == told.deformation]
            chosen[quantity] = named or places
    if not chosen and not told.columns and told.kind is not None:
        names = next(names for kind, names in WAYS if kind == told.kind)
        if len(head.names) == len(names):
            chosen = {quantity: [i] for i, quantity in enumerate(names)}
    for quantity, name in told.columns.items():
        places = [i for i, other in enumerate(head.names) if other == name or i + 1 == name]
        if len(places) != 1:
            count = f"{len(places)} columns" if places else "no column"
            raise ValueError(
                f"{head.place}: `columns` asks for {name!r}, but the file has {count} of that name "
                f"or number; it has {_listed(head)}"
            )
        chosen[quantity] = places
    return chosen


def _way(head: _Head, have: set[str], told: Told) -> tuple[str, tuple[str, ...]]:
    """The kind of measurement and the quantities to take it from."""
    ways = [way for way in WAYS if told.kind in (None, way[0])]
    possible = [way for way in ways if have.issuperset(way[1])]
    if [kind for kind, _ in possible] == ["relaxation", "creep"]:
        raise ValueError(f"{head.place}: a modulus and a compliance are there; pass `kind`")
    if possible:
        return possible[0]
    shortest = {kind: ", ".join(names) for kind, names in reversed(ways)}
    raise ValueError(
        f"{head.place}: of {_listed(head)}, understood is {', '.join(sorted(have)) or 'nothing'}. "
        f"Needed: {'; or '.join(reversed(shortest.values()))} (loss may be given by tan_delta or "
        "phase, storage by magnitude). Tell by `columns`, a name or number (from 1) for each"
        + ("" if told.kind or have else ", or by `kind` if they stand in this order")
    )


def _column(head: _Head, quantity: str, places: list[int], told: Told) -> Column:
    if len(places) > 1:
        names = " and ".join(f"column {i + 1} ({head.names[i]})" for i in places)
        raise ValueError(
            f"{head.place}: {names} may all be the {quantity}. Tell which by "
            f"`columns={{'{quantity}': ...}}`, or by `deformation`"
        )
    (place,) = places
    heading, name = head.headings[place], head.names[place]
    label = f"column {place + 1} ({name})" if name else f"column {place + 1}"
    unit, source = _unit(head, quantity, place, label, told)
    deformation = told.deformation or heading.deformation
    return Column(quantity, label, place, unit, source, deformation)


def _unit(head: _Head, quantity: str, place: int, label: str, told: Told) -> tuple[str, str]:
    dimension = DIMENSIONS[quantity]
    if dimension in told.units:
        return told.units[dimension], told.source
    heading, below = head.headings[place], head.units[place]
    unit = heading.unit or parse_unit(below)
    if unit in UNITS[dimension]:
        return unit, "as the file says"
    if dimension == "ratio":
        return "1", "as usual"
    silent = unit == PER_SECOND or not (unit or below)
    if dimension == "frequency" and silent and heading.quantity == quantity:
        return ("rad/s" if heading.angular else "Hz"), "by its name"
    has = f"the unit {unit or below!r}" if (unit or below) else "no unit"
    raise ValueError(
        f"{head.place}: {label}, the {quantity}, has {has}. Pass `units={{'{dimension}': ...}}`, "
        f"one of {list(UNITS[dimension])}"
    )


def _listed(head: _Head) -> str:
    if any(head.names):
        return "the columns " + ", ".join(repr(name) for name in head.names)
    return f"{len(head.names)} columns without names"
