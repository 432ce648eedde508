"""A scene that is ready to run: its surface is read or drawn, and all is checked and traced, once.

    read_scene  ──>  plan  ──>  Plan.run  ──>  results

A solve in a store has the name of the program that JAX traced, and of its numbers on the axes. All
that decides its numbers is in the program; a title is not.
"""

import dataclasses
import os
from collections.abc import Callable, Iterable
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from ..core.checks import within
from ..core.memory import (
    CYCLE,
    CYCLE_COUNTERFACE,
    DERIVATIVE,
    SLIDING,
    available_memory,
    check_memory,
    in_gigabytes,
    memory_of,
)
from ..core.quantities import TRANSIENT
from ..fields.frequency import velocity_along
from ..sliding.bodies import TwoBodies
from ..sliding.case import FLOW
from ..sliding.interior.stress import STRESSES
from ..sliding.number import numbers_in
from ..sliding.result import RESULTS
from ..sliding.slide import slide_case
from ..sliding.solve.steady import check_approach
from ..sliding.solve.transient import solve_transient
from ..sliding.transient.errors import steps_with_errors
from ..sliding.transient.pose import fields_of_transient
from ..studies.interruption import ctrl_c_later
from ..studies.old_sweep import Workers, columns_of, solve_points
from ..studies.parameter_covariance import with_standard_error
from ..studies.program import Program, trace
from ..studies.store import Store, open_store
from ..surfaces.surface import Surface
from .collect import collect, fields_of, numbers_of_scene
from .results import DEPTH, FLOWS, KEPT_FIELDS
from .scene import Scene
from .scene_checks import refuse_liquids
from .scene_doubts import doubts_of
from .surface_source import RandomSurface, SurfaceFile
from .theory import errors_of_bodies

