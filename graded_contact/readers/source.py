"""A file to read with its options, and the error that asks for those that are missing."""

import contextlib
import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

_WIDEST = 110  # characters of a line in a message
_FLAGS = {"columns": "column", "units": "unit"}  # of the command

Layout = Mapping[str, Any]


class Source(NamedTuple):
    """A file, the function that reads it, and the options that were given."""

    path: Path
    reader: str
    options: Mapping[str, Any]

    def not_plain(
        self, reasons: Sequence[str], lines: Sequence[str] = (), **options: Any
    ) -> "NotPlain":
        """Returns the error whose call has these options beside those that were given."""
        merged = dict(self.options)
        for name, value in options.items():
            old = merged.get(name)
            merged[name] = {**old, **value} if isinstance(old, Mapping) else value
        merged = {name: each for name, each in merged.items() if each != {}}
        known = merged if merged != self.options else {}  # else something is to be left out
        return NotPlain(self.path, self.reader, reasons, known, lines)


def source_of(path: str | os.PathLike, reader: str, **options: Any) -> Source:
    """Returns a file with the options that are not None."""
    return Source(Path(path), reader, {k: v for k, v in options.items() if v is not None})


class NotPlain(ValueError):
    """A file that needs options: "..." stands for what only its owner knows.

    **Fields:**

    - `path`, `reader`: the file, and the name of the function that reads it.
    - `reasons`: what is not clear.
    - `options`: of the call that would read it.
    - `lines`: of the file, with their numbers.
    """

    def __init__(
        self,
        path: Path,
        reader: str,
        reasons: Sequence[str],
        options: Mapping[str, Any],
        lines: Sequence[str] = (),
    ):
        self.path, self.reader, self.reasons = path, reader, reasons
        self.options, self.lines = options, lines
        call = "".join(f", {name}={value!r}" for name, value in options.items())
        remedy = f"To read it, complete: {reader}({path.name!r}{call})"
        super().__init__(self.with_remedy(remedy if options else ""))

    @property
    def flags(self) -> str:
        """The options as the command takes them, such as "--unit modulus=..."."""
        words = []
        for name, value in self.options.items():
            parts = value.items() if isinstance(value, Mapping) else [("", value)]
            pairs = [f"{key}={each}" if key else str(each) for key, each in parts]
            words += [f"--{_FLAGS.get(name, name)} {_quoted(pair)}" for pair in pairs]
        return " ".join(words)

    def with_remedy(self, remedy: str) -> str:
        """Returns the message with another last line."""
        shown = "".join(f"\n    {line[:_WIDEST]}" for line in self.lines)
        return f"`path={self.path}`: {'; '.join(self.reasons)}.{shown}\n{remedy}".rstrip()


def _quoted(text: str) -> str:
    """A word of a command line."""
    return text if re.fullmatch(r"[\w.=/+-]+", text) else '"' + text.replace("\t", "\\t") + '"'


@contextlib.contextmanager
def damage_named(path: Path) -> Iterator[None]:
    """Raises `ValueError` that names the file for the many errors of libraries in a damaged one."""
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except (NotPlain, ImportError, FileNotFoundError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise ValueError(f"`path={path}` cannot be read: {reason}.") from error
