"""Readers of files, each registered with what it knows; the content decides which one reads a file.

A module in `instruments/` is found without being named anywhere. Its functions take a `File` and
return a `Scan` (heights), a list of `Sheet` (moduli) or `Modes` (Prony), or raise `Refusal`.
"""

import codecs
import contextlib
import dataclasses
import functools
import importlib
import os
import pkgutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from ..core.files import (
    LARGEST_FILE,
    UNPACKED_TEXT,
    Refusal,
    check_archive,
    check_hdf5,
    check_unpacked,
    may_unpack,
    names_in,
    read_file,
)
from .scan import Scan

DEEPEST = 3  # containers in one another


@dataclasses.dataclass(frozen=True)
class File:
    """A file, or a part of a container.

    - `name`: of the file; what it is follows from its content if possible.
    - `content`: all its bytes.
    - `channel`, `size`, `unit`, `columns`: as in `read_surface`.
    - `packed`: bytes of the outermost file.
    - `depth`: of the container that it lies in.
    """

    name: PurePath
    content: bytes
    packed: int
    channel: str | int | None = None
    size: Any = None
    unit: str | None = None
    columns: Mapping[str, str | int] | None = None
    depth: int = 0

    @property
    def at_most(self) -> float:
        """Bytes to which the file may unpack."""
        return may_unpack(self.packed)

    @functools.cached_property
    def decoded(self) -> tuple[str, str] | None:
        """Characters of the file and their encoding, None if it has none."""
        # Without a mark, UTF-16 of western text has a zero in every second byte.
        codes = ["utf-16"] * self.content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        for start, code in ((1, "utf-16-le"), (0, "utf-16-be")):
            half = self.content[start:1000:2]
            codes += [code] * (half.count(0) > 0.9 * max(len(half), 1))
        if codes:
            text = self.content.decode(codes[0], errors="replace")
            return None if "\0" in text else (_without_marks(text), "UTF-16")
        if b"\0" in self.content:
            return None
        with contextlib.suppress(UnicodeDecodeError):
            return _without_marks(self.content.decode()), "UTF-8"
        return _without_marks(self.content.decode("cp1252", errors="replace")), "Latin-1"

    @functools.cached_property
    def text(self) -> str | None:
        """The text of the file, None if it is no text."""
        text, encoding = self.decoded or ("", None)
        # Latin-1 can hold any bytes: a file of instruments has other characters than text.
        odd = sum(not (char.isprintable() or char.isspace()) for char in text[:10_000])
        odd += text.count("\ufffd", 0, 10_000)
        binary = encoding is None or (encoding == "Latin-1" and odd > 0.01 * len(text[:10_000]))
        return None if binary else text

    @functools.cached_property
    def parts(self) -> list[str]:
        """The names of the files in a zip; none if it is no zip."""
        return names_in(self.content) if self.content.startswith(b"PK") else []

    def read_part(self, name: str, content: bytes, channel: int | None = None) -> Scan:
        """Returns the heights in a part of this file, by the reader that knows it."""
        if self.depth == DEEPEST:
            raise Refusal("it has too many zips in one another")
        changes = {"name": PurePath(name), "content": content, "channel": channel}
        return read_as(dataclasses.replace(self, **changes, depth=self.depth + 1), "heights")


def _without_marks(text: str) -> str:
    """The text without marks of byte order, also those read in another encoding."""
    return text.replace("\ufeff", "").replace("ï»¿", "")


@contextlib.contextmanager
def opening(path: str | os.PathLike, at_most: float = LARGEST_FILE, **known: Any) -> Iterator[File]:
    """Gives the file at a path; a `Refusal` becomes a `ValueError` that names the path."""
    content = read_file(path, at_most)
    try:
        yield File(Path(path), content, len(content), **known)
    except Refusal as error:
        raise ValueError(f"`path={path}` is refused: {str(error).rstrip('.')}.") from None


class RegisteredReader(NamedTuple):
    """A function that reads a kind of file, and whether it knows one."""

    name: str
    knows: Callable[[File], bool]
    read: Callable[[File], Any]
    rank: int


READERS: dict[str, list[RegisteredReader]] = {"heights": [], "moduli": [], "prony": []}


def extra(package: str) -> Any:
    """Returns a package of the extra `io`."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(package)
    except ImportError as error:
        reason = f"This file needs the package {package}: pip install graded_contact[io]"
        raise ImportError(reason) from error


def reader(name: str, gives: str, *, knows: Callable[[File], bool], rank: int = 0):
    """Registers the function below it as a reader of files.

    **Arguments:**

    - `name`: of the kind of file.
    - `gives`: "heights" for a function that returns a `Scan`, "moduli" for a list of `Sheet`,
      "prony" for a `Modes` by the name of each material.
    - `knows`: whether the function reads a file: by its first bytes, a heading, or its extension.
    - `rank`: 0 for a format that is told by its content, 1 for a library of many formats, 2 for
      what is tried after it.
    """

    def register(function: Callable[[File], Any]) -> Callable[[File], Any]:
        READERS[gives].append(RegisteredReader(name, knows, function, rank))
        READERS[gives].sort(key=lambda each: each.rank)
        return function

    return register


@functools.cache
def find_readers() -> None:
    """Imports all instruments, which register themselves."""
    room = importlib.import_module(f"{__package__}.instruments")
    for module in pkgutil.iter_modules(room.__path__, f"{room.__name__}."):
        importlib.import_module(module.name)


def _is_refused(file: File) -> bool:
    """Raises `Refusal` for an empty file, and for one that unpacks to too much."""
    if not file.content.strip():
        raise Refusal("it is empty")
    if file.content.startswith(b"PK"):
        check_archive(file.content, file.at_most)
    check_hdf5(file.content, file.at_most)
    if file.text is not None:
        check_unpacked(len(file.content), may_unpack(file.packed, UNPACKED_TEXT))
    return False


def read_as(file: File, gives: str) -> Any:
    """Returns what a reader that knows a file reads from it; raises `Refusal`.

    Readers are asked in turn until one returns. A `Refusal` is the last word, and so is any error
    of a reader of rank 0.
    """
    find_readers()
    errors: list[Exception] = []
    for each in [RegisteredReader("none", _is_refused, lambda _: None, 0), *READERS[gives]]:
        try:
            if each.knows(file):
                return each.read(file)
        except Refusal:
            raise
        except Exception as error:  # libraries raise many kinds
            errors.append(error)
            if each.rank == 0:
                break
    error = next((each for each in errors if isinstance(each, ImportError)), errors[-1])
    if isinstance(error, ImportError):
        raise error
    reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    raise Refusal(f"its format is not known, or the file is damaged ({reason})") from error
