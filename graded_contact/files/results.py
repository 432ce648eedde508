"""Results of a scene, and the HDF5 file that holds them.

The root group has one dataset per quantity over the dimensions `pressure` and `velocity`, and the
surface over `x` and `y`; a group `solve_i_j` has the fields of the solve at pressure i and velocity
j. Every dataset carries its `units` and a `description`, every dimension is a scale, so that
xarray opens the file with `engine="h5netcdf"`. Attributes of the root hold the scene (TOML text),
the versions of the packages, the dtype, the seed and what else the run reported.

A file is written under another name and renamed when complete: a killed run leaves no half file.
"""

import contextlib
import dataclasses
import math
import os
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..caveats import Caveat, caveats_of
from ..grid import Grid
from ..surface import Step, Surface
from .sealed import SEAL, is_sealed, replacing, seal

FORMAT = "graded_contact results 2"
NOT_STARTED = "not started"
FAILED = "failed: "
_COMPRESSION = 1100  # the most that gzip saves is a factor of 1032
# What h5py raises for files that are damaged inside, beside what is looked for.
_UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, IndexError,
    OverflowError, MemoryError,
)  # fmt: skip
_PACKAGES = ("graded_contact", "jax", "numpy", "h5py")


class Quantity(NamedTuple):
    """Unit, description and dimensions of an array in the file."""

    unit: str
    description: str
    dimensions: tuple[str, ...]


def _of_solve(unit: str, description: str) -> Quantity:
    return Quantity(unit, description, ("pressure", "velocity"))


