"""Scenes: a block, a surface, loads and velocities, as a TOML file describes them.

The keys of a scene are the names of fields and arguments of this package, in SI units, angles in
radians; `KEYS` lists them. Paths are relative to the scene file.

    [surface]             kind = "self_affine": the fields of `SelfAffine` (`q_low` is 2π over the
                          longest edge unless given), `roll_off`, `seed`, `amplitudes`, and a
                          table [grid] with `shape` and `size`; or kind = "file": the arguments of
                          `read_surface`, and `rms_height` or `rms_slope` to rescale to
    [materials.NAME]      kind = "elastic", "prony", "prony_creep", "tabulated" or "tyre_tread"; the
                          two series may have `measured` = {omega = [lowest, highest], temperature =
                          [lowest, highest]}, where they follow data
    [[layers]]            `material` = a NAME, `thickness`; from the loaded surface downwards. A
                          graded one has, instead of `material`, the NAMEs `bottom` and `top`, and
                          may have `shape` ("linear", "sinusoidal") and `mixing` as in `Blend`
    [base]                kind = "half_space" with a `material`, "rigid" or "free"
    [load]                `pressure` and `velocity`: a number, a list, or {from, to, points},
                          equally spaced in the logarithm; `direction` of the velocity from the
                          x axis; `temperature` [K]; `extrapolate` = true to allow friction from
                          frequencies at which a material was not measured
    [solver]              `rtol` and the numbers of `DouglasRachford`
    [output]              `name`, `directory`, and which `fields` to keep: "last", "every" or "none"
    [design]              what the command `design` is to do, see `files/study.py`
"""

import dataclasses
import os
from pathlib import Path
from typing import Any, Literal, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from .._checks import as_float, check_positive, check_tolerance, check_values
from .._memory import check_points
from ..contact.douglas_rachford import DouglasRachford
from ..grid import Grid
from ..response.profile import Blend
from ..response.shape import Linear, Sinusoidal
from ..response.stack import Free, GradedLayer, HalfSpace, Layer, Rigid, Stack
from ..rheology.library import tyre_tread
from ..rheology.material import AbstractMaterial, Elastic, Prony
from ..rheology.measured import MeasuredRange
from ..rheology.shift import WLF, AbstractShift, Arrhenius
from ..rheology.tabulated import Tabulated
from ..rheology.tabulated_shift import TabulatedShift
from ..spectrum import SelfAffine
from ..surface import Surface, random_surface, rescale
from .moduli.quantities import DIMENSIONS, UNITS
from .moduli.reading import read_moduli
from .output import check_name, folder_path
from .toml import Table, nearest, parse_toml, short, within
from .topography.reading import read_surface

READ_ARGUMENTS = ("periodic", "shape", "size", "unit", "region", "fill", "rim", "channel")
SPECTRUM_FIELDS = ("rms_height", "rms_slope", "hurst", "q_low", "q_roll", "q_high")
TABLE_ARGUMENTS = ("columns", "units", "deformation", "sheet")
SHAPES = {"linear": Linear, "sinusoidal": Sinusoidal}
SOLVER_FIELDS = tuple(
    field.name for field in dataclasses.fields(DouglasRachford) if field.metadata.get("static")
)
# The keys of every table; those that have a `kind` list them by kind.
KEYS: dict[str, Any] = {
    "scene": (
        "title", "surface", "grid", "materials", "layers", "base", "load", "solver", "output",
        "design",
    ),
    "surface": {
        "self_affine": (*SPECTRUM_FIELDS, "roll_off", "seed", "amplitudes"),
        "file": ("path", *READ_ARGUMENTS, "rms_height", "rms_slope"),
    },
    "grid": ("shape", "size"),
    "material": {
        "elastic": ("modulus", "poisson"),
        "prony": ("equilibrium", "strengths", "times", "poisson", "shift", "measured"),
        "prony_creep": ("glassy", "compliances", "times", "poisson", "shift", "measured"),
        "tabulated": ("path", *TABLE_ARGUMENTS, "poisson", "extrapolate", "shift"),
        "tyre_tread": ("poisson",),
    },
    "shift": {
        "wlf": ("c1", "c2", "reference"),
        "arrhenius": ("activation_energy", "reference"),
        "tabulated": ("temperatures", "log10_factors", "reference", "vertical_factors"),
    },
    "layers": ("material", "bottom", "top", "shape", "mixing", "thickness"),
    "base": {"half_space": ("material",), "rigid": (), "free": ()},
    "measured": ("omega", "temperature"),
    "load": ("pressure", "velocity", "direction", "temperature", "extrapolate"),
    "solver": ("rtol", *SOLVER_FIELDS),
    "output": ("name", "directory", "fields"),
}  # fmt: skip


