"""A scene to its results: an `xarray.Dataset` over its axes.

Variables are the numbers of each contact, `message` (empty where the solve succeeded), the
`heights` of the surface (of several seeds the last one), and the fields that the scene stores:
`contact_pressure`, `gap` and `displacement`. Numbers of a motion may also be over `time`; its
fields are over `time`, of a transient motion over `field_time`.
"""

import os
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.quantities import FIELDS, quantity_of
from ..fields.frequency import velocity_along
from ..materials.shift import shifts_in
from ..sliding import slide_case
from ..sliding.interior.stress import STRESSES, largest_stress
from ..sliding.number import numbers_of
from ..studies.sweep import sweep
from .scene import Scene

if TYPE_CHECKING:
    from xarray import Dataset

# Names in the results, where `pressure` is an axis, and in a contact.
CONTACT_FIELDS = {"contact_pressure": "pressure", "gap": "gap", "displacement": "displacement"}
FLOWS = ("flow_along_x", "flow_along_y")


def run_scene(scene: Scene, **engine: Any) -> "Dataset":
    """Returns friction, contact area and more at every point of the axes of a scene.

    **Arguments:**

    - `scene`: as read.
    - `engine`: `store`, `workers`, `client` and `progress`, see `sweep`.

    **Returns:** a dataset over the axes of the scene, with the text of the scene and the version of
    this package as attributes. It has the fields of the last point, or of all points if the
    scene stores these.
    """
    last = tuple(CONTACT_FIELDS) if scene.output.fields == "last" else ()
    results = sweep(lambda point: numbers_at(scene, point), scene.axes, last=last, **engine)
    results = with_places(scene, results)
    if "temperature" in scene.axes and "velocity" in scene.axes:
        results = with_reduced_velocity(scene, results)
    surfaces = filter(None, (scene.surface_at(scene.last), scene.block_surface))
    return results.assign_attrs(
        title=scene.title,
        scene=scene.text,
        version=version("graded_contact"),
        warnings="\n".join(text for surface in surfaces for text in surface.warnings),
    )


