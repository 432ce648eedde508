"""Text files and Excel workbooks as rows of cells.

Cells that are numbers become text with a decimal point and without marks between thousands,
whatever marks the file has; all other cells are unchanged.
"""

import codecs
import contextlib
import csv
import io
import re
import warnings
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from ..core.files import UNPACKED_TEXT, Refusal, check_archive, may_unpack

LARGEST = 100_000_000  # bytes, unpacked too; sweeps have thousands of points
MOST_CELLS = 5_000_000  # of a sheet; lines of a text
MOST_ROWS = 2**20  # of a sheet, as in Excel
LONGEST = 10_000_000  # characters of a line

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
# By the decimal mark: numbers, and those with marks between thousands.
_PLAIN = {
    mark: re.compile(rf"[-+−]?(\d+[{mark}]?\d*|[{mark}]\d+)([eEdD][-+]?\d+)?") for mark in ".,"
}
_GROUPED = {
    mark: re.compile(rf"[-+−]?[1-9]\d{{0,2}}([{other}'’\s]\d{{3}})+([{mark}]\d*)?")
    for mark, other in (".,", ",.")
}
_MISSING = {
    "", "-", "--", "---", "n/a", "n.a.", "na", "#n/a", "#nv", "nan", "-nan", "+nan", "null", "none",
    "inf", "-inf", "+inf", "infinity", "-infinity", "#num!", "#div/0!", "#value!", "#ref!",
}  # fmt: skip
COMMENT = re.compile(r"^\s*(#+|%+(?![\t;,])|//|!)\s*")  # a "%" in its own cell is a unit
_REMARK = re.compile(r"(?<=[\d\s])\s*(#|//|!).*$")  # behind numbers
_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", None: "spaces"}


class Row(NamedTuple):
    """One line of a file: its number, counted from 1, and its cells."""

    line: int
    cells: list[str]

    @property
    def num_numbers(self) -> int:
        return sum(map(is_number, self.cells))

    @property
    def text(self) -> str:
        return " ".join(self.cells)


class Sheet(NamedTuple):
    """The rows of a file, or of one sheet of a workbook.

    - `name`: of the sheet; empty for a text file.
    - `layout`: its encoding, separator and decimal mark, in words.
    - `spaced`: whether spaces separate its cells, so that no cell can be empty.
    """

    name: str
    rows: list[Row]
    layout: str
    spaced: bool

    def numbers_only(self, width: int) -> "Sheet":
        """Returns the first cells of the rows of numbers."""
        rows = [row._replace(cells=row.cells[:width]) for row in self.rows if holds_data(row)]
        return self._replace(rows=rows)


class TextLayout(NamedTuple):
    """The separator of the cells of a text, None for spaces, and its decimal mark."""

    separator: str | None
    decimal: str

    def __str__(self) -> str:
        return _SEPARATORS[self.separator] + " and decimal commas" * (self.decimal == ",")

    def split(self, line: str) -> list[str]:
        """Returns the cells of a line unchanged."""
        if self.separator is None:
            return line.split()
        return [cell.strip() for cell in next(csv.reader([line], delimiter=self.separator), [])]

    def cells(self, line: str) -> list[str]:
        """Returns the cells of a line, numbers with a decimal point."""
        return [_with_point(cell, self.decimal) for cell in self.split(line)]


