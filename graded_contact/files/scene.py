"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them. The site lists all of them. Paths are relative to the scene file, or
begin with `~`.
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

from ..contact.nested_solve import DouglasRachford
from ..contact.problem import RTOL
from ..core.checks import as_float, check_positive, check_tolerance, check_values
from ..core.display import shown
from ..core.memory import check_points
from ..core.parameters import paths, with_values
from ..fields.grid import Grid
from ..friction.heating import Heating
from ..friction.motion import Motion
from ..response.grading import AbstractGradedSolver
from ..response.layering import Layering
from ..response.stack import Stack
from ..rheology.material import AbstractMaterial
from ..rheology.shear import AbstractShear, shear_stress
from ..rheology.softening import as_strain_per_slope
from ..rheology.tabulated import Tabulated
from .block import Block, extremes
from .parameter_covariance import Errors
from .paths import check_name, existing_file
from .schema import (
    LARGEST,
    LINEAR,
    LOGARITHMIC,
    ROOT,
    keys_of,
    nearest,
    within,
)
from .surface_source import RandomSurface, Sphere, SurfaceFile, surface_source
from .toml import parse_toml

Values = Annotated[Float[np.ndarray, " _"], LOGARITHMIC]


@dataclasses.dataclass(frozen=True)
class Tables:
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
    - `shear`: stress in the contact, which adds to the friction, with a `kind`.
    - `heating`: how the heat of friction flows; it then softens the block under the contact.
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
    sweep: dict[str, Values] = dataclasses.field(default_factory=dict)
    motion: Motion | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    solver: dict[str, object] = dataclasses.field(default_factory=dict)
    output: dict[str, object] = dataclasses.field(default_factory=dict)
    design: dict[str, object] | None = None


