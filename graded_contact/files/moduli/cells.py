"""Files of tables as rows of cells: text in any usual layout, and Excel workbooks.

Numbers come out as text with a decimal point, whatever the file's decimal mark, and without marks
between thousands; all other cells as they stand.
"""

import csv
import io
import re
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from ..paths import check_archive, existing_file

LARGEST = 100_000_000  # bytes, unpacked too; sweeps have thousands of points
MOST_CELLS = 5_000_000  # of a sheet

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
# By the decimal mark: numbers, and those whose thousands are set apart.
_PLAIN = {
    mark: re.compile(rf"[-+−]?(\d+[{mark}]?\d*|[{mark}]\d+)([eEdD][-+]?\d+)?") for mark in ".,"
}
_GROUPED = {
    mark: re.compile(rf"[-+−]?[1-9]\d{{0,2}}([{other}'’\s]\d{{3}})+([{mark}]\d*)?")
    for mark, other in (".,", ",.")
}
_MISSING = {"", "-", "--", "---", "n/a", "n.a.", "na", "#n/a", "#nv", "nan", "null", "none", "inf",
            "-inf", "#num!", "#div/0!", "#value!", "#ref!"}  # fmt: skip
_COMMENT = re.compile(r"^\s*(#+|%+|//|!)\s*")
_REMARK = re.compile(r"(?<=[\d\s])\s*(#|//|!).*$")  # behind numbers
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
    return _NUMBER.fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or marks a missing value."""
    return cell.lower() in _MISSING


def holds_data(row: Row) -> bool:
    """Whether a row holds numbers, besides missing ones and some words, such as a sample's name."""
    numbers = _numbers(row)
    words = len(row.cells) - numbers - sum(map(is_missing, row.cells))
    return 2 * numbers > words and (numbers >= 2 or words == 0)


def _numbers(row: Row) -> int:
    return sum(map(is_number, row.cells))


def read_sheets(path: Path) -> list[Sheet]:
    """Returns the sheets of a workbook, or a text file as the only sheet, without empty rows.

    What a file is, its first bytes tell, not its name. Raises `FileNotFoundError`, `ImportError`
    if the reader of a workbook is not installed, and `ValueError` for what is not a table.
    """
    existing_file(path, at_most=LARGEST)
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

    kept = (xlrd.XL_CELL_TEXT, xlrd.XL_CELL_NUMBER)  # the values of others are codes
    with xlrd.open_workbook(str(path), logfile=io.StringIO()) as book:
        return [
            _sheet(
                sheet.name,
                (
                    [cell.value if cell.ctype in kept else None for cell in sheet.row(i)]
                    for i in range(sheet.nrows)
                ),
            )
            for sheet in book.sheets()
        ]


def _read_xlsx(path: Path) -> list[Sheet]:
    import openpyxl

    check_archive(path, LARGEST)
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    for sheet in book.worksheets:
        sheet.reset_dimensions()  # which may reach far beyond the cells
    try:
        return [_sheet(sheet.title, sheet.values) for sheet in book.worksheets]
    finally:
        book.close()


def _sheet(name: str, table: Iterable[Iterable[Any]]) -> Sheet:
    rows: list[tuple[int, list[Any]]] = []
    width = 0
    for line, values in enumerate(table, start=1):
        row = ["" if value is None else value for value in values]
        while row and row[-1] == "":
            row.pop()
        if row:
            rows.append((line, row))
            width = max(width, len(row))
        if width * len(rows) > MOST_CELLS:
            raise ValueError(f"its sheet {name!r} has more than {MOST_CELLS:g} cells")
    texts = [value.strip() for _, row in rows for value in row if isinstance(value, str)]
    marked = (*_PLAIN.values(), *_GROUPED.values())
    texts = [text for text in texts if any(number.fullmatch(text) for number in marked)]
    decimal = max(".,", key=lambda mark: _score([texts], mark))
    return Sheet(
        name=name,
        rows=[
            Row(line, [_pointed(str(value).strip(), decimal) for value in row]
                + [""] * (width - len(row)))
            for line, row in rows
        ],
        layout=f"sheet {name!r} of a workbook",
        spaced=False,
    )  # fmt: skip


