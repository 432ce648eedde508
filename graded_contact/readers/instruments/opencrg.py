"""Heights of roads in OpenCRG files (ASAM OpenCRG 1.2, https://www.asam.net/standards/detail/opencrg/).

A header of text names the channels; the elevations follow, one row per step along the reference
line, as text of 10 or 20 characters a number ("LRFI", "LDFI") or as big-endian floats ("KRBI",
"KDBI"). x runs along the reference line (u), y to the left of it (v). The elevation is that over
the reference line, whose bends, slope and banking are left out.
"""

import re

import numpy as np

from ...core.files import Refusal
from ..decisions import Log
from ..registry import File, reader
from ..scan import Scan, equally_spaced
from ..units import metres

_IS_ROAD = re.compile(rb"^\$ROAD_CRG", re.MULTILINE | re.IGNORECASE)
_DATA = re.compile(rb"^\$\$[^\n]*\n", re.MULTILINE)
_POSITION = re.compile(r"at\s+v\s*=\s*([-+.\deE]+)")
_PARAMETER = re.compile(r"^\s*(\w+)\s*=\s*([-+.\deE]+)")


@reader(
    "opencrg", "heights", knows=lambda file: _IS_ROAD.search(file.content[:100_000]) is not None
)
def read_road(file: File) -> Scan:
    """Returns the elevations of a road [m]; raises `ValueError` for a damaged file."""
    content = file.content
    end = _DATA.search(content)
    header = content[: end.start() if end else None].decode("latin-1")
    sections = _sections(header)
    if other := sections.get("ROAD_CRG_FILE"):
        names = " ".join(filter(None, map(str.strip, other)))[:200]
        raise Refusal(f"its elevations are in another OpenCRG file, {names!r}: read that one")
    if end is None:
        raise Refusal("its header does not end: no line begins with '$$'")
    road, changes = _settings(sections, "ROAD_CRG"), _settings(sections, "ROAD_CRG_MODS")
    form, channels = "KRBI", []
    for line in sections.get("KD_DEFINITION", []):
        if line.startswith("#:"):
            form = line[2:].strip().upper()
        elif line.upper().startswith("D:"):
            name, _, unit = line[2:].partition(",")
            channels.append((" ".join(name.lower().split()), unit.strip()))
    if not re.fullmatch("[LK][RD][FB]I?", form):
        raise Refusal(f"its format {form[:10]!r} is not known; LRFI, LDFI, KRBI and KDBI are")
    sides = [i for i, (name, _) in enumerate(channels) if name.startswith("long section")]
    if len(sides) < 4:
        raise Refusal(f"it has {len(sides)} long sections; at least 4 are needed")
    factors = {metres(channels[i][1]) for i in sides}
    if len(factors) > 1 or None in factors:
        raise Refusal("its long sections are not all in one unit of length")
    rows = _road_rows(content[end.end() :], form, len(channels))
    heights = factors.pop() * rows[:, sides] * changes.get("SCALE_Z_GRID", 1.0)
    step = road.get("REFERENCE_LINE_INCREMENT", 0.0)
    if not (np.isfinite(step) and step > 0):
        raise Refusal("it has no REFERENCE_LINE_INCREMENT, a length above 0")
    if {"REFERENCE_LINE_START_U", "REFERENCE_LINE_END_U"} <= set(road):
        count = (road["REFERENCE_LINE_END_U"] - road["REFERENCE_LINE_START_U"]) / step + 1
        if len(heights) < count - 1:  # rows without any elevation at the end are dropped
            raise Refusal(f"it has {len(heights)} of {count:.0f} rows of elevations: cut short")
    names = [channels[i][0] for i in sides]
    log = Log()
    heights, width = _evenly(heights, names, road, log)
    if len(sides) < len(channels):
        log.note("Heading, slope and banking of the reference line were left out.")
    if left_out := ", ".join(sorted(set(changes) - {"SCALE_Z_GRID"})):
        log.note(f"The file's modifiers {left_out} were left out.")
    size = np.array([len(heights) * step, heights.shape[1] * width])
    return Scan(heights, "an OpenCRG road", size, "m", "m", log=log)


def _sections(header: str) -> dict[str, list[str]]:
    """The lines of each section, without comments."""
    sections, lines = {}, []
    for line in header.splitlines():
        if name := re.match(r"\$(\w*)", line):
            lines = sections.setdefault(name[1].upper(), [])
        elif not line.startswith("*"):
            lines.append(line.split("!")[0].rstrip())
    return sections


def _settings(sections: dict[str, list[str]], name: str) -> dict[str, float]:
    found = (_PARAMETER.match(line) for line in sections.get(name, []))
    return {match[1].upper(): float(match[2]) for match in found if match}


def _road_rows(content: bytes, form: str, num_channels: int) -> np.ndarray:
    """The rows of numbers, NaN where missing."""
    double = form[1] == "D"
    if form[2] == "B":
        width = 8 if double else 4
        numbers = np.frombuffer(content[: len(content) // width * width], f">f{width}")
        numbers = numbers[: len(numbers) // num_channels * num_channels]
    else:
        numbers = _text_numbers(content.decode("latin-1"), 20 if double else 10, num_channels)
    rows = np.array(numbers, float).reshape(-1, num_channels)
    # Binary files are filled up with NaN to whole records.
    used = np.flatnonzero(np.any(np.isfinite(rows), axis=1))
    rows = rows[: np.max(used, initial=-1) + 1]
    if len(rows) < 4:
        raise Refusal(f"it has {len(rows)} rows of elevations; at least 4 are needed")
    return np.where(np.isfinite(rows), rows, np.nan)


def _text_numbers(text: str, width: int, num_channels: int) -> list[float]:
    """Numbers of equal width; a row may go on in the next line, but starts a line."""
    values: list[float] = []
    for number, line in enumerate(map(str.rstrip, text.splitlines()), start=1):
        before = len(values) % num_channels
        cells = [line[i : i + width].strip() for i in range(0, len(line), width)]
        values += [np.nan if cell.startswith("*") else float(cell) for cell in cells]
        if before + len(cells) > num_channels:
            raise Refusal(f"line {number} of its elevations has too many numbers")
    if len(values) % num_channels:
        raise Refusal("its last row of elevations is cut short")
    return values


def _evenly(
    heights: np.ndarray, names: list[str], road: dict[str, float], log: Log
) -> tuple[np.ndarray, float]:
    """Heights at equal steps across the road, and the step [m]."""
    given = [match for match in map(_POSITION.search, names) if match]
    if given and len(given) < len(names):
        raise Refusal("only some of its long sections have a position")
    if given:
        across = np.array([float(match[1]) for match in given])
    elif "LONG_SECTION_V_INCREMENT" in road:
        across = road["LONG_SECTION_V_INCREMENT"] * np.arange(len(names))
    elif {"LONG_SECTION_V_RIGHT", "LONG_SECTION_V_LEFT"} <= set(road):
        span = road["LONG_SECTION_V_LEFT"] - road["LONG_SECTION_V_RIGHT"]
        across = span / (len(names) - 1) * np.arange(len(names))
    else:
        raise Refusal("it has no distance between its long sections")
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
    apart = f"{step:.3g} to {np.max(gaps):.3g} m apart"
    log.note(f"Long sections {apart} were interpolated linearly to {num} equally spaced ones.")
    heights = np.stack([np.interp(even, across, row) for row in heights])
    return heights, float(even[1] - even[0])
