"""The state of a page in its address: a reload, or a bookmark, shows the same scene again.

The state holds the tables of the scene and the values of its knobs. An address may come from
anybody: it can name no file except those of the scene that was opened and of the page's folder.
"""

import base64
import json
import math
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .document import POINTS, Document

LONGEST = 16_000  # characters of a state
LARGEST = 1_000_000  # bytes of its tables


def to_address(document: Document, values: tuple[float, ...]) -> str:
    """Returns the state of a scene whose knobs have `values` [SI]; "" if it is too long."""
    state = json.dumps([document.content, document.speeds, values], separators=(",", ":"))
    text = base64.urlsafe_b64encode(zlib.compress(state.encode(), 9)).decode()
    return text if len(text) <= LONGEST else ""


def from_address(text: str, opened: Document, folder: Path) -> Document:
    """Returns the scene of a state, with its values.

    **Arguments:**

    - `text`: of `to_address`.
    - `opened`: the scene of the page.
    - `folder`: of the page.

    **Raises:** `ValueError` for a text that is no state, or names another file or a finer grid.
    """
    try:
        data = zlib.decompressobj().decompress(base64.urlsafe_b64decode(text), LARGEST)
        content, (low, high), values = json.loads(data)
        document = Document(
            content, opened.folder, (float(low), float(high)), tuple(map(float, values))
        )
        allowed = set(_found("path", opened.content))
        paths = [Path(path) for path in _found("path", content) if path not in allowed]
        strange = [path for path in paths if path.resolve().parent != folder.resolve()]
        points = [math.prod(shape) for shape in _found("shape", content)]
        most = max(POINTS**2, *map(math.prod, _found("shape", opened.content)))
        valid = 0 < document.speeds[0] < document.speeds[1] and not strange
        if not valid or max(points, default=0) > most:
            raise ValueError("it names other files, or a finer grid.")
        document.scene()
    except (ValueError, TypeError, KeyError, zlib.error) as error:
        raise ValueError(f"The address does not contain a scene of this page: {error}") from error
    return document


def _found(key: str, table: Any) -> Iterator[Any]:
    """The values of all keys of this name in tables."""
    if isinstance(table, dict):
        if key in table:
            yield table[key]
        for value in table.values():
            yield from _found(key, value)
    elif isinstance(table, list):
        for value in table:
            yield from _found(key, value)
