"""A scene: a case with axes, as a TOML file describes it.

    read_scene  ──>  Scene  ──case(point)──>  Case  ──sweep──>  xarray.Dataset

Keys are the names of arguments of this package, in SI units, angles in radians; a `kind` names the
constructor. Paths are relative to the scene file, or begin with `~`.
"""

import dataclasses
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from ..blocks import Stack
from ..contacts import DouglasRachford, HardWall
from ..core.checks import as_float, check_tolerance, check_type, check_whole, within
from ..core.display import shown
from ..core.files import read_file
from ..core.parameters import with_values
from ..fields.frequency import velocity_along
from ..fields.grid import Grid
from ..sliding import Case, Fluid, Heating, Motion, Numerics
from ..sliding.bodies import TwoBodies, in_both
from ..sliding.interior.stress import STRESSES
from ..sliding.number import observables_in
from ..sliding.result import KINDS
from ..sliding.shear import SHEARS
from ..surfaces import Surface
from . import kinds, loads
from .builder import Builder, check_table, in_table, kind_of, tables_of

NEEDED = ("surface", "materials", "base", "load")
OF_BODIES = ("grid", "block_surface", "layers", "counterface")
OF_LAWS = ("law", "shear", "heating", "fluid")
OF_RUNS = ("title", "sweep", "motion", "observe", "solver", "output")
TABLES = (*NEEDED, *OF_BODIES, *OF_LAWS, *OF_RUNS)


@shown("asked", unset=False)
@dataclasses.dataclass(frozen=True)
class Observe:
    """Optional outputs, off by default because they take longer.

    **Fields:**

    - `stiffness`: true for the contact stiffness [Pa/m].
    - `conductance`: true for the conductance of the contact between two half spaces, times the sum
      of their resistivities [1/m]. Over the sum of 1/λ it is the thermal conductance.
    - `flow`: true for the conductance of the gap for a thin fluid along x and along y [m³].
    - `tension`, `von_mises`: true for the largest principal stress and the largest von Mises stress
      in the block [Pa], with their depths [m]: at the surface, at a quarter, half and all of each
      layer, and just below it; of the points of the grid, without an error.
    - `interface_shear`: true for the largest shear stress between layers [Pa], with its depth.
    """

    stiffness: bool = False
    conductance: bool = False
    flow: bool = False
    tension: bool = False
    von_mises: bool = False
    interface_shear: bool = False

    def __post_init__(self):
        for name, value in vars(self).items():
            check_type(name, value, bool)

    @property
    def asked(self) -> tuple[str, ...]:
        """The names of the outputs that are true."""
        return tuple(name for name, value in vars(self).items() if value)


@dataclasses.dataclass(frozen=True)
class Output:
    """The fields that are stored beside the numbers.

    **Fields:**

    - `fields`: solves whose fields over the surface are stored: "last", "every" or "none".
    - `frames`: number of times of a transient motion with fields, and with a flow or leakage: after
      equal numbers of steps, with the first and the last.
    """

    fields: Literal["last", "every"] | None = "last"
    frames: int = 8

    def __post_init__(self):
        check_type("fields", self.fields, "last", "every", type(None))
        check_whole("frames", self.frames, 1)


