"""Which column of a table of measurements is which quantity, in which unit."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..core.display import short
from .cells import Row, stripped
from .tables import Column, Table, stress_above, temperature_above, tension_above
from .units import DIMENSIONS, PER_SECOND, UNITS, implies_shear, parse_unit

# The quantities that make a measurement of each kind, the most direct ones first; in the order of
# the first of a kind the columns of a file without names are read.
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
    ("relaxation", ("time", "stress")),  # these two if the constant load is known
    ("creep", ("time", "strain")),
)
SWEEPS = tuple(("strain", ("strain", *way[1:])) for kind, way in WAYS if kind == "frequency")
# In words that no other kind understands: "Oscillation strain", "strain_dyn_pct".
_STRAIN = re.compile(r"(?i)^(?!.*(?:rate|stat|stress)).*(?:strain|d[eé]formation|dehnung)")
ALIKE = 0.02  # columns whose values differ by less are the same
CONSTANT = 0.05  # what a test holds constant varies by less
SAME = 1e-3  # relative, between frequencies that are meant to be equal


@dataclasses.dataclass(frozen=True)
class Options:
    """The arguments of the caller, which override the file; None and empty where the file decides.

    - `kind`: a kind of `WAYS`, or "strain".
    - `columns`: name, or number counted from 1, of the column of a quantity.
    - `units`: unit of a dimension.
    - `deformation`: "tension" or "shear".
    - `temperature`: whether it is given, so that a column of it is not needed.
    - `step`: numbers, or parts of titles, of the steps to read.
    - `load`: the constant stress of a creep test [Pa], the strain of a relaxation test [1].
    - `source`: where these come from, in words.
    """

    kind: str | None
    columns: Mapping[str, str | int]
    units: Mapping[str, str]
    deformation: str | None
    temperature: bool
    step: tuple[str | int, ...] = ()
    load: float | None = None
    source: str = "as given in `units`"


class MeasuredTable(NamedTuple):
    """A table whose columns are understood.

    - `kind`: a kind of `WAYS`.
    - `columns`: those needed, by quantity.
    - `check`: the column of tan delta, if the moduli do without it.
    - `load`: the constant stress of a creep test [Pa], or strain of a relaxation test [1], if no
      column holds it.
    - `table`: its rows.
    - `spaced`: whether spaces separate the cells, so that none can be empty.
    - `shear`: the name of another column, which only a test in shear has.
    - `unused`: names of the other columns.
    - `notes`: what was decided, in sentences.
    """

    kind: str
    columns: dict[str, Column]
    check: Column | None
    load: float | None
    table: Table
    spaced: bool
    shear: str | None
    unused: list[str]
    notes: list[str]

    def numbers(self, quantity: str, rows: list[Row]) -> np.ndarray:
        """Returns the numbers of a quantity in SI units, NaN where there is none."""
        return self.columns[quantity].numbers(rows)


def measured_table(table: Table, options: Options, spaced: bool) -> MeasuredTable:
    """Returns which column of a table is which quantity.

    Raises `ValueError` that names the line, and all arguments that would help.
    """
    _check_widths(table, spaced)
    notes: list[str] = []
    chosen = _chosen(table, options)
    if options.temperature:
        chosen.pop("temperature", None)
    titles = [row for segment in table.segments for row in segment.titles]
    stress = None if options.kind == "relaxation" else stress_above(titles)
    load = stress if options.load is None else options.load
    kind, names = _way(table, chosen, load is not None, options)
    beside = {"frequency", "temperature"} if kind == "strain" else {"temperature"}
    needed = [*names, *sorted(beside & set(chosen))]
    lacking: list[str] = []
    columns: dict[str, Column] = {}
    for quantity in needed:
        places = _distinct(table, quantity, chosen[quantity], options, notes)
        if len(places) > 1:
            lacking.append(
                f"{' and '.join(map(table.label, places))} may all be the {quantity}. Choose one "
                f"by `columns` (of the {quantity}), or by `deformation`"
            )
        column = _column(table, quantity, places[0], options)
        if column is not None:
            columns[quantity] = column
    lacking += _lacking_units(table, [name for name in needed if name not in columns], chosen)
    used = {column.place for column in columns.values()}
    others = [name for i, name in enumerate(table.names) if name and i not in used]
    shear = next(filter(implies_shear, others), None)
    if shear and tension_above(titles) and not any(c.deformation for c in columns.values()):
        lacking.append(
            f"the lines above name a test in tension or bending, but only a test in shear has a "
            f"column {shear!r}: pass `deformation`"
        )
    if lacking:
        lacking += _lacking_temperature(table, chosen, options)
        raise ValueError(f"{table.place}: {'; '.join(lacking)}")
    tangents = chosen.get("tan_delta", []) if names[1:] == WAYS[0][1][1:] else []
    return MeasuredTable(
        kind=kind,
        columns=columns,
        check=_column(table, "tan_delta", tangents[0], options) if len(tangents) == 1 else None,
        load=load if len(names) == 2 else None,
        table=table,
        spaced=spaced,
        shear=shear,
        unused=others,
        notes=notes,
    )


def misfit(row: Row, width: int, spaced: bool) -> int:
    """Returns the number of entries of a row if these cannot be assigned to columns, else 0."""
    entries = len(stripped(row.cells))
    # Where spaces separate, a missing entry would move those after it.
    return entries if entries > width or (spaced and entries < width) else 0


def _check_widths(table: Table, spaced: bool) -> None:
    """Raises `ValueError` if no row can be assigned to the columns."""
    width = table.blocks * len(table.names)
    entries = [misfit(row, width, spaced) for row in table.rows]
    if all(entries):
        raise ValueError(
            f"line {table.rows[0].line} has {entries[0]} entries, but there are {width} columns "
            f"({table.place}: {table.listed()})"
        )


# Columns and kinds.


def _chosen(table: Table, options: Options) -> dict[str, list[int]]:
    """The places of each quantity, by the options or by the headings."""
    chosen: dict[str, list[int]] = {}
    for i, heading in enumerate(table.headings):
        if heading.quantity is not None:
            chosen.setdefault(heading.quantity, []).append(i)
    if options.deformation is not None:
        for quantity, places in chosen.items():
            named = [i for i in places if table.headings[i].deformation == options.deformation]
            chosen[quantity] = named or places
    if options.kind == "strain" and "strain" not in chosen:
        named = [i for i, name in enumerate(table.names) if _STRAIN.search(name)]
        chosen |= {"strain": named} if named else {}
    if not chosen and not options.columns and options.kind is not None:
        names = _ways(options.kind)[0][1]
        if len(table.names) == len(names):
            chosen = {quantity: [i] for i, quantity in enumerate(names)}
    for quantity, name in options.columns.items():
        places = [i for i, other in enumerate(table.names) if other == name or i + 1 == name]
        if len(places) != 1:
            count = f"{len(places)} columns" if places else "no column"
            raise ValueError(
                f"{table.place}: `columns` names {short(name)}, but the file has {count} of "
                f"that name or number; it has {table.listed()}"
            )
        chosen[quantity] = places
    return chosen


def _distinct(
    table: Table, quantity: str, places: list[int], options: Options, notes: list[str]
) -> list[int]:
    """The places of a quantity, without those that repeat the first one."""
    if quantity == "time" and len(places) > 1:
        places = [i for i in places if table.headings[i].step] or places
    columns = [_column(table, quantity, place, options) for place in places]
    if len(places) < 2 or len({column and column.deformation for column in columns}) > 1:
        return places
    if None in columns:
        return places
    first, *others = (column.numbers(table.rows) for column in columns if column)
    for other in others:
        both = np.isfinite(first) & np.isfinite(other) & (first != 0)
        if not np.any(both) or np.max(np.abs(other[both] / first[both] - 1)) > ALIKE:
            return places
    notes.append(f"{' and '.join(map(table.label, places))} are the same; the first is used.")
    return places[:1]


def _ways(kind: str | None) -> Sequence[tuple[str, tuple[str, ...]]]:
    return SWEEPS if kind == "strain" else [way for way in WAYS if kind in (None, way[0])]


def _way(
    table: Table, chosen: dict[str, list[int]], loaded: bool, options: Options
) -> tuple[str, tuple[str, ...]]:
    """The kind of measurement and the quantities to take it from."""
    ways = _ways(options.kind)
    possible = [way for way in ways if set(chosen).issuperset(way[1])]
    if not loaded:
        possible = [way for way in possible if way not in WAYS[-2:]]
    if not possible:
        raise ValueError(_unknown(table, chosen, options, ways))
    if [kind for kind, _ in possible[:2]] != ["relaxation", "creep"]:
        return possible[0]
    if "modulus" not in possible[0][1]:
        return _by_constant_load(table, chosen, possible)
    if "compliance" in possible[1][1]:
        raise ValueError(f"{table.place}: it has a modulus and a compliance; pass `kind`")
    return possible[0]


def _by_constant_load(
    table: Table, chosen: dict[str, list[int]], possible: list[tuple[str, tuple[str, ...]]]
) -> tuple[str, tuple[str, ...]]:
    """Creep at constant stress, or relaxation at constant strain."""
    constant = []
    for kind, quantity in (("relaxation", "strain"), ("creep", "stress")):
        place, any_unit = chosen[quantity][0], next(iter(UNITS[DIMENSIONS[quantity]]))
        base = table.headings[place].base
        values = Column(quantity, "", place, any_unit, "", None, base).numbers(table.rows)
        values = values[values > 0.5 * np.nanmax(values, initial=0)]
        if len(values) and np.mean(np.abs(values / np.median(values) - 1) < CONSTANT) > 0.9:
            constant.append(kind)
    if len(constant) == 1:
        return next(way for way in possible if way[0] == constant[0])
    raise ValueError(
        f"{table.place}: of stress and strain, {'both are' if constant else 'neither is'} "
        "constant; pass `kind`, 'relaxation' or 'creep'"
    )


def _column(table: Table, quantity: str, place: int, options: Options) -> Column | None:
    """The column of a quantity; None if its unit is not known."""
    unit, source = _unit(table, quantity, place, options)
    if unit is None:
        return None
    heading = table.headings[place]
    deformation = options.deformation or heading.deformation
    return Column(quantity, table.label(place), place, unit, source, deformation, heading.base)


def _unit(table: Table, quantity: str, place: int, options: Options) -> tuple[str | None, str]:
    dimension = DIMENSIONS[quantity]
    if dimension in options.units:
        return options.units[dimension], options.source
    heading, below = table.headings[place], table.units[place]
    unit = heading.unit or parse_unit(below)
    if unit in UNITS[dimension]:
        return unit, "as in the file"
    if dimension == "ratio":
        return "1", "as usual"
    absent = unit == PER_SECOND or not (unit or below)
    if dimension == "frequency" and absent and heading.quantity == quantity:
        return ("rad/s" if heading.angular else "Hz"), "by its name"
    return None, ""


# What is lacking.


def _unknown(table: Table, chosen: dict[str, list[int]], options: Options, ways) -> str:
    shortest = {kind: ", ".join(names) for kind, names in reversed(ways)}
    known = f"; understood: {', '.join(sorted(chosen)) or 'none'}" if any(table.names) else ""
    lacking = [
        f"it has {table.listed()}{known}. "
        f"Needed: {'; or '.join(reversed(shortest.values()))} (tan_delta or phase can replace "
        "loss, magnitude can replace storage, stress and strain can replace modulus and "
        "compliance; a constant stress may also be in a line above the table, 'stress: 2 kPa'). "
        "Name them by `columns`, a name or number (from 1) for each"
        + ("" if options.kind or chosen else ", or by `kind` if they are in this order")
    ]
    without = [
        table.label(i) for i in range(len(table.names))
        if not (table.headings[i].unit or parse_unit(table.units[i]))
    ]  # fmt: skip
    if without and not options.units:
        lacking.append(
            f"{', '.join(without)} {'have' if len(without) > 1 else 'has'} no known unit: pass "
            f"`units` too, those of {tuple(UNITS)} that are needed, such as MPa of the modulus"
        )
    return f"{table.place}: {'; '.join(lacking + _lacking_temperature(table, chosen, options))}"


def _lacking_units(table: Table, quantities: list[str], chosen: dict[str, list[int]]) -> list[str]:
    if not quantities:
        return []
    lacking = []
    for quantity in quantities:
        place = chosen[quantity][0]
        unit = table.headings[place].unit or table.units[place]
        has = f"the unit {unit!r}" if unit else "no known unit"
        lacking.append(f"{table.label(place)}, the {quantity}, has {has}")
    dimensions = dict.fromkeys(DIMENSIONS[quantity] for quantity in quantities)
    allowed = "; ".join(f"{dimension}: one of {list(UNITS[dimension])}" for dimension in dimensions)
    return [f"{', '.join(lacking)}. Pass `units`: {allowed}"]


def _lacking_temperature(table: Table, chosen: dict[str, list[int]], options: Options) -> list[str]:
    curves = table.blocks * len(table.segments)
    if curves < 2 or options.temperature or "temperature" in chosen:
        return []
    if all(temperature_above(segment.titles) is not None for segment in table.segments):
        return []
    return [f"it has {curves} curves: pass `temperature` [K], one for each"]
