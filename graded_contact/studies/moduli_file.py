"""Tables of measured moduli: text files of frequency, storage modulus and loss modulus.

A file has one line of column names, optionally a line of units below it, and lines of numbers,
separated by commas, semicolons, tabs or spaces. Lines that start with `#` are left out.
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float

FREQUENCY_UNITS = {"Hz": 2 * np.pi, "kHz": 2e3 * np.pi, "rad/s": 1.0, "1/s": 1.0}
MODULUS_UNITS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}


def read_moduli(
    path: str | os.PathLike,
    *,
    columns: Sequence[str] | None = None,
    frequency_unit: str | None = None,
    modulus_unit: str | None = None,
) -> tuple[Float[np.ndarray, " points"], Complex[np.ndarray, " points"]]:
    """Returns angular frequencies [rad/s], increasing, and complex moduli E' + iE'' [Pa].

    The lines are sorted by frequency. A frequency that occurs twice is refused.

    **Arguments:**

    - `path`: the file.
    - `columns`: names of the columns of frequency, storage and loss modulus; None takes the three
      columns of a file that has no more.
    - `frequency_unit`: one of `FREQUENCY_UNITS`, `modulus_unit`: one of `MODULUS_UNITS`; for a
      file without a line of units.

    **Returns:** two arrays of shape `(points,)`.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise ValueError(f"`path={path}` is not a text file in UTF-8: {error}.") from error
    rows = [
        (number, _cells(line))
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("#")
    ]
    if len(rows) < 3:
        raise ValueError(f"`path={path}` has {len(rows)} lines; a table of moduli has more.")
    names, rows = rows[0][1], rows[1:]
    if all(map(_is_number, names)):
        raise ValueError(f"`path={path}`, line 1: the names of the columns are needed here.")
    units = None
    if not any(map(_is_number, rows[0][1])):
        units, rows = rows[0][1], rows[1:]
    chosen = _choose_columns(path, names, columns)
    numbers = np.array([[_number(path, line, cells, names, i) for i in chosen]
                        for line, cells in rows])  # fmt: skip
    told = [None if units is None or i >= len(units) else units[i] for i in chosen]
    if told[1] != told[2]:
        raise ValueError(
            f"`path={path}`: the moduli have different units, {told[1]} and {told[2]}."
        )
    rate = _unit(path, "frequency_unit", frequency_unit, told[0], FREQUENCY_UNITS)
    scale = _unit(path, "modulus_unit", modulus_unit, told[1], MODULUS_UNITS)
    order = np.argsort(numbers[:, 0], kind="stable")
    numbers = numbers[order]
    twice = np.flatnonzero(np.diff(numbers[:, 0]) == 0)
    if len(twice):
        first, second = (rows[order[i]][0] for i in (twice[0], twice[0] + 1))
        raise ValueError(
            f"`path={path}`, lines {first} and {second}: the same frequency "
            f"{numbers[twice[0], 0]:g} stands in both. Keep one of them."
        )
    return rate * numbers[:, 0], scale * (numbers[:, 1] + 1j * numbers[:, 2])


def _cells(line: str) -> list[str]:
    separator = next((mark for mark in ",;\t" if mark in line), None)
    return [cell.strip() for cell in line.split(separator)]


def _is_number(cell: str) -> bool:
    return re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", cell) is not None


def _number(path: Path, line: int, cells: list[str], names: list[str], column: int) -> float:
    if len(cells) != len(names):
        raise ValueError(
            f"`path={path}`, line {line}: {len(cells)} entries, but line 1 names {len(names)} "
            f"columns ({', '.join(names)})."
        )
    value = float(cells[column]) if _is_number(cells[column]) else np.nan
    if not value > 0:
        raise ValueError(
            f"`path={path}`, line {line}: {names[column]} = {cells[column]!r} is not a positive "
            "number."
        )
    return value


def _choose_columns(path: Path, names: list[str], columns: Sequence[str] | None) -> list[int]:
    listed = ", ".join(names)
    if columns is None:
        if len(names) != 3:
            raise ValueError(
                f"`path={path}` has {len(names)} columns ({listed}); tell by `columns` which are "
                "frequency, storage modulus and loss modulus."
            )
        return [0, 1, 2]
    if len(columns) != 3:
        raise ValueError(
            f"`columns={list(columns)}` must name three: frequency, storage, loss modulus."
        )
    for name in columns:
        if name not in names:
            raise ValueError(f"`path={path}` has no column {name!r}, only {listed}.")
    return [names.index(name) for name in columns]


def _unit(
    path: Path, argument: str, given: str | None, told: str | None, units: dict[str, float]
) -> float:
    if given is None and told is None:
        raise ValueError(
            f"`path={path}` has no line of units: give `{argument}`, one of {list(units)}."
        )
    if given is not None and told is not None and given != told:
        raise ValueError(f"`{argument}={given!r}`, but `path={path}` tells {told!r}; leave it out.")
    unit = told if given is None else given
    if unit not in units:
        raise ValueError(f"The unit {unit!r} of `path={path}` is not one of {list(units)}.")
    return units[unit]
