"""Tables in the JSON that TRIOS exports (TA Instruments), as the sheet of its text export.

A table has `ColumnHeaders`, with names and units, and `Rows`; each row names its step. TRIOS may
export the results as measured and as edited: those as edited are read.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .cells import LARGEST, Row, Sheet, read_sheets
from .paths import Refusal, read_file

_NUMBERS = ("Number", "Integer")


def read_tables(path: Path) -> list[Sheet]:
    """Returns the tables in the JSON of TRIOS, or else the sheets, as `read_sheets` does."""
    try:
        tables = _trios_sheets(read_file(path, LARGEST))
    except Refusal as error:
        raise ValueError(f"`path={path}` is refused: {error}.") from error
    return tables or read_sheets(path)


def _trios_sheets(content: bytes) -> list[Sheet] | None:
    """Returns the tables in a JSON; None for other files. Raises `Refusal` for other JSON."""
    if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        return None
    try:
        root = json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        return None
    tables = dict(_tables(root, ""))
    if not tables:
        export = "export it as text, or as a workbook"
        raise Refusal(f"it is a JSON without the `ColumnHeaders` and `Rows` of TRIOS: {export}")
    edited = {name: table for name, table in tables.items() if name == "Processed"} or tables
    try:
        return [_sheet(name, table) for name, table in edited.items()]
    except (AttributeError, TypeError) as error:
        raise Refusal(f"its tables are not as TRIOS writes them ({error})") from error


def _tables(value: Any, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables in a tree, with the keys that hold them."""
    if isinstance(value, dict):
        if isinstance(value.get("ColumnHeaders"), dict) and isinstance(value.get("Rows"), list):
            yield name, value
        else:
            for key, inner in value.items():
                yield from _tables(inner, key)
    elif isinstance(value, list):
        for inner in value:
            yield from _tables(inner, name)


def _sheet(name: str, table: dict[str, Any]) -> Sheet:
    headers = {
        key: header
        for key, header in table["ColumnHeaders"].items()
        if isinstance(header, dict) and header.get("ValueType", "Number") in _NUMBERS
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
    return Sheet(name, [row for row in rows if any(row.cells)], layout, spaced=False)
