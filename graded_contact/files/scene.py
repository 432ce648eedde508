"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of arguments of this package, in SI units, angles in radians; a
`kind` names what takes them, see `files/block.py`. Paths are relative to the scene
file, or begin with `~`.

    [surface]             kind = "self_affine": the fields of `SelfAffine` (`q_low` is 2π over the
                          longest edge unless given), `roll_off`, `seed`, `amplitudes`, and a
                          table [grid] with `shape` and `size`; `seeds` = 8 draws as many surfaces,
                          from `seed`, `seed` + 1, ...; or kind = "file": the arguments of
                          `read_surface`, and `rms_height` or `rms_slope` to rescale to
    [materials.NAME]      kind = "elastic", "prony", "prony_creep", "tabulated", "tyre_tread" or
                          "bulk_shear", whose two parts are NAMEs of materials above it; the two
                          series may have `measured` = {omega = [lowest, highest], temperature =
                          [lowest, highest]}, where they follow data; any may have `errors`, the
                          file NAME-errors.csv of `graded-contact fit`: friction has its standard
                          error then, and the frequencies are told that decide it
    [[layers]]            `material` = a NAME, `thickness`; from the loaded surface downwards. A
                          graded one has, instead of `material`, the NAMEs `bottom` and `top`, and
                          may have `shape` ("linear", {kind = "exponential", rate = 2.0}, ...) and
                          `mixing` as in `Blend`
    [base]                kind = "half_space" with a `material`, "rigid" or "free"
    [load]                `pressure` and `velocity`: a number, a list, or {from, to, points},
                          equally spaced in the logarithm; `direction` of the velocity from the
                          x axis (in Python, two numbers are one velocity, (vx, vy));
                          `temperature` [K]: a number, a list, or {from, to, points}, here
                          equally spaced; `extrapolate` = true to allow friction from frequencies
                          at which a material was not measured
    [sweep]               values of numbers of the block, by paths as in `parameters.py`:
                          "layers[0].thickness" = [1e-5, 1e-4], or {from, to, points}, equally
                          spaced in the logarithm; a temperature acts on the block that has them
    [solver]              `rtol` or `friction_rtol`, as in `slide` (`rtol` = 5e-5 if neither is
                          given: friction to 1e-4), the numbers of `DouglasRachford`, and
                          `graded_solver` = "layering" or "riccati", or a table with that `kind` and
                          its `rtol`, for graded layers
    [output]              `name`, `directory`, and which `fields` to keep: "last", "every" or "none"
    [design]              what the command `design` is to do, see `files/design_scene.py`
