"""Isotherms side by side in one table: their temperatures stand above the columns, or in the names.

    T [°C]    20         40                f [Hz]   20 °C          40 °C
    f [Hz]    E'   E''   E'   E''                   E'      E''    E'      E''

The columns of each temperature become a block, with the columns that all share. A cell without a
temperature (of merged cells only the first has one) belongs to the temperature before it.
"""

import re
from collections.abc import Mapping, Sequence

from .cells import Row, holds_number, stripped
from .decisions import Log
from .tables import DataTable
from .units import OFFSETS, UNITS, parse_heading

_DEGREES = r"[-+−]?\d+(?:[.,]\d+)?"
_IN_WORDS = re.compile(
    rf"[(\[@]?\s*(?:(?:at|bei|à|T\s*[=:])\s*)?(?<![\w.,])({_DEGREES})\s*((?:°|º|deg\.?)\s*[CFK]|[CK])"
    r"(?![\w/])\s*[)\]]?"
)
_ALONE = re.compile(rf"(?i)(?:t|temp\w*)?\s*[=:]?\s*({_DEGREES})\s*")
COLD = 150.0  # K or °C: below it a bare number is in °C


def isotherms_beside(table: DataTable, units: Mapping[str, str]) -> DataTable:
    """Returns a table with a block for each temperature, or the table as it is.

    `units` are those of the user; that of "temperature" counts for numbers without one.
    """
    width = table.blocks * len(table.names)
    above = [row for row in table.above[0] if len(row.cells) > 1][-1:]
    cells = (above[0].cells if above else [])[:width]
    cells += [""] * (width - len(cells))
    log = Log()
    kelvins = _kelvins(cells, units.get("temperature"), log)
    if table.blocks > 1:  # each with its own frequencies
        size = len(table.names)
        of_block = [kelvins[start : start + size] for start in range(0, width, size)]
        found = [next((k for k in part if k is not None), None) for part in of_block]
        if None in found:
            return table
        return _with_kelvins(table, found, log)
    names = table.names
    if sum(kelvin is not None for kelvin in kelvins) < 2:
        inside = [_IN_WORDS.search(name) for name in names]
        kelvins = [found and _to_kelvin(*found.groups()) for found in inside]
        names = [_IN_WORDS.sub(" ", name).strip(" ,;_") or _quantity_above(table) for name in names]
        log = Log()
    else:
        for i in range(1, width):  # the other cells of merged ones
            kelvins[i] = kelvins[i - 1] if kelvins[i] is None and not cells[i] else kelvins[i]
    shared = [i for i, kelvin in enumerate(kelvins) if kelvin is None]
    groups: dict[float, list[int]] = {}
    for i, kelvin in enumerate(kelvins):
        if kelvin is not None:
            groups.setdefault(kelvin, []).append(i)
    heads = [[(names[i], table.units[i]) for i in group] for group in groups.values()]
    if len(groups) < 2 or not shared or any(head != heads[0] for head in heads):
        return table
    order = [i for group in groups.values() for i in (*shared, *group)]
    first = order[: len(order) // len(groups)]
    split = table._replace(
        names=[names[i] for i in first],
        units=[table.units[i] for i in first],
        blocks=len(groups),
        rows=[_reordered(row, order, width) for row in table.rows],
    )
    return _with_kelvins(split, list(groups), log)


def _quantity_above(table: DataTable) -> str:
    """The line above the names that names a quantity, as "Relaxation modulus [MPa]"; or nothing."""
    texts = [row.text.strip() for row in table.above[0]]
    return next((text for text in texts if parse_heading(text).quantity), "")


def _kelvins(cells: list[str], given: str | None, log: Log) -> list[float | None]:
    """The temperatures [K] in the cells of a row."""
    kelvins: list[float | None] = [None] * len(cells)
    label = next((parse_heading(cell) for cell in cells if cell and not holds_number(cell)), None)
    unit = label.unit if label and label.quantity == "temperature" else None
    bare = {}
    for i, cell in enumerate(cells):
        if found := _IN_WORDS.search(cell):
            kelvins[i], unit = _to_kelvin(*found.groups()), found[2][-1]
        elif found := _ALONE.fullmatch(cell):
            bare[i] = _decimal_value(found[1])
    if not bare:
        return kelvins
    unit = unit or given
    if unit is None:
        if label is not None and label.quantity not in ("temperature", None):
            return kelvins  # numbers of another quantity
        if max(bare.values()) >= COLD:
            numbers = ", ".join(f"{value:g}" for value in bare.values())
            raise ValueError(
                f"the temperatures above the columns ({numbers}) have no unit: pass for instance "
                "`units={'temperature': 'K'}`"
            )
        unit = "C"
        log.assume(
            "The temperatures above the columns are assumed to be in °C; otherwise pass "
            "`units={'temperature': 'K'}`."
        )
    for i, value in bare.items():
        kelvins[i] = UNITS["temperature"][unit] * value + OFFSETS[unit]
    return kelvins


def _to_kelvin(number: str, unit: str) -> float:
    known = unit[-1]  # of "deg. C"
    return round(UNITS["temperature"][known] * _decimal_value(number) + OFFSETS[known], 6)


def _decimal_value(number: str) -> float:
    return float(number.replace(",", ".").replace("−", "-"))


def _reordered(row: Row, order: list[int], width: int) -> Row:
    if len(stripped(row.cells)) > width:
        return row  # entries that fit no column
    return row._replace(cells=[row.cells[i] if i < len(row.cells) else "" for i in order])


def _with_kelvins(table: DataTable, kelvins: Sequence[float | None], log: Log) -> DataTable:
    """The table with the temperature of each block, to ten digits."""
    return table._replace(kelvins=[float(f"{kelvin:.10g}") for kelvin in kelvins], log=log)
