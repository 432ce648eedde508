"""Tables of numbers among the rows of a sheet, and the lines above them.

The names of the columns are in a row above a table. Tables with the same names are one table in
segments, such as the steps of a test. A table may also repeat its columns side by side, one block
for each curve.
"""

import itertools
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .cells import Row, Sheet, holds_data, holds_number, is_missing, stripped
from .decisions import Log
from .units import DIMENSIONS, OFFSETS, SI, UNITS, Heading, parse_heading, parse_unit

HUGE = 1e100  # in SI units; of shifted frequencies and times
MOST_COLUMNS = 1000  # of a table; a hundred curves side by side have a few hundred


def is_credible(values: np.ndarray) -> np.ndarray:
    """Whether a measurement can have these values, so that their ratios are finite."""
    return (values > 1 / HUGE) & (values < HUGE)


def credible(values: np.ndarray) -> np.ndarray:
    """Returns the values that a measurement can have."""
    return values[is_credible(values)]


class DataColumn(NamedTuple):
    """A column of a table.

    - `quantity`: a key of `units.DIMENSIONS`.
    - `place`: counted from 0, within a block.
    - `label`: its number and name, for messages.
    - `unit`: one of `UNITS` of its dimension; empty if any unit does.
    - `source`: where the unit comes from.
    - `deformation`: "tension", "shear" or None, by its name.
    - `base`: of the logarithms that it holds, "10" or "e"; None for plain values.
    - `period`: whether it holds the periods T of frequencies, ω = 2π/T.
    """

    quantity: str
    place: int
    label: str = ""
    unit: str = ""
    source: str = ""
    deformation: str | None = None
    base: str | None = None
    period: bool = False

    @property
    def dimension(self) -> str:
        """The dimension of the numbers in the file."""
        return "time" if self.period else DIMENSIONS[self.quantity]

    @property
    def sentence(self) -> str:
        """How the column is understood."""
        of = {None: "", "10": "decimal logarithm of ", "e": "natural logarithm of "}[self.base]
        named = "period (ω = 2π/T)" if self.period else self.quantity.replace("_", " ")
        start = f"{self.label[0].upper()}{self.label[1:]}: {of}{named} in {self.unit}"
        factor = UNITS[self.dimension][self.unit]
        times = factor != 1 and self.dimension != "temperature"  # whose zero moves too
        si = f"; times {factor:.6g} in {SI[self.dimension]}"
        return f"{start}, {self.source}" + times * si + "."

    def si(self, cells: Iterable[str]) -> np.ndarray:
        """Returns numbers in SI units; NaN for words, infinity for what is too large."""
        values = np.array([float(cell) if holds_number(cell) else np.nan for cell in cells])
        with np.errstate(over="ignore", divide="ignore"):
            if self.base is not None:
                values = np.exp(values * (np.log(10) if self.base == "10" else 1))
            values = UNITS[self.dimension].get(self.unit, 1.0) * values
            return 2 * np.pi / values if self.period else values + OFFSETS.get(self.unit, 0.0)

    def numbers(self, rows: Iterable[Row]) -> np.ndarray:
        """Returns the numbers of the first block in SI units, NaN where there is none."""
        return self.si("".join(row.cells[self.place : self.place + 1]) for row in rows)


class DataTable(NamedTuple):
    """Names and units of the columns of one block, and the rows of all segments below them.

    - `place`: the line of its names, for messages.
    - `blocks`: how often the columns are repeated side by side.
    - `spaced`: whether spaces separate the cells, so that none can be empty.
    - `above`: the rows above each segment.
    - `rows`: those of numbers; `words` are the others.
    - `log`: of the reading of this table.
    - `kelvins`: the temperature of each block [K], if its columns state it.
    """

    place: str
    names: list[str]
    units: list[str]
    blocks: int
    spaced: bool
    above: list[list[Row]]
    rows: list[Row]
    words: list[Row]
    log: Log
    kelvins: Sequence[float] | None = None

    @property
    def headings(self) -> list[Heading]:
        return list(map(parse_heading, self.names))

    def misfit(self, row: Row) -> int:
        """Returns the number of entries of a row if these cannot be assigned to columns, else 0."""
        entries, width = len(stripped(row.cells)), self.blocks * len(self.names)
        # Where spaces separate, a missing entry would move those after it.
        return entries if entries > width or (self.spaced and entries < width) else 0

    def label(self, place: int) -> str:
        name = self.names[place]
        return f"column {place + 1}" + (f" ({name})" if name else "")

    def unit(self, place: int) -> str | None:
        """Returns the unit in a column's heading or below it, as `parse_unit`."""
        return parse_heading(self.names[place]).unit or parse_unit(self.units[place])

    def listed(self) -> str:
        """Returns the names of the columns, for messages."""
        if any(self.names):
            return "the columns " + ", ".join(map(repr, self.names))
        return f"{len(self.names)} columns without names"


