"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them. Paths are relative to the scene file, or begin with `~`.
"""

import dataclasses
import itertools
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..blocks.stack import LIQUID, Stack, liquid_in
from ..contacts.law import AbstractLaw, HardWall, check_pressure
from ..contacts.nested_solve import DouglasRachford
from ..contacts.solve import RTOL
from ..core.checks import (
    as_float,
    check_positive,
    check_squares,
    check_tolerance,
    check_values,
    nearest,
    within,
)
from ..core.display import shown
from ..core.files import check_name, read_utf8
from ..core.memory import check_points
from ..core.parameters import paths, places, with_values
from ..fields.frequency import velocity_along
from ..fields.grid import Grid
from ..materials.material import AbstractMaterial
from ..materials.softening import as_strain_per_slope
from ..sliding.case import Case, Heating
from ..sliding.motion import Motion
from ..sliding.numerics import Numerics
from ..sliding.shear import AbstractShear, shear_stress
from ..studies.parameter_covariance import Errors
from ..surfaces.surface import Surface
from .block import KIND_MAKERS, Block, extremes
from .schema import LINEAR, LOGARITHMIC, MOST_BYTES, ROOT, check_texts, keys_of, parse_toml
from .surface_source import RandomSurface, Sphere, SurfaceFile, surface_source

Axis = Annotated[Float[np.ndarray, " _"], LOGARITHMIC]


@dataclasses.dataclass(frozen=True)
class Observe:
    """Numbers of each contact that take more time, for those who ask.

    **Fields:**

    - `stiffness`: true for the contact stiffness [Pa/m], by which the mean pressure rises as the
      mean gap closes.
    - `conductance`: true for the conductance of the contact between two half spaces, times the sum
      of their resistivities [1/m]. Over the sum of 1/λ it is the thermal conductance.
    - `flow`: true for the conductance of the gap for a thin fluid along x and along y [m³]. Times
      the gradient of the fluid's pressure, over 12 times its viscosity, it is the leakage per
      width.
    """

    stiffness: bool = False
    conductance: bool = False
    flow: bool = False


@dataclasses.dataclass(frozen=True)
class SceneTables:
    """The tables of a scene; those that need others are converted after them.

    **Fields:**

    - `surface`: of the rough counter-body, with a `kind`.
    - `materials`: tables [materials.NAME], each with a `kind`; one may use those above it.
    - `base`: below the layers, with a `kind`.
    - `load`: pressures or approaches, velocities, temperatures.
    - `title`: one line for the reader.
    - `grid`: of a random surface, or of a sphere.
    - `layers`: tables [[layers]], from the loaded surface downwards. A graded one has, instead of
      `material`, the NAMEs `bottom` and `top`.
    - `sweep`: other values for numbers of the block, by paths as in `with_values`:
      "layers[0].thickness" = [1e-5, 1e-4]. A temperature acts on the block with these values.
    - `motion`: back and forth or with stops, in place of steady sliding, with a `kind`.
    - `law`: of contact, with a `kind`: adhesion, hardness or a soft wall; if missing, a hard wall.
    - `shear`: stress in the contact, which adds to the friction, with a `kind`.
    - `heating`: how the heat of friction flows; it then softens the block under the contact.
    - `observe`: numbers that are computed if asked for: stiffness, conductance, flow.
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
    sweep: dict[str, Axis] = dataclasses.field(default_factory=dict)
    motion: dict[str, object] | None = None
    law: AbstractLaw | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    observe: Observe = Observe()
    solver: dict[str, object] = dataclasses.field(default_factory=dict)
    output: dict[str, object] = dataclasses.field(default_factory=dict)
    design: dict[str, object] | None = None


