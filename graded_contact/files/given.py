"""Files that a user names, and how large they may be."""

import os
import zipfile
from pathlib import Path
from typing import Any


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
            f"`path={path}` is refused: it has {_megabytes(path.stat().st_size)}, and at most "
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