"""

import dataclasses
import itertools
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, ScalarLike

from ..contact.nested_solve import DouglasRachford
from ..contact.problem import RTOL
from ..core.checks import as_float, check_positive, check_tolerance, check_values
from ..core.display import shown
from ..core.memory import check_points
from ..core.parameters import paths, with_values
from ..response.grading import AbstractGradedSolver
from ..response.layering import Layering
from ..response.stack import Stack
from ..rheology.material import AbstractMaterial
from ..rheology.tabulated import Tabulated
from .block import Block, extremes
from .errors import Errors
from .given import existing_file
from .output import check_name, full_path
from .surfaces import RandomSurface, SurfaceFile, parse_surface
from .toml import LARGEST, Section, nearest, parse_toml, within

KEYS = (
    "title", "surface", "grid", "materials", "layers", "base", "load", "sweep", "solver", "output",
    "design",
)  # fmt: skip
SOLVER_KEYS = tuple(
    field.name for field in dataclasses.fields(DouglasRachford) if field.metadata.get("static")
)
LOAD_KEYS = ("pressure", "velocity", "direction", "temperature", "extrapolate")


@shown("title", "stack", "surface", "sweep", "temperature", "pressure", "velocity")
@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """What to compute, as a scene file says.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for people.
    - `stack`: the block as it is written; `block` is that of a point.
    - `surface`: where the surface comes from; `build_surface` makes it.
    - `sweep`: other values for numbers of the stack, by their paths.
    - `temperature`: one [K], or an axis of them, or None.
    - `pressure`, `velocity`: mean pressures [Pa] and velocities [m/s], one axis each.
    - `direction`: of the velocity from the x axis [rad].
    - `extrapolate`: whether friction may come from where a material was not measured.
    - `solver`: algorithm of the contact.
    - `tolerance`: `friction_rtol` or `rtol` of `slide`, by its name.
    - `graded_solver`: the solver of graded layers.
    - `name`, `directory`: of the output; None leaves them to the caller.
    - `keep`: which fields the results hold: "last", "every" or "none".
    - `errors`: what is known of numbers of materials: name, the material of the stack, and these.
    - `inputs`: the files that the scene names.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile
    sweep: dict[str, Float[np.ndarray, " values"]]
    temperature: Float[np.ndarray, "*temperatures"] | None
    pressure: Float[np.ndarray, " pressures"]
    velocity: Float[np.ndarray, " velocities"]
    direction: float
    extrapolate: bool
    solver: DouglasRachford
    tolerance: Mapping[str, Any]
    graded_solver: AbstractGradedSolver
    name: str | None
    directory: Path | None
    keep: str
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
        return {**found, "pressure": self.pressure, "velocity": self.velocity}

    @property
    def num_solves(self) -> int:
        """How many combinations there are of what is varied."""
        return math.prod(len(values) for values in self.axes.values())

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
    """Returns the scene that a TOML file describes; see the module's text for its keys.

    A missing file raises `FileNotFoundError`; whatever is wrong in it `ValueError`, naming the
    table and the key.

    **Arguments:**

    - `path`: of the TOML file.

    **Returns:** what it describes.
    """
    path = existing_file(path, at_most=LARGEST)
    with within(f"{path}:"):
        return parse_scene(path.read_text(encoding="utf-8"), path.parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    folder = Path(folder)
    scene = Section("the scene", parse_toml(text), KEYS)
    load = Section("[load]", scene.get("load"), LOAD_KEYS)
    solver = Section(
        "[solver]",
        scene.get("solver", {}),
        ("rtol", "friction_rtol", "graded_solver", *SOLVER_KEYS),
    )
    output = Section("[output]", scene.get("output", {}), ("name", "directory", "fields"))
    block = Block(folder)
    temperature = _temperature(load)
    block.read_materials(scene, temperature)
    surface, stack = parse_surface(scene, block.builder), block.stack(scene)
    pressure, velocity = load.axis("pressure"), load.axis("velocity")
    sweep = _sweep(scene, stack, temperature)
    with within(load.place):
        check_positive("pressure", pressure, "[Pa]")
        check_values("velocity", velocity, "a velocity [m/s] must be finite")
        direction = load.number("direction", 0.0)
        full = 2 * np.pi
        reason = "an angle [rad] lies between -2π and 2π"
        check_values("direction", direction, reason, at_least=-full, at_most=full)
    tolerance, graded_solver = block.builder.build(solver, _accuracy)
    with within(solver.place):
        for name, rtol in tolerance.items():
            check_tolerance(name, rtol, as_float(pressure))
    name, directory = output.text("name", None), output.text("directory", None)
    with within(output.place):
        if name is not None:
            check_name(name)
        if directory is not None:
            directory = full_path(directory, folder)
    materials = block.materials.values()
    found = Scene(
        text=text,
        title=scene.text("title", ""),
        stack=stack,
        surface=surface,
        sweep=sweep,
        temperature=temperature,
        pressure=pressure,
        velocity=velocity,
        direction=direction,
        extrapolate=load.truth("extrapolate", False)
        or any(isinstance(m, Tabulated) and m.extrapolate == "plateau" for m in materials),
        solver=block.builder.build(solver, DouglasRachford),
        tolerance=tolerance,
        graded_solver=graded_solver,
        name=name,
        directory=directory,
        keep=output.choice("fields", ("last", "every", "none"), "last"),
        errors=tuple((name, block.materials[name], known) for name, known in block.errors.items()),
        inputs=tuple(block.builder.paths),
        notes=tuple(block.notes),
    )
    check_points("` x `".join(found.axes), found.num_solves)
    return found


def _temperature(load: Section) -> np.ndarray | None:
    if "temperature" not in load.content:
        return None
    content = load.get("temperature")
    if not isinstance(content, list | dict):
        return np.asarray(load.number("temperature"))
    return load.axis("temperature", linear=True)


def _sweep(scene: Section, stack: Stack, temperature: np.ndarray | None) -> dict[str, np.ndarray]:
    """The axes of [sweep]; each of their values must make a block, at each temperature."""
    content = scene.get("sweep", {})
    section = Section("[sweep]", content, content)
    with within(section.place):
        check_paths(content, stack)
        found = {path: section.axis(path) for path in content}
        for path, values in found.items():
            for value in (np.min(values), np.max(values)):  # what is allowed has no gaps
                changed = with_values(stack, {path: value})
                for at in extremes(temperature):
                    changed.at(at)
    return found


def check_paths(given: Iterable[str], stack: Stack) -> None:
    """Raises `ValueError` unless all name numbers of the block."""
    known = paths(stack)
    whole = [path for path in known if not path.endswith("]")]  # entries of arrays are many
    for path in given:
        if path not in known:
            raise ValueError(f"`{path}` is no number of the block; {nearest(path, whole)}")


def _accuracy(
    rtol: ScalarLike | None = None,
    friction_rtol: ScalarLike | None = None,
    graded_solver: AbstractGradedSolver = Layering(),  # noqa: B008 (immutable)
) -> tuple[dict[str, ScalarLike], AbstractGradedSolver]:
    if rtol is not None and friction_rtol is not None:
        raise ValueError("Give `rtol` or `friction_rtol`, not both.")
    if rtol is not None:
        return {"rtol": rtol}, graded_solver
    if friction_rtol is not None:
        return {"friction_rtol": friction_rtol}, graded_solver
    return {"rtol": RTOL}, graded_solver
