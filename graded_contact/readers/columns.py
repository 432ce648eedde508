"""Which column of a table is which quantity, in which unit; one error for all that is missing."""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .tables import DataColumn, DataTable
from .units import UNITS

_DEFORMATIONS = {"E": "tension", "D": "tension", "G": "shear", "J": "shear"}
_WORDS = {"shear": "shear", "tens": "tension", "young": "tension"}


class Heading(NamedTuple):
    """The headings of a quantity, and its dimension.

    **Fields:**

    - `dimension`: in `UNITS`.
    - `names`: a pattern. Names are compared without spaces, dots and underscores, exactly and then
      in small letters.
    - `unit`: if none is stated or given; None asks for one.
    """

    dimension: str
    names: str
    unit: str | None = None


class Understood(NamedTuple):
    """A table whose columns are known.

    **Fields:**

    - `table`: as read.
    - `way`: the quantities that are used.
    - `columns`, `units`: of each quantity.
    - `numbers`: of each quantity in SI units, NaN for empty cells.
    - `deformation`: "tension" or "shear", None for other tables.
    - `told`: how the columns were understood.
    """

    table: DataTable
    way: tuple[str, ...]
    columns: dict[str, DataColumn]
    units: dict[str, str]
    numbers: dict[str, np.ndarray]
    deformation: str | None
    told: str


def understood(
    table: DataTable,
    quantities: Mapping[str, Heading],
    ways: Sequence[tuple[str, ...]],
    *,
    also: Sequence[str] = (),
    deformation: str | None = None,
    deformed: bool = True,
) -> Understood:
    """Returns the numbers of the first way whose quantities the table has.

    **Arguments:**

    - `table`: with the options `columns` and `units` of its source: the name, or the number from 1,
      of the column of a quantity, and the unit of a dimension, where the file states none.
    - `quantities`: that a table may hold.
    - `ways`: quantities that are enough, the best first.
    - `also`: quantities that are read if they are there.
    - `deformation`: "tension" or "shear"; asked for if moduli are `deformed` and no name says it.

    **Raises:** `NotPlain`, with all that is missing.
    """
    search = _Search(table, quantities)
    way, found = search.columns_of(ways, also)
    units = search.units_of(found)
    whose = search.deformation_of(way, found, deformation) if deformed else None
    if logarithms := [c.label for c in found.values() if re.match(r"(?i)log|ln\b", c.name)]:
        search.reasons.append(f"{' and '.join(logarithms)} hold logarithms: write the numbers")
    if search.reasons:
        raise table.not_plain(search.reasons, **search.options)
    numbers = {
        name: table.numbers(column, quantities[name].dimension, units[name])
        for name, column in found.items()
    }
    parts = [f"{column.label} is the {name} in {units[name]}" for name, column in found.items()]
    used = {column.place for column in found.values()}
    unused = [column.name for column in table.columns if column.place not in used and column.name]
    left = f" Not used: {', '.join(unused)}." if unused else ""
    first, last = table.lines[[0, -1]]
    read = f"Read lines {first} to {last} of {table.source.path.name}: {'; '.join(parts)}.{left}"
    return Understood(table, way, found, units, numbers, whose, read)


