"""Paths from the user: files to read, folders to write results to.

Names and folders are checked before anything is computed.
"""

import contextlib
import os
import uuid
import zipfile
from pathlib import Path
from typing import Any

LONGEST_NAME = 180  # bytes; file systems take 255, and endings are added
PROBE = 65536  # bytes written to see whether a folder takes any


def check_name(name: str) -> None:
    """Raises `ValueError` unless `name` can begin the names of files in any folder."""
    bad = sorted({c for c in name if c in '/\\\\:*?"<>|' or not c.isprintable()})
    if bad:
        raise ValueError(
            f"`name={name!r}` is refused: file names cannot contain {' '.join(map(repr, bad))}. "
            "`directory` sets the folder."
        )
    if not name.strip(". ") or name.startswith("-"):
        raise ValueError(f"`name={name!r}` is refused: letters or digits are needed.")
    length = len(os.fsencode(name))
    if length > LONGEST_NAME:
        raise ValueError(
            f"`name={name[:20]!r}...` is refused: it has {length} bytes; at most "
            f"{LONGEST_NAME} are allowed."
        )


def full_path(text: str, beside: str | os.PathLike = ".") -> Path:
    """Returns the path that a text names: `~` is the user's, other paths are relative to `beside`.

    **Raises:** `ValueError` for one that no file system has.
    """
    if not text or not text.isprintable():
        raise ValueError(f"the path {text!r} is refused: it needs printable characters.")
    try:
        return Path(beside) / Path(text).expanduser()
    except RuntimeError as error:
        raise ValueError(f"the path {text!r} is refused: {error}") from error


def check_folder(folder: str | os.PathLike) -> None:
    """Raises `OSError` unless files can be written to a folder, which need not exist yet.

    The check leaves nothing behind.
    """
    folder = Path(folder)
    made = []
    try:
        for part in [*reversed(folder.parents), folder]:
            if not part.exists():
                part.mkdir()
                made.append(part)
        probe = folder / f".{uuid.uuid4().hex}.partial"
        try:
            with open(probe, "xb") as file:
                file.write(bytes(PROBE))
                file.flush()
                os.fsync(file.fileno())
        finally:
            probe.unlink(missing_ok=True)
    except OSError as error:
        raise OSError(
            f"Nothing can be written to the folder `{folder}`: {error.strerror}."
        ) from error
    finally:
        for part in reversed(made):
            with contextlib.suppress(OSError):  # another process may use it by now
                part.rmdir()


def existing_file(path: str | os.PathLike, at_most: float | None = None) -> Path:
    """Returns the path of a file.

    **Arguments:**

    - `path`: of the file.
    - `at_most`: bytes that it may have; None for any number.

    **Raises:** `FileNotFoundError`; `ValueError` for a folder or a larger file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    if path.is_dir():
        raise ValueError(f"`path={path}` is a folder; a file is needed.")
    if at_most is not None and path.stat().st_size > at_most:
        raise ValueError(
            f"`path={path}` is refused: it has {_megabytes(path.stat().st_size)}; at most "
            f"{_megabytes(at_most)} are read here."
        )
    return path


def check_archive(source: Any, at_most: float) -> None:
    """Raises `ValueError` if a zip, a path or a stream, unpacks to more bytes.

    One that packs less than ten times may be larger: measured numbers do not pack better.
    """
    with zipfile.ZipFile(source) as archive:
        entries = archive.infolist()
    size = sum(entry.file_size for entry in entries)
    if size > max(at_most, 10 * sum(entry.compress_size for entry in entries)):
        raise ValueError(
            f"its parts unpack to {_megabytes(size)}, and at most {_megabytes(at_most)} are read"
        )


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
