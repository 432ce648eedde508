"""Heights of roads in OpenCRG files (ASAM OpenCRG 1.2, https://www.asam.net/standards/detail/opencrg/).

A header of text names the channels; the elevations follow, one row per step along the reference
line, as text of 10 or 20 characters a number ("LRFI", "LDFI") or as big-endian floats ("KRBI",
"KDBI"). x runs along the reference line (u), y to the left of it (v). The elevation is that over
the reference line, whose bends, slope and banking are left out.
"""

import re

import numpy as np

from .formats import Scan, equally_spaced
from .paths import Refusal
from .units import metres

_MARK = re.compile(rb"^\$ROAD_CRG", re.MULTILINE | re.IGNORECASE)
_DATA = re.compile(rb"^\$\$[^\n]*\n", re.MULTILINE)
_POSITION = re.compile(r"at\s+v\s*=\s*([-+.\deE]+)")
_PARAMETER = re.compile(r"^\s*(\w+)\s*=\s*([-+.\deE]+)")


def is_road(content: bytes) -> bool:
    return _MARK.search(content[:100_000]) is not None


def read_road(content: bytes) -> Scan:
    """Returns the elevations of a road [m], or raises `Refusal`."""
    end = _DATA.search(content)
    if end is None:
        raise Refusal("its header does not end: no line begins with '$$'")
    sections = _sections(content[: end.start()].decode("latin-1"))
    if "ROAD_CRG_FILE" in sections:
        raise Refusal("it refers to another OpenCRG file; read that one")
    road = _parameters(sections.get("ROAD_CRG", []))
    changes = _parameters(sections.get("ROAD_CRG_MODS", []))
    form, channels = _channels(sections.get("KD_DEFINITION", []))
    sides = [i for i, (name, _) in enumerate(channels) if name.startswith("long section")]
    if len(sides) < 4:
        raise Refusal(f"it has {len(sides)} long sections; at least 4 are needed")
    units = {channels[i][1] for i in sides}
    factor = metres(units.pop()) if len(units) == 1 else None
    if factor is None:
        raise Refusal("its long sections are not all in one unit of length")
    rows = _payload(content[end.end() :], form, len(channels))
    heights = factor * rows[:, sides] * changes.get("SCALE_Z_GRID", 1.0)
    step = road.get("REFERENCE_LINE_INCREMENT", 0.0)
    if not (np.isfinite(step) and step > 0):
        raise Refusal("it has no REFERENCE_LINE_INCREMENT, a length above 0")
    if {"REFERENCE_LINE_START_U", "REFERENCE_LINE_END_U"} <= set(road):
        rows = (road["REFERENCE_LINE_END_U"] - road["REFERENCE_LINE_START_U"]) / step + 1
        if len(heights) < rows - 1:  # rows without any elevation at the end are dropped
            raise Refusal(f"it has {len(heights)} of {rows:.0f} rows of elevations: cut short")
    notes = []
    across = _positions([channels[i][0] for i in sides], road)
    heights, width = _interpolated(heights, across, notes)
    if len(sides) < len(channels):
        notes.append("Heading, slope and banking of the reference line were left out.")
    left_out = ", ".join(sorted(set(changes) - {"SCALE_Z_GRID"}))
    if left_out:
        notes.append(f"The file's modifiers {left_out} were left out.")
    size = np.array([len(heights) * step, heights.shape[1] * width])
    return Scan(heights, "an OpenCRG road", size, "m", "m", notes=tuple(notes))


def _sections(header: str) -> dict[str, list[str]]:
    """The lines of each section, without comments."""
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    for line in header.splitlines():
        if line.startswith("$"):
            name = re.match(r"\$(\w*)", line)
            lines = sections.setdefault(name.group(1).upper() if name else "", [])
        elif not line.startswith("*"):
            lines.append(line.split("!")[0].rstrip())
    return sections


def _parameters(lines: list[str]) -> dict[str, float]:
    found = (_PARAMETER.match(line) for line in lines)
    return {match.group(1).upper(): _float(match.group(2)) for match in found if match}