def _read_text(path: Path, content: bytes) -> Sheet:
    text, encoding = _decode(content)
    lines = re.split(r"\r\n|\r|\n", text)
    if "\0" in text or max(map(len, lines)) > 100_000:
        raise ValueError(f"`path={path}` is neither a table of text nor an Excel workbook.")
    separator, decimal = _separator(lines)
    rows = []
    for number, line in enumerate(lines, start=1):
        comment = _COMMENT.match(line)
        row = Row(number, _cells(line[comment.end() :] if comment else line, separator, decimal))
        if not comment and _REMARK.search(line):
            without = Row(number, _cells(_REMARK.sub("", line), separator, decimal))
            if holds_data(without) and _numbers(without) >= _numbers(row):
                row = without
        if not (comment and holds_data(row)):  # numbers that were taken out of the table
            rows.append(row)
    if separator is None:
        width = max((len(row.cells) for row in rows if holds_data(row)), default=0)
        rows = [row if holds_data(row) else _spaced(row, lines, width) for row in rows]
    marks = " and decimal commas" if decimal == "," else ""
    if any(_GROUPED[decimal].fullmatch(cell) for line in lines for cell in _split(line, separator)):
        marks += ", thousands set apart"
    layout = f"{encoding} text with {_SEPARATORS[separator]}{marks}"
    return Sheet("", rows, layout, separator is None)


def _spaced(row: Row, lines: list[str], width: int) -> Row:
    """A row of names such as "Storage modulus", which hold single spaces."""
    text = _COMMENT.sub("", lines[row.line - 1], count=1).strip()
    cells = re.split(r"\s{2,}|\t", text)
    return Row(row.line, cells) if len(cells) == width else row


def _decode(content: bytes) -> tuple[str, str]:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace"), "UTF-16"
    for offset, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = content[offset:1000:2]
        if half and half.count(0) > 0.9 * len(half):
            return content.decode(encoding, errors="replace"), "UTF-16"
    try:
        return content.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        pass
    try:
        return content.decode("cp1252"), "Latin-1"
    except UnicodeDecodeError:
        return content.decode("latin-1"), "Latin-1"


def _cells(line: str, separator: str | None, decimal: str) -> list[str]:
    return [_pointed(cell, decimal) for cell in _split(line, separator)]


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def _pointed(cell: str, decimal: str) -> str:
    """A number with a decimal point and nothing between thousands; other cells as they are."""
    if _GROUPED[decimal].fullmatch(cell):
        cell = re.sub(rf"[^-+−\d{decimal}]", "", cell)
    elif not _PLAIN[decimal].fullmatch(cell):
        return cell
    return cell.replace("−", "-").replace(",", ".").replace("d", "e").replace("D", "e")


def _separator(lines: list[str]) -> tuple[str | None, str]:
    """The separator and the decimal mark under which most cells of the file are numbers."""
    last = lines[-200:]  # the numbers stand at the end
    tables = {separator: [_split(line, separator) for line in last] for separator in _SEPARATORS}
    candidates = [(separator, decimal) for decimal in ".," for separator in _SEPARATORS]
    return max(candidates, key=lambda pair: _score(tables[pair[0]], pair[1]))  # first of equals


def _score(table: list[list[str]], decimal: str) -> tuple[int, int]:
    """How well a table is read with a decimal mark.

    Marks between thousands count less: 1,234 alone is a little more than one, but 1,234 beside
    0.5 is a thousand.
    """
    total, plain = 0, 0
    for cells in table:
        plains = sum(_PLAIN[decimal].fullmatch(cell) is not None for cell in cells)
        numbers = plains + sum(_GROUPED[decimal].fullmatch(cell) is not None for cell in cells)
        words = len(cells) - numbers - sum(map(is_missing, cells))
        if numbers >= 2 and 2 * numbers > words:  # not a sentence with numbers in it
            total += 2 * numbers - words
            plain += plains
    return total, plain