def find_tables(sheet: Sheet, named: Iterable[str]) -> list[DataTable]:
    """Returns the tables of numbers; `named` are names of columns that are known."""
    rows = sheet.rows
    if not any(map(holds_data, rows)):
        return []
    if (width := max(len(row.cells) for row in rows)) > MOST_COLUMNS:
        raise ValueError(f"it has {width} columns; at most {MOST_COLUMNS} are read")
    # Universal Analysis writes names below one another, "Sig1 Time (min)", "Sig2 ...": as one row.
    signals = [row for row in rows if re.fullmatch(r"Sig\d+", row.cells[0])]
    if len(signals) > 1:
        names = Row(signals[-1].line, [" ".join(row.cells[1:]) for row in signals])
        last_of = {id(row) for row in signals[:-1]}
        rows = [names if row is signals[-1] else row for row in rows if id(row) not in last_of]
    starts = _starts(rows, set(named))
    if not starts:
        data = list(filter(holds_data, rows))
        empty = [""] * max((len(row.cells) for row in data), default=0)
        above = list(itertools.takewhile(lambda row: not holds_data(row), rows))
        return [
            DataTable("no line of names", empty, empty, 1, sheet.spaced, [above], data, [], Log())
        ]
    tables: dict[tuple[str, ...], DataTable] = {}
    last = 0  # behind the numbers above
    for start, end in zip(starts, [*starts[1:], len(rows)], strict=True):
        below = rows[start + 1 : end]
        has_units = below and not holds_data(below[0]) and any(map(parse_unit, below[0].cells))
        units = below.pop(0).cells if has_units else []
        above = rows[max(last, start - 1) : start]
        table = _headed(_with_near_names(rows[start], above, below), units, sheet.spaced)
        key = tuple(table.names)
        if key in tables and has_units and tables[key].units != table.units:
            key = (*table.names, *table.units)
        table = tables.setdefault(key, table)
        data = [row for row in below if holds_data(row) and not _COUNTERFACE.match(row.cells[0])]
        if data:
            lines = {row.line for row in data}
            for row in below:
                kept = table.rows if row.line in lines else table.words
                kept.append(row._replace(segment=len(table.above)))
            table.above.append(rows[last:start])
            last = rows.index(data[-1], start) + 1
    return [table for table in tables.values() if table.rows]


def _with_near_names(names: Row, above: Sequence[Row], below: Sequence[Row]) -> Row:
    """A row of names whose empty cells have their name in the row above or below."""
    cells = list(names.cells)
    near = [below[0].cells] if below and not holds_data(below[0]) else []
    near += [above[-1].cells] if above else []
    for i, cell in enumerate(cells):
        others = [row[i] for row in near if i < len(row) and not cell]
        # A temperature in the row above is that of the columns beside it.
        stated = (
            name for name in others if parse_heading(name).quantity not in (None, "temperature")
        )
        cells[i] = next(stated, cell)
    return names._replace(cells=cells)


def _headed(row: Row, units: list[str], spaced: bool) -> DataTable:
    """A table without rows yet, whose names may repeat: each repetition is a block."""
    names = stripped(row.cells)
    below = (units + [""] * len(names))[: len(names)]
    columns = list(zip(names, below, strict=True))
    for width in _periods(columns):
        blocks, rest = divmod(len(names), width)
        if width > 1 and not (rest and any(map(any, columns[rest:width]))):
            blocks += rest > 0  # an empty column between blocks
            names, below = names[:width], below[:width]
            break
    else:
        blocks = 1
    return DataTable(f"line {row.line}", names, below, blocks, spaced, [], [], [], Log())


