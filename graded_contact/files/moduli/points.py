"""From the columns of a table to moduli in SI units, point by point.

Each function adds to `notes` what it understood or did, in sentences; every row left out is told,
with the reason.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int

from ...core.checks import Numbers
from .cells import Row, is_missing
from .isotherms import isotherms, note_isotherms, temperatures
from .layout import HELD, SAME, Layout
from .quantities import DIMENSIONS, SI
from .tables import Column, misfit, stripped

CREDIBLE = (1e2, 1e12)  # Pa
# What numbers can be, in SI units: instruments write 9.9e37 and the like where they measured none.
LIMITS = {"modulus": 1e30, "stress": 1e30, "compliance": 1e30}
LIMIT = 1e100  # of shifted frequencies and times
HOTTEST = 1e4  # K


class Points(NamedTuple):
    """Measured points, sorted by isotherm, then by frequency or time; see `measured.Measured`."""

    deformation: str
    abscissa: Float[np.ndarray, " points"]
    values: Complex[np.ndarray, " points"] | Float[np.ndarray, " points"]
    temperature: Float[np.ndarray, " points"] | None
    isotherm: Int[np.ndarray, " points"]
    lines: Int[np.ndarray, " points"]


class _Entries(NamedTuple):
    """The numbers of a table in SI units, with the curve and line of each row."""

    si: dict[str, np.ndarray]
    check: np.ndarray
    curve: np.ndarray
    lines: np.ndarray

    def only(self, chosen: np.ndarray) -> "_Entries":
        si = {quantity: values[chosen] for quantity, values in self.si.items()}
        return _Entries(si, self.check[chosen], self.curve[chosen], self.lines[chosen])


def measured_points(
    layout: Layout, poisson: Numbers | None, temperature: Numbers | None, notes: list[str]
) -> Points:
    """Returns the points of a table; `poisson` and `temperature` as in `read_moduli`."""
    notes += [_understood(column) for column in layout.columns.values()] + layout.notes
    entries = _entries(layout, notes)
    kelvin = temperatures(layout, entries.curve, entries.si.get("temperature"), temperature, notes)
    abscissa = entries.si["frequency" if layout.kind == "frequency" else "time"]
    isotherm = isotherms(kelvin, entries.curve, abscissa, layout.blocks > 1)
    held = _held(layout, entries, isotherm, notes)
    if not np.all(held):
        entries, abscissa = entries.only(held), abscissa[held]
        kelvin = None if kelvin is None else kelvin[held]
        isotherm = np.unique(isotherm[held], return_inverse=True)[1]
    values = _values(layout, entries.si)
    _check_credible(values.real if layout.kind != "creep" else 1 / values, entries.lines, notes)
    if layout.check is not None:
        _compare_tan_delta(layout.check, entries, values, notes)
    deformation, factor = _deformation(layout, poisson, notes)
    values = values / factor if layout.kind == "creep" else factor * values
    note_isotherms(kelvin, isotherm, notes)
    order = np.lexsort((abscissa, isotherm))
    if layout.blocks == 1 and np.any(np.diff(entries.lines[order]) < 0):
        notes.append("Sorted the rows.")
    points = Points(
        deformation=deformation,
        abscissa=abscissa[order],
        values=values[order],
        temperature=None if kelvin is None else kelvin[order],
        isotherm=isotherm[order],
        lines=entries.lines[order],
    )
    _check_sweep(layout, points, notes)
    return points


def _understood(column: Column) -> str:
    label = column.label[0].upper() + column.label[1:]
    of = {None: "", "10": "decimal logarithm of ", "e": "natural logarithm of "}[column.base]
    by = "" if column.factor == 1 or column.quantity == "temperature" else (
        f"; times {column.factor:.6g} in {SI[DIMENSIONS[column.quantity]]}"
    )  # fmt: skip
    return f"{label}: {of}{column.quantity} in {column.unit}, {column.source}{by}."


# Rows to numbers.


def _entries(layout: Layout, notes: list[str]) -> _Entries:
    columns, found, check, places = layout.columns, [], [], []
    left: dict[str, list[tuple[int, str]]] = {}  # reason: lines, with what stands there
    unusable = 0

    def leave(reason: str, line: int, what: str = "") -> None:
        left.setdefault(reason, []).append((line, what))

    for curve, row in _curves(layout):
        width, entries = layout.blocks * layout.width, len(stripped(row.cells))
        if misfit(entries, width, layout.spaced):
            leave(f"{entries} entries, where there are {width} columns", row.line)
            unusable += 1
            continue
        block = curve % layout.blocks
        mine = row.cells + [""] * (layout.blocks * layout.width - len(row.cells))
        mine = mine[block * layout.width :][: layout.width]
        empty = sum(is_missing(mine[column.place]) for column in columns.values())
        if empty:
            if layout.blocks == 1 or empty < len(columns):
                leave("a missing value", row.line)
            continue
        numbers = [column.si(mine[column.place]) for column in columns.values()]
        bad = [
            (reason, column)
            for number, column in zip(numbers, columns.values(), strict=True)
            if (reason := _refused(column, number))
        ]
        if bad:
            reason, column = bad[0]
            cell = mine[column.place]
            leave(f"{column.label}, where the {column.quantity} {reason}", row.line, repr(cell))
            unusable += column.quantity not in ("stress", "strain")  # none before and after a test
        elif "time" in columns and numbers[list(columns).index("time")] == 0:
            leave("the time 0", row.line)
        else:
            found.append(numbers)
            check.append(layout.check.si(mine[layout.check.place]) if layout.check else np.nan)
            places.append((curve, row.line))
    left_out = [_left_out(reason, lines) for reason, lines in left.items()]
    if len(found) < 2 or unusable > len(found):
        raise ValueError(
            f"{len(found)} complete rows of numbers are left; at least 2 are needed, and half of "
            f"them. {' '.join(left_out)} Are the columns and units right (`columns`, `units`)"
        )
    notes += left_out
    words = [(row.line, "") for segment in layout.segments for row in segment.words]
    if words:
        notes.append(_left_out("having no numbers", words))
    table, where = np.array(found).T, np.array(places).T
    return _Entries(dict(zip(columns, table, strict=True)), np.array(check), where[0], where[1])


def _curves(layout: Layout) -> Iterable[tuple[int, Row]]:
    """Each row, once for each block, with the number of the curve that it belongs to."""
    for number, segment in enumerate(layout.segments):
        for row in segment.data:
            for block in range(layout.blocks):
                yield number * layout.blocks + block, row


def _refused(column: Column, value: float) -> str | None:
    """What a number in SI units must be that this one is not."""
    if np.isnan(value):
        return "must be a number"
    if column.quantity == "temperature":
        return None if 0 < value < HOTTEST else f"must lie between absolute zero and {HOTTEST:g} K"
    if column.quantity == "time" and value == 0:
        return None
    if value <= 0 and column.base is None:
        return "must be a positive number"
    if column.quantity == "phase" and not value < np.pi / 2:
        return "must be an angle below 90°"
    limit = LIMITS.get(DIMENSIONS[column.quantity], LIMIT)
    if not 1 / limit <= value <= limit:
        return f"must lie between {1 / limit:g} and {limit:g} {SI[DIMENSIONS[column.quantity]]}"
    return None


def _left_out(reason: str, lines: list[tuple[int, str]]) -> str:
    rows = list(dict.fromkeys(lines))
    return f"Left out for {reason}: {len(rows)} row(s), line {_listed(rows)}."


def _listed(rows: list[tuple[int, str]]) -> str:
    """All lines with what stands there; neighbours of which nothing is told as "4-9"."""
    parts: list[list[int | str]] = []
    for line, what in rows:
        if parts and not what and not parts[-1][2] and line == int(parts[-1][1]) + 1:
            parts[-1][1] = line
        else:
            parts.append([line, line, what])
    return ", ".join(
        (f"{first}" if first == last else f"{first}-{last}") + (f" ({what})" if what else "")
        for first, last, what in parts
    )


def _held(layout: Layout, entries: _Entries, isotherm: np.ndarray, notes: list[str]) -> np.ndarray:
    """Which rows are of the load that the test holds constant: not of loading, nor of recovery."""
    good = np.ones(len(isotherm), bool)
    if "stress" not in entries.si or "strain" not in entries.si:
        return good
    quantity = "stress" if layout.kind == "creep" else "strain"
    load = entries.si[quantity]
    for i in range(np.max(isotherm) + 1):
        mine = isotherm == i
        typical = np.median(load[mine][load[mine] > 0.5 * np.max(load[mine])])
        good[mine] = np.abs(load[mine] / typical - 1) < 2 * HELD
        notes.append(f"{quantity.capitalize()} held at {typical:.4g} {SI[quantity]}.")
    if not np.all(good):
        rows = [(int(line), "") for line in entries.lines[~good]]
        notes.append(_left_out(f"a {quantity} that departs from it by {2 * HELD:.0%}", rows))
    if np.sum(good) < max(2, 0.5 * len(good)):
        raise ValueError(
            f"the {quantity} is not held constant: this is no {layout.kind}. {' '.join(notes[-2:])}"
        )
    return good


def _values(layout: Layout, si: dict[str, np.ndarray]) -> Any:
    if layout.kind == "creep":
        direct = si.get("compliance")
        return si["strain"] / si.get("stress", layout.held) if direct is None else direct
    if layout.kind == "relaxation":
        direct = si.get("modulus")
        return si["stress"] / si.get("strain", layout.held) if direct is None else direct
    if "storage" in si and "loss" in si:
        return si["storage"] + 1j * si["loss"]
    ratio = si["tan_delta"] if "tan_delta" in si else np.tan(si["phase"])
    if "storage" in si:
        return si["storage"] * (1 + 1j * ratio)
    if "magnitude" in si:
        return si["magnitude"] / np.hypot(1, ratio) * (1 + 1j * ratio)
    return si["loss"] * (1 / ratio + 1j)


def _deformation(layout: Layout, poisson: Numbers | None, notes: list[str]) -> tuple[str, float]:
    """Tension or shear, and the factor to the modulus to bring it there."""
    said = {column.deformation for column in layout.columns.values()} - {None}
    if len(said) > 1:
        labels = ", ".join(column.label for column in layout.columns.values())
        raise ValueError(f"{labels} mix tension and shear; tell by `columns` which belong together")
    if not said and layout.shear:
        said = {"shear"}
        notes.append(
            f"Taken as of shear, of which the column {layout.shear!r} tells; otherwise pass "
            "`deformation='tension'`."
        )
    if said == {"shear"} and poisson is not None:
        factor = 2 * (1 + float(np.asarray(poisson)))
        notes.append(f"Turned from shear into tension: E = {factor:.6g} G, from `poisson`.")
        return "tension", factor
    if said == {"shear"}:
        notes.append("These are of shear (modulus G); `poisson` turns them into tension (E).")
        return "shear", 1.0
    if not said:
        notes.append("Taken as of tension (Young's modulus); otherwise pass `deformation='shear'`.")
    return "tension", 1.0


# What looks wrong.


def _check_credible(stiffness: np.ndarray, lines: np.ndarray, notes: list[str]) -> None:
    least, most = np.min(stiffness), np.max(stiffness)
    odd = (stiffness < CREDIBLE[0]) | (stiffness > CREDIBLE[1])
    if np.any(odd):
        where = _listed([(int(line), "") for line in np.unique(lines[odd])])
        notes.append(
            f"Warning: moduli from {least:.3g} to {most:.3g} Pa leave the usual "
            f"{CREDIBLE[0]:g} to {CREDIBLE[1]:g} Pa in line {where}: is the unit right?"
        )


def _compare_tan_delta(check: Column, entries: _Entries, values: Any, notes: list[str]) -> None:
    """Compares a column of tan delta, not needed otherwise, with the moduli read."""
    told = entries.check
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        error = np.where(told > 0, np.abs(values.imag / values.real / told - 1), 0)
    worst = int(np.argmax(error))
    if error[worst] < 0.02:
        notes.append(f"The tan delta of {check.label} agrees with loss over storage modulus.")
    else:
        notes.append(
            f"Warning: the tan delta of {check.label} differs from loss over storage modulus by "
            f"{100 * error[worst]:.2g} % in line {entries.lines[worst]}: are the columns right?"
        )


def _check_sweep(layout: Layout, points: Points, notes: list[str]) -> None:
    name = "frequency" if layout.kind == "frequency" else "time"
    abscissa, lines = points.abscissa, points.lines
    least, most = np.min(abscissa), np.max(abscissa)
    single = name == "frequency" and np.max(points.isotherm) == 0
    if least == most or (single and most < (1 + HELD) * least):
        raise ValueError(f"the {name} is the same in every row: this is no sweep over {name}")
    near = np.diff(abscissa) <= SAME * abscissa[:-1]
    twice = np.flatnonzero(near & (np.diff(points.isotherm) == 0))
    if not len(twice):
        return
    first, second = lines[twice[0] : twice[0] + 2]
    notes.append(
        f"{len(twice)} points repeat the {name} of another at their temperature (first in "
        f"lines {first} and {second}); all are kept."
    )
    apart = np.abs(points.values[twice + 1] / points.values[twice] - 1)
    if len(twice) >= 0.25 * len(lines) and np.median(apart) > 0.1:
        doubt = (
            "isotherms, whose column of temperature is missing?"
            if points.temperature is None
            else "tests, of other strain for instance? `step` chooses those to read."
        )
        notes.append(
            f"Warning: repeated points differ by {np.median(apart):.0%}: are these several {doubt}"
        )
