"""What a scene is refused for when it is read, and what some jobs refuse of a scene."""

from collections.abc import Iterable

import numpy as np

from ..blocks.stack import LIQUID, Stack, check_at_rest, liquid_in
from ..contacts.law import check_pressure
from ..core.checks import (
    as_float,
    check_positive,
    check_tolerance,
    check_values,
    nearest,
    within,
)
from ..core.files import check_name
from ..core.memory import check_points
from ..core.parameters import paths, with_values
from ..core.quantities import CYCLE, TRANSIENT
from ..materials.softening import as_strain_per_slope
from ..sliding.bodies import OF_COUNTERFACE, BodyName, TwoBodies, in_both
from ..sliding.interior.conduction import of_parts
from ..sliding.shear import shear_stress
from .block import extremes
from .once import LIFTED
from .scene import Scene
from .surface_source import Sphere, SurfaceFile


def check_numbers(scene: Scene) -> None:
    """Raises `ValueError` for numbers that no contact, file or block can have."""
    with within("[load]"):
        if scene.approach is None:
            check_positive("pressure", scene.pressure, "[Pa]")
            highest = np.max(scene.pressure) * np.max(scene.pressure_ratio or 1.0)
            check_pressure(as_float(highest), scene.contact_law)
        else:
            check_values("approach", scene.approach, "an approach [m] must be finite")
        check_values("velocity", scene.velocity, "a velocity [m/s] must be finite")
        for value in extremes(scene.strain_per_slope):
            as_strain_per_slope(value, (scene.stack, scene.counterface))
    with within("[solver]"):
        check_tolerance("rtol", scene.rtol, as_float(1.0))  # in the dtype of the session
    if scene.name is not None:
        with within("[output]"):
            check_name(scene.name)
    with within("[sweep]"):
        bodies = TwoBodies(scene.stack, scene.counterface)
        for path, values in scene.sweep.items():
            body: BodyName = "counterface" if path.startswith(OF_COUNTERFACE) else "block"
            check_paths([path.removeprefix(OF_COUNTERFACE)], bodies[body == "counterface"], body)
            for value in (np.min(values), np.max(values)):  # what is allowed has no gaps
                with within(f'"{path}":'):
                    changed = with_values(bodies, {in_both(path): value})
                for at in extremes(scene.temperature):
                    changed.at(at)
    check_points("` x `".join(scene.axes), scene.num_solves)


def check_tables(scene: Scene) -> None:
    """Raises `ValueError` for tables and keys that do not go together, or that need another."""
    source, motion = scene.surface, scene.motion
    is_open = isinstance(source, SurfaceFile) and source.arguments.get("periodic") == "open"
    if scene.approach is not None and not (is_open or isinstance(source, Sphere)):
        raise ValueError(
            '[load] `approach` needs a surface of kind "sphere", or a file that is "open".'
        )
    window, once = is_open or isinstance(source, Sphere), scene.kind == TRANSIENT
    if {*scene.observe.asked} - ({"flow"} if once else set()) and (motion is not None or window):
        raise ValueError(
            "[observe] needs steady sliding on a periodic surface; what happens once has `flow`."
        )
    if scene.observe.stresses and scene.strain_per_slope is not None:
        raise ValueError("[observe] has no stress with `strain_per_slope` in [load].")
    if scene.observe.interface_shear and not scene.stack.layers:
        raise ValueError("[observe] `interface_shear` needs a layer.")
    if scene.fluid is not None and (window or scene.kind == CYCLE):
        raise ValueError(
            "[fluid] needs a periodic surface, under steady sliding or a [motion] with "
            "`once = true`."
        )
    for key, place in (("ratio_times", "load"), ("frames", "output")):
        default = Scene.__dataclass_fields__[key].default
        if getattr(scene, key) != default and not once:
            raise ValueError(f"[{place}] `{key}` needs [motion] with `once = true`.")
    if scene.heating is not None and scene.temperature is None:
        raise ValueError("[heating] needs the bulk `temperature` [K] in [load].")
    if scene.heating is not None:
        with within("[heating]"):
            of_parts(scene.heating, scene.stack, scene.counterface)
    with within("[shear]"):
        # A law with a shift refuses a scene without a temperature.
        for at in extremes(scene.temperature) or [None]:
            shear_stress(scene.shear, as_float(1.0, "velocity"), at)
    with within("[counterface]"):  # its waves rest under the surface
        for _, (_, counterface) in scene.all_bodies():
            if counterface is not None:
                check_at_rest(counterface)
    if scene.block_surface is not None:
        if motion is None:
            raise ValueError("[block_surface] needs a table [motion]: see `slide`.")
        refuse_tables(scene, "[block_surface]", "heating")
    if motion is None:
        if scene.pressure_ratio is not None:
            raise ValueError("[load] `pressure_ratio` needs a table [motion].")
        return
    refuse_tables(scene, "[motion]")
    if once:
        refuse_tables(scene, "[motion] `once = true`", "heating")
    with within("[output]"):
        check_values("frames", scene.frames, "at least one time is needed", at_least=1)
    if scene.strain_per_slope is not None:
        raise ValueError("[motion] does not take the key `strain_per_slope` of [load].")
    with within("[load]"):
        if scene.pressure_ratio is not None:
            check_positive("pressure_ratio", np.array(scene.pressure_ratio), f"[1]{LIFTED}")
        if float(motion.highest_speed) > 0:
            check_positive("velocity", scene.velocity, "[m/s]: a motion has a highest speed")
        elif np.any(scene.velocity):
            raise ValueError("`velocity` is refused: [motion] is at rest. Leave it out.")
        elif scene.heating is not None:
            raise ValueError("[heating] is refused: [motion] is at rest. Remove one of the two.")


def refuse_tables(scene: Scene, place: str, *names: str) -> None:
    """Raises `ValueError` if a scene has an approach or one of these tables, which `place` does
    not take.
    """
    if scene.approach is not None:
        raise ValueError(f"{place} needs a `pressure` in [load], not an `approach`.")
    for name in names:
        if getattr(scene, name) is not None:
            raise ValueError(f"{place} does not take the table [{name}].")


def refuse_liquids(scene: Scene) -> None:
    """Raises `ValueError` with the name of a material that is a liquid, in any block of a scene."""
    for _, (stack, _) in scene.all_bodies():
        path = liquid_in(stack)
        if path is not None:
            raise ValueError(f"[materials.{scene.materials[path]}] {LIQUID}")


def check_paths(given: Iterable[str], stack: Stack | None, body: BodyName = "block") -> None:
    """Raises `ValueError` unless all name numbers of the body."""
    if stack is None:
        raise ValueError(f"{[*given]} need the table [{body}].")
    start = OF_COUNTERFACE if body == "counterface" else ""
    known = [start + path for path in paths(stack)]
    whole = [path for path in known if not path.endswith("]")]  # entries of arrays are many
    for path in (start + path for path in given):
        if path not in known:
            other = path.startswith(OF_COUNTERFACE) and not start
            hint = "only those of the block vary here" if other else nearest(path, whole)
            raise ValueError(f"`{path}` is not a number of the {body}; {hint.rstrip('.')}.")
