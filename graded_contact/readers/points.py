"""From the columns of a table to moduli in SI units, point by point, and their isotherms.

Each function adds to the log what it understood or did, in sentences; every row that is left out is
reported, with the reason.
"""

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core.checks import Numbers
from ..materials.measured import ISOTHERM_GAP, Measured, grouped
from ..materials.shift import check_kelvin
from .cells import Row, is_infinite, is_missing
from .columns import SAME_FREQUENCY, MeasuredTable
from .deformation import as_young
from .tables import HUGE, DataColumn, value_above
from .units import DIMENSIONS, SI
from .ways import CONSTANT

CREDIBLE = (1e2, 1e12)  # Pa
# What numbers can be, in SI units: instruments write 9.9e37 and the like where they measured none.
HUGE_OF = {"modulus": 1e30, "stress": 1e30, "compliance": 1e30}
HOTTEST_TEST = 1e4  # K
RAMP = 5.0  # K over which no isotherm drifts


def measured_points(path: Path, measured: MeasuredTable, lines: Sequence[str]) -> Measured:
    """Returns the points of a table; `lines` are those of the file without numbers."""
    kind, log, total = measured.kind, measured.log, len(measured.points)
    segments = np.unique(measured.points["curve"] // measured.table.blocks).tolist()
    points = _usable(measured, segments)
    kelvin = _kelvins_of(measured, points, segments)
    if kelvin is not None:
        points["temperature"] = kelvin
    points["isotherm"] = _isotherms(points, measured.abscissa, separate=measured.table.blocks > 1)
    points = _at_constant_load(measured, points)
    if len(points) < total:
        log.note(f"{len(points)} of {total} points are used.")
    numbers = [points[name].to_numpy() for name in measured.way.names[1:]]
    values = measured.way.value(*numbers, *[measured.load] * (measured.load is not None))
    _note_unusual(measured, points, 1 / values if kind == "creep" else values)
    deformation, factor = as_young(measured, lines)
    points["values"] = values / factor if kind == "creep" else factor * values
    # Stable: points that repeat a frequency keep the order of the file.
    points = points.sort_values(["isotherm", measured.abscissa])
    _note_isotherms(measured, points)
    if measured.table.blocks == 1 and not points["line"].is_monotonic_increasing:
        log.note("Sorted the rows.")
    _check_abscissa(measured, points)
    if measured.unused:
        log.note(f"Not used: {', '.join(map(repr, dict.fromkeys(measured.unused)))}.")
    names = (measured.abscissa, "values", "isotherm", "line")
    abscissa, values, isotherm, places = (np.array(points[name]) for name in names)
    kelvin = None if kelvin is None else np.array(points["temperature"])
    told = tuple(log.history), tuple(log.assumed)
    return Measured(kind, deformation, abscissa, values, kelvin, isotherm, places, path, *told)


# Which points are used.


def _usable(measured: MeasuredTable, segments: Sequence[int]) -> Any:
    """The points that can be used, with their curves counted from 0."""
    points = measured.points.assign(
        curve=np.unique(measured.points["curve"], return_inverse=True)[1]
    )
    _check_finite(measured)
    left_out, unusable, good = [], 0, np.ones(len(points), bool)
    for reason, bad, wrong, place in _reasons(measured, points):
        out = np.flatnonzero(good & bad)
        good &= ~bad
        unusable += wrong * len(out)
        lines, cells = points["line"].to_numpy()[out].tolist(), points["cells"].to_numpy()[out]
        shown = [
            (line, "" if place is None else repr(each[place]))
            for line, each in zip(lines, cells, strict=True)
        ]
        left_out += [_left_out(reason, shown)] * (len(out) > 0)
    if np.sum(good) < 2 or unusable > np.sum(good):
        reason = f"{np.sum(good)} complete rows are left; at least 2 and half of all are needed"
        raise ValueError(f"{reason}. {' '.join(left_out)} Check `columns` and `units`")
    words = [(row.line, "") for row in measured.table.words if row.segment in segments]
    measured.log.note(*left_out, *[_left_out("having no numbers", words)] * bool(words))
    return points[good].reset_index(drop=True)


def _check_finite(measured: MeasuredTable) -> None:
    """Refuses an infinite time, which a relaxation or creep test has not, but a Prony series."""
    place, points = measured.columns[measured.abscissa].place, measured.points
    infinite = [is_infinite(each[place]) for each in points["cells"]]
    if measured.kind in ("relaxation", "creep") and any(infinite):
        raise ValueError(
            f"line {points['line'][infinite].iloc[0]} has an infinite time: `readers.read_prony` "
            "reads a Prony series; of a test leave out this row"
        )


def _reasons(measured: MeasuredTable, points) -> Iterator:
    """Reasons to leave out points, the first counts: which, if these are wrong, by which cell."""
    columns, blocks, curve = measured.columns, measured.table.blocks, points["curve"].to_numpy()
    entries = points["entries"].to_numpy()
    for count in np.unique(entries[entries > 0]):
        width = blocks * len(measured.table.names)
        yield f"{count} entries in {width} columns", entries == count, True, None
    places = [column.place for column in columns.values()]
    empty = np.array([[is_missing(each[place]) for place in places] for each in points["cells"]])
    infinite = [any(is_infinite(each[place]) for place in places) for each in points["cells"]]
    for block in range(blocks) if blocks > 1 else ():  # a curve may end above the others
        ended = empty.all(axis=1) & (curve % blocks == block)
        yield f"an empty curve {block + 1} of {blocks}", ended, False, None
    yield "an infinite value", np.array(infinite), False, None
    yield "a missing value", empty.any(axis=1), False, None
    for name, column in columns.items():
        wrong = name not in ("stress", "strain")  # there is none before and after a test
        for condition, bad in _limits_of(column, points[name].to_numpy()):
            yield f"{column.label}, where the {name} {condition}", bad, wrong, column.place
    yield "the time 0", (points[measured.abscissa] == 0).to_numpy(), False, None


def _limits_of(column: DataColumn, values: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Conditions, and which numbers in SI units do not meet them."""
    yield "must be a number", np.isnan(values)
    if column.quantity == "temperature":
        bad = ~((values > 0) & (values < HOTTEST_TEST))
        yield f"must lie between absolute zero and {HOTTEST_TEST:g} K", bad
        return
    begins = (column.quantity == "time") & (values == 0)
    if column.base is None:
        yield "must be a positive number", (values <= 0) & ~begins
    if column.quantity == "phase":
        yield "must be an angle below 90°", values >= np.pi / 2
    limit, unit = HUGE_OF.get(DIMENSIONS[column.quantity], HUGE), SI[DIMENSIONS[column.quantity]]
    bad = ~((values >= 1 / limit) & (values <= limit)) & ~begins
    yield f"must lie between {1 / limit:g} and {limit:g} {unit}", bad


def _left_out(reason: str, points: list[tuple[int, str]]) -> str:
    """Why points were left out, and all their lines, with cells; neighbours without as "4-9"."""
    rows = list(dict.fromkeys(points))  # side by side, a row has several points
    what = "row" if len(rows) == len(points) else "point"
    parts = [f"{line} ({cell})" for line, cell in rows if cell] or _ranges([r[0] for r in rows])
    return f"Left out for {reason}: {len(points)} {what}(s), line {', '.join(parts)}."


def _ranges(lines: list[int]) -> list[str]:
    runs = itertools.groupby(enumerate(lines), key=lambda pair: pair[1] - pair[0])
    ends = [[line for _, line in run] for _, run in runs]
    return [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in ends]


def _at_constant_load(measured: MeasuredTable, points) -> Any:
    """The points at the load that the test holds constant: not of loading, nor of recovery."""
    if not {"stress", "strain"} <= set(measured.columns):
        return points
    quantity = "stress" if measured.kind == "creep" else "strain"
    log, good = measured.log, np.ones(len(points), bool)
    for _, load in points[quantity].groupby(points["isotherm"]):
        typical = np.median(load[load > 0.5 * np.max(load)])  # neither rest nor recovery
        good[load.index] = np.abs(load / typical - 1) < 2 * CONSTANT
        log.note(f"Constant {quantity}: {typical:.4g} {SI[quantity]}.")
    if not np.all(good):
        lines = [(line, "") for line in points["line"][~good].tolist()]
        log.note(_left_out(f"a {quantity} that differs from it by {2 * CONSTANT:.0%}", lines))
    if np.sum(good) < max(2, 0.5 * len(good)):
        needs = f"the {quantity} is not constant, as {measured.kind} needs"
        raise ValueError(f"{needs}. {' '.join(log.history[-2:])}")
    points = points.loc[good].copy()
    points["isotherm"] = np.unique(points["isotherm"], return_inverse=True)[1]
    return points


# Isotherms.


def one_each(temperature: Numbers | None, count: int, what: str) -> Any:
    """Returns a temperature for each of so many files, sheets or curves; None if it is unknown."""
    if temperature is None:
        return [None] * count
    kelvin = np.asarray(temperature, float)
    check_kelvin("temperature", kelvin)
    if kelvin.shape not in ((), (count,)):
        needed = f"one number is needed, or one for each of the {count} {what}"
        raise ValueError(f"`temperature` has shape {kelvin.shape}; {needed}.")
    return np.broadcast_to(kelvin, (count,))


def _kelvins_of(measured: MeasuredTable, points, segments: Sequence[int]) -> Any:
    """The temperatures [K]: as given, of a column, or of titles above curves ("25 °C")."""
    table, curve, given = measured.table, points["curve"].to_numpy(), measured.options.temperature
    if given is not None:
        return one_each(given, table.blocks * len(segments), "curve(s)")[curve]
    if "temperature" in points:
        return points["temperature"]
    found, width = [], len(table.names)
    for segment, block in itertools.product(segments, range(table.blocks)):
        rows = table.above[segment]
        if table.blocks > 1:  # the last line above has a title over each block
            cells = [row.cells[block * width : (block + 1) * width] for row in rows[-1:]]
            rows = [Row(rows[-1].line, part) for part in cells if part]
        found.append(table.kelvins[block] if table.kelvins else value_above(rows, "temperature"))
    if None in found:
        return None
    listed = ", ".join(f"{value:.2f}" for value in found)
    measured.log.note(f"Took the temperature from the lines above the numbers: {listed} K.")
    return np.array(found)[curve]


def _isotherms(points, name: str, separate: bool) -> np.ndarray:
    """Numbers of isotherms from 0, the coldest first.

    An isotherm is a group of temperatures; or a curve, if these are `separate`. Without
    temperatures the curves are isotherms if they overlap in the abscissa, of this name.
    """
    curve, abscissa = points["curve"].to_numpy(), points[name].to_numpy()
    if "temperature" not in points:
        ends = sorted((part.min(), part.max()) for _, part in points.groupby("curve")[name])
        over = any(low < high for (_, high), (low, _) in itertools.pairwise(ends))
        return np.unique(curve, return_inverse=True)[1] if separate or over else 0 * curve
    kelvin = points["temperature"].to_numpy()
    if not separate:
        isotherm = grouped(kelvin)
        if _drift(kelvin, isotherm) <= RAMP:
            return isotherm
        # A slow ramp, on which each sweep is a separate isotherm.
        steps = np.diff(np.log(abscissa), prepend=np.log(abscissa[0]))
        curve = np.cumsum(steps * np.sign(np.median(steps)) < 0)
    curve = np.unique(curve, return_inverse=True)[1]
    means = np.bincount(curve, kelvin) / np.bincount(curve)
    if separate:  # replicates side by side, of one temperature, are one isotherm
        return grouped(means)[curve]
    return np.argsort(np.argsort(means, kind="stable"))[curve]


def _drift(kelvin: np.ndarray, isotherm: np.ndarray) -> float:
    high, low = np.full((2, np.max(isotherm) + 1), [[-np.inf], [np.inf]])
    np.maximum.at(high, isotherm, kelvin)
    np.minimum.at(low, isotherm, kelvin)
    return float(np.max(high - low))


# What is reported, and what looks wrong.


def _note_isotherms(measured: MeasuredTable, points) -> None:
    """Reports the number of isotherms; refuses temperatures that change during a sweep."""
    log, table = measured.log, measured.table
    isotherm = points["isotherm"].to_numpy()
    count = np.max(isotherm) + 1
    if "temperature" not in points:
        if count > 1:
            log.note(f"{count} curves of unknown temperature; pass their `temperature`s [K].")
        return
    kelvin = points["temperature"].to_numpy()
    drift = _drift(kelvin, isotherm)
    if drift > RAMP:
        changes = f"the temperature changes by {drift:.3g} K within a sweep: isotherms are needed"
        beyond = f"numbers above {len(table.names)} in `columns` choose one curve"
        raise ValueError(changes + f"; of those side by side, {beyond}" * (table.blocks > 1))
    ends = f"{np.min(kelvin):.2f} to {np.max(kelvin):.2f} K"
    log.note(f"{count} isotherm(s), {ends}, each constant within {drift:.2g} K.")
    if drift > 2 * ISOTHERM_GAP:
        drifts = f"a temperature drifts by {drift:.3g} K without a step above {ISOTHERM_GAP:g} K"
        log.note(f"Warning: {drifts}; these may not be isotherms.")


def _note_unusual(measured: MeasuredTable, points, values: Any) -> None:
    """Reports moduli of unusual size, and compares a column of tan delta with them."""
    stiffness, log, lines = values.real, measured.log, points["line"].to_numpy()
    odd = (stiffness < CREDIBLE[0]) | (stiffness > CREDIBLE[1])
    if np.any(odd):
        where = ", ".join(_ranges(np.unique(lines[odd]).tolist()))
        span = f"moduli from {np.min(stiffness):.3g} to {np.max(stiffness):.3g} Pa"
        log.note(f"Warning: {span} are unusual in line {where}: is the unit right?")
    if measured.check is None:
        return
    tangent, label = points["check"].to_numpy(), measured.check.label
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        error = np.where(tangent > 0, np.abs(values.imag / stiffness / tangent - 1), 0)
    worst = int(np.argmax(error))
    if error[worst] < 0.02:
        log.note(f"The tan delta of {label} agrees with loss over storage modulus.")
        return
    where = f"{100 * error[worst]:.2g} % in line {lines[worst]}"
    words = f"tan delta of {label} differs from loss over storage modulus by {where}"
    log.note(f"Warning: the {words}: are the columns right?")


def _check_abscissa(measured: MeasuredTable, points) -> None:
    """Refuses points without a sweep; reports points that repeat others."""
    name, log = measured.abscissa, measured.log
    parts = (name, "values", "line", "isotherm")
    abscissa, values, lines, isotherm = (points[part].to_numpy() for part in parts)
    if name == "strain" and "frequency" in points:
        low, high = points["frequency"].min(), points["frequency"].max()
        if high > (1 + CONSTANT) * low:
            varied = f"the frequency varies from {low:.4g} to {high:.4g} rad/s"
            raise ValueError(f"{varied}: choose the sweep of strain by `step`")
    least, most = np.min(abscissa), np.max(abscissa)
    single = name == "frequency" and np.max(isotherm) == 0
    if least == most or (single and most < (1 + CONSTANT) * least):
        hint = " (`readers.read_strain_sweep` reads those over strain)" * (name == "frequency")
        raise ValueError(f"the {name} is the same in every row: no sweep over {name}{hint}")
    near = np.diff(abscissa) <= SAME_FREQUENCY * abscissa[:-1]
    twice = np.flatnonzero(near & (np.diff(isotherm) == 0))
    if not len(twice):
        return
    first, second = lines[twice[0] : twice[0] + 2]
    where = f"first in lines {first} and {second}"
    log.note(f"{len(twice)} points repeat the {name} of another ({where}); all are used.")
    difference = np.median(np.abs(values[twice + 1] / values[twice] - 1))
    if len(twice) >= 0.25 * len(lines) and difference > 0.1:
        remedy = "`step`" if "temperature" in points else "a column of temperature"
        differ = f"repeated points differ by {difference:.0%}: several isotherms or tests?"
        log.note(f"Warning: {differ} Then {remedy} is needed.")
