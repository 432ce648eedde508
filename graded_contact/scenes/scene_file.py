"""Reads a scene from its TOML file: tables by their keys, then what they say together."""

import dataclasses
import os
from pathlib import Path

import numpy as np

from ..blocks.stack import Stack
from ..contacts.law import AbstractLaw
from ..contacts.solver.nested_solve import DouglasRachford
from ..core.checks import (
    check_values,
    within,
)
from ..core.parameters import places
from ..fields.frequency import velocity_along
from ..fields.grid import Grid
from ..sliding.case import Heating
from ..sliding.numbers.gap_flow import Fluid
from ..sliding.shear import AbstractShear
from .block import Block
from .once import motion_of, read_load, with_corners
from .scene import Axis, Observe, Scene
from .scene_checks import check_numbers, check_tables
from .scene_doubts import doubts_of
from .schema import ROOT, keys_of
from .surface_source import RandomSurface, Sphere, SurfaceFile, surface_of_block, surface_source
from .toml import check_texts, parse_toml, text_of_scene


@dataclasses.dataclass(frozen=True)
class CounterfaceTables:
    """The body that carries the surface and moves with it; without the table it is rigid.

    **Fields:**

    - `base`: below its layers, with a `kind`.
    - `layers`: tables [[counterface.layers]], from its rough surface inwards, as [[layers]].
    """

    base: dict[str, object]
    layers: list[dict] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class SceneTables:
    """The tables of a scene; those that need others are converted after them.

    **Fields:**

    - `surface`: of the rough counterface, with a `kind`.
    - `materials`: tables [materials.NAME], each with a `kind`; one may use those above it.
    - `base`: below the layers, with a `kind`.
    - `load`: pressures or approaches, velocities, temperatures.
    - `title`: one line for the reader.
    - `grid`: of a random surface, or of a sphere.
    - `layers`: tables [[layers]], from the loaded surface downwards. A graded one has, instead of
      `material`, the NAMEs `bottom` and `top`.
    - `counterface`: the body that carries the surface; rigid without the table. It has the
      temperature of [load], and [heating] warms it.
    - `block_surface`: heights of the block itself, out of the block, with a `kind`; with [motion].
    - `sweep`: other values for numbers of the block, by paths as in `with_values`:
      "layers[0].thickness" = [1e-5, 1e-4], and of the counterface:
      "counterface.layers[0].thickness". A temperature acts on bodies with these values.
    - `motion`: in place of steady sliding, with a `kind`: back and forth or with stops; with
      `once = true` what happens once, with further motions after it as [[motion.then]].
    - `law`: of contact, with a `kind`: adhesion, hardness or a soft wall; if missing, a hard wall.
    - `shear`: stress in the contact, which adds to the friction, with a `kind`.
    - `heating`: how the heat of friction flows; it then softens the block under the contact.
    - `fluid`: in a seal; its leakage is computed.
    - `observe`: numbers that are computed if asked for: stiffness, conductance, flow, stresses.
    - `solver`: tolerance and algorithm.
    - `output`: names and fields of the results.
    - `design`: what the command `design` does.
    """

    surface: dict[str, object]
    materials: dict[str, object]
    base: dict[str, object]
    load: dict[str, object]
    title: str = ""
    grid: Grid | None = None
    layers: list[dict] = dataclasses.field(default_factory=list)
    counterface: CounterfaceTables | None = None
    block_surface: dict[str, object] | None = None
    sweep: dict[str, Axis] = dataclasses.field(default_factory=dict)
    motion: dict[str, object] | None = None
    law: AbstractLaw | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    fluid: Fluid | None = None
    observe: Observe = Observe()  # noqa: RUF009 (immutable)
    solver: dict[str, object] = dataclasses.field(default_factory=dict)
    output: dict[str, object] = dataclasses.field(default_factory=dict)
    design: dict[str, object] | None = None


