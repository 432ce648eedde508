"""Finished points of a study, kept on disk one by one; what was finished survives any end.

A store is a folder with one HDF5 file per point, named by a fingerprint of everything that decides
the point's numbers. A file is written under another name, brought to the disk and renamed, so that
it is whole or absent. It begins with a digest of itself, so that a damaged one is known. A lock
refuses a second writer; it ends with its process, however that ends.
"""

import contextlib
import dataclasses
import hashlib
import os
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import jax
import numpy as np

from ..files.hdf5 import sealed_file
from ..files.sealed import is_sealed


def fingerprint(*parts: Any) -> str:
    """Returns 64 hexadecimal digits that differ if any of `parts` does, the same in any process.

    Parts are numbers, texts, None, arrays (bit for bit, with dtype and shape), and lists, tuples,
    dicts and dataclasses (such as stacks and solvers) of these.

    **Raises:** `ValueError` for anything else: a function has no name that lasts.
    """
    digest = hashlib.sha256()
    for piece in _pieces(parts):
        digest.update(f"{len(piece)}:".encode() + piece)
    return digest.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    """What a value consists of, each kind of it announced: no two values give the same pieces."""
    kind = f"{type(value).__module__}.{type(value).__qualname__}"
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        yield f"{kind} {value!r}".encode("utf-8", "surrogatepass")
    elif isinstance(value, jax.Array | np.ndarray | np.generic):
        array = np.asarray(value)
        text = array.dtype.kind in "OU"
        yield f"array {'text' if text else array.dtype.str} {array.shape}".encode()
        yield from _pieces(array.tolist()) if text else [np.ascontiguousarray(array).tobytes()]
    elif isinstance(value, list | tuple):
        yield f"{len(value)} entries".encode()
        for entry in value:
            yield from _pieces(entry)
    elif isinstance(value, dict):
        yield b"dict"
        yield from _pieces(sorted(value.items()))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield kind.encode()
        yield from _pieces({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    else:
        raise ValueError(f"A {kind} cannot be told from others by its value: {value!r}.")


@dataclasses.dataclass(frozen=True, eq=False)
class Point:
    """What a study found at one point.

    **Fields:**

    - `values`: numbers and fields by name, any shapes.
    - `message`: why it failed; empty where it succeeded.
    - `inputs`: what the point is of, for people: numbers and texts by name.
    """

    values: dict[str, np.ndarray]
    message: str
    inputs: dict[str, Any]


def reason_of(error: Exception) -> str:
    """Returns why a point failed, without the traceback that compiled code puts around it.

    **Raises:** `MemoryError` and `KeyboardInterrupt`, which compiled code tells as errors of its
    own, and which are not the point's.
    """
    reason = str(error).rpartition("Error: ")[2].partition("\n\n")[0].strip()
    if "RESOURCE_EXHAUSTED" in str(error):
        raise MemoryError(reason) from error
    if "KeyboardInterrupt" in str(error):
        raise KeyboardInterrupt from error
    return reason


class Store:
    """A folder of finished points; `with Store(folder) as store:` makes it and locks it.

    **Arguments:**

    - `folder`: where; it is made if it does not exist.

    **Raises:** on entry, `BlockingIOError` if another process writes to it, `OSError` if nothing
    can be written there.
    """

    def __init__(self, folder: str | os.PathLike):
        self.folder = Path(folder)
        self.damaged: list[Path] = []

    def __enter__(self) -> "Store":
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(self.folder / "lock", os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OSError(
                f"Nothing can be written to the folder `{self.folder}`: {error.strerror}."
            ) from error
        self._lock = _lock(handle, self.folder)
        for leftover in self.folder.glob(".*.partial"):  # of a killed process
            leftover.unlink(missing_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._lock)

    def path(self, name: str) -> Path:
        """Returns the file of a point, whether or not it exists."""
        return self.folder / f"{name}.h5"

    def read(self, name: str) -> Point | None:
        """Returns the point of this name; None if it is absent or damaged.

        The paths of damaged ones are added to `damaged`.
        """
        path = self.path(name)
        if not path.exists():
            return None
        if not is_sealed(path, name):
            self.damaged.append(path)
            return None
        with h5py.File(path) as file:
            arrays: Any = file.get("values", {})
            return Point(
                values={key: np.asarray(array[()]) for key, array in arrays.items()},
                message=str(file.attrs["message"]),
                inputs=dict(file["inputs"].attrs),
            )

    def write(self, name: str, point: Point) -> None:
        """Keeps a point; on return it is on the disk.

        **Raises:** `OSError` if it cannot be written; whatever was kept before stays whole.
        """
        with sealed_file(self.path(name), name) as file:
            file.attrs["message"] = point.message
            file.create_group("inputs", track_order=True).attrs.update(point.inputs)
            for key, values in point.values.items():
                file[f"values/{key}"] = values


def _lock(handle: int, folder: Path) -> int:
    """Locks a folder for this process by an open file in it; returns what to close to unlock it."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        os.close(handle)
        who = (folder / "lock").read_text().strip()
        raise BlockingIOError(
            f"`{folder}` is being written by another process ({who}). Wait until it ends, or take "
            "another folder."
        ) from None
    except OSError:
        # The file system has no locks. Two writers then do the same work twice, and no harm.
        return handle
    with contextlib.suppress(OSError):  # for people only: a full disk does not matter here
        os.truncate(handle, 0)
        os.write(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
    return handle
