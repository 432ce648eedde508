"""Heights in grids of maps: ESRI ASCII (`.asc`) and Golden Software's Surfer (`.grd`).

ESRI's header has the number of columns and rows, the size of a cell, and a mark of missing points;
without that mark -9999 counts as missing, as in the standard;
its first row is the northernmost. Lengths are those of the map's projection, nearly always metres.
Surfer's grids begin with "DSAA" (text), "DSBB" (binary) or "DSRB" (binary of version 7); their
nodes lie on the edges, and the first row is the southernmost. They state no unit, and heights of
1.70141e38 and more are missing.
"""

import re
import struct

import numpy as np

from ...core.files import Refusal
from ..cells import holds_number, is_missing
from ..decisions import Log
from ..registry import File, reader
from ..scan import Scan, check_count, from_lines

_ESRI = re.compile(rb"\s*(ncols|nrows)\s+\d+\s+(ncols|nrows|[xy]ll|cellsize|dx|dy|nodata)", re.I)
_ESRI_KEYS = re.compile(
    r"(?i)ncols|nrows|[xy]ll(corner|center|centre)|cellsize|dx|dy|nodata(_value)?"
)
_HEADER_LINES = 20  # of a header
_ESRI_MARK = -9999.0  # of missing points where the header names none


@reader("esri", "heights", knows=lambda file: _ESRI.match(_first_bytes(file)) is not None)
def read_esri(file: File) -> Scan:
    """Returns the heights of an ESRI ASCII grid; NaN where its header marks missing points."""
    lines = _file_text(file).split("\n", _HEADER_LINES)
    header: dict[str, str] = {}
    while lines:
        key, *value = lines[0].split() or [""]
        cell = _point_for_comma("".join(value[:1]))
        known = holds_number(cell) or (key.lower().startswith("nodata") and is_missing(cell))  # nan
        if not (_ESRI_KEYS.fullmatch(key) and len(value) == 1 and known):
            break
        header[key.lower()] = cell
        del lines[0]
    rest = "\n".join(lines)
    shape = tuple(int(_header_number(header, name)) for name in ("ncols", "nrows"))
    steps = [_header_number(header, name, "cellsize") for name in ("dx", "dy")]
    check_count(shape, file.at_most)
    heights = from_lines(_text_heights(rest, shape))
    log = Log()
    mark = header.get("nodata_value", header.get("nodata"))
    if mark is None and (num := np.sum(heights == _ESRI_MARK)):
        default = f"{num} heights of {_ESRI_MARK:g} count as missing, as its header names no mark"
        log.assume(f"{default}; otherwise state another NODATA_value there.")
    if not is_missing(mark or str(_ESRI_MARK)):  # of a word the cells are NaN already
        heights[heights == float(mark or _ESRI_MARK)] = np.nan
    if file.unit is None:
        log.assume("The map is in metres, of which its file says nothing; otherwise pass `unit`.")
    unit = "m" if file.unit is None else None
    lateral = unit if file.size is None else None
    size = np.array(steps) * shape
    return Scan(heights, "an ESRI grid", size, unit, lateral, log=log)


@reader("surfer", "heights", knows=lambda file: file.content[:4] in (b"DSAA", b"DSBB", b"DSRB"))
def read_surfer(file: File) -> Scan:
    """Returns the heights of a grid of Surfer; they and its lengths have no unit."""
    read = {b"DSAA": _surfer_text, b"DSBB": _surfer_6, b"DSRB": _surfer_7}[file.content[:4]]
    lines, size = read(file)
    return Scan(lines.T, "a grid of Surfer", size)


def _first_bytes(file: File) -> bytes:
    return file.content[:1000].removeprefix(b"\xef\xbb\xbf")


def _file_text(file: File) -> str:
    if file.text is None:
        raise Refusal("its header is that of a text, and it is none")
    return file.text


def _point_for_comma(cell: str) -> str:
    return cell.replace(",", ".")


def _header_number(header: dict[str, str], *names: str) -> float:
    """The first of these numbers in a header, above 0."""
    found = next((float(header[name]) for name in names if name in header), 0.0)
    if not (np.isfinite(found) and found > 0):
        raise Refusal(f"its header has no {' or '.join(names)} above 0")
    return found


def _text_heights(text: str, shape: tuple[int, ...]) -> np.ndarray:
    """The rows of numbers in a text, which may go on in the next line."""
    cells = _point_for_comma(text).split()
    if len(cells) != shape[0] * shape[1]:
        raise Refusal(f"it has {len(cells)} heights for {shape[0]} x {shape[1]} points")
    try:
        return np.array(cells, float).reshape(shape[::-1])
    except ValueError as error:
        raise Refusal(f"its heights are no numbers ({error})") from error


def _surfer_text(file: File) -> tuple[np.ndarray, np.ndarray]:
    head = _file_text(file).split(maxsplit=9)
    shape = int(head[1]), int(head[2])
    edges = [float(cell) for cell in head[3:7]]
    check_count(shape, file.at_most)
    return _text_heights(head[9], shape), _size(shape, edges)


def _surfer_6(file: File) -> tuple[np.ndarray, np.ndarray]:
    num_x, num_y, *edges = struct.unpack_from("<2h4d", file.content, 4)
    return _binary_heights(file, 56, (num_x, num_y), "<f4"), _size((num_x, num_y), edges)


def _surfer_7(file: File) -> tuple[np.ndarray, np.ndarray]:
    """Sections, each a name of four bytes and its length."""
    at, places = 0, {}
    while at + 8 <= len(file.content):
        name, length = struct.unpack_from("<4si", file.content, at)
        places.setdefault(name, at + 8)
        if length < 0:
            break
        at += 8 + length
    if not {b"GRID", b"DATA"} <= set(places):
        raise Refusal("it has no section of a grid, or none of heights")
    num_y, num_x, _, _, *steps, _, _, _, mark = struct.unpack_from(
        "<2i8d", file.content, places[b"GRID"]
    )
    lines = _binary_heights(file, places[b"DATA"], (num_x, num_y), "<f8")
    return np.where(lines == mark, np.nan, lines), np.array(steps) * (num_x, num_y)


def _binary_heights(file: File, at: int, shape: tuple[int, int], form: str) -> np.ndarray:
    if min(shape) < 1:
        raise Refusal(f"its header is damaged: {shape[0]} x {shape[1]} points")
    check_count(shape, file.at_most)
    needed, there = np.dtype(form).itemsize * shape[0] * shape[1], len(file.content) - at
    if there < needed:
        raise Refusal(f"it has {there} of {needed} bytes of heights: cut short")
    values = np.frombuffer(file.content, form, shape[0] * shape[1], at)
    return values.astype(float).reshape(shape[::-1])


def _size(shape: tuple[int, int], edges: list[float]) -> np.ndarray:
    """The size of cells around the nodes between two edges along x and two along y."""
    points = np.array(shape)
    if np.min(points) < 2:
        raise Refusal(f"it has {shape[0]} x {shape[1]} points")
    return (np.array(edges[1::2]) - np.array(edges[::2])) * points / (points - 1)
