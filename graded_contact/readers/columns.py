"""Which column of a table of measurements is which quantity, in which unit."""

import operator
import re
from typing import Any, NamedTuple

import numpy as np

from ..core.display import short
from .decisions import Log, Options, settled
from .other_tables import check_others
from .tables import DataColumn, DataTable, credible, value_above
from .units import DIMENSIONS, PER_SECOND, UNITS, Heading
from .ways import ALL_WAYS, AT_LOAD, Way, way_of, ways_of_kind

_WITH_TANGENT = ("storage loss", "storage_compliance loss_compliance")  # whose ratio is tan delta
# In words that no other kind understands: "Oscillation strain", "strain_dyn_pct".
_STRAIN = re.compile(r"(?i)^(?!.*(?:rate|stat|stress)).*(?:strain|d[eé]formation|dehnung)")
_NO_AMPLITUDE = re.compile(r"(?i)\bcmd\b|command|ratio|constant")  # as TRIOS has beside the strain
ALIKE = 0.02  # columns whose values differ by less are the same
SAME_FREQUENCY = 1e-3  # relative, between frequencies that are meant to be equal


_HZ_ASSUMED = "assumed by its name; if it is not, pass `units={'frequency': 'rad/s'}`"


class Unclear(ValueError):
    """A sweep is there, but some of its columns must be chosen, or need a unit."""


class MeasuredTable(NamedTuple):
    """A table whose columns are understood.

    - `way`: of `ALL_WAYS` or `SWEEPS`.
    - `columns`: those needed, by quantity.
    - `check`: the column of tan delta, if the moduli do without it.
    - `load`: the constant stress of a creep test [Pa], or strain of a relaxation test [1], if no
      column holds it.
    - `table`: the names, and the lines above.
    - `points`: a frame with the line, curve, step, cells and, if the row does not fit the columns,
      number of cells of each point; and in SI units its numbers, by quantity and as "check".
    - `unused`: names of the other columns.
    - `options`: of the user, completed by the format.
    """

    way: Way
    columns: dict[str, DataColumn]
    check: DataColumn | None
    load: float | None
    table: DataTable
    points: Any
    unused: list[str]
    options: Options

    @property
    def log(self) -> Log:
        return self.table.log

    @property
    def num_rows(self) -> int:
        return len(self.points) // self.table.blocks

    @property
    def kind(self) -> str:
        return self.way.kind

    @property
    def abscissa(self) -> str:
        """The quantity that was swept."""
        return self.way.names[0]


def measured_table(table: DataTable, options: Options) -> MeasuredTable:
    """Returns which column of a table is which quantity.

    Raises `ValueError` that names the line, and all arguments that would help.
    """
    if all(map(table.misfit, table.rows)):
        first = f"line {table.rows[0].line} has {table.misfit(table.rows[0])} entries"
        raise ValueError(f"{first}, unlike {table.place} with {table.listed()}")
    stated = {heading.quantity for heading in table.headings}
    if not any(set(way.names) <= stated for way in ALL_WAYS):
        check_others(table, options.columns.values())
    width, numbers = len(table.names), [n for n in options.columns.values() if isinstance(n, int)]
    if table.blocks > 1 and max(numbers, default=0) > width:  # one of the curves side by side
        names, units = table.names * table.blocks, table.units * table.blocks
        table = table._replace(names=names, units=units, blocks=1)
    places = _candidates(table, options)
    if options.temperature is not None:
        places.pop("temperature", None)
    above = [row for segment in {row.segment for row in table.rows} for row in table.above[segment]]
    stress = None if options.kind == "relaxation" else value_above(above, "stress")
    load = stress if options.load is None else options.load
    way = way_of(table, places, load is not None, options)
    beside = {"frequency" if way.kind == "strain" else "temperature"} & set(places)
    needed = {name: places[name] for name in (*way.names, *beside)}
    if len(times := needed.get("time", ())) > 1:
        needed["time"] = [i for i in times if table.headings[i].step] or times
    found = {name: _unrepeated(table, name, needed[name], options) for name in needed}
    columns = {name: each[0] for name, each in found.items() if each[0] is not None}
    lacking = []
    several = {name: needed[name] for name, each in found.items() if len(each) > 1}
    for name, where in several.items():
        lacking.append(f"{' and '.join(map(table.label, where))} may be the {name}")
    if several:
        lacking.append(_how_to_choose(table, several))
    lacking += [
        _unit_needed(table, name, needed[name][0]) for name in needed if name not in columns
    ]
    used = {column.place for column in columns.values()}
    others = [name for i, name in enumerate(table.names) if name and i not in used]
    if lacking:
        abscissa = DataColumn(way.names[0], needed[way.names[0]][0])
        swept = len(np.unique(credible(abscissa.numbers(table.rows)))) > 1
        raise (Unclear if swept else ValueError)(f"{table.place}: {'; '.join(lacking)}")
    _check_reciprocal(columns, options)
    for name, column in columns.items():
        (table.log.assume if column.source == _HZ_ASSUMED else table.log.note)(column.sentence)
        if len(needed[name]) > len(found[name]):
            alike = " and ".join(map(table.label, needed[name]))
            table.log.note(f"{alike} are the same; the first is used.")
    tangents = places.get("tan_delta", []) if way.quantities in _WITH_TANGENT else []
    check = _column(table, "tan_delta", tangents[0], options) if len(tangents) == 1 else None
    points = _points_frame(table, columns | ({"check": check} if check else {}))
    load = load if way in AT_LOAD else None
    return MeasuredTable(way, columns, check, load, table, points, others, options)


