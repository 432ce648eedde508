"""Paths from the user: files to read, folders to write results to.

Names and folders are checked before anything is computed. Files are read by `read_file`, which
refuses one that is larger than the memory by its size.
"""

import contextlib
import io
import os
import uuid
from pathlib import Path

from .display import short

LONGEST_NAME = 180  # bytes; file systems take 255, and endings are added
PROBE = 65536  # bytes written to see whether a folder takes any
_HDF5 = b"\x89HDF\r\n\x1a\n"


def check_name(name: str) -> None:
    """Raises `ValueError` unless `name` can begin the names of files in any folder."""
    bad = sorted({c for c in name if c in '/\\:*?"<>|' or not c.isprintable()})
    reason = ""
    if bad:
        reason = f"names cannot contain {' '.join(map(repr, bad))}; `directory` sets the folder"
    elif not name.strip(". ") or name.startswith("-"):
        reason = "letters or digits are needed"
    elif (length := len(os.fsencode(name))) > LONGEST_NAME:
        reason = f"it has {length} bytes; at most {LONGEST_NAME} are allowed"
    if reason:
        raise ValueError(f"`name={short(name)}` is refused: {reason}.")


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
        reason = f"Nothing can be written to the folder `{folder}`: {error.strerror}."
        raise OSError(reason) from error
    finally:
        for part in reversed(made):
            with contextlib.suppress(OSError):  # another process may use it by now
                part.rmdir()


def read_file(path: str | os.PathLike, at_most: float | None = None) -> bytes:
    """Returns the content of a file.

    **Arguments:**

    - `path`: of the file.
    - `at_most`: bytes that it may have, by default those of the memory.

    **Raises:** `FileNotFoundError`; `ValueError` for a folder or a device, or a larger file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    if not path.is_file():
        raise ValueError(f"`path={path}` is a folder or a device; a file is needed.")
    size, most = path.stat().st_size, _memory() if at_most is None else at_most
    if size > most:
        raise ValueError(
            f"`path={path}` has {_megabytes(size)}; at most {_megabytes(most)} can be read."
        )
    return path.read_bytes()


def read_utf8(path: str | os.PathLike, at_most: float | None = None) -> str:
    """Returns the text of a file with "\\n" at the ends of lines, as `read_file`."""
    content = read_file(path, at_most)
    try:
        return io.TextIOWrapper(io.BytesIO(content), "utf-8").read()
    except UnicodeDecodeError as error:
        raise ValueError(f"`path={path}` is no UTF-8 text: {error}.") from error


def _memory() -> float:
    """Bytes of the machine; of unknown ones, without a limit."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return float("inf")


def is_hdf5(path: str | os.PathLike) -> bool:
    """Returns whether there is a file that begins as HDF5 does, or after a seal of results."""
    if not Path(path).is_file():
        return False
    with open(path, "rb") as file:
        start = file.read(512 + len(_HDF5))  # HDF5 may begin there
    return _HDF5 in (start[: len(_HDF5)], start[512:])


def is_open_for_writing(path: str | os.PathLike) -> bool:
    """Returns whether a program holds a file as HDF5 does that writes to it (only on POSIX)."""
    try:
        import fcntl
    except ImportError:  # on Windows the file could not be read
        return False
    with open(path, "rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:  # a file system without locks
            return False
    return False


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
