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

from ..core.memory import (
    DERIVATIVE,
    check_memory,
    cycle_memory,
    num_numbers,
    sliding_memory,
)
from ..core.quantities import FIELDS, OBSERVABLES
from ..files.dataset import NOT_STARTED, attach, package_versions
from ..files.parameter_covariance import moved
from ..files.results import KEPT_FIELDS, OVER_TIME, surface_variables, warnings_of
from ..files.scene import Scene
from ..files.schema import within
from ..files.surface_source import RandomSurface, SurfaceFile
from ..friction.cycle import slide_cycle
from ..friction.sliding import check_approach, slide
from ..response.stack import Stack
from ..response.window import has_ground
from ..rheology.shift import shifts_in
from ..roughness.surface import Surface
from .program import trace
from .scene_theory import check_frequencies_of, errors_of_stack, velocity_vector
from .store import Point, Store, fingerprint
from .sweep import Workers, solve_points

if TYPE_CHECKING:
    from xarray import Dataset

# Numbers of every solve; the others follow from a law of temperature, errors of a material, heating
# or a window.
SOLVED = tuple(
    name for name in OBSERVABLES if name not in ("reduced_velocity", "friction_standard_error")
)
# Numbers of every cycle.
CYCLIC = (
    "mean_friction", "mean_friction_error", "peak_friction", "peak_friction_error", "work",
    "load_work", "dissipated_power", "phase", "slope_in_contact", "energy_imbalance",
    "load_mismatch", "largest_step", "unresolved_motion", "extrapolated_friction", "error",
    "num_fft_pairs",
)  # fmt: skip


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
    fields = num_fields * math.prod(shape) * 8 * scene.num_times
    if scene.motion is not None:
        return fields + cycle_memory((scene.num_times, *shape), 8, scene.solver.history_length)
    return fields + sliding_memory(shape, 8, numbers, oblique, scene.solver.history_length)


def check_scene(scene: Scene) -> None:
    """Raises `ValueError` if a scene with a [grid] needs more memory than there is."""
    if not isinstance(scene.surface, SurfaceFile):
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
    [sweep], `temperature` [K], `seed`, and always `pressure` [Pa] (or `approach` [m]) and
    `velocity` [m/s]. Variables
    are the numbers of `Sliding` (`friction`, `contact_area`, ...), `message`, `point`,
    `reduced_velocity` a_T v [m/s] if the block has one law of temperature, and
    `friction_standard_error` if errors of a material are known; the `heights` of the surface, and
    the fields of solves that the scene keeps. Attributes hold the scene, the seed, the versions and
    the caveats. With [heating] there is the `surface_rise` [K] of the contact, on a window the
    `rim_load` and the `approach` [m], or the `mean_pressure` [Pa] at a given one.

    With [motion] the variables are the numbers of `CyclicSliding`: those of a cycle over these axes
    (`mean_friction`, `peak_friction`, `work`, ...), `friction`, areas, `load` and `mean_gap` also
    over `time` (over the period, from 0), `surface_displacement` [m] over `time`, and the `period`
    [s] over `velocity`, which is the highest speed. Friction is that along `direction`.

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
    numbers = _numbers_of(scene, surface)
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
        rough, surface.grid, surface.periodic, scene.direction, scene.solver, scene.tolerance,
        scene.graded_solver, scene.motion, scene.pressure_ratio, scene.shear, scene.heating,
        scene.strain_per_slope, errors_of_stack(scene),
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


def _numbers_of(scene: Scene, surface: Surface) -> tuple[str, ...]:
    """The numbers of a solve: a standard error if errors of a material are known."""
    names = SOLVED if scene.motion is None else (*CYCLIC, *OVER_TIME)
    if errors_of_stack(scene) is not None:
        names += ("friction_standard_error",)
    if scene.heating is not None:
        names += ("surface_rise",)
    if not surface.periodic:
        names += ("rim_load",)
        if scene.approach is not None:
            names += ("mean_pressure",)
        elif has_ground(scene.stack, surface.grid):
            names += ("approach", "approach_error")
    return names


def _fields_of(scene: Scene) -> tuple[str, ...]:
    """The fields of a solve that is kept: heights if each seed has its own."""
    return tuple(name for name in KEPT_FIELDS if name != "heights" or "seed" in scene.axes)


