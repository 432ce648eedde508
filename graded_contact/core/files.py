"""Files from the user. One that is larger than the free memory is refused by its size."""

import os
from pathlib import Path

from .memory import free_memory


def read_file(path: str | os.PathLike) -> bytes:
    """Returns the content of a file.

    **Raises:** `FileNotFoundError`; `ValueError` for a folder or a device, or a file too large.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    if not path.is_file():
        raise ValueError(f"`path={path}` is a folder or a device; a file is needed.")
    check_fits(path, path.stat().st_size)
    return path.read_bytes()


def check_fits(path: Path, size: float) -> None:
    """Raises `ValueError` for more bytes than the memory has free, if that is known."""
    free = free_memory()
    if free is not None and size > free:
        raise ValueError(f"`path={path}` takes {size / 1e9:.3g} GB; {free / 1e9:.3g} GB are free.")