def _periods(columns: Sequence[tuple[str, str]]) -> Iterator[int]:
    """Yields the numbers of columns after which these repeat, rising, in linear time.

    The longest start of the list that is its end, too, follows from those of its starts (Knuth,
    Morris and Pratt).
    """
    borders = [0] * len(columns)
    for i in range(1, len(columns)):
        length = borders[i - 1]
        while length and columns[i] != columns[length]:
            length = borders[length - 1]
        borders[i] = length + (columns[i] == columns[length])
    length = len(columns)
    while length and (length := borders[length - 1]):
        yield len(columns) - length


def _starts(rows: list[Row], named: set[str]) -> list[int]:
    """The rows of names: those that name two quantities."""
    words = [i for i, row in enumerate(rows) if not holds_data(row)]

    def num_names(row: Row) -> int:
        quantities = {parse_heading(cell).quantity for cell in row.cells} - {None}
        return len(quantities) + len(named & set(row.cells))

    if starts := [i for i in words if num_names(rows[i]) >= 2]:
        return starts
    # Otherwise the last row of words before the numbers that is not one of units.
    first = next((i for i, row in enumerate(rows) if holds_data(row)), 0)
    above = [i for i in words if i < first and len(rows[i].cells) > 1]
    return [i for i in above if not all(is_missing(c) or parse_unit(c) for c in rows[i].cells)][-1:]


# The lines above a table: its title, the temperature, the constant stress of a creep test, the
# geometry. A value counts only with its unit, and only if no line gives another value.
_VALUE = r"([-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)"
_VALUES = {
    # Not "10 °C/min", and not the end of a word or of another number.
    "temperature": rf"(?<![\w.,]){_VALUE}\s*(?:°|º|deg\.?)?\s*([CK])\b(?!\s*(?:/|\^|min|per))",
    "stress": rf"(?i)\b(?:schub)?(?:stress|spannung)\b[^\w+-]*{_VALUE}\s*([a-z][a-z0-9/^²]*)",
}
_TEST = re.compile(
    r"(?i)sweep|ramp|hold|relax|creep|soak|step|test|balayage|rampe|fluage|paliers?|essai|kriech|versuch"
)
# RheoCompass counts the points above the numbers: "Interval and data points: 1 29".
_COUNTERFACE = re.compile(r"(?i)(?:interval|abschnitt).*:")
# Settings of an instrument that are no temperature of a test.
_SETTING = re.compile(r"(?i)toleran|limit|offset|compensation|expansion|calibration|span|range")


def title_above(rows: Sequence[Row]) -> str:
    """Returns the title of the next step, such as "Frequency sweep - 2", or an empty text."""
    titles = [
        row for row in rows if _TEST.search(row.text) and not _COUNTERFACE.match(row.cells[0])
    ]
    pairs = itertools.pairwise(rows)
    titles += [row for mark, row in pairs if mark.cells[0].casefold() == "[step]"]  # TRIOS
    return next((cell for cell in reversed(titles[-1].cells) if cell), "")[:60] if titles else ""


def value_above(rows: Sequence[Row], quantity: str) -> float | None:
    """Returns the only "temperature" [K] or "stress" [Pa] that the rows name, such as "25 °C"."""
    units, found = UNITS[quantity], set()
    for row in rows:
        given = settings_in(row)
        if quantity == "temperature" and "chem" in given and holds_number(given.get("T", "")):
            found.add(float(given["T"]) + OFFSETS["C"])  # as RepTate's files begin
        for number, word in re.findall(_VALUES[quantity], row.text):
            unit = parse_unit(word)
            if unit in units and not _SETTING.search(row.cells[0]):
                found.add(float(number.replace(",", ".")) * units[unit] + OFFSETS.get(unit, 0.0))
    return found.pop() if len(found) == 1 else None


def settings_in(row: Row) -> dict[str, str]:
    """Returns the parameters of a line such as "T=-35; Mw = 634.5;", as RepTate's files begin."""
    entries = [entry.split("=", 1) for entry in row.text.split(";") if entry.strip()]
    if not all(len(entry) == 2 for entry in entries):
        return {}
    return {name.strip(): value.strip() for name, value in entries}
