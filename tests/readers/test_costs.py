"""The cost of a text or a workbook is proportional to its bytes, or it is refused before."""

import contextlib
import cProfile
import re

import pytest
from test_containers import sheet

from graded_contact import read_moduli, read_surface
from graded_contact.readers import cells

HEAD = "f [Hz],E1 [Pa],E2 [Pa]"
ROWS = "1,2e6,3e6\n2,3e6,4e6\n"
TEXTS = {
    "tables": lambda n: n * f"{HEAD}\n{ROWS}",
    "tables of other columns": lambda n: "".join(
        f"{HEAD},x{i}\n1,2e6,3e6,1\n2,3e6,4e6,1\n" for i in range(n)
    ),
    "steps": lambda n: f"step,{HEAD}\n" + "".join(
        f"{i},{j},2e6,3e6\n" for i in range(n) for j in range(1, 5)
    ),
    "isotherms": lambda n: f"{HEAD},T [C]\n" + "".join(
        f"{j},2e6,3e6,{5 * i}\n" for i in range(n) for j in range(1, 3)
    ),
    "signals": lambda n: n * "Sig1 Time (min)\n" + n * "1,2,3\n",
    "words": lambda n: "".join(f"w{i},v{i},u{i}\n" for i in range(4 * n)),
    "words and numbers": lambda n: HEAD + "\n" + ROWS + "".join(f"w{i},v\n" for i in range(4 * n)),
    "names": lambda n: "".join(f"f {i} [Hz],E1 {i} [Pa],E2\n" for i in range(n)) + 2 * ROWS,
    "a line of numbers": lambda n: n * "1.5 " + "\n",
    "a line of words": lambda n: n * "um " + "\n" + ROWS,
    "a line of brackets": lambda n: 9 * n * "(" + "\n" + ROWS,
    "a line of steps": lambda n: n * "step probe " + "\n" + ROWS,
    "columns": lambda n: n * "a," + "b\n" + ROWS,
    "a long title": lambda n: f"stress 5{' ,' * n}x\n{HEAD}\n{ROWS}",
}  # fmt: skip


def calls(read):
    """How many functions, of Python and of C, a reading calls."""
    with cProfile.Profile() as made, contextlib.suppress(ValueError):
        read()
    return sum(entry.callcount for entry in made.getstats())


@pytest.mark.parametrize("kind", TEXTS)
def test_calls_grow_no_faster_than_the_bytes_of_a_text(tmp_path, kind):
    reads = {
        "moduli": lambda path: read_moduli(path, temperature=300.0),
        "heights": lambda path: read_surface(path, unit="um", size=1e-3),
    }
    for read in reads.values():
        counts = []
        for n in (2, 20, 80):  # the first imports
            path = tmp_path / f"{len(counts)}.csv"
            path.write_text(TEXTS[kind](n))
            counts.append(calls(lambda path=path, read=read: read(path)))
        assert counts[2] < 6 * counts[1], counts  # 16 if they grew with the square


@pytest.mark.parametrize(
    "line", ["7" * 3000 + ",7" * 9, "1" + " 777" * 750 + ",x", "1," + "-" * 3000]
)
def test_no_number_is_looked_for_in_long_cells(tmp_path, monkeypatch, line):
    """The search for numbers sees each character a few times, and no cell of thousands of them."""
    seen = []

    class Counting:
        def __init__(self, pattern):
            self.pattern = pattern

        def fullmatch(self, cell):
            seen.append(len(cell))
            return self.pattern.fullmatch(cell)

    for patterns in (cells._PLAIN_NUMBER, cells._GROUPED):
        for mark, pattern in patterns.items():
            monkeypatch.setitem(patterns, mark, Counting(pattern))
    (tmp_path / "a.csv").write_text(10 * f"{line}\n")
    with pytest.raises(ValueError, match=r"no table of numbers is found|columns without names"):
        read_moduli(tmp_path / "a.csv")
    assert max(seen) <= cells.LONGEST_NUMBER
    assert sum(seen) < 20 * 11 * len(line)


@pytest.mark.parametrize("cell, known", [
    ("1.", True), (".5", True), ("-1.5e-3", True), ("−2", True), ("1d5", True), ("+7E+2", True),
    ("1.5.2", False), (".", False), ("1e", False), ("e5", False), ("--1", False), ("", False),
])  # fmt: skip
def test_the_form_of_a_number(cell, known):
    assert (cells._PLAIN_NUMBER["."].fullmatch(cell) is not None) == known
    other = re.sub(r"\.", ",", cell)
    assert (cells._PLAIN_NUMBER[","].fullmatch(other) is not None) == known


def test_a_workbook_of_many_rows_in_few_bytes_is_refused_before_a_row_is_read(
    tmp_path, monkeypatch
):
    sheet(tmp_path / "a.xlsx", b"<row><c><v>1</v></c></row>" * 350_000)
    monkeypatch.setattr(cells, "_book_sheet", None)
    for read in (read_moduli, lambda path: read_surface(path, unit="m", size=1e-3)):
        with pytest.raises(ValueError, match=r"a\.xlsx` is refused: it unpacks to more than"):
            read(tmp_path / "a.xlsx")


def test_a_long_number_of_all_digits_is_read_and_a_long_word_is_no_name(tmp_path):
    digits = f"{1e306:f}"
    (tmp_path / "b.csv").write_text(40 * f"{'7' * 3000},{'7' * 3000}\n")
    with pytest.raises(ValueError, match="no table of numbers is found"):
        read_moduli(tmp_path / "b.csv")
    assert cells.holds_number(digits) and not cells.holds_number(2 * digits)
    rows = "".join(f"{i},{i + 1}e6\n" for i in range(1, 6))
    (tmp_path / "a.csv").write_text(f"{'word ' * 1000}\ntime [s],modulus [Pa]\n{rows}")
    assert len(read_moduli(tmp_path / "a.csv").values) == 5
