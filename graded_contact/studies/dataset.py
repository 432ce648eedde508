"""Numbers over named axes: units, statistics and files of an `xarray.Dataset`.

A file is HDF5 as xarray writes it, after 512 bytes with a checksum of the rest.
`xarray.open_dataset(path, engine="h5netcdf")` opens it too.
"""

import functools
import io
import os
from collections.abc import Mapping
from importlib.metadata import version
from types import MappingProxyType
from typing import TYPE_CHECKING

from ..core.memory import available_memory
from ..core.quantities import quantity_of
from ..readers.paths import Refusal, check_hdf5
from .sealed import read_sealed, write_sealed, write_whole

if TYPE_CHECKING:
    from xarray import Dataset

# How a point ended, if neither solved nor stopped by its solver.
NOT_STARTED = "not started"
FAILED = "failed: "
LOST = f"{FAILED}its worker died, each time that it was tried"  # no fault of the point's
_PACKAGES = ("graded_contact", "jax", "numpy", "h5py")


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


def mean_and_error(dataset: "Dataset") -> tuple["Dataset", "Dataset"]:
    """Returns the mean and its standard error over the seeds.

    Only points that succeeded count, those with an empty `message`.
    """
    solved = dataset.drop_vars("message").where(dataset["message"] == "")
    error = solved.std("seed", ddof=1, keep_attrs=True) / solved.count("seed") ** 0.5
    return solved.mean("seed", keep_attrs=True), error


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


def read(path: str | os.PathLike) -> "Dataset":
    """Returns the dataset that `write` wrote, bit for bit.

    **Raises:** `FileNotFoundError`; `ValueError` for another file, or a damaged one.
    """
    import xarray

    most = available_memory() or float("inf")
    content = read_sealed(path, most)
    try:
        check_hdf5(content, most)
        return xarray.load_dataset(io.BytesIO(content), engine="h5netcdf")
    except Refusal as error:
        raise ValueError(f"`path={path}` is refused: {error}.") from error
    except Exception as error:  # of many kinds, of HDF5 that something else wrote
        raise ValueError(f"`path={path}` does not contain a dataset: {error}.") from error


def write_csv(path: str | os.PathLike, dataset: "Dataset") -> None:
    """Writes a table with a row for each point: axes, numbers (no fields) and message."""
    axes = dataset["message"].dims
    numbers = [
        str(name)
        for name, variable in dataset.data_vars.items()
        if {*variable.dims} <= {*axes} and variable.dtype.kind in "fiub"
    ]
    table = dataset[[*numbers, "message"]].to_dataframe(dim_order=[*axes]).reset_index()
    # Whole numbers, as seeds, have no unit.
    heads = {
        name: f"{name} [{dataset[name].units}]"
        for name in table
        if "units" in dataset[name].attrs and dataset[name].dtype.kind == "f"
    }
    table = table.rename(columns=heads)
    write_whole(path, table.to_csv(index=False, na_rep="nan", lineterminator="\r\n"))


# Called once: a worker of dask that ends in a thread of this process edits sys.path meanwhile.
@functools.cache
def package_versions() -> dict[str, str]:
    """Returns the versions of this package and of those its numbers depend on, as attributes."""
    return {f"version_{name}": version(name) for name in _PACKAGES}
