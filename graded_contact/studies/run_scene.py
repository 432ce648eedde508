"""Scenes: a `slide` at every combination of the varied quantities."""

import dataclasses
import hashlib
import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..core.memory import DERIVATIVE, check_memory, num_numbers, sliding_memory
from ..core.quantities import FIELDS, OBSERVABLES
from ..files.dataset import NOT_STARTED, attach, package_versions
from ..files.parameter_covariance import moved
from ..files.results import KEPT_FIELDS, surface_variables, warnings_of
from ..files.scene import Scene
from ..files.schema import within
from ..files.surface_source import RandomSurface
from ..friction.sliding import slide
from ..response.stack import Stack
from ..rheology.shift import shifts_in
from ..roughness.surface import Surface
from .program import trace
from .scene_theory import check_frequencies_of, errors_of_stack, velocity_vector
from .store import Point, Store, fingerprint
from .sweep import Workers, solve_points

if TYPE_CHECKING:
    from xarray import Dataset

# Numbers of every solve; the others follow from a law of temperature or errors of a material.
SOLVED = tuple(
    name for name in OBSERVABLES if name not in ("reduced_velocity", "friction_standard_error")
)


def build_surface(scene: Scene) -> Surface:
    """Returns the surface of a scene, of its first seed, drawn or read from its file."""
    check_scene(scene)
    return scene.surface.build()


def scene_memory(scene: Scene, shape: tuple[int, ...]) -> float:
    """Returns the bytes that a scene takes with a surface of this shape, in double precision."""
    kept = {"every": scene.num_solves, "last": 1, "none": 0}[scene.fields]
    numbers, oblique = num_numbers(scene.stack), scene.direction != 0
    # The surface, what is kept, and a derivative.
    num_fields = 1 + len(_fields_of(scene)) * kept + (DERIVATIVE if scene.errors else 0)
    fields = num_fields * math.prod(shape) * 8
    return fields + sliding_memory(shape, 8, numbers, oblique, scene.solver.history_length)


def check_scene(scene: Scene) -> None:
    """Raises `ValueError` if a scene with a random surface needs more memory than there is."""
    if isinstance(scene.surface, RandomSurface):
        with within("[grid]"):
            needed = partial(scene_memory, scene)
            check_memory("shape", scene.surface.grid.shape, needed, "this scene")


def check_run(scene: Scene, surface: Surface) -> None:
    """Raises `ValueError` for what `run_scene` refuses before its first solve."""
    check_frequencies_of(scene, surface)
    trace(_solver(scene, surface), {name: at[0] for name, at in _columns(scene).items()})