@shown("title", "bodies", "axes", "motion", "options", "fluid", "observe", unset=False)
@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """A block, a rough surface and loads, some of which vary.

    **Fields:**

    - `text`, `title`: of the file.
    - `bodies`: the block, and the counterface or None.
    - `surface`, `block_surface`: rough surfaces, or the function that draws them from a seed.
    - `axes`: values of the numbers that vary, by name: paths of numbers of the bodies, such as
      "layers[0].thickness", "seed", and the loads. Each has at least one value.
    - `motion`: in place of steady sliding a cycle or a transient motion; else None.
    - `load_over_time`: of a motion whose load varies; else None.
    - `options`: `law`, `shear`, `heating` and `strain_per_slope` of the `Case`.
    - `fluid`: whose leakage is a result, or None.
    - `observe`, `output`: optional outputs, and the fields to store.
    - `numerics`: how a contact is computed.
    """

    text: str
    title: str
    bodies: TwoBodies
    surface: Surface | kinds.DrawSurface
    block_surface: Surface | None
    axes: dict[str, Float[np.ndarray, " values"]]
    motion: Motion | None
    load_over_time: loads.LoadOverTime | None
    options: dict[str, Any]
    fluid: Fluid | None
    observe: Observe
    output: Output
    numerics: Numerics

    @property
    def kind(self) -> Literal["steady", "cycle", "transient"]:
        """The kind of its contacts."""
        if self.motion is None:
            return "steady"
        return "cycle" if self.motion.repeats else "transient"

    @property
    def last(self) -> dict[str, Any]:
        """The last point of all axes."""
        return {name: values[-1] for name, values in self.axes.items()}

    def case(self, point: Mapping[str, Any]) -> Case:
        """Returns the case at a point, given by its numbers on the axes; JAX may trace them."""
        given: dict[str, Any] = {
            **self.bodies_at(point)._asdict(),
            **self.options,
            "surface": self.surface_at(point),
            "block_surface": self.block_surface,
            "temperature": point.get("temperature"),
            **{name: point[name] for name in ("pressure", "approach") if name in point},
        }
        direction, motion = point.get("direction", 0.0), self.motion
        if motion is None:
            return Case(velocity=velocity_along(point["velocity"], direction), **given)
        if self.load_over_time is not None:
            given["pressure"] = given["pressure"] * self.load_over_time.at(motion)
        given["displacement"] = loads.turned(motion.displacement, direction)
        if not motion.repeats:
            return Case(times=np.asarray(motion.times), **given)
        period = motion.period
        if "velocity" in point:  # the same path at another highest speed
            period = period * (motion.highest_speed / point["velocity"])
        return Case(period=period, **given)

    def bodies_at(self, point: Mapping[str, Any]) -> TwoBodies:
        """Returns both bodies at a point; JAX may trace its numbers."""
        values = {in_both(path): number for path, number in point.items() if is_path(path)}
        bodies, temperature = with_values(self.bodies, values), point.get("temperature")
        return bodies if temperature is None else bodies.at(temperature)

    def surface_at(self, point: Mapping[str, Any]) -> Surface:
        """Returns the surface at a point, drawn from its seed if that varies."""
        return self.surface if isinstance(self.surface, Surface) else self.surface(point["seed"])