@dataclasses.dataclass
class _Search:
    """The open questions about a table, and the options that answer them."""

    table: DataTable
    quantities: Mapping[str, Heading]
    reasons: list[str] = dataclasses.field(default_factory=list)
    options: dict[str, Any] = dataclasses.field(default_factory=dict)

    def columns_of(
        self, ways: Sequence[tuple[str, ...]], also: Sequence[str]
    ) -> tuple[tuple[str, ...], dict[str, DataColumn]]:
        """The way that is used, and the column of each quantity."""
        given = self.table.source.options.get("columns", {})
        places = self._places(given)
        asked = set(given) - set(also)
        # Of ways for which as much is missing, the first.
        way = min(ways, key=lambda names: (len(asked - set(names)), len(set(names) - set(places))))
        if left := sorted(asked - set(way)):
            self.reasons.append(f"`columns` names {left} beside {list(way)}: leave them out")
        missing = [name for name in way if name not in places]
        if missing:
            known = ", ".join(places) or "none of them"
            needed = "; or ".join(", ".join(names) for names in ways)
            self.reasons.append(f"its names say {known}; needed are {needed}")
        found = {}
        for name in [*way, *also]:
            if len(places.get(name, ())) > 1:
                labels = " and ".join(column.label for column in places[name][:3])
                self.reasons.append(f"{labels} may be the {name}")
                missing.append(name)
            elif name in places:
                found[name] = places[name][0]
        if missing and not asked and not set(places) & set(way):
            self.options["columns"] = {"...": "..."}
        elif missing:
            self.options["columns"] = dict.fromkeys(missing, "...")
        return way, found

    def _places(self, given: Mapping[str, str | int]) -> dict[str, list[DataColumn]]:
        """The columns that may be each quantity: those that are given, others by their names."""
        places: dict[str, list[DataColumn]] = {}
        for name, column in given.items():
            if name not in self.quantities:
                raise ValueError(f"`columns` names {name!r}: use one of {list(self.quantities)}.")
            places[name] = [c for c in self.table.columns if column in (c.name, c.place + 1)]
            if len(places[name]) != 1:
                listed = [c.name or c.place + 1 for c in self.table.columns]
                many = len(places[name]) or "no"
                reason = f"{many} columns are {column!r}; there are {listed}"
                raise self.table.not_plain([reason], columns={name: "..."})
        taken = {column.place for columns in places.values() for column in columns}
        for column in self.table.columns:
            name = quantity_named(column.name, self.quantities)
            if name is not None and name not in given and column.place not in taken:
                places.setdefault(name, []).append(column)
        return places

    def units_of(self, found: Mapping[str, DataColumn]) -> dict[str, str]:
        """The unit of each column; a given one counts where the file states none that is known."""
        given = self.table.source.options.get("units", {})
        self._check_units(given, found)
        units, lacking = {}, {}
        for name, column in found.items():
            dimension, _, usual = self.quantities[name]
            stated = column.unit if column.unit in UNITS[dimension] else None
            if not stated and any(column.unit in UNITS[other] for other in UNITS):
                self.reasons.append(f"{column.label}, the {name}, is in {column.unit}")
            if stated and given.get(dimension, stated) != stated:
                self.reasons.append(
                    f"{column.label} is in {stated}, as the file says: leave out "
                    f"`units={ {dimension: given[dimension]} }`, or correct the file"
                )
            unit = stated or given.get(dimension) or usual
            if unit is None:
                lacking[dimension] = "..."
            else:
                units[name] = unit
        if lacking:
            self.reasons += [f"no unit of the {dimension} is stated" for dimension in lacking]
            self.options["units"] = lacking
        return units

    def _check_units(self, given: Mapping[str, str], found: Mapping[str, DataColumn]) -> None:
        used = {self.quantities[name].dimension for name in found}
        known = {quantity.dimension for quantity in self.quantities.values()}
        for dimension, unit in given.items():
            if dimension not in known or unit not in UNITS[dimension]:
                allowed = list(UNITS[dimension]) if dimension in known else sorted(known)
                raise ValueError(f"`units={ {dimension: unit} }` must have one of {allowed}.")
            if dimension not in used and not self.reasons:
                self.reasons.append(f"no column needs the unit of the {dimension}: leave it out")

    def deformation_of(
        self, way: tuple[str, ...], found: Mapping[str, DataColumn], given: str | None
    ) -> str | None:
        """Tension or shear of moduli, by the names of the columns or as it is given."""
        if given not in (None, "tension", "shear"):
            raise ValueError(f"`deformation` must be 'tension' or 'shear', not {given!r}.")
        if not {self.quantities[name].dimension for name in way} & {"modulus", "compliance"}:
            return given
        stated = {kind for column in found.values() if (kind := deformation_in(column.name))}
        if not stated and given is None:
            self.reasons.append("no name says tension (E, D) or shear (G, J)")
            self.options["deformation"] = "..."
        if len(stated | {given} - {None}) > 1:
            said = " and ".join(sorted(stated))
            self.reasons.append(f"its names say {said}" + f", not {given}" * bool(given))
        return next(iter(stated), given)


def quantity_named(name: str, quantities: Mapping[str, Heading]) -> str | None:
    """Returns the quantity that a heading names, None for another one."""
    bare = _bare(name)
    found = (
        quantity
        for text in (bare, bare.lower())
        for quantity, (_, names, _) in quantities.items()
        if re.fullmatch(names, text)
    )
    return next(found, None)


def _bare(name: str) -> str:
    """A name without spaces, dots and underscores, and with primes in one spelling."""
    name = re.sub(r"''|´´|′′|’’|[\"″”]", "''", name)
    return re.sub(r"[\s_.]", "", re.sub(r"[′’´`]", "'", name))


def deformation_in(name: str) -> str | None:
    """Returns "tension" for a name with E or D, "shear" for one with G or J, else None."""
    bare = _bare(name)
    if word := next((w for w in _WORDS if bare.lower().startswith(w)), None):
        return _WORDS[word]
    found = re.match(r"\|?([EGDJ])(?=['*(|]|stor|loss|abs|relax|[ijk]?$)", bare)
    return _DEFORMATIONS[found[1]] if found else None
