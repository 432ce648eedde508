"""Files of tables as rows of cells: text in any usual layout, and Excel workbooks.

Numbers come out as text with a decimal point, whatever the file's decimal mark; all other cells
as they stand.
"""

import csv
import re
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

_POINT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_COMMA = re.compile(r"[-+]?(\d+,?\d*|,\d+)([eE][-+]?\d+)?")
_MISSING = {"", "-", "--", "---", "n/a", "na", "#n/a", "nan", "null", "none", "inf", "-inf",
            "#num!", "#div/0!", "#value!"}  # fmt: skip
_COMMENT = re.compile(r"^\s*(#|%|//|!)\s*")
_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", None: "spaces"}


class Row(NamedTuple):
    """One line of a file: its number, counted from 1, and its cells."""

    line: int
    cells: list[str]


class Sheet(NamedTuple):
    """The rows of a file, or of one sheet of a workbook.

    - `name`: of the sheet; empty for a text file.
    - `layout`: how it was read, in words.
    - `spaced`: whether spaces separate its cells, so that no cell can be empty.
    """

    name: str
    rows: list[Row]
    layout: str
    spaced: bool


def is_number(cell: str) -> bool:
    return _POINT.fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or marks a missing value."""
    return cell.lower() in _MISSING


def holds_data(row: Row) -> bool:
    """Whether a row holds numbers, besides missing ones and some words, such as a sample's name."""
    numbers = sum(map(is_number, row.cells))
    words = len(row.cells) - numbers - sum(map(is_missing, row.cells))
    return 2 * numbers > words and (numbers >= 2 or words == 0)


def read_sheets(path: Path) -> list[Sheet]:
    """Returns the sheets of a workbook, or a text file as the only sheet, without empty rows.

    What a file is, its first bytes tell, not its name. Raises `FileNotFoundError`, `ImportError`
    if the reader of a workbook is not installed, and `ValueError` for what is not a table.
    """
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    content = path.read_bytes()
    if content.startswith(b"\xd0\xcf\x11\xe0"):
        sheets = _workbook(path, "xlrd", _read_xls)
    elif content.startswith(b"PK\x03\x04"):
        sheets = _workbook(path, "openpyxl", _read_xlsx)
    else:
        sheets = [_read_text(path, content)]
    return [sheet._replace(rows=[row for row in sheet.rows if any(row.cells)]) for sheet in sheets]


def _workbook(path: Path, library: str, read: Callable[[Path], list[Sheet]]) -> list[Sheet]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions, not of cells
            return read(path)
    except ImportError as error:
        raise ImportError(
            f"`path={path}` is an Excel workbook, which needs the package {library}: "
            "pip install graded_contact[io]"
        ) from error
    except Exception as error:  # the libraries raise many kinds on a damaged file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise ValueError(f"`path={path}` cannot be read as an Excel workbook: {reason}.") from error


def _read_xls(path: Path) -> list[Sheet]:
    import xlrd

    with xlrd.open_workbook(str(path)) as book:
        return [
            _sheet(sheet.name, map(sheet.row_values, range(sheet.nrows))) for sheet in book.sheets()
        ]


def _read_xlsx(path: Path) -> list[Sheet]:
    import openpyxl

    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    try:
        return [_sheet(sheet.title, sheet.values) for sheet in book.worksheets]
    finally:
        book.close()


def _sheet(name: str, table: Iterable[Iterable[Any]]) -> Sheet:
    rows = [
        Row(line, ["" if value is None else _pointed(str(value).strip()) for value in values])
        for line, values in enumerate(table, start=1)
    ]
    return Sheet(name, rows, f"sheet {name!r} of a workbook", False)


def _read_text(path: Path, content: bytes) -> Sheet:
    text, encoding = _decode(content)
    lines = text.splitlines()
    if "\0" in text or max(map(len, lines), default=0) > 100_000:
        raise ValueError(f"`path={path}` is neither a table of text nor an Excel workbook.")
    separator, decimal = _separator(lines)
    rows = []
    for number, line in enumerate(lines, start=1):
        comment = _COMMENT.match(line)
        cells = _split(line[comment.end() :] if comment else line, separator)
        if decimal == ",":
            cells = list(map(_pointed, cells))
        row = Row(number, cells)
        if not (comment and holds_data(row)):  # numbers that were taken out of the table
            rows.append(row)
    if separator is None:
        width = max((len(row.cells) for row in rows if holds_data(row)), default=0)
        rows = [row if holds_data(row) else _spaced(row, lines, width) for row in rows]
    mark = " and decimal commas" if decimal == "," else ""
    layout = f"{encoding} text with {_SEPARATORS[separator]}{mark}"
    return Sheet("", rows, layout, separator is None)


def _spaced(row: Row, lines: list[str], width: int) -> Row:
    """A row of names such as "Storage modulus", which hold single spaces."""
    text = _COMMENT.sub("", lines[row.line - 1], count=1).strip()
    cells = re.split(r"\s{2,}|\t", text)
    return Row(row.line, cells) if len(cells) == width else row


def _pointed(cell: str) -> str:
    comma = not is_number(cell) and _COMMA.fullmatch(cell)
    return cell.replace(",", ".") if comma else cell


def _decode(content: bytes) -> tuple[str, str]:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace"), "UTF-16"
    try:
        return content.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        return content.decode("latin-1"), "Latin-1"


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _separator(lines: list[str]) -> tuple[str | None, str]:
    """The separator and the decimal mark under which most cells of the file are numbers."""

    def score(candidate):
        separator, number = candidate[0], _POINT if candidate[1] == "." else _COMMA
        total = 0
        for line in lines[-200:]:  # the numbers stand at the end
            cells = _split(line, separator)
            numbers = sum(number.fullmatch(cell) is not None for cell in cells)
            words = len(cells) - numbers - sum(map(is_missing, cells))
            total += max(2 * numbers - words, 0) if numbers >= 2 else 0
        return total

    candidates = [(separator, decimal) for decimal in ".," for separator in _SEPARATORS]
    return max(candidates, key=score)  # the first of equals
