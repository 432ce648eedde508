"""Where results go: names and folders are refused before anything is computed."""

import contextlib
import os
import uuid
from pathlib import Path

LONGEST_NAME = 180  # bytes; file systems take 255, and endings are added
PROBE = 65536  # bytes written to see whether a folder takes any


def check_name(name: str) -> None:
    """Raises `ValueError` unless `name` can begin the names of files in any folder."""
    bad = sorted({c for c in name if c in '/\\\\:*?"<>|' or not c.isprintable()})
    if bad:
        raise ValueError(
            f"`name={name!r}` is refused: it begins the names of files, which cannot have "
            f"{' '.join(map(repr, bad))}. `directory` says where they go."
        )
    if not name.strip(". ") or name.startswith("-"):
        raise ValueError(f"`name={name!r}` is refused: letters or digits are needed.")
    length = len(os.fsencode(name))
    if length > LONGEST_NAME:
        raise ValueError(
            f"`name={name[:20]!r}...` is refused: it has {length} bytes, and may have "
            f"{LONGEST_NAME}."
        )


def full_path(text: str, beside: str | os.PathLike = ".") -> Path:
    """Returns the path that a text names: `~` is the user's, others are relative to `beside`.

    **Raises:** `ValueError` for one that no file system has.
    """
    if not text or not text.isprintable():
        raise ValueError(f"the path {text!r} is refused: printable characters are needed.")
    try:
        return Path(beside) / Path(text).expanduser()
    except RuntimeError as error:
        raise ValueError(f"the path {text!r} is refused: {error}") from error


def check_folder(folder: str | os.PathLike) -> None:
    """Raises `OSError` unless files can be written to a folder, which need not exist yet.

    What is tried leaves nothing behind.
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
