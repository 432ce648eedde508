"""Scenes: a `slide` at every combination of the varied quantities."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from ..blocks.stack import Stack
from ..core.checks import within
from ..core.memory import CYCLE, DERIVATIVE, SLIDING, check_memory
from ..fields.frequency import velocity_along
from ..sliding.slide import solve
from ..sliding.steady import check_approach
from ..studies.dataset import package_versions
from ..studies.parameter_covariance import with_standard_error
from ..studies.program import trace
from ..studies.store import Store, fingerprint
from ..studies.sweep import Workers, columns_of, solve_points
from ..surfaces.surface import Surface
from .results import collect, fields_of, numbers_of_scene
from .scene import Scene, refuse_liquids
from .surface_source import RandomSurface, SurfaceFile
from .theory import check_frequencies_of, errors_of_stack

if TYPE_CHECKING:
    from xarray import Dataset


def build_surface(scene: Scene) -> Surface:
    """Returns the surface of a scene, of its first seed, drawn or read from its file."""
    check_scene(scene)
    return scene.surface.build()


def scene_fields(scene: Scene) -> float:
    """Returns how many fields of the size of its surface a scene takes."""
    kept = {"every": scene.num_solves, "last": 1, "none": 0}[scene.fields]
    # The surface, what is kept, and a derivative.
    fields = 1 + len(fields_of(scene)) * kept + (DERIVATIVE if scene.errors else 0)
    return scene.num_times * (fields + (SLIDING if scene.motion is None else CYCLE))


def check_scene(scene: Scene) -> None:
    """Raises `ValueError` if a scene with a [grid] needs more memory than there is."""
    if not isinstance(scene.surface, SurfaceFile):
        with within("[grid]"):
            check_memory("shape", "this scene", scene_fields(scene), scene.surface.grid.shape)


def check_run(scene: Scene, surface: Surface) -> None:
    """Raises `ValueError` for what `run_scene` refuses before its first solve."""
    _check_blocks(scene, surface)
    # A refusal inside the program must come before the first solve: the first point is traced.
    trace(_solver(scene, surface), {name: at[0] for name, at in columns_of(scene.axes).items()})


def _check_blocks(scene: Scene, surface: Surface) -> None:
    # In two dimensions waves across the velocity are at rest, and need a modulus there.
    if surface.grid.ndim == 2 or scene.motion is not None or not np.all(scene.velocity):
        refuse_liquids(scene)
    check_frequencies_of(scene, surface)


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
    - `surface`: the surface, if built before; that of the first seed if there are several.
    - `kept`: index along the axes of the solve whose fields are stored, if the scene stores one; by
      default the last.
    - `store`: stores each solve on disk as it ends; a solve in the store is not computed again.
    - `workers`, `client`, `progress`: as in `sweep`.

    **Returns:** an `xarray.Dataset` over the axes of the scene: paths of [sweep], `temperature` [K]
    and `seed` if the scene has them, and always `pressure` [Pa] (or `approach` [m]) and `velocity`
    [m/s]. Variables are the numbers of `Sliding` (`friction`, `contact_area`, ...), `message`,
    `point`, `reduced_velocity` a_T v [m/s] if the block has one law of temperature, and
    `friction_standard_error` if errors of a material are known; the `heights` of the surface, and
    the fields of solves that the scene stores. Attributes contain the scene, the seed, the versions
    and the caveats. With [heating] there is the `surface_rise` [K] of the contact. On a window
    there are the `rim_load`, and the `approach` [m] or, at a given approach, the `mean_pressure`
    [Pa], with their errors.

    With [motion] the variables are the numbers of `CyclicSliding`: those of a cycle over these axes
    (`mean_friction`, `peak_friction`, `work`, ...), `friction`, areas, `load` and `mean_gap` also
    over `time` (over the period, from 0), `surface_displacement` [m] over `time`, and the `period`
    [s] over `velocity`, which is the highest speed. Friction is that along `direction`.

    **Raises:** `ValueError` for velocities that a table of moduli does not cover; `MemoryError`;
    `OSError` if the store cannot be written; `TimeoutError` as `sweep`; `KeyboardInterrupt` if
    nothing had finished.
    """
    surface = build_surface(scene) if surface is None else surface
    _check_blocks(scene, surface)
    names = point_names(scene, surface)
    indices = list(np.ndindex(names.shape))
    kept = indices[-1] if kept is None else kept
    chosen = {"every": indices, "last": [kept], "none": []}[scene.fields]
    numbers = numbers_of_scene(scene, surface)
    points = solve_points(
        _solver(scene, surface), columns_of(scene.axes), names.ravel().tolist(),
        keep=[(*numbers, *fields_of(scene)) if i in chosen else numbers for i in indices],
        store=store, workers=workers, client=client, progress=progress,
    )  # fmt: skip
    if not any(points):
        raise KeyboardInterrupt  # there is nothing to keep
    return collect(scene, surface, names, points, kept)


def point_names(scene: Scene, surface: Surface) -> np.ndarray:
    """Returns a name for each solve of a scene by all that decides its numbers, for a store.

    Scenes that vary the same numbers have the same names for their common solves. The shape is that
    of the results.
    """
    versions = {key: package_versions()[key] for key in ("version_graded_contact", "version_jax")}
    # Of drawn surfaces the seed, which is in the point, is the whole difference.
    rough: Any = (surface.heights, surface.measured)
    if "seed" in scene.axes and isinstance(scene.surface, RandomSurface):
        rough = scene.surface._replace(seed=0, seeds=None)
    names = ("temperature", "direction")
    fixed = [None if name in scene.axes else getattr(scene, name) for name in names]
    common = fingerprint(
        versions, scene.stack, *fixed, rough, surface.grid, surface.periodic, scene.solver,
        scene.rtol, scene.motion, scene.pressure_ratio, scene.law, scene.shear,
        scene.heating, scene.strain_per_slope, errors_of_stack(scene),
    )  # fmt: skip
    columns = columns_of(scene.axes)
    names = [
        fingerprint(common, dict(zip(columns, numbers, strict=True)))
        for numbers in zip(*columns.values(), strict=True)
    ]
    return np.reshape(names, [len(at) for at in scene.axes.values()])


def _solver(scene: Scene, surface: Surface) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """What gives the numbers and fields of one solve, from its numbers on the axes."""
    if scene.approach is not None:
        with within("[load]"):
            check_approach(scene.approach, surface, scene.contact_law)
    fields = fields_of(scene)
    errors = errors_of_stack(scene)
    names = [n for n in numbers_of_scene(scene, surface) if n != "friction_standard_error"]

    def solved(point: dict[str, Any], stack: Stack) -> dict[str, Any]:
        rough = surface
        # A seed is drawn inside the program: JAX traces its number.
        if "seed" in point and isinstance(scene.surface, RandomSurface):
            rough = scene.surface.drawn(point["seed"])
        case = dataclasses.replace(scene, stack=stack).case(point, rough)
        contact = solve(case, scene.numerics)
        found = dict(zip(names, contact.compute(*names), strict=True))
        if scene.motion is not None:  # along the direction of the motion
            for name in ("friction", "traction"):
                direction = point.get("direction", scene.direction)
                along = jnp.atleast_1d(velocity_along(1.0, direction))
                found[name] = found[name].reshape(scene.num_times, -1) @ along
        found |= {name: getattr(contact.contact, name) for name in fields if name != "heights"}
        found |= {"heights": rough.heights} if "heights" in fields else {}
        return found | {"result": contact.result}

    main = "friction" if scene.motion is None else "mean_friction"
    return lambda point: with_standard_error(partial(solved, point), scene.stack, errors, main)
