"""What a function gave at many points, as arrays over named axes, and the file that holds them.

The file is HDF5 as xarray writes it: one dataset per quantity, one scale per axis, units as
attributes, so that `xarray.open_dataset(path, engine="h5netcdf")` opens it.
"""

import csv
import dataclasses
import os
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core.checks import check_values
from ..core.display import shown
from .hdf5 import new_file, numbers, opened, put, texts
from .schema import nearest
from .sealed import replacing

if TYPE_CHECKING:
    import xarray

FORMAT = "graded_contact study 1"
NOT_STARTED = "not started"
FAILED = "failed: "
LOST = f"{FAILED}its worker died, each time that it was tried"  # no fault of the point's
# Of axes and quantities by the last word of their names.
UNITS = {
    "pressure": "Pa", "velocity": "m/s", "reduced_velocity": "m/s", "temperature": "K",
    "mean_pressure": "Pa", "gap_error": "m", "thickness": "m", "modulus": "Pa",
    "equilibrium": "Pa", "strengths": "Pa", "glassy": "Pa",
    "times": "s", "poisson": "1", "gap": "m", "mean_gap": "m", "displacement": "m",
    "heights": "m", **dict.fromkeys((
        "friction", "contact_area", "contact_area_corrected", "contact_area_smooth",
        "friction_standard_error", "geometric_friction", "energy_imbalance", "slope_in_contact",
        "unmeasured_area", "unmeasured_friction", "extrapolated_friction", "error", "num_fft_pairs",
        "friction_error", "contact_area_error", "load_error", "complementarity_error",
        "penetration",
    ), "1"),
}  # fmt: skip


def units_of(
    names: Iterable[str], more: Mapping[str, str] = MappingProxyType({})
) -> dict[str, str]:
    """Returns the units that are known, by name: "layers[0].thickness" has that of a thickness."""
    known = {**UNITS, **more}
    last = {name: name.rpartition(".")[2].partition("[")[0] for name in names}
    return {name: known[word] for name, word in last.items() if word in known}


