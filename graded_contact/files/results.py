"""Results of a scene, and the HDF5 file that holds them.

The root group is a study (`files/study.py`): one dataset per quantity over the axes of the scene,
such as `pressure` and `velocity`. Beside it lies the surface over `x` and `y`; a group `solve_i_j`
has the fields of the solve with these indices along the axes. Every dataset carries its `units` and
a `description`, every dimension is a scale, so that xarray opens the file with `engine="h5netcdf"`.
Attributes of the root hold the scene (TOML text), the versions of the packages, the dtype, the seed
and what else the run reported.

A file is written under another name and renamed when complete: a killed run leaves no half file.
"""

import dataclasses
import functools
import os
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..core.display import shown
from ..core.warnings import Caveat, caveats_of
from ..fields.grid import Grid
from ..roughness.surface import Step, Surface
from .hdf5 import new_file, numbers, opened, put, texts
from .study import FAILED, LOST, NOT_STARTED, Study, get_study, put_study, units_of

FORMAT = "graded_contact results 3"
_PACKAGES = ("graded_contact", "jax", "numpy", "h5py")
# What they are, by name; units are those of studies.
AXES = {
    "temperature": "temperature",
    "seed": "number that the surface is drawn from",
    "pressure": "mean pressure",
    "velocity": "sliding velocity",
}
OBSERVABLES = {
    "friction": "friction coefficient",
    "friction_error": "estimated error of the friction coefficient that the solver left",
    "contact_area": "contact area fraction (points in contact)",
    "contact_area_error": "estimated error of the contact area fraction that the solver left",
    "contact_area_corrected": "contact area fraction (corrected by the perimeter)",
    "contact_area_smooth": "contact area fraction (sub-pixel)",
    "mean_gap": "mean gap",
    "geometric_friction": "friction coefficient from the slope of the surface",
    "energy_imbalance": "work of friction against dissipation, relative difference",
    "slope_in_contact": "rms slope of the block, weighted by the pressure",
    "unmeasured_area": "share of the contact area on filled or tapered points",
    "unmeasured_friction": "share of the friction on filled or tapered points",
    "extrapolated_friction": "share of the friction where no modulus was measured",
    "error": "estimated relative error of the contact pressure",
    "num_fft_pairs": "FFT pairs spent on the solve",
}
# Files of earlier versions lack the errors.
REQUIRED = tuple(name for name in OBSERVABLES if not name.endswith("_error"))
OPTIONAL = {
    "reduced_velocity": "velocity times the time-temperature shift a_T",
    "friction_standard_error": "standard error of the friction by that of the materials",
}
TEXTS = {
    "message": "how the solve ended; empty where it succeeded",
    "point": "fingerprint of what decides the solve's numbers",
}
FIELDS = {
    "pressure": "contact pressure",
    "gap": "gap",
    "displacement": "displacement into the solid",
    "heights": "height of the surface, into the solid",
}


@shown()
@dataclasses.dataclass(frozen=True, eq=False)
class Fields:
    """Fields of one solve, NumPy arrays of the shape of the surface.

    **Fields:**

    - `pressure`: contact pressure [Pa].
    - `gap`, `displacement`: gap and displacement into the solid [m].
    - `heights`: of the surface [m] where each seed has its own, otherwise None.
    """

    pressure: Float[np.ndarray, "*shape"]
    gap: Float[np.ndarray, "*shape"]
    displacement: Float[np.ndarray, "*shape"]
    heights: Float[np.ndarray, "*shape"] | None = None


