"""The dataset of a scene from its solves."""

import hashlib
import json
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Float

from ..core.files import read_file
from ..core.quantities import CYCLE, FIELDS, TRANSIENT
from ..materials.shift import shifts_in
from ..sliding.case import facts_of
from ..sliding.number import numbers_in
from ..sliding.result import RESULTS, numbers_of
from ..studies.dataset import NOT_STARTED, attach, package_versions
from ..studies.store import Point, together
from ..surfaces.surface import Surface
from .results import DEPTH, FLOWS, FORMAT, KEPT_FIELDS, LEAKAGE, NO_NUMBERS, TIME, warnings_of
from .scene import Scene
from .surface_source import RandomSurface
from .theory import errors_of_bodies

if TYPE_CHECKING:
    from xarray import Dataset


def numbers_of_scene(scene: Scene, surface: Surface) -> tuple[str, ...]:
    """The numbers of a solve but those of the axes; a standard error if errors are known."""
    case = scene.case({name: at[0] for name, at in scene.axes.items()}, surface)
    known = facts_of(case) | {*scene.asked}
    # What is varied is a coordinate, and no result.
    names = [n for n in numbers_of(scene.kind, known) if n not in scene.axes]
    names += [name + end for name in scene.observe.stresses for end in ("", DEPTH)]
    return *names, *(["friction_standard_error"] if errors_of_bodies(scene) is not None else [])


def fields_of(scene: Scene) -> tuple[str, ...]:
    """The fields of a solve that may be kept: heights if each seed has its own."""
    return tuple(name for name in KEPT_FIELDS if name != "heights" or "seed" in scene.axes)


def collect(
    scene: Scene,
    surface: Surface,
    names: np.ndarray,
    points: list[Point | None],
    kept: tuple[int, ...],
) -> "Dataset":
    """Returns the results of a scene from its solves.

    **Arguments:**

    - `scene`, `surface`: what was solved.
    - `names`: of the solves in a store, over the axes.
    - `points`: the solves; None marks one that was not started.
    - `kept`: index of the solve whose fields are stored, if the scene stores those of one.
    """
    import xarray

    axes, shape, dtype = tuple(scene.axes), names.shape, surface.heights.dtype
    points = [p and (Point({}, p.message) if p.message in NO_NUMBERS else p) for p in points]

    def over_axes(name: str, *inner: int) -> np.ndarray:
        like = jax.ShapeDtypeStruct(inner, dtype)
        return together(name, like, points).reshape(*shape, *inner)

    variables: dict[str, Any] = {}
    once = scene.kind == TRANSIENT
    times = {} if scene.motion is None else {"time": scene.num_times}
    entries = numbers_in(RESULTS[scene.kind])
    for name in numbers_of_scene(scene, surface):
        over_time = name in entries and entries[name].over_time
        inner = times if over_time or (once and name.startswith(FLOWS)) else {}
        variables[name] = (*axes, *inner), over_axes(name, *inner.values())
    if scene.fluid is not None:
        for end in ("", "_error"):
            (over, along_x), (_, along_y) = (variables[name + end] for name in FLOWS)
            flow = np.stack([along_x, along_y], -1)
            leakage = np.asarray(scene.fluid.leakage(flow, surface.grid))
            variables |= {name + end: (over, leakage[..., i]) for i, name in enumerate(LEAKAGE)}
    ends = [NOT_STARTED if point is None else point.message for point in points]
    variables["message"] = axes, np.reshape(ends, shape)
    variables["point"] = axes, names
    of_surface, places, about_surface = surface_variables(surface)
    attributes = _attributes(scene, surface) | about_surface
    coordinates = {name: (name, at) for name, at in scene.axes.items()} | places
    if scene.temperature is not None and "temperature" not in axes:
        coordinates["temperature"] = (), np.asarray(scene.temperature, float)
    if scene.motion is not None:
        variables["surface_displacement"] = "time", np.asarray(scene.motion.displacement)
    if scene.kind == CYCLE:
        variables["period"] = "velocity", np.asarray(scene.period_at(scene.velocity))
        coordinates["time"] = "time", np.arange(scene.num_times) / scene.num_times
    if once:
        assert scene.motion is not None
        at = np.asarray(scene.motion.times)
        coordinates["time"] = "time", at, TIME
        kept_at = at[np.array(scene.kept_steps)]
        coordinates["field_time"] = "field_time", kept_at, TIME
        times = {"field_time": len(kept_at)}
    if "temperature" in axes:
        factor, attributes["master_curve"] = shift_factors(scene)
        if factor is not None:
            reduced = np.multiply.outer(factor, scene.velocity).astype(dtype)
            variables["reduced_velocity"] = ("temperature", "velocity"), reduced
    attributes["kept"] = " ".join(map(str, kept))
    one = points[int(np.ravel_multi_index(kept, shape))]
    for name in fields_of(scene) if scene.fields != "none" else ():
        about = {"units": FIELDS[name].unit, "long_name": FIELDS[name].meaning}
        inner = dict(zip(places, surface.grid.shape, strict=True))
        inner = inner if name == "heights" else times | inner  # heights are the same at all times
        if scene.fields == "every":
            values = over_axes(name, *inner.values())
            variables[KEPT_FIELDS[name]] = (*axes, *inner), values, about
        elif one is not None and one.values:
            variables[KEPT_FIELDS[name]] = tuple(inner), one.values[name], about
    results = attach(xarray.Dataset(variables | of_surface, coordinates, attributes))
    results.attrs["largest_error"] = float(results["error"].max())
    results.attrs["num_solves"] = names.size
    results.attrs["num_converged"] = ends.count("")
    results.attrs["warnings"] = "\n".join(warning.sentence for warning in warnings_of(results))
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
    # So that another file of the same name is noticed later.
    digests = [f"{hashlib.sha256(read_file(path)).hexdigest()}  {path}" for path in files]
    attributes = {
        "title": scene.title,
        "format": FORMAT,
        "scene": scene.text,
        "inputs": "\n".join(digests),
        "moduli": "\n".join(scene.notes),
        "assumed": "\n".join(scene.assumed),
        "dtype": str(surface.heights.dtype),
        "rtol": scene.rtol,
        **package_versions(),
    }
    if "direction" not in scene.axes:
        attributes["direction"] = scene.direction
    if isinstance(scene.surface, RandomSurface):
        attributes["seed"] = scene.surface.seed
    return attributes


def surface_variables(surface: Surface) -> tuple[dict, dict, dict]:
    """Returns variables, coordinates and attributes of a dataset that hold a surface."""
    heights, size = np.asarray(surface.heights), np.asarray(surface.grid.size)
    axes = ("x", "y")[: heights.ndim]
    places = {
        axis: (axis, np.arange(points) * (length / points), {"period": length})
        for axis, points, length in zip(axes, heights.shape, size, strict=True)
    }
    variables = {"heights": (axes, heights)}
    if surface.measured is not None:
        variables["measured"] = (axes, np.asarray(surface.measured))
    attributes = {
        "surface_history": "\n".join(surface.history),
        "surface_steps": json.dumps(surface.steps),
        "surface_assumed": "\n".join(surface.assumed),
        "surface_periodic": int(surface.periodic),
    }
    return variables, places, attributes
