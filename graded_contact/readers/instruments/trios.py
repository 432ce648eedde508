"""Tables in the JSON that TRIOS exports (TA Instruments), as the sheet of its text export.

A table has `ColumnHeaders`, with names and units, and `Rows`; each row names its step. TRIOS may
export the results as measured and as edited: those as edited are read.
"""

import json
from collections.abc import Iterator
from typing import Any

from ...core.files import Refusal
from ..cells import Row, Sheet
from ..registry import File, reader

_NUMBER_TYPES = ("Number", "Integer")


def _tree(file: File) -> Any:
    """The value of a JSON, None for other files."""
    try:
        text = file.text or ""
        return json.loads(text) if text.lstrip()[:1] == "{" else None
    except (ValueError, RecursionError):
        return None


@reader("trios", "moduli", knows=lambda file: _tree(file) is not None)
def read_trios(file: File) -> list[Sheet]:
    """Returns the tables in a JSON of TRIOS; raises `Refusal` for other JSON."""
    tables = dict(_tables(_tree(file), ""))
    if not tables:
        export = "export it as text, or as a workbook"
        raise Refusal(f"it is a JSON without the `ColumnHeaders` and `Rows` of TRIOS: {export}")
    edited = {name: table for name, table in tables.items() if name == "Processed"} or tables
    return [_table_sheet(name, table) for name, table in edited.items()]


def _tables(value: Any, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables in a tree, with the keys that hold them."""
    if isinstance(value, dict) and {"ColumnHeaders", "Rows"} <= set(value):
        yield name, value
    elif isinstance(value, dict | list):
        inner = value.items() if isinstance(value, dict) else ((name, each) for each in value)
        for key, each in inner:
            yield from _tables(each, key)


def _table_sheet(name: str, table: dict[str, Any]) -> Sheet:
    headers = {
        key: header
        for key, header in table["ColumnHeaders"].items()
        if isinstance(header, dict) and header.get("ValueType", "Number") in _NUMBER_TYPES
    }
    names = [str(header.get("DisplayName") or key) for key, header in headers.items()]
    units = [str((header.get("Unit") or {}).get("Name") or "") for header in headers.values()]
    titles = {step.get("Id"): str(step.get("Name")) for step in table.get("ResultsSteps") or []}
    lines: list[list[str]] = []
    last = object()
    for row in table["Rows"]:
        step = row.get("Results Step Id")
        if step != last:
            lines += [["[step]"], [titles.get(step, "")], names, units]
            last = step
        cells = (row.get(key) for key in headers)
        lines.append(["" if cell is None else str(cell) for cell in cells])
    rows = [Row(line, cells) for line, cells in enumerate(lines, start=1)]
    layout = f"{name!r} of TRIOS's JSON; lines are those of its text export"
    return Sheet(name, [row for row in rows if any(row.cells)], layout)
