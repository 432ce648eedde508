"""Files that a user names."""

import os
from pathlib import Path


def existing_file(path: str | os.PathLike) -> Path:
    """Returns the path of a file.

    **Raises:** `FileNotFoundError`; `ValueError` for a folder.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    if path.is_dir():
        raise ValueError(f"`path={path}` is a folder; a file is needed.")
    return path
