"""The results of a scene: which numbers its solves have, and the dataset of all of them."""

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from ..blocks.window_kernel import has_ground
from ..core.quantities import FIELDS, OBSERVABLES, numbers_of
from ..materials.shift import shifts_in
from ..readers.paths import read_file
from ..studies.dataset import NOT_STARTED, attach, package_versions
from ..studies.store import Point
from ..surfaces.surface import Surface
from .results import KEPT_FIELDS, surface_variables, warnings_of
from .scene import Scene
from .surface_source import RandomSurface
from .theory import errors_of_stack

if TYPE_CHECKING:
    from xarray import Dataset


def numbers_of_scene(scene: Scene, surface: Surface) -> tuple[str, ...]:
    """The numbers of a solve but those of the axes; a standard error if errors are known."""
    facts = {
        "heated": scene.heating is not None,
        "window": not surface.periodic,
        "ground": not surface.periodic and has_ground(scene.stack, surface.grid),
        "given approach": scene.approach is not None,
        "given load": scene.approach is None,
    }
    known = [fact for fact, holds in facts.items() if holds]
    names = [n for n in numbers_of(scene.motion is not None, known) if n not in scene.axes]
    return *names, *(["friction_standard_error"] if errors_of_stack(scene) is not None else [])


def fields_of(scene: Scene) -> tuple[str, ...]:
    """The fields of a solve that is kept: heights if each seed has its own."""
    return tuple(name for name in KEPT_FIELDS if name != "heights" or "seed" in scene.axes)


def collect(
    scene: Scene,
    surface: Surface,
    names: np.ndarray,
    points: list[Point | None],
    kept: tuple[int, ...],
) -> "Dataset":
    """The results of a scene from its solves; None marks a solve that was not started."""
    import xarray

    axes, shape, dtype = tuple(scene.axes), names.shape, surface.heights.dtype

    def over_axes(name: str, points: list[Point | None], *inner: int) -> np.ndarray:
        """A quantity of some solves, NaN where a solve has no numbers."""
        values = np.full((len(points), *inner), np.nan, dtype)
        for i, point in enumerate(points):
            if point is not None and point.values:
                values[i] = point.values[name]
        return values

    variables: dict[str, Any] = {}
    times, over_time = scene.num_times, ()
    for name in numbers_of_scene(scene, surface):
        if scene.motion is not None and name in OBSERVABLES and OBSERVABLES[name].over_time:
            values = over_axes(name, points, times).reshape(*shape, times)
            variables[name] = (*axes, "time"), values
        else:
            variables[name] = axes, over_axes(name, points).reshape(shape)
    ends = [NOT_STARTED if point is None else point.message for point in points]
    variables["message"] = axes, np.reshape(ends, shape)
    variables["point"] = axes, names
    of_surface, places, about = surface_variables(surface)
    attributes = _attributes(scene, surface) | about
    coordinates = {name: (name, at) for name, at in scene.axes.items()} | places
    if scene.motion is not None:
        over_time = ("time",)
        variables["surface_displacement"] = "time", np.asarray(scene.motion.displacement)
        variables["period"] = "velocity", np.asarray(scene.period_at(scene.velocity))
        coordinates["time"] = "time", np.arange(times) / times
    if "temperature" in axes:
        factor, attributes["master_curve"] = shift_factors(scene)
        if factor is not None:
            reduced = np.multiply.outer(factor, scene.velocity).astype(dtype)
            variables["reduced_velocity"] = ("temperature", "velocity"), reduced
    one = points[int(np.ravel_multi_index(kept, shape))]
    attributes["kept"] = " ".join(map(str, kept))
    grid, inner = (*over_time, *places), (*[scene.num_times] * len(over_time), *surface.grid.shape)
    for name in fields_of(scene):
        about = {"units": FIELDS[name].unit, "long_name": FIELDS[name].meaning}
        if name == "heights":  # the same at all times
            grid, inner = tuple(places), surface.grid.shape
        if scene.fields == "every":
            values = over_axes(name, points, *inner).reshape(*shape, *inner)
            variables[KEPT_FIELDS[name]] = (*axes, *grid), values, about
        elif scene.fields == "last" and one is not None and one.values:
            variables[KEPT_FIELDS[name]] = grid, one.values[name], about
    results = attach(xarray.Dataset(variables | of_surface, coordinates, attributes))
    results.attrs["largest_error"] = float(results["error"].max())
    results.attrs["num_solves"] = names.size
    results.attrs["num_converged"] = ends.count("")
    results.attrs["caveats"] = "\n".join(caveat.sentence for caveat in warnings_of(results))
    return results


def shift_factors(scene: Scene) -> tuple[Float[np.ndarray, " temperatures"] | None, str]:
    """Returns a_T [1] at each temperature, None unless the materials share it; and a message."""
    laws = shifts_in(scene.stack)
    logs = np.array([[law.log_factor(at) for at in scene.axes["temperature"]] for law in laws])
    if not laws or any(".shift." in path for path in scene.sweep):
        return None, "No master curve: no one law of temperature holds for the block."
    # The same law may be written about several references.
    if not np.allclose(logs - logs[:, :1], logs[0] - logs[0, 0], rtol=1e-6, atol=1e-6):
        return None, "No master curve: the block's materials have different laws of temperature."
    return np.exp(logs[0]), f"Velocities times a_T are those at {float(laws[0].reference):.2f} K."


def _attributes(scene: Scene, surface: Surface) -> dict[str, Any]:
    files = scene.inputs.values()
    digests = [f"{hashlib.sha256(read_file(path)).hexdigest()}  {path}" for path in files]
    attributes = {
        "title": scene.title,
        "scene": scene.text,
        "inputs": "\n".join(digests),
        "moduli": "\n".join(scene.notes),
        "dtype": str(surface.heights.dtype),
        "direction": scene.direction,
        "rtol": scene.rtol,
        **package_versions(),
    }
    if isinstance(scene.surface, RandomSurface):
        attributes["seed"] = scene.surface.seed
    return attributes
