"""HDF5 files that are whole, sealed, and open in xarray: datasets with units on named scales."""

import contextlib
import io
import math
import os
from collections.abc import Iterator, Sequence
from typing import Any

import h5py
import numpy as np

from .paths import existing_file
from .sealed import SEAL, is_sealed, replacing, seal

_COMPRESSION = 1100  # the most that gzip saves is a factor of 1032
# What h5py raises for files that are damaged inside, beside what is looked for.
_UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, IndexError,
    OverflowError, MemoryError,
)  # fmt: skip


@contextlib.contextmanager
def new_file(path: str | os.PathLike, format: str) -> Iterator[Any]:
    """Gives an HDF5 file of a format to write to, see `sealed_file`."""
    with sealed_file(path) as file:
        file.attrs["format"] = format
        yield file


@contextlib.contextmanager
def sealed_file(path: str | os.PathLike, name: str = "") -> Iterator[Any]:
    """Gives an HDF5 file to write to; on leaving it is on the disk, whole and sealed by its name.

    If it is left by an exception there is no new file, and an earlier one stays.
    """
    # Made in memory: HDF5 crashes where a disk is full in the middle of its own bookkeeping.
    image = io.BytesIO()
    with h5py.File(image, "w", userblock_size=SEAL, track_order=True) as file:
        yield file
    with replacing(path) as partial:
        # Not `getbuffer`: the traceback of a full disk keeps it, and `image` could not close.
        partial.write_bytes(image.getvalue())
        seal(partial, name)


@contextlib.contextmanager
def opened(path: str | os.PathLike, format: str) -> Iterator[Any]:
    """Gives a file that `new_file` wrote with this format.

    **Raises:** `FileNotFoundError`; `ValueError` for another file or a damaged one, also if what
    is done with it fails.
    """
    path = existing_file(path)
    try:
        if not is_sealed(path):
            raise ValueError("it was damaged or changed, or written by another program")
        with h5py.File(path) as file:
            if str(file.attrs.get("format")) != format:
                raise ValueError(f"it does not say that it holds {format!r}")
            yield file
    except _UNREADABLE as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"`path={path}` cannot be read as {format[:-2]}: {reason}.") from error


def put(
    group: Any, name: str, values: np.ndarray, dimensions: Sequence[str], about: dict[str, str]
) -> None:
    """Writes one dataset; one that has its only dimension's name becomes that dimension's scale.

    The scales of the others lie in the group, else in the root.
    """
    if values.dtype.kind in "UO":
        dataset = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    elif values.ndim:
        dataset = group.create_dataset(
            name, data=values, compression="gzip", shuffle=True, fletcher32=True
        )
    else:
        dataset = group.create_dataset(name, data=values)
    dataset.attrs.update(about)
    if tuple(dimensions) == (name,):
        dataset.make_scale(name)
        return
    for dimension, label in zip(dataset.dims, dimensions, strict=True):
        dimension.label = label
        dimension.attach_scale((group if label in group else group.file)[label])


def numbers(dataset: Any, kinds: str = "f") -> np.ndarray:
    """Returns the numbers of a dataset, which it must hold as it says: read after a look at that.

    `kinds` are those of NumPy's dtypes, "f" floating-point and "iu" whole numbers.
    """
    _check_stored(dataset)
    if dataset.dtype.kind not in kinds:
        raise ValueError(f"{dataset.name} holds {dataset.dtype} instead of numbers")
    return np.asarray(dataset[()])


def texts(dataset: Any) -> np.ndarray:
    """Returns the texts of a dataset."""
    _check_stored(dataset)
    if h5py.check_string_dtype(dataset.dtype) is None:
        raise ValueError(f"{dataset.name} holds {dataset.dtype} instead of texts")
    return np.asarray(dataset.asstr()[()]).astype(str)


def _check_stored(dataset: Any) -> None:
    """Refuses a shape that asks for more than is stored: it could take all the memory there is."""
    if not isinstance(dataset, h5py.Dataset) or dataset.shape is None:
        raise ValueError(f"{getattr(dataset, 'name', dataset)} is no array")
    stored, whole = dataset.id.get_storage_size(), True
    if dataset.chunks is not None:
        needed = [-(-n // c) for n, c in zip(dataset.shape, dataset.chunks, strict=True)]
        whole = dataset.id.get_num_chunks() >= math.prod(needed)
        stored *= _COMPRESSION
    if not whole or stored < dataset.nbytes:
        raise ValueError(f"{dataset.name} lacks a part of its numbers, shape {dataset.shape}")