if TYPE_CHECKING:
    from xarray import Dataset


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """A scene that is ready to run; `print` shows what it takes, and what makes it doubtful.

    **Fields:**

    - `scene`: what to compute.
    - `surface`: of the scene, or of its first seed.
    - `program`: what JAX traced of one solve; it solves all.
    """

    scene: Scene
    surface: Surface
    program: Program

    @cached_property
    def points(self) -> np.ndarray:
        """The names of the solves in a store, over the axes of the scene."""
        names = self.program.names_of(columns_of(self.scene.axes))
        return np.reshape(names, [len(at) for at in self.scene.axes.values()])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes every number doubtful before it is solved: of the surface, and assumed."""
        own = self.scene.block_surface
        of_block = () if own is None else own.build().warnings
        return *self.surface.warnings, *of_block, *self.scene.assumed

    def __str__(self) -> str:
        fields, solves = fields_in_memory(self.scene), str(self.points.size)
        if self.scene.kind == TRANSIENT:
            solves += f", each of {self.scene.num_times} steps"
        return cost_text(self.surface.grid.shape, fields, solves, self.warnings)

    def run(
        self, *, kept: tuple[int, ...] | None = None,
        store: str | os.PathLike | Store | None = None, workers: Workers = None,
        client: Any = None, progress: Callable[[int, int], None] | None = None,
    ) -> "Dataset":  # fmt: skip
        """Returns friction, contact area and more at every combination of the varied quantities.

        A solve that does not converge is stored with its message. A solve that fails (a kernel that
        cannot be evaluated) is stored with its reason. The run continues in both cases. An
        interrupted run (Ctrl-C) returns all finished solves, with NaN and "not started" for the
        rest. No solve starts from another one: a start from the neighbouring velocity saves 2 to
        12 % of the FFT pairs (measured with 13 and 41 velocities over four decades), costs a second
        compilation, and each result would depend on the one before.

        **Arguments:**

        - `kept`: index along the axes of the solve whose fields are stored, if the scene stores
          one; by default the last.
        - `store`: stores each solve on disk as it ends; a solve in the store is not computed again.
        - `workers`, `client`, `progress`: as in `sweep`. Of what happens once `progress` counts
          steps, with those of the errors; an interrupted run goes on at the step that it reached.

        **Returns:** an `xarray.Dataset` over the axes of the scene: paths of [sweep], `temperature`
        [K] and `seed` if the scene has them, and always `pressure` [Pa] (or `approach` [m]) and
        `velocity` [m/s]. Variables are the numbers of `Sliding` (`friction`, `contact_area`, ...),
        `message`, `point`, `reduced_velocity` a_T v [m/s] if the block has one law of temperature,
        and `friction_standard_error` if errors of a material are known; the `heights` of the
        surface, and the fields of solves that the scene stores. Attributes contain the scene, the
        seed, the versions and the warnings. With [heating] there is the `surface_rise` [K] of the
        contact. On a window there are the `rim_load`, and the `approach` [m] or, at a given
        approach, the `mean_pressure` [Pa], with their errors.

        With [motion] the variables are the numbers of `CyclicSliding`: those of a cycle over these
        axes (`mean_friction`, `peak_friction`, `work`, ...), `friction`, areas, `load` and
        `mean_gap` also over `time` (over the period, from 0), `surface_displacement` [m] over
        `time`, and the `period` [s] over `velocity`, which is the highest speed. Friction is that
        along `direction`. With `once = true` the numbers of `TransientSliding` are over `time` [s],
        the ends of the steps, and fields over `field_time` [s]; a flow is NaN at other times.

        **Raises:** `MemoryError`; `OSError` if the store cannot be written; `TimeoutError` as
        `sweep`; `KeyboardInterrupt` if nothing had finished.
        """
        scene, surface, names = self.scene, self.surface, self.points
        indices = list(np.ndindex(names.shape))
        kept = indices[-1] if kept is None else kept
        chosen = {"every": indices, "last": [kept], "none": []}[scene.fields]
        numbers = numbers_of_scene(scene, surface)
        with open_store(store) as opened:
            points = solve_points(
                self.program, columns_of(scene.axes), names.ravel().tolist(), store=opened,
                keep=[(*numbers, *fields_of(scene)) if i in chosen else numbers for i in indices],
                workers=workers, client=client, progress=progress,
            )  # fmt: skip
        if not any(points):
            raise KeyboardInterrupt  # there is nothing to keep
        return collect(scene, surface, names, points, kept)


def plan(scene: Scene, *, surface: Surface | None = None) -> Plan:
    """Returns a scene that is ready to run. It refuses all that a run would; no contact is solved.

    **Arguments:**

    - `scene`: what to compute.
    - `surface`: of the scene, if it was read or drawn before.

    **Returns:** the plan; `plan(scene).run()` gives the results.

    **Raises:** `ValueError` for what no solve of the scene can have, such as velocities that a
    table of moduli does not cover, a liquid under waves at rest, or more memory than is free.
    """
    with ctrl_c_later() as later:
        surface = build_surface(scene) if surface is None else surface
        # In two dimensions waves across the velocity are at rest, and need a modulus there.
        at_rest = surface.grid.ndim == 2 or scene.motion is not None or not np.all(scene.velocity)
        if at_rest and scene.kind != TRANSIENT:  # for a while a liquid may rest under a load
            refuse_liquids(scene)
        if isinstance(scene.surface, SurfaceFile):
            told = (*scene.assumed, *doubts_of(scene, surface.grid))
            scene = dataclasses.replace(scene, assumed=told)
        if scene.fluid is not None and surface.grid.ndim == 1:
            raise ValueError(
                "[fluid] needs a surface in two dimensions: no fluid passes a profile."
            )
        if scene.approach is not None:
            with within("[load]"):
                check_approach(scene.approach, surface, scene.contact_law)
        later.check()
        # Only names and dtypes of the first point matter: one program solves all points.
        first = {name: column[0] for name, column in columns_of(scene.axes).items()}
        # With errors of materials a solve has a derivative, and is one program.
        by_steps = scene.kind == TRANSIENT and not scene.errors
        steps = steps_with_errors(scene.num_times) if by_steps else 0
        program = trace(_solver(scene, surface), first, steps)
        later.check()
    return Plan(scene, surface, program)


def build_surface(scene: Scene) -> Surface:
    """Returns the surface of a scene, of its first seed, drawn or read from its file.

    **Raises:** `ValueError` if the scene needs more memory than there is.
    """
    if isinstance(scene.surface, SurfaceFile):
        surface = scene.surface.build()
        with within("[surface]"):
            check_memory("shape", "this scene", fields_in_memory(scene), surface.grid.shape)
        return surface
    with within("[grid]"):  # before it is drawn
        check_memory("shape", "this scene", fields_in_memory(scene), scene.surface.grid.shape)
    return scene.surface.build()


def fields_in_memory(scene: Scene) -> float:
    """Returns how many fields of the size of its surface a scene takes."""
    kept = {"every": scene.num_solves, "last": 1, "none": 0}[scene.fields]
    # The surface, what is kept, and a derivative.
    if scene.motion is not None and scene.kind == TRANSIENT:
        own = fields_of_transient(scene.counterface, scene.shear, scene.motion.displacement)
        return 1 + len(KEPT_FIELDS) * len(scene.kept_steps) * (2 + kept) + own
    fields = 1 + len(fields_of(scene)) * kept + (DERIVATIVE if scene.errors else 0)
    if scene.motion is None:
        return fields + SLIDING
    return scene.num_times * (
        fields + CYCLE + (0 if scene.counterface is None else CYCLE_COUNTERFACE)
    )


def cost_text(
    shape: tuple[int, ...], fields: float, num_solves: int | str, warnings: Iterable[str]
) -> str:
    """Returns grid, memory of so many fields, number of contacts, and warnings as text."""
    memory, free = memory_of(fields, shape) if fields else 0.0, available_memory()
    beside = "" if free is None else f", {in_gigabytes(free)} are free"
    rows = {
        "grid": f"{' x '.join(map(str, shape))} points",
        "memory": f"about {in_gigabytes(memory)}{beside}",
        "contact solves": num_solves,
    }
    lines = [f"{name:22} {text}" for name, text in rows.items()]
    return "\n".join([*lines, *(f"Warning: {sentence}" for sentence in warnings)])


def _solver(scene: Scene, surface: Surface) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """What gives the numbers and fields of one solve, from its numbers on the axes."""
    fields, errors = fields_of(scene), errors_of_bodies(scene)
    names = [n for n in numbers_of_scene(scene, surface) if n in numbers_in(RESULTS[scene.kind])]

    def solved(point: dict[str, Any], bodies: TwoBodies) -> dict[str, Any]:
        rough = surface
        # A seed is drawn inside the program: JAX traces its number.
        if "seed" in point and isinstance(scene.surface, RandomSurface):
            rough = scene.surface.drawn(point["seed"])
        case = dataclasses.replace(scene, **bodies._asdict()).case(point, rough)
        if scene.kind == TRANSIENT:
            contact = solve_transient(case, scene.numerics, scene.kept_steps)
        else:
            contact = slide_case(case, scene.numerics)
        found = dict(zip(names, contact.compute(*names), strict=True))
        stack = case.stack if contact.heated is None else contact.heated.stack
        for name in scene.observe.stresses:
            stress, depth = STRESSES[name](contact, stack, scene.observe.stress_depths)
            found |= {name: stress, name + DEPTH: depth}
        if scene.motion is not None:  # along the direction of the motion
            direction = point.get("direction", scene.direction)
            along = jnp.atleast_1d(velocity_along(1.0, direction))
            for name, number in found.items():
                if number.ndim == 2:
                    found[name] = number @ (jnp.abs(along) if name.endswith("_error") else along)
        if scene.kind == TRANSIENT and FLOW in scene.asked:  # of the times with a gap
            unknown = jnp.full(scene.num_times, jnp.nan, rough.heights.dtype)
            for name in (n for n in names if n.startswith(FLOWS)):
                found[name] = unknown.at[np.array(scene.kept_steps)].set(found[name])
        found |= {name: getattr(contact.contact, name) for name in fields if name != "heights"}
        found |= {"heights": rough.heights} if "heights" in fields else {}
        return found | {"result": contact.result}

    main = "friction" if scene.motion is None else "mean_friction"
    bodies = TwoBodies(scene.stack, scene.counterface)
    return lambda point: with_standard_error(partial(solved, point), bodies, errors, main)
