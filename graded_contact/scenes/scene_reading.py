"""Scenes read from TOML and checked."""

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..blocks.stack import Stack
from ..contacts.nested_solve import DouglasRachford
from ..core.checks import (
    as_float,
    check_positive,
    check_squares,
    check_tolerance,
    check_values,
    nearest,
    within,
)
from ..core.memory import check_points
from ..core.parameters import paths, with_values
from ..materials.softening import as_strain_per_slope
from ..materials.table import Tabulated
from ..readers.paths import check_name, read_utf8
from ..sliding.shear import shear_stress
from .block import Block, extremes
from .scene import KEYS, Scene, Tables
from .schema import LARGEST, ROOT, keys_of
from .surface_source import Sphere, SurfaceFile, surface_source
from .toml import parse_toml


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; the site lists its keys.

    A missing file raises `FileNotFoundError`. An error in the file raises `ValueError` with the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** the scene.
    """
    text = read_utf8(path, LARGEST)
    with within(f"{path}:"):
        return parse_scene(text, Path(path).parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    block = Block(Path(folder))
    reader = block.reader
    tables: Tables = reader.build(ROOT, parse_toml(text), Tables)
    (load,) = reader.arguments("[load]", tables.load, KEYS["[load]"])
    if ("pressure" in load) == ("approach" in load):
        both = "has `pressure` and `approach`; give" if "pressure" in load else "lacks"
        raise ValueError(f"[load] {both} one of the keys `pressure` and (on a window) `approach`.")
    kind = "approach" if "approach" in load else "pressure"
    if "velocity" not in load:
        if tables.motion is None:
            raise ValueError("[load] lacks the key `velocity`.")
        load["velocity"] = np.array([float(tables.motion.highest_speed)])
    solver, accuracy = reader.arguments(
        "[solver]", tables.solver, keys_of(DouglasRachford), KEYS["[solver]"]
    )
    block.read_materials(tables.materials, load.get("temperature"))
    if any(
        isinstance(m, Tabulated) and m.extrapolate == "plateau" for m in block.materials.values()
    ):
        load["extrapolate"] = True
    with within("[load]"):
        if kind == "pressure":
            check_positive(kind, load[kind], "[Pa]")
        else:
            check_values(kind, load[kind], "an approach [m] must be finite")
        load.setdefault("pressure", np.array([]))
        check_values("velocity", load["velocity"], "a velocity [m/s] must be finite")
        check_squares("velocity", load["velocity"], "m/s")
        full, reason = 2 * np.pi, "an angle [rad] lies between -2π and 2π"
        check_values("direction", load.get("direction", 0.0), reason, at_least=-full, at_most=full)
    with within("[solver]"):
        algorithm = DouglasRachford(**solver)
        if "rtol" in accuracy:
            check_tolerance("rtol", accuracy["rtol"], as_float(load[kind]))
    surface, stack, inputs = (
        surface_source(tables.surface, tables.grid, reader),
        block.stack(tables.layers, tables.base),
        dict(reader.paths),
    )
    (output,) = reader.arguments("[output]", tables.output, KEYS["[output]"])
    with within("[output]"):
        if "name" in output:
            check_name(output["name"])
    found = Scene(
        text=text,
        title=tables.title,
        surface=surface,
        stack=stack,
        sweep=tables.sweep,
        errors=tuple(
            (name, block.materials[name], errors) for name, errors in block.errors.items()
        ),
        inputs=inputs,
        motion=tables.motion,
        shear=tables.shear,
        heating=tables.heating,
        notes=tuple(block.notes),
        solver=algorithm,
        **load,
        **accuracy,
        **output,
    )
    ends = isinstance(surface, SurfaceFile) and surface.arguments.get("periodic") == "open"
    if found.approach is not None and not (ends or isinstance(surface, Sphere)):
        raise ValueError(
            '[load] `approach` needs a surface of kind "sphere", or a file that is "open".'
        )
    _check_motion(found)
    _check_dry(found)
    _check_sweep(found)
    check_points("` x `".join(found.axes), found.num_solves)
    return found


def _check_motion(scene: Scene) -> None:
    """Raises `ValueError` for what does not go with a motion, or not without one."""
    if scene.motion is None:
        if scene.pressure_ratio is not None:
            raise ValueError("[load] `pressure_ratio` needs a table [motion].")
        return
    refuse_tables(scene, "[motion]", "shear", "heating")
    if scene.strain_per_slope is not None:
        raise ValueError("[motion] does not take the key `strain_per_slope` of [load].")
    with within("[load]"):
        if scene.pressure_ratio is not None:
            check_positive("pressure_ratio", np.array(scene.pressure_ratio), "[1]")
        if float(scene.motion.highest_speed) > 0:
            check_positive("velocity", scene.velocity, "[m/s]: a motion has a highest speed")
        elif np.any(scene.velocity):
            raise ValueError("`velocity` is refused: [motion] is at rest. Leave it out.")


def _check_dry(scene: Scene) -> None:
    """Raises `ValueError` if shear or heating lack a temperature."""
    if scene.heating is not None and scene.temperature is None:
        raise ValueError("[heating] needs the bulk `temperature` [K] in [load].")
    with within("[load]"):
        if scene.strain_per_slope is not None:
            as_strain_per_slope(scene.strain_per_slope, scene.stack)
    with within("[shear]"):
        for at in extremes(scene.temperature) or [None]:
            shear_stress(scene.shear, as_float(1.0, "velocity"), at)


def refuse_tables(scene: Scene, place: str, *names: str) -> None:
    """Raises `ValueError` if a scene has a table of these names, which `place` does not take.

    Nor does it take an approach.
    """
    if scene.approach is not None:
        raise ValueError(f"{place} needs a `pressure` in [load], not an `approach`.")
    for name in names:
        if getattr(scene, name) is not None:
            raise ValueError(f"{place} does not take the table [{name}].")


def _check_sweep(scene: Scene) -> None:
    """Raises `ValueError` unless every value makes a block, at each temperature."""
    with within("[sweep]"):
        check_paths(scene.sweep, scene.stack)
        for path, values in scene.sweep.items():
            for value in (np.min(values), np.max(values)):  # what is allowed has no gaps
                changed = with_values(scene.stack, {path: value})
                for at in extremes(scene.temperature):
                    changed.at(at)


def check_paths(given: Iterable[str], stack: Stack) -> None:
    """Raises `ValueError` unless all name numbers of the block."""
    known = paths(stack)
    whole = [path for path in known if not path.endswith("]")]  # entries of arrays are many
    for path in given:
        if path not in known:
            raise ValueError(f"`{path}` is not a number of the block; {nearest(path, whole)}")
