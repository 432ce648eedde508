"""The text of a scene: TOML to tables, and tables to TOML."""

import itertools
import json
import os
import re
import tomllib
from collections.abc import Iterator
from typing import Any

from ..core.checks import within
from ..core.files import is_hdf5, read_utf8

MOST_BYTES = 1_000_000  # of a text; building 20,000 layers takes a minute
# The time of tomllib grows with the square of the parts of a key. No search begins inside a part.
_LONG_KEY = re.compile(
    r"""(?<![\w"'\\-])(?:(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')[ \t]*\.[ \t]*){100}"""
)


def text_of_scene(path: str | os.PathLike) -> str:
    """Returns the text of the file of a scene, as `read_utf8`; refuses a file of results."""
    if is_hdf5(path):
        raise ValueError(
            f"`path={path}` is a result (HDF5), no scene: `graded-contact info {path}` prints it."
        )
    return read_utf8(path, MOST_BYTES)


def parse_toml(text: str) -> dict[str, Any]:
    """Returns the tables of a TOML text.

    **Raises:** `ValueError` for a text that is not TOML, with the line; or too long.
    """
    if len(text) > MOST_BYTES:
        raise ValueError(
            f"The text has {len(text) / 1e6:.3g} MB; at most {MOST_BYTES / 1e6:g} MB are read."
        )
    with within("Not valid TOML:"):
        if long := _LONG_KEY.search(text):
            raise ValueError(f"the key {long.group()[:20]}... has more than 100 parts.")
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            hint = "; tables of a list have two brackets each, as `[[layers]]`"
            raise ValueError(f"{error}{hint * ('Cannot declare' in str(error))}") from error
        except RecursionError as error:  # of tomllib, at some thousand brackets
            raise ValueError("its lists or tables are nested too deeply.") from error


def check_texts(tables: dict[str, Any]) -> None:
    """Raises `ValueError` for a text or a key that no file of results can hold."""
    if any("\0" in text for text in _texts(tables)):
        raise ValueError("A text has the character \\u0000, which no file of results can hold.")


def _texts(value: Any) -> Iterator[str]:
    """The keys and texts in a value of TOML."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from itertools.chain(value, *map(_texts, value.values()))
    elif isinstance(value, list):
        yield from itertools.chain.from_iterable(map(_texts, value))


def toml_text(content: dict[str, Any]) -> str:
    """Returns the text of a scene's tables: those of materials and layers each under a heading.

    **Arguments:**

    - `content`: as `parse_toml` gives it; comments are not part of that.

    **Returns:** a text from which `parse_toml` gives the same.
    """
    blocks = [_entries({k: v for k, v in content.items() if not _has_heading(v)})]
    for name, value in content.items():
        if not _has_heading(value):
            continue
        if isinstance(value, list):
            blocks += [f"[[{_key(name)}]]\n{_entries(entry)}" for entry in value]
        elif all(isinstance(entry, dict) for entry in value.values()):
            blocks += [f"[{_key(name)}.{_key(k)}]\n{_entries(v)}" for k, v in value.items()]
        else:
            blocks.append(f"[{_key(name)}]\n{_entries(value)}")
    return "\n".join(block for block in blocks if block)


def entry_text(value: Any) -> str:
    """Returns the text of a number, truth, text, list or inline table."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {entry_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(entry_text, value)) + "]"
    if isinstance(value, float) and not abs(value) < float("inf"):
        return str(value)  # JSON spells nan and inf otherwise
    # JSON leaves DEL unchanged, which TOML forbids.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _has_heading(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(isinstance(entry, dict) for entry in value)
    return isinstance(value, dict) and bool(value)


def _entries(table: dict[str, Any]) -> str:
    return "".join(f"{_key(key)} = {entry_text(value)}\n" for key, value in table.items())


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else entry_text(key)
