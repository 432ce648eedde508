"""Files from the user. One that is larger than the memory is refused by its size."""

import os
from pathlib import Path


def read_file(path: str | os.PathLike, at_most: float | None = None) -> bytes:
    """Returns the content of a file.

    **Arguments:**

    - `path`: of the file.
    - `at_most`: bytes that it may have, by default as many as the memory has.

    **Raises:** `FileNotFoundError`; `ValueError` for a folder or a device, or a larger file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    if not path.is_file():
        raise ValueError(f"`path={path}` is a folder or a device; a file is needed.")
    check_fits(path, path.stat().st_size, at_most)
    return path.read_bytes()


def check_fits(path: Path, size: float, at_most: float | None = None) -> None:
    """Raises `ValueError` for more bytes than are allowed, by default as many as the memory has."""
    most = _memory_of_machine() if at_most is None else at_most
    if size > most:
        raise ValueError(
            f"`path={path}` has {_megabytes(size)}; at most {_megabytes(most)} can be read."
        )


def _memory_of_machine() -> float:
    """Bytes of the machine; of unknown ones, without a limit."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return float("inf")


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