@shown(
    "title", "stack", "surface", "sweep", "temperature", "pressure", "velocity", "motion",
    "sampling", "law", "shear", "heating", "observe",
)  # fmt: skip
@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What to compute: block, surface and loads of a scene file.

    Its fields are keys of the tables [load], [solver] and [output], see `KEYS`.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for the reader.
    - `stack`: the block of the file; `block` returns that of a point.
    - `surface`: where the surface comes from; `plan` makes it.
    - `sweep`: other values for numbers of the stack, by their paths.
    - `pressure`: mean pressures [Pa], an axis; none with an approach.
    - `approach`: of a body on a window since its first touch [m], an axis in place of the pressure.
    - `velocity`: sliding velocities [m/s], an axis. With a motion these are its highest speeds, and
      each changes its period; if missing, the motion has the period of its table.
    - `temperature`: of the block [K], one or an axis; None leaves the materials unchanged. With
      heating it is the bulk temperature.
    - `pressure_ratio`: with a motion, pressures over `pressure` [1] at equally spaced times of the
      period, linear in between; if missing, the load is constant.
    - `motion`, `law`, `shear`, `heating`: the tables of these names, or None.
    - `observe`: the table of this name.
    - `step`: of a motion, its largest step from one time to the next, in spacings of the grid.
    - `strain_per_slope`: of a block that softens, strain amplitude over rms slope [1], see `slide`;
      if missing, each material has its own amplitude.
    - `direction`: of the velocity from the x axis [rad], one or an axis. (In Python two numbers are
      one velocity, (vx, vy).)
    - `extrapolate`: true allows friction from frequencies at which a material was not measured.
    - `solver`: algorithm of the contact.
    - `rtol`: requested relative error of the contact pressure [1].
    - `name`: begins the names of the files of results.
    - `directory`: folder of the results, relative to the scene.
    - `fields`: solves whose fields over the surface are stored.
    - `materials`: names of the materials by their paths in the block, such as "base.material".
    - `errors`: of materials: name, material of the stack, and errors of its numbers.
    - `inputs`: the files that the scene names, by table and key.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    - `assumed`: those of them that neither a file nor the scene states: caveats of the results.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile | Sphere
    sweep: dict[str, Axis]
    pressure: Axis
    velocity: Axis
    approach: Axis | None = None
    temperature: Annotated[Float[np.ndarray, "*temperatures"], LINEAR] | None = None
    direction: Annotated[Any, LINEAR] = 0.0  # a float, or an array as an axis
    extrapolate: bool = False
    pressure_ratio: list[float] | None = None
    strain_per_slope: float | None = None
    motion: Motion | None = None
    step: float | None = None
    law: AbstractLaw | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    observe: Observe = Observe()
    solver: DouglasRachford
    rtol: float = RTOL
    name: str | None = None
    directory: Path | None = None
    fields: Literal["last", "every", "none"] = "last"
    materials: dict[str, str]
    errors: tuple[tuple[str, AbstractMaterial, Errors], ...]
    inputs: dict[tuple[str, str], Path]
    notes: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """What is varied, by name, in the order of the results' axes."""
        found = dict(self.sweep)
        if self.temperature is not None and self.temperature.ndim:
            found["temperature"] = self.temperature
        if isinstance(self.direction, np.ndarray):
            found["direction"] = self.direction
        if isinstance(self.surface, RandomSurface) and self.surface.seeds is not None:
            found["seed"] = self.surface.seed + np.arange(self.surface.seeds)
        load = "pressure" if self.approach is None else "approach"
        return {**found, load: getattr(self, load), "velocity": self.velocity}

    @property
    def contact_law(self) -> AbstractLaw:
        """That of [law], or a hard wall."""
        return self.law or HardWall()

    @property
    def num_solves(self) -> int:
        """How many combinations there are of what is varied."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def num_times(self) -> int:
        """How many times a solve has: 1 under steady sliding."""
        return 1 if self.motion is None else self.motion.num_times

    @property
    def sampling(self) -> str | None:
        """How many times a motion has, and how fine they are, in words."""
        if self.motion is None or self.step is None:
            return None
        return f"{self.num_times} times, a largest step of {self.step:.2g} spacings"

    def period_at(self, velocity: Any) -> Any:
        """Returns the period of the motion [s] at a highest speed [m/s]."""
        assert self.motion is not None
        # The same path at another speed takes another period; at rest the period stays.
        own = self.motion.highest_speed
        return self.motion.period * jnp.where(own > 0, own / jnp.where(own > 0, velocity, 1), 1)

    @property
    def numerics(self) -> Numerics:
        """How its contacts are computed; a solve that fails says so in its result."""
        return Numerics(rtol=self.rtol, solver=self.solver, throw=False)

    def case(self, point: Mapping[str, Any], surface: Surface) -> Case:
        """Returns the case at a point, given by its numbers on the axes; JAX may trace them."""
        given: dict[str, Any] = {
            "stack": self.block(point), "surface": surface, "shear": self.shear,
            "temperature": point.get("temperature", self.temperature), "heating": self.heating,
            "strain_per_slope": self.strain_per_slope, "law": self.contact_law,
            **{name: point[name] for name in ("pressure", "approach") if name in point},
        }  # fmt: skip
        direction = point.get("direction", self.direction)
        if self.motion is None:
            return Case(velocity=velocity_along(point["velocity"], direction), **given)
        # The motion is a path along x; the direction turns it.
        along, moved = jnp.atleast_1d(velocity_along(1.0, direction)), self.motion.displacement
        if self.pressure_ratio is not None:
            # The load is linear between its times, and periodic as the motion.
            times = np.arange(self.num_times) / self.num_times
            known = np.arange(len(self.pressure_ratio)) / len(self.pressure_ratio)
            ratio = np.interp(times, known, self.pressure_ratio, period=1.0)
            given["pressure"] = given["pressure"] * ratio
        moved = moved if len(along) == 1 else moved[:, None] * along
        period = self.period_at(point["velocity"])
        return Case(displacement=moved, period=period, **given)

    def block(self, point: Mapping[str, Any]) -> Stack:
        """Returns the stack at a point, given by its numbers on the axes; JAX may trace them."""
        stack = with_values(self.stack, {path: point[path] for path in self.sweep})
        temperature = point.get("temperature", self.temperature)
        return stack if temperature is None else stack.at(temperature)

    def blocks(self) -> Iterator[tuple[dict[str, float], Stack]]:
        """Yields the stacks that differ, each with its numbers of [sweep] and its temperature."""
        axes = {name: at for name, at in self.axes.items() if name in (*self.sweep, "temperature")}
        for numbers in itertools.product(*axes.values()):
            point = dict(zip(axes, numbers, strict=True))
            yield point, self.block(point)


# The tables that are fields of a scene as they are.
_OWN = ("title", "sweep", "law", "shear", "heating", "observe")
# The keys of tables that are fields of a scene.
KEYS = {
    place: tuple(
        key._replace(default=None) if key.name in ("pressure", "velocity") else key
        for key in keys_of(Scene)
        if key.name in names
    )
    for place, names in {
        "[load]": (
            *("pressure", "approach", "velocity", "temperature", "direction", "extrapolate"),
            *("pressure_ratio", "strain_per_slope"),
        ),
        "[solver]": ("rtol",),
        "[output]": ("name", "directory", "fields"),
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
    text = read_utf8(path, MOST_BYTES)
    with within(f"{path}:"):
        return parse_scene(text, Path(path).parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    block = Block(Path(folder))
    reader = block.reader
    entries = parse_toml(text)
    tables: SceneTables = reader.build(ROOT, entries, SceneTables)
    (load,) = reader.arguments("[load]", tables.load, KEYS["[load]"])
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
    # A table that is continued by a plateau allows what [load] would refuse.
    if any(getattr(m, "extrapolate", "") == "plateau" for m in block.materials.values()):
        load["extrapolate"] = True
    with within("[solver]"):
        algorithm = DouglasRachford(**solver)
    surface = surface_source(tables.surface, tables.grid, reader)
    motion = step = None
    if tables.motion is not None:
        line = _along(surface, direction)
        motions = {**KIND_MAKERS[Motion], "recorded": block.recorded}
        motion = reader.build_kind("[motion]", tables.motion, motions, grid=line)
        step = float(motion.largest_step(line))
        load.setdefault("velocity", np.array([float(motion.highest_speed)]))
    stack = block.stack(tables.layers, tables.base, accuracy.pop("graded_solver", None))
    inputs = dict(reader.paths)  # before [output], whose folder is no input
    (output,) = reader.arguments("[output]", tables.output, KEYS["[output]"])
    own = {name: getattr(tables, name) for name in _OWN}
    errors = tuple((name, block.materials[name], known) for name, known in block.errors.items())
    materials = {at: name for name, part in block.materials.items() for at in places(stack, part)}
    found = Scene(
        text=text, surface=surface, stack=stack, materials=materials, errors=errors, inputs=inputs,
        notes=tuple(block.notes), assumed=tuple(block.assumed), solver=algorithm, motion=motion,
        step=step,
        **own, **load, **accuracy, **output,
    )  # fmt: skip
    _check_numbers(found)
    _check_tables(found)
    check_texts(entries)
    return found


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


def _check_numbers(scene: Scene) -> None:
    """Raises `ValueError` for numbers that no contact, file or block can have."""
    with within("[load]"):
        if scene.approach is None:
            check_positive("pressure", scene.pressure, "[Pa]")
            highest = np.max(scene.pressure) * np.max(scene.pressure_ratio or 1.0)
            check_pressure(as_float(highest), scene.contact_law)
        else:
            check_values("approach", scene.approach, "an approach [m] must be finite")
        check_values("velocity", scene.velocity, "a velocity [m/s] must be finite")
        check_squares("velocity", scene.velocity, "m/s")
        if scene.strain_per_slope is not None:
            as_strain_per_slope(scene.strain_per_slope, scene.stack)
    with within("[solver]"):
        check_tolerance("rtol", scene.rtol, as_float(1.0))  # in the dtype of the session
    if scene.name is not None:
        with within("[output]"):
            check_name(scene.name)
    with within("[sweep]"):
        check_paths(scene.sweep, scene.stack)
        for path, values in scene.sweep.items():
            for value in (np.min(values), np.max(values)):  # what is allowed has no gaps
                changed = with_values(scene.stack, {path: value})
                for at in extremes(scene.temperature):
                    changed.at(at)
    check_points("` x `".join(scene.axes), scene.num_solves)


def _check_tables(scene: Scene) -> None:
    """Raises `ValueError` for tables and keys that do not go together, or that need another."""
    source, motion = scene.surface, scene.motion
    is_open = isinstance(source, SurfaceFile) and source.arguments.get("periodic") == "open"
    if scene.approach is not None and not (is_open or isinstance(source, Sphere)):
        raise ValueError(
            '[load] `approach` needs a surface of kind "sphere", or a file that is "open".'
        )
    asked = scene.observe != Observe()
    if asked and (motion is not None or is_open or isinstance(source, Sphere)):
        raise ValueError("[observe] needs steady sliding on a periodic surface.")
    if scene.heating is not None and scene.temperature is None:
        raise ValueError("[heating] needs the bulk `temperature` [K] in [load].")
    with within("[shear]"):
        # A law with a shift refuses a scene without a temperature.
        for at in extremes(scene.temperature) or [None]:
            shear_stress(scene.shear, as_float(1.0, "velocity"), at)
    if motion is None:
        if scene.pressure_ratio is not None:
            raise ValueError("[load] `pressure_ratio` needs a table [motion].")
        return
    refuse_tables(scene, "[motion]")
    if scene.strain_per_slope is not None:
        raise ValueError("[motion] does not take the key `strain_per_slope` of [load].")
    with within("[load]"):
        if scene.pressure_ratio is not None:
            check_positive("pressure_ratio", np.array(scene.pressure_ratio), "[1]")
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
    for _, stack in scene.blocks():
        path = liquid_in(stack)
        if path is not None:
            raise ValueError(f"[materials.{scene.materials[path]}] {LIQUID}")


def check_paths(given: Iterable[str], stack: Stack) -> None:
    """Raises `ValueError` unless all name numbers of the block."""
    known = paths(stack)
    whole = [path for path in known if not path.endswith("]")]  # entries of arrays are many
    for path in given:
        if path not in known:
            raise ValueError(f"`{path}` is not a number of the block; {nearest(path, whole)}")