@shown("axes", "values", "ends")
@dataclasses.dataclass(frozen=True, eq=False)
class Study:
    """One NumPy array per quantity over named axes.

    **Fields:**

    - `axes`: coordinates along each axis of the points, by name, in order. Points that make no grid
      lie along one axis `point`, and what they are is among the values.
    - `values`: real arrays by the quantity's name, the axes of the points before its own; NaN where
      a point has no numbers.
    - `message`: how each point ended: empty where it succeeded, otherwise the solver's words,
      "failed: ..." or "not started". Shape of the points.
    - `units`: of axes and quantities, by name, where they are known.
    """

    axes: dict[str, np.ndarray]
    values: dict[str, np.ndarray]
    message: np.ndarray
    units: dict[str, str]

    def __getitem__(self, name: str) -> np.ndarray:
        """Returns the quantity or the axis of this name."""
        known = {**self.axes, **self.values}
        if name not in known:
            raise KeyError(f"There is no {name!r}: {nearest(name, known)}")
        return known[name]

    @property
    def complete(self) -> bool:
        """Whether every point succeeded."""
        return bool(np.all(self.message == ""))

    @property
    def ends(self) -> dict[str, int]:
        """How many points ended how, by their message."""
        messages, counts = np.unique(self.message, return_counts=True)
        return {str(m) or "successful": int(n) for m, n in zip(messages, counts, strict=True)}

    def over(self, axis: str, quantiles: Sequence[float] = (0.05, 0.5, 0.95)) -> "Spread":
        """Returns mean, standard error and quantiles over an axis, such as "seed".

        Points that did not succeed are left out; NaN where none is left. The standard error of the
        mean is that of independent draws: NaN where there is one.

        **Raises:** `ValueError` if there is no such axis, or for quantiles outside 0 to 1.
        """
        if axis not in self.axes:
            raise ValueError(f"`axis={axis!r}` is no axis: {nearest(axis, self.axes)}")
        check_values(
            "quantiles", np.asarray(quantiles), "they are from 0 to 1", at_least=0, at_most=1
        )
        along = list(self.axes).index(axis)
        used = self.message == ""
        mean, error, levels = {}, {}, {}
        for name, values in self.values.items():
            outer = used.reshape(used.shape + (1,) * (values.ndim - used.ndim))
            kept = np.ma.masked_array(values.astype(float), np.broadcast_to(~outer, values.shape))
            count = np.sum(outer, axis=along)
            mean[name] = np.ma.filled(kept.mean(along), np.nan)
            variance = np.ma.filled(kept.var(along), np.nan)
            error[name] = np.sqrt(variance / np.where(count > 1, count - 1, np.nan))
            levels[name] = _quantiles(kept.filled(np.nan), quantiles, along)
        axes = {name: at for name, at in self.axes.items() if name != axis}
        message = np.where(np.any(used, axis=along), "", "no point succeeded")
        each = {"quantile": np.asarray(quantiles, float), **axes}
        everywhere = np.broadcast_to(message, (len(each["quantile"]), *message.shape))
        return Spread(
            Study(axes, mean, message, self.units),
            Study(axes, error, message, self.units),
            Study(each, levels, everywhere, self.units),
        )

    def to_xarray(self) -> "xarray.Dataset":
        """Returns the study as an `xarray.Dataset` (the extra `xarray`)."""
        try:
            import xarray
        except ImportError as error:
            raise ImportError(
                "`to_xarray` needs xarray: `pip install 'graded_contact[xarray]'`."
            ) from error
        data: dict[str, Any] = {
            name: (self._dimensions(name), values, self._about(name))
            for name, values in self.values.items()
        }
        data["message"] = (tuple(self.axes), self.message.astype(object))
        coordinates = {name: (name, at, self._about(name)) for name, at in self.axes.items()}
        return xarray.Dataset(data, coordinates)

    def to_csv(self, path: str | os.PathLike) -> None:
        """Writes a table with a row for each point: axes, numbers (no fields) and message."""
        numbers = [name for name in self.values if self.values[name].ndim == self.message.ndim]
        units = [f" [{self.units[n]}]" if n in self.units else "" for n in (*self.axes, *numbers)]
        names = [*map("".join, zip((*self.axes, *numbers), units, strict=True)), "message"]
        with replacing(path) as partial, open(partial, "w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(names)
            for index in np.ndindex(self.message.shape):
                at = [values[i] for values, i in zip(self.axes.values(), index, strict=True)]
                rows.writerow([*at, *(self.values[n][index] for n in numbers), self.message[index]])

    def write(self, path: str | os.PathLike) -> None:
        """Writes an HDF5 file; an earlier one is replaced once the new one is whole."""
        with new_file(path, FORMAT) as file:
            put_study(file, self)

    def _dimensions(self, name: str) -> tuple[str, ...]:
        own = self.values[name].shape[self.message.ndim :]
        return (*self.axes, *(f"index_{i}_of_{length}" for i, length in enumerate(own)))

    def _about(self, name: str) -> dict[str, str]:
        return {"units": self.units[name]} if name in self.units else {}


@shown()
class Spread(NamedTuple):
    """Mean, standard error of the mean, and quantiles, which lie along a first axis `quantile`."""

    mean: Study
    standard_error: Study
    quantiles: Study


def read_study(path: str | os.PathLike) -> Study:
    """Returns the study in a file that `Study.write` wrote, bit for bit.

    **Arguments:**

    - `path`: of the HDF5 file.

    **Returns:** a `Study`.

    **Raises:** `FileNotFoundError`; `ValueError` for another file or a damaged one.
    """
    with opened(path, FORMAT) as file:
        axes = list(map(str, file.attrs["axes"]))
        rest = [name for name in file if name not in axes and not name.startswith("index_")]
        return get_study(file, [name for name in rest if name != "message"])


def put_study(
    file: Any, study: Study, descriptions: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Writes a study into the root of an HDF5 file, with what is said of its axes and values."""

    def about(name: str) -> dict[str, str]:
        said = {"description": descriptions[name]} if name in descriptions else {}
        return study._about(name) | said

    file.attrs["axes"] = list(study.axes)
    for name, at in study.axes.items():
        put(file, name, at, (name,), about(name))
    # The format has no dimension without a scale.
    indices = {d for name in study.values for d in study._dimensions(name)} - set(study.axes)
    for name in sorted(indices):
        put(file, name, np.arange(int(name.split("_")[-1])), (name,), {})
    for name, values in study.values.items():
        put(file, name, values, study._dimensions(name), about(name))
    put(file, "message", study.message, tuple(study.axes), about("message"))


def get_study(file: Any, names: Sequence[str], kinds: str = "fiub") -> Study:
    """Returns the study in the root of an open file, of its values those with these names.

    `kinds` are those that the values may have, of NumPy's dtypes.

    **Raises:** `ValueError` if shapes do not fit.
    """
    axes = {str(name): numbers(file[str(name)], "fiu") for name in file.attrs["axes"]}
    values = {name: numbers(file[name], kinds) for name in names}
    message, shape = texts(file["message"]), tuple(at.size for at in axes.values())
    for name, array in {**values, "message": message}.items():
        if array.shape[: len(shape)] != shape:
            raise ValueError(f"{name} has the shape {array.shape} instead of {shape}")
    units = {
        name: str(file[name].attrs["units"])
        for name in (*axes, *values)
        if "units" in file[name].attrs
    }
    return Study(axes, values, message, units)


def _quantiles(values: np.ndarray, levels: Sequence[float], along: int) -> np.ndarray:
    """Quantiles of what is not NaN, the levels along a first axis; NaN where nothing is left."""
    ordered = np.sort(np.moveaxis(values, along, 0), axis=0)  # NaN comes last
    count = np.sum(~np.isnan(ordered), axis=0)
    found = []
    for level in levels:
        place = np.asarray(level * np.maximum(count - 1, 0))
        low = np.floor(place).astype(int)
        high = np.minimum(low + 1, np.maximum(count - 1, 0))
        ends = [np.take_along_axis(ordered, i[None], axis=0)[0] for i in (low, high)]
        found.append(ends[0] + (place - low) * (ends[1] - ends[0]))
    return np.stack(found)