def run_scene(
    scene: Scene,
    *,
    surface: Surface | None = None,
    kept: tuple[int, ...] | None = None,
    store: Store | None = None,
    workers: Workers = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> "Dataset":
    """Returns friction, contact area and more at every combination of the varied quantities.

    A solve that does not converge is stored with its message. A solve that fails (a kernel that
    cannot be evaluated) is stored with its reason. The run continues in both cases. An interrupted
    run (Ctrl-C) returns all finished solves, with NaN and "not started" for the rest. No solve
    starts from another one: a start from the neighbouring velocity saves 2 to 12 % of the FFT pairs
    (measured with 13 and 41 velocities over four decades), costs a second compilation, and each
    result would depend on the one before.

    **Arguments:**

    - `scene`: the scene.
    - `surface`: the surface, if built before; that of the first seed, where there are several.
    - `kept`: index along the axes of the solve whose fields are kept, if the scene keeps one; by
      default the last.
    - `store`: stores each solve on disk as it ends; a solve in the store is not computed again.
    - `workers`, `client`, `progress`: as in `sweep`.

    **Returns:** an `xarray.Dataset` over the axes of the scene, as far as it has them: the paths of
    [sweep], `temperature` [K], `seed`, and always `pressure` [Pa] and `velocity` [m/s]. Variables
    are the numbers of `Sliding` (`friction`, `contact_area`, ...), `message`, `point`,
    `reduced_velocity` a_T v [m/s] if the block has one law of temperature, and
    `friction_standard_error` if errors of a material are known; the `heights` of the surface, and
    the fields of solves that the scene keeps. Attributes hold the scene, the seed, the versions and
    the caveats.

    **Raises:** `ValueError` for velocities that a table of moduli does not cover; `MemoryError`;
    `OSError` if the store cannot be written; `TimeoutError` as `sweep`; `KeyboardInterrupt` if
    nothing had finished.
    """
    surface = build_surface(scene) if surface is None else surface
    check_frequencies_of(scene, surface)
    names = point_names(scene, surface)
    indices = list(np.ndindex(names.shape))
    kept = indices[-1] if kept is None else kept
    chosen = {"every": indices, "last": [kept], "none": []}[scene.fields]
    numbers = _numbers_of(scene)
    points = solve_points(
        _solver(scene, surface),
        _columns(scene),
        names.ravel().tolist(),
        store=store,
        workers=workers,
        client=client,
        keep=[(*numbers, *_fields_of(scene)) if i in chosen else numbers for i in indices],
        progress=progress,
    )
    if not any(points):
        raise KeyboardInterrupt  # there is nothing to keep
    return _collect(scene, surface, names, points, kept)


def point_names(scene: Scene, surface: Surface) -> np.ndarray:
    """Returns a name for each solve of a scene by all that decides its numbers, for a store.

    Scenes that vary the same numbers have the names of their common solves in common. The shape is
    that of the results.
    """
    versions = {key: package_versions()[key] for key in ("version_graded_contact", "version_jax")}
    rough: Any = (surface.heights, surface.measured)
    if "seed" in scene.axes and isinstance(scene.surface, RandomSurface):
        rough = scene.surface._replace(seed=0, seeds=None)
    common = fingerprint(
        versions, scene.stack, None if "temperature" in scene.axes else scene.temperature,
        rough, surface.grid, scene.direction, scene.solver, scene.tolerance, scene.graded_solver,
        errors_of_stack(scene),
    )  # fmt: skip
    columns = _columns(scene)
    names = [
        fingerprint(common, dict(zip(columns, numbers, strict=True)))
        for numbers in zip(*columns.values(), strict=True)
    ]
    return np.reshape(names, [len(at) for at in scene.axes.values()])


def _columns(scene: Scene) -> dict[str, np.ndarray]:
    """The numbers of each solve, by the names of the axes."""
    grid = np.meshgrid(*scene.axes.values(), indexing="ij")
    return {name: at.ravel() for name, at in zip(scene.axes, grid, strict=True)}


def _numbers_of(scene: Scene) -> tuple[str, ...]:
    """The numbers of a solve: a standard error if errors of a material are known."""
    known = errors_of_stack(scene) is not None
    return (*SOLVED, "friction_standard_error") if known else SOLVED


def _fields_of(scene: Scene) -> tuple[str, ...]:
    """The fields of a solve that is kept: heights if each seed has its own."""
    return tuple(name for name in KEPT_FIELDS if name != "heights" or "seed" in scene.axes)


def _solver(scene: Scene, surface: Surface) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """What gives the numbers and fields of one solve, from its numbers on the axes."""
    fields = _fields_of(scene) if scene.fields != "none" else ()
    errors = errors_of_stack(scene)

    def solved(point: dict[str, Any], stack: Stack) -> dict[str, Any]:
        rough = surface
        if "seed" in point and isinstance(scene.surface, RandomSurface):
            rough = scene.surface.drawn(point["seed"])
        sliding = slide(
            dataclasses.replace(scene, stack=stack).block(point),
            rough,
            pressure=point["pressure"],
            velocity=velocity_vector(point["velocity"], scene.direction),
            solver=scene.solver,
            **scene.tolerance,
            graded_solver=scene.graded_solver,
            throw=False,
        )
        heights = {"heights": rough.heights} if "heights" in fields else {}
        names = (*SOLVED, *fields, "result")
        return heights | {n: getattr(sliding, n) for n in names if n != "heights"}

    if errors is None:
        return lambda point: solved(point, scene.stack)

    def with_error(point: dict[str, Any]) -> dict[str, Any]:
        def friction(steps):
            found = solved(point, moved(scene.stack, errors, steps))
            return found["friction"], found

        none = jnp.zeros(len(errors.directions), surface.heights.dtype)
        slopes, found = jax.grad(friction, has_aux=True)(none)
        return {**found, "friction_standard_error": jnp.linalg.norm(slopes)}

    return with_error


def _collect(
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

    variables: dict[str, Any] = {
        name: (axes, over_axes(name, points).reshape(shape)) for name in _numbers_of(scene)
    }
    ends = [NOT_STARTED if point is None else point.message for point in points]
    variables["message"] = axes, np.reshape(ends, shape)
    variables["point"] = axes, names
    of_surface, places, about = surface_variables(surface)
    attributes = _attributes(scene, surface) | about
    coordinates = {name: (name, at) for name, at in scene.axes.items()} | places
    if "temperature" in axes:
        factor, attributes["master_curve"] = shift_factors(scene)
        if factor is not None:
            reduced = np.multiply.outer(factor, scene.velocity).astype(dtype)
            variables["reduced_velocity"] = ("temperature", "velocity"), reduced
    one = points[int(np.ravel_multi_index(kept, shape))]
    attributes["kept"] = " ".join(map(str, kept))
    grid, inner = tuple(places), surface.grid.shape
    for name in _fields_of(scene):
        about = {"units": FIELDS[name].unit, "long_name": FIELDS[name].meaning}
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
    digests = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path}" for path in scene.inputs]
    attributes = {
        "title": scene.title,
        "scene": scene.text,
        "inputs": "\n".join(digests),
        "moduli": "\n".join(scene.notes),
        "dtype": str(surface.heights.dtype),
        "direction": scene.direction,
        **scene.tolerance,
        **package_versions(),
    }
    if isinstance(scene.surface, RandomSurface):
        attributes["seed"] = scene.surface.seed
    return attributes
