"""Text files and Excel workbooks as rows of cells.

Cells that are numbers become text with a decimal point and without marks between thousands,
whatever marks the file has; all other cells are unchanged.
"""

import contextlib
import csv
import io
import itertools
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from ..core.files import UNPACKED_BOOK, Refusal, check_archive, may_unpack
from .decisions import Options
from .registry import File, extra

TABLE_BYTES = 100_000_000  # bytes, unpacked too; sweeps have thousands of points
MOST_CELLS = 5_000_000  # of a sheet of moduli; lines of any text
MOST_ROWS = 2**20  # of a sheet, as in Excel
LONGEST_LINE = 100_000  # characters of a line of moduli
LONGEST_NUMBER = 400  # characters: 1e308 with all digits has 309
LONGEST_WORDS = 200  # characters of other cells that are kept
LONGEST_TEXT = 1000  # characters of a row that are looked at for titles

# By the decimal mark: numbers, and those with marks between thousands. Where a pattern may match in
# one way only, a cell that it does not match costs no more than its length.
_PLAIN_NUMBER = {
    mark: re.compile(rf"[-+−]?(\d+([{mark}]\d*)?|[{mark}]\d+)([eEdD][-+]?\d+)?") for mark in ".,"
}
_GROUPED = {
    mark: re.compile(rf"[-+−]?[1-9]\d{{0,2}}([{other}'’\s]\d{{3}})+([{mark}]\d*)?")
    for mark, other in (".,", ",.")
}
_INFINITE = {"inf", "infinity", "infty", "∞"}
_MISSING_CELLS = {
    "", "-", "--", "---", "n/a", "n.a.", "na", "#n/a", "#nv", "nan", "-nan", "+nan", "null", "none",
    "#num!", "#div/0!", "#value!", "#ref!",
    *(sign + word for sign in ("", "+", "-") for word in _INFINITE),
}  # fmt: skip
COMMENT = re.compile(r"^\s*(#+|%+(?![\t;,])|//|!|\*+)\s*")  # a "%" in its own cell is a unit
_REMARK = re.compile(r"(?<=[\d\s])(#|//|!).*$")  # behind numbers
_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", None: "spaces"}


class Row(NamedTuple):
    """One line of a file: its number, counted from 1, its cells, and whether it is a comment.

    In a table, `segment` counts the lines of names above it from 0, `step` the steps of a test
    from 1.
    """

    line: int
    cells: list[str]
    comment: bool = False
    segment: int = 0
    step: int = 0

    @property
    def num_numbers(self) -> int:
        return sum(map(holds_number, self.cells))

    @property
    def text(self) -> str:
        """Its start, with single spaces between the cells that are not empty."""
        return " ".join(filter(None, self.cells[:LONGEST_TEXT]))[:LONGEST_TEXT]


class Sheet(NamedTuple):
    """The rows of a file, or of one sheet of a workbook.

    - `name`: of the sheet; empty for a text file.
    - `layout`: its encoding, separator and decimal mark, in words.
    - `spaced`: whether spaces separate its cells, so that no cell can be empty.
    - `fixed`: what its format says of its moduli.
    """

    name: str
    rows: list[Row]
    layout: str
    spaced: bool = False
    fixed: Options = Options()

    def numbers_only(self, width: int) -> "Sheet":
        """Returns the first cells of the rows of numbers."""
        rows = [row._replace(cells=row.cells[:width]) for row in self.rows if holds_data(row)]
        return self._replace(rows=rows)


class TextLayout(NamedTuple):
    """The separator of the cells of a text, None for spaces, its decimal mark, and others."""

    separator: str | None
    decimal: str
    grouped: bool = False

    def __str__(self) -> str:
        commas = " and decimal commas" * (self.decimal == ",")
        return (
            _SEPARATORS[self.separator] + commas + ", with marks between thousands" * self.grouped
        )

    def split(self, line: str) -> list[str]:
        """Returns the cells of a line unchanged."""
        if self.separator is None:
            return line.replace('"', "").split()
        rows = csv.reader([line], delimiter=self.separator, skipinitialspace=True)
        return [cell.strip() for cell in next(rows, [])]