# The tables that are fields of a scene as they are.
_OWN = ("title", "sweep", "law", "shear", "heating", "fluid", "observe")
# The keys of tables that are fields of a scene.
KEYS = {
    place: tuple(
        key._replace(default=None) if key.name in ("pressure", "velocity") else key
        for key in keys_of(Scene)
        if key.name in names
    )
    for place, names in {
        "[load]": (
            *("pressure", "approach", "velocity", "temperature", "direction"),
            *("pressure_ratio", "ratio_times", "pressure_path", "strain_per_slope"),
        ),
        "[solver]": ("rtol",),
        "[output]": ("name", "directory", "fields", "frames"),
    }.items()
}
# [solver] has a key of the stack, too.
KEYS["[solver]"] += tuple(key for key in keys_of(Stack) if key.name == "graded_solver")


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; `docs/scene_keys.md` lists its keys.

    A missing file raises `FileNotFoundError`. An error in the file raises `ValueError` with the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** the scene.
    """
    text = text_of_scene(path)
    with within(f"{path}:"):
        return parse_scene(text, Path(path).parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    block = Block(Path(folder))
    reader = block.reader
    entries = parse_toml(text)
    tables: SceneTables = reader.build(ROOT, entries, SceneTables)
    (load,) = reader.arguments("[load]", tables.load, KEYS["[load]"])
    read_load(block, load)
    if ("pressure" in load) == ("approach" in load):
        both = "has `pressure` and `approach`; give" if "pressure" in load else "lacks"
        raise ValueError(f"[load] {both} one of the keys `pressure` and (on a window) `approach`.")
    load.setdefault("pressure", np.array([]))  # with an approach there is none
    if "velocity" not in load and tables.motion is None:
        raise ValueError("[load] lacks the key `velocity`.")
    with within("[load]"):
        turn, allowed = 2 * np.pi, "an angle [rad] lies between -2π and 2π"
        direction = np.asarray(load.get("direction", 0.0))
        load["direction"] = direction if direction.ndim else float(direction)
        check_values("direction", direction, allowed, at_least=-turn, at_most=turn)
    solver, accuracy = reader.arguments(
        "[solver]", tables.solver, keys_of(DouglasRachford), KEYS["[solver]"]
    )
    block.read_materials(tables.materials, load.get("temperature"))
    with within("[solver]"):
        algorithm = DouglasRachford(**solver)
    surface = surface_source(tables.surface, tables.grid, reader)
    motion = step = None
    if tables.motion is not None:
        line = _along(surface, direction)
        motion = motion_of(block, tables.motion, line)
        if motion is not None and motion.times is not None:
            motion = with_corners(motion, load)
            if "velocity" in load:
                raise ValueError("[load] `velocity` is refused: [motion] `once = true` gives it.")
        step = float(motion.largest_step(line))
        highest = float(motion.highest_speed)
        if (
            motion is not None and motion.times is not None
        ):  # as it was written, not as steps round it
            highest = float(f"{highest:.12g}")
        load.setdefault("velocity", np.array([highest]))
    how = accuracy.pop("graded_solver", None)
    stack, counterface, own_surface = block.stack(tables.layers, tables.base, how), None, None
    if tables.counterface is not None:
        counterface = block.stack(
            tables.counterface.layers, tables.counterface.base, how, "counterface."
        )
    if tables.block_surface is not None:
        own_surface = surface_of_block(tables.block_surface, tables.grid, surface, reader)
    inputs = dict(reader.paths)  # before [output], whose folder is no input
    (output,) = reader.arguments("[output]", tables.output, KEYS["[output]"])
    own = {name: getattr(tables, name) for name in _OWN}
    errors = tuple((name, block.materials[name], known) for name, known in block.errors.items())
    materials = {at: name for name, part in block.materials.items() for at in places(stack, part)}
    found = Scene(
        text=text, surface=surface, stack=stack, materials=materials, errors=errors, inputs=inputs,
        notes=tuple(block.notes), assumed=tuple(block.assumed), solver=algorithm, motion=motion,
        step=step, counterface=counterface, block_surface=own_surface,
        **own, **load, **accuracy, **output,
    )  # fmt: skip
    check_numbers(found)
    check_tables(found)
    check_texts(entries)
    if isinstance(surface, SurfaceFile):  # `plan` reads it
        return found
    return dataclasses.replace(found, assumed=(*found.assumed, *doubts_of(found, surface.grid)))


def _along(source: RandomSurface | SurfaceFile | Sphere, direction: np.ndarray) -> Grid:
    """A line of points for a motion along x: a step on it is one of the turned path on the grid.

    Of several directions it is the one in which a path crosses most points.
    """
    grid = source.build().grid if isinstance(source, SurfaceFile) else source.grid
    crossed = []
    for angle in np.ravel(direction):
        along = np.abs(np.ravel(velocity_along(1.0, float(angle))))
        if len(along) > grid.ndim:
            return grid  # refused later
        crossed.append(np.sum(along / np.asarray(grid.spacing)[: len(along)]))
    return Grid(grid.shape[:1], grid.shape[0] / max(crossed))