def frames_of(scene: Scene) -> tuple[int, ...]:
    """Returns the numbers of the steps of a transient motion with fields, the last among them."""
    if scene.motion is None or scene.motion.repeats:
        return (-1,)
    last = scene.motion.num_times - 1
    count = min(scene.output.frames, last + 1)
    return tuple(last - (last * i) // max(count - 1, 1) for i in reversed(range(count)))


def numbers_at(scene: Scene, point: dict[str, Any]) -> dict[str, Any]:
    """Returns numbers and fields of the contact of a scene at a point, and how the solve ended."""
    case, motion, frames = scene.case(point), scene.motion, frames_of(scene)
    contact: Any = slide_case(case, scene.numerics, fields_at=frames)
    asked = {*scene.observe.asked, *([] if scene.fluid is None else ["flow"])}
    names = [n for n in numbers_of(type(contact), contact.facts | asked) if n not in scene.axes]
    found = dict(zip(names, contact.compute(*names), strict=True))
    for name in asked.intersection(STRESSES):
        stress, depth = largest_stress(name, contact)
        found |= {name: stress, f"{name}_depth": depth}
    if motion is not None:
        found = {name: _along_motion(name, number, point) for name, number in found.items()}
        if motion.repeats:
            found["period"] = case.period
        else:  # the flow is known at some times
            unknown = jnp.full(motion.num_times, jnp.nan)
            flows = [name for name in found if name.startswith(FLOWS)]
            found |= {name: unknown.at[np.array(frames)].set(found[name]) for name in flows}
    if scene.fluid is not None:
        found |= _leakages(scene, found, case.surface.grid)
    if scene.output.fields is not None:
        found |= {name: getattr(contact.contact, of) for name, of in CONTACT_FIELDS.items()}
    return found | {"result": contact.result}


def _along_motion(name: str, number: Array, point: dict[str, Any]) -> Array:
    """The component along the motion of a number with two components."""
    if number.ndim < 2:
        return number
    along = jnp.atleast_1d(velocity_along(1.0, point["direction"]))
    return number @ (jnp.abs(along) if name.endswith("_error") else along)


def _leakages(scene: Scene, found: dict[str, Array], grid: Any) -> dict[str, Float[Array, "*nt"]]:
    """The leakage of a cell of a seal along x and along y [m³/s], and its error."""
    assert scene.fluid is not None
    leakages = {}
    for end in ("", "_error"):
        flow = jnp.stack([found[name + end] for name in FLOWS], axis=-1)
        leakage = scene.fluid.leakage(flow, grid)
        leakages |= {f"leakage_along_{axis}{end}": leakage[..., i] for i, axis in enumerate("xy")}
    return leakages


def with_places(scene: Scene, results: "Dataset") -> "Dataset":
    """Returns results with places and times in place of numbered dimensions, and the heights."""
    surface, motion = scene.surface_at(scene.last), scene.motion
    space, times = ("x", "y")[: surface.grid.ndim], ()
    for axis, count, length in zip(space, surface.grid.shape, surface.grid.size, strict=False):
        places = np.arange(count) * (float(length) / count)
        results = results.assign_coords({axis: (axis, places, attributes_of(axis))})
    if motion is not None:
        times = ("time",) if motion.repeats else ("field_time",)
        moved = "time", np.asarray(motion.displacement), attributes_of("surface_displacement")
        results = results.assign(surface_displacement=moved)
        at, about = np.arange(motion.num_times) / motion.num_times, attributes_of("time")
        if motion.times is not None:
            at, about = np.asarray(motion.times), {"units": "s", "long_name": "time"}
            framed = at[np.array(frames_of(scene))]
            results = results.assign_coords(field_time=("field_time", framed, about))
        results = results.assign_coords(time=("time", at, about))
    for name, variable in results.data_vars.items():
        axes = tuple(dim for dim in variable.dims if dim in scene.axes)
        is_field = name in CONTACT_FIELDS
        if is_field or (len(axes) < variable.ndim and "time" not in variable.dims):
            dims = *axes, *((*times, *space) if is_field else ("time",))
            about = attributes_of(CONTACT_FIELDS.get(str(name), str(name)))
            results = results.assign({name: (dims, variable.values, about)})
    return results.assign(heights=(space, np.asarray(surface.heights), attributes_of("heights")))


def attributes_of(name: str) -> dict[str, str]:
    """Returns unit and meaning of a variable."""
    quantity = FIELDS.get(name) or quantity_of(name)
    return {} if quantity is None else {"units": quantity.unit, "long_name": quantity.meaning}


def with_reduced_velocity(scene: Scene, results: "Dataset") -> "Dataset":
    """Returns results with `reduced_velocity` a_T v [m/s], if one law shifts all materials."""
    laws = shifts_in(scene.bodies.stack)
    if not laws or any(".shift." in axis for axis in scene.axes):
        return results
    logs = np.array([[law.log_factor(at) for at in scene.axes["temperature"]] for law in laws])
    # Two equal laws may be written about different references.
    if not np.allclose(logs - logs[:, :1], logs[0] - logs[0, 0], rtol=1e-6, atol=1e-6):
        return results
    reduced = np.multiply.outer(np.exp(logs[0]), scene.axes["velocity"])
    about = attributes_of("reduced_velocity")
    return results.assign(reduced_velocity=(("temperature", "velocity"), reduced, about))


def write_results(path: str | os.PathLike, results: "Dataset") -> None:
    """Writes results as HDF5 with checksums; an earlier file is replaced when all is written."""
    packed = {"zlib": True, "shuffle": True, "fletcher32": True}
    encoding = {
        name: packed
        for name, variable in results.variables.items()
        if variable.ndim and variable.dtype.kind in "fi"
    }
    partial = Path(f"{path}.partial")
    results.to_netcdf(partial, engine="h5netcdf", encoding=encoding)
    os.replace(partial, path)


def read_results(path: str | os.PathLike) -> "Dataset":
    """Returns the results in an HDF5 file of the command `run`, bit for bit as written.

    **Raises:** `FileNotFoundError`; `ValueError` for another file or a damaged one.
    """
    import xarray

    if not Path(path).exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    try:
        results = xarray.load_dataset(path, engine="h5netcdf")
        _ = results["message"], results.attrs["scene"]
    except (OSError, ValueError, KeyError) as error:
        raise ValueError(
            f"`path={path}` is not a result file of `graded-contact run`: {error}"
        ) from error
    return results
