"""Finished points of a study on the disk, one file each: they survive a kill of the process.

A store is a folder. The name of a file is a fingerprint of all that decides the numbers of the
point. A file is whole or absent, and damage is detected (`studies/dataset.py`). A lock refuses a
second process that writes; the lock ends with its process, however that ends.
"""

import contextlib
import hashlib
import io
import os
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import filelock
import jax
import numpy as np

from .dataset import FAILED, read_sealed, write_sealed


def fingerprint(*parts: Any) -> str:
    """Returns 64 hexadecimal digits that differ if any of `parts` does, the same in any process.

    Parts are trees of JAX, such as stacks, solvers, lists and dicts, of numbers, texts and arrays
    (bit for bit, with dtype and shape).

    **Raises:** `ValueError` for anything else, such as a function.
    """
    leaves, structure = jax.tree.flatten(parts)
    # The structure holds static fields as text; an address there changes from process to process.
    if " at 0x" in str(structure):
        raise ValueError(f"{structure} contains a function: it cannot be identified later.")
    pieces = [str(structure).encode()]
    for leaf in leaves:
        array = np.asarray(leaf)
        # A Python number and an array of the same value may compile to different programs.
        if array.dtype.kind in "biufc" and not isinstance(leaf, bool | int | float | complex):
            pieces.append(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
        elif array.dtype.kind in "biufcUS":
            kind = f"{type(leaf).__name__}{array.shape}"
            pieces.append(f"{kind}{array.tolist()!r}".encode("utf-8", "surrogatepass"))
        else:
            raise ValueError(f"{leaf!r} cannot be identified later.")
    # With lengths in front, no two lists of pieces have the same bytes.
    lengths = [f"{len(piece)}:".encode() for piece in pieces]
    return hashlib.sha256(b"".join([*lengths, *pieces])).hexdigest()


class Point(NamedTuple):
    """Result of one point.

    **Fields:**

    - `values`: numbers and fields by name, any shapes.
    - `message`: why it failed; empty where it succeeded.
    """

    values: dict[str, np.ndarray]
    message: str = ""


def together(name: str, like: jax.ShapeDtypeStruct, points: Sequence[Point | None]) -> np.ndarray:
    """Returns one array of a quantity at all points, NaN where there is none."""
    found = [None if point is None else point.values.get(name) for point in points]
    # Whole numbers become floats only where NaN must stand among them.
    dtype = np.result_type(like.dtype, 0.0) if any(one is None for one in found) else like.dtype
    whole = np.full((len(points), *like.shape), np.nan if dtype.kind == "f" else 0, dtype)
    for i, one in enumerate(found):
        if one is not None:
            whole[i] = one
    return whole


@contextlib.contextmanager
def open_store(store: "str | os.PathLike | Store | None") -> Iterator["Store | None"]:
    """Yields an open store: `store`, or that of a folder, with a warning of damaged points."""
    if not isinstance(store, str | os.PathLike):
        yield store
        return
    with Store(store) as points:
        yield points
    if points.damaged:
        text = f"{len(points.damaged)} of the points in `{points.folder}` were damaged and are"
        text += f" computed again; the first is {points.damaged[0].name}."
        warnings.warn(text, stacklevel=4)


class Store:
    """A folder of finished points; `with Store(folder) as store:` makes and locks it.

    **Arguments:**

    - `folder`: it is made if it does not exist.

    **Raises:** on entry, `BlockingIOError` if another process writes to it, `OSError` if nothing
    can be written there.
    """

    def __init__(self, folder: str | os.PathLike):
        self.folder = Path(folder)
        self.damaged: list[Path] = []
        self._lock = filelock.FileLock(self.folder / "lock")

    def __enter__(self) -> "Store":
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(timeout=0)
        except filelock.Timeout:
            raise BlockingIOError(
                f"`{self.folder}` is being written by another process: wait for its end, or give "
                "another store (another `--output` of the command)."
            ) from None
        except OSError as error:
            text = f"Nothing can be written to the folder `{self.folder}`: {error.strerror}."
            raise OSError(text) from error
        for leftover in self.folder.glob(".*.partial"):  # of a killed process
            leftover.unlink(missing_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def path(self, name: str) -> Path:
        """Returns the file of a point, whether or not it exists."""
        return self.folder / f"{name}.point"

    def read(self, name: str, values: Iterable[str] = ()) -> Point | None:
        """Returns the point of this name; None if it is absent or damaged.

        The paths of damaged files are added to `damaged`. A point that lacks one of `values`,
        although it did not fail, is damaged.
        """
        path = self.path(name)
        try:
            content = read_sealed(path)
            with np.load(io.BytesIO(content)) as file:
                found = dict(file)
            own, message = str(found.pop("name")), str(found.pop("message"))
        except FileNotFoundError:
            return None
        except OSError:
            raise
        except Exception:  # of many kinds, if another program wrote it with a checksum
            own, message, found = "", "", {}
        found = {key.removeprefix("values/"): array for key, array in found.items()}
        # A file that was renamed holds another point.
        if own != name or not (message.startswith(FAILED) or found.keys() >= {*values}):
            self.damaged.append(path)
            return None
        return Point(found, message)

    def write(self, name: str, point: Point) -> None:
        """Writes a point; on return it is on the disk.

        **Raises:** `OSError` if it cannot be written; other files, and an earlier one, stay whole.
        """
        # With a prefix, a result called "name" or "message" stays apart from those of the point.
        content = io.BytesIO()
        arrays: Any = {f"values/{key}": array for key, array in point.values.items()}
        np.savez(content, name=name, message=point.message, **arrays)
        write_sealed(self.path(name), content.getvalue())