def is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or marks a missing value."""
    return cell.lower() in _MISSING


def holds_data(row: Row) -> bool:
    """Whether a row holds numbers; some may be missing, and some cells may be words, as a sample's
    name."""
    numbers = row.num_numbers
    words = len(row.cells) - numbers - sum(map(is_missing, row.cells))
    return 2 * numbers > words and (numbers >= 2 or words == 0)


def stripped(cells: list[Any]) -> list[Any]:
    """Returns the cells without the empty ones at the end."""
    count = max((i + 1 for i, cell in enumerate(cells) if cell != ""), default=0)
    return cells[:count]


# Text.


def decoded(content: bytes) -> tuple[str, str] | None:
    """Returns the text of a file and its encoding, or None for a file that is no text."""
    # Without a mark, UTF-16 of western text has a zero in every second byte.
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace"), "UTF-16"
    for start, code in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = content[start:1000:2]
        if half.count(0) > 0.9 * max(len(half), 1):
            text = content.decode(code, errors="replace")
            return None if "\0" in text else (text, "UTF-16")
    if b"\0" in content:
        return None
    for code, name in (("utf-8-sig", "UTF-8"), ("cp1252", "Latin-1")):
        with contextlib.suppress(UnicodeDecodeError):
            return content.decode(code), name
    return content.decode("latin-1"), "Latin-1"


def lines_of(text: str) -> list[str]:
    """Returns the lines of a text; raises `Refusal` for too many."""
    if max(text.count("\n"), text.count("\r")) > MOST_CELLS:
        raise Refusal(f"it has more than {MOST_CELLS:g} lines")
    return re.split(r"\r\n|\r|\n", text)


def text_layout(lines: Iterable[str], least: int) -> TextLayout:
    """Returns the layout in which most cells are numbers, of rows with at `least` so many."""
    # The end of a file holds its numbers, the start may be all words.
    sample = [line[:5000] for line in lines if line.strip()][-200:]
    layouts = [TextLayout(separator, decimal) for decimal in ".," for separator in _SEPARATORS]
    return max(layouts, key=lambda each: _score(map(each.split, sample), each.decimal, least))


def _score(table: Iterable[list[str]], decimal: str, least: int) -> tuple[int, int]:
    """How well a table is read with a decimal mark.

    Marks between thousands count less: 1,234 alone is a little more than one, but 1,234 next to
    0.5 is a thousand.
    """
    total, plain = 0, 0
    for cells in table:
        plains = sum(_PLAIN[decimal].fullmatch(cell) is not None for cell in cells)
        numbers = plains + sum(_GROUPED[decimal].fullmatch(cell) is not None for cell in cells)
        words = len(cells) - numbers - sum(map(is_missing, cells))
        if numbers >= least and 2 * numbers > words:  # not a sentence with numbers in it
            total += 2 * numbers - words
            plain += plains
    return total, plain


def _with_point(cell: str, decimal: str) -> str:
    """A number with a decimal point and nothing between thousands; other cells unchanged."""
    if _GROUPED[decimal].fullmatch(cell):
        cell = re.sub(rf"[^-+−\d{decimal}]", "", cell)
    elif not _PLAIN[decimal].fullmatch(cell):
        return cell
    return cell.replace("−", "-").replace(",", ".").replace("d", "e").replace("D", "e")


def _text_sheet(content: bytes) -> Sheet:
    text, encoding = decoded(content) or ("\0", "")
    lines = lines_of(text)
    if "\0" in text or max(map(len, lines)) > 100_000:
        raise Refusal("it is neither a table of text nor an Excel workbook")
    layout = text_layout(lines, 2)
    grouped = _GROUPED[layout.decimal]
    rows, count = [], 0
    for number, line in enumerate(lines, start=1):
        row = Row(number, layout.cells(COMMENT.sub("", line, count=1)))
        if COMMENT.match(line):
            if holds_data(row):  # numbers that were commented out
                continue
        elif _REMARK.search(line):
            without = Row(number, layout.cells(_REMARK.sub("", line)))
            if holds_data(without) and without.num_numbers >= row.num_numbers:
                row = without
        rows.append(row)
        count += len(row.cells)
        if count > MOST_CELLS:
            raise Refusal(f"it has more than {MOST_CELLS:g} cells")
    marked = any(grouped.fullmatch(cell) for line in lines for cell in layout.split(line))
    marks = ", with marks between thousands" * marked
    spaced = layout.separator is None
    if spaced:  # names such as "Storage modulus" hold single spaces
        width = max((len(row.cells) for row in rows if holds_data(row)), default=0)
        for i, row in enumerate(rows):
            if not holds_data(row):
                text = COMMENT.sub("", lines[row.line - 1], count=1).strip()
                names = re.split(r"\s{2,}|\t", text)
                rows[i] = Row(row.line, names) if len(names) == width else row
    return Sheet("", rows, f"{encoding} text with {layout}{marks}", spaced)


# Files and workbooks.


def sheets_of(content: bytes, packed: int) -> list[Sheet]:
    """Returns the sheets of a workbook, or a text as the only sheet, without empty rows.

    The first bytes decide what it is. Raises `Refusal` for what is no table, and `ImportError` if
    the reader of a workbook is not installed. `packed`: bytes of the file that it lies in.
    """
    if content.startswith(b"\xd0\xcf\x11\xe0"):
        sheets = _workbook("xlrd", _xls(content))
    elif content.startswith(b"PK\x03\x04"):
        sheets = _workbook("openpyxl", _xlsx(content, packed))
    else:
        sheets = [_text_sheet(content)]
    return [sheet._replace(rows=[row for row in sheet.rows if any(row.cells)]) for sheet in sheets]


def _workbook(library: str, tables: Iterable[tuple[str, Iterable]]) -> list[Sheet]:
    """Without pandas, which pads every row to the widest one: a few far cells would fill memory."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions, not of cells
            return [_sheet(name, table) for name, table in tables]
    except ImportError as error:
        reason = f"This workbook needs the package {library}: pip install graded_contact[io]"
        raise ImportError(reason) from error
    except Refusal:
        raise
    except Exception as error:  # the libraries raise many kinds on a damaged file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise Refusal(f"it cannot be read as an Excel workbook: {reason}") from error