def _solver(scene: Scene, surface: Surface) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """What gives the numbers and fields of one solve, from its numbers on the axes."""
    if scene.approach is not None:
        with within("[load]"):
            check_approach(scene.approach, surface.grid)
    fields = _fields_of(scene) if scene.fields != "none" else ()
    errors = errors_of_stack(scene)
    names = [n for n in _numbers_of(scene, surface) if n != "friction_standard_error"]
    job = _slid if scene.motion is None else _cycled

    def solved(point: dict[str, Any], stack: Stack) -> dict[str, Any]:
        rough = surface
        if "seed" in point and isinstance(scene.surface, RandomSurface):
            rough = scene.surface.drawn(point["seed"])
        block = dataclasses.replace(scene, stack=stack).block(point)
        how: dict[str, Any] = dict(
            solver=scene.solver, graded_solver=scene.graded_solver, throw=False, **scene.tolerance
        )
        found, contact = job(scene, block, rough, point, how)
        found |= {name: getattr(contact, name) for name in fields if name != "heights"}
        found |= {"heights": rough.heights} if "heights" in fields else {}
        return {name: found[name] for name in (*names, *fields)} | {"result": contact.result}

    if errors is None:
        return lambda point: solved(point, scene.stack)

    def with_error(point: dict[str, Any]) -> dict[str, Any]:
        def friction(steps):
            found = solved(point, moved(scene.stack, errors, steps))
            return found["friction" if scene.motion is None else "mean_friction"], found

        none = jnp.zeros(len(errors.directions), surface.heights.dtype)
        slopes, found = jax.grad(friction, has_aux=True)(none)
        return {**found, "friction_standard_error": jnp.linalg.norm(slopes)}

    return with_error


def _slid(scene: Scene, block: Stack, surface: Surface, point: dict[str, Any], how: dict):
    """The numbers of steady sliding by name, and the contact."""
    sliding = slide(
        block,
        surface,
        pressure=point.get("pressure"),
        approach=point.get("approach"),
        velocity=velocity_vector(point["velocity"], scene.direction),
        shear=scene.shear,
        heating=scene.heating,
        temperature=point.get("temperature", scene.temperature),
        strain_per_slope=scene.strain_per_slope,
        **how,
    )
    found = {name: getattr(sliding, name) for name in SOLVED}
    if sliding.heated is not None:
        found["surface_rise"] = sliding.heated.surface_rise
    if not surface.periodic:
        found |= {"rim_load": sliding.rim_load, "mean_pressure": sliding.contact.mean_pressure}
        found |= {"approach": sliding.approach, "approach_error": sliding.approach_error}
    return found, sliding


def _cycled(scene: Scene, block: Stack, surface: Surface, point: dict[str, Any], how: dict):
    """The numbers of a cycle by name, and the contact."""
    motion, along = scene.motion, np.ravel(velocity_vector(1.0, scene.direction))
    assert motion is not None
    moved, times = motion.displacement, np.arange(scene.num_times) / scene.num_times
    pressure = point["pressure"]
    if scene.pressure_ratio is not None:
        known = np.arange(len(scene.pressure_ratio)) / len(scene.pressure_ratio)
        pressure = pressure * np.interp(times, known, scene.pressure_ratio, period=1.0)
    cycle = slide_cycle(
        block,
        surface,
        displacement=moved if len(along) == 1 else moved[:, None] * along,
        period=scene.period_at(point["velocity"]),
        pressure=pressure,
        **how,
    )
    found = {name: getattr(cycle, name) for name in (*CYCLIC, *OVER_TIME) if hasattr(cycle, name)}
    for name in ("friction", "geometric_friction", "traction"):
        found[name] = found[name].reshape(scene.num_times, -1) @ along
    contact = cycle.contact
    return found | {"error": contact.error, "num_fft_pairs": contact.num_fft_pairs}, contact


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
        name: (axes, over_axes(name, points).reshape(shape))
        for name in _numbers_of(scene, surface)
        if name not in OVER_TIME or scene.motion is None
    }
    ends = [NOT_STARTED if point is None else point.message for point in points]
    variables["message"] = axes, np.reshape(ends, shape)
    variables["point"] = axes, names
    of_surface, places, about = surface_variables(surface)
    attributes = _attributes(scene, surface) | about
    coordinates = {name: (name, at) for name, at in scene.axes.items()} | places
    over_time = ()
    if scene.motion is not None:
        times, over_time = scene.num_times, ("time",)
        for name in OVER_TIME:
            values = over_axes(name, points, times).reshape(*shape, times)
            variables[name] = (*axes, "time"), values
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
    for name in _fields_of(scene):
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
