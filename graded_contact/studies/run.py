"""Scenes, run point by point."""

import hashlib
import math
from collections.abc import Callable
from functools import partial

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._memory import check_memory, num_numbers, sliding_memory
from ..contact.solution import RESULTS
from ..files.results import (
    FAILED,
    FIELDS,
    NOT_STARTED,
    OBSERVABLES,
    Fields,
    Results,
    package_versions,
)
from ..files.scene import Scene
from ..files.surfaces import RandomSurface
from ..files.toml import within
from ..sliding import slide
from ..surface import Surface
from .extrapolation import check_frequencies_of, velocity_vector
from .store import Point, Store, fingerprint, reason_of


def build_surface(scene: Scene) -> Surface:
    """Returns the surface of a scene, drawn or read from its file."""
    check_scene(scene)
    return scene.surface.build()


def scene_memory(scene: Scene, shape: tuple[int, ...]) -> float:
    """Returns the bytes that a scene takes with a surface of this shape, in double precision."""
    kept = {"every": scene.pressure.size * scene.velocity.size, "last": 1, "none": 0}[scene.keep]
    numbers, askew = num_numbers(scene.stack), scene.direction != 0
    fields = (1 + len(FIELDS) * kept) * math.prod(shape) * 8  # the surface, and what is kept
    return fields + sliding_memory(shape, 8, numbers, askew, scene.solver.memory)


def check_scene(scene: Scene) -> None:
    """Raises `ValueError` if a scene with a random surface needs more memory than there is."""
    if isinstance(scene.surface, RandomSurface):
        with within("[grid]"):
            needed = partial(scene_memory, scene)
            check_memory("shape", scene.surface.grid.shape, needed, "this scene")


def run_scene(
    scene: Scene,
    *,
    surface: Surface | None = None,
    store: Store | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Results:
    """Returns friction, contact area and more of a scene at each of its pressures and velocities.

    A solve that does not converge is kept with its message, one that fails (a kernel that cannot
    be evaluated) with its reason, and the run goes on; a run that is interrupted (Ctrl-C) returns
    what it has, with NaN and "not started" for the rest. Every solve starts afresh: a start from
    the neighbouring velocity saves 2 to 12 % of the FFT pairs (measured with 13 and 41 velocities
    over four decades), costs a second compilation, and would make each result depend on the one
    before.

    **Arguments:**

    - `scene`: what to compute.
    - `surface`: the surface, if built before.
    - `store`: keeps each solve on disk as it ends; those that it has are not computed again.
    - `progress`: called after each solve with the number of finished solves and of all solves.

    **Returns:** observables with axes (pressures, velocities), and the fields that the scene keeps.

    **Raises:** `ValueError` for velocities that a table of moduli does not cover; `MemoryError`;
    `OSError` if the store cannot be written; `KeyboardInterrupt` if nothing had finished.
    """
    surface = build_surface(scene) if surface is None else surface
    check_frequencies_of(scene, surface)
    names = point_names(scene, surface)
    indices = list(np.ndindex(names.shape))
    with_fields = {"every": indices, "last": indices[-1:], "none": []}[scene.keep]
    points: dict[tuple[int, ...], Point] = {}
    for index in indices:
        point = None if store is None else store.read(str(names[index]))
        if point is not None and _is_whole(point, index in with_fields):
            points[index] = point
    if points and progress is not None:
        progress(len(points), len(indices))
    try:
        for index in [index for index in indices if index not in points]:
            point = _solve(scene, surface, index, index in with_fields)
            if store is not None:
                store.write(str(names[index]), point)
            points[index] = point
            if progress is not None:
                progress(len(points), len(indices))
    except KeyboardInterrupt:
        if not points:
            raise  # there is nothing to keep
    return _collect(scene, surface, names, points, with_fields)


def point_names(scene: Scene, surface: Surface) -> np.ndarray:
    """Returns a name for each solve of a scene by all that decides its numbers, for a store.

    Two scenes that have solves in common have names in common. The shape is that of the results.
    """
    versions = {key: package_versions()[key] for key in ("version_graded_contact", "version_jax")}
    common = fingerprint(
        versions, scene.stack, surface.heights, surface.measured, surface.grid, scene.solver,
        scene.rtol, scene.graded,
    )  # fmt: skip
    names = [
        [fingerprint(common, *_load(scene, i, j)) for j in range(len(scene.velocity))]
        for i in range(len(scene.pressure))
    ]
    return np.array(names)


def _load(scene: Scene, i: int, j: int) -> tuple[Array, Array]:
    """Pressure and velocity of one solve, as `slide` takes them."""
    velocity = velocity_vector(scene.velocity[j], scene.direction)
    return jnp.asarray(scene.pressure[i]), jnp.asarray(velocity)


def _solve(scene: Scene, surface: Surface, index: tuple[int, ...], with_fields: bool) -> Point:
    """One solve of a scene, or why there is none."""
    pressure, velocity = _load(scene, *index)
    inputs = {
        "pressure": np.asarray(pressure),
        "velocity": np.asarray(velocity),
        "scene": scene.text,
        **package_versions(),
    }
    try:
        sliding = slide(
            scene.stack,
            surface,
            pressure=pressure,
            velocity=velocity,
            solver=scene.solver,
            rtol=scene.rtol,
            graded=scene.graded,
            throw=False,
        )
    except (ValueError, RuntimeError) as error:
        return Point(values={}, message=FAILED + reason_of(error), inputs=inputs)
    kept = (*OBSERVABLES, *FIELDS) if with_fields else OBSERVABLES
    values = {name: np.asarray(getattr(sliding, name)) for name in kept}
    return Point(values=values, message=str(RESULTS[sliding.result]), inputs=inputs)


def _is_whole(point: Point, with_fields: bool) -> bool:
    wanted = {*OBSERVABLES, *FIELDS} if with_fields else {*OBSERVABLES}
    return point.message.startswith(FAILED) or wanted <= point.values.keys()


def _collect(
    scene: Scene,
    surface: Surface,
    names: np.ndarray,
    points: dict[tuple[int, ...], Point],
    with_fields: list[tuple[int, ...]],
) -> Results:
    """The results of a scene from its solves, those that there are."""
    values = {name: np.full(names.shape, np.nan, surface.heights.dtype) for name in OBSERVABLES}
    message, fields = np.full(names.shape, NOT_STARTED, object), {}
    for index, point in points.items():
        message[index] = point.message
        if not point.values:
            continue
        for name in OBSERVABLES:
            values[name][index] = point.values[name]
        if index in with_fields:
            fields[index] = Fields(**{name: point.values[name] for name in FIELDS})
    return Results(
        pressure=scene.pressure,
        velocity=scene.velocity,
        **values,
        message=message.astype(str),
        point=names,
        surface=surface,
        fields=fields,
        attributes=_attributes(scene, surface, values["error"], message),
    )


def _attributes(scene: Scene, surface: Surface, error: np.ndarray, message: np.ndarray) -> dict:
    digests = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path}" for path in scene.inputs]
    attributes = {
        "title": scene.title,
        "scene": scene.text,
        "inputs": "\n".join(digests),
        "moduli": "\n".join(scene.notes),
        "dtype": str(surface.heights.dtype),
        "direction": scene.direction,
        "rtol": scene.rtol,
        "largest_error": float(np.fmax.reduce(error, axis=None)),
        "num_solves": message.size,
        "num_converged": int(np.sum(message == "")),
        **package_versions(),
    }
    if isinstance(scene.surface, RandomSurface):
        attributes["seed"] = scene.surface.seed
    return attributes
