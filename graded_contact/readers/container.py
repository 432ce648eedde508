"""Measurements in a container of contact.engineering: a zip of files and one that describes them.

`index.json` or `meta.yml` names the measurements of each surface, with their files, sizes and units
(https://contactengineering.github.io/SurfaceTopography). Of YAML it uses blocks, and values in a
line: `_yaml` reads these.
"""

import io
import json
import re
import zipfile
from collections import Counter, deque
from typing import Any, NamedTuple

import numpy as np

from .formats import Scan, marked_as_missing, names_in
from .paths import UNPACKED_TEXT, Refusal, check_unpacked
from .units import metres

_DESCRIPTIONS = ("index.json", "meta.yml")


class Measurement(NamedTuple):
    """A file in a container, and what the container says of it.

    - `file`: its name in the zip.
    - `source`: the channel in the file, or None.
    - `size`: edge lengths in `unit`, or None.
    - `unit`: of lengths and heights, or None.
    - `scale`: by which the numbers of the file are to be multiplied.
    - `periodic`: whether the surface is declared periodic.
    """

    file: str
    source: int | None
    size: np.ndarray | None
    unit: str | None
    scale: float
    periodic: bool


def measurements_in(content: bytes) -> dict[str, Measurement]:
    """Returns the measurements in a zip by name; none for a zip that is no container."""
    names = set(names_in(content))
    described = next((name for name in _DESCRIPTIONS if name in names), None)
    if described is None:
        return {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        check_unpacked(archive.getinfo(described).file_size, UNPACKED_TEXT)
        text = archive.read(described).decode("utf-8-sig")
    try:
        description = (json.loads if described.endswith("json") else _yaml)(text)
        if "surfaces" not in description:
            return {}
        found = [
            (
                str(each.get("name") or file),
                str(surface.get("name") or ""),
                _measurement(each, file),
            )
            for surface in description["surfaces"]
            for each in surface["topographies"]
            if (file := _file(each, names))
        ]
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        if described == "index.json":  # many a zip has one
            return {}
        raise Refusal(f"its {described!r} is not understood ({error})") from error
    uses = Counter(name for name, _, _ in found)
    full = [f"{name} of {surface}" if uses[name] > 1 else name for name, surface, _ in found]
    uses = Counter(full)
    each = [measurement for _, _, measurement in found]
    return {one.file if uses[name] > 1 else name: one for name, one in zip(full, each, strict=True)}


def as_described(scan: Scan, measurement: Measurement) -> Scan:
    """Returns the heights of a file with the size and unit of its container where it lacks them."""
    notes = list(scan.notes)
    scale, unit, size = measurement.scale, measurement.unit, measurement.size
    if scan.unit is None:
        missing = marked_as_missing(scan.heights)
        scan = scan._replace(heights=np.where(missing, np.nan, scale * scan.heights), unit=unit)
        notes += [f"Heights were multiplied by {scale:g}, as the container says."] * (scale != 1)
    elif scale != 1:
        own = f"the file has its own scale, in {scan.unit!r}, which is used"
        notes.append(f"The container scales its heights by {scale:g}; {own}.")
    lateral = scan.lateral_unit or unit
    if scan.size is None and size is not None and size.shape == (scan.heights.ndim,):
        scan, lateral = scan._replace(size=size), unit
    elif scan.size is not None and size is not None:
        own, said = (
            (metres(str(name)) or np.nan) * edges
            for name, edges in ((lateral, scan.size), (unit, size))
        )
        # The length of a line of n points may be n or n - 1 steps.
        if own.shape != said.shape or np.any(np.abs(said / own - 1) > 0.01 + 1 / len(scan.heights)):
            notes.append(f"The container says its size is {said} m; the file's {own} m is used.")
    periodic = scan.periodic or measurement.periodic
    return scan._replace(lateral_unit=lateral, periodic=periodic, notes=tuple(notes))


def _file(entry: dict[str, Any], names: set[str]) -> str | None:
    """The name in the zip of the file of a measurement, as the instrument wrote it if possible."""
    files = entry.get("datafile")
    files = {"original": files} if isinstance(files, str) else files or {}
    ordered = sorted(files.items(), key=lambda pair: pair[0] != "original")
    return next((name for _, name in ordered if name in names), None)


def _measurement(entry: dict[str, Any], file: str) -> Measurement:
    source, size = entry.get("data_source"), entry.get("size")
    return Measurement(
        file=file,
        source=source if isinstance(source, int) else None,
        size=None if size is None else np.atleast_1d(np.array(size, float)),
        unit=None if entry.get("unit") is None else str(entry["unit"]),
        scale=float(entry.get("height_scale") or 1),
        periodic=entry.get("is_periodic") is True,
    )


# YAML: blocks of keys and items, and scalars that may go on in deeper lines.

_KEY = re.compile(r"""("[^"]*"|'[^']*'|[^\s"'\[{#][^#]*?)\s*:(?:\s+|$)""")
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_ESCAPED = re.compile(r"\\(x[\da-fA-F]{2}|u[\da-fA-F]{4}|U[\da-fA-F]{8}|.)")


def _yaml(text: str) -> Any:
    """The value of a text in YAML; raises `ValueError` for what is not understood."""
    lines = deque(
        (len(line) - len(line.lstrip()), line.strip())
        for line in text.splitlines()
        if line.strip() and not re.match(r"\s*#|---|%|\.\.\.$", line)
    )
    value = _block(lines) if lines else None
    if lines:
        raise ValueError(f"at {lines[0][1][:40]!r}")
    return value


def _block(lines: deque[tuple[int, str]]) -> Any:
    """The items, or keys, of the first line's depth."""
    depth, items, keys = lines[0][0], [], {}
    while lines and lines[0][0] == depth and re.match(r"-(\s|$)", lines[0][1]):
        line = lines.popleft()[1]
        rest = line[1:].lstrip()
        if _KEY.match(rest) or rest.startswith("- "):
            lines.appendleft((depth + len(line) - len(rest), rest))
            items.append(_block(lines))
        else:
            items.append(_value(rest, depth, lines))
    if items:
        return items
    while lines and lines[0][0] == depth and (key := _KEY.match(lines[0][1])):
        rest = lines.popleft()[1][key.end() :]
        # Items may be as deep as their key.
        deeper = not (lines and lines[0][0] == depth and re.match(r"-(\s|$)", lines[0][1]))
        keys[_scalar(key[1])] = _value(rest, depth if deeper else depth - 1, lines)
    if not keys:
        raise ValueError(f"at {lines[0][1][:40]!r}")
    return keys


def _value(rest: str, depth: int, lines: deque[tuple[int, str]]) -> Any:
    """The value behind a key or dash of this depth."""
    rest = re.sub(r"^(?:[!&]\S*\s*)+", "", rest)
    if rest in ("", "|", ">", "|-", ">-"):
        deeper = lines and lines[0][0] > depth
        if deeper and not rest:
            return _block(lines)
        rest = ""
    parts = [rest]
    while lines and lines[0][0] > depth:
        parts.append(lines.popleft()[1])
    # A backslash at the end of a quoted line joins it to the next.
    text = " ".join(parts).strip()
    return _scalar(text.replace("\\ \\ ", " ") if text.startswith('"') else text)


def _scalar(text: str) -> Any:
    if text[:1] in ("[", "{"):
        inner = [part.strip() for part in text[1:-1].split(",") if part.strip()]
        if text[0] == "[":
            return [_scalar(part) for part in inner]
        pairs = (part.partition(":") for part in inner)
        return {_scalar(name.strip()): _scalar(value.strip()) for name, _, value in pairs}
    if text[:1] == '"':
        short = {"n": "\n", "t": "\t"}
        return _ESCAPED.sub(
            lambda found: chr(int(found[1][1:], 16)) if len(found[1]) > 1
            else short.get(found[1], found[1]), text[1:-1],
        )  # fmt: skip
    if text[:1] == "'":
        return text[1:-1].replace("''", "'")
    text = re.sub(r"\s#.*$", "", text)
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