def _points_frame(table: DataTable, columns: dict[str, DataColumn]) -> Any:
    """The frame of `MeasuredTable`: a point for each row of each block."""
    import pandas as pd

    width, blocks = len(table.names), range(table.blocks)
    pairs = [(row, block) for row in table.rows for block in blocks]
    entries = {row.line: table.misfit(row) for row in table.rows}
    cells = [
        (row.cells[block * width : (block + 1) * width] + [""] * width)[:width]
        for row, block in pairs
    ]
    points: dict[str, Any] = {
        "line": [row.line for row, _ in pairs],
        "curve": [row.segment * len(blocks) + block for row, block in pairs],
        "step": [row.step for row, _ in pairs],
        "entries": [entries[row.line] for row, _ in pairs],
        "cells": cells,
    }
    for name, column in columns.items():
        points[name] = column.si(each[column.place] for each in cells)
    return pd.DataFrame(points)


def _unit_needed(table: DataTable, name: str, place: int) -> str:
    """How to give the unit of a column, or why the column is not what it was taken for."""
    dimension, unit = _dimension(table, name, place), table.unit(place) or table.units[place]
    stated = f"{unit!r} as unit" if unit else "no known unit"
    start = f"{table.label(place)}, the {name}, has {stated}"
    if _of_another_kind(unit, dimension):
        return f"{start}, which is none of a {dimension}: choose another column by `columns`"
    first, *rest = UNITS[dimension]
    return (
        f"{start}; pass for instance `units={ {dimension: first} }`; others are {', '.join(rest)}"
    )


def _dimension(table: DataTable, quantity: str, place: int) -> str:
    """The dimension of the numbers in a column."""
    return "time" if table.headings[place].period else DIMENSIONS[quantity]


def _of_another_kind(unit: str | None, dimension: str) -> bool:
    """Whether a unit is known, but not one of a dimension."""
    return unit not in UNITS[dimension] and any(unit in units for units in UNITS.values())


def _check_reciprocal(columns: dict[str, DataColumn], options: Options) -> None:
    """Refuses units of a modulus for compliances, and of a compliance for moduli."""
    for given, other in (("modulus", "compliance"), ("compliance", "modulus")):
        used = {column.dimension: column for column in columns.values()}
        if given in options.units and other in used and given not in used:
            option = f"`units={ {given: options.units[given]} }`"
            settled(used[other].label, used[other].unit, options.units[given], option=option,
                    alike=lambda stated, unit: False)  # fmt: skip


def _how_to_choose(table: DataTable, several: dict[str, list[int]]) -> str:
    """How to choose between columns that may be the same quantity."""
    first = {name: where[0] + 1 for name, where in several.items()}
    kinds = {table.headings[place].deformation for where in several.values() for place in where}
    by = " or by `deformation`" * (len(kinds) > 1)
    last = table.blocks * len(table.names)
    curves = f"; numbers up to {last} choose one of {table.blocks} curves" * (table.blocks > 1)
    return f"choose, for instance by `columns={first}`{by}{curves}"