AXES = {
    "pressure": Quantity("Pa", "mean pressure", ("pressure",)),
    "velocity": Quantity("m/s", "sliding velocity", ("velocity",)),
}
OBSERVABLES = {
    "friction": _of_solve("1", "friction coefficient"),
    "contact_area": _of_solve("1", "contact area fraction (points in contact)"),
    "contact_area_corrected": _of_solve("1", "contact area fraction (corrected by the perimeter)"),
    "contact_area_smooth": _of_solve("1", "contact area fraction (sub-pixel)"),
    "mean_gap": _of_solve("m", "mean gap"),
    "geometric_friction": _of_solve("1", "friction coefficient from the slope of the surface"),
    "energy_imbalance": _of_solve("1", "work of friction against dissipation, relative difference"),
    "slope_in_contact": _of_solve("1", "rms slope of the block, weighted by the pressure"),
    "unmeasured_area": _of_solve("1", "share of the contact area on filled or tapered points"),
    "unmeasured_friction": _of_solve("1", "share of the friction on filled or tapered points"),
    "extrapolated_friction": _of_solve("1", "share of the friction where no modulus was measured"),
    "error": _of_solve("1", "estimated relative error of the contact pressure"),
    "num_fft_pairs": _of_solve("1", "FFT pairs spent on the solve"),
}
TEXTS = {
    "message": _of_solve("1", "how the solve ended; empty where it succeeded"),
    "point": _of_solve("1", "fingerprint of what decides the solve's numbers"),
}
FIELDS = {
    "pressure": Quantity("Pa", "contact pressure", ("x", "y")),
    "gap": Quantity("m", "gap", ("x", "y")),
    "displacement": Quantity("m", "displacement into the solid", ("x", "y")),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Fields:
    """Fields of one solve, NumPy arrays of the shape of the surface.

    **Fields:**

    - `pressure`: contact pressure [Pa].
    - `gap`, `displacement`: gap and displacement into the solid [m].
    """

    pressure: Float[np.ndarray, "*shape"]
    gap: Float[np.ndarray, "*shape"]
    displacement: Float[np.ndarray, "*shape"]


@dataclasses.dataclass(frozen=True, eq=False)
class Results:
    """What a scene gave at each of its pressures and velocities, as NumPy arrays.

    **Fields:**

    - `pressure`, `velocity`: mean pressures [Pa] and velocities [m/s] of the sweep, one axis each.
    - `friction`, `contact_area`, `contact_area_corrected`, `contact_area_smooth`, `mean_gap`,
      `geometric_friction`, `energy_imbalance`, `slope_in_contact`, `unmeasured_area`,
      `unmeasured_friction`, `extrapolated_friction`: as in `Sliding`, shape
      `(pressures, velocities)`.
    - `error`, `num_fft_pairs`: as in `ContactSolution`, same shape.
    - `message`: how each solve ended, same shape; empty where it succeeded.
    - `point`: the name of each solve in a store of points, same shape.
    - `surface`: the rough surface.
    - `fields`: fields of the solves that were kept, by their pair of indices.
    - `attributes`: texts and numbers about the run: the scene, the seed, the versions, ...
    """

    pressure: Float[np.ndarray, " pressures"]
    velocity: Float[np.ndarray, " velocities"]
    friction: Float[np.ndarray, "pressures velocities"]
    contact_area: Float[np.ndarray, "pressures velocities"]
    contact_area_corrected: Float[np.ndarray, "pressures velocities"]
    contact_area_smooth: Float[np.ndarray, "pressures velocities"]
    mean_gap: Float[np.ndarray, "pressures velocities"]
    geometric_friction: Float[np.ndarray, "pressures velocities"]
    energy_imbalance: Float[np.ndarray, "pressures velocities"]
    slope_in_contact: Float[np.ndarray, "pressures velocities"]
    unmeasured_area: Float[np.ndarray, "pressures velocities"]
    unmeasured_friction: Float[np.ndarray, "pressures velocities"]
    extrapolated_friction: Float[np.ndarray, "pressures velocities"]
    error: Float[np.ndarray, "pressures velocities"]
    num_fft_pairs: Float[np.ndarray, "pressures velocities"]
    message: np.ndarray
    point: np.ndarray
    surface: Surface
    fields: dict[tuple[int, int], Fields]
    attributes: dict[str, Any]

    @property
    def converged(self) -> np.ndarray:
        """Whether each solve succeeded, shape `(pressures, velocities)`."""
        return self.message == ""

    @property
    def state(self) -> np.ndarray:
        """A word for each solve, same shape: empty where it succeeded, "not started", "failed"
        (there is no number) or "not converged" (the numbers are partial results)."""
        failed = np.char.startswith(self.message, FAILED)
        words = np.where(failed, "failed", np.where(self.converged, "", "not converged"))
        return np.where(self.message == NOT_STARTED, NOT_STARTED, words)

    @property
    def complete(self) -> bool:
        """Whether every solve succeeded."""
        return bool(np.all(self.converged))

    @property
    def caveats(self) -> tuple[Caveat, ...]:
        """What makes these numbers doubtful although solved, and the solves that it concerns."""
        everywhere = np.ones(self.friction.shape, bool)
        of_surface = tuple(Caveat(text, everywhere) for text in self.surface.caveats)
        return (*of_surface, *caveats_of(self))


def package_versions() -> dict[str, str]:
    """Returns the versions of this package and of those its numbers depend on, as attributes."""
    return {f"version_{name}": version(name) for name in _PACKAGES}


def write_results(path: str | os.PathLike, results: Results) -> None:
    """Writes results to an HDF5 file; an earlier one is replaced once the new one is complete."""
    with replacing(path) as partial:
        with h5py.File(partial, "w-", userblock_size=SEAL, track_order=True) as file:
            _write(file, results)
        seal(partial)


def read_results(path: str | os.PathLike) -> Results:
    """Returns the results held by a file that `write_results` wrote, bit for bit.

    A missing file raises `FileNotFoundError`, an unreadable or truncated one `ValueError`.

    **Arguments:**

    - `path`: of the HDF5 file.

    **Returns:** what `run_scene` gave.
    """
    with _opened(path) as file:
        return _read(file)


def lost_solves(path: str | os.PathLike, point: np.ndarray) -> tuple[int, dict[str, Any]]:
    """Returns how many solves the file at `path` has that are not in `point`, and its attributes.

    A file that has any must not be replaced by one with the solves of these names only. Solves that
    were not started do not count; there are none if there is no file. Raises as `read_results`.
    """
    if not Path(path).exists():
        return 0, {}
    with _opened(path) as file:
        finished = _read_texts(file["point"])[_read_texts(file["message"]) != NOT_STARTED]
        return int(np.sum(~np.isin(finished, point))), _attributes(file)


@contextlib.contextmanager
def _opened(path: str | os.PathLike) -> Iterator[Any]:
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    try:
        if not is_sealed(path):
            raise ValueError("it was damaged or changed, or written by another program")
        with h5py.File(path) as file:
            if str(file.attrs.get("format")) != FORMAT:
                raise ValueError(f"it does not say that it holds {FORMAT!r}")
            yield file
    except _UNREADABLE as error:
        reason = " ".join(str(error).split())
        raise ValueError(
            f"`path={path}` cannot be read as results of graded_contact: {reason}."
        ) from error


def _write(file: h5py.File, results: Results) -> None:
    file.attrs["format"] = FORMAT
    for name, value in results.attributes.items():
        file.attrs[name] = value
    file.attrs["caveats"] = "\n".join(caveat.sentence for caveat in results.caveats)
    for name, about in {**AXES, **OBSERVABLES, **TEXTS}.items():
        _put(file, name, getattr(results, name), about)
    _write_surface(file, results.surface)
    for (i, j), fields in results.fields.items():
        group = file.create_group(f"solve_{i}_{j}")
        group.attrs["load"], group.attrs["speed"] = results.pressure[i], results.velocity[j]
        for name, about in FIELDS.items():
            values = getattr(fields, name)
            dimensions = about.dimensions[: values.ndim]
            _put(group, name, values, about._replace(dimensions=dimensions))


def _write_surface(file: h5py.File, surface: Surface) -> None:
    heights, size = np.asarray(surface.heights), np.asarray(surface.grid.size)
    file.attrs["surface_size"] = size
    file.attrs["surface_history"] = "\n".join(surface.history)
    axes = ("x", "y")[: heights.ndim]
    for axis, points, length in zip(axes, heights.shape, size, strict=True):
        where = np.arange(points) * (length / points)
        _put(file, axis, where, Quantity("m", f"position along {axis}", (axis,)))
    about = Quantity("m", "height of the surface, into the solid", axes)
    _put(file, "heights", heights, about)
    if surface.measured is not None:
        about = Quantity("1", "how much of each height was measured, not filled or tapered", axes)
        _put(file, "measured", np.asarray(surface.measured), about)
    if surface.steps:
        for name, values in zip(Step._fields, zip(*surface.steps, strict=True), strict=True):
            file.attrs[f"surface_step_{name}"] = values


def _put(group: h5py.Group, name: str, values: np.ndarray, about: Quantity) -> None:
    """Writes one dataset; one that has its only dimension's name becomes that dimension's scale."""
    if values.dtype.kind in "UO":
        dataset = group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        dataset = group.create_dataset(
            name, data=values, compression="gzip", shuffle=True, fletcher32=True
        )
    dataset.attrs["units"], dataset.attrs["description"] = about.unit, about.description
    if about.dimensions == (name,):
        dataset.make_scale(name)
        return
    for dimension, label in zip(dataset.dims, about.dimensions, strict=True):
        dimension.label = label
        dimension.attach_scale(group.file[label])


def _read(file: Any) -> Results:
    attributes = _attributes(file)
    heights = _read_array(file["heights"])
    values = {name: _read_array(file[name]) for name in {**AXES, **OBSERVABLES}}
    values |= {name: _read_texts(file[name]) for name in TEXTS}
    shape = tuple(values[name].size for name in AXES)
    for name in {**OBSERVABLES, **TEXTS}:
        if values[name].shape != shape:
            raise ValueError(f"{name} has the shape {values[name].shape} instead of {shape}")
    fields = {}
    for name, group in file.items():
        if name.startswith("solve_"):
            i, j = map(int, name.split("_")[1:])
            values["message"][i, j]  # there is such a solve
            arrays = {key: _read_array(group[key]) for key in FIELDS}
            if any(array.shape != heights.shape for array in arrays.values()):
                raise ValueError(f"{name} has not the shape {heights.shape} of the surface")
            fields[i, j] = Fields(**arrays)
    history = str(file.attrs["surface_history"])
    steps = [file.attrs.get(f"surface_step_{name}", ()) for name in Step._fields]
    surface = Surface(
        heights=jnp.asarray(heights),
        grid=Grid(heights.shape, jnp.asarray(file.attrs["surface_size"])),
        history=tuple(history.split("\n")) if history else (),
        measured=jnp.asarray(_read_array(file["measured"])) if "measured" in file else None,
        steps=tuple(
            Step(str(name), *map(float, numbers)) for name, *numbers in zip(*steps, strict=True)
        ),
    )
    return Results(**values, surface=surface, fields=fields, attributes=attributes)


def _attributes(file: Any) -> dict[str, Any]:
    """The texts and numbers of the root, those apart that have a field of their own."""
    found = {}
    for name, value in file.attrs.items():
        if name in ("format", "caveats") or name.startswith("surface_"):
            continue
        if not isinstance(value, str | np.number | np.bool_):
            raise ValueError(f"the attribute {name} is neither a text nor a number")
        found[name] = value if isinstance(value, str) else value.item()
    return found


def _read_array(dataset: Any) -> np.ndarray:
    """The numbers of a dataset, which it must hold as it says: read only after a look at that."""
    _check_stored(dataset)
    if dataset.dtype.kind != "f":
        raise ValueError(f"{dataset.name} holds {dataset.dtype} instead of numbers")
    return np.asarray(dataset[()])


def _read_texts(dataset: Any) -> np.ndarray:
    """The texts of a dataset."""
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