@shown(
    "title", "stack", "surface", "sweep", "temperature", "pressure", "velocity", "motion", "shear",
    "heating",
)  # fmt: skip
@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """What to compute: block, surface and loads of a scene file.

    Its fields are keys of the tables [load], [solver] and [output], see `KEYS`.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for the reader.
    - `stack`: the block of the file; `block` returns that of a point.
    - `surface`: where the surface comes from; `build_surface` makes it.
    - `sweep`: other values for numbers of the stack, by their paths.
    - `pressure`: mean pressures [Pa], an axis; none with an approach.
    - `approach`: of a body on a window since its first touch [m], an axis in place of the pressure.
    - `velocity`: sliding velocities [m/s], an axis. With a motion these are its highest speeds, and
      each changes its period; if missing, the motion has the period of its table.
    - `temperature`: of the block [K], one or an axis; None leaves the materials unchanged. With
      heating it is the bulk temperature.
    - `pressure_ratio`: with a motion, pressures over `pressure` [1] at equally spaced times of the
      period, linear in between; if missing, the load is constant.
    - `motion`, `shear`, `heating`: the tables of these names, or None.
    - `strain_per_slope`: of a block that softens, strain amplitude over rms slope [1], see `slide`;
      if missing, each material has its own amplitude.
    - `direction`: of the velocity from the x axis [rad]. (In Python two numbers are one velocity,
      (vx, vy).)
    - `extrapolate`: true allows friction from frequencies at which a material was not measured.
    - `solver`: algorithm of the contact.
    - `tolerance`: `friction_rtol` or `rtol` of `slide`, by its name.
    - `graded_solver`: the solver of graded layers.
    - `name`: begins the names of the files of results.
    - `directory`: folder of the results, relative to the scene.
    - `fields`: solves whose fields over the surface are stored.
    - `errors`: of materials: name, material of the stack, and errors of its numbers.
    - `inputs`: the files that the scene names.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile | Sphere
    sweep: dict[str, Values]
    pressure: Values
    velocity: Values
    approach: Values | None = None
    temperature: Annotated[Float[np.ndarray, "*temperatures"], LINEAR] | None = None
    direction: float = 0.0
    extrapolate: bool = False
    pressure_ratio: list[float] | None = None
    strain_per_slope: float | None = None
    motion: Motion | None = None
    shear: AbstractShear | None = None
    heating: Heating | None = None
    solver: DouglasRachford
    tolerance: Mapping[str, Any]
    graded_solver: AbstractGradedSolver = Layering()  # noqa: RUF009 (immutable)
    name: str | None = None
    directory: Path | None = None
    fields: Literal["last", "every", "none"] = "last"
    errors: tuple[tuple[str, AbstractMaterial, Errors], ...]
    inputs: tuple[Path, ...]
    notes: tuple[str, ...] = ()

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """What is varied, by name, in the order of the results' axes."""
        found = dict(self.sweep)
        if self.temperature is not None and self.temperature.ndim:
            found["temperature"] = self.temperature
        if isinstance(self.surface, RandomSurface) and self.surface.seeds is not None:
            found["seed"] = self.surface.seed + np.arange(self.surface.seeds)
        if self.approach is None:
            return {**found, "pressure": self.pressure, "velocity": self.velocity}
        return {**found, "approach": self.approach, "velocity": self.velocity}

    @property
    def num_solves(self) -> int:
        """How many combinations there are of what is varied."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def num_times(self) -> int:
        """How many times a solve has: 1 under steady sliding."""
        return 1 if self.motion is None else len(self.motion.displacement)

    def period_at(self, velocity: Any) -> Any:
        """Returns the period of the motion [s] at a highest speed [m/s]."""
        assert self.motion is not None
        own = self.motion.highest_speed
        return self.motion.period * jnp.where(own > 0, own / jnp.where(own > 0, velocity, 1), 1)

    def block(self, point: Mapping[str, Any]) -> Stack:
        """Returns the stack at a point, given by its numbers on the axes; JAX may trace them."""
        values = {path: point[path] for path in self.sweep}
        stack = with_values(self.stack, values) if values else self.stack
        temperature = point.get("temperature", self.temperature)
        return stack if temperature is None else stack.at(temperature)

    def blocks(self) -> Iterator[tuple[dict[str, float], Stack]]:
        """Yields the stacks that differ, each with its numbers of [sweep] and its temperature."""
        axes = {name: at for name, at in self.axes.items() if name in (*self.sweep, "temperature")}
        for numbers in itertools.product(*axes.values()):
            point = dict(zip(axes, numbers, strict=True))
            yield point, self.block(point)


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; the site lists its keys.

    A missing file raises `FileNotFoundError`. An error in the file raises `ValueError` with the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** the scene.
    """
    path = existing_file(path, at_most=LARGEST)
    with within(f"{path}:"):
        return parse_scene(path.read_text(encoding="utf-8"), path.parent)


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
    solver, tolerance, accuracy = reader.arguments(
        "[solver]", tables.solver, keys_of(DouglasRachford), keys_of(_tolerance), KEYS["[solver]"]
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
        full, reason = 2 * np.pi, "an angle [rad] lies between -2π and 2π"
        check_values("direction", load.get("direction", 0.0), reason, at_least=-full, at_most=full)
    with within("[solver]"):
        algorithm = {"solver": DouglasRachford(**solver), "tolerance": _tolerance(**tolerance)}
        for name, rtol in algorithm["tolerance"].items():
            check_tolerance(name, rtol, as_float(load[kind]))
    surface, stack, inputs = (
        surface_source(tables.surface, tables.grid, reader),
        block.stack(tables.layers, tables.base),
        tuple(reader.paths),
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
        **algorithm,
        **load,
        **accuracy,
        **output,
    )
    ends = isinstance(surface, SurfaceFile) and surface.arguments.get("periodic") == "open"
    if found.approach is not None and not (ends or isinstance(surface, Sphere)):
        raise ValueError('[load] `approach` is that of a sphere, or of a file that is "open".')
    _check_motion(found)
    _check_dry(found)
    _check_sweep(found)
    check_points("` x `".join(found.axes), found.num_solves)
    return found


def _tolerance(rtol: float | None = None, friction_rtol: float | None = None) -> dict[str, float]:
    """The tolerance of `slide`, by its name.

    **Arguments:**

    - `rtol`: relative error of the contact pressure [1]; 5e-5 if neither tolerance is given, which
      gives friction to 1e-4.
    - `friction_rtol`: relative error of friction and contact area [1].
    """
    if friction_rtol is None:
        return {"rtol": RTOL if rtol is None else rtol}
    if rtol is not None:
        raise ValueError("Give `rtol` or `friction_rtol`, not both.")
    return {"friction_rtol": friction_rtol}


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
            raise ValueError("`velocity` must be missing: [motion] stays at its place.")


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
            raise ValueError(f"`{path}` is no number of the block; {nearest(path, whole)}")


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
        "[solver]": ("graded_solver",),
        "[output]": ("name", "directory", "fields"),
    }.items()
}