def _candidates(table: DataTable, options: Options) -> dict[str, list[int]]:
    """The columns that may be each quantity, by the options or by the headings."""
    places: dict[str, list[int]] = {}
    for i, heading in enumerate(table.headings):
        if heading.quantity is not None:
            places.setdefault(heading.quantity, []).append(i)
    if options.deformation is not None:
        for quantity, each in places.items():
            named = [i for i in each if table.headings[i].deformation == options.deformation]
            places[quantity] = named or each
    if options.kind == "strain" and "strain" not in places:
        named = [i for i, name in enumerate(table.names) if _STRAIN.search(name)]
        measured = [i for i in named if not _NO_AMPLITUDE.search(table.names[i])]
        places |= {"strain": measured or named} if named else {}
    if not places and not options.columns and options.kind is not None:
        names = ways_of_kind(options.kind)[0].names
        if len(table.names) == len(names):
            places = {quantity: [i] for i, quantity in enumerate(names)}
    for quantity, name in options.columns.items():
        found = [i for i, other in enumerate(table.names) if other == name or i + 1 == name]
        if len(found) != 1:
            same = f"{len(found) or 'no'} columns have that name or number"
            reason = f"`columns` names {short(name)}, but {same}; there are {table.listed()}"
            raise ValueError(f"{table.place}: {reason}")
        settled(table.label(found[0]), _stated_role(table, found[0]), quantity,
                option=f"`columns={ {quantity: name} }`", alike=_alike)  # fmt: skip
        places[quantity] = found
    return places


def _stated_role(table: DataTable, place: int) -> str | None:
    """The quantity that a name states; a letter alone does not: T may be a torque."""
    name, quantity = table.names[place], table.headings[place].quantity
    return quantity if len(re.split(r"[\s\[(/,]", name.strip())[0]) > 1 else None


def _alike(stated: str, given: str) -> bool:
    """Whether a column of one quantity may be that of the other, as their units say."""
    return UNITS[DIMENSIONS[stated]] == UNITS[DIMENSIONS[given]]


def _unrepeated(table: DataTable, quantity: str, places: list[int], options: Options) -> list:
    """The columns of a quantity, without those that repeat the first one."""
    columns = [_column(table, quantity, place, options) for place in places]
    known = [column for column in columns if column]
    if len(known) < max(2, len(columns)) or len({column.deformation for column in known}) > 1:
        return columns
    first, *others = (column.numbers(table.rows) for column in known)
    for other in others:
        both = np.isfinite(first) & np.isfinite(other) & (first != 0)
        if not np.any(both) or np.max(np.abs(other[both] / first[both] - 1)) > ALIKE:
            return columns
    return columns[:1]


def _column(table: DataTable, quantity: str, place: int, options: Options) -> DataColumn | None:
    """The column of a quantity; None if its unit is not known."""
    heading, label = table.headings[place], table.label(place)
    dimension = _dimension(table, quantity, place)
    stated, given = table.unit(place), options.units.get(dimension)
    if given is None:
        unit, source = _unit_in_file(heading, stated or table.units[place], dimension, quantity)
    else:
        unit, source = settled(
            label, stated, given, option=f"`units={ {dimension: given} }`",
            alike=lambda stated, given: not _of_another_kind(stated, dimension),
        ), options.source  # fmt: skip
    if unit is None:
        return None
    deformation = settled(
        label, heading.deformation, options.deformation,
        option=f"`deformation={options.deformation!r}`", alike=operator.eq,
    )  # fmt: skip
    return DataColumn(
        quantity, place, label, unit, source, deformation, heading.base, heading.period
    )


def _unit_in_file(
    heading: Heading, unit: str | None, dimension: str, quantity: str
) -> tuple[str | None, str]:
    """The unit that a file gives a column, and where it comes from; None if it has to be asked."""
    if unit in UNITS[dimension]:
        return unit, "as in the file"
    if dimension == "ratio":
        return "1", "as usual"
    # A cell below the name that is no unit, such as "mPa", may still be meant as one.
    if dimension == "frequency" and unit in ("", None, PER_SECOND) and heading.quantity == quantity:
        return ("rad/s", "by its name") if heading.angular else ("Hz", _HZ_ASSUMED)
    return None, ""
