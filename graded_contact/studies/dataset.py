"""Numbers over named axes: units, statistics and files of an `xarray.Dataset`.

A file is HDF5 as xarray writes it, after `SEAL` bytes with a checksum of the rest: a damaged HDF5
file may make HDF5 hang or return other numbers. HDF5 skips these bytes, so
`xarray.open_dataset(path, engine="h5netcdf")` opens the file too. HDF5 changes bytes at the start
of a file that it opens for writing, even if nothing is written: those are restored before the
checksum is compared. Files are written under another name, flushed to the disk and renamed.
"""

import contextlib
import functools
import hashlib
import io
import os
import uuid
import warnings
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from ..core.escaping import in_csv
from ..core.files import is_open_for_writing, read_file
from ..core.memory import available_memory
from ..core.quantities import in_brackets, quantity_of

if TYPE_CHECKING:
    from xarray import Dataset

# How a point ended, if neither solved nor stopped by its solver.
NOT_STARTED = "not started"
FAILED = "failed: "
LOST = f"{FAILED}its worker died, each time that it was tried"  # no fault of the point's
SEAL = 512  # bytes, the least that HDF5 can skip


def attach(dataset: "Dataset", units: Mapping[str, str] = MappingProxyType({})) -> "Dataset":
    """Returns the dataset with `units` and `long_name` added where they are missing.

    **Arguments:**

    - `dataset`: its variables and coordinates are looked up in the table of quantities by the last
      word of their names: "layers[0].thickness" is a thickness.
    - `units`: of names that the table does not have, or has in another unit.
    """
    for name, variable in dataset.variables.items():
        entry = quantity_of(str(name))
        known = {} if entry is None else {"units": entry.unit, "long_name": entry.meaning}
        if name in units:
            known["units"] = units[str(name)]
        variable.attrs = known | variable.attrs
    return dataset


def write_whole(path: str | os.PathLike, content: bytes | str) -> None:
    """Writes a file; an earlier file, or a link, is replaced when the new one is complete.

    **Arguments:**

    - `path`: of the file.
    - `content`: a text is written in UTF-8.

    **Raises:** `OSError` if it cannot be written; an earlier file stays.
    """
    path = Path(path)
    # In the same folder: a file cannot be renamed from one disk to another.
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


def read_sealed(path: str | os.PathLike, at_most: float | None = None) -> bytes:
    """Returns the content that `write_sealed` wrote to a file of `at_most` bytes.

    **Raises:** `FileNotFoundError`; `ValueError` if the file differs from what was written.
    """
    whole = read_file(path, at_most)
    for content in (whole[SEAL:], _closed(whole[SEAL:])):
        if whole[:SEAL] == _header(content):
            return content
    if is_open_for_writing(path):
        raise ValueError(f"`path={path}` is open in another program: close it there.")
    raise ValueError(
        f"`path={path}` is no file of results, or was changed since it was written, or is damaged, "
        "or another program or version wrote it: compute it again."
    )


def _header(content: bytes) -> bytes:
    return f"graded_contact\n{hashlib.sha256(content).hexdigest()}\n".encode().ljust(SEAL)


def _closed(content: bytes) -> bytes:
    """The content of HDF5 before a program opened it for writing (superblock of version 0).

    HDF5 then marks the file as open, and counts the bytes of the seal.
    """
    closed = bytearray(content)
    closed[20:32] = bytes(12)
    closed[40:48] = len(content).to_bytes(8, "little")
    return bytes(closed)


def write(path: str | os.PathLike, dataset: "Dataset") -> None:
    """Writes a file completely or not at all; it replaces an earlier file only at the end.

    **Raises:** `OSError` if it cannot be written.
    """
    packed = {
        name: {"zlib": True, "shuffle": True}
        for name, variable in dataset.variables.items()
        if variable.ndim and variable.dtype.kind in "fiub"
    }
    # In memory first: HDF5 crashes if the disk is full.
    write_sealed(path, bytes(dataset.to_netcdf(engine="h5netcdf", encoding=packed)))


def read_dataset(path: str | os.PathLike) -> "Dataset":
    """Returns the dataset that `write` wrote, bit for bit.

    **Raises:** `FileNotFoundError`; `ValueError` for another file, a damaged one, or one that
    another program is changing.
    """
    import xarray

    most = available_memory() or float("inf")
    content = read_sealed(path, most)  # damaged HDF5 never reaches the HDF5 library
    try:
        # HDF5 that something else wrote may be odd in ways that libraries warn of.
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            warnings.simplefilter("error", RuntimeWarning)
            return xarray.load_dataset(io.BytesIO(content), engine="h5netcdf")
    except Exception as error:  # of many kinds, of HDF5 that something else wrote
        raise ValueError(f"`path={path}` does not contain a dataset: {error}.") from error


def write_csv(path: str | os.PathLike, dataset: "Dataset", *more: str) -> None:
    """Writes a table with a row for each point: axes, numbers (no fields) and message.

    With `more` dimensions it has a row for each of their values, and the numbers over these.
    """
    axes, numbers = (*dataset["message"].dims, *more), dataset.data_vars.items()
    names = [
        str(n) for n, v in numbers if {*more} <= {*v.dims} <= {*axes} and v.dtype.kind in "fiub"
    ]
    table = dataset[[*names, "message"]].to_dataframe(dim_order=[*axes]).reset_index()
    heads = {n: in_csv(n + in_brackets(dataset[n].attrs.get("units", ""))) for n in table}
    table = table.rename(columns=heads).map(lambda at: in_csv(at) if isinstance(at, str) else at)
    write_whole(path, table.to_csv(index=False, na_rep="nan", lineterminator="\r\n"))


# Called once: a worker of dask that ends in a thread of this process edits sys.path meanwhile.
@functools.cache
def package_versions() -> dict[str, str]:
    """Returns the versions of this package and of those its numbers depend on, as attributes."""
    return {f"version_{name}": version(name) for name in ("graded_contact", "jax", "numpy", "h5py")}