def _xls(content: bytes) -> Iterator[tuple[str, Iterable]]:
    import xlrd

    values = (xlrd.XL_CELL_TEXT, xlrd.XL_CELL_NUMBER)  # those of other cells are codes
    # Rows that are not ragged are padded to the widest.
    with xlrd.open_workbook(file_contents=content, logfile=io.StringIO(), ragged_rows=True) as book:
        for sheet in book.sheets():
            rows = sheet.get_rows()
            yield sheet.name, ([c.value if c.ctype in values else "" for c in row] for row in rows)


def _xlsx(content: bytes, packed: int) -> Iterator[tuple[str, Iterable]]:
    import openpyxl

    check_archive(content, may_unpack(packed, UNPACKED_TEXT))
    book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
    with contextlib.closing(book):
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # which may reach far beyond the cells
            yield sheet.title, sheet.values


def _sheet(name: str, table: Iterable[Iterable[Any]]) -> Sheet:
    rows: list[tuple[int, list[Any]]] = []
    width = 0
    for line, values in enumerate(table, start=1):
        row = stripped(["" if value is None else value for value in values]) if values else []
        if row:
            rows.append((line, row))
            width = max(width, len(row))
        if line > MOST_ROWS or width * len(rows) > MOST_CELLS:
            limit = f"{MOST_ROWS} rows or {MOST_CELLS:g} cells"
            raise Refusal(f"its sheet {name!r} has more than {limit}")
    # Numbers may be cells of text: these decide about the decimal mark.
    texts = [cell.strip() for _, row in rows for cell in row if isinstance(cell, str)]
    marked = (*_PLAIN.values(), *_GROUPED.values())
    texts = [text for text in texts if any(number.fullmatch(text) for number in marked)]
    decimal = max(".,", key=lambda mark: _score([texts], mark, 2))
    padded = []
    for line, row in rows:
        cells = [_with_point(str(cell).strip(), decimal) for cell in row]
        padded.append(Row(line, cells + [""] * (width - len(row))))
    return Sheet(name, padded, f"sheet {name!r} of a workbook", spaced=False)