def _channels(lines: list[str]) -> tuple[str, list[tuple[str, str]]]:
    """The code of the format, and the name and unit of each channel."""
    form, channels = "KRBI", []
    for line in lines:
        if line.startswith("#:"):
            form = line[2:].strip().upper()
        elif line.upper().startswith("D:"):
            name, _, unit = line[2:].partition(",")
            channels.append((" ".join(name.lower().split()), unit.strip()))
    if not re.fullmatch("[LK][RD][FB]I?", form):
        raise Refusal(f"its format {form[:10]!r} is not known; LRFI, LDFI, KRBI and KDBI are")
    return form, channels


def _payload(content: bytes, form: str, num_channels: int) -> np.ndarray:
    """The rows of numbers, NaN where missing."""
    double = form[1] == "D"
    if form[2] == "B":
        width = 8 if double else 4
        values = np.frombuffer(content[: len(content) // width * width], f">f{width}").astype(float)
        rows = values[: len(values) // num_channels * num_channels].reshape(-1, num_channels)
    else:
        rows = _text_rows(content.decode("latin-1"), 20 if double else 10, num_channels)
    used = np.any(np.isfinite(rows), axis=1)
    rows = rows[: np.max(np.nonzero(used)[0]) + 1] if np.any(used) else rows[:0]
    if len(rows) < 4:
        raise Refusal(f"it has {len(rows)} rows of elevations; at least 4 are needed")
    return np.where(np.isfinite(rows), rows, np.nan)


def _text_rows(text: str, width: int, num_channels: int) -> np.ndarray:
    """Rows of numbers of equal width; a row may go on in the next line."""
    rows, row = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.rstrip()
        cells = [line[i : i + width].strip() for i in range(0, len(line), width)]
        row += [np.nan if cell.startswith("*") else _float(cell) for cell in cells]
        if len(row) > num_channels:
            raise Refusal(f"row {number} of its elevations has too many numbers")
        if len(row) == num_channels:
            rows.append(row)
            row = []
    if row:
        raise Refusal("its last row of elevations is cut short")
    return np.array(rows, float).reshape(-1, num_channels)


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise Refusal(f"it holds {cell[:20]!r} where a number is needed") from None


def _positions(names: list[str], road: dict[str, float]) -> np.ndarray:
    """The positions of the long sections, v [m]."""
    found = [_POSITION.search(name) for name in names]
    given = [match for match in found if match]
    if given:
        if len(given) < len(names):
            raise Refusal("only some of its long sections have a position")
        return np.array([_float(match.group(1)) for match in given])
    if "LONG_SECTION_V_INCREMENT" in road:
        step = road["LONG_SECTION_V_INCREMENT"]
    elif {"LONG_SECTION_V_RIGHT", "LONG_SECTION_V_LEFT"} <= set(road):
        span = road["LONG_SECTION_V_LEFT"] - road["LONG_SECTION_V_RIGHT"]
        step = span / (len(names) - 1)
    else:
        raise Refusal("it has no distance between its long sections")
    return step * np.arange(len(names))


def _interpolated(
    heights: np.ndarray, across: np.ndarray, notes: list[str]
) -> tuple[np.ndarray, float]:
    """Heights at equal steps across the road, and the step [m]."""
    gaps = np.diff(across)
    if not (np.all(np.isfinite(gaps)) and np.all(gaps > 0)):
        raise Refusal("the positions of its long sections do not ascend")
    if equally_spaced(across, 1e-3):
        return heights, float(np.mean(gaps))
    step = float(np.min(gaps))
    num = round((across[-1] - across[0]) / step) + 1
    if num > 100 * len(across):
        raise Refusal("its long sections are spaced too unequally")
    even = np.linspace(across[0], across[-1], num)
    notes.append(
        f"Its long sections, {step:.3g} to {np.max(gaps):.3g} m apart, were interpolated linearly "
        f"to {num} equally spaced ones."
    )
    return np.stack([np.interp(even, across, row) for row in heights]), float(even[1] - even[0])