def is_path(axis: str) -> bool:
    """Returns whether an axis is the path of a number of a body."""
    return axis not in (*loads.AXES, "seed")


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes.

    A missing file raises `FileNotFoundError`. An error in the file raises `ValueError` with the
    table and the key.
    """
    text = read_file(path).decode()
    with within(f"{path}:"):
        return parse_scene(text, Path(path).parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    tables = tomllib.loads(text)
    check_table("the scene", tables, TABLES)
    for name in NEEDED:
        if name not in tables:
            raise ValueError(f"[the scene] lacks the table [{name}].")
    builder = Builder(Path(folder), kinds.NESTED)
    for name, table in tables["materials"].items():
        builder.materials[name] = builder.build_kind(f"materials.{name}", table, kinds.MATERIALS)
    numerics, graded_solver = numerics_of(builder, tables.get("solver", {}))
    grid = builder.build("grid", tables["grid"], Grid) if "grid" in tables else None
    surface, seeds = surface_of(builder, "surface", tables["surface"], grid)
    load, sweep = tables["load"], tables.get("sweep", {})
    axes = {path: loads.axis_of("sweep", path, values) for path, values in sweep.items()}
    axes = axes | seeds | loads.load_axes(load)
    first = surface if isinstance(surface, Surface) else surface(seeds["seed"][0])
    line = loads.line_along(first.grid, axes.get("direction", 0.0))
    motion = loads.motion_of(builder, tables.get("motion"), line)
    over_time, highest = loads.load_over_time(builder, load, motion)
    if highest is not None:
        axes["pressure"] = np.array([highest])
    if motion is not None and not motion.repeats:
        motion = motion if over_time is None else loads.with_corners(motion, over_time)
        if "velocity" in axes:
            raise ValueError("[load] `velocity` is not for [[motion]], which has its own.")
    elif motion is None and "velocity" not in axes:
        raise ValueError("[load] lacks the key `velocity`.")
    block_surface: Any = None
    if "block_surface" in tables:
        own = {"seed": 1, **tables["block_surface"]}  # another surface with the same spectrum
        block_surface, more = surface_of(builder, "block_surface", own, first.grid)
        if more:
            raise ValueError("[block_surface] `seeds` must be 1: only [surface] may have several.")
    bodies = TwoBodies(
        body_of(builder, "", tables, graded_solver),
        body_of(builder, "counterface.", tables.get("counterface"), graded_solver),
    )
    scene = Scene(
        text=text,
        title=tables.get("title", ""),
        bodies=bodies,
        surface=surface,
        block_surface=block_surface,
        axes=axes,
        motion=motion,
        load_over_time=over_time,
        options=options_of(builder, tables),
        fluid=builder.build("fluid", tables["fluid"], Fluid) if "fluid" in tables else None,
        observe=builder.build("observe", tables.get("observe", {}), Observe),
        output=builder.build("output", tables.get("output", {}), Output),
        numerics=numerics,
    )
    check_bodies(scene)
    check_outputs(scene)
    return scene


def numerics_of(builder: Builder, table: Any) -> tuple[Numerics, Any]:
    """Returns tolerance and solver of the table [solver], and the solver of graded layers."""
    check_table("solver", table, table)
    own = dict(table)
    rtol, graded = own.pop("rtol", None), own.pop("graded_solver", None)
    solver = builder.build("solver", own, DouglasRachford)
    if rtol is not None:
        with in_table("solver"):
            check_tolerance("rtol", rtol, as_float(1.0))
    if graded is not None:
        graded = builder.build_kind("solver.graded_solver", graded, kinds.GRADED_SOLVERS)
    return Numerics(rtol=rtol, solver=solver, throw=False), graded


def options_of(builder: Builder, tables: dict[str, Any]) -> dict[str, Any]:
    """Returns the options of a `Case` in the tables of a scene."""
    options: dict[str, Any] = {"law": HardWall()}
    options |= {name: tables["load"][name] for name in loads.OPTIONS if name in tables["load"]}
    for name, known in (("law", kinds.CONTACT_LAWS), ("shear", SHEARS)):
        if name in tables:
            options[name] = builder.build_kind(name, tables[name], known)
    if "heating" in tables:
        options["heating"] = builder.build("heating", tables["heating"], Heating)
    return options


def body_of(builder: Builder, owner: str, tables: Any, graded_solver: Any) -> Any:
    """Returns the body of the tables `layers` and `base`, or None without tables."""
    if tables is None:
        return None
    if owner:
        check_table(owner[:-1], tables, ("layers", "base"))
    if "base" not in tables:
        raise ValueError(f"[{owner[:-1]}] lacks the table `base`.")
    layers = [
        kinds.layer_of(builder, place, table)
        for place, table in tables_of(f"{owner}layers", tables.get("layers", [])).items()
    ]
    base = builder.build_kind(f"{owner}base", tables["base"], kinds.BASES)
    with in_table(f"{owner}base"):
        return Stack(layers=layers, base=base, graded_solver=graded_solver)


def surface_of(
    builder: Builder, place: str, table: Any, grid: Grid | None
) -> tuple[Surface | kinds.DrawSurface, dict[str, np.ndarray]]:
    """Returns a surface; of several seeds, the function that draws it and the axis "seed"."""
    kind, own = kind_of(place, table, kinds.SURFACES)
    if kind == "file" and place == "surface" and grid is not None:
        raise ValueError("[grid] is not for a surface from a file: `shape` sets its points.")
    if kind != "file" and grid is None:
        raise ValueError("[the scene] lacks the table [grid].")
    seed, count = (own.pop("seed", 0), own.pop("seeds", 1)) if kind == "self_affine" else (0, 1)
    with in_table(place):
        check_whole("seed", seed, 0)
        check_whole("seeds", count, 1)
    made = builder.build_kind(place, {"kind": kind, **own}, kinds.SURFACES, grid=grid)
    if isinstance(made, Surface):
        return made, {}
    with in_table(place):
        first = made(seed)  # refuses waves that no grid resolves
    return (first, {}) if count == 1 else (made, {"seed": seed + np.arange(count)})


def check_outputs(scene: Scene) -> None:
    """Raises `ValueError` for an optional output that contacts of this kind do not have."""
    surface, numbers = scene.surface_at(scene.last), observables_in(KINDS[scene.kind])
    known = {need for number in numbers.values() for need in number.needs}
    if surface.grid.ndim == 1 or not surface.periodic:
        known -= {"flow"}
    if scene.fluid is not None and "flow" not in known:
        raise ValueError("[fluid] is not for this scene: it needs a periodic plane, and no cycle.")
    with in_table("observe"):
        for name in scene.observe.asked:
            if name not in (*STRESSES, *known):
                raise ValueError(f"`{name}` is not for this motion and this surface.")


def check_bodies(scene: Scene) -> None:
    """Raises `ValueError` for numbers on the axes that no body can have."""
    for name, values in scene.axes.items():
        if is_path(name) or name == "temperature":
            with in_table("sweep" if is_path(name) else "load"):
                for value in values:
                    scene.bodies_at({**scene.last, name: value})
