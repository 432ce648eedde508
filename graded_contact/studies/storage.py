"""Results of a scene, and the HDF5 file that holds them.

The root group has one dataset per quantity over the dimensions `pressure` and `velocity`, and the
surface over `x` and `y`; a group `solve_i_j` has the fields of the solve at pressure i and velocity
j. Every dataset carries its `units` and a `description`, every dimension is a scale, so that
xarray opens the file with `engine="h5netcdf"`. Attributes of the root hold the scene (TOML text),
the versions of the packages, the dtype, the seed and what else the run reported.

A file is written under another name and renamed when complete: a killed run leaves no half file.
"""

import dataclasses
import os
import uuid
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

FORMAT = "graded_contact results 1"
_PACKAGES = ("graded_contact", "jax", "numpy", "h5py")
# Why a file that opens may still not be one of ours, or be damaged inside.
_UNREADABLE = (OSError, KeyError, ValueError, TypeError, RuntimeError)


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
    "error": _of_solve("1", "estimated relative error of the contact pressure"),
    "num_fft_pairs": _of_solve("1", "FFT pairs spent on the solve"),
}
MESSAGE = {"message": _of_solve("1", "how the solve ended; empty where it succeeded")}
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
      `unmeasured_friction`: as in `Sliding`, shape `(pressures, velocities)`.
    - `error`, `num_fft_pairs`: as in `ContactSolution`, same shape.
    - `message`: how each solve ended, same shape; empty where it succeeded.
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
    error: Float[np.ndarray, "pressures velocities"]
    num_fft_pairs: Float[np.ndarray, "pressures velocities"]
    message: np.ndarray
    surface: Surface
    fields: dict[tuple[int, int], Fields]
    attributes: dict[str, Any]

    @property
    def converged(self) -> np.ndarray:
        """Whether each solve succeeded, shape `(pressures, velocities)`."""
        return self.message == ""

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
    path = Path(path)
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        with h5py.File(partial, "w-", track_order=True) as file:
            _write(file, results)
        with open(partial, "rb") as written:
            os.fsync(written.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def read_results(path: str | os.PathLike) -> Results:
    """Returns the results held by a file that `write_results` wrote, bit for bit.

    A missing file raises `FileNotFoundError`, an unreadable or truncated one `ValueError`.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    try:
        with h5py.File(path) as file:
            if file.attrs.get("format") != FORMAT:
                raise ValueError(f"it does not say that it holds {FORMAT!r}")
            return _read(file)
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
    for name, about in {**AXES, **OBSERVABLES, **MESSAGE}.items():
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
        # The checksum tells a damaged number from a measured one.
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
    derived = ("format", "caveats")
    attributes = {name: _plain(value) for name, value in file.attrs.items() if name not in derived}
    size, history = attributes.pop("surface_size"), attributes.pop("surface_history")
    steps = [attributes.pop(f"surface_step_{name}", []) for name in Step._fields]
    heights = file["heights"][()]
    values = {name: _array(file[name]) for name in {**AXES, **OBSERVABLES, **MESSAGE}}
    fields = {}
    for name, group in file.items():
        if name.startswith("solve_"):
            _, i, j = name.split("_")
            fields[int(i), int(j)] = Fields(**{key: group[key][()] for key in FIELDS})
    surface = Surface(
        heights=jnp.asarray(heights),
        grid=Grid(heights.shape, jnp.asarray(size)),
        history=tuple(history.split("\n")) if history else (),
        measured=jnp.asarray(file["measured"][()]) if "measured" in file else None,
        steps=tuple(
            Step(str(name), *map(float, numbers)) for name, *numbers in zip(*steps, strict=True)
        ),
    )
    return Results(**values, surface=surface, fields=fields, attributes=attributes)


def _array(dataset: Any) -> np.ndarray:
    if h5py.check_string_dtype(dataset.dtype) is not None:
        return dataset.asstr()[()].astype(str)
    return dataset[()]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