@shown("study", "surface", "caveats")
@dataclasses.dataclass(frozen=True, eq=False)
class Results:
    """What a scene gave at each of its points, as NumPy arrays over its axes.

    The axes are, as far as the scene has them: the paths of [sweep], `temperature` [K], `seed`;
    and always `pressure` [Pa] and `velocity` [m/s]. Axes and quantities are had by `results[name]`
    and, but for paths, as attributes: `results.friction`.

    **Fields:**

    - `study`: axes; `friction`, `friction_error`, `contact_area`, `contact_area_error`,
      `contact_area_corrected`, `contact_area_smooth`, `mean_gap`, `geometric_friction`,
      `energy_imbalance`, `slope_in_contact`, `unmeasured_area`, `unmeasured_friction`,
      `extrapolated_friction` as in `Sliding`; `error`, `num_fft_pairs` as in `ContactSolution`;
      `reduced_velocity` a_T v [m/s] where the block has one law of temperature,
      `friction_standard_error` where errors of a material are known; and how each solve ended. It
      makes tables and spreads: `results.study.over("seed")`.
    - `point`: the name of each solve in a store of points, shape of the axes.
    - `surface`: the rough surface, that of the first seed.
    - `fields`: fields of the solves that were kept, by their indices along the axes.
    - `attributes`: texts and numbers about the run: the scene, the seed, the versions, ...
    """

    study: Study
    point: np.ndarray
    surface: Surface
    fields: dict[tuple[int, ...], Fields]
    attributes: dict[str, Any]

    def __getitem__(self, name: str) -> np.ndarray:
        """Returns the quantity or the axis of this name."""
        return self.study[name]

    def __getattr__(self, name: str) -> np.ndarray:
        if name not in (*AXES, *OBSERVABLES, *OPTIONAL):
            raise AttributeError(f"`Results` has no attribute {name!r}.")
        try:
            return self.study[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from error

    @property
    def message(self) -> np.ndarray:
        """How each solve ended, shape of the axes; empty where it succeeded."""
        return self.study.message

    @property
    def converged(self) -> np.ndarray:
        """Whether each solve succeeded, shape of the axes."""
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
        return self.study.complete

    @property
    def caveats(self) -> tuple[Caveat, ...]:
        """What makes these numbers doubtful although solved, and the solves that it concerns."""
        everywhere = np.ones(self.message.shape, bool)
        of_surface = tuple(Caveat(text, everywhere) for text in self.surface.caveats)
        return (*of_surface, *caveats_of(self))

    def surface_of(self, index: tuple[int, ...]) -> Surface:
        """Returns the surface of a solve whose fields were kept."""
        heights = self.fields[index].heights
        return self.surface if heights is None else Surface(heights, self.surface.grid)


# Asked once: a worker of dask that ends in a thread of this process edits sys.path meanwhile.
@functools.cache
def package_versions() -> dict[str, str]:
    """Returns the versions of this package and of those its numbers depend on, as attributes."""
    return {f"version_{name}": version(name) for name in _PACKAGES}


def write_results(path: str | os.PathLike, results: Results) -> None:
    """Writes results to an HDF5 file; an earlier one is replaced once the new one is complete."""
    with new_file(path, FORMAT) as file:
        for name, value in results.attributes.items():
            file.attrs[name] = value
        file.attrs["caveats"] = "\n".join(caveat.sentence for caveat in results.caveats)
        paths = {name: "number of the block" for name in results.study.axes if name not in AXES}
        put_study(file, results.study, {**paths, **AXES, **OBSERVABLES, **OPTIONAL, **TEXTS})
        about = {"description": TEXTS["point"]}
        put(file, "point", results.point, tuple(results.study.axes), about)
        _write_surface(file, results.surface)
        for index, fields in results.fields.items():
            _write_fields(file, index, fields, results.study.axes)


def read_results(path: str | os.PathLike) -> Results:
    """Returns the results held by a file that `write_results` wrote, bit for bit.

    A missing file raises `FileNotFoundError`, an unreadable or truncated one `ValueError`.

    **Arguments:**

    - `path`: of the HDF5 file.

    **Returns:** what `run_scene` gave.
    """
    with opened(path, FORMAT) as file:
        names = [name for name in (*OBSERVABLES, *OPTIONAL) if name in file or name in REQUIRED]
        study = get_study(file, names, "f")
        surface, point = _read_surface(file), texts(file["point"])
        shapes = {values.shape for values in (*study.values.values(), point)}
        if shapes != {study.message.shape}:
            raise ValueError(f"its quantities have the shapes {shapes}")
        groups = (name for name in file if name.startswith("solve_"))
        fields = dict(_read_fields(file[name], study, surface) for name in groups)
        return Results(study, point, surface, fields, _attributes(file))


def lost_solves(path: str | os.PathLike, point: np.ndarray) -> tuple[int, dict[str, Any]]:
    """Returns how many solves the file at `path` has that are not in `point`, and its attributes.

    A file that has any must not be replaced by one with the solves of these names only. Solves that
    were not started, or whose worker died, do not count; there are none if there is no file. Raises
    as `read_results`.
    """
    if not Path(path).exists():
        return 0, {}
    with opened(path, FORMAT) as file:
        finished = texts(file["point"])[~np.isin(texts(file["message"]), (NOT_STARTED, LOST))]
        return int(np.sum(~np.isin(finished, point))), _attributes(file)


def _about(name: str, description: str) -> dict[str, str]:
    return {"units": units_of([name])[name], "description": description}


def _write_surface(file: h5py.File, surface: Surface) -> None:
    heights, size = np.asarray(surface.heights), np.asarray(surface.grid.size)
    file.attrs["surface_size"] = size
    file.attrs["surface_history"] = "\n".join(surface.history)
    axes = ("x", "y")[: heights.ndim]
    for axis, points, length in zip(axes, heights.shape, size, strict=True):
        where = np.arange(points) * (length / points)
        put(file, axis, where, (axis,), {"units": "m", "description": f"position along {axis}"})
    put(file, "heights", heights, axes, _about("heights", FIELDS["heights"]))
    if surface.measured is not None:
        about = "how much of each height was measured, not filled or tapered"
        about = {"units": "1", "description": about}
        put(file, "measured", np.asarray(surface.measured), axes, about)
    if surface.steps:
        for name, values in zip(Step._fields, zip(*surface.steps, strict=True), strict=True):
            file.attrs[f"surface_step_{name}"] = values


def _read_surface(file: Any) -> Surface:
    heights = numbers(file["heights"])
    history = str(file.attrs["surface_history"])
    steps = [file.attrs.get(f"surface_step_{name}", ()) for name in Step._fields]
    return Surface(
        heights=jnp.asarray(heights),
        grid=Grid(heights.shape, jnp.asarray(file.attrs["surface_size"])),
        history=tuple(history.split("\n")) if history else (),
        measured=jnp.asarray(numbers(file["measured"])) if "measured" in file else None,
        steps=tuple(
            Step(str(name), *map(float, values)) for name, *values in zip(*steps, strict=True)
        ),
    )


def _write_fields(file: h5py.File, index: tuple[int, ...], fields: Fields, axes: dict) -> None:
    group = file.create_group("_".join(map(str, ("solve", *index))))
    for (name, at), i in zip(axes.items(), index, strict=True):
        group.attrs[name] = at[i]
    for name, description in FIELDS.items():
        values = getattr(fields, name)
        if values is not None:
            put(group, name, values, ("x", "y")[: values.ndim], _about(name, description))


def _read_fields(group: Any, study: Study, surface: Surface) -> tuple[tuple[int, ...], Fields]:
    index = tuple(map(int, group.name.split("_")[1:]))
    study.message[index]  # there is such a solve
    if len(index) != study.message.ndim:
        raise ValueError(f"{group.name} has not the axes of the solves")
    names = [name for name in FIELDS if name != "heights" or name in group]
    arrays = {name: numbers(group[name]) for name in names}
    if any(array.shape != surface.grid.shape for array in arrays.values()):
        raise ValueError(f"{group.name} has not the shape {surface.grid.shape} of the surface")
    return index, Fields(**arrays)


def _attributes(file: Any) -> dict[str, Any]:
    """The texts and numbers of the root, those apart that have a field of their own."""
    found = {}
    for name, value in file.attrs.items():
        if name in ("format", "caveats", "axes") or name.startswith("surface_"):
            continue
        if not isinstance(value, str | np.number | np.bool_):
            raise ValueError(f"the attribute {name} is neither a text nor a number")
        found[name] = value if isinstance(value, str) else value.item()
    return found