class RandomSurface(NamedTuple):
    """A surface to be drawn: arguments of `random_surface`, with the seed of its key."""

    spectrum: SelfAffine
    grid: Grid
    seed: int
    amplitudes: Literal["exact", "gaussian"]

    def build(self) -> Surface:
        """Returns the surface, drawn anew; the same one each time."""
        key = jax.random.key(self.seed)
        with within("[surface]"):
            return random_surface(self.spectrum, self.grid, key, amplitudes=self.amplitudes)


class SurfaceFile(NamedTuple):
    """A surface to be read: its path, arguments of `read_surface` and of `rescale`."""

    path: Path
    arguments: dict[str, Any]
    target: dict[str, float]

    def build(self) -> Surface:
        """Returns the surface, read and rescaled."""
        with within("[surface]"):
            surface = read_surface(self.path, **self.arguments)
            return rescale(surface, **self.target) if self.target else surface


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """What to compute, as a scene file says.

    **Fields:**

    - `text`: the TOML text.
    - `title`: one line for people.
    - `stack`: the block, at the temperature of the scene.
    - `surface`: where the surface comes from; `build_surface` makes it.
    - `pressure`, `velocity`: mean pressures [Pa] and velocities [m/s], one axis each.
    - `direction`: of the velocity from the x axis [rad].
    - `extrapolate`: whether friction may come from where a material was not measured.
    - `solver`, `rtol`: algorithm and wanted relative error.
    - `name`, `directory`: of the output; None leaves them to the caller.
    - `keep`: which fields the results hold: "last", "every" or "none".
    - `inputs`: the files that the scene names.
    - `notes`: what was understood of its tables of moduli, one sentence each.
    """

    text: str
    title: str
    stack: Stack
    surface: RandomSurface | SurfaceFile
    pressure: Float[np.ndarray, " pressures"]
    velocity: Float[np.ndarray, " velocities"]
    direction: float
    extrapolate: bool
    solver: DouglasRachford
    rtol: float
    name: str | None
    directory: Path | None
    keep: str
    inputs: tuple[Path, ...]
    notes: tuple[str, ...] = ()