def holds_number(cell: str) -> bool:
    try:
        return len(cell) <= LONGEST_NUMBER and "_" not in cell and math.isfinite(float(cell))
    except ValueError:
        return False


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or marks a missing value."""
    return len(cell) <= LONGEST_NUMBER and cell.lower() in _MISSING_CELLS


def _is_written(cell: str, fullmatch: Callable[[str], Any]) -> bool:
    """Whether a cell is a number of this form."""
    return len(cell) <= LONGEST_NUMBER and fullmatch(cell) is not None


def is_infinite(cell: str) -> bool:
    """Whether a cell says infinite, as a relaxation time of the equilibrium is."""
    return cell.lower().lstrip("+") in _INFINITE


def holds_data(row: Row) -> bool:
    """Whether a row holds numbers; some may be missing, and some cells may be words, as a sample's
    name."""
    numbers = row.num_numbers
    words = len(row.cells) - numbers - sum(map(is_missing, row.cells))
    return 2 * numbers > words and (numbers >= 2 or words == 0)


def stripped(cells: Sequence[Any]) -> list[Any]:
    """Returns the cells without the empty ones at the end."""
    count = max((i + 1 for i, cell in enumerate(cells) if cell != ""), default=0)
    return list(cells[:count])


# Text.


def lines_of(text: str, longest: int) -> list[str]:
    """Returns the lines of a text; raises `Refusal` for too many, or one that is too long."""
    if max(text.count("\n"), text.count("\r")) > MOST_CELLS:
        raise Refusal(f"it has more than {MOST_CELLS:g} lines")
    lines = re.split(r"\r\n|\r|\n", text)
    if max(map(len, lines)) > longest:
        raise Refusal("its lines are too long for a table")
    return lines


def text_layout(lines: Iterable[str], least: int) -> TextLayout:
    """Returns the layout in which most cells are numbers, of rows with at `least` so many."""
    # The end of a file holds its numbers, the start may be all words.
    sample = [line[:5000] for line in lines if line.strip()][-200:]
    layouts = [TextLayout(separator, decimal) for decimal in ".," for separator in _SEPARATORS]
    best = max(layouts, key=lambda each: _score(map(each.split, sample), each.decimal, least))
    cells = itertools.chain.from_iterable(map(best.split, sample))
    return best._replace(
        grouped=any(_is_written(cell, _GROUPED[best.decimal].fullmatch) for cell in cells)
    )


def _score(table: Iterable[list[str]], decimal: str, least: int) -> tuple[int, int]:
    """How well a table is read with a decimal mark.

    Marks between thousands count less: 1,234 alone is a little more than one, but 1,234 next to
    0.5 is a thousand.
    """
    total, plain = 0, 0
    for cells in table:
        plains = sum(_is_written(cell, _PLAIN_NUMBER[decimal].fullmatch) for cell in cells)
        numbers = plains + sum(_is_written(cell, _GROUPED[decimal].fullmatch) for cell in cells)
        words = len(cells) - numbers - sum(map(is_missing, cells))
        if numbers >= least and 2 * numbers > words:  # not a sentence with numbers in it
            total += 2 * numbers - words
            plain += plains
    return total, plain


def _shortened(cell: str) -> str:
    """The start of a cell; with a mark, so that digits do not become a number."""
    return cell if len(cell) <= LONGEST_WORDS else cell[:LONGEST_WORDS] + "…"


def _pointed(cell: str, decimal: str) -> str:
    """A number with a decimal point and nothing between thousands; of other cells the start."""
    if _is_written(cell, _GROUPED[decimal].fullmatch):
        cell = re.sub(rf"[^-+−\d{decimal}]", "", cell)
    elif not _is_written(cell, _PLAIN_NUMBER[decimal].fullmatch):
        return _shortened(cell)
    return cell.replace("−", "-").replace(",", ".").replace("d", "e").replace("D", "e")


def text_sheet(
    lines: list[str], layout: TextLayout, encoding: str, most_cells: float = MOST_CELLS
) -> Sheet:
    """Returns the rows of a text, numbers with a decimal point; raises `Refusal` for too many."""

    def cells(line: str) -> list[str]:
        found = layout.split(line)
        if layout.decimal == "." and all(map(holds_number, found)):  # as most lines
            return found
        return [_pointed(cell, layout.decimal) for cell in found]

    rows, count = [], 0
    for number, line in enumerate(lines, start=1):
        bare = COMMENT.sub("", line, count=1)
        row = Row(number, cells(bare), comment=bare != line)
        if _REMARK.search(bare):
            without = row._replace(cells=cells(_REMARK.sub("", bare)))
            if holds_data(without) and without.num_numbers >= row.num_numbers:
                row = without
        if row.cells:
            rows.append(row)
            count += len(row.cells)
        if count > most_cells:
            raise Refusal(f"it has more than {most_cells:g} cells")
    if layout.separator is None:  # names such as "Storage modulus" hold single spaces
        data = list(map(holds_data, rows))
        width = max((len(row.cells) for row in itertools.compress(rows, data)), default=0)
        for i in itertools.compress(range(len(rows)), map(operator.not_, data)):
            line = COMMENT.sub("", lines[rows[i].line - 1], count=1).strip()
            names = list(map(_shortened, re.split(r"\t|\s{2,}", line)))
            rows[i] = rows[i]._replace(cells=names if len(names) == width else rows[i].cells)
    return Sheet("", rows, f"{encoding} text with {layout}", layout.separator is None)


# Files and workbooks.


def sheets_of(file: File) -> list[Sheet]:
    """Returns the sheets of a workbook, or a text as the only sheet, without empty rows.

    Workbooks are read without pandas, which pads every row to the widest one: a few far cells would
    fill memory. Raises `Refusal` for what is no table; damaged workbooks raise any error.
    """
    workbooks = {b"\xd0\xcf\x11\xe0": _xls, b"PK\x03\x04": _xlsx}
    if read := workbooks.get(file.content[:4]):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions, not of cells
            return [_book_sheet(*each) for each in read(file)]
    if file.decoded is None:
        raise Refusal("it is neither a table of text nor an Excel workbook")
    text, encoding = file.decoded
    lines = lines_of(text, LONGEST_LINE)
    sheet = text_sheet(lines, text_layout(lines, 2), encoding)
    # Numbers may be commented out.
    rows = [row for row in sheet.rows if any(row.cells) and not (row.comment and holds_data(row))]
    return [sheet._replace(rows=rows)]


def _xls(file: File) -> Iterator[tuple[str, Iterable]]:
    xlrd = extra("xlrd")
    values = (xlrd.XL_CELL_TEXT, xlrd.XL_CELL_NUMBER)  # those of other cells are codes
    # Rows that are not ragged are padded to the widest.
    options = {"logfile": io.StringIO(), "ragged_rows": True}
    with xlrd.open_workbook(file_contents=file.content, **options) as book:
        for sheet in book.sheets():
            rows = sheet.get_rows()
            yield sheet.name, ([c.value if c.ctype in values else "" for c in row] for row in rows)


def _xlsx(file: File) -> Iterator[tuple[str, Iterable]]:
    openpyxl = extra("openpyxl")
    check_archive(file.content, may_unpack(file.packed, UNPACKED_BOOK))
    book = openpyxl.load_workbook(io.BytesIO(file.content), read_only=True, data_only=True)
    with contextlib.closing(book):
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # which may reach far beyond the cells
            yield sheet.title, sheet.values


def _book_sheet(name: str, table: Iterable[Iterable[Any]]) -> Sheet:
    rows: list[tuple[int, list[Any]]] = []
    width = 0
    for line, values in enumerate(table, start=1):
        # Libraries give a million empty rows before a far one.
        if values and (row := stripped(["" if value is None else value for value in values])):
            rows.append((line, row))
            width = max(width, len(row))
        if line > MOST_ROWS or width * len(rows) > MOST_CELLS:
            limit = f"{MOST_ROWS} rows or {MOST_CELLS:g} cells"
            raise Refusal(f"its sheet {name!r} has more than {limit}")
    # Numbers may be cells of text: these decide about the decimal mark.
    texts = [cell.strip() for _, row in rows for cell in row if isinstance(cell, str)]
    marked = (*_PLAIN_NUMBER.values(), *_GROUPED.values())
    texts = [
        text for text in texts if any(_is_written(text, number.fullmatch) for number in marked)
    ]
    decimal = max(".,", key=lambda mark: _score([texts], mark, 2))
    padded = []
    for line, row in rows:
        cells = [_pointed(str(cell).replace("\ufeff", "").strip(), decimal) for cell in row]
        padded.append(Row(line, cells + [""] * (width - len(row))))
    return Sheet(name, padded, f"sheet {name!r} of a workbook")
