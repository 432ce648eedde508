"""Readers of files, each registered with what it knows; the content decides which one reads a file.

A module in `instruments/` is found without being named anywhere. Its functions take a `File` and
return a `Scan` (heights) or `Tables` (moduli), or raise `Refusal`.
"""

import dataclasses
import functools
import importlib
import pkgutil
from collections.abc import Callable, Mapping
from pathlib import PurePath
from typing import Any, Literal, NamedTuple

from .cells import Sheet, decoded
from .paths import (
    UNPACKED_TEXT,
    Refusal,
    check_archive,
    check_hdf5,
    check_unpacked,
    may_unpack,
    names_in,
)
from .scan import Scan

DEEPEST = 3  # containers in one another
Gives = Literal["heights", "moduli"]


@dataclasses.dataclass(frozen=True)
class File:
    """A file, or a part of a container.

    - `name`: of the file; what it is follows from its content if possible.
    - `content`: all its bytes.
    - `channel`, `size`, `unit`: as in `read_surface`.
    - `packed`: bytes of the outermost file.
    - `depth`: of the container that it lies in.
    """

    name: PurePath
    content: bytes
    packed: int
    channel: str | int | None = None
    size: Any = None
    unit: str | None = None
    depth: int = 0

    @property
    def at_most(self) -> float:
        """Bytes to which the file may unpack."""
        return may_unpack(self.packed)

    @functools.cached_property
    def text(self) -> str | None:
        """The text of the file, None if it is no text."""
        text, encoding = decoded(self.content) or ("", None)
        # Latin-1 can hold any bytes: a file of instruments has other characters than text.
        odd = sum(not (char.isprintable() or char.isspace()) for char in text[:10_000])
        if encoding is None or (encoding == "Latin-1" and odd > 0.01 * len(text[:10_000])):
            return None
        check_unpacked(len(self.content), may_unpack(self.packed, UNPACKED_TEXT))
        return text

    @functools.cached_property
    def parts(self) -> list[str]:
        """The names of the files in a zip; none if it is no zip."""
        return names_in(self.content) if self.content.startswith(b"PK") else []

    def read_part(self, name: str, content: bytes, channel: int | None = None) -> Scan:
        """Returns the heights in a part of this file, by the reader that knows it."""
        if self.depth == DEEPEST:
            raise Refusal("it has too many zips in one another")
        changes = {"name": PurePath(name), "content": content, "channel": channel}
        return read(dataclasses.replace(self, **changes, depth=self.depth + 1), "heights")


class Tables(NamedTuple):
    """Tables of measured moduli, and what their format fixes.

    - `sheets`: rows of cells, with lines of names.
    - `kind`, `columns`, `units`, `deformation`, `temperature`: as in `read_moduli`.
    - `load`: the constant stress of a creep test [Pa], the strain of a relaxation test [1].
    - `source`: where the units come from, in words.
    """

    sheets: list[Sheet]
    kind: str | None = None
    columns: Mapping[str, str | int] = {}
    units: Mapping[str, str] = {}
    deformation: str | None = None
    temperature: float | None = None
    load: float | None = None
    source: str = "as given in `units`"


class Reader(NamedTuple):
    """A function that reads a kind of file, and whether it knows one."""

    name: str
    knows: Callable[[File], bool]
    read: Callable[[File], Any]
    last: bool


READERS: dict[Gives, list[Reader]] = {"heights": [], "moduli": []}


def reader(name: str, gives: Gives, *, knows: Callable[[File], bool], last: bool = False):
    """Registers the function below it as a reader of files.

    **Arguments:**

    - `name`: of the kind of file.
    - `gives`: "heights" for a function that returns a `Scan`, "moduli" for `Tables`.
    - `knows`: whether the function reads a file: by its first bytes, a heading, or its extension.
    - `last`: whether it only takes what no other reader knows.
    """

    def register(function: Callable[[File], Any]) -> Callable[[File], Any]:
        READERS[gives].append(Reader(name, knows, function, last))
        READERS[gives].sort(key=lambda each: each.last)
        return function

    return register


@functools.cache
def find_readers() -> None:
    """Imports all instruments, which register themselves."""
    room = importlib.import_module(f"{__package__}.instruments")
    for module in pkgutil.iter_modules(room.__path__, f"{room.__name__}."):
        importlib.import_module(module.name)


def read(file: File, gives: Gives) -> Any:
    """Returns what the first reader that knows a file reads from it; raises `Refusal`."""
    find_readers()
    if not file.content.strip():
        raise Refusal("it is empty")
    try:
        if file.content.startswith(b"PK"):
            check_archive(file.content, file.at_most)
        check_hdf5(file.content, file.at_most)
        return next(each.read(file) for each in READERS[gives] if each.knows(file))
    except (ImportError, Refusal):
        raise
    except Exception as error:  # libraries raise many kinds
        reason = "its format is not known, or the file is damaged"
        if type(error).__name__ != "CannotDetectFileFormat":
            reason += " (" + " ".join(f"{type(error).__name__}: {error}".split())[:300] + ")"
        raise Refusal(reason) from error
