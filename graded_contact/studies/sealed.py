"""Files that are written completely or not at all, with a checksum against damage.

A file is written under another name, flushed to the disk and renamed. It begins with `SEAL` bytes
that hold a checksum of the rest: a damaged HDF5 file may make HDF5 hang or return other numbers.
HDF5 skips these bytes.
"""

import contextlib
import hashlib
import os
import uuid
from pathlib import Path

from ..readers.paths import LARGEST_FILE, read_file

SEAL = 512  # bytes, the least that HDF5 can skip


def write_whole(path: str | os.PathLike, content: bytes | str) -> None:
    """Writes a file; an earlier file, or a link, is replaced when the new one is complete.

    **Arguments:**

    - `path`: of the file.
    - `content`: a text is written in UTF-8.

    **Raises:** `OSError` if it cannot be written; an earlier file stays.
    """
    path = Path(path)
    partial = path.with_name(f".{uuid.uuid4().hex}.partial")
    try:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        with open(partial, "rb+") as written:
            os.fsync(written.fileno())
        os.replace(partial, path)
    except OSError as error:
        raise OSError(f"`{path}` cannot be written: {error.strerror or error}.") from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()
    if os.name == "posix":  # the new name, too, is to survive a loss of power
        folder = os.open(path.parent, os.O_RDONLY)
        os.fsync(folder)
        os.close(folder)


def write_sealed(path: str | os.PathLike, content: bytes) -> None:
    """Writes a checksum and the content as `write_whole` does."""
    write_whole(path, _header(content) + content)


def read_sealed(path: str | os.PathLike, at_most: float = LARGEST_FILE) -> bytes:
    """Returns the content of a file that `write_sealed` wrote, of `at_most` bytes.

    **Raises:** `FileNotFoundError`; `ValueError` if the file differs from what was written.
    """
    whole = read_file(path, at_most)
    content = whole[SEAL:]
    if whole[:SEAL] != _header(content):
        raise ValueError(
            f"`path={path}` is damaged, or another program or an earlier version wrote it."
        )
    return content


def _header(content: bytes) -> bytes:
    return f"graded_contact\n{hashlib.sha256(content).hexdigest()}\n".encode().ljust(SEAL)