def read_scene(path: str | os.PathLike) -> Scene:
    """Returns the scene that a TOML file describes; see the module's text for its keys.

    A missing file raises `FileNotFoundError`; whatever is wrong in it `ValueError`, naming the
    table and the key.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    with within(f"{path}:"):
        return parse_scene(path.read_text(encoding="utf-8"), path.parent)


def parse_scene(text: str, folder: str | os.PathLike = ".") -> Scene:
    """Returns the scene that a TOML text describes; its paths are relative to `folder`."""
    folder = Path(folder)
    scene = Table("the scene", parse_toml(text), KEYS["scene"])
    load = Table("[load]", scene.get("load"), KEYS["load"])
    solver = Table("[solver]", scene.get("solver", {}), KEYS["solver"])
    output = Table("[output]", scene.get("output", {}), KEYS["output"])
    materials, inputs, notes = _materials(scene, folder, load)
    surface = _surface(scene, folder)
    if isinstance(surface, SurfaceFile):
        inputs.append(surface.path)
    pressure, velocity = load.values("pressure"), load.values("velocity")
    with within(load.place):
        check_points("pressure` x `velocity", pressure.size * velocity.size)
        check_positive("pressure", pressure, "[Pa]")
        check_values("velocity", velocity, "a velocity [m/s] must be finite")
        direction = load.number("direction", 0.0)
        full = 2 * np.pi
        reason = "an angle [rad] lies between -2π and 2π"
        check_values("direction", direction, reason, at_least=-full, at_most=full)
    rtol = solver.number("rtol", 1e-6)
    with within(solver.place):
        check_tolerance("rtol", rtol, as_float(pressure))
        settings: dict[str, Any] = {
            key: solver.number(key) if key == "relaxation" else solver.whole(key)
            for key in SOLVER_FIELDS
            if key in solver.content
        }
        method = DouglasRachford(**settings)
    name, directory = output.text("name", None), output.text("directory", None)
    with within(output.place):
        if name is not None:
            check_name(name)
        if directory is not None:
            directory = folder_path(directory, folder)
    return Scene(
        text=text,
        title=scene.text("title", ""),
        stack=_stack(scene, materials),
        surface=surface,
        pressure=pressure,
        velocity=velocity,
        direction=direction,
        extrapolate=load.truth("extrapolate", False)
        or any(isinstance(m, Tabulated) and m.extrapolate == "plateau" for m in materials.values()),
        solver=method,
        rtol=rtol,
        name=name,
        directory=directory,
        keep=output.choice("fields", ("last", "every", "none"), "last"),
        inputs=tuple(inputs),
        notes=tuple(notes),
    )


def _materials(
    scene: Table, folder: Path, load: Table
) -> tuple[dict[str, AbstractMaterial], list[Path], list[str]]:
    content = scene.get("materials")
    if not isinstance(content, dict):
        raise ValueError(f"[materials] must hold tables [materials.NAME], got {short(content)}.")
    materials, inputs, notes = {}, [], []
    for name, entry in content.items():
        table, kind = Table.of_kind(f"[materials.{name}]", entry, KEYS["material"])
        if kind == "tabulated":
            inputs.append(folder / table.text("path"))
        with within(table.place):
            materials[name], said = _material(table, kind, folder)
        notes += [f"{name}: {sentence}" for sentence in said]
    if "temperature" in load.content:
        temperature = load.number("temperature")
        for name, material in materials.items():
            with within(f"[load] `temperature`, of [materials.{name}]:"):
                materials[name] = material.at(temperature)
    return materials, inputs, notes


def _material(table: Table, kind: str, folder: Path) -> tuple[AbstractMaterial, tuple[str, ...]]:
    """A material, and what was understood of its file."""
    poisson = table.number("poisson", 0.5)
    if kind == "elastic":
        return Elastic(modulus=table.number("modulus"), poisson=poisson), ()
    if kind == "tyre_tread":
        return tyre_tread(poisson), ()
    shift, measured = _shift(table), _measured(table)
    if kind == "prony":
        relaxing = Prony(
            equilibrium=table.number("equilibrium"),
            strengths=table.numbers("strengths"),
            times=table.numbers("times"),
            poisson=poisson,
            shift=shift,
            measured=measured,
        )
        return relaxing, ()
    if kind == "prony_creep":
        creeping = Prony.from_creep(
            glassy=table.number("glassy"),
            compliances=table.numbers("compliances"),
            times=table.numbers("times"),
            poisson=poisson,
            shift=shift,
            measured=measured,
        )
        return creeping, ()
    place = table.place[:-1]
    columns = Table(f"{place}.columns]", table.get("columns", {}), DIMENSIONS)
    units = Table(f"{place}.units]", table.get("units", {}), UNITS)
    try:
        found = read_moduli(
            folder / table.text("path"),
            kind="frequency",
            columns=columns.content,
            units=units.content,
            deformation=table.text("deformation", None),
            sheet=table.text("sheet", None),
            poisson=poisson,
        )
    except ValueError as error:
        advice = "`graded-contact fit FILE` reads more, and writes a material for a scene."
        raise ValueError(f"{error} {advice}") from error
    omega, modulus = found.table()
    extrapolate = table.choice("extrapolate", ("refuse", "plateau"), "refuse")
    material = Tabulated(omega, modulus, poisson, shift=shift, extrapolate=extrapolate)
    return material, found.history


def _measured(table: Table) -> MeasuredRange | None:
    if "measured" not in table.content:
        return None
    ends = Table(f"{table.place[:-1]}.measured]", table.get("measured"), KEYS["measured"])
    temperature = ends.numbers("temperature") if "temperature" in ends.content else None
    with within(ends.place):
        return MeasuredRange(ends.numbers("omega"), temperature)


def _shift(table: Table) -> AbstractShift | None:
    if "shift" not in table.content:
        return None
    place = f"{table.place[:-1]}.shift]"
    shift, kind = Table.of_kind(place, table.get("shift"), KEYS["shift"])
    if kind == "tabulated":
        return TabulatedShift(
            temperatures=shift.numbers("temperatures"),
            log10_factors=shift.numbers("log10_factors"),
            reference=shift.number("reference"),
            vertical_factors=shift.numbers("vertical_factors", None),
        )
    constants = {key: shift.number(key) for key in KEYS["shift"][kind]}
    return WLF(**constants) if kind == "wlf" else Arrhenius(**constants)


def _surface(scene: Table, folder: Path) -> RandomSurface | SurfaceFile:
    table, kind = Table.of_kind("[surface]", scene.get("surface"), KEYS["surface"])
    target = {key: table.number(key) for key in ("rms_height", "rms_slope") if key in table.content}
    if kind == "file":
        if "grid" in scene.content:
            raise ValueError(
                '[grid] belongs to a surface of kind "self_affine"; the points of a file are '
                "resampled by `shape` in [surface]."
            )
        if len(target) == 2:
            raise ValueError("[surface] takes `rms_height` or `rms_slope` to rescale to, not both.")
        arguments = {key: table.get(key) for key in READ_ARGUMENTS if key in table.content}
        for key in ("periodic", "fill"):
            if arguments.get(key) == "none":  # TOML has no None
                arguments[key] = None
        if "shape" in arguments:
            arguments["shape"] = table.wholes("shape")
        if "size" in arguments:
            sizes = table.numbers("size")
            arguments["size"] = sizes[0] if len(sizes) == 1 else sizes
        if "region" in arguments:
            arguments["region"] = table.numbers("region")
        return SurfaceFile(folder / table.text("path"), arguments, target)
    place = Table("[grid]", scene.get("grid"), KEYS["grid"])
    with within(place.place):
        sizes = place.numbers("size")
        grid = Grid(place.wholes("shape"), sizes[0] if len(sizes) == 1 else sizes)
    seed = table.whole("seed", 0)
    rest: dict[str, Any] = {key: table.number(key) for key in ("hurst", "q_roll", "q_high")}
    rest["q_low"] = table.number("q_low", 2 * np.pi / float(np.max(grid.size)))
    rest["roll_off"] = table.choice("roll_off", ("sharp", "smooth"), "sharp")
    with within(table.place):
        spectrum = SelfAffine(**target, **rest)
    amplitudes = table.choice("amplitudes", ("exact", "gaussian"), "exact")
    return RandomSurface(spectrum, grid, seed, amplitudes)


def _stack(scene: Table, materials: dict[str, AbstractMaterial]) -> Stack:
    entries = scene.get("layers", [])
    if not isinstance(entries, list):
        raise ValueError(f"`layers` must be a list of tables [[layers]], got {short(entries)}.")

    def named(table: Table, key: str = "material") -> AbstractMaterial:
        name = table.text(key)
        if name not in materials:
            raise ValueError(
                f"{table.place} `{key}` = {name!r} is not in [materials]; "
                f"{nearest(name, materials)}"
            )
        return materials[name]

    def layer(table: Table) -> Layer | GradedLayer:
        thickness = table.number("thickness")
        if "bottom" not in table.content and "top" not in table.content:
            return Layer(named(table), thickness)
        if "material" in table.content:
            raise ValueError(f"{table.place} has `material` besides `bottom` or `top`: give one.")
        shape = SHAPES[table.choice("shape", tuple(SHAPES), "linear")]
        mixing = table.choice("mixing", ("linear", "logarithmic"), "linear")
        profile = Blend(named(table, "bottom"), named(table, "top"), shape(), mixing)
        return GradedLayer(profile, thickness)

    layers = []
    for i, entry in enumerate(entries):
        table = Table(f"[layers[{i}]]", entry, KEYS["layers"])
        with within(table.place):
            layers.append(layer(table))
    table, kind = Table.of_kind("[base]", scene.get("base"), KEYS["base"])
    base = (
        HalfSpace(named(table)) if kind == "half_space" else {"rigid": Rigid, "free": Free}[kind]()
    )
    with within(table.place):
        return Stack(layers=layers, base=base)
