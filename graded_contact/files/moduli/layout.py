"""Which column of a table of measurements is which quantity, in which unit."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .quantities import (
    DIMENSIONS,
    PER_SECOND,
    UNITS,
    parse_unit,
    tells_of_shear,
)
from .tables import Column, Head, NumberTable, Segment, check_widths, listed, numbers_of
from .titles import stress_above, temperature_above, tension_above

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
    ("relaxation", ("time", "stress", "strain")),
    ("creep", ("time", "strain", "stress")),
    ("relaxation", ("time", "stress")),  # these two where the load is told, or said above
    ("creep", ("time", "strain")),
)
KINDS = tuple(dict.fromkeys(kind for kind, _ in WAYS))
ALIKE = 0.02  # columns whose values differ by less say the same
HELD = 0.05  # what a test holds constant varies by less
SAME = 1e-3  # relative, between frequencies that are meant to be equal


@dataclasses.dataclass(frozen=True)
class Told:
    """What the caller says of a file; None and empty where the file is to tell.

    - `kind`: one of `KINDS`.
    - `columns`: name, or number counted from 1, of the column of a quantity.
    - `units`: unit of a dimension.
    - `deformation`: "tension" or "shear".
    - `temperature`: whether it is told, so that a column of it is not needed.
    - `step`: numbers, or parts of titles, of the steps to read.
    - `held`: the constant stress of a creep test [Pa], the strain of a relaxation test [1].
    - `source`: who tells it, in words.
    """

    kind: str | None
    columns: Mapping[str, str | int]
    units: Mapping[str, str]
    deformation: str | None
    temperature: bool
    step: tuple[str | int, ...] = ()
    held: float | None = None
    source: str = "as told"


class Layout(NamedTuple):
    """A table whose columns are understood.

    - `kind`: one of `KINDS`.
    - `columns`: those needed, by quantity.
    - `check`: the column of tan delta, if the moduli do without it.
    - `held`: the constant stress of a creep test [Pa], or strain of a relaxation test [1], if no
      column holds it.
    - `segments`: its rows.
    - `blocks`: how often the columns are repeated; `width`: columns of a block.
    - `spaced`: whether spaces separate the cells, so that none can be empty.
    - `shear`: the name of another column, which tells of a test in shear.
    - `unused`: names of the other columns.
    - `notes`: what was decided, in sentences.
    """

    kind: str
    columns: dict[str, Column]
    check: Column | None
    held: float | None
    segments: list[Segment]
    blocks: int
    width: int
    spaced: bool
    shear: str | None
    unused: list[str]
    notes: list[str]


def table_layout(table: NumberTable, told: Told, spaced: bool) -> Layout:
    """Returns which column of a table is which quantity.

    Raises `ValueError` that names the line, and all arguments that would settle it.
    """
    head, notes = table.head, []
    check_widths(table, spaced)
    chosen = _chosen(head, told)
    if told.temperature:
        chosen.pop("temperature", None)
    titles = [row for segment in table.segments for row in segment.titles]
    stress = None if told.kind == "relaxation" else stress_above(titles)
    held = stress if told.held is None else told.held
    kind, names = _way(table, chosen, held is not None, told)
    needed = [*names, "temperature"] if "temperature" in chosen else names
    asked: list[str] = []
    columns: dict[str, Column] = {}
    for quantity in needed:
        places = _distinct(table, quantity, chosen[quantity], told, notes)
        if len(places) > 1:
            asked.append(
                f"{' and '.join(map(head.label, places))} may all be the {quantity}. Tell which by "
                f"`columns` (of the {quantity}), or by `deformation`"
            )
        column = _column(head, quantity, places[0], told)
        if column is not None:
            columns[quantity] = column
    asked += _asked_of_units(head, [name for name in needed if name not in columns], chosen)
    used = {column.place for column in columns.values()}
    others = [name for i, name in enumerate(head.names) if name and i not in used]
    shear = next(filter(tells_of_shear, others), None)
    if shear and tension_above(titles) and not any(c.deformation for c in columns.values()):
        asked.append(
            f"the lines above tell of a test in tension or bending, but {shear!r} of one in shear: "
            "pass `deformation`"
        )
    if asked:
        asked += _asked_of_temperature(table, chosen, told)
        raise ValueError(f"{head.place}: {'; '.join(asked)}")
    check = len(chosen.get("tan_delta", [])) == 1 and names == WAYS[0][1]
    return Layout(
        kind=kind,
        columns=columns,
        check=_column(head, "tan_delta", chosen["tan_delta"][0], told) if check else None,
        held=held if names in (("time", "strain"), ("time", "stress")) else None,
        segments=table.segments,
        blocks=head.blocks,
        width=len(head.names),
        spaced=spaced,
        shear=shear,
        unused=others,
        notes=notes,
    )


# Columns and kinds.


def _chosen(head: Head, told: Told) -> dict[str, list[int]]:
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
                f"or number; it has {listed(head)}"
            )
        chosen[quantity] = places
    return chosen


def _distinct(
    table: NumberTable, quantity: str, places: list[int], told: Told, notes: list[str]
) -> list[int]:
    """The places of a quantity, less those that say the same as the first one."""
    head = table.head
    if quantity == "time" and len(places) > 1:
        places = [i for i in places if head.headings[i].step] or places
    if len(places) < 2:
        return places
    columns = [_column(head, quantity, place, told) for place in places]
    if None in columns or len({column.deformation for column in columns if column}) > 1:
        return places
    first, *others = (numbers_of(table.rows, column) for column in columns if column)
    for other in others:
        both = np.isfinite(first) & np.isfinite(other) & (first != 0)
        if not np.any(both) or np.max(np.abs(other[both] / first[both] - 1)) > ALIKE:
            return places
    notes.append(
        f"Of {' and '.join(map(head.label, places))}, which say the same, the first is used."
    )
    return places[:1]


def _way(
    table: NumberTable, chosen: dict[str, list[int]], held: bool, told: Told
) -> tuple[str, tuple[str, ...]]:
    """The kind of measurement and the quantities to take it from."""
    head, have = table.head, set(chosen)
    ways = [way for way in WAYS if told.kind in (None, way[0])]
    possible = [way for way in ways if have.issuperset(way[1])]
    if not held:
        possible = [way for way in possible if way not in WAYS[-2:]]
    kinds = [kind for kind, _ in possible]
    if kinds[:2] != ["relaxation", "creep"]:
        if possible:
            return possible[0]
    elif "modulus" in possible[0][1] and "compliance" in possible[1][1]:
        raise ValueError(f"{head.place}: a modulus and a compliance are there; pass `kind`")
    elif "modulus" in possible[0][1]:
        return possible[0]
    else:
        return _by_what_is_held(table, chosen, possible)
    shortest = {kind: ", ".join(names) for kind, names in reversed(ways)}
    asked = [
        f"of {listed(head)}, understood is {', '.join(sorted(have)) or 'nothing'}. "
        f"Needed: {'; or '.join(reversed(shortest.values()))} (loss may be given by tan_delta or "
        "phase, storage by magnitude, modulus and compliance by stress and strain; a constant "
        "stress also by a line above the table, 'stress: 2 kPa'). Tell by `columns`, a name or "
        "number (from 1) for each"
        + ("" if told.kind or have else ", or by `kind` if they stand in this order")
    ]
    silent = [
        head.label(i) for i in range(len(head.names))
        if not (head.headings[i].unit or parse_unit(head.units[i]))
    ]  # fmt: skip
    if silent and not told.units:
        asked.append(
            f"no unit is said of {', '.join(silent)}: pass `units` too, of those of "
            f"{tuple(UNITS)} that are needed, such as MPa of the modulus"
        )
    asked += _asked_of_temperature(table, chosen, told)
    raise ValueError(f"{head.place}: {'; '.join(asked)}")


def _by_what_is_held(
    table: NumberTable,
    chosen: dict[str, list[int]],
    possible: list[tuple[str, tuple[str, ...]]],
) -> tuple[str, tuple[str, ...]]:
    """Creep at constant stress, or relaxation at constant strain."""
    held = []
    for kind, quantity in (("relaxation", "strain"), ("creep", "stress")):
        place, any_unit = chosen[quantity][0], next(iter(UNITS[DIMENSIONS[quantity]]))
        base = table.head.headings[place].base
        values = numbers_of(table.rows, Column(quantity, "", place, any_unit, "", None, base))
        values = values[values > 0.5 * np.nanmax(values, initial=0)]
        if len(values) and np.mean(np.abs(values / np.median(values) - 1) < HELD) > 0.9:
            held.append(kind)
    if len(held) == 1:
        return next(way for way in possible if way[0] == held[0])
    raise ValueError(
        f"{table.head.place}: of stress and strain, {'both are' if held else 'neither is'} held "
        "constant; pass `kind`, 'relaxation' or 'creep'"
    )


def _column(head: Head, quantity: str, place: int, told: Told) -> Column | None:
    """The column of a quantity; None if its unit is not known."""
    unit, source = _unit(head, quantity, place, told)
    if unit is None:
        return None
    heading = head.headings[place]
    deformation = told.deformation or heading.deformation
    return Column(quantity, head.label(place), place, unit, source, deformation, heading.base)


def _unit(head: Head, quantity: str, place: int, told: Told) -> tuple[str | None, str]:
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
    return None, ""


# What is asked for.


def _asked_of_units(head: Head, quantities: list[str], chosen: dict[str, list[int]]) -> list[str]:
    if not quantities:
        return []
    lacking = []
    for quantity in quantities:
        place = chosen[quantity][0]
        unit = head.headings[place].unit or head.units[place]
        has = f"the unit {unit!r}" if unit else "no unit"
        lacking.append(f"{head.label(place)}, the {quantity}, has {has}")
    dimensions = dict.fromkeys(DIMENSIONS[quantity] for quantity in quantities)
    allowed = "; ".join(f"{dimension}: one of {list(UNITS[dimension])}" for dimension in dimensions)
    return [f"{', '.join(lacking)}. Pass `units`: {allowed}"]


def _asked_of_temperature(
    table: NumberTable, chosen: dict[str, list[int]], told: Told
) -> list[str]:
    if table.curves < 2 or told.temperature or "temperature" in chosen:
        return []
    if all(temperature_above(segment.titles) is not None for segment in table.segments):
        return []
    return [f"{table.curves} curves are there: pass `temperature` [K], one for each"]
