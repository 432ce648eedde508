"""Files that are whole or absent, and that show whether they are what was written.

A file is written under another name, brought to the disk and renamed. A digest stands in the bytes
that HDF5 leaves to its users, since a damaged file may make HDF5 hang or return other numbers.
"""

import contextlib
import hashlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SEAL = 512  # bytes before those of HDF5, the least that it allows


def seal(path: str | os.PathLike, name: str = "") -> None:
    """Writes a digest of an HDF5 file into its first `SEAL` bytes, which must be its user block.

    HDF5 leaves them to us. It may hang or return other numbers where a file is damaged: look with
    `is_sealed` before it opens one.
    """
    with open(path, "rb+") as file:
        header = _header(file, name)
        file.seek(0)
        file.write(header)


def is_sealed(path: str | os.PathLike, name: str = "") -> bool:
    """Returns whether a file is, byte for byte, what was sealed under this name."""
    with open(path, "rb") as file:
        return file.read(SEAL) == _header(file, name)


def _header(file: Any, name: str) -> bytes:
    file.seek(SEAL)
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    return f"graded_contact {name}\n{digest}\n".encode().ljust(SEAL)


@contextlib.contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """Gives a name to write under; on leaving, that file replaces the one at `path`, whole.

    If it is left by an exception there is no new file, and an earlier one stays.
    """
    path = Path(path)
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        yield partial
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
